"""What the knives cut on the tape, told from the axes, and what becomes of the tape."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.laying.cut_check import judge_cuts
from tapelayer.laying.evidence import Samples, TapeLedger
from tapelayer.laying.laid import Case, Laid
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tapelayer.verification.failures import Failure
from tests.helpers.machines import TEN_AXES, tape_layer
from tests.helpers.plies import exported, job_of
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course, helix_course

REACH = 0.0475  # half of 75 mm and 10 mm of clearance
KNIVES = {1: ("v", "d", Event.KNIFE_1_DOWN, Event.KNIFE_1_UP), 2: ("q", "e", Event.KNIFE_2_DOWN, Event.KNIFE_2_UP)}
OUT = np.array([0.0, 1.0, 0.0])


class Program:
    """A program made by hand, block by block; every motion takes a second."""

    def __init__(self) -> None:
        self.at = dict.fromkeys(TEN_AXES, 0.0) | {"v": REACH, "q": -REACH}
        self.blocks: list[tuple[dict[str, float], Kind, float, Event]] = []

    def go(self, seconds: float = 1.0, **axes: float) -> None:
        kind = Kind.LINEAR if any(self.at[axis] != value for axis, value in axes.items()) else Kind.DWELL
        self.at |= axes
        self.blocks.append((dict(self.at), kind, seconds, Event.NONE))

    def say(self, event: Event) -> None:
        self.blocks.append((dict(self.at), Kind.SWITCH, 0.0, event))

    def sweep(self, station: float, angle: float = 90.0, knife: int = 1, **off: float) -> None:
        """Cut a line at degrees through a station; `off`: along, blade, start and stop, as they miss it."""
        slide, blade, down, up = KNIVES[knife]
        cot = 1.0 / math.tan(angle * DEG) if angle != 90.0 else 0.0
        side = -1.0 if cot > 0.0 else 1.0 if cot < 0.0 else math.copysign(1.0, self.at[slide])
        begin, end = side * REACH, -side * REACH
        begin, end = begin - side * off.get("start", 0.0), end + side * off.get("stop", 0.0)
        u = station + off.get("along", 0.0) - (0.1 if knife == 2 else 0.0)
        turned = (angle - 90.0) * DEG + off.get("blade", 0.0)
        self.go(**{"u": u + begin * cot, slide: begin, blade: turned})
        self.say(down)
        self.go(**{"u": u + end * cot, slide: end})
        self.say(up)

    @property
    def time(self) -> float:
        return sum(seconds for _, _, seconds, _ in self.blocks)

    @property
    def trajectory(self) -> Trajectory:
        count = len(self.blocks)
        start = np.zeros(len(TEN_AXES))
        return Trajectory(
            axes=TEN_AXES,
            start=start,
            positions=np.array([[at[name] for name in TEN_AXES] for at, *_ in self.blocks]),
            kinds=np.array([kind for _, kind, _, _ in self.blocks], np.uint8),
            durations=np.array([seconds for _, _, seconds, _ in self.blocks]),
            events=np.array([event for *_, event in self.blocks], np.uint8),
            courses=np.zeros(count, np.int32),
            stated=np.zeros(count, np.uint16),
            lines=np.arange(1, count + 1, dtype=np.int32),
        )


def laid(number: int, station: float, length: float, *angles: float, begin: float = 0.0, end: float = 0.0) -> Laid:
    start, stop = (angle * DEG for angle in (angles * 2)[:2])
    return Laid(number, 11, (start, stop), length, station, begin, end, OUT)


def judged(program: Program, *courses: Laid, setup: Setup | None = None) -> tuple[TapeLedger, list[Failure]]:
    machine = tape_layer()
    return judge_cuts(
        Case(
            program.trajectory,
            courses,
            Samples.joined([]),
            0.0,
            setup or setup_of(),
            machine,
            np.zeros(len(machine.axes)),
        )
    )


def said(failures: list[Failure]) -> list[tuple[int, str, int]]:
    return [(failure.number, failure.what, failure.line) for failure in failures]


@pytest.mark.parametrize("knife", [1, 2])
@pytest.mark.parametrize("angle", [20.0, 45.0, 89.9, 90.0, 90.1, 135.0, 160.0])
def test_cuts_on_their_lines_are_cuts_made(angle: float, knife: int) -> None:
    program = Program()
    program.sweep(0.5, angle, knife)
    program.sweep(1.5, angle, knife)
    ledger, failures = judged(program, laid(7, 0.5, 1.0, angle))
    assert failures == []
    first, second = ledger.cuts
    assert (first.starting, first.ending, second.starting, second.ending) == (7, 0, 0, 7)
    assert [cut.knife for cut in ledger.cuts] == [knife, knife]
    assert [cut.station for cut in ledger.cuts] == [0.5, 1.5]
    assert [cut.line for cut in ledger.cuts] == [cut.block for cut in ledger.cuts] == [2, 6]
    assert max(cut.error for cut in ledger.cuts) < 1e-12
    assert max(cut.blade_error for cut in ledger.cuts) < 1e-9
    assert ledger.rows[0].cuts == (2, 6)


@pytest.mark.parametrize("off", [-0.3, -0.049, 0.0, 0.049, 0.051, 0.9])
@pytest.mark.parametrize("angle", [20.0, 90.0, 120.0])
def test_a_cut_off_its_line_is_measured_across_it(angle: float, off: float) -> None:
    program = Program()
    program.sweep(0.5, angle)
    program.sweep(1.5, angle, along=off * MM / math.sin(angle * DEG))
    ledger, failures = judged(program, laid(1, 0.5, 1.0, angle))
    assert ledger.cuts[1].error == pytest.approx(abs(off) * MM, abs=1e-12)
    assert said(failures) == ([(1, "cut_error_mm", 6)] if abs(off) > 0.05 else [])


def test_a_bent_cut_is_as_far_off_as_its_middle() -> None:
    program = Program()
    program.sweep(0.5)
    program.go(u=1.5)
    program.say(Event.KNIFE_1_DOWN)
    program.go(u=1.5 + 0.3 * MM, v=0.0)
    program.go(u=1.5 + 0.3 * MM)
    program.go(u=1.5 + 0.6 * MM, v=REACH)
    program.say(Event.KNIFE_1_UP)
    ledger, failures = judged(program, laid(1, 0.5, 1.0, 90))
    # Its end counts up to the error of a cut.
    assert ledger.cuts[1].error == pytest.approx((0.3 + 0.3 * 47.45 / 47.5) * MM)
    assert said(failures) == [(1, "cut_error_mm", 6)]


@pytest.mark.parametrize("turned", [-30.0, -0.06, -0.04, 0.04, 0.06, 10.0])
@pytest.mark.parametrize("knife", [1, 2])
def test_a_blade_across_its_cut_is_measured(turned: float, knife: int) -> None:
    program = Program()
    program.sweep(0.5, 60.0, knife)
    program.sweep(1.5, 60.0, knife, blade=turned * DEG)
    ledger, failures = judged(program, laid(1, 0.5, 1.0, 60))
    assert ledger.cuts[1].blade_error / DEG == pytest.approx(abs(turned), abs=1e-9)
    assert said(failures) == ([(1, "blade_error_deg", 6)] if abs(turned) > 0.05 else [])


@pytest.mark.parametrize("short", ["start", "stop"])
@pytest.mark.parametrize("by", [0.04, 0.1, 5.0, 12.0, 40.0])
def test_a_cut_spans_the_tape_and_both_clearances(short: str, by: float) -> None:
    program = Program()
    program.sweep(0.5, 70.0)
    program.sweep(1.5, 70.0, **{short: by * MM})
    failures = judged(program, laid(1, 0.5, 1.0, 70))[1]
    assert said(failures) == ([(1, "cut_width_mm", 6)] if by > 0.05 else [])
    assert all(failure.value == pytest.approx(95.0 - 2 * by) for failure in failures)


def test_a_cut_that_turns_back_before_the_far_edge_spans_nothing() -> None:
    program = Program()
    program.sweep(0.5)
    program.go(u=1.5)
    program.say(Event.KNIFE_1_DOWN)
    program.go(v=REACH)
    program.go(v=-REACH / 2)
    program.say(Event.KNIFE_1_UP)
    failures = judged(program, laid(1, 0.5, 1.0, 90))[1]
    assert said(failures) == [(1, "cut_width_mm", 6)]


def test_cuts_missing_again_and_astray_are_told_apart() -> None:
    program = Program()
    program.sweep(0.5)
    program.sweep(1.5)
    program.sweep(1.5)
    program.sweep(2.0)
    ledger, failures = judged(program, laid(1, 0.5, 1.0, 90), laid(2, 2.3, 1.0, 90))
    program.go(u=2.5)
    assert said(failures) == [
        (0, "knife_1_off_every_cut_mm", 14),
        (1, "cuts_made", 10),
        (2, "cuts_made", 1),
        (2, "cuts_made", 1),
    ]
    assert failures[0].value == pytest.approx(300.0)
    assert [failure.value for failure in failures[1:]] == [2, 0, 0]
    assert [(cut.starting, cut.ending) for cut in ledger.cuts] == [(1, 0)]


def test_a_missing_cut_shows_where_the_tape_goes_by() -> None:
    program = Program()
    program.sweep(0.5)
    program.go(u=1.4)
    program.go(u=1.7)
    failures = judged(program, laid(1, 0.5, 1.0, 90))[1]
    assert said(failures) == [(1, "cuts_made", 6)]


def test_a_knife_left_down_cuts_to_the_end() -> None:
    program = Program()
    program.sweep(0.5)
    program.sweep(1.5)
    program.blocks.pop()
    program.go(u=1.6)
    failures = judged(program, laid(1, 0.5, 1.0, 90))[1]
    assert [failure.what for failure in failures] == ["knife_1_off_every_cut_mm", "cuts_made"]


def test_one_cut_ends_a_course_and_starts_the_next() -> None:
    program = Program()
    for station in (0.5, 1.5, 2.5):
        program.sweep(station, 45.0)
    ledger, failures = judged(program, laid(1, 0.5, 1.0, 45), laid(2, 1.5, 1.0, 45))
    assert failures == []
    assert [(cut.ending, cut.starting) for cut in ledger.cuts] == [(0, 1), (1, 2), (2, 0)]
    assert [(row.waste_formula, row.waste_knives) for row in ledger.rows][1] == (0.0, 0.0)


def test_courses_closer_than_their_angles_allow_are_refused() -> None:
    """Between 60 and 120 degrees lie 37.5 mm (cot 60 + cot 60) and the margin: 48.301 mm."""
    needed = 37.5 * MM * 2 / math.sqrt(3) + 5 * MM
    for gap, failing in ((needed + 1e-6, False), (needed - 0.04 * MM, False), (needed - 0.06 * MM, True)):
        program = Program()
        program.sweep(0.5, 60.0)
        program.sweep(1.5, 60.0)
        program.sweep(1.5 + gap, 120.0, knife=2)
        program.sweep(2.5 + gap, 120.0)
        ledger, failures = judged(program, laid(1, 0.5, 1.0, 60), laid(2, 1.5 + gap, 1.0, 120, begin=7.5))
        assert said(failures) == ([(2, "waste_before_mm", 15)] if failing else [])
        assert ledger.rows[1].waste_formula == pytest.approx(needed, abs=1e-12)
        assert ledger.rows[1].waste_knives == pytest.approx(max(gap - needed, 0.0), abs=1e-12)


def test_the_ledger_by_hand() -> None:
    """A metre laid from station 0.1 in 4 s with two rests of the tape, 350 mm of it between knife and nip."""
    program = Program()
    program.say(Event.SUPPLY_MODE)
    program.sweep(0.1, 30.0)
    program.go(seconds=3.0, u=0.45)
    program.go(x=0.1)
    begin = program.time
    program.go(u=0.9, x=0.5)
    program.sweep(1.1)
    program.go(seconds=0.5, u=1.45, x=0.6)
    end = program.time
    program.go(seconds=2.0, x=0.7)
    ledger, failures = judged(program, laid(3, 0.1, 1.0, 30, 90, begin=begin, end=end))
    assert failures == []
    (row,) = ledger.rows
    assert (row.course, row.length, row.station, row.laying_stops) == (3, 1.0, 0.1, 1)
    assert row.waste_formula == pytest.approx(37.5 * MM * math.sqrt(3) + 5 * MM)
    assert row.waste_knives == pytest.approx(0.1 - row.waste_formula)
    assert row.waste_roll == 0.0
    assert ledger.used == pytest.approx(1.1)
    assert ledger.waste == pytest.approx(0.1)
    assert ledger.laying == pytest.approx(3.5)
    # To the first sweep, in it, and up to the nip; the way down, the link and the way out are the rest.
    assert ledger.threading == pytest.approx(5.0)
    assert ledger.linking == pytest.approx(3.0)


def test_a_new_roll_begins_at_the_stop() -> None:
    """No shared cut over it; what lies between knife and nip is waste; the edge counts as a square cut."""
    program = Program()
    program.sweep(0.1, 45.0)
    program.sweep(1.1, 45.0)
    program.go(u=1.45)
    program.say(Event.STOP)
    station = 1.45 + 37.5 * MM + 5 * MM + 0.02
    program.sweep(station, 45.0)
    begin = program.time
    program.sweep(station + 1.0, 45.0)
    program.go(u=station + 1.35)
    courses = laid(1, 0.1, 1.0, 45), laid(2, station, 1.0, 45, begin=begin)
    ledger, failures = judged(program, *courses, setup=setup_of("[tape]\nroll_length_m = 1.6"))
    assert failures == []
    assert ledger.rows[1].waste_roll == pytest.approx(0.35)
    assert ledger.rows[1].waste_formula == pytest.approx(42.5 * MM)
    assert ledger.rows[1].waste_knives == pytest.approx(0.02)
    assert len(ledger.cuts) == 4
    # The first roll gives 1.45 m and what stands before it at knife 2, the second 1.4125 m more.
    failures = judged(program, *courses, setup=setup_of("[tape]\nroll_length_m = 1.52"))[1]
    assert said(failures) == [(0, "roll_used_m", 9)]
    assert failures[0].value == pytest.approx(1.55)
    without = Program()
    without.blocks = [block for block in program.blocks if block[3] != Event.STOP]
    failures = judged(without, *courses, setup=setup_of("[tape]\nroll_length_m = 1.6"))[1]
    assert said(failures) == [(0, "roll_used_m", 12)]
    assert failures[0].value == pytest.approx(station + 1.35 + 0.1)


def test_a_stop_before_the_first_course_sets_a_new_edge() -> None:
    program = Program()
    program.sweep(0.1)
    program.say(Event.STOP)
    program.sweep(1.1)
    failures = judged(program, laid(1, 0.1, 1.0, 90, begin=2.5))[1]
    assert said(failures) == [(1, "waste_before_mm", 6)]


def test_knives_act_behind_their_words() -> None:
    """Words a second ahead, for knives that take a second; for prompt ones they stand in the wrong places."""
    cot = 1.0 / math.tan(60.0 * DEG)
    ahead = Program()
    for station, knife in ((0.5, 1), (1.5, 2)):
        slide, blade, down, up = KNIVES[knife]
        u = station - (0.1 if knife == 2 else 0.0)
        ahead.go(**{"u": u - 2 * REACH * cot, slide: -REACH, blade: -30.0 * DEG})
        ahead.say(down)
        ahead.go(u=u - REACH * cot)
        ahead.say(up)
        ahead.go(**{"u": u + REACH * cot, slide: REACH})
    slow = setup_of("[head]\ndelays_ms = {knife = 1000}")
    ledger, failures = judged(ahead, laid(1, 0.5, 1.0, 60), setup=slow)
    assert failures == []
    assert max(cut.error for cut in ledger.cuts) < 1e-12
    assert {failure.what for failure in judged(ahead, laid(1, 0.5, 1.0, 60))[1]} >= {"cuts_made"}


STOPPING = "[machine]\nspeeds_mm_per_s = {v = 5, q = 5}\nlimits_mm = {y = [0, 4000]}\n[tape]\nwidth_mm = 300"


@pytest.mark.parametrize("stop", [2.0, 100.0])
def test_the_heater_is_off_in_stops_that_are_too_long(stop: float) -> None:
    """320 mm at 5 mm/s: the tape stands for 64 s in each square cut, with the shoe down."""
    courses = [flat_course(k, length=1.0, n=11, x=0.4 * k) for k in (1, 2)]
    job = job_of(tuple(courses), setup_of(f"{STOPPING}\n[head]\nheater_stop_s = {stop}"))
    text, evidence = exported(job)
    assert evidence.passed, evidence.worst(5)
    assert [row.laying_stops for row in evidence.tape.rows] == [1, 1]
    words = [line.split()[-1] for line in text.decode().splitlines() if line.endswith(("M20", "M25", "M27", "M28"))]
    pause = ["M28", "M27"] if stop == 2.0 else []
    assert words == ["M20", "M27", *pause, "M28", "M25"] * 2
    trajectory = job.read_back(text, "stops.nc").trajectory
    off, on = (trajectory.times[trajectory.events == event] for event in (Event.HEATER_OFF, Event.HEATER_ON))
    if pause:
        assert on[1::2] - off[::2] == pytest.approx([64.0, 64.0], rel=1e-4)
        fed = trajectory.positions[1:, TEN_AXES.index("u")]
        for begin, end in zip(off[::2], on[1::2], strict=True):
            assert np.ptp(np.interp(np.linspace(begin, end, 9), trajectory.times[1:], fed)) == 0.0


@pytest.mark.parametrize("delay", [0, 35, 400])
@pytest.mark.parametrize("angles", [(90, 90), (45, 120), (160, 20)])
def test_delayed_knives_cut_where_prompt_ones_do(delay: int, angles: tuple[float, float]) -> None:
    """Words stand ahead by the delay, at whatever speed the sweep goes; the lines on the tape are the same."""
    ends = (angles[0] * DEG, angles[1] * DEG)
    courses = tuple(replace(helix_course(k, start=(0.3 + 0.1 * k, 0.0)), cut_angles=ends) for k in (1, 2, 3))
    job = job_of(courses, setup_of(f"[head]\ndelays_ms = {{knife = {delay}}}"))
    planned = job.plan()
    assert planned.evidence.passed
    cuts = planned.evidence.tape.cuts
    prompt = job_of(courses, setup_of()).plan().evidence.tape.cuts
    assert [cut.station for cut in cuts] == pytest.approx([cut.station for cut in prompt], abs=1e-9)
    assert max(cut.error for cut in cuts) < 1e-6
    if delay:
        effects = [
            slides(found.trajectory, found.trajectory.events == Event.KNIFE_1_DOWN, seconds)
            for found, seconds in ((planned, delay * 1e-3), (job_of(courses, setup_of()).plan(), 0.0))
        ]
        np.testing.assert_allclose(effects[0], effects[1], atol=1e-6)
        assert np.all(np.abs(effects[1]) >= REACH - 1e-9)


def slides(trajectory: Trajectory, words: np.ndarray, seconds: float) -> np.ndarray:
    """Where the slide of knife 1 is so many seconds after each of some words."""
    times = trajectory.times[words] + seconds
    blocks = np.searchsorted(trajectory.times, times)
    return trajectory.within(blocks, trajectory.fractions(blocks, times))[:, TEN_AXES.index("v")]


@pytest.mark.parametrize(
    ("first", "second", "formula"),
    [
        ((90, 90), (90, 90), 0.0),
        ((90, 60), (60, 90), 0.0),
        ((90, 60), (120, 90), 37.5 * 2 / math.sqrt(3) + 5),
        ((90, 45), (90, 90), 37.5 + 5),
        ((45, 135), (45, 45), 37.5 * 2 + 5),
        ((90, 30), (60, 90), 37.5 * (math.sqrt(3) - 1 / math.sqrt(3)) + 5),
    ],
)
def test_waste_between_courses_is_the_formulas(
    first: tuple[float, float], second: tuple[float, float], formula: float
) -> None:
    courses = tuple(
        replace(flat_course(k, x=0.4 * k), cut_angles=(start * DEG, end * DEG))
        for k, (start, end) in enumerate((first, second), 1)
    )
    evidence = exported(job_of(courses, setup_of()))[1]
    assert evidence.passed
    row = evidence.tape.rows[1]
    assert row.waste_formula / MM == pytest.approx(formula, abs=1e-9)
    assert row.waste_knives / MM == pytest.approx(0.0, abs=2e-3)
    waste = sum(each.waste_roll + each.waste_formula + each.waste_knives for each in evidence.tape.rows)
    assert evidence.tape.waste == pytest.approx(waste, abs=2e-6)
    assert evidence.tape.used == pytest.approx(1.2 + waste, abs=2e-6)
