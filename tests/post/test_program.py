from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from post.controllers import Controller, load
from post.controllers.parsing import parse
from post.program import write
from tapelayer.errors import ControllerRefused, NotWritable
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.provenance import Provenance, unedited
from tests.helpers.machines import TEN_AXES
from tests.helpers.paths import DATA, ROOT

GOLDEN = DATA / "nc"
REVOLUTE = ("c", "a", "d", "e", "theta", "phi")
MADE_FROM = Provenance("panel.txt", "ab" * 32, "cd" * 32, "1.2.3")


def trajectory_of(blocks: list[tuple[Any, ...]], axes: tuple[str, ...] = TEN_AXES) -> Trajectory:
    """Blocks as (kind, course, seconds, {axis: mm or deg} or Event, optionally the stated axes)."""
    scale = np.array([np.pi / 180 if axis in REVOLUTE else 1e-3 for axis in axes])
    now = np.full(len(axes), np.nan)
    positions, events, stated = [], [], []
    for _, _, _, what, *rest in blocks:
        if isinstance(what, dict):
            for axis, value in what.items():
                now[axes.index(axis)] = value
        positions.append(now * scale)
        events.append(what if isinstance(what, Event) else Event.NONE)
        stated.append(sum(1 << axes.index(axis) for axis in (rest[0] if rest else ())))
    return Trajectory(
        axes,
        np.full(len(axes), np.nan),
        np.array(positions).reshape(len(blocks), len(axes)),
        np.array([block[0] for block in blocks], dtype=np.uint8),
        np.array([block[2] for block in blocks], dtype=float),
        np.array(events, dtype=np.uint8),
        np.array([block[1] for block in blocks], dtype=np.int32),
        np.array(stated, dtype=np.uint16),
        np.zeros(len(blocks), dtype=np.int32),
    )


def verified(blocks: list[tuple[Any, ...]], axes: tuple[str, ...] = TEN_AXES) -> Any:
    # What verification measured does not concern the writer.
    return SimpleNamespace(trajectory=trajectory_of(blocks, axes))


def body(blocks: list[tuple[Any, ...]], controller: Controller | None = None, axes: tuple[str, ...] = TEN_AXES) -> str:
    """Program without its header, last block and percent signs."""
    text = write(verified(blocks, axes), controller or load("jb3208"), MADE_FROM).decode("ascii")
    lines = text.splitlines()
    return "\n".join(
        line for line in lines[2:-2] if not re.match(r"\((tapelayer|source|setup|text|controller|units|note)", line)
    )


ALL = dict.fromkeys(TEN_AXES, 0.0)
LINK = [
    (Kind.RAPID, 0, 0.0, {"z": 10}, "z"),
    (Kind.RAPID, 0, 0.0, ALL | {"x": 100, "y": -0.0, "z": 10, "c": -30, "u": 12.5}, TEN_AXES),
]


def changed_table(*changes: tuple[str, str]) -> Controller:
    text = (ROOT / "post" / "controllers" / "jb3208.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return parse(text.encode(), "mine.toml")


def two_courses() -> list[tuple[Any, ...]]:
    blocks: list[tuple[Any, ...]] = [
        (Kind.SWITCH, 0, 0.0, Event.SUPPLY_MODE),
        *LINK,
        (Kind.LINEAR, 0, 1.2, {"z": 50}),
        (Kind.SWITCH, 0, 0.0, Event.SHOE_DOWN),
        (Kind.SWITCH, 0, 0.0, Event.HEATER_ON),
        (Kind.LINEAR, 0, 0.5, {"x": 103, "y": 4, "u": 17.5}),
        (Kind.LINEAR, 0, 0.5, {"x": 106, "y": 8, "u": 22.5}),
        (Kind.DWELL, 0, 0.25, {}),
        (Kind.LINEAR, 0, 0.1, {"d": -12.345, "v": 0.001}),
        (Kind.SWITCH, 0, 0.0, Event.HEATER_OFF),
        (Kind.SWITCH, 0, 0.0, Event.SHOE_UP),
        (Kind.RAPID, 0, 0.2, {"z": 10}),
        (Kind.RAPID, 1, 0.0, {}, "z"),
        (Kind.RAPID, 1, 0.5, {"x": 0}, TEN_AXES),
        (Kind.RAPID, 1, 0.5, {"z": 20}),
        (Kind.LINEAR, 1, 0.5, {"x": 3, "y": 12}),
    ]
    return blocks


def test_identical_input_gives_identical_bytes() -> None:
    first = write(verified(two_courses()), load("jb3208"), MADE_FROM)
    assert first == write(verified(two_courses()), load("jb3208"), MADE_FROM)


def test_first_motion_is_z_alone_and_then_all_axes_stand_in_word_order() -> None:
    lines = body(LINK).splitlines()
    assert lines == [
        "(course 1 of 1)",
        "N10 G90",
        "N20 G61",
        "N30 G00 Z10.000",
        "N40 X100.000 Y0.000 Z10.000 A0.000 C-30.000 U12.500 V0.000 Q0.000 D0.000 E0.000",
    ]


def test_motion_before_the_first_course_has_absolute_mode_stated_too() -> None:
    blocks = [(kind, course - 1, *rest) for kind, course, *rest in LINK] + LINK[1:]
    assert [line for line in body(blocks).splitlines() if "G90" in line or line[0] == "("] == [
        "N10 G90",
        "(course 1 of 1)",
        "N50 G90",
    ]


def test_words_stand_where_their_text_changes() -> None:
    moves = [(Kind.LINEAR, 0, 1.0, {"x": 100.0004}), (Kind.LINEAR, 0, 1.0, {"x": 100.0006, "y": 1.0})]
    assert body([*LINK, *moves]).splitlines()[5:] == ["N50 G04 P1.000000", "N60 G01 X100.001 Y1.000 F60.0000"]


def test_a_block_without_words_is_a_dwell_or_gives_its_time_to_the_next() -> None:
    tiny = (Kind.LINEAR, 0, 0.0004, {})
    move = (Kind.LINEAR, 0, 0.9992, {"x": 101})
    assert body([*LINK, tiny, tiny, move]).splitlines()[5:] == ["N50 G01 X101.000 F60.0000"]
    stop = (Kind.SWITCH, 0, 0.0, Event.SHOE_DOWN)
    assert body([*LINK, tiny, tiny, stop, tiny]).splitlines()[5:] == [
        "N50 G04 P0.000800",
        "N60 M20",
        "N70 G04 P0.000400",
    ]
    assert body([*LINK, (Kind.LINEAR, 0, 2.0, {}), move]).splitlines()[5] == "N50 G04 P2.000000"
    tenths = changed_table(('dwell_address = "P"', 'dwell_address = "P"\ndwell_decimals = 1'))
    blocks = [*LINK, (Kind.LINEAR, 0, 0.04, {}), (Kind.LINEAR, 0, 0.96, {"x": 101}), (Kind.LINEAR, 0, 0.06, {})]
    assert body(blocks, tenths).splitlines()[5:] == ["N50 G01 X101.000 F60.0000", "N60 G04 P0.1"]
    assert body([*LINK, (Kind.RAPID, 0, 0.0, {}), (Kind.DWELL, 0, 0.0, {})]) == body(LINK)


def test_feed_follows_the_path_or_the_largest_change() -> None:
    moves = [
        (Kind.LINEAR, 0, 0.5, {"x": 103, "y": 4, "u": 99}),
        (Kind.LINEAR, 0, 0.5, {"u": 100, "d": -12}),
        (Kind.LINEAR, 0, 6.0, {"d": 0, "u": 88}),
    ]
    assert [line.split(" F")[1] for line in body([*LINK, *moves]).splitlines()[5:]] == ["600.000", "1440.00", "120.000"]


def test_feed_is_computed_from_the_rounded_end_points() -> None:
    move = (Kind.LINEAR, 0, 60.0, {"x": 100.0016})
    assert body([*LINK, move]).splitlines()[5:] == ["N50 G01 X100.002 F0.00200000"]


@pytest.mark.parametrize("seconds", [1e-3, 0.37, 5.0, 59.99, 500.0])
@pytest.mark.parametrize("length", [0.001, 0.5, 77.0, 9000.0])
def test_feed_has_six_significant_digits_and_no_exponent(seconds: float, length: float) -> None:
    last = body([*LINK, (Kind.LINEAR, 0, seconds, {"x": 100 + length})]).splitlines()[-1]
    feed = re.fullmatch(r".* F(\d+(?:\.\d+)?)", last)
    assert feed is not None
    assert len(feed[1].replace(".", "").lstrip("0")) >= 6
    assert float(feed[1]) == pytest.approx(length / seconds * 60, rel=5.01e-6)


def test_feed_is_modal_and_restated_at_a_course() -> None:
    moves = [(Kind.LINEAR, i // 2, 1.0, {"x": 101 + i}) for i in range(4)]
    assert body([*LINK, *moves]).splitlines()[5:] == [
        "N50 G01 X101.000 F60.0000",
        "N60 X102.000",
        "(course 2 of 2)",
        "N70 G90",
        "N80 G61",
        "N90 G01 X103.000 F60.0000",
        "N100 X104.000",
    ]


def test_block_numbers_wrap_to_the_first() -> None:
    controller = changed_table(("number_maximum = 9999990", "number_maximum = 35"))
    moves = [(Kind.LINEAR, 0, 1.0, {"x": 101 + i}) for i in range(3)]
    assert [line.split()[0] for line in body([*LINK, *moves], controller).splitlines()[1:]] == [
        *("N10", "N20", "N30"),
        *("N10", "N20", "N30"),
        "N10",
    ]


def test_without_block_numbers_no_line_begins_with_a_space() -> None:
    controller = changed_table(("number_step = 10", "number_step = 0"))
    numbered = body(two_courses())
    assert body(two_courses(), controller) == re.sub(r"(?m)^N\d+ ", "", numbered)


def test_comment_text_cannot_become_words() -> None:
    source = "a) M22 (.txt\n%;\tü" + "x" * 300
    text = write(verified(LINK), load("jb3208"), Provenance(source, "0", "1", "2", ("b)\nM23",))).decode("ascii")
    lines = text.splitlines()
    assert lines[2].startswith("(source: a_ M22 _.txt____uxxx") and lines[2].endswith("x)")
    assert max(map(len, lines)) == len(lines[2]) == load("jb3208").blocks.max_line
    assert "(note: b__M23)" in lines
    assert not re.search(r"(?m)^[^(]*M2[23]", text)


@pytest.mark.parametrize(
    ("source", "written"),
    [
        ("\u673a\u8eab\u8499\u76ae(3).txt", "JiShenMengPi_3_.txt"),
        ("\u673a\u7ffc\u8499\u76ae\uff083\uff09.txt", "JiYiMengPi_3_.txt"),
        ("Fl\u00fcgel \u00d8 50 %.txt", "Flugel O 50 _.txt"),
        ("\u041a\u0440\u044b\u043b\u043e.txt", "Krylo.txt"),
        ("\ue000\ufdd0.txt", "__.txt"),
    ],
)
def test_names_in_other_scripts_are_written_in_ascii_letters(source: str, written: str) -> None:
    text = write(verified(LINK), load("jb3208"), Provenance(source, "0", "1", "2")).decode("ascii")
    assert f"\n(source: {written})\n" in text


def test_comments_of_a_control_with_semicolons() -> None:
    controller = changed_table(('comment = "("', 'comment = ";"'))
    text = write(verified(LINK), controller, Provenance("p;(.txt", "0", "1", "2")).decode("ascii")
    assert "\n; source: p__.txt\n" in text and "\n; course 1 of 1\n" in text


def test_many_pages_of_rows_have_every_course_comment_in_its_place() -> None:
    moves = [(Kind.LINEAR, i // 10_000, 1.0, {"x": 100 + (i + 1) / 1000}) for i in range(50_000)]
    lines = body([*LINK, *moves]).splitlines()
    at = [i for i, line in enumerate(lines) if line[0] == "("]
    assert [lines[i] for i in at] == [f"(course {i} of 5)" for i in range(1, 6)]
    assert all(lines[i + 2].split()[1:] == ["G61"] for i in at)
    assert [lines[i + 3].split()[1:] for i in at[1:]] == [
        ["G01", f"X{100 + (10_000 * i + 1) / 1000:.3f}", "F0.0600000"] for i in range(1, 5)
    ]
    numbers = [int(line.split()[0][1:]) for line in lines if line[0] == "N"]
    assert numbers == list(range(10, 10 * len(numbers) + 10, 10))


def test_tape_axis_reset_at_each_course() -> None:
    controller = changed_table(('u_reset = "never"', 'u_reset = "course"'))
    blocks = [
        *LINK,
        (Kind.LINEAR, 0, 1.0, {"u": 20}),
        (Kind.LINEAR, 1, 1.0, {"u": 25}, "u"),
        (Kind.LINEAR, 1, 1.0, {"x": 0}),
    ]
    lines = [line.split(" ", 1)[1] for line in body(blocks, controller).splitlines() if line[0] == "N"]
    assert lines[4:] == ["G01 U20.000 F450.000", "G90", "G92 U0", "G61", "G01 U5.000 F300.000", "X0.000 F6000.00"]


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        (
            [(Kind.SWITCH, 0, 0.0, Event.ARC_ON)],
            "block 0: controller jb3208 has no word for arc_on; add it to the table",
        ),
        (
            [*LINK, (Kind.LINEAR, 0, 1.0, {"u": 2e7})],
            "block 2: axis u would be at 20000000.000 mm, beyond the largest word of this control, 9999999.999; choose",
        ),
        ([LINK[0], (Kind.LINEAR, 0, 1.0, {"z": 0})], "block 1: axis x is used before a rapid has stated it"),
        ([(Kind.RAPID, 0, 0.0, {"z": 0}, "xz")], "block 0: axis x is used before a rapid has stated it"),
        (
            [*LINK, (Kind.LINEAR, 0, 1.0, {"z": np.nan})],
            "block 2: the position of axis z is not a number, though it was known before",
        ),
        ([*LINK, (Kind.RAPID, 0, 1.0, {"z": np.inf})], "axis z: inf has no fixed-point word with 3 decimals"),
        ([*LINK, (Kind.DWELL, 0, 1.0, {"z": 3})], "block 2: axis z changes in a block that is no motion"),
        ([*LINK, (Kind.LINEAR, 0, 0.0, {"z": 3})], "block 2: moves in no time, so it has no feed"),
        ([*LINK, (Kind.LINEAR, 0, np.nan, {"z": 3})], "block 2: moves in no time, so it has no feed"),
        (
            [*LINK, (Kind.LINEAR, 0, 1.0, {}, "z")],
            "block 2: states axes without moving one; only a rapid can, at no feed",
        ),
        (
            [*LINK, (Kind.LINEAR, 0, 1e6, {"z": 10.001})],
            "a block has a feed of 6e-08 per minute; make its standing time",
        ),
    ],
)
def test_what_cannot_be_written_is_refused_by_name(blocks: list[tuple[Any, ...]], message: str) -> None:
    with pytest.raises(NotWritable) as caught:
        write(verified(blocks), load("jb3208"), MADE_FROM)
    assert str(caught.value).startswith(message)


def test_a_line_longer_than_the_control_takes_is_refused() -> None:
    controller = changed_table(("max_line = 200", "max_line = 90"))
    wide = (Kind.RAPID, 0, 0.0, dict.fromkeys(TEN_AXES, -123.456))
    assert body(LINK, controller) == body(LINK)
    with pytest.raises(NotWritable, match="^a line would have 103 characters, controller mine takes 90; write fewer"):
        body([*LINK, wide], controller)


def test_an_axis_without_address_is_refused() -> None:
    with pytest.raises(ControllerRefused, match="controller jb3208: has no address for axis theta"):
        body([(Kind.RAPID, 0, 0.0, {"x": 1})], axes=("x", "theta"))


def test_an_empty_trajectory_is_refused() -> None:
    with pytest.raises(NotWritable, match="the trajectory has no blocks"):
        body([])


NINE = {**ALL, "x": 100.0, "z": 10.0, "e": 5.0}
LINUXCNC_LINK = [(Kind.RAPID, 0, 0.0, {"z": 10}, "z"), (Kind.RAPID, 0, 0.0, NINE, TEN_AXES)]


def linuxcnc_body(blocks: list[tuple[Any, ...]], name: str = "linuxcnc") -> list[str]:
    lines = body([*LINUXCNC_LINK, *blocks], load(name)).splitlines()
    return [line.split(" ", 1)[1] for line in lines if line[0] == "N"][2:]


def test_an_axis_on_an_output_is_written_alone_with_a_dwell_for_its_time() -> None:
    blocks = [
        (Kind.LINEAR, 0, 0.5, {"x": 101}),
        (Kind.LINEAR, 0, 0.25, {"e": -5}),
        (Kind.LINEAR, 0, 0.5, {"x": 102}),
        (Kind.RAPID, 1, 0.25, {"e": 7}, TEN_AXES),
    ]
    assert linuxcnc_body(blocks) == [
        "G61",
        "G0 Z10.000",
        "M68 E0 Q5.000",
        "X100.000 Y0.000 Z10.000 A0.000 B0.000 C0.000 U0.000 V0.000 W0.000",
        "G1 X101.000 F120.000",
        "M68 E0 Q-5.000",
        "G4 P0.250000",
        "X102.000 F120.000",
        "G90 G93",
        "M68 E0 Q7.000",
        "G4 P0.250000",
        "G61",
        "G0 X102.000 Y0.000 Z10.000 A0.000 B0.000 C0.000 U0.000 V0.000 W0.000",
    ]


def test_an_axis_on_an_output_cannot_move_with_others() -> None:
    blocks = [*LINUXCNC_LINK, (Kind.LINEAR, 0, 0.5, {"x": 101, "e": 6})]
    with pytest.raises(NotWritable, match="^block 2: axis e moves together with others, but controller linuxcnc moves"):
        write(verified(blocks), load("linuxcnc"), MADE_FROM)


def blended(blocks: list[tuple[Any, ...]], tolerances: list[float]) -> Any:
    """Blocks whose ends may be rounded off by tolerances in metres; 0 for a stop, inf for words on the fly."""
    return SimpleNamespace(trajectory=replace(trajectory_of(blocks), tolerances=np.array(tolerances)))


MODES = [
    *LINUXCNC_LINK,
    (Kind.LINEAR, 0, 0.5, {"x": 101}),
    (Kind.SWITCH, 0, 0.0, Event.SHOE_DOWN),
    (Kind.LINEAR, 0, 0.5, {"x": 102}),
    (Kind.LINEAR, 0, 0.5, {"x": 103}),
    (Kind.SWITCH, 0, 0.0, Event.HEATER_ON),
    (Kind.LINEAR, 0, 0.5, {"x": 104}),
    (Kind.LINEAR, 1, 0.5, {"x": 105}),
]
TOLERANCES = [0.0, 0.0, 4e-5, np.inf, 4e-5, 1.5e-4, 0.0, 0.0, 4e-5]


@pytest.mark.parametrize(
    ("name", "exact", "fine", "coarse", "flying", "waiting"),
    [
        ("linuxcnc", "G61", "G64 P0.04", "G64 P0.15", "M62 P0", "M64 P4"),
        ("jb3208", "G61", "G64", "G64", "M20", "M27"),
        ("sinumerik840d", "G60", "G642", "G642", "M20", "M27"),
    ],
)
def test_the_way_to_pass_block_ends_is_stated_where_it_changes(
    name: str, exact: str, fine: str, coarse: str, flying: str, waiting: str
) -> None:
    text = write(blended(MODES, TOLERANCES), load(name), MADE_FROM).decode("ascii")
    modes, events = {exact, fine, coarse}, {flying, waiting}
    found = []
    for line in text.splitlines():
        words = line.split(" ", 1)[-1]
        motion = re.search(r"\bX10[1-5]\b", words)
        if words in modes | events or motion:
            found.append(motion[0] if motion else words)
    assert found == [
        *(exact, fine, "X101", flying, "X102"),
        *([coarse] if coarse != fine else []),
        *("X103", waiting, exact, "X104", fine, "X105"),
    ]


def test_axes_that_a_word_takes_ride_with_it() -> None:
    blocks = [
        (Kind.LINEAR, 0, 0.5, {"x": 101, "d": 3}),
        (Kind.LINEAR, 0, 0.5, {"q": 4, "e": -5}),
        (Kind.LINEAR, 0, 0.5, {"x": 102}),
    ]
    assert linuxcnc_body(blocks, "linuxcnc_remap") == [
        "G61",
        "G0 Z10.000",
        "X100.000 Y0.000 Z10.000 A0.000 C0.000 U0.000 V0.000 Q0.000 D0.000 E5.000 M29",
        "G1 X101.000 D3.000 F120.000 M29",
        "M29 Q4.000 E-5.000",
        "G4 P0.500000",
        "X102.000 F120.000",
    ]


def test_switching_words_that_no_motion_follows_switch_at_once() -> None:
    def switch(event: Event) -> tuple[Any, ...]:
        return (Kind.SWITCH, 0, 0.0, event)

    blocks = [
        switch(Event.SHOE_DOWN),
        switch(Event.HEATER_ON),
        (Kind.LINEAR, 0, 0.5, {"x": 101}),
        switch(Event.KNIFE_2_UP),
        (Kind.LINEAR, 0, 0.25, {"e": -5}),
        switch(Event.HEATER_OFF),
        switch(Event.STOP),
        (Kind.RAPID, 0, 0.5, {"x": 102}),
        switch(Event.KNIFE_1_DOWN),
        (Kind.DWELL, 0, 1.5, {}),
        switch(Event.KNIFE_1_UP),
        (Kind.RAPID, 0, 0.5, {"x": 103}),
        switch(Event.SHOE_UP),
    ]
    assert linuxcnc_body(blocks)[4:] == [
        *("M62 P0", "M62 P4", "G1 X101.000 F120.000", "M65 P3", "M68 E0 Q-5.000", "G4 P0.250000", "M65 P4", "M0"),
        *("G0 X102.000", "M64 P2", "G4 P1.500000", "M63 P2", "X103.000", "M65 P0"),
    ]


@pytest.mark.parametrize("name", ["jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d"])
def test_golden_program_of_every_control(name: str) -> None:
    golden = GOLDEN / ("two_courses.nc" if name == "jb3208" else f"two_courses_{name}.nc")
    assert write(verified(two_courses()), load(name), MADE_FROM) == golden.read_bytes()


@pytest.mark.parametrize(("current", "word"), [(200.0, "M03 S200"), (187.5, "M03 S187.5"), (0.0625, "M03 S0.063")])
def test_an_event_carries_its_level_where_the_table_has_a_letter(current: float, word: str) -> None:
    blocks = [(Kind.RAPID, 0, 0.0, {"x": 1}), (Kind.SWITCH, 0, 0.0, Event.ARC_ON), (Kind.SWITCH, 0, 0.0, Event.AIR_ON)]
    levels = {Event.ARC_ON: current, Event.AIR_ON: 6.0}
    text = write(verified(blocks, ("x",)), load("generic5"), MADE_FROM, levels).decode("ascii")
    assert f" {word}\n" in text and " M08\n" in text
    assert "S" not in write(verified(blocks, ("x",)), load("linuxcnc"), MADE_FROM, levels).decode("ascii")[150:]


def test_golden_program_of_the_spray_robot() -> None:
    axes = ("x", "y", "z", "theta", "phi")
    blocks = [
        (Kind.RAPID, 0, 0.0, {"z": 10}, "z"),
        (Kind.RAPID, 0, 0.0, {"x": 1, "y": 2, "z": 10, "theta": 270, "phi": 15}, axes),
        (Kind.SWITCH, 0, 0.0, Event.AIR_ON),
        (Kind.DWELL, 0, 0.5, {}),
        (Kind.SWITCH, 0, 0.0, Event.ARC_ON),
        (Kind.LINEAR, 0, 0.5, {"x": 151, "theta": 271.5, "phi": 14}),
        (Kind.LINEAR, 0, 0.5, {"theta": 301.5, "phi": 10}),
        (Kind.SWITCH, 0, 0.0, Event.ARC_OFF),
        (Kind.SWITCH, 0, 0.0, Event.AIR_OFF),
        (Kind.RAPID, 0, 0.5, {"z": 10}),
    ]
    assert write(verified(blocks, axes), load("generic5"), MADE_FROM) == (GOLDEN / "spray_generic5.nc").read_bytes()


@pytest.mark.parametrize("name", ["jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d"])
def test_a_program_states_the_hash_of_its_own_text(name: str) -> None:
    """So that whoever would replace it can tell whether anyone edited it."""
    text = write(verified(two_courses()), load(name), MADE_FROM)
    assert unedited(text)
    assert not unedited(text.replace(b"X100", b"X101"))
    assert not unedited(text.replace(b"\n", b"\r\n"))
    assert not unedited(text + b"\n")
    assert not unedited(b"".join(line for line in text.splitlines(keepends=True) if b"text sha256" not in line))
