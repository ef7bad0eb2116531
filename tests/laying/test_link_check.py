"""Two level courses, and everything that the head may do wrong between and beside laying them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.laying.inspection import Inspector
from tapelayer.laying.laid import Case, Laid
from tapelayer.laying.link_check import judge_sequence
from tapelayer.laying.program import plan
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tapelayer.verification.failures import Failure
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course
from tests.helpers.trajectories import reordered, untimed

MACHINE = Machine.load()
COLUMN = {name: column for column, name in enumerate(MACHINE.names)}
COURSES = (flat_course(7, length=0.3, n=4), flat_course(8, length=0.3, n=4, x=0.6))
INSPECTOR = Inspector(COURSES, setup_of(), MACHINE)
PLANNED = untimed(plan(COURSES, setup_of(), MACHINE))
# Every block has the line of its index.
GOOD = replace(PLANNED, lines=np.arange(len(PLANNED), dtype=np.int32))
ALONG_Y = np.array([0.0, 1.0, 0.0])
NO_DIGITS = np.zeros(len(MACHINE.names))

Change = Callable[[Trajectory], Trajectory]
# What fails: the course, what, value and limit, and the line.
Wrong = list[tuple[int, str, object, object, int]]


def word(event: Event, number: int = 0) -> int:
    """The block with a word, by its number from 0."""
    return int(np.flatnonzero(GOOD.events == event)[number])


THREADING = word(Event.KNIFE_1_UP) + 1
PLUNGE = word(Event.SHOE_DOWN) - 1
CUT_AT_REST = word(Event.KNIFE_1_DOWN, 2) + 1
RUN_OUT = word(Event.SHOE_UP) + 1
RETRACT = RUN_OUT + 2
CLIMB, LINK, DESCENT, PLUNGE_2 = range(RETRACT + 1, RETRACT + 5)


def test_the_program_is_the_one_that_is_broken_below() -> None:
    rows = [THREADING, PLUNGE, CUT_AT_REST, RUN_OUT, RETRACT, CLIMB, LINK, DESCENT, PLUNGE_2]
    assert GOOD.kinds[rows].tolist() == [Kind.LINEAR] * 5 + [Kind.RAPID] * 3 + [Kind.LINEAR]
    steps = np.abs(GOOD.positions[rows] - GOOD.begins(np.array(rows)))
    moved = [{name for name, column in COLUMN.items() if row[column] > 1e-9} for row in steps]
    assert moved == [{"u"}, {"z"}, {"v"}, {"y"}, {"z"}, set(), {"x", "y"}, set(), {"z"}]


def at(axis: str, value: float, *rows: int) -> Change:
    """An axis stands at a value in mm or degrees at the end of blocks."""

    def change(trajectory: Trajectory) -> Trajectory:
        positions = trajectory.positions.copy()
        positions[list(rows), COLUMN[axis]] = value * (DEG if axis in "cade" else MM)
        return replace(trajectory, positions=positions)

    return change


def lasting(seconds: float, row: int) -> Change:
    def change(trajectory: Trajectory) -> Trajectory:
        durations = trajectory.durations.copy()
        durations[row] = seconds
        return replace(trajectory, durations=durations)

    return change


def rapid(row: int) -> Change:
    def change(trajectory: Trajectory) -> Trajectory:
        kinds = trajectory.kinds.copy()
        kinds[row] = Kind.RAPID
        return replace(trajectory, kinds=kinds)

    return change


def rows_of(trajectory: Trajectory, rows: Floats) -> Trajectory:
    return reordered(trajectory, rows)


def without(row: int) -> Change:
    return lambda trajectory: rows_of(trajectory, np.delete(np.arange(len(trajectory)), row))


def saying(event: Event, *rows: int) -> Change:
    """A word more behind each of some blocks, which keeps the block's line."""

    def change(trajectory: Trajectory) -> Trajectory:
        added = [int(np.flatnonzero(trajectory.lines == row)[-1]) for row in rows]
        order = np.sort(np.append(np.arange(len(trajectory)), added))
        again = np.append(False, order[1:] == order[:-1])
        longer = rows_of(trajectory, order)
        events, kinds, durations = longer.events.copy(), longer.kinds.copy(), longer.durations.copy()
        events[again], kinds[again], durations[again] = event, Kind.SWITCH, 0.0
        return replace(longer, events=events, kinds=kinds, durations=durations)

    return change


def case_of(trajectory: Trajectory, setup: Setup, digits: Floats = NO_DIGITS) -> Case:
    delay = setup.head.delays_ms.shoe * 1e-3
    begins, ends = (trajectory.times[trajectory.events == event] + delay for event in (Event.SHOE_DOWN, Event.SHOE_UP))
    laid = [
        Laid(course.number, 4, (90 * DEG, 90 * DEG), 0.3, 0.3 * index, float(begin), float(end), ALONG_Y)
        for index, (course, begin, end) in enumerate(zip(COURSES, begins, ends, strict=True))
    ]
    samples = Inspector(COURSES, setup, MACHINE).judge(trajectory).samples
    return Case(trajectory, laid, samples, INSPECTOR.highest, setup, MACHINE, digits)


def judged(*changes: Change, text: str = "", digits: Floats = NO_DIGITS) -> tuple[float, list[Failure]]:
    trajectory = GOOD
    for change in changes:
        trajectory = change(trajectory)
    return judge_sequence(case_of(trajectory, setup_of(text), digits))


def check(failures: list[Failure], wrong: Wrong) -> None:
    def near(value: object) -> object:
        return value if isinstance(value, str) else pytest.approx(value, abs=1e-6)

    found = [(failure.number, failure.what, failure.value, failure.limit, failure.line) for failure in failures]
    assert found == [tuple(map(near, row)) for row in wrong]
    assert all(failure.point == 0 and failure.of == "course" for failure in failures)


def test_what_was_planned_keeps_everything() -> None:
    clearance, failures = judged()
    assert failures == []
    assert clearance == pytest.approx(50 * MM, abs=1e-9)


@pytest.mark.parametrize(("delay", "failing"), [(0.9, False), (1.1, True), (50.0, True)])
def test_the_heater_is_on_from_start_to_end(delay: float, failing: bool) -> None:
    """Its words stand at the ends of the courses, as for a heater that acts at once."""
    failures = judged(text=f"[head]\ndelays_ms = {{heater = {delay}}}")[1]
    wrong: Wrong = []
    for what, event, behind in (("on", Event.HEATER_ON, 1), ("off", Event.HEATER_OFF, 2)):
        rows = word(event), word(event, 1)
        # 50 ms after its end a course has run out: what is laid next is another one.
        late = (7, 8) if what == "on" else (8, 8)
        wrong += [(late[k], f"heater_{what}_astray_ms", delay, 1.0, rows[k]) for k in range(2)]
        wrong += [
            (number, f"heater_{what}_words", 0, 1, row + behind) for number, row in zip((7, 8), rows, strict=True)
        ]
    check(failures, wrong if failing else [])


def test_a_heater_word_that_is_missing_or_too_many_is_named() -> None:
    for event, what in ((Event.HEATER_ON, "on"), (Event.HEATER_OFF, "off")):
        failures = judged(without(word(event, 1)))[1]
        assert [(f.number, f.what, f.value, f.limit) for f in failures] == [(8, f"heater_{what}_words", 0, 1)]
    # In the middle of a course, 1.095 s behind its start and 0.2 s before its end.
    check(judged(saying(Event.HEATER_ON, CUT_AT_REST))[1], [(7, "heater_on_astray_ms", 1095.0, 1.0, CUT_AT_REST)])
    check(judged(saying(Event.HEATER_OFF, CUT_AT_REST))[1], [(7, "heater_off_astray_ms", 200.0, 1.0, CUT_AT_REST)])


@pytest.mark.parametrize("seconds", [1.9, 1.9995, 2.0005, 2.1])
@pytest.mark.parametrize("pausing", [False, True])
def test_the_heater_is_off_in_long_stops_only(seconds: float, pausing: bool) -> None:
    """Two seconds are allowed; within a millisecond of them it may be on or off."""
    changes = [lasting(seconds, CUT_AT_REST)]
    if pausing:
        changes += [saying(Event.HEATER_OFF, CUT_AT_REST - 1), saying(Event.HEATER_ON, CUT_AT_REST)]
    failures = judged(*changes)[1]
    if seconds == 2.1 and not pausing:
        check(failures, [(7, "heater_on_words", 0, 1, CUT_AT_REST + 2), (7, "heater_off_words", 0, 1, CUT_AT_REST)])
    elif seconds == 1.9 and pausing:
        assert [failure.what for failure in failures] == ["heater_on_astray_ms", "heater_off_astray_ms"]
    else:
        assert failures == []


def test_the_auxiliary_roller_goes_down_and_up_once_a_course() -> None:
    down, up = word(Event.ROLLER_DOWN), word(Event.ROLLER_UP)
    check(judged(without(down))[1], [(7, "auxiliary_roller_down_words", 0, 1, RUN_OUT)])
    check(judged(without(up))[1], [(7, "auxiliary_roller_up_words", 0, 1, RUN_OUT)])
    check(judged(saying(Event.ROLLER_UP, CUT_AT_REST))[1], [(7, "auxiliary_roller_up_words", 2, 1, up)])
    check(judged(saying(Event.ROLLER_DOWN, LINK))[1], [(7, "auxiliary_roller_down_words", 2, 1, LINK)])


@pytest.mark.parametrize(("delay", "off"), [(0.1, 0.025), (0.3, 0.075), (40.0, 10.0)])
def test_the_auxiliary_roller_follows_by_its_lag(delay: float, off: float) -> None:
    """At 250 mm/s a late word is late by a quarter of a millimetre a millisecond."""
    failures = judged(text=f"[head]\ndelays_ms = {{roller = {delay}}}")[1]
    down = [failure for failure in failures if failure.what == "auxiliary_roller_down_mm"]
    rows = [word(Event.ROLLER_DOWN), word(Event.ROLLER_DOWN, 1)]
    wrong = [(number, "auxiliary_roller_down_mm", 60 + off, 60, row) for number, row in zip((7, 8), rows, strict=True)]
    check(down, wrong if off > 0.05 else [])  # type: ignore[arg-type]
    # At its end the head goes up already; how far it has come is measured from the course's end.
    up = [failure.value - 360 for failure in failures if failure.what == "auxiliary_roller_up_mm"]
    assert all(0.0 < late < off for late in up) and len(up) == (2 if delay == 40.0 else 0)


def test_the_head_runs_out_along_the_tangent() -> None:
    up = word(Event.ROLLER_UP)
    short = judged(at("y", 1000, RUN_OUT, up, RETRACT, CLIMB))[1]
    check(short, [(7, "auxiliary_roller_up_mm", 340, 360, up), (7, "run_out_mm", 40, 60, RETRACT)])
    # Across the tangent by more than a position may be off, and within that.
    aside = judged(at("x", 801, RUN_OUT, up, RETRACT, CLIMB))[1]
    assert (aside[0].what, aside[0].value, aside[0].line) == ("run_out_mm", 0.0, RUN_OUT)
    assert judged(at("x", 800.04, RUN_OUT, up, RETRACT, CLIMB))[1] == []


def test_a_head_that_does_not_run_out_retracts_at_once() -> None:
    failures = judged(text='[head]\nrun_out = "none"')[1]
    up = word(Event.ROLLER_UP), word(Event.ROLLER_UP, 1)
    check(
        failures[:2],
        [(7, "auxiliary_roller_up_mm", 360, 300, up[0]), (7, "retract_mm", 0, 50, RUN_OUT)],
    )


@pytest.mark.parametrize("course", [7, 8])
def test_the_head_comes_and_goes_along_its_normal(course: int) -> None:
    more = 0 if course == 7 else word(Event.SHOE_UP, 1) - word(Event.SHOE_UP)
    retract = RETRACT + more
    check(judged(rapid(retract))[1], [(course, "retract_mm", 0, 50, retract)])
    plunge = PLUNGE if course == 7 else PLUNGE_2
    check(judged(rapid(plunge))[1], [(course, "plunge_mm", 0, 50, plunge)])


def test_coming_and_going_take_the_whole_approach() -> None:
    check(judged(at("z", 570, RETRACT))[1], [(7, "retract_mm", 30, 50, RETRACT)])
    check(judged(at("z", 580, DESCENT))[1], [(8, "plunge_mm", 20, 50, DESCENT)])
    assert judged(text="[process]\napproach_mm = 49.96")[1] == []
    assert judged(at("z", 550.04, RETRACT))[1] == []


def test_the_head_comes_and_goes_no_faster_than_it_lays() -> None:
    quick: Wrong = [(7, "approach_speed_mm_per_s", 500, 250, RETRACT)]
    check(judged(lasting(0.1, RETRACT))[1], quick)
    check(judged(lasting(0.1, PLUNGE_2))[1], [(8, "approach_speed_mm_per_s", 500, 250, PLUNGE_2)])
    check(judged(lasting(0.12, RUN_OUT))[1], [(7, "approach_speed_mm_per_s", 500, 250, RUN_OUT)])
    # Two written digits are known to be doubtful.
    digits = np.where(np.isin(np.arange(10), [COLUMN[axis] for axis in "xyz"]), 13 * MM, 0.0)
    assert judged(lasting(0.1, RETRACT), digits=digits)[1] == []


def test_the_head_links_over_the_part() -> None:
    clearance, failures = judged(at("z", 570, CLIMB, LINK))
    check(failures, [(8, "link_clearance_mm", 30, 50, LINK)])
    assert clearance == pytest.approx(30 * MM, abs=1e-9)
    # In the middle of a link that goes down and up no end says so.
    clearance, failures = judged(at("z", 610, LINK))
    check(failures[:1], [(8, "link_clearance_mm", -10, 50, LINK)])
    # The way to where every axis is stated is one, too.
    check(judged(at("z", 570, 1, 2))[1], [(7, "link_clearance_mm", 30, 50, 1)])


def test_the_setup_says_how_high_the_head_links() -> None:
    assert judged(text="[process]\nlink_clearance_mm = 50")[1] == []
    assert judged(at("z", 570, CLIMB, LINK), text="[process]\nlink_clearance_mm = 30")[1] == []
    high = judged(text="[process]\nlink_clearance_mm = 2000")[1]
    assert [(failure.number, failure.limit) for failure in high] == [(7, 2000.0), (8, 2000.0)]
    # At the end of its travel the head can go no higher.
    top = at("z", MACHINE.axis("z").lower / MM, 1, 2, CLIMB, LINK, DESCENT)
    failures = judged(top, text="[process]\nlink_clearance_mm = 2000")[1]
    assert "link_clearance_mm" not in {failure.what for failure in failures}


def test_a_head_that_turns_in_the_air_turns_over_the_part() -> None:
    turned = at("c", 5, CLIMB)
    check(judged(turned, at("z", 570, CLIMB), at("z", 550, LINK))[1][:1], [(8, "link_clearance_mm", 30, 50, CLIMB)])
    assert "retract_mm" in {failure.what for failure in judged(at("c", 5, RETRACT, CLIMB))[1]}


def test_tape_and_knives_move_by_feed() -> None:
    check(judged(rapid(THREADING))[1], [(7, "head_moves_in_rapids", 1, 0, THREADING)])
    knife = word(Event.KNIFE_1_DOWN) + 1
    check(judged(rapid(knife), rapid(THREADING))[1], [(7, "head_moves_in_rapids", 2, 0, knife)])
    check(judged(at("d", 9, LINK, DESCENT))[1], [(8, "head_moves_in_rapids", 1, 0, LINK)])


@pytest.mark.parametrize(("seconds", "failing"), [(1.2, False), (1.19999, False), (1.1999, True), (0.6, True)])
def test_the_tape_is_threaded_no_faster_than_it_may_be(seconds: float, failing: bool) -> None:
    failures = judged(lasting(seconds, THREADING))[1]
    check(failures, [(7, "thread_speed_mm_per_s", 300 / seconds, 250, THREADING)] if failing else [])
    digits = np.where(np.arange(10) == COLUMN["u"], 0.16, 0.0)
    assert judged(lasting(seconds, THREADING), digits=digits)[1] == []
