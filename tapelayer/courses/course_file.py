"""Course files, the paper's Table 3: bytes to courses and back; nothing else knows the format.

A file holds courses one after another. A course is its number, `start`, the cut angle (or one for the start and one for
the end) in degrees, one line `x y z nx ny nz l` a point (mm in the part's frame, normal, arc length in mm), and `end`.
What follows `#` on a line is a comment in any encoding that keeps ASCII; keywords may be in any case; a line ends
with LF, CRLF or CR.
"""

from __future__ import annotations

import math
import re
import warnings
from array import array
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.atomic_files import write_files
from tapelayer.errors import CourseFileRefused, Fault
from tapelayer.geometry.toolpath import Toolpath

CHORD_SHARE = 0.01
"""An arc length may differ from the chord by this share of the chord ..."""
CHORD_SLACK = 0.05e-3
"""... and by this much more, in metres."""
LONGEST_LINE = 1000
"""Characters of a line without its comment; a point takes less than 200 however it is printed."""
MOST_FAULTS = 100_000
"""Lines with a fault after which reading stops."""

_COLUMNS = ("x", "y", "z", "nx", "ny", "nz", "arc length")
_QUOTED = 40
_BATCH = 1 << 18  # bytes of numbers that are worked on at once: they stay in a core's cache
_SHORT = 22  # characters of a word that is read as an integer over a power of ten
_POWERS_OF_TEN = 10.0 ** np.arange(_SHORT)  # a double holds them exactly
_EXACT = 2**53  # a double holds the integers up to here exactly
_LARGEST = 10**18  # a power of ten below the largest 64-bit integer
_SPLITTER = 2.0**27 + 1.0
_MARKS = (b"\xef\xbb\xbf", b"\x84\x31\x95\x33")  # the byte order mark in UTF-8 and in GB18030
# Older C libraries print what is no number as 1.#QNAN, -1.#IND or 1.#INF: there # is no comment.
_COMMENT = re.compile(rb"(?<![0-9]\.)#[^\r\n]*")
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
# Python's float() also takes underscores and the digits of other scripts; a course file's numbers are plain ASCII.
_NUMBER = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_COURSE_NUMBER = re.compile(rb"(?=0*[1-9])[0-9]{1,9}")
_HEAD = re.compile(
    rb"[ \t\n]*([0-9]{1,9})[ \t]*\n[ \t\n]*start[ \t]*\n[ \t\n]*([-+.0-9e]+)(?:[ \t]+([-+.0-9e]+))?[ \t]*\n"
)
_TAIL = re.compile(rb"end[ \t]*(?:\n|\Z)")
_CAPITALS = (b"S", b"T", b"A", b"R", b"E", b"N", b"D")


@dataclass(frozen=True, eq=False)
class Course(Toolpath):
    """One course of tape, in the part's frame.

    Attributes:
        cut_angles: of the cut at the start and at the end, radians from the direction of travel towards the left.
    """

    cut_angles: tuple[float, float]


def read_courses(path: Path | str) -> tuple[Course, ...]:
    """Courses of a file, in file order: points and arc lengths in metres in the part's frame, unit normals.

    Raises:
        CourseFileRefused: the file cannot be read or is no course file; all faults at once.
    """
    name = str(path)
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise CourseFileRefused(name, [Fault(0, f"cannot be read: {(error.strerror or str(error)).lower()}")]) from None
    return parse_courses(data, name)


def parse_courses(data: bytes, name: str) -> tuple[Course, ...]:
    """Courses from the bytes of a file, as `read_courses`.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.

    Raises:
        CourseFileRefused: as `read_courses`.
    """
    text = _plain(data)
    try:
        return _courses(_quick(text))
    except _NeedsCare:
        return _courses(_careful(text, data, name))


def format_courses(courses: Iterable[Course]) -> bytes:
    """Text of a course file; every double that a course file can give is read back as the same double."""
    parts = []
    for course in courses:
        start, end = _as_written(np.array(course.cut_angles), np.degrees(course.cut_angles), np.radians).tolist()
        angles = f"{start!r}" if course.cut_angles[0] == course.cut_angles[1] else f"{start!r} {end!r}"
        metres = np.column_stack([course.points, course.arc_lengths])
        mm = _as_written(metres, metres * 1000.0, _metres)
        rows = np.column_stack([mm[:, :3], course.normals, mm[:, 3]])
        # The text of a nested list has every number in its shortest exact form; only the brackets are in the way.
        points = repr(rows.tolist())[2:-2].replace("], [", "\n").replace(",", "")
        parts.append(f"{course.number}\nstart\n{angles}\n{points}\nend\n")
    return "".join(parts).encode("ascii")


def write_courses(courses: Iterable[Course], path: Path | str) -> None:
    """Write a course file whole or not at all.

    Raises:
        CourseFileRefused: the courses would make a file that `read_courses` refuses; nothing is written.
        TargetNotWritable: the file cannot be written; whatever stood there is untouched.
    """
    data = format_courses(courses)
    parse_courses(data, str(path))
    write_files({Path(path): data})


@dataclass(frozen=True, eq=False)
class _Table:
    """All courses of a file in one table.

    Attributes:
        numbers: (m) course numbers.
        cut_angles: (m) pairs, radians.
        counts: (m,) points of each course.
        rows: (n, 7) points in mm, normals of any length, arc lengths in mm.
        readable: (n,) the row has seven finite numbers; what else stands in another row means nothing.
    """

    numbers: Sequence[int]
    cut_angles: Sequence[tuple[float, float]]
    counts: Ints
    rows: Floats
    readable: Mask

    @property
    def without_normal(self) -> Mask:
        """Rows (n,) whose normal has length zero."""
        zero: Mask = (self.rows[:, 3] == 0.0) & (self.rows[:, 4] == 0.0) & (self.rows[:, 5] == 0.0)
        return zero


@dataclass(frozen=True, eq=False)
class _Steps:
    """From each row of a table to the next.

    Attributes:
        inside: (n - 1,) both rows are of one course and could be read.
        chords: (n - 1,) metres.
        growths: (n - 1,) of the arc length, metres.
    """

    inside: Mask
    chords: Floats
    growths: Floats

    @classmethod
    def of(cls, table: _Table) -> _Steps:
        """Steps of a table."""
        rows = _metres(table.rows[:, [0, 1, 2, 6]])
        inside = np.ones(max(len(rows) - 1, 0), dtype=np.bool_)
        borders = np.cumsum(table.counts)[:-1] - 1
        inside[borders[(borders >= 0) & (borders < len(inside))]] = False
        inside &= table.readable[:-1] & table.readable[1:]
        with np.errstate(over="ignore", invalid="ignore"):
            steps = np.diff(rows, axis=0)
            chords = np.sqrt(np.einsum("ij,ij->i", steps[:, :3], steps[:, :3]))
        return cls(inside, chords, steps[:, 3])

    @property
    def standing(self) -> Mask:
        """Steps (n - 1,) between two rows at one place."""
        return self.inside & ~(self.chords > 0.0)

    @property
    def falling(self) -> Mask:
        """Steps (n - 1,) along which the arc length does not increase."""
        return self.inside & ~(self.growths > 0.0)

    @property
    def off(self) -> Mask:
        """Steps (n - 1,) along which the arc length is not that of the chord."""
        with np.errstate(over="ignore", invalid="ignore"):
            # A chord beyond all doubles allows no difference, rather than every one.
            allowed = np.minimum(CHORD_SHARE * self.chords + CHORD_SLACK, np.finfo(np.float64).max)
            return self.inside & ~(np.abs(self.growths - self.chords) <= allowed)


class _NeedsCare(Exception):
    """The quick way cannot tell that a file is good; the careful way decides."""


def _courses(table: _Table) -> tuple[Course, ...]:
    points = _metres(table.rows[:, :3])
    normals = _units(table.rows[:, 3:6])
    arc_lengths = _metres(table.rows[:, 6])
    ends = np.cumsum(table.counts).tolist()
    return tuple(
        Course(number, points[start:end], normals[start:end], arc_lengths[start:end], cut_angles)
        for number, cut_angles, start, end in zip(table.numbers, table.cut_angles, [0, *ends[:-1]], ends, strict=True)
    )


def _metres(mm: Floats) -> Floats:
    return mm / 1000.0


def _as_written(values: Floats, estimate: Floats, read: Callable[[Floats], Floats]) -> Floats:
    """Values in the file's unit that `read` turns into `values` exactly; where no double does, the estimate.

    Of several, the one with few decimals is taken, so that a number typed by hand keeps its look.

    Args:
        values: any shape, SI.
        estimate: the same in the file's unit, within two units in the last place.
        read: what reading does to a number of the file.
    """
    up, down = np.nextafter(estimate, np.inf), np.nextafter(estimate, -np.inf)
    with np.errstate(over="ignore", invalid="ignore"):
        candidates = [np.nextafter(down, -np.inf), np.nextafter(up, np.inf), down, up, estimate, np.round(estimate, 9)]
    written = estimate.copy()
    for candidate in candidates:
        np.copyto(written, candidate, where=read(candidate) == values)
    return written


def _units(normals: Floats) -> Floats:
    """Unit normals (n, 3); one that is a unit vector already, as far as rounding tells, stays as it is."""
    units = np.ascontiguousarray(normals)
    with np.errstate(over="ignore"):
        squares = np.einsum("ij,ij->i", units, units)
    if np.any(extreme := ~((squares > 1e-200) & (squares < 1e200))):
        units[extreme] /= np.max(np.abs(units[extreme]), axis=1)[:, None]
        squares[extreme] = np.einsum("ij,ij->i", units[extreme], units[extreme])
    done = np.abs(squares - 1.0) <= 8 * np.finfo(np.float64).eps
    units /= np.where(done, 1.0, np.sqrt(squares))[:, None]
    return units


def _plain(data: bytes) -> bytes:
    """The file without mark and comments, lines ended by LF; line numbers stay."""
    for mark in _MARKS:
        data = data.removeprefix(mark)
    if b"#" in data:
        data = _COMMENT.sub(b"", data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def _cut_angle(word: bytes) -> float:
    """Radians, NaN where the word is no angle between 0 and 180 degrees."""
    angle = math.radians(float(word)) if _NUMBER.fullmatch(word) else math.nan
    return angle if 0.0 < angle < math.pi else math.nan


def _quick(text: bytes) -> _Table:
    """Table of a good file: keywords by search, all numbers by a few array operations a batch.

    Raises:
        _NeedsCare: the file has a fault, or something that only the careful way can judge.
    """
    # A letter is looked for sooner than a text is copied, or a word found in it.
    if any(letter in text for letter in _CAPITALS):
        text = text.lower()
    numbers: list[int] = []
    cut_angles: list[tuple[float, float]] = []
    counts: list[Ints] = []
    rows: list[Floats] = []
    batch: list[bytes] = []
    size = at = 0
    while head := _HEAD.match(text, at):
        end = text.find(b"d", head.end()) - 2
        tail = _TAIL.match(text, max(end, 0))
        start_angle, end_angle = _cut_angle(head[2]), _cut_angle(head[3] or head[2])
        if tail is None or head.end() - at > LONGEST_LINE or math.isnan(start_angle + end_angle):
            raise _NeedsCare
        numbers.append(int(head[1]))
        cut_angles.append((start_angle, end_angle))
        batch.append(text[head.end() : end])
        size += end - head.end()
        at = tail.end()
        if size > _BATCH:
            _add_batch(batch, counts, rows)
            batch, size = [], 0
    if not numbers or min(numbers) < 1 or text[at:].strip(b" \t\n") or len(set(numbers)) < len(numbers):
        raise _NeedsCare
    _add_batch(batch, counts, rows)
    all_rows = np.concatenate(rows)
    if not np.all(np.isfinite(all_rows)):
        raise _NeedsCare
    table = _Table(numbers, cut_angles, np.concatenate(counts), all_rows, np.ones(len(all_rows), dtype=np.bool_))
    steps = _Steps.of(table)
    if np.any(table.counts < 2) or np.any(table.without_normal) or np.any(steps.standing | steps.falling | steps.off):
        raise _NeedsCare
    return table


def _add_batch(bodies: Sequence[bytes], counts: list[Ints], rows: list[Floats]) -> None:
    """Add the counts (m,) and rows (n, 7) of the points of some courses.

    Raises:
        _NeedsCare: a line is too long, has not seven columns, or has something that is no number.
    """
    text = b"".join(bodies)
    if text.translate(None, b"0123456789+-.e \t\n"):
        raise _NeedsCare
    characters = np.frombuffer(text, np.uint8)
    blanks = np.flatnonzero(characters <= 32)
    before = np.empty_like(blanks)  # the blank before each blank: a word stands between where they are not neighbours
    before[:1], before[1:] = -1, blanks[:-1]
    words = blanks - before > 1
    starts, stops = before[words] + 1, blanks[words]
    line_ends = characters[blanks] == ord("\n")
    lines = blanks[line_ends]
    columns = np.diff(np.cumsum(words)[line_ends], prepend=0)
    borders = np.cumsum([len(body) for body in bodies])
    closed = all(body.rstrip(b" \t")[-1:] in (b"", b"\n") for body in bodies)
    if (
        not closed
        or 7 * np.count_nonzero(columns) != len(starts)
        or np.any((columns != 0) & (columns != 7))
        or np.any(np.diff(lines, prepend=-1) > LONGEST_LINE)
    ):
        raise _NeedsCare
    counts.append(np.diff(np.searchsorted(stops, borders), prepend=0) // 7)
    rows.append(_values(text, starts, stops).reshape(-1, 7))


def _values(text: bytes, starts: Ints, stops: Ints) -> Floats:
    """Numbers (k,) of the words of a text from `starts` to before `stops` (k,).

    Words of up to 22 characters without exponent, nearly all, go the quick way.

    Raises:
        _NeedsCare: a word is no number.
    """
    characters = np.frombuffer(text, np.uint8)
    long = stops - starts > _SHORT
    if b"e" in text:
        long[np.searchsorted(stops, np.flatnonzero(characters == ord("e")), side="right")] = True
    if not np.any(long):
        return _short_values(text, starts, stops)
    lengths = stops[long] + 1 - starts[long]  # with the blank behind, which keeps the words apart
    ends = np.cumsum(lengths)
    inside = np.arange(ends[-1]) + np.repeat(starts[long] - (ends - lengths), lengths)
    values = np.empty(len(starts))
    values[long] = _scan(characters[inside].tobytes(), np.float64, len(lengths))
    others = characters.copy()
    others[inside] = ord(" ")
    values[~long] = _short_values(others.tobytes(), starts[~long], stops[~long])
    return values


def _short_values(text: bytes, starts: Ints, stops: Ints) -> Floats:
    """Numbers (k,) of words of up to 22 characters without exponent: integers over powers of ten.

    Where a double holds the integer exactly, one division rounds as a careful reading of the text does (Clinger 1990,
    the fast case), at a fraction of its cost.

    Raises:
        _NeedsCare: a word is no number.
    """
    characters = np.frombuffer(text, np.uint8)
    points = np.flatnonzero(characters == ord("."))
    owners: Ints | slice = slice(None)
    if len(points) != len(starts) or np.any((points < starts) | (points >= stops)):
        owners = np.searchsorted(stops, points, side="right")
        if np.any(owners[1:] == owners[:-1]):
            raise _NeedsCare
    minus = characters[starts] == ord("-")
    signs = np.count_nonzero(minus) + np.count_nonzero(characters[starts] == ord("+"))
    if np.count_nonzero(characters == ord("-")) + np.count_nonzero(characters == ord("+")) != signs:
        raise _NeedsCare
    scales = np.ones(len(starts))
    scales[owners] = _POWERS_OF_TEN[stops[owners] - points - 1]
    integers = _scan(text.translate(None, b"."), np.int64, len(starts))
    values: Floats = integers / scales
    values[(integers == 0) & minus] = -0.0
    rounded = np.flatnonzero((integers > _EXACT) | (integers < -_EXACT))
    if len(rounded):
        values[rounded], certain = _quotients(integers[rounded], scales[rounded])
        for word in rounded[~certain].tolist():
            values[word] = float(text[starts[word] : stops[word]])
    return values


def _quotients(integers: Ints, divisors: Floats) -> tuple[Floats, Mask]:
    """Correctly rounded quotients (k,) of integers beyond 2^53, and where (k,) they are certain to be.

    The remainder of a first quotient is found with exact products (Dekker 1971) and divided again; that is certain
    unless the quotient then lies too close to the middle between two doubles, or the integer is one of 19 digits.
    """
    certain = (integers < _LARGEST) & (integers > -_LARGEST)
    integers = np.where(certain, integers, _LARGEST)
    high = integers.astype(np.float64)
    low = (integers - high.astype(np.int64)).astype(np.float64)
    first = high / divisors
    product = first * divisors
    first_high, divisor_high = (_SPLITTER * factor - (_SPLITTER * factor - factor) for factor in (first, divisors))
    first_low, divisor_low = first - first_high, divisors - divisor_high
    error = first_low * divisor_low - (
        ((product - first_high * divisor_high) - first_low * divisor_high) - first_high * divisor_low
    )
    second = ((high - product) + (low - error)) / divisors
    quotients = first + second
    rest = np.abs(second - (quotients - first))
    middle = np.spacing(np.abs(quotients)) / 2
    near = np.minimum(np.abs(rest - middle), np.abs(rest - middle / 2))  # half as wide below a power of two
    return quotients, certain & (near > 1e-6 * middle)


def _scan(text: bytes, kind: type[np.generic], count: int) -> NDArray[Any]:
    """The `count` numbers of a text that ends with a line end or is empty.

    Raises:
        _NeedsCare: there are not as many, or something is no number.
    """
    with warnings.catch_warnings():
        # Depending on its version NumPy raises at a word that is no number, or warns and stops there; then the last
        # number, the zero added here, is missing.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            values = np.fromstring(text + b"0", dtype=kind, sep=" ")
        except ValueError:
            raise _NeedsCare from None
    if len(values) != count + 1:
        raise _NeedsCare
    return values[:-1]


def _careful(text: bytes, data: bytes, name: str) -> _Table:
    """Table of any file, a line at a time.

    Raises:
        CourseFileRefused: with every fault.
    """
    if faults := _no_text(text, data):
        raise CourseFileRefused(name, faults)
    reader = _Reader(text)
    try:
        reader.read()
    except _Hopeless:
        raise CourseFileRefused(name, reader.faults) from None
    table = reader.table()
    faults = sorted([*reader.faults, *_geometric_faults(table, reader)], key=lambda fault: fault.line)
    if faults:
        raise CourseFileRefused(name, faults)
    return table


def _no_text(text: bytes, data: bytes) -> list[Fault]:
    """What keeps the file from being read by lines at all."""
    if not data:
        return [Fault(0, "the file is empty; export the courses again")]
    sample = data[:256]
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or (
        sample.strip(b"\0") and len(sample) > 3 and not (any(sample[1::2]) and any(sample[::2]))
    ):
        return [Fault(0, "the file is in UTF-16 or UTF-32; save it as UTF-8 or plain ASCII")]
    if control := _CONTROL.search(text):
        line = text.count(b"\n", 0, control.start()) + 1
        return [Fault(line, f"byte 0x{control[0][0]:02x} is not text: this is a binary file; expected a course file")]
    return [
        Fault(
            line,
            f"the line has {len(content)} characters, expected at most {LONGEST_LINE}: {_quote(content)}; "
            "this is no course file, or it is damaged: export the courses again",
        )
        for line, content in enumerate(text.split(b"\n"), start=1)
        if len(content) > LONGEST_LINE
    ]


def _quote(text: bytes) -> str:
    """The beginning of a text as a message shows it; what cannot be seen is escaped."""
    start = text[: 4 * _QUOTED]
    try:
        shown = getincrementaldecoder("utf-8")().decode(start)  # which leaves out a character that the cut divides
    except UnicodeDecodeError:
        shown = start.decode("gb18030", errors="replace")
    return repr(shown[:_QUOTED]) + ("..." if len(shown) > _QUOTED or len(text) > len(start) else "")


class _Hopeless(Exception):
    """The file has so many faults that more of them say nothing new."""


class _Reader:
    """Reads a file line by line, keeps every fault and goes on where the next course or point can be.

    Args:
        text: of the file, without comments.
    """

    def __init__(self, text: bytes) -> None:
        self.faults: list[Fault] = []
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
            self.faults.append(Fault(0, f"the file has no course; {expected}: export the courses again"))
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

    def table(self) -> _Table:
        """What was read; rows that could not be read are NaN."""
        rows = np.frombuffer(self.rows, dtype=np.float64).reshape(-1, len(_COLUMNS))
        readable = ~np.any(~np.isfinite(rows), axis=1)
        return _Table(self.numbers, self.cut_angles, np.array(self.counts, dtype=np.int64), rows, readable)

    def _refuse(self, at: int, sentence: str) -> None:
        line = self.line_numbers[at]
        self.faults.append(Fault(line, sentence))
        if len(self.faults) == MOST_FAULTS:
            self.faults.append(Fault(line, "too many faults; the file was read up to here"))
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
        """Read one course from its number, or `start` where that is missing; returns where to go on."""
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
        goes_on = _NUMBER.fullmatch(self.lines[at].split()[0]) is not None or self._is(at, b"end")
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
        angles = [_cut_angle(word) for word in words]
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
        values = [float(word) if _NUMBER.fullmatch(word) else math.nan for word in words]
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


def _geometric_faults(table: _Table, reader: _Reader) -> list[Fault]:
    """Faults of rows that are numbers: zero normals, repeated points, arc lengths that do not fit the points."""
    steps = _Steps.of(table)
    courses = np.repeat(np.arange(len(table.counts)), table.counts)
    points = np.arange(len(courses)) - np.repeat(np.cumsum(table.counts) - table.counts, table.counts) + 1

    def fault(row: int, sentence: str) -> Fault:
        return Fault(reader.row_lines[row], f"{reader.labels[courses[row]]}, point {points[row]}: {sentence}")

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
    return faults
