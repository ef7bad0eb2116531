"""Fault finding: a course file read line by line, to state what is wrong with it and where."""

from __future__ import annotations

import math
import re
from array import array
from codecs import getincrementaldecoder

import numpy as np

from tapelayer.courses.normal_check import NormalCheck
from tapelayer.courses.separators import Separators, separators_of
from tapelayer.courses.table import (
    CHORD_SHARE,
    CHORD_SLACK,
    LONGEST_LINE,
    NUMBER,
    CourseTable,
    TableSteps,
    cut_angle,
    in_mm,
)
from tapelayer.errors import CourseFileRefused, InputFault
from tapelayer.vectors import ramp

# Lines with a fault after which reading stops.
MOST_FAULTS = 100_000

_COLUMNS = ("x", "y", "z", "nx", "ny", "nz", "arc length")
_QUOTED = 40
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_COURSE_NUMBER = re.compile(rb"(?=0*[1-9])[0-9]{1,9}")


def careful_table(text: bytes, name: str, scale: float = 1.0) -> CourseTable:
    r"""Return the table of any file, read one line at a time.

    Args:
        text: of the file, without comments.
        name: the file as the user named it.
        scale: millimetres in the unit of its lengths.

    Raises:
        CourseFileRefused: with every fault.

    Examples:
        >>> text = b"1\nstart\n200\n0 0 0 0 0 1 0\n100 0 0 0 0 1\nend\n"
        >>> careful_table(text, "one.txt")
        Traceback (most recent call last):
            ...
        tapelayer.errors.CourseFileRefused: one.txt:3: course 1: expected the cut angle in degrees, or ...
    """
    if faults := _no_text(text):
        raise CourseFileRefused(name, faults)
    spelling = separators_of(text)
    reader = _Reader(text if spelling is None else spelling.respelt(text))
    if spelling is not None:
        reader.faults.append(_of_spelling(text, spelling))
    try:
        reader.read()
    except _Hopeless:
        raise CourseFileRefused(name, reader.faults) from None
    table = reader.table(scale)
    faults = sorted([*reader.faults, *_geometric_faults(table, reader)], key=lambda fault: fault.line)
    if faults:
        raise CourseFileRefused(name, faults)
    return table


def _no_text(text: bytes) -> list[InputFault]:
    """Return the faults that keep a file from being read by lines at all."""
    if not text:
        return [InputFault(0, "the file is empty; export the courses again")]
    if control := _CONTROL.search(text):
        line = text.count(b"\n", 0, control.start()) + 1
        return [
            InputFault(line, f"byte 0x{control[0][0]:02x} is not text: this is a binary file; expected a course file")
        ]
    return [
        InputFault(
            line,
            f"the line has {len(content)} characters, expected at most {LONGEST_LINE}: {_quote(content)}; "
            "this is no course file, or it is damaged: export the courses again",
        )
        for line, content in enumerate(text.split(b"\n"), start=1)
        if len(content) > LONGEST_LINE
    ]


def _of_spelling(text: bytes, spelling: Separators) -> InputFault:
    """Return the one fault of all lines that are spelt in another way."""
    lines = [row for row, line in enumerate(text.split(b"\n"), 1) if line.translate(None, spelling.signs) != line]
    sentence = f"{spelling.fault} (on {len(lines)} line{'s' if len(lines) > 1 else ''}); {spelling.remedy}"
    return InputFault(lines[0], sentence)


def _quote(text: bytes) -> str:
    """Return the beginning of a text for a message, with invisible characters escaped."""
    start = text[: 4 * _QUOTED]
    try:
        shown = getincrementaldecoder("utf-8")().decode(start)  # which drops a character split by the cut
    except UnicodeDecodeError:
        shown = start.decode("gb18030", errors="replace")
    return repr(shown[:_QUOTED]) + ("..." if len(shown) > _QUOTED or len(text) > len(start) else "")


class _Hopeless(Exception):
    """The file has so many faults that more of them would add nothing."""


class _Reader:
    """Reads a file line by line, records every fault and resumes at the next possible course or point.

    Args:
        text: of the file, without comments.
    """

    def __init__(self, text: bytes) -> None:
        self.faults: list[InputFault] = []
        lines = text.split(b"\n")
        self.line_numbers = array("q", (i for i, line in enumerate(lines, start=1) if line.strip()))
        self.lines = [line for line in map(bytes.strip, lines) if line]
        self.numbers: list[int] = []
        self.cut_angles: list[tuple[float, float]] = []
        self.counts: list[int] = []
        self.rows = array("d")
        self.row_lines = array("q")
        self.labels: list[str] = []
        self._first_lines: dict[int, int] = {}

    def read(self) -> None:
        """Read all lines."""
        if not self.lines:
            expected = "expected a course number, `start`, a cut angle, points and `end`"
            self.faults.append(InputFault(0, f"the file has no course; {expected}: export the courses again"))
        at = 0
        while at < len(self.lines):
            if not self._is_number(at):
                self._refuse(
                    at,
                    "expected a course number (a whole number from 1, of at most 9 digits) alone on its line before "
                    f"`start`, got {self._got(at)}; give each course a number and close it with `end`",
                )
            while at < len(self.lines) and not self._is_number(at) and not self._is(at, b"start"):
                at += 1
            if at < len(self.lines):
                at = self._course(at)

    def table(self, scale: float) -> CourseTable:
        """Return the table read so far, from lengths of `scale` millimetres; rows that could not be read are NaN."""
        rows = in_mm(np.frombuffer(self.rows, dtype=np.float64).reshape(-1, len(_COLUMNS)), scale)
        readable = ~np.any(~np.isfinite(rows), axis=1)
        return CourseTable(self.numbers, self.cut_angles, np.array(self.counts, dtype=np.int64), rows, readable)

    def _refuse(self, at: int, sentence: str) -> None:
        line = self.line_numbers[at]
        self.faults.append(InputFault(line, sentence))
        if len(self.faults) == MOST_FAULTS:
            self.faults.append(InputFault(line, "too many faults; the file was read up to here"))
            raise _Hopeless

    def _is(self, at: int, keyword: bytes) -> bool:
        return at < len(self.lines) and self.lines[at].lower() == keyword

    def _is_number(self, at: int) -> bool:
        return _COURSE_NUMBER.fullmatch(self.lines[at]) is not None

    def _got(self, at: int) -> str:
        return _quote(self.lines[at])

    def _cut_off(self, expected: str) -> int:
        self._refuse(
            -1,
            f"{self.labels[-1]}: the file ends before {expected}; it may be cut off: export the courses again",
        )
        return len(self.lines)

    def _course(self, at: int) -> int:
        """Read one course from its number, or from `start` without one, and return the index of the next line."""
        self.counts.append(0)
        self.cut_angles.append((math.nan, math.nan))
        if self._is_number(at):
            self._number(at)
            at += 1
        else:
            self.numbers.append(-1)
            self.labels.append("course without a number")
        for expected, read in (("`start`", self._start), ("the cut angle", self._angles)):
            if at == len(self.lines):
                return self._cut_off(expected)
            at = read(at)
        return self._points(at)

    def _number(self, at: int) -> None:
        number = int(self.lines[at])
        self.numbers.append(number)
        self.labels.append(f"course {number}")
        if number in self._first_lines:
            self._refuse(
                at,
                f"course {number}: expected a number of its own for each course, got that of line "
                f"{self._first_lines[number]} again; renumber one of the two",
            )
        self._first_lines.setdefault(number, self.line_numbers[at])

    def _start(self, at: int) -> int:
        if self._is(at, b"start"):
            return at + 1
        self._refuse(at, f"{self.labels[-1]}: expected `start` after the course number, got {self._got(at)}; add it")
        goes_on = NUMBER.fullmatch(self.lines[at].split()[0]) is not None or self._is(at, b"end")
        return at if goes_on else at + 1

    def _angles(self, at: int) -> int:
        words = self.lines[at].split()
        expected = f"{self.labels[-1]}: expected the cut angle in degrees, or one for each end,"
        if self._is(at, b"end") or len(words) == len(_COLUMNS):
            self._refuse(at, f"{expected} before the points, got {self._got(at)}; add it")
            return at
        if len(words) > 2:
            self._refuse(at, f"{expected} got {len(words)} words: {self._got(at)}; correct the line")
            return at + 1
        angles = [cut_angle(word) for word in words]
        if math.isnan(sum(angles)):
            self._refuse(at, f"{expected} greater than 0 and less than 180, got {self._got(at)}; correct it")
        self.cut_angles[-1] = (angles[0], angles[-1])
        return at + 1

    def _points(self, at: int) -> int:
        while not self._is(at, b"end"):
            if at == len(self.lines):
                return self._cut_off("`end`")
            if self._is(at, b"start") or (self._is_number(at) and self._is(at + 1, b"start")):
                self._refuse(
                    at,
                    f"{self.labels[-1]}: expected `end` before the next course, got {self._got(at)}; add it",
                )
                return at
            self._point(at)
            at += 1
        if self.counts[-1] < 2:
            self._refuse(
                at,
                f"{self.labels[-1]}: expected at least 2 points, got {self.counts[-1]}; complete or remove the course",
            )
        return at + 1

    def _point(self, at: int) -> None:
        words = self.lines[at].split()
        values = [float(word) if NUMBER.fullmatch(word) else math.nan for word in words]
        self.counts[-1] += 1
        point = f"{self.labels[-1]}, point {self.counts[-1]}"
        if len(words) != len(_COLUMNS):
            self._refuse(
                at,
                f"{point}: expected 7 columns between blanks (x y z nx ny nz arc length), got {len(words)}: "
                f"{self._got(at)}; correct the line",
            )
            values = [math.nan] * len(_COLUMNS)
        elif not all(map(math.isfinite, values)):
            bad = [i for i, value in enumerate(values) if not math.isfinite(value)]
            got = ", ".join(_quote(words[i]) for i in bad)
            self._refuse(
                at,
                f"{point}: expected a finite number for {', '.join(_COLUMNS[i] for i in bad)}, got {got}; "
                "correct or remove the point",
            )
        self.rows.extend(values)
        self.row_lines.append(self.line_numbers[at])


def _geometric_faults(table: CourseTable, reader: _Reader) -> list[InputFault]:
    """Return the faults of readable rows: zero normals, repeated points, arc lengths that do not fit the points."""
    steps = TableSteps.of(table)
    courses, points = ramp(table.counts)

    def fault(row: int, sentence: str) -> InputFault:
        return InputFault(reader.row_lines[row], f"{reader.labels[courses[row]]}, point {points[row] + 1}: {sentence}")

    faults = [
        fault(row, "expected the direction out of the surface as normal, got one of length zero; correct it")
        for row in np.flatnonzero(table.without_normal).tolist()
    ]
    for step in np.flatnonzero(steps.standing | steps.falling | steps.off).tolist():
        chord, growth = 1000.0 * steps.chords[step], 1000.0 * steps.growths[step]
        if steps.standing[step]:
            sentence = "expected another place than that of the point before, got the same; remove one of the two"
        elif steps.falling[step]:
            first, second = table.rows[step : step + 2, 6].tolist()
            sentence = (
                f"expected an arc length greater than the {first!r} mm of the point before, got {second!r} mm; "
                "measure it again"
            )
        else:
            sentence = (
                f"expected the arc length to grow by the chord of {chord:.4f} mm, within {100 * CHORD_SHARE:g} % + "
                f"{1000 * CHORD_SLACK:g} mm, got {growth:.4f} mm; measure it again"
            )
        faults.append(fault(step + 1, sentence))
    check = NormalCheck.of(table, steps)
    if check is not None:
        faults.extend(fault(row, check.sentence(row)) for row in np.flatnonzero(check.damaged).tolist())
    return faults
