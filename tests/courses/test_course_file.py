"""Course files: what is read is what stands there, and what cannot be read is named."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.courses import course_file as module
from tapelayer.courses import fast_numbers, fault_finding, table
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses, read_courses, write_courses
from tapelayer.errors import CourseFileRefused, TargetNotWritable
from tests.helpers.parts import real_course, real_courses
from tests.helpers.paths import ROOT
from tests.helpers.plies import courses_of
from tests.helpers.surfaces import helix_course

HERE = ROOT / "tests"
GOOD = sorted((HERE / "data" / "courses" / "good").glob("*.txt"))
BAD = sorted((HERE / "data" / "courses" / "bad").glob("*.txt"))
EXAMPLES = sorted((HERE.parent / "examples").glob("*.txt"))
PLAIN = (HERE / "data" / "courses" / "good" / "plain.txt").read_bytes()


def assert_same(first: tuple[Course, ...], second: tuple[Course, ...]) -> None:
    """Bit for bit, the signs of zeros included."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert (one.number, one.cut_angles) == (other.number, other.cut_angles)
        for name in ("points", "normals", "arc_lengths"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def quickly(data: bytes) -> tuple[Course, ...]:
    """Courses by the quick way alone."""
    return module._courses(module.quick_table(module._plain(data)))


def carefully(data: bytes) -> tuple[Course, ...]:
    """Courses by the careful way alone."""
    return module._courses(fault_finding.careful_table(module._plain(data), data, "f"))


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


def test_there_are_files_to_test_with() -> None:
    assert len(GOOD) >= 5 and len(BAD) >= 49 and len(EXAMPLES) == 5


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLES], ids=lambda path: path.stem)
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


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLES], ids=lambda path: path.stem)
def test_quick_and_careful_ways_agree_on_files(path: Path) -> None:
    assert_same(quickly(path.read_bytes()), carefully(path.read_bytes()))


@pytest.mark.parametrize("path", [*GOOD, *EXAMPLES], ids=lambda path: path.stem)
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
    text = format_courses(read_courses(EXAMPLES[0])).decode().splitlines()
    written = [line.split() for line in text if line.count(" ") == 6]
    original = [line.split() for line in EXAMPLES[0].read_text().splitlines() if line.count(" ") == 6]
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


def test_very_long_blank_stretches_need_care_and_are_no_fault() -> None:
    data = 5000 * b"\n" + PLAIN.replace(b"1\nstart", b"1\n" + 3000 * b"\n" + b"start")
    assert_same(parse_courses(data, "f"), quickly(PLAIN))


@pytest.mark.parametrize("path", BAD, ids=lambda path: path.stem)
def test_bad_files_are_refused_in_these_words(path: Path) -> None:
    expected = path.with_suffix(".expect").read_text(encoding="utf-8")
    assert refusal(path.read_bytes(), path.name) + "\n" == expected


def test_messages_name_line_and_course() -> None:
    whole_file = {"empty", "only_comments", "utf16", "utf16_without_mark"}
    outside = {path.stem for path in BAD if path.stem.startswith(("number_", "stray_", "binary", "long_line"))}
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
        with pytest.raises(fast_numbers.NeedsCare):
            quickly(bytes(damaged))
        assert refused.faults and str(refused).startswith("f:")
    else:
        assert_same(parse_courses(bytes(damaged), "f"), expected)


WORDS = st.text("0123456789+-.e", min_size=1, max_size=24) | st.from_regex(
    re.compile(table.NUMBER.pattern.decode().replace("eE", "e")), fullmatch=True
)
WORDS |= st.floats(allow_nan=False, allow_infinity=False).map(repr) | st.floats(-1e4, 1e4).map(repr)
WORDS |= st.integers(2**53, 2**64).map(str) | st.tuples(st.integers(-(2**60), 2**60), st.integers(0, 18)).map(
    lambda parts: (
        f"{'-' if parts[0] < 0 else ''}{abs(parts[0]) // 10 ** parts[1]}.{abs(parts[0]) % 10 ** parts[1]:0{parts[1]}d}"
    )
)


@given(st.lists(WORDS, min_size=1, max_size=14))
def test_numbers_are_those_of_python_or_none(words: list[str]) -> None:
    text = "".join(word + "\n" for word in words).encode()
    stops = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate([[0], stops[:-1] + 1])
    if all(table.NUMBER.fullmatch(word.encode()) for word in words):
        values = fast_numbers.values_of_words(text, starts, stops)
        assert values.tobytes() == np.array([float(word) for word in words]).tobytes()
    else:
        with pytest.raises(fast_numbers.NeedsCare):
            fast_numbers.values_of_words(text, starts, stops)


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 4, 5])
def test_numbers_halfway_between_doubles_round_to_even(exponent: int) -> None:
    """Decimals of 16 to 18 digits exactly between two doubles, and one unit of their last place beside."""
    words = []
    for i in range(2**53 + 1, 2**53 + 200, 2):
        tie = i * 5**exponent  # i / 2**exponent, written with `exponent` decimals
        for digits in (tie - 1, tie, tie + 1):
            whole, part = divmod(digits, 10**exponent)
            words.append(f"-{whole}.{part:0{exponent}d}" if exponent else str(whole))
    text = "".join(word + "\n" for word in words).encode()
    stops = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate([[0], stops[:-1] + 1])
    values = fast_numbers.values_of_words(text, starts, stops)
    assert values.tobytes() == np.array([float(word) for word in words]).tobytes()


NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
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
    courses = quickly(data)
    assert_same(carefully(data), courses)
    text = format_courses(courses)
    again = quickly(text)
    assert_same(again, courses)
    assert format_courses(again) == text


@given(st.lists(NUMBERS, min_size=1))
def test_a_length_of_a_file_is_written_as_the_same_double(mm: list[float]) -> None:
    metres = np.array(mm) / 1000.0
    written = module._as_written(metres, metres * 1000.0, table.from_mm)
    assert (written / 1000.0).tobytes() == metres.tobytes()


@given(st.lists(st.floats(-1e300, 1e300), min_size=1))
def test_any_length_is_written_within_its_last_place_and_then_stays(values: list[float]) -> None:
    metres = np.array(values)
    written = module._as_written(metres, metres * 1000.0, table.from_mm)
    again = written / 1000.0
    assert np.all(np.abs(again - metres) <= np.spacing(np.abs(metres)))
    assert module._as_written(again, again * 1000.0, table.from_mm).tobytes() == written.tobytes()


@given(st.lists(st.floats(0.0, 180.0), min_size=1))
def test_an_angle_of_a_file_is_written_as_the_same_double(degrees: list[float]) -> None:
    radians = np.radians(degrees)
    written = module._as_written(radians, np.degrees(radians), np.radians)
    assert np.radians(written).tobytes() == radians.tobytes()
    assert [table.cut_angle(repr(angle).encode()) for angle in written.tolist() if 0.0 < angle < 180.0] == [
        angle for angle, plain in zip(radians.tolist(), written.tolist(), strict=True) if 0.0 < plain < 180.0
    ]


def test_whole_degrees_stay_whole() -> None:
    for degrees in range(1, 180):
        course = Course(1, np.eye(3)[:2], np.eye(3)[:2], np.array([0.0, math.sqrt(2)]), 2 * (math.radians(degrees),))
        assert format_courses([course]).splitlines()[2] == f"{degrees}.0".encode()


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(any), min_size=1))
def test_normals_are_made_unit_once(vectors: list[tuple[float, float, float]]) -> None:
    normals = np.array(vectors)
    units = table.unit_normals(normals)
    assert np.all(np.abs(np.linalg.norm(units, axis=1) - 1.0) <= 1e-15)
    assert np.array_equal(np.sign(units) * (units != 0), np.sign(normals) * (units != 0))
    assert table.unit_normals(units).tobytes() == units.tobytes()


@pytest.mark.parametrize(
    ("path", "reason"), [("missing.txt", "no such file or directory"), (".", "is a directory")], ids=["missing", "dir"]
)
def test_a_file_that_cannot_be_opened_is_named(tmp_path: Path, path: str, reason: str) -> None:
    with pytest.raises(CourseFileRefused) as caught:
        read_courses(tmp_path / path)
    assert str(caught.value) == f"{tmp_path / path}: cannot be read: {reason}"


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
