"""Course files, the paper's Table 3: bytes to courses and back; no other module knows the format.

A file holds courses one after another. A course is its number, `start`, the cut angle (or one for the start and one for
the end) in degrees, a line `x y z nx ny nz l` per point (in the part's frame, normal, arc length), and `end`. Lengths
are in mm unless the reader is told another unit.
Text after `#` on a line is a comment in any encoding; keywords may be in any case; lines end with LF, CRLF or CR.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.atomic_files import write_files
from tapelayer.courses.course import Course
from tapelayer.courses.fast_numbers import NeedsCare, values_of_words
from tapelayer.courses.fault_finding import careful_table
from tapelayer.courses.normal_check import NormalCheck
from tapelayer.courses.table import LONGEST_LINE, CourseTable, TableSteps, cut_angle, from_mm, in_mm
from tapelayer.errors import CourseFileRefused
from tapelayer.text import plain_text
from tapelayer.units import METRES, MM, Unit

_BATCH = 1 << 18  # bytes of numbers processed at once, so that they stay in a core's cache
# Older C libraries print non-numbers as 1.#QNAN, -1.#IND or 1.#INF, where # begins no comment.
_COMMENT = re.compile(rb"(?<![0-9]\.)#[^\n]*")
_HEAD = re.compile(
    rb"[ \t\n]*([0-9]{1,9})[ \t]*\n[ \t\n]*start[ \t]*\n[ \t\n]*([-+.0-9e]+)(?:[ \t]+([-+.0-9e]+))?[ \t]*\n"
)
_TAIL = re.compile(rb"end[ \t]*(?:\n|\Z)")
_CAPITALS = (b"S", b"T", b"A", b"R", b"E", b"N", b"D")


def read_courses(path: Path | str, unit: Unit = "mm") -> tuple[Course, ...]:
    """Read the courses of a file, in file order: points and arc lengths in metres in the part's frame, unit normals.

    Args:
        path: the file.
        unit: of its lengths.

    Raises:
        CourseFileRefused: the file cannot be read or is not a course file; all faults at once.
    """
    name = str(path)
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise CourseFileRefused.unreadable(name, error) from None
    return parse_courses(data, name, unit)


def parse_courses(data: bytes, name: str, unit: Unit = "mm") -> tuple[Course, ...]:
    r"""Return the courses in the bytes of a file, as `read_courses`.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: of its lengths; messages give them in mm.

    Raises:
        CourseFileRefused: as `read_courses`.

    Examples:
        >>> (course,) = parse_courses(b"1\nstart\n45\n0 0 0 0 0 1 0\n100 0 0 0 0 1 100\nend\n", "one.txt")
        >>> course.points.tolist(), course.arc_lengths.tolist()
        ([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], [0.0, 0.1])
        >>> [round(math.degrees(angle), 6) for angle in course.cut_angles]
        [45.0, 45.0]
    """
    text = plain_text(data, name, CourseFileRefused)
    if b"#" in text:
        text = _COMMENT.sub(b"", text)
    scale = METRES[unit] / MM
    try:
        return _courses(quick_table(text, scale))
    except NeedsCare:
        return _courses(careful_table(text, name, scale))


def format_courses(courses: Iterable[Course]) -> bytes:
    """Return the text of a course file; every double that a course file can hold reads back as the same double.

    Examples:
        >>> points, normals = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
        >>> course = Course(1, points, normals, np.array([0.0, 0.1]), (math.pi / 4, math.pi / 2))
        >>> print(format_courses([course]).decode(), end="")
        1
        start
        45.0 90.0
        0.0 0.0 0.0 0.0 0.0 1.0 0.0
        100.0 0.0 0.0 0.0 0.0 1.0 100.0
        end
    """
    parts = []
    for course in courses:
        start, end = _as_written(np.array(course.cut_angles), np.degrees(course.cut_angles), np.radians).tolist()
        angles = f"{start!r}" if course.cut_angles[0] == course.cut_angles[1] else f"{start!r} {end!r}"
        metres = np.column_stack([course.points, course.arc_lengths])
        mm = _as_written(metres, metres * 1000.0, from_mm)
        rows = np.column_stack([mm[:, :3], course.normals, mm[:, 3]])
        # The repr of a nested list has every number in its shortest exact form; only the brackets must go.
        points = repr(rows.tolist())[2:-2].replace("], [", "\n").replace(",", "")
        parts.append(f"{course.number}\nstart\n{angles}\n{points}\nend\n")
    return "".join(parts).encode("ascii")


def write_courses(courses: Iterable[Course], path: Path | str) -> None:
    """Write a course file completely or not at all.

    Raises:
        CourseFileRefused: the courses would make a file that `read_courses` refuses; nothing is written.
        TargetNotWritable: the file cannot be written; any earlier file is left as it was.
    """
    data = format_courses(courses)
    parse_courses(data, str(path))
    write_files({Path(path): data})


def _courses(table: CourseTable) -> tuple[Course, ...]:
    points = from_mm(table.rows[:, :3])
    normals = table.normals
    arc_lengths = from_mm(table.rows[:, 6])
    ends = np.cumsum(table.counts).tolist()
    return tuple(
        Course(number, points[start:end], normals[start:end], arc_lengths[start:end], cut_angles)
        for number, cut_angles, start, end in zip(table.numbers, table.cut_angles, [0, *ends[:-1]], ends, strict=True)
    )


def _as_written(values: Floats, estimate: Floats, read: Callable[[Floats], Floats]) -> Floats:
    """Return values in the file's unit that `read` turns into `values` exactly; the estimate where no double does.

    Where several do, the one with fewest decimals is taken, so that a number typed by hand looks the same.

    Args:
        values: any shape, SI.
        estimate: the same in the file's unit, within two units in the last place.
        read: the conversion that reading applies to a number of the file.
    """
    up, down = np.nextafter(estimate, np.inf), np.nextafter(estimate, -np.inf)
    with np.errstate(over="ignore", invalid="ignore"):
        candidates = [np.nextafter(down, -np.inf), np.nextafter(up, np.inf), down, up, estimate, np.round(estimate, 9)]
    written = estimate.copy()
    for candidate in candidates:
        np.copyto(written, candidate, where=read(candidate) == values)
    return written


def quick_table(text: bytes, scale: float = 1.0) -> CourseTable:
    r"""Return the table of a good file, finding keywords by search and numbers by a few array operations per batch.

    Args:
        text: of the file, without comments.
        scale: millimetres in the unit of its lengths.

    Raises:
        NeedsCare: the file has a fault, or something that only the careful reader can judge.

    Examples:
        >>> table = quick_table(b"1\nstart\n45\n0 0 0 0 0 1 0\n100 0 0 0 0 1 100\nend\n")
        >>> table.numbers, table.counts.tolist(), table.rows[1].tolist()
        ([1], [2], [100.0, 0.0, 0.0, 0.0, 0.0, 1.0, 100.0])
    """
    # Searching for single capitals is cheaper than lower-casing the whole text.
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
        start_angle, end_angle = cut_angle(head[2]), cut_angle(head[3] or head[2])
        if tail is None or head.end() - at > LONGEST_LINE or math.isnan(start_angle + end_angle):
            raise NeedsCare
        numbers.append(int(head[1]))
        cut_angles.append((start_angle, end_angle))
        batch.append(text[head.end() : end])
        size += end - head.end()
        at = tail.end()
        if size > _BATCH:
            _add_batch(batch, counts, rows)
            batch, size = [], 0
    if not numbers or min(numbers) < 1 or text[at:].strip(b" \t\n") or len(set(numbers)) < len(numbers):
        raise NeedsCare
    _add_batch(batch, counts, rows)
    all_rows = in_mm(np.concatenate(rows), scale)
    if not np.all(np.isfinite(all_rows)):
        raise NeedsCare
    table = CourseTable(numbers, cut_angles, np.concatenate(counts), all_rows, np.ones(len(all_rows), dtype=np.bool_))
    steps = TableSteps.of(table)
    if np.any(table.counts < 2) or np.any(table.without_normal) or np.any(steps.standing | steps.falling | steps.off):
        raise NeedsCare
    check = NormalCheck.of(table, steps)
    if check is not None and np.any(check.damaged):
        raise NeedsCare
    return table


def _add_batch(bodies: Sequence[bytes], counts: list[Ints], rows: list[Floats]) -> None:
    """Append the counts (m,) and rows (n, 7) of the points of some courses.

    Raises:
        NeedsCare: a line is too long, does not have seven columns, or has a word that is not a number.
    """
    text = b"".join(bodies)
    if text.translate(None, b"0123456789+-.e \t\n"):
        raise NeedsCare
    characters = np.frombuffer(text, np.uint8)
    blanks = np.flatnonzero(characters <= 32)
    before = np.empty_like(blanks)  # the blank before each blank: a word lies between them where they are not adjacent
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
        raise NeedsCare
    counts.append(np.diff(np.searchsorted(stops, borders), prepend=0) // 7)
    rows.append(values_of_words(text, starts, stops).reshape(-1, 7))
