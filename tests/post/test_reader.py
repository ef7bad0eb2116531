from __future__ import annotations

import re
from decimal import Decimal
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from post.controllers import Controller, load
from post.controllers.parsing import parse
from post.program import write
from post.reader import Program, read
from post.source import Comment
from tapelayer.errors import ControllerRefused, ProgramRefused
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.provenance import Provenance
from tests.helpers.machines import TEN_AXES
from tests.helpers.paths import DATA, ROOT

GOLDEN = DATA / "nc"
REVOLUTE = ("c", "a", "d", "e")
# mm/s and deg/s, as numbers that nothing else in the tests has.
LIMITS = Limits.speeds(np.array([np.pi / 2 if axis in REVOLUTE else 0.5 for axis in TEN_AXES]))
STATE = "G00 X0 Y0 Z0 A0 C0 U0 V0 Q0 D0 E0\n"


def parsed(text: str | bytes, controller: Controller | None = None, axes: tuple[str, ...] = TEN_AXES) -> Program:
    data = text.encode("utf-8") if isinstance(text, str) else text
    limits = Limits.speeds(LIMITS.speed[: len(axes)])
    return read(data, controller or load("jb3208"), axes, limits, "p.nc")


def boundless() -> Controller:
    """The default control without the limits of its words."""
    table = load("jb3208")
    axes = tuple(axis.model_copy(update={"decimals": 99}) for axis in table.axes)
    return table.model_copy(update={"axes": axes, "max_word": np.inf})


def blocks(text: str, **kwargs: Any) -> Trajectory:
    """Blocks of a program that has stated all axes at zero before; that block is left out here."""
    whole = parsed(STATE + text + "\nM30\n", **kwargs).trajectory
    rows = ("positions", "kinds", "durations", "events", "courses", "stated", "lines", "centres", "planes")
    left = {name: None if getattr(whole, name) is None else getattr(whole, name)[1:] for name in rows}
    return Trajectory(axes=whole.axes, start=whole.positions[0], **left)


def refusals(text: str | bytes, **kwargs: Any) -> list[str]:
    with pytest.raises(ProgramRefused) as caught:
        parsed(text, **kwargs)
    return str(caught.value).splitlines()


def written(path: Trajectory, axis: str) -> list[float]:
    """Positions of an axis in mm or deg."""
    values = path.positions[:, path.column(axis)]
    return (np.rad2deg(values) if axis in REVOLUTE else values * 1e3).round(9).tolist()


def test_golden_program() -> None:
    program = parsed((GOLDEN / "two_courses.nc").read_bytes())
    path = program.trajectory
    assert (program.version, program.source, program.controller) == ("1.2.3", "panel.txt", "jb3208")
    assert (program.source_sha256, program.setup_sha256) == ("ab" * 32, "cd" * 32)
    assert [comment.text for comment in program.comments[-2:]] == ["course 1 of 2", "course 2 of 2"]
    R, L, D, S = Kind.RAPID, Kind.LINEAR, Kind.DWELL, Kind.SWITCH
    assert path.kinds.tolist() == [S, R, R, L, S, S, L, L, D, L, S, S, R, R, R, R, L]
    events = {
        0: Event.SUPPLY_MODE, 4: Event.SHOE_DOWN, 5: Event.HEATER_ON, 10: Event.HEATER_OFF, 11: Event.SHOE_UP,
    }  # fmt: skip
    assert path.events.tolist() == [events.get(block, Event.NONE) for block in range(17)]
    assert path.courses.tolist() == [0] * 13 + [1] * 4
    assert np.isnan(path.positions[0]).all() and np.isnan(path.start).all()
    assert np.isnan(path.positions[1]).tolist() == [axis != "z" for axis in TEN_AXES]
    assert path.positions[9].tolist() == [
        0.106, 0.008, 0.05, np.deg2rad(-30.0), 0.0, 0.0225, 1e-6, np.deg2rad(-12.345), 0.0, 0.0,
    ]  # fmt: skip
    seconds = [0, 0, 0, 1.2, 0, 0, 0.5, 0.5, 0.25, 0.1, 0, 0, 0.08, 0, 0.212, 0.02, 0.5]
    assert path.asked == pytest.approx(seconds, rel=1e-5)
    # D cannot turn as fast as it is asked to.
    seconds[9] = 12.345 / 90.0
    assert path.durations == pytest.approx(seconds, rel=1e-5)
    assert path.stated.tolist()[1:3] == [0b100, 0b1111111111]
    assert path.lines.tolist()[:4] == [11, 13, 14, 15]
    assert path.tolerances.tolist() == [np.inf if kind == S else 0.0 for kind in path.kinds]


@pytest.mark.parametrize(
    ("line", "x", "y"),
    [
        ("G1X5Y.5F60", 5, 0.5),
        ("g01 x5. y+0.5 f60", 5, 0.5),
        ("N 7 G 1 X 5 Y .5 F 60", 5, 0.5),
        ("n007 g001\tx +0005.000\ty 000.5 f60.", 5, 0.5),
        ("N0007G01X5(up)Y(to the edge).5F60", 5, 0.5),
        ("(first) G1 X 5.00000000000000 Y 0.50 (last) F 0000060", 5, 0.5),
        ("X5 Y.5 F60 G1", 5, 0.5),
        ("G90 G1 X-5 Y-.5 F60", -5, -0.5),
        ("G91 G1 X-5 Y-.5 F60", -5, -0.5),
        ("G94 G90 G17 G01 X- 5 Y - 0 . 5 F 60", -5, -0.5),
    ],
)
def test_hand_written_words(line: str, x: float, y: float) -> None:
    if "G17" in line:
        line = line.replace("G17 ", "")
    path = blocks(line, controller=boundless())
    assert path.positions[0][:2].tolist() == [x / 1000, y / 1000]
    assert path.durations.tolist() == [np.hypot(5, 0.5)]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_and_lines_without_blocks(end: str) -> None:
    text = end.join(
        ["", "  %  ", "( text )", "N5", "", STATE.strip(), "G01 F60", "X1", " M02 ".replace("02", "30"), "%"]
    )
    path = parsed("\ufeff" + text).trajectory
    assert path.lines.tolist() == [6, 8]
    assert path.durations.tolist() == [0.0, 1.0]


numbers = st.one_of(
    st.decimals(-99999, 99999, places=3),
    st.decimals(-(10**9), 10**9, places=6),
    st.integers(-(10**15), 10**15).map(Decimal),
    st.decimals(-1, 1, places=15),
    st.decimals(-(10**9), 10**9, places=12),
)


@given(st.lists(st.tuples(numbers, st.integers(0, 3), st.sampled_from(["", "0", "00000000"])), min_size=1, max_size=9))
def test_numbers_are_those_of_python(cases: list[tuple[Decimal, int, str]]) -> None:
    texts = []
    for number, style, zeros in cases:
        text = f"{abs(number):f}"
        if style == 1 and "." in text:
            text = text.rstrip("0")
        if style == 2:
            text = text.removeprefix("0") if text.startswith("0.") else text
        sign = "-" if number < 0 else ("+" if style == 3 else "")
        texts.append(sign + zeros + text)
    program = "".join(f"G00 X{text}\n" for text in texts) + "M30"
    path = parsed(program, boundless()).trajectory
    assert path.positions[:, 0].tolist() == [float(text) / 1e3 for text in texts]


@given(st.text("0123456789.+-", max_size=19))
def test_what_python_takes_for_no_number_is_refused(text: str) -> None:
    program = f"G00 X{text}\nM30"
    if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)", text):
        assert parsed(program, boundless()).trajectory.positions[0, 0] == float(text) / 1e3
    else:
        assert refusals(program)[0] == f"p.nc:1:5: expected a number after X, got {text or 'nothing'}"


def test_feed_rules_of_the_control() -> None:
    path = blocks("G01 X3 Y4 U99 D7 F60\nU100 D5\nD-100\nG93 X0 F2\nX9 Y9 F0.5\nG94 X8 Y9 F120")
    assert path.durations == pytest.approx([5, 2, 105, 30, 120, 0.5], rel=1e-12)


def test_rapids_take_the_time_of_the_slowest_axis_and_dwells_their_own() -> None:
    path = blocks("X100 Y-50\nA45\nG04 P1.5\nX0 A0\nX0\n")
    assert path.durations == pytest.approx([0.2, 0.5, 1.5, 0.5, 0.0], rel=1e-12)
    assert path.kinds.tolist() == [Kind.RAPID, Kind.RAPID, Kind.DWELL, Kind.RAPID, Kind.RAPID]


def test_a_rapid_from_an_unstated_position_takes_no_time() -> None:
    whole = parsed("G00 Z5\nZ10\nX100 Z15\nM30").trajectory
    assert whole.durations == pytest.approx([0, 0.01, 0.01], rel=1e-12)


@given(st.lists(st.tuples(st.booleans(), st.integers(-99999, 99999)), min_size=1, max_size=30))
def test_absolute_and_incremental_words_mixed(moves: list[tuple[bool, int]]) -> None:
    text, expected, now = [], [], 0
    for incremental, value in moves:
        text.append(f"{'G91' if incremental else 'G90'} G01 X{value / 1000:.3f} F60")
        now = now + value if incremental else value
        expected.append(now / 1000)
    path = blocks("\n".join(text))
    assert written(path, "x") == pytest.approx(expected, abs=1e-8)
    assert path.durations == pytest.approx(np.abs(np.diff(expected, prepend=0.0)), abs=1e-8)


def test_position_words_shift_what_follows() -> None:
    path = blocks("G01 U20 F60\nG92 U0\nU5\nG91 U-1\nG92 U100\nG90 U101 X1\n")
    assert written(path, "u") == [20, 25, 24, 25]
    assert written(path, "x") == [0, 0, 0, 1]


def test_courses_are_those_of_the_comments_or_counted() -> None:
    lay = "G00 Z{z}\nG01 Z0 F60\nM20\nX{x}\nM25\nZ9\n"
    text = lay.format(z=5, x=1) + lay.format(z=6, x=2) + "M20\nX3\nM25\nZ7\n"
    assert blocks(text).courses.tolist() == [0] * 6 + [1] * 6 + [2] * 4
    commented = "(Course 4)\n" + lay.format(z=5, x=1) + "(course 2 of 9)\n" + lay.format(z=6, x=2)
    assert blocks(commented).courses.tolist() == [3] * 6 + [1] * 6
    passes = commented.replace("Course", "pass").replace("course", "Pass")
    assert blocks(passes).courses.tolist() == [3] * 6 + [1] * 6
    assert blocks("X1\n").courses.tolist() == [-1]


def test_comments_are_kept_with_their_lines() -> None:
    program = parsed(STATE + "( a ; b )X1(c%)\n\n(d)\nM30 (ü)")
    assert program.comments == (Comment(2, "a ; b"), Comment(2, "c%"), Comment(4, "d"), Comment(5, "ü"))
    assert (program.source, program.setup_sha256) == ("", "")


def table(*changes: tuple[str, str]) -> Controller:
    text = (ROOT / "post" / "controllers" / "jb3208.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return parse(text.encode(), "mine.toml")


OTHER = (
    ('comment = "("', 'comment = ";"'),
    ('address = "U"', 'address = "U="'),
    ('address = "V"', 'address = "Q1="'),
    ('address = "Q"', 'address = "Q2="'),
    ('"M22"', '"M62 P3"'),
    ('"M23"', '"M63 P3"'),
    ("preamble = []", 'preamble = ["GROUP(X, Y)"]'),
    ('set_position = "G92"', 'set_position = "G92.1"\nno_effect = ["S", "G8", "GROUP(X, Y)"]'),
)


def test_extended_addresses_arguments_and_words_without_effect() -> None:
    text = "G8 S200\nn3 group( X,Y ) ; text\nG0 X0 Y0 Z0 A0 C0 U=0 Q1=0 Q2=0 D0 E0\nG1 q1 = -1.5 U=2 F60\n"
    path = parsed(text + "M62 P3\nM63P3\nM30", table(*OTHER)).trajectory
    assert (written(path, "v")[1], written(path, "u")[1]) == (-1.5, 2)
    assert path.events.tolist() == [0, 0, Event.KNIFE_1_DOWN, Event.KNIFE_1_UP]


REFUSED = [
    ("X1", ["2:1: axis words before any G00 or G01; state one of them"]),
    ("G00 X1 L5", ["2:8: L is no word of controller jb3208"]),
    ("G00 X1 G05\nM77", ["2:8: G5 is no word of controller jb3208", "3:1: M77 is no word of controller jb3208"]),
    ("X1 G1.5", ["2:1: axis words before any G00 or G01; state one of them",
                 "2:4: G1.5 is no word of controller mine"]),
    ("G00 G01 X1", ["2:5: a second motion, dwell or position word in one block; write it in a block of its own"]),
    ("G00 X1 G90 G91", ["2:12: a second distance mode in one block; write it in a block of its own"]),
    ("G00 X1 G93 G94", ["2:12: a second feed mode in one block; write it in a block of its own"]),
    ("G00 X1 Y2 X3", ["2:11: a second X word in one block; write it in a block of its own"]),
    ("M20 M21", ["2:5: a second M word in one block; write it in a block of its own"]),
    ("G00 X1 M20", ["2:8: a switching word stands in a block with a motion or dwell; give it its own"]),
    ("G04", ["2:1: expected G04 P and the seconds, nothing else"]),
    ("G04 P-1", ["2:1: expected G04 P and the seconds, nothing else"]),
    ("G04 P1 X5", ["2:1: expected G04 P and the seconds, nothing else"]),
    ("G00 X5 P2", ["2:8: the P word has no meaning in this block; remove it"]),
    ("G00 X1..5 Y--2 Z1 e3", [
        "2:5: expected a number after X, got 1..5",
        "2:11: expected a number after Y, got --2",
        "2:19: E is no word of controller three",
    ]),
    ("N10 G00 X1-5 Y Z", [
        "2:9: expected a number after X, got 1-5",
        "2:14: expected a number after Y, got nothing",
        "2:16: expected a number after Z, got nothing",
    ]),
    ("  5 G00 X1", ["2: expected a word (a letter and a number), got 5"]),
    ("/G00 X1", ["2: expected a word (a letter and a number), got /"]),
    ("% G00 X1", ["2: expected a word (a letter and a number), got %"]),
    ("G00 X1 (no end\nY2 )", ["2:8: the comment is not closed; end it with )",
                                   "3:1: expected a number after Y, got 2)"]),
    ("G00 X1 (one (two) Y2", ["2:8: a comment begins within this comment; close it before"]),
    ("G00 X1 _ Y2", ["2:8: expected a number after _, got nothing", "2:8: _ is no word of controller three"]),
    ("G00 X1\nY2 ü Z3\n", ["3:4: expected ASCII outside comments, got ü"]),
    ("G00 X0\nG01 X1 F60", ["3:1: a feed motion before a rapid has stated axis Y; state every axis first",
                           "3:1: a feed motion before a rapid has stated axis Z; state every axis first"]),
    ("G91 G00 X1", ["2:9: an increment of X before a rapid has stated it"]),
    ("G00 X1\nG92 Y0", ["3:5: sets Y before a rapid has stated it"]),
    ("G00 X0 Y0 Z0\nG01 X1\nX2\nY1 F0", ["5:4: expected a feed above 0"]),
    ("G00 X0 Y0 Z0\nG01 X1\nX2", ["3:1: a feed motion without a feed word; give it one"]),
    ("G00 X0 Y0 Z0\nG01 X1 F9\nG93 X2\nX3 F1\nX4\nG94 X5", [
        "4:1: a feed motion without a feed word; give it one",
        "6:1: a feed motion without a feed word; give it one",
        "7:1: a feed motion without a feed word; give it one",
    ]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), REFUSED)
def test_refused_with_line_and_column(text: str, expected: list[str]) -> None:
    # Three axes, so that there are letters to be strange.
    three = table(*((f'  {{ address = "{a}", joints = ["{a.lower()}"], unit = "{u}" }},\n', "")
                    for a, u in [*((a, "mm") for a in "UVQ"), *((a, "deg") for a in "ACDE")]))  # fmt: skip
    lines = refusals("(x)\n" + text + "\nM30", controller=three, axes=("x", "y", "z"))
    assert lines == [f"p.nc:{line}".replace("jb3208", "mine").replace("three", "mine") for line in expected]


def test_refused_as_a_whole() -> None:
    assert refusals("G00 X1\nY2\n") == ["p.nc:2: the program does not end with M30; it may be cut off"]
    assert refusals("G00 X1\nM30\nX2\nX3") == ["p.nc:3:1: stands after the end of the program in line 2"]
    assert refusals("M30") == ["p.nc: the program has no blocks"]
    assert refusals("") == ["p.nc:1: the program does not end with M30; it may be cut off"]
    assert refusals(b"G00 X1\0\nM30") == ["p.nc: is a binary file, no NC program"]


EXPONENT = "is a number with an exponent, which this control does not have; write"


@pytest.mark.parametrize(
    ("line", "place", "number"),
    [
        ("G00 X1 Y1.44E3", "2:8: Y1.44E3", "1440"),
        ("G00 x1e3", "2:5: X1E3", "1000"),
        ("G00 X-1.5E-2 Z1", "2:5: X-1.5E-2", "-0.015"),
        ("N10 G00 X1.E+2", "2:9: X1.E+2", "100"),
    ],
)
@pytest.mark.parametrize("controller", ["jb3208", "linuxcnc"])
def test_a_number_with_an_exponent_is_one_sentence(line: str, place: str, number: str, controller: str) -> None:
    table = load(controller)
    axes = TEN_AXES if controller == "jb3208" else ("x", "y", "z")
    (sentence,) = refusals(f"%\n{line}\nM30", controller=table, axes=axes)
    assert sentence == f"p.nc:{place} {EXPONENT} {number}, or a blank before E where that is a word of its own"
    (sentence,) = refusals(f"%\n{line}\n{line}\nG00 X1..2\n{line}\nM30", controller=table, axes=axes)
    assert sentence.startswith(f"p.nc:{place}") and sentence.endswith("of its own; 2 more such words")


@pytest.mark.parametrize("line", ["G01 X5 E3 F60", "G01X5E3F60", "G01 X5E3.0 F60", "G01 X5 (1E3) E3 F60"])
def test_an_axis_e_is_no_exponent(line: str) -> None:
    assert written(blocks(line), "e") == [3.0]


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("G01 X5 F60" + " " * 191, "2: the line has 201 characters, expected at most 200 of this control"),
        ("(" + "c" * 199 + ")", "2: the line has 201 characters, expected at most 200 of this control"),
        ("N9999991 G01 X5 F60", "2:1: block number 9999991, expected a whole number from 0 to 9999990"),
        ("N1.5 G01 X5 F60", "2:1: block number 1.5, expected a whole number from 0 to 9999990"),
        ("N-10 G01 X5 F60", "2:1: block number -10, expected a whole number from 0 to 9999990"),
        ("N10 N10 G01 X5 F60", "2:5: a second N word in one block; write it in a block of its own"),
        ("G01 X10000000 F60", "2:5: X10000000 is beyond the largest word of this control, 9999999.999"),
        ("G01 U-9999999.9991 F60", "2:5: U-9999999.9991 is beyond the largest word of this control, 9999999.999"),
        ("G01 X5.0000 F60", "2:5: X has 4 digits after the point, expected at most 3 of this control"),
        ("G04 P0.1234567", "2:5: P has 7 digits after the point, expected at most 6 of this control"),
    ],
)
def test_what_the_control_cannot_take_is_refused(line: str, sentence: str) -> None:
    lines = refusals(STATE + line + "\nM30")
    assert lines[0] == f"p.nc:{sentence}"


def test_what_the_control_can_just_take_is_read() -> None:
    at_most = ["G01 X9999999.999 F60" + " " * 180, "N9999990 G01 U-9999999.999", "N0 G04 P0.123456", "G01 X5.000"]
    assert len(parsed(STATE + "\n".join(at_most) + "\nM30").trajectory) == 5


def test_many_faults_are_counted() -> None:
    lines = refusals("G00 L1\n" * 1001 + "M30")
    assert len(lines) == 21
    assert lines[-1].startswith("p.nc: and 981 more faults")


def test_a_joint_without_address_is_refused() -> None:
    with pytest.raises(ControllerRefused, match="no address for axis theta"):
        parsed("M30", axes=("x", "theta"))


def test_arcs_turn_about_their_centre_in_their_plane_and_sense() -> None:
    path = blocks("G01 X10 F60\nG17 G03 X0 Y10 I-10 J0 U7 F600\nG18 G2 Z-10 X10 K0 I10\nG19 G03 Y20 Z0 J0 K10 F60")
    assert path.kinds.tolist() == [Kind.LINEAR, Kind.COUNTERCLOCKWISE, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE]
    assert path.planes is not None and path.planes.tolist() == [0, 0, 1, 2]
    assert path.centres is not None
    centres = [[0, 0, np.nan], [0.01, np.nan, 0], [np.nan, 0.01, 0]]
    np.testing.assert_array_equal(path.centres[1:].round(12) + 0.0, centres)
    quarter = 10 * np.pi / 2
    assert path.durations[1:] == pytest.approx([quarter / 10, quarter / 10, quarter], rel=1e-12)
    middle = path.within(np.array([1, 2, 3]), np.full(3, 0.5))[:, :3]
    half = 0.01 * np.sqrt(0.5)
    expected = [[half, half, 0], [0.01 - half, 0.01, -half], [0.01, 0.01 + half, -half]]
    assert middle == pytest.approx(np.array(expected), abs=1e-12)
    assert written(path, "u")[1] == 7


def test_arcs_count_the_third_axis_and_increments() -> None:
    path = blocks("G91 G02 X10 Y10 I10 J0 Z3 F60\nG93 X10 Y-10 I0 J-10 F2")
    assert path.durations == pytest.approx([np.hypot(10 * np.pi / 2, 3), 30], rel=1e-12)
    assert written(path, "x") == [10, 20]


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("G02 X10 F60", "2:1: a circular block without its centre; give I or J"),
        ("G02 X10 I5 K5 F60", "2:12: K lies outside the plane of this circular block"),
        ("G02 X10 I5.01 F60", "2:1: begin and end of a circular block lie 5.010 and 4.990 mm from its centre; expected "
                              "equal distances and an end apart from the begin"),
        ("G02 X0 I5 F60", "2:1: begin and end of a circular block lie 5.000 and 5.000 mm from its centre; expected "
                          "equal distances and an end apart from the begin"),
        ("G02 X10 I5", "2:1: a feed motion without a feed word; give it one"),
        ("G01 X10 I5 F60", "2:9: the I word has no meaning in this block; remove it"),
        ("G17 G18 G02 X10 I5", "2:5: a second plane in one block; write it in a block of its own"),
    ],
)  # fmt: skip
def test_what_is_no_arc_is_refused(block: str, expected: str) -> None:
    assert refusals(STATE + block + "\nM30") == [f"p.nc:{expected}"]


def test_arcs_need_a_control_and_a_machine_that_have_them() -> None:
    none = table(('planes = ["xy", "zx", "yz"]', "planes = []"))
    lines = refusals(STATE + "G02 X10 I5 F60\nM30", controller=none)
    assert lines[0] == "p.nc:2:1: G2 is no word of controller mine"
    two = refusals("G00 X0 Z0\nG02 X10 I5 F60\nM30", axes=("x", "z"))
    assert "a circular block, but the machine has no x and y" in two[0]


LINUXCNC_STATE = "G0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\nM68 E0 Q0\nG93\n"


def test_an_axis_on_an_output_moves_in_the_dwell_that_follows_it() -> None:
    text = (
        LINUXCNC_STATE + "G1 X1 F60\nM68 E0 Q12.5\nG4 P0.5\nM62 P3\nG4 P2\nM68 E0 Q12.5\nG4 P3\nM68 E0 Q-4\nX2 F60\nM2"
    )
    path = parsed(text, load("linuxcnc")).trajectory
    R, L, D, S = Kind.RAPID, Kind.LINEAR, Kind.DWELL, Kind.SWITCH
    assert path.kinds.tolist() == [R, R, L, L, S, D, D, L, L]
    assert path.durations.tolist() == [0, 0, 1, 0.5, 0, 2, 3, 0, 1]
    assert written(path, "e")[1:] == [0, 0, 12.5, 12.5, 12.5, 12.5, -4, -4]
    assert path.events[4] == Event.KNIFE_2_DOWN
    e = 1 << path.axes.index("e")
    assert [bool(bits & e) for bits in path.stated.tolist()] == [
        False,
        True,
        False,
        True,
        False,
        False,
        True,
        True,
        False,
    ]
    assert path.lines.tolist() == [1, 2, 4, 5, 7, 8, 10, 11, 12]


def test_rapids_need_no_output_stated() -> None:
    path = parsed("G0 X5\nM2", load("linuxcnc")).trajectory
    assert written(path, "x") == [5] and np.isnan(path.positions[0, path.column("e")])


def test_axes_that_a_word_takes_ride_with_a_motion_or_alone() -> None:
    state = "G0 X0 Y0 Z0 A0 C0 U0 V0 Q0 D0 E0 M29\nG93\n"
    path = parsed(state + "G1 X1 D3 M29 F60\nM29 E5 Q1\nG4 P0.5\nM20\nM2", load("linuxcnc_remap")).trajectory
    assert path.kinds.tolist() == [Kind.RAPID, Kind.LINEAR, Kind.LINEAR, Kind.SWITCH]
    assert path.durations.tolist() == [0, 1, 0.5, 0]
    assert (written(path, "d"), written(path, "e")) == ([0, 3, 3, 3], [0, 0, 5, 5])


@pytest.mark.parametrize(
    ("controller", "block", "expected"),
    [
        ("linuxcnc", "G1 X1 Q5 F60", "4:7: expected M68 E0 in a block with Q"),
        ("linuxcnc", "M68 E0", "4:1: expected the axis words that this word takes, and no others that it does not"),
        (
            "linuxcnc",
            "M68 E0 Q5 X1",
            "4:1: expected the axis words that this word takes, and no others that it does not",
        ),
        ("linuxcnc", "M68 E1 Q5", "4:1: M68 is no word of controller linuxcnc"),
        ("linuxcnc", "M62 P9", "4:1: M62 is no word of controller linuxcnc"),
        ("linuxcnc", "G61 P1", "4:5: the P word has no meaning in this block; remove it"),
        ("linuxcnc", "G64 P0", "4:5: expected a tolerance above 0"),
        ("linuxcnc", "G61 G64", "4:5: a second exact stop or blending in one block; write it in a block of its own"),
        ("jb3208", "G64 P1", "4:5: the P word has no meaning in this block; remove it"),
        ("linuxcnc", "G1 X1", "4:1: a feed motion without a feed word; give it one"),
    ],
)
def test_words_that_take_axes_are_checked(controller: str, block: str, expected: str) -> None:
    assert f"p.nc:{expected}" in refusals(LINUXCNC_STATE + block + "\nM2", controller=load(controller))


@pytest.mark.parametrize(
    ("controller", "text", "expected"),
    [
        ("linuxcnc", "G1 X1 F60\nG61 X2 F60\nX3 F60\nG64 P0.25 X4 F60\nX5 F60\nG64 X6 F60", "* 0 0 0.25 0.25 *"),
        ("jb3208", "G1 X1 F60\nG64 X2\nX3\nG61 X4", "0 0.02 0.02 0"),
        ("sinumerik840d", "G1 X1 F60\nG642 X2\nG60 X3", "0 0.02 0"),
    ],
)
def test_a_block_s_end_is_rounded_off_as_the_words_say(controller: str, text: str, expected: str) -> None:
    """In mm, by the control's own parameters where no word states it; * without a bound."""
    rows = f"G0 X0\n{text}\nM30"
    if controller == "linuxcnc":
        rows = f"G93\n{rows}"
    path = parsed(rows, load(controller), ("x",)).trajectory
    bounds = [np.inf if word == "*" else float(word) * 1e-3 for word in expected.split()]
    assert path.tolerances[1:] == pytest.approx(bounds)


@pytest.mark.parametrize(("word", "waits"), [("M62 P4", False), ("M64 P4", True)])
def test_a_word_at_rest_lets_the_control_finish_all_motion(word: str, waits: bool) -> None:
    path = parsed(LINUXCNC_STATE + f"G1 X1 F60\n{word}\nX2 F60\nM2", load("linuxcnc")).trajectory
    at = path.events.tolist().index(Event.HEATER_ON)
    assert path.tolerances[at] == (0.0 if waits else np.inf)


def test_an_output_must_be_stated_before_a_feed_motion() -> None:
    text = "G93 G0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\nG1 X1 F9\nM2"
    assert refusals(text, controller=load("linuxcnc")) == [
        "p.nc:2:1: a feed motion before a rapid has stated axis Q; state every axis first"
    ]


micrometres = st.integers(-(10**6), 10**6)
link = st.tuples(st.just(Kind.RAPID), st.lists(micrometres, min_size=10, max_size=10))
motion = st.tuples(
    st.sampled_from([Kind.RAPID, Kind.LINEAR, Kind.LINEAR]), st.dictionaries(st.integers(0, 9), micrometres)
)
other = st.one_of(
    st.tuples(st.just(Kind.DWELL), st.integers(1, 10**5)),
    st.tuples(st.just(Kind.SWITCH), st.sampled_from(sorted(load("jb3208").event_words()))),
)


CONTROLS = {
    **{name: load(name) for name in ("jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d")},
    "without numbers": table(("number_step = 10", "number_step = 0")),
    "other letters": table(*OTHER),
    "reset": table(('u_reset = "never"', 'u_reset = "course"')),
}


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2), st.one_of(motion, other), st.floats(1e-3, 50)), max_size=40),
    st.lists(micrometres, min_size=10, max_size=10),
    st.sampled_from(sorted(CONTROLS)),
)
def test_what_is_written_reads_back_as_the_rounded_trajectory(
    sequence: list[tuple[int, tuple[Kind, Any], float]], first: list[int], control: str
) -> None:
    controller = CONTROLS[control]
    now = np.array(first, dtype=np.int64)
    rows: list[tuple[np.ndarray, int, float, int, int, int]] = [(now, Kind.RAPID, 0.0, 0, 0, 1023)]
    course = 0
    for more, (kind, what), seconds in sequence:
        before, course = now, course + (more == 2)
        event = 0
        if kind == Kind.DWELL:
            seconds = what / 1000
        elif kind == Kind.SWITCH:
            seconds, event = 0.0, int(what)
        else:
            now = now.copy()
            now[list(what)] = list(what.values())
            if controller.name == "linuxcnc" and (now[:9] != before[:9]).any():
                now[9] = before[9]
            if (now == before).all():
                continue
            if kind == Kind.RAPID:
                rates = np.array([90.0 if axis in REVOLUTE else 500.0 for axis in TEN_AXES])
                seconds = float((np.abs(now - before) / 1000 / rates).max())
            # An output turns in a dwell, which is a straight block: e, and for linuxcnc_remap d and q too.
            outputs = {"linuxcnc": [9], "linuxcnc_remap": [7, 8, 9]}.get(controller.name, [])
            if outputs and (np.delete(now, outputs) == np.delete(before, outputs)).all():
                kind, seconds = Kind.LINEAR, max(round(seconds, 3), 0.001)
        rows.append((now, kind, seconds, event, course, 0))
    whole, kinds, seconds_, events, courses, stated = zip(*rows, strict=True)
    # A third of the last digit away from where it will be rounded to, either way.
    noise = np.random.default_rng(len(rows)).uniform(-0.33, 0.33, (len(rows), 10))
    noise[np.concatenate([[False], (np.diff(np.array(whole), axis=0) == 0).all(axis=1)])] = np.nan
    for row in range(1, len(rows)):
        noise[row] = np.where(np.isnan(noise[row]), noise[row - 1], noise[row])
    scale = np.array([180 / np.pi if axis in REVOLUTE else 1e3 for axis in TEN_AXES])
    trajectory = Trajectory(
        TEN_AXES,
        np.full(10, np.nan),
        (np.array(whole) + noise) / 1000 / scale,
        np.array(kinds, dtype=np.uint8),
        np.array(seconds_),
        np.array(events, dtype=np.uint8),
        np.array(courses, dtype=np.int32),
        np.array(stated, dtype=np.uint16),
        np.zeros(len(rows), dtype=np.int32),
    )
    text = write(SimpleNamespace(trajectory=trajectory), controller, Provenance("a", "b", "c", "d"))  # type: ignore[arg-type]
    path = read(text, controller, TEN_AXES, LIMITS, "p.nc").trajectory
    # What stands alone is stated in a block of its own first.
    stated_in = 1 if controller.name == "linuxcnc" else 0
    exact = np.array(whole) / 1000
    column = np.where([axis in REVOLUTE for axis in TEN_AXES], np.deg2rad(exact), exact / 1e3)
    if controller.u_reset == "course":
        assert path.positions[stated_in:] == pytest.approx(column, abs=1e-12)
    else:
        assert (path.positions[stated_in:] == column).all()
    assert path.kinds[stated_in:].tolist() == list(kinds)
    assert path.events[stated_in:].tolist() == list(events)
    assert path.courses[stated_in:].tolist() == list(courses)
    assert path.requested[stated_in:] == pytest.approx(np.array(seconds_), rel=1e-5, abs=1e-9)


SEEDS = {
    "jb3208": (
        "N10 G90\nN20 G00 X1 Y2 Z3 A4 C5 U6 V7 Q8 D9 E1\nG01 X2 F60\nM20\nG18 G02 X4 I1 K0\nG91 X1\nG04 P1\n(a)\nM30\n"
    ),
    "linuxcnc": "G0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\nM68 E0 Q0\nG93 G1 X1 F9\nM62 P3\nM68 E0 Q2\nG4 P0.5\nM2\n",
    "linuxcnc_remap": "G0 X0 Y0 Z0 A0 C0 U0 V0 Q0 D0 E0 M29\nG93 G1 X1 D2 M29 F9\nM29 D3\nG4 P1\nM2\n",
    "sinumerik840d": "G0 X0 Y0 Z0 A0 C0 U=0 V=0 Q1=0 B1=0 B2=0 ; t\nG1 Q1=3 F9\nG4 F2\nM30\n",
}


@settings(deadline=None)
@given(
    st.sampled_from(sorted(SEEDS)),
    st.lists(
        st.tuples(
            st.integers(0, 120), st.integers(0, 3), st.text("GXYZACUQDEFMNPIJKS0129.-+=()%; \n\r/_\u00fc", max_size=5)
        ),
        max_size=3,
    ),
)
def test_edited_programs_are_read_or_refused(control: str, edits: list[tuple[int, int, str]]) -> None:
    text = SEEDS[control]
    for at, length, new in edits:
        text = text[:at] + new + text[at + length :]
    try:
        path = parsed(text, load(control)).trajectory
    except ProgramRefused as refused:
        assert refused.faults
        assert all(0 <= fault.line <= len(text) + 2 for fault in refused.faults)
    else:
        assert (path.durations >= 0).all() and np.isfinite(path.durations).all()
        unstated = np.isnan(path.positions).any(axis=1)
        assert np.isin(path.kinds[unstated], (Kind.RAPID, Kind.DWELL, Kind.SWITCH)).all()


@pytest.mark.parametrize("stray", ["G93  X1 F9\n", ""])
def test_an_output_turns_no_axis_while_another_is_unstated(stray: str) -> None:
    text = f"G0 X0 Y0 Z0 A0 C0 U0 V0 W0\nM68 E0 Q0\n{stray}M62 P3\nM68 E0 Q2\nG4 P0.5\nM2\n"
    line = 5 if stray else 4
    assert refusals(text, controller=load("linuxcnc")) == [
        f"p.nc:{line}:1: an output turns an axis before rapids have stated every axis; state every axis first"
    ]
