"""The time law against hand values, and what must hold of any law of its kind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tapelayer.machines.machine import Machine
from tapelayer.motion.corners import Corner, Rule
from tapelayer.motion.smoothing import LEAST_WINDOW
from tapelayer.motion.time_law import Limits, at_speed, axis_times, by_feed_word, feeds, rapids, rest_to_rest, timed
from tapelayer.motion.trajectory import Kind, Trajectory
from tests.helpers.chains import AXES, LINUXCNC, LOOK_AHEAD, RULES, STOP, by, chains, run
from tests.helpers.chains import LIMITS as AXES_LIMITS
from tests.helpers.trajectories import straight

LIMITS = Limits.speeds(np.array([0.5, 2.0, 0.25]))
STEPS = arrays(np.float64, (4, 3), elements=st.floats(-10.0, 10.0))
LEAST = arrays(np.float64, 4, elements=st.floats(0.0, 10.0))


def test_a_rapid_takes_what_its_slowest_axis_takes() -> None:
    steps = np.array([[1.0, 1.0, 0.0], [-0.1, 3.0, 0.25], [0.0, 0.0, 0.0]])
    assert rapids(steps, LIMITS).tolist() == [2.0, 1.5, 0.0]
    assert axis_times(steps, LIMITS).tolist() == [[2.0, 0.5, 0.0], [0.2, 1.5, 1.0], [0.0, 0.0, 0.0]]
    assert rapids(np.zeros((0, 3)), LIMITS).shape == (0,)


def test_a_rapid_from_where_nothing_is_stated_counts_as_none() -> None:
    steps = np.array([[np.nan, np.nan, np.nan], [np.nan, 1.0, np.nan]])
    assert rapids(steps, LIMITS).tolist() == [0.0, 0.5]


def test_a_feed_takes_what_is_asked_unless_an_axis_needs_longer() -> None:
    steps = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert feeds(steps, LIMITS, np.array([0.0, 3.0, 0.75])).tolist() == [2.0, 3.0, 0.75]
    assert feeds(np.zeros((0, 3)), LIMITS, np.zeros(0)).shape == (0,)


def test_lengths_at_a_set_speed() -> None:
    assert at_speed(3.0, 0.25) == 12.0
    assert at_speed(np.array([0.0, 0.5]), 0.25).tolist() == [0.0, 2.0]


def test_a_feed_word_is_units_per_minute_or_one_over_the_minutes() -> None:
    lengths, words = np.array([100.0, 100.0]), np.array([1200.0, 30.0])
    assert by_feed_word(lengths, words, np.array([False, True])).tolist() == [5.0, 2.0]


def test_limits_are_those_of_the_axes_in_their_order() -> None:
    machine = Machine.load().with_limits({}, {"y": 0.125})
    limits = Limits.of([machine.axis("y"), machine.axis("c")])
    assert limits.speed.tolist() == [0.125, machine.axis("c").speed]
    with pytest.raises(ValueError, match="read-only"):
        limits.speed[0] = 1.0


@given(STEPS, LEAST, st.sampled_from([0.25, 0.5, 2.0, 8.0]))
def test_distances_scale_times(steps: np.ndarray, least: np.ndarray, share: float) -> None:
    np.testing.assert_allclose(rapids(steps * share, LIMITS), rapids(steps, LIMITS) * share, atol=1e-300)
    scaled = feeds(steps * share, LIMITS, least * share)
    np.testing.assert_allclose(scaled, feeds(steps, LIMITS, least) * share, atol=1e-300)


@given(STEPS)
def test_limits_twice_as_high_halve_the_time(steps: np.ndarray) -> None:
    twice = Limits.speeds(LIMITS.speed * 2.0)
    np.testing.assert_allclose(rapids(steps, twice), rapids(steps, LIMITS) / 2.0, atol=1e-300)
    none = np.zeros(4)
    np.testing.assert_allclose(feeds(steps, twice, none), feeds(steps, LIMITS, none) / 2.0, atol=1e-300)


@given(STEPS, LEAST)
def test_no_axis_exceeds_its_limit_and_one_reaches_it_where_nothing_else_is_asked(
    steps: np.ndarray, least: np.ndarray
) -> None:
    times = feeds(steps, LIMITS, least)
    assert np.all(times >= least) and np.all(times >= rapids(steps, LIMITS))
    assert np.all(np.abs(steps) <= times[:, None] * LIMITS.speed * (1 + 1e-15) + 1e-300)
    assert np.array_equal(feeds(steps, LIMITS, np.zeros(4)), rapids(steps, LIMITS))


@given(STEPS, LEAST)
def test_there_and_back_take_the_same_time(steps: np.ndarray, least: np.ndarray) -> None:
    assert np.array_equal(feeds(-steps, LIMITS, least), feeds(steps, LIMITS, least))


MOVES = arrays(np.float64, 4, elements=st.floats(1e-4, 10.0))


def test_rest_to_rest_in_round_numbers() -> None:
    one = np.ones(1)
    assert rest_to_rest(0.08 * one, 0.25 * one, 1.5 * one)[0] == pytest.approx(0.486667, abs=5e-7)
    assert rest_to_rest(0.08 * one, 0.25 * one, 1.5 * one, 30.0 * one)[0] == pytest.approx(0.536667, abs=5e-7)
    assert rest_to_rest(0.095 * one, one, 5.0 * one)[0] == pytest.approx(0.276, abs=5e-4)
    assert rest_to_rest(np.zeros(1), one, one).tolist() == [0.0]


@given(MOVES, MOVES, MOVES, MOVES)
def test_rest_to_rest_scales_as_motion_does(
    lengths: np.ndarray, speeds: np.ndarray, accelerations: np.ndarray, jerks: np.ndarray
) -> None:
    slow = rest_to_rest(lengths, speeds, accelerations, jerks)
    np.testing.assert_allclose(rest_to_rest(lengths, 2 * speeds, 4 * accelerations, 8 * jerks), slow / 2, rtol=1e-12)
    trapezoid = rest_to_rest(lengths, speeds, accelerations)
    np.testing.assert_allclose(rest_to_rest(lengths, speeds, accelerations, 1e15), trapezoid, rtol=1e-4)
    assert np.all(slow >= trapezoid * (1 - 1e-9))
    assert np.all(trapezoid >= lengths / speeds)


@given(MOVES, MOVES, MOVES, MOVES)
def test_rest_to_rest_is_what_ruckig_says(
    lengths: np.ndarray, speeds: np.ndarray, accelerations: np.ndarray, jerks: np.ndarray
) -> None:
    ruckig = pytest.importorskip("ruckig", reason="ruckig is an oracle, in the extra `test`")
    found = rest_to_rest(lengths, speeds, accelerations, jerks)
    for row in range(len(lengths)):
        asked = ruckig.InputParameter(1)
        asked.current_position, asked.target_position = [0.0], [lengths[row]]
        asked.max_velocity, asked.max_acceleration = [speeds[row]], [accelerations[row]]
        asked.max_jerk = [jerks[row]]
        planned = ruckig.Trajectory(1)
        assert ruckig.Ruckig(1).calculate(asked, planned) >= 0
        assert found[row] == pytest.approx(planned.duration, rel=1e-9)


def faster(rule: Rule) -> Rule:
    """The rule of a control that does everything in half the time."""
    return replace(rule, cycle=rule.cycle / 2, drain=rule.drain / 2)


@given(st.sampled_from(RULES), chains(), st.sampled_from([math.inf, 50.0]))
def test_a_machine_twice_as_quick_takes_half_the_time(rule: Rule, chain: Trajectory, jerk: float) -> None:
    limits = replace(AXES_LIMITS, jerk=np.full(6, jerk))
    quick = Limits(2 * limits.speed, 4 * limits.acceleration, 8 * limits.jerk)
    slow = by(rule, chain, limits)
    halved = by(faster(rule), replace(chain, durations=chain.durations / 2), quick)
    np.testing.assert_allclose(halved.times, slow.times / 2, rtol=1e-9)


@given(st.sampled_from([STOP, LOOK_AHEAD]), chains(stops=False), st.floats(0.0, 1.0))
def test_backwards_it_takes_the_same_time(rule: Rule, chain: Trajectory, jerk: float) -> None:
    chain = replace(chain, tolerances=np.full(len(chain), chain.tolerances[0]))
    places = np.vstack([chain.start, chain.positions])[::-1]
    back = straight(chain.axes, places[1:], chain.durations[::-1], chain.tolerances, start=places[0])
    limits = AXES_LIMITS if jerk < 0.5 else replace(AXES_LIMITS, jerk=np.full(6, 50.0))
    forth = by(rule, chain, limits)
    np.testing.assert_allclose(by(rule, back, limits).durations[::-1], forth.durations, rtol=1e-6, atol=1e-9)


@given(st.sampled_from(RULES), chains())
def test_without_end_to_its_jerk_a_control_makes_trapezoids(rule: Rule, chain: Trajectory) -> None:
    limits = replace(AXES_LIMITS, jerk=np.full(6, 1e15))
    # No window of a run is shorter than this, and a slower block holds for several windows around it.
    windows = 10 * LEAST_WINDOW * len(chain)
    np.testing.assert_allclose(by(rule, chain, limits).times, by(rule, chain).times, rtol=1e-5, atol=windows)
    slower = by(rule, chain, replace(AXES_LIMITS, jerk=np.full(6, 5.0)))
    assert slower.duration >= by(rule, chain).duration


@given(st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_two_passes_do_what_a_loop_does(count: int, seed: int) -> None:
    """A straight chain by a look ahead: speeds at block ends by one loop back and one forth."""
    rng = np.random.default_rng(seed)
    lengths, speeds = 10.0 ** rng.uniform(-3, -1, count), rng.uniform(0.02, 0.9, count)
    tolerances = np.where(rng.random(count) < 0.8, 1e-5, 0.0)
    positions = np.zeros((count, 6))
    positions[:, 0] = np.cumsum(lengths)
    found = by(LOOK_AHEAD, straight(AXES, positions, lengths / speeds, tolerances))
    rate = AXES_LIMITS.acceleration[0]
    ends = [0.0] * (count + 1)
    for i in range(1, count):
        ends[i] = min(speeds[i - 1], speeds[i]) if tolerances[i - 1] else 0.0
    for i in range(count - 1, 0, -1):
        ends[i] = min(ends[i], math.sqrt(ends[i + 1] ** 2 + 2 * rate * lengths[i]))
    for i in range(1, count + 1):
        ends[i] = min(ends[i], math.sqrt(ends[i - 1] ** 2 + 2 * rate * lengths[i - 1]))
    seconds = []
    for i in range(count):
        first, last = ends[i], ends[i + 1]
        top = min(speeds[i], math.sqrt((2 * rate * lengths[i] + first**2 + last**2) / 2))
        ramps = (2 * top**2 - first**2 - last**2) / (2 * rate)
        seconds.append((2 * top - first - last) / rate + max(lengths[i] - ramps, 0.0) / top)
    assert found.durations == pytest.approx(seconds, rel=1e-7, abs=1e-9)


def test_a_path_is_as_fast_as_its_slowest_axis() -> None:
    """100 mm of X with 60 deg of C at 120 deg/s: half a second, and its share of the acceleration."""
    found = by(STOP, run([{"x": 0.1, "c": math.radians(60)}], speed=1.0))
    seconds = rest_to_rest(np.array([0.1]), np.array([0.2]), np.array([1.5]))
    assert found.durations == pytest.approx(seconds)
    assert found.asked is not None and found.asked.tolist() == [0.1]


def test_a_path_along_the_first_group_that_moves() -> None:
    """A block of 2 um in X with a whole stroke of V takes the stroke's time."""
    stroke = by(LINUXCNC, run([{"v": 0.095}], speed=1.0))
    both = run([{"x": 2e-6, "v": 0.095}], speed=1.0)
    found = by(LINUXCNC, replace(both, durations=stroke.requested))
    assert found.durations == pytest.approx(stroke.durations, rel=1e-6)


RADIUS, RAMP = 0.1, 2.0
THREE = Limits(np.full(3, 10.0), np.full(3, RAMP), np.full(3, np.inf))


def round_corner(sweeps: list[float], straight: float = 0.0) -> Trajectory:
    """Arcs in XY about one centre, counterclockwise by angles one after the other, between two tangent straights."""
    angles = np.append(0.0, np.cumsum(sweeps))
    on_circle = RADIUS * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    forward = np.array([-np.sin(angles[-1]), np.cos(angles[-1]), 0.0])
    points = [on_circle[0] - [0.0, straight, 0.0], *on_circle, on_circle[-1] + straight * forward]
    kinds = [Kind.LINEAR, *[Kind.COUNTERCLOCKWISE] * len(sweeps), Kind.LINEAR]
    rows = slice(None) if straight else slice(1, -1)
    count = len(kinds[rows])
    return Trajectory(
        axes=("x", "y", "z"),
        start=np.array(points[rows][0]),
        positions=np.array(points[1:][rows]),
        kinds=np.array(kinds[rows], np.uint8),
        durations=np.full(count, 1e-3),
        events=np.zeros(count, np.uint8),
        courses=np.zeros(count, np.int32),
        stated=np.zeros(count, np.uint16),
        lines=np.zeros(count, np.int32),
        centres=np.zeros((count, 3)),
        planes=np.zeros(count, np.uint8),
        tolerances=np.append(np.full(count - 1, 1e-5), 0.0),
    )


def on_control(trajectory: Trajectory, corner: Corner) -> Trajectory:
    return timed(trajectory, THREE, Rule(corner, paths=((0, 1, 2),), tolerance=1e-5))


@pytest.mark.parametrize("corner", ["stop", "look_ahead", "linuxcnc"])
def test_an_arc_is_as_fast_as_its_turning_allows(corner: Corner) -> None:
    """Turning takes sqrt(3)/2 of the acceleration, so that half of it is left for the ramps."""
    speed, length = np.sqrt(np.sqrt(0.75) * RAMP * RADIUS), np.pi * RADIUS
    by_hand = length / speed + speed / (RAMP / 2.0)
    assert on_control(round_corner([np.pi]), corner).duration == pytest.approx(by_hand, abs=1e-3)


@pytest.mark.parametrize("corner", ["look_ahead", "linuxcnc"])
def test_tangent_arcs_and_straights_are_passed_at_speed(corner: Corner) -> None:
    whole = on_control(round_corner([1.5]), corner)
    assert on_control(round_corner([0.25, 0.75, 0.5]), corner).duration == pytest.approx(whole.duration, rel=1e-2)
    joined = on_control(round_corner([1.5], 0.2), corner)
    assert not np.any(joined.clock.stands[:-1])


@pytest.mark.parametrize("corner", ["stop", "look_ahead"])
def test_no_axis_exceeds_its_acceleration_on_an_arc(corner: Corner) -> None:
    path = on_control(round_corner([0.5, 1.0, 2.0], 0.1), corner)
    times = np.linspace(0.0, path.duration, 4001)
    blocks = np.minimum(np.searchsorted(path.times, times), len(path) - 1)
    places = path.rounded(blocks, path.fractions(blocks, times))
    step = times[1]
    accelerations = np.abs(np.diff(places, 2, axis=0)) / step**2
    assert 0.9 * RAMP < np.max(accelerations) < 1.02 * RAMP
    assert path.positions[-1] == pytest.approx(places[-1])
