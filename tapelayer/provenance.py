"""Provenance: what a program was made from, as its header states it."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from typing import NamedTuple

from tapelayer.errors import InputFault, ProgramOfOtherSetup, SetupRefused

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


def moment(clock: float, epoch: str | None = None) -> str:
    """Return a moment in UTC as a report states it (ISO 8601, whole seconds).

    Args:
        clock: seconds since 1970, as `time.time` gives them.
        epoch: value of SOURCE_DATE_EPOCH, which goes before the clock so that files can be made again byte by byte
            (https://reproducible-builds.org/specs/source-date-epoch).

    Raises:
        SetupRefused: the value is no number of seconds.

    Examples:
        >>> moment(1767225600.9), moment(0.0, "1767225600")
        ('2026-01-01T00:00:00Z', '2026-01-01T00:00:00Z')
    """
    try:
        seconds = int(clock) if epoch is None else int(epoch)
        return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):
        sentence = f"expected whole seconds since 1970, got {epoch!r}; set it to such a number, or unset it"
        raise SetupRefused("SOURCE_DATE_EPOCH", [InputFault(0, sentence)]) from None


class NamedFile(NamedTuple):
    """A file that went into a program.

    Attributes:
        name: base name; empty where there is no file.
        sha256: SHA-256 of its bytes, hexadecimal.
    """

    name: str
    sha256: str


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
        more_sources: further files beside the input that went into the program.
    """

    source: str
    source_sha256: str
    setup_sha256: str
    version: str
    notes: tuple[str, ...] = ()
    not_judged: tuple[str, ...] = ()
    more_sources: tuple[NamedFile, ...] = ()

    @property
    def sources(self) -> tuple[NamedFile, ...]:
        """Return all files that went into the program, the input first."""
        return (NamedFile(self.source, self.source_sha256), *self.more_sources)

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
