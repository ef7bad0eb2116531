"""Separators: how other programs than ours spell columns and decimals, told from a course file's own lines."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tapelayer.courses.table import NUMBER

_POINT = re.compile(
    rb"^[ \t]*%b(?:[ \t]+%b){6}[ \t]*$" % (NUMBER.pattern, NUMBER.pattern), re.MULTILINE
)  # seven numbers between blanks


@dataclass(frozen=True)
class Separators:
    """A spelling of numbers and columns that is not that of a course file.

    Attributes:
        fault: what is wrong.
        remedy: what to do.
        signs: the signs of it that stand for others.
        meant: for each sign, what a course file has in its place.
    """

    fault: str
    remedy: str
    signs: bytes
    meant: bytes

    def respelt(self, text: bytes) -> bytes:
        """Return a text spelt as a course file is; its lines keep their numbers."""
        return text.translate(bytes.maketrans(self.signs, self.meant))


_BLANKS, _POINTS = "separate columns by blanks", "write decimal points"
SPELLINGS = (
    Separators("columns are separated by semicolons", _BLANKS, b";", b" "),
    Separators("columns are separated by commas", _BLANKS, b",", b" "),
    Separators("numbers have decimal commas", _POINTS, b",", b"."),
    Separators(
        "columns are separated by semicolons and numbers have decimal commas",
        "separate columns by blanks and write decimal points",
        b";,",
        b" .",
    ),
)


def separators_of(text: bytes) -> Separators | None:
    r"""Return the spelling with which most lines of a text become points; None where none makes one more.

    Examples:
        >>> separators_of(b"1\nstart\n45\n0,5 0 0 0 0 1 0\nend\n").fault
        'numbers have decimal commas'
        >>> separators_of(b"0,5\n") is None
        True
    """
    if b"," not in text and b";" not in text:
        return None
    points = [len(_POINT.findall(spelling.respelt(text))) for spelling in SPELLINGS]
    best = max(points)
    return SPELLINGS[points.index(best)] if best > len(_POINT.findall(text)) else None
