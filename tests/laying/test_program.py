"""Courses and a setup become blocks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.errors import AxisBeyondTravel, PartTooHigh, TapeRunsBack
from tapelayer.laying.inspection import Inspector
from tapelayer.laying.program import plan
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.stroke import SAME_TIME
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.machines import LENGTHS, TEN_AXES, tape_layer
from tests.helpers.paths import EXAMPLES
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import SQUARE, circle_course, flat_course, helix, helix_course

COLUMN = {name: column for column, name in enumerate(TEN_AXES)}
KNIFE_EVENTS = [Event.KNIFE_1_DOWN, Event.KNIFE_1_UP, Event.KNIFE_2_DOWN, Event.KNIFE_2_UP]
# What lies before the first course: a square leading cut needs no more than the scrap margin.
FIRST_STATION = 0.005
COURSE_EVENTS = [
    Event.SHOE_DOWN,
    Event.HEATER_ON,
    Event.ROLLER_DOWN,
    Event.HEATER_OFF,
    Event.SHOE_UP,
    Event.ROLLER_UP,
]


def planned(*courses: Course, setup: Setup | None = None, machine: Machine | None = None) -> Trajectory:
    return plan(courses, setup or setup_of(), machine or tape_layer())


def wide(lower: float = -720.0, upper: float = 720.0) -> Machine:
    return tape_layer().with_limits({"c": (lower * DEG, upper * DEG), "a": (-40 * DEG, 40 * DEG)}, {})


def at_events(trajectory: Trajectory, event: Event) -> np.ndarray:
    return trajectory.positions[trajectory.events == event]


def test_a_program_begins_with_z_alone_and_then_states_every_axis() -> None:
    trajectory = planned(flat_course())
    assert np.all(np.isnan(trajectory.start))
    assert np.flatnonzero(~np.isnan(trajectory.positions[0])).tolist() == [COLUMN["z"]]
    assert not np.any(np.isnan(trajectory.positions[1:]))
    assert trajectory.stated[:3].tolist() == [1 << COLUMN["z"], (1 << 10) - 1, 0]
    assert [Kind(kind) for kind in trajectory.kinds[:5]] == [Kind.RAPID] * 3 + [Kind.SWITCH, Kind.LINEAR]


def test_every_course_has_its_words_in_order() -> None:
    trajectory = planned(flat_course(1), helix_course(2), flat_course(3))
    for index in range(3):
        of_course = (trajectory.courses == index) & (trajectory.events > 0) & ~np.isin(trajectory.events, KNIFE_EVENTS)
        events = trajectory.events[of_course].tolist()
        assert events == ([Event.SUPPLY_MODE] if index == 0 else []) + COURSE_EVENTS


def test_the_link_goes_up_first_and_down_last() -> None:
    """Z alone up to the link height, sideways there, then down along z to the approach point."""
    setup = setup_of("[process]\nlink_clearance_mm = 60")
    trajectory = planned(flat_course(1), helix_course(2, heading=0.4), setup=setup)
    highest = max(flat_course().points[:, 2].max(), helix_course(heading=0.4).points[:, 2].max()) - 1.4
    rapids = np.flatnonzero((trajectory.kinds == Kind.RAPID) & (trajectory.courses == 1))
    up, over, down = trajectory.positions[rapids]
    before = trajectory.positions[rapids[0] - 1]
    sideways = [i for name, i in COLUMN.items() if name != "z"]
    assert up[COLUMN["z"]] == over[COLUMN["z"]]
    # The edge of the roller, on the side to which it is rolled, keeps the clearance.
    pose = tape_layer().forward(np.array([up, over]), "roller")
    edges = pose[:, 2, 3] - LENGTHS.radius - 75 * MM / 2 * np.abs(pose[:, 2, 1])
    assert np.min(edges) == pytest.approx(highest + 0.06, abs=1e-12)
    assert np.array_equal(up[sideways], before[sideways])
    assert np.array_equal(over[sideways], down[sideways])
    assert down[COLUMN["z"]] > over[COLUMN["z"]]


def test_a_rolled_head_that_cannot_rise_over_the_part_is_refused() -> None:
    """Along a cylinder, 16 degrees down its side: approach and courses are in reach, the roller's edge hangs lower."""
    courses = [helix_course(k, heading=math.pi / 2, start=(0.3, 0.28)) for k in (1, 2)]
    setup = setup_of("[process]\napproach_mm = 5\n[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}")
    free = planned(*courses, setup=setup, machine=wide())
    reached = float(np.min(free.positions[free.kinds == Kind.LINEAR, COLUMN["z"]]))
    rolled = 75 / 2 * math.sin(0.28) + 40 * (1 - math.cos(0.28)) - 5 * math.cos(0.28)
    with pytest.raises(PartTooHigh, match=rf"end of its travel, {reached / MM:g} mm.* is {rolled:.3f} mm below.*l3_mm"):
        planned(*courses, setup=setup, machine=wide().with_limits({"z": (reached, 0.8)}, {}))
    assert planned(*courses, setup=setup, machine=wide().with_limits({"z": (reached - rolled * MM - 1e-9, 0.8)}, {}))


def test_the_link_never_leaves_the_travel() -> None:
    machine = tape_layer().with_limits({"z": (0.59, 0.8)}, {})
    trajectory = planned(
        flat_course(), machine=machine, setup=setup_of("[process]\napproach_mm = 5\nlink_clearance_mm = 500")
    )
    assert np.min(trajectory.positions[:, COLUMN["z"]]) == 0.59


def test_approach_and_retract_are_along_the_heads_normal() -> None:
    course = helix_course(heading=0.4)
    trajectory = planned(course)
    rows = np.flatnonzero(trajectory.events == Event.SHOE_DOWN)
    pose = tape_layer().forward(
        trajectory.positions[[rows[0] - 1, rows[0] - 2, len(trajectory) - 2, len(trajectory) - 1]], "contact"
    )
    for near, far in (pose[:2], pose[2:]):
        assert np.allclose(far[:3, 3] - near[:3, 3], 0.05 * near[:3, 2], atol=1e-12)
        assert np.allclose(far[:3, :3], near[:3, :3], atol=1e-15)


def test_laying_puts_the_roller_on_the_surface_at_every_block() -> None:
    course = helix_course(heading=0.4)
    trajectory = planned(course, setup=setup_of("[head]\nwrap_compensation = false"))
    laid = laying_rows(trajectory)
    arc_lengths = trajectory.positions[laid, COLUMN["u"]] - 0.35 - FIRST_STATION
    points, normals, tangents = helix(arc_lengths, heading=0.4)
    pose = tape_layer().forward_pinocchio(trajectory.positions[laid], "roller")
    centre = points + [0.3, -1.9, -1.4] + LENGTHS.radius * normals
    # Blocks are balanced about the surface: their ends are as far off it as their middles are on the other side.
    assert np.max(np.abs(pose[:, :3, 3] - centre)) < 0.02e-3
    assert np.max(np.abs(-pose[:, :3, 1] - np.cross(tangents, normals))) < 1e-5
    assert arc_lengths[0] == pytest.approx(0.0, abs=1e-15)
    assert arc_lengths[-1] == pytest.approx(0.6, abs=1e-15)


def laying_rows(trajectory: Trajectory, course: int = 0) -> np.ndarray:
    """Rows from the shoe's touch to its lift, the touch itself first."""
    of_course = trajectory.courses == course
    down = np.flatnonzero(of_course & (trajectory.events == Event.SHOE_DOWN))[0]
    up = np.flatnonzero(of_course & (trajectory.events == Event.SHOE_UP))[0]
    rows = np.arange(down, up)
    return rows[(trajectory.kinds[rows] == Kind.LINEAR) | (rows == down)]


def test_tape_is_one_continuous_coordinate_with_wrap() -> None:
    """u = S_k + l + knife_to_nip - R beta(l), S_k behind shared cuts; beta by Pinocchio and exact tangents."""
    courses = [helix_course(1, heading=0.5, start=(0.5, -0.1)), helix_course(2, heading=0.5, start=(0.7, -0.1))]
    trajectory = planned(*courses, machine=wide())
    for index in range(2):
        rows = laying_rows(trajectory, index)
        pose = tape_layer().forward(trajectory.positions[rows], "roller")
        u = trajectory.positions[rows, COLUMN["u"]] - 0.35 - FIRST_STATION - index * 0.6
        arc_lengths = u.copy()
        for _ in range(60):
            _, _, tangents = helix(arc_lengths, heading=0.5, start=(0.5 + 0.2 * index, -0.1))
            beta = np.arctan2(np.sum(tangents * pose[:, :3, 2], axis=1), np.sum(tangents * pose[:, :3, 0], axis=1))
            arc_lengths = u + LENGTHS.radius * beta
        assert np.ptp(beta) > 0.1
        assert arc_lengths[0] == pytest.approx(0.0, abs=1e-8)
        assert arc_lengths[-1] == pytest.approx(0.6, abs=1e-8)
        assert np.all(np.diff(trajectory.positions[rows, COLUMN["u"]]) >= 0)


def test_tape_runs_back_under_no_shoe() -> None:
    """A hollow tighter than the roller."""
    angle = np.linspace(-0.5, 0.5, 81)
    normals = np.stack([0 * angle, -np.sin(angle), np.cos(angle)], axis=1)
    hollow = Course(9, np.array([0.5, 1.0, 0.03]) - 0.03 * normals, normals, 0.03 * (angle + 0.5), SQUARE)
    with pytest.raises(TapeRunsBack, match=r"course 9 point \d+: the tape would run back.*wrap_compensation = false"):
        planned(hollow)
    free = planned(hollow, setup=setup_of("[head]\nwrap_compensation = false"))
    assert np.all(np.diff(free.positions[laying_rows(free), COLUMN["u"]]) > 0)


def test_the_auxiliary_roller_follows_by_its_lag() -> None:
    trajectory = planned(flat_course())
    path = trajectory.positions[:, COLUMN["y"]]
    start, down, end, up = (
        float(at_events(trajectory, event)[0, COLUMN["y"]])
        for event in (Event.SHOE_DOWN, Event.ROLLER_DOWN, Event.SHOE_UP, Event.ROLLER_UP)
    )
    assert [start - down, start - end, start - up] == pytest.approx([0.06, 0.6, 0.66], abs=1e-12)
    assert np.ptp(path[np.flatnonzero(trajectory.events == Event.ROLLER_UP)[0] :]) == 0.0


def test_a_course_shorter_than_the_lag_sets_the_roller_down_in_the_run_out() -> None:
    trajectory = planned(flat_course(length=0.04, n=5))
    start, down, end = (
        float(at_events(trajectory, event)[0, COLUMN["y"]])
        for event in (Event.SHOE_DOWN, Event.ROLLER_DOWN, Event.SHOE_UP)
    )
    assert [start - down, start - end] == pytest.approx([0.06, 0.04], abs=1e-12)


def test_without_run_out_the_roller_lifts_at_the_end() -> None:
    trajectory = planned(flat_course(length=0.04, n=5), setup=setup_of('[head]\nrun_out = "none"'))
    ends = [at_events(trajectory, e)[0, COLUMN["y"]] for e in (Event.ROLLER_DOWN, Event.SHOE_UP, Event.ROLLER_UP)]
    assert len(set(ends)) == 1


def test_run_out_goes_along_the_tangent_with_the_tape_at_rest() -> None:
    course = helix_course(heading=0.4)
    trajectory = planned(course)
    rows = [int(np.flatnonzero(trajectory.events == e)[0]) for e in (Event.SHOE_UP, Event.ROLLER_UP)]
    end, out = tape_layer().forward(trajectory.positions[rows], "roller")
    _, _, tangents = helix(np.array([0.6]), heading=0.4)
    assert np.allclose(out[:3, 3] - end[:3, 3], 0.06 * tangents[0], atol=1e-6)
    assert trajectory.positions[rows[0], COLUMN["u"]] == trajectory.positions[rows[1], COLUMN["u"]]


@settings(deadline=None, max_examples=30)
@given(shoe=st.floats(0, 900), roller=st.floats(0, 900), heater=st.floats(0, 900), length=st.floats(0.02, 0.7))
def test_delays_move_words_ahead_by_just_that_time(shoe: float, roller: float, heater: float, length: float) -> None:
    plain = planned(helix_course(length=length))
    setup = setup_of(f"[head]\ndelays_ms = {{shoe = {shoe!r}, roller = {roller!r}, heater = {heater!r}}}")
    delayed = planned(helix_course(length=length), setup=setup)
    wait = delayed.duration - plain.duration
    assert wait >= -1e-12
    delays = {
        Event.SHOE_DOWN: shoe,
        Event.SHOE_UP: shoe,
        Event.ROLLER_DOWN: roller,
        Event.ROLLER_UP: roller,
        Event.HEATER_ON: heater,
        Event.HEATER_OFF: heater,
    }
    for event, delay in delays.items():
        moved, still = (t.times[np.flatnonzero(t.events == event)[0]] for t in (delayed, plain))
        assert moved + delay * 1e-3 == pytest.approx(still + wait, abs=2 * SAME_TIME)
    # The path is the same at every time: only words moved.
    threaded = plain.times[np.flatnonzero(plain.kinds == Kind.LINEAR)[0]]
    rows = delayed.times > threaded + wait
    for column in range(len(tape_layer().names)):
        there = np.interp(delayed.times[rows] - wait, plain.times[1:], plain.positions[1:, column])
        assert np.allclose(there, delayed.positions[rows, column], atol=SAME_TIME)


def test_no_axis_and_no_nip_is_faster_than_allowed() -> None:
    machine = wide().with_limits({}, {"c": 5 * DEG, "z": 0.2})
    setup = setup_of("[head]\nwrap_compensation = false")
    trajectory = planned(helix_course(heading=0.3), circle_course(2), machine=machine, setup=setup)
    rows = np.flatnonzero(trajectory.kinds == Kind.LINEAR)
    speeds = np.abs(trajectory.positions[rows] - trajectory.begins(rows)) / trajectory.durations[rows, None]
    assert np.all(speeds <= np.array([axis.speed for axis in machine.axes]) * (1 + 1e-9))
    assert np.max(speeds[:, COLUMN["c"]]) == pytest.approx(5 * DEG)
    for index, nip_speed in enumerate((0.25, 0.1 * 5 * DEG)):
        laid = laying_rows(trajectory, index)[1:]
        fed = trajectory.positions[laid, COLUMN["u"]] - trajectory.begins(laid)[:, COLUMN["u"]]
        assert np.max(fed / trajectory.durations[laid]) == pytest.approx(nip_speed, rel=1e-4)


def test_c_stays_in_its_travel_by_whole_turns() -> None:
    """C falls by 396 degrees: in +-330 it has to start at 180, not at -180."""
    trajectory = planned(circle_course(turns=1.1, n=800, phase=math.pi), machine=wide(-330, 330))
    c = trajectory.positions[laying_rows(trajectory), COLUMN["c"]] / DEG
    assert np.ptp(c) == pytest.approx(396, abs=0.01)
    assert -330 <= c.min() < c.max() <= 330


def test_c_stays_near_the_course_before() -> None:
    """After a whole turn the next course is laid where c is, not where it began."""
    circle = circle_course(1)
    after = planned(circle, circle_course(2), machine=wide(-1080, 1080))
    ends = [after.positions[laying_rows(after, k)][[0, -1], COLUMN["c"]] for k in (0, 1)]
    assert ends[1][0] == pytest.approx(ends[0][1], abs=1e-6)


def test_axes_beyond_travel_are_named_all_at_once() -> None:
    with pytest.raises(AxisBeyondTravel) as caught:
        planned(flat_course(4, heading=45 * DEG), flat_course(5, x=-1.0))
    sentences = str(caught.value).splitlines()
    assert sentences[0].startswith("course 5 point ")
    assert "axis x would be at" in sentences[0]
    assert "beyond its bound 0 mm (travel 0 to 2500)" in sentences[0]
    assert sentences[1].startswith("course 4 point ")
    assert "axis c would be at 45.000 deg, beyond its bound 30 deg (travel -30 to 30)" in sentences[1]
    assert "limits_deg = {c = [-180, 180], a = [-30, 30]}" in sentences[2]
    assert len(sentences) == 3


def test_wing_skin_45_says_that_table_1_looks_swapped() -> None:
    courses = read_courses(EXAMPLES / "wing_skin_45.txt")
    with pytest.raises(AxisBeyondTravel, match="look swapped"):
        plan(courses, setup_of(), tape_layer())


def test_planning_is_deterministic() -> None:
    first, second = (planned(helix_course(), flat_course(2)) for _ in range(2))
    assert first.positions.tobytes() == second.positions.tobytes()
    assert first.durations.tobytes() == second.durations.tobytes()


def test_laid_thickness_lifts_the_roller_and_lengthens_the_feed() -> None:
    stack = setup_of("[part]\nlaid_thickness_mm = 5\n[head]\nwrap_compensation = false")
    trajectory = planned(helix_course(heading=0.0), setup=stack)
    fed = np.ptp(trajectory.positions[laying_rows(trajectory), COLUMN["u"]])
    assert fed == pytest.approx(0.6 * (1.5 + 5 * MM) / 1.5, abs=1e-8)
    assert math.isclose(trajectory.duration, trajectory.times[-1])


def test_a_blade_that_turns_alone_turns_while_everything_else_rests() -> None:
    courses = [
        replace(helix_course(k, start=(0.3 + 0.1 * k, 0.0)), cut_angles=(math.radians(a), math.radians(b)))
        for k, (a, b) in enumerate([(90, 60), (40, 130), (75, 90), (110, 35), (50, 50)], 1)
    ]
    free, alone = (plan(courses, setup_of(), tape_layer(), frozenset(axes)) for axes in ("", "e"))
    blade = COLUMN["e"]
    others = [column for column in range(len(tape_layer().names)) if column != blade]
    for trajectory, expected in ((free, False), (alone, True)):
        feeding = np.flatnonzero(trajectory.kinds == Kind.LINEAR)
        steps = trajectory.positions[feeding] - trajectory.begins(feeding)
        turning = steps[:, blade] != 0.0
        assert np.any(turning)
        assert bool(np.max(np.abs(steps[turning][:, others])) < 1e-12) == expected
    assert Inspector(courses, setup_of(), tape_layer()).judge(alone).passed
