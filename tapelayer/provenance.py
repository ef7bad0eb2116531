"""Provenance: what a program was made from, as its header states it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version

from tapelayer.errors import InputFault, ProgramOfOtherSetup

VERSION = version("tapelayer")


@dataclass(frozen=True)
class Provenance:
    """What went into a program; never a path, never a date.

    Attributes:
        source: base name of the input file.
        source_sha256: SHA-256 of the input's bytes, hexadecimal.
        setup_sha256: SHA-256 of the effective setup, hexadecimal.
        version: version of this package.
        notes: further header lines, one comment each.
        not_judged: what no verdict on the program covers.
    """

    source: str
    source_sha256: str
    setup_sha256: str
    version: str
    notes: tuple[str, ...] = ()
    not_judged: tuple[str, ...] = ()

    def check_setup(self, named: str, program: str) -> None:
        """Refuse a program whose header names another setup.

        Args:
            named: SHA-256 of a setup as the header gives it; empty where it gives none.
            program: the program as the user named it.

        Raises:
            ProgramOfOtherSetup: the setups differ.
        """
        if named and named != self.setup_sha256:
            sentence = (
                f"its header names the setup {named[:12]}..., this one is {self.setup_sha256[:12]}...; "
                "give the setup it was made with (options count, too), or judge it by this one with --force"
            )
            raise ProgramOfOtherSetup(program, [InputFault(0, sentence)])

    def remarks(self, named: str, program: str, source: str) -> tuple[str, ...]:
        """Return a sentence where a program's header names another source; nothing elsewhere.

        Args:
            named: SHA-256 of a source as the header gives it; empty where it gives none.
            program: the program as the user named it.
            source: what a source of this kind is called.

        Examples:
            >>> made = Provenance("panel.txt", source_sha256="ab12", setup_sha256="cd34", version="0.1.0")
            >>> made.remarks("ef56", "panel.nc", "course file")
            ('panel.nc: its header names another course file than panel.txt',)
        """
        if not named or named == self.source_sha256:
            return ()
        return (f"{program}: its header names another {source} than {self.source}",)
