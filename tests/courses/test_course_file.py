"""Course files: what is read is what stands there, and what cannot be read is named."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses, read_courses, write_courses
from tapelayer.courses.fast_numbers import NeedsCare
from tapelayer.courses.normal_check import NormalCheck
from tapelayer.errors import CourseFileRefused, TargetNotWritable
from tests.helpers.course_files import (
    BAD,
    EXAMPLE_FILES,
    GOOD,
    NUMBERS,
    PLAIN,
    assert_same,
    by_the_line,
    carefully,
    quickly,
)
from tests.helpers.parts import real_courses
from tests.helpers.plies import courses_of
from tests.helpers.surfaces import flat_course


def test_there_are_files_to_test_with() -> None:
    assert len(GOOD) >= 5 and len(BAD) >= 49 and len(EXAMPLE_FILES) == 5


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLE_FILES], ids=lambda path: path.stem)
def test_what_is_read_is_what_stands_there(path: Path) -> None:
    courses = read_courses(path)
    expected = by_the_line(path.read_bytes())
    assert len(courses) == len(expected) > 0
    for course, (number, angles, rows) in zip(courses, expected, strict=True):
        assert course.number == number
        assert course.cut_angles == (math.radians(angles[0]), math.radians(angles[-1]))
        assert np.array_equal(course.points, rows[:, :3] / 1000.0)
        assert np.array_equal(course.arc_lengths, rows[:, 6] / 1000.0)
        assert np.all(np.abs(np.linalg.norm(course.normals, axis=1) - 1.0) <= 4e-16)
        assert np.all(np.abs(np.cross(course.normals, rows[:, 3:6])) <= 4e-16 * np.abs(rows[:, 3:6]).max())
        assert np.all(np.sum(course.normals * rows[:, 3:6], axis=1) > 0.0)


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLE_FILES], ids=lambda path: path.stem)
def test_quick_and_careful_ways_agree_on_files(path: Path) -> None:
    assert_same(quickly(path.read_bytes()), carefully(path.read_bytes()))


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLE_FILES], ids=lambda path: path.stem)
def test_files_make_the_round_trip(path: Path) -> None:
    courses = read_courses(path)
    text = format_courses(courses)
    again = quickly(text)
    assert_same(again, courses)
    assert format_courses(again) == text


@pytest.mark.parametrize("name", ["bracket", *real_courses("GEBracket_151")])
def test_many_close_points_make_the_round_trip(name: str) -> None:
    text = format_courses(courses_of(name))
    courses = quickly(text)
    assert sum(len(course.points) for course in courses) > 2000
    assert format_courses(courses) == text
    assert_same(quickly(format_courses(courses)), courses)


def test_numbers_of_a_file_keep_their_look() -> None:
    text = format_courses(read_courses(EXAMPLE_FILES[0])).decode().splitlines()
    written = [line.split() for line in text if line.count(" ") == 6]
    original = [line.split() for line in EXAMPLE_FILES[0].read_text().splitlines() if line.count(" ") == 6]
    assert [[float(row[i]) for i in (0, 1, 2, 6)] for row in original] == [
        [float(row[i]) for i in (0, 1, 2, 6)] for row in written
    ]
    assert max(len(row[i]) for row in written for i in (0, 1, 2, 6)) <= len("1234.1234")


def test_arrays_cannot_be_changed() -> None:
    for array in (quickly(PLAIN)[0].points, quickly(PLAIN)[0].normals, quickly(PLAIN)[0].arc_lengths):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


VARIANTS = {
    "CRLF": PLAIN.replace(b"\n", b"\r\n"),
    "CR": PLAIN.replace(b"\n", b"\r"),
    "mixed line ends": PLAIN.replace(b"\n", b"\r\n", 3).replace(b"end\n", b"end\r"),
    "UTF-8 mark": b"\xef\xbb\xbf" + PLAIN,
    "GB18030 mark": b"\x84\x31\x95\x33" + PLAIN,
    "UTF-16": PLAIN.decode().encode("utf-16"),
    "UTF-16 without mark": PLAIN.decode().encode("utf-16-be"),
    "end mark of DOS": PLAIN + b"\x1a",
    "upper case": PLAIN.upper(),
    "mixed case": PLAIN.replace(b"start", b"StArT").replace(b"end", b"eNd"),
    "tabs": PLAIN.replace(b" ", b"\t"),
    "many blanks": PLAIN.replace(b" ", b" \t  ").replace(b"\n", b" \t\n\t "),
    "blank lines": b"\n\n" + PLAIN.replace(b"\n", b"\n \n\n"),
    "no last line end": PLAIN[:-1],
    "comment lines": b"# courses\n" + PLAIN.replace(b"\n", b"\n  # start end 1 2 3\n"),
    "comments behind": PLAIN.replace(b"\n", b" # start end 1 2 3\n"),
    "comments without blank": PLAIN.replace(b"\n", b"#end\n"),
    "UTF-8 comments": PLAIN.replace(b"\n", " # 铺带轨迹 ½ é\n".encode()),
    "GB18030 comments": PLAIN.replace(b"\n", " # 铺带轨迹 ½ é \U00020000\n".encode("gb18030")),
    "comments of no encoding": PLAIN.replace(b"\n", b" #\xff\xfe\x80\x00\x1b\n"),
    "long comment": PLAIN.replace(b"\n", b" #" + 5000 * b"-" + b"\n", 5),
    "normals of another length": PLAIN.replace(b"0.000000 0.000000 1.000000", b"0 0 17e-30"),
    "more digits": PLAIN.replace(b"4.0000", b"4.000000000000000000000000"),
    "angle twice": PLAIN.replace(b"60\n", b"60 60.0\n"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_variants_read_as_the_plain_file_without_need_of_care(name: str) -> None:
    assert_same(quickly(VARIANTS[name]), quickly(PLAIN))
    assert_same(carefully(VARIANTS[name]), quickly(PLAIN))


def test_a_file_cut_anywhere_is_refused_or_ends_with_a_whole_course() -> None:
    data = PLAIN.replace(b"\n", b" # c\r\n")
    courses = parse_courses(data, "f")
    whole = 0
    for cut in range(len(data)):
        try:
            found = parse_courses(data[:cut], "f")
        except CourseFileRefused:
            continue
        whole += 1
        assert data[:cut].rstrip(b" #c\r\n").endswith(b"end")
        assert_same(found, courses[: len(found)])
    assert whole == 2 * len(b" # c\r\n") + 1  # from behind each `end` to before the next word


@given(st.data())
def test_ways_agree_on_damaged_files(data: st.DataObject) -> None:
    """What the quick way takes, the careful way takes with the same result; what neither takes is named."""
    damaged = bytearray(data.draw(st.sampled_from([PLAIN, GOOD[-1].read_bytes(), VARIANTS["comments behind"]])))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        length = data.draw(st.integers(0, 3))
        damaged[at : at + length] = data.draw(
            st.text("0123456789+-.eE #_\n\r\tnxadstr", max_size=3).map(str.encode) | st.binary(max_size=1)
        )
    try:
        expected = carefully(bytes(damaged))
    except CourseFileRefused as refused:
        with pytest.raises(NeedsCare):
            quickly(bytes(damaged))
        assert refused.faults and str(refused).startswith("f:")
    else:
        assert_same(parse_courses(bytes(damaged), "f"), expected)


def written(metres: Floats) -> Floats:
    """The numbers that stand in a file, in mm, for lengths (n,) in metres."""
    columns = np.column_stack([metres, metres, metres])
    course = Course(1, columns, np.tile([0.0, 0.0, 1.0], (len(metres), 1)), metres, (1.0, 1.0))
    (found,) = by_the_line(format_courses([course]))
    assert np.array_equal(found[2][:, :3], found[2][:, [6, 6, 6]])
    numbers: Floats = found[2][:, 6]
    return numbers


STYLES = st.sampled_from(["%.4f", "%.6f", "%r", "%.17g", "%e", "%+.3f", "%.0f"])


@st.composite
def files(draw: st.DrawFn) -> bytes:
    """Good course files in many styles."""
    parts = []
    for number in draw(st.lists(st.integers(1, 999_999_999), min_size=1, max_size=4, unique=True)):
        style, arc_style = draw(STYLES), draw(st.sampled_from(["%.4f", "%r"]))
        angles = " ".join(draw(st.lists(st.floats(1e-300, 179.999999).map(repr), min_size=1, max_size=2)))
        parts.append(f"{number}\n{draw(st.sampled_from(['start', 'START', 'Start']))}\n{angles}\n")
        point = np.array(draw(st.tuples(*3 * [st.floats(-5000.0, 5000.0)])))
        length, before = draw(st.floats(-100.0, 100.0)), None
        for _ in range(draw(st.integers(2, 6))):
            words = [style % value for value in point.tolist()]
            here = np.array([float(word) for word in words])
            length += 0.0 if before is None else float(np.linalg.norm(here - before)) * draw(st.floats(0.991, 1.009))
            normal = draw(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(any))
            parts.append(" ".join([*words, *map(repr, normal), arc_style % length]) + "\n")
            before = here
            step = np.array(draw(st.tuples(*3 * [st.floats(-50.0, 50.0)])))
            point = point + step + np.copysign(2.0, step)
        parts.append("end\n")
    return "".join(parts).encode()


@given(files())
def test_any_good_file_makes_the_round_trip(data: bytes) -> None:
    # Normals drawn by chance are those of no surface.
    with patch.object(NormalCheck, "of", return_value=None):
        courses = quickly(data)
        assert_same(carefully(data), courses)
        text = format_courses(courses)
        again = quickly(text)
        assert_same(again, courses)
        assert format_courses(again) == text


@given(st.lists(NUMBERS, min_size=1))
def test_a_length_of_a_file_is_written_as_the_same_double(mm: list[float]) -> None:
    metres = np.array(mm) / 1000.0
    assert (written(metres) / 1000.0).tobytes() == metres.tobytes()


@given(st.lists(st.floats(-1e300, 1e300), min_size=1))
def test_any_length_is_written_within_its_last_place_and_then_stays(values: list[float]) -> None:
    metres = np.array(values)
    again = written(metres) / 1000.0
    assert np.all(np.abs(again - metres) <= np.spacing(np.abs(metres)))
    assert written(again).tobytes() == written(metres).tobytes()


@given(st.floats(0.0, 180.0), st.floats(0.0, 180.0))
def test_an_angle_of_a_file_is_written_as_the_same_double(start: float, end: float) -> None:
    angles = (math.radians(start), math.radians(end))
    words = by_the_line(format_courses([replace(flat_course(), cut_angles=angles)]))[0][1]
    assert (math.radians(words[0]), math.radians(words[-1])) == angles
    assert len(words) == 1 + (angles[0] != angles[1])


def test_whole_degrees_stay_whole() -> None:
    for degrees in range(1, 180):
        course = Course(1, np.eye(3)[:2], np.eye(3)[:2], np.array([0.0, math.sqrt(2)]), 2 * (math.radians(degrees),))
        assert format_courses([course]).splitlines()[2] == f"{degrees}.0".encode()


@pytest.mark.parametrize(
    ("path", "reason"), [("missing.txt", "no such file or directory"), (".", "is a directory")], ids=["missing", "dir"]
)
def test_a_file_that_cannot_be_opened_is_named(tmp_path: Path, path: str, reason: str) -> None:
    with pytest.raises(CourseFileRefused) as caught:
        read_courses(tmp_path / path)
    assert str(caught.value) == f"{tmp_path / path}: cannot be read: {reason}"


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    courses = quickly(PLAIN)
    write_courses(courses, tmp_path / "courses.txt")
    assert_same(read_courses(tmp_path / "courses.txt"), courses)
    assert [path.name for path in tmp_path.iterdir()] == ["courses.txt"]


def test_courses_that_cannot_be_read_are_not_written(tmp_path: Path) -> None:
    course = quickly(PLAIN)[0]
    points = course.points.copy()
    points[1, 2] = math.nan
    target = tmp_path / "courses.txt"
    target.write_bytes(b"as before")
    for courses, sentence in (
        ([], "the file is empty"),
        ([Course(7, points, course.normals, course.arc_lengths, course.cut_angles)], "course 7, point 2: .* z, got"),
        ([course, course], "course 1: expected a number of its own"),
        ([Course(7, course.points, course.normals, course.arc_lengths, (1.0, math.nan))], "course 7: expected the cut"),
    ):
        with pytest.raises(CourseFileRefused, match=sentence):
            write_courses(courses, target)
        assert target.read_bytes() == b"as before"


def test_a_target_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(TargetNotWritable) as caught:
        write_courses(quickly(PLAIN), tmp_path / "missing" / "courses.txt")
    assert str(caught.value).startswith(f"{tmp_path / 'missing' / 'courses.txt'}: cannot be written: no such file")
