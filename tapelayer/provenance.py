"""Provenance: what a program was made from, as its header states it."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from importlib.metadata import version

from tapelayer.errors import InputFault, ProgramOfOtherSetup

VERSION = version("tapelayer")
_SEAL = re.compile(rb"""^[^\n]*\btext[ _]sha256"?: "?([0-9a-f]{64})\b[^\n]*\n""", re.MULTILINE)


def sealed(text: bytes, at: int, before: str, after: str = "") -> bytes:
    r"""Return a text with a line that gives the SHA-256 of all its other lines.

    Args:
        text: without that line.
        at: where the line goes, the start of a line.
        before: what opens the line, before the words; it makes the line a comment, or a value of its own.
        after: what closes the line.

    Examples:
        >>> text = sealed(b"%\nM30\n", 2, "(text sha256: ", ")")
        >>> text[:24], unedited(text), unedited(text.replace(b"M30", b"M02"))
        (b'%\n(text sha256: 64a8274d', True, False)
    """
    line = f"{before}{hashlib.sha256(text).hexdigest()}{after}\n"
    return text[:at] + line.encode("ascii") + text[at:]


def unedited(text: bytes) -> bool:
    """Return whether a text is as it was sealed: its line with a SHA-256 fits all its other lines."""
    seal = _SEAL.search(text)
    if seal is None:
        return False
    rest = text[: seal.start()] + text[seal.end() :]
    return hashlib.sha256(rest).hexdigest().encode("ascii") == seal[1]


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
