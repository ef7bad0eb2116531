"""Course files, read the quick way, the careful way, and the obvious way."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.courses import course_file
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import parse_courses
from tapelayer.courses.fast_numbers import NeedsCare
from tapelayer.errors import CourseFileRefused
from tests.helpers.paths import DATA, EXAMPLES

GOOD = sorted((DATA / "courses" / "good").glob("*.txt"))
BAD = sorted((DATA / "courses" / "bad").glob("*.txt"))
EXAMPLE_FILES = sorted(EXAMPLES.glob("*.txt"))
PLAIN = (DATA / "courses" / "good" / "plain.txt").read_bytes()


def assert_same(first: tuple[Course, ...], second: tuple[Course, ...]) -> None:
    """Bit for bit, the signs of zeros included."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert (one.number, one.cut_angles) == (other.number, other.cut_angles)
        for name in ("points", "normals", "arc_lengths"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def quickly(data: bytes) -> tuple[Course, ...]:
    """Courses by the quick way alone.

    Raises:
        NeedsCare: only the careful way can judge the file.
    """
    with patch.object(course_file, "careful_table", side_effect=NeedsCare):
        return parse_courses(data, "f")


def carefully(data: bytes) -> tuple[Course, ...]:
    """Courses by the careful way alone."""
    with patch.object(course_file, "quick_table", side_effect=NeedsCare):
        return parse_courses(data, "f")


def refusal(data: bytes, name: str = "f") -> str:
    with pytest.raises(CourseFileRefused) as caught:
        parse_courses(data, name)
    return str(caught.value)


def by_the_line(data: bytes) -> list[tuple[int, list[float], Floats]]:
    """Numbers, angles in degrees and rows of a good file, read the obvious way."""
    lines = [line.split(b"#")[0].split() for line in data.removeprefix(b"\xef\xbb\xbf").splitlines()]
    lines = [words for words in lines if words]
    found, rows = [], []
    for i, words in enumerate(lines):
        if words[0].lower() == b"start":
            found.append((int(lines[i - 1][0]), [float(word) for word in lines[i + 1]], rows := []))
        elif len(words) == 7:
            rows.append([float(word) for word in words])
    return [(number, angles, np.array(rows)) for number, angles, rows in found]


NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
