"""The time law against hand values, and what must hold of any law of its kind."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tapelayer.machines.machine import Machine
from tapelayer.motion.corners import Corner, Rule
from tapelayer.motion.time_law import Limits, at_speed, axis_times, by_feed_word, feeds, rapids, timed
from tapelayer.motion.trajectory import Kind, Trajectory

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
