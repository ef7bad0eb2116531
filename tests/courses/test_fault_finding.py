"""Faults of course files: every one is named with its place, in a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from tapelayer.courses import fault_finding
from tapelayer.courses.course_file import format_courses, parse_courses
from tapelayer.errors import CourseFileRefused
from tests.helpers.course_files import BAD, PLAIN, assert_same, quickly, refusal
from tests.helpers.parts import real_course, real_courses
from tests.helpers.surfaces import helix_course


def test_very_long_blank_stretches_need_care_and_are_no_fault() -> None:
    data = 5000 * b"\n" + PLAIN.replace(b"1\nstart", b"1\n" + 3000 * b"\n" + b"start")
    assert_same(parse_courses(data, "f"), quickly(PLAIN))


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_files_are_refused_in_these_words(path: Path) -> None:
    expected = path.with_suffix(".expect").read_text(encoding="utf-8")
    assert refusal(path.read_bytes(), path.name) + "\n" == expected


def test_messages_name_line_and_course() -> None:
    whole_file = {"empty", "only_comments", "utf16"}
    without_course = ("number_", "stray_", "binary", "long_line", "comma_separated", "decimal_comma")
    outside = {path.stem for path in BAD if path.stem.startswith(without_course)}
    for path in BAD:
        for line in path.with_suffix(".expect").read_text(encoding="utf-8").splitlines():
            if path.stem in whole_file:
                assert line.startswith(f"{path.name}: ")
            elif path.stem in outside - {"number_twice"}:
                assert re.match(rf"{path.name}:\d+: ", line)
            else:
                assert re.match(rf"{path.name}:\d+: course \d+[:,] ", line), line


def spoilt(rows: Sequence[int], normal: bytes) -> bytes:
    """A file of one course of 73 points, CRLF line ends, with another normal in some of its rows."""
    lines = format_courses([helix_course(n=73)]).splitlines()
    for row in rows:
        words = lines[row].split()
        lines[row] = b" ".join([*words[:3], normal, words[6]])
    return b"\r\n".join([*lines, b""])


@pytest.mark.parametrize(
    "data",
    [
        lambda: spoilt(range(3, 63), b"-nan(ind) -nan(ind) -nan(ind)"),
        *(real_course(name).read_bytes for name in real_courses("bad_nan_normal")),
    ],
)
def test_many_undefined_normals_are_named(data: Callable[[], bytes]) -> None:
    with pytest.raises(CourseFileRefused) as caught:
        parse_courses(data(), "f")
    assert [fault.line for fault in caught.value.faults] == list(range(4, 64))
    lines = str(caught.value).splitlines()
    assert lines[0] == (
        "f:4: course 1, point 1: expected a finite number for nx, ny, nz, "
        "got '-nan(ind)', '-nan(ind)', '-nan(ind)'; correct or remove the point"
    )
    assert len(lines) == 21 and lines[20].endswith("and 40 more faults")


@pytest.mark.parametrize(
    "data",
    [
        lambda: spoilt([31, 32], b"-0 -0 -0"),
        *(real_course(name).read_bytes for name in real_courses("bad_zero_normal")),
    ],
)
def test_negative_zeros_are_no_normal(data: Callable[[], bytes]) -> None:
    with pytest.raises(CourseFileRefused) as caught:
        parse_courses(data(), "f")
    assert [fault.line for fault in caught.value.faults] == [32, 33]


def test_all_faults_of_a_file_come_at_once() -> None:
    data = PLAIN.replace(b"60\n", b"190\n", 1).replace(b"3.0000", b"nan", 1)
    data = data.replace(b"\n2\nstart", b"\n1\nstart").replace(b"78.0000", b"75.0000").replace(b"5.0000\nend", b"0\nend")
    with pytest.raises(CourseFileRefused) as caught:
        parse_courses(data, "f")
    assert [fault.line for fault in caught.value.faults] == [3, 5, 8, 12]


@pytest.mark.parametrize("content", [b"1", b"1 ", b"x", b"\xe9\x93\xba", b"0.", b"end "], ids=repr)
def test_ten_megabytes_without_line_end_get_a_short_sentence(content: bytes) -> None:
    line = content * (10_000_000 // len(content))
    for data in (line, PLAIN.replace(b"60\n", b"60\n" + line + b"\n", 1)):
        assert all(len(sentence) < 400 for sentence in refusal(data).splitlines())


def test_reading_stops_at_very_many_faults() -> None:
    with pytest.raises(CourseFileRefused) as caught:
        parse_courses(PLAIN + b"1 # course\n" * (fault_finding.MOST_FAULTS + 10), "f")
    assert len(caught.value.faults) == fault_finding.MOST_FAULTS + 1
    last = caught.value.faults[-1]
    assert last.line < PLAIN.count(b"\n") + fault_finding.MOST_FAULTS + 10
    assert last.sentence == "too many faults; the file was read up to here"


def test_a_binary_file_gets_one_sentence() -> None:
    data = np.random.default_rng(0).bytes(1_000_000)
    assert re.fullmatch(r"f:\d+: byte 0x[0-9a-f]{2} is not text: .*", refusal(data))
    assert re.fullmatch(r"f:1: byte 0x00 is not text: .*", refusal(bytes(1000)))
