"""Path speeds within the axes' jerks: what must hold of any chain, and moves by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits, rest_to_rest
from tapelayer.motion.trajectory import Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.chains import LIMITS, LINUXCNC, LOOK_AHEAD, STOP, by, chains, run

JERKS = np.array([30.0, 20.0, 30.0, 6000 * DEG, 60.0, 100.0])
SMOOTH = replace(LIMITS, jerk=JERKS)
FINE = 20_001


def clock_of(rule: Rule, chain: Trajectory, limits: Limits = SMOOTH) -> Clock:
    clock = by(rule, chain, limits).clock
    assert clock is not None
    return clock


def sampled(found: Trajectory) -> tuple[np.ndarray, np.ndarray, float]:
    """Joints on the straight blocks at even times, the block of each, and the seconds between two."""
    times = np.linspace(0.0, found.duration, FINE)
    blocks = np.minimum(np.searchsorted(found.times, times), len(found) - 1)
    return found.within(blocks, found.fractions(blocks, times)), blocks, float(times[1])


@given(st.sampled_from([STOP, LOOK_AHEAD]), chains())
def test_no_axis_exceeds_its_speed_acceleration_or_jerk_along_a_block(rule: Rule, chain: Trajectory) -> None:
    """By differences of the joints that a control would put out."""
    joints, blocks, step = sampled(by(rule, chain, SMOOTH))
    # What rounding leaves of a joint, in the differences.
    rounding = 1e-13
    for order, limit in enumerate((LIMITS.speed, LIMITS.acceleration, JERKS), start=1):
        changes = np.abs(np.diff(joints, order, axis=0)) / step**order
        inside = blocks[order:] == blocks[:-order]
        beyond = changes[inside] - limit * (1 + 1e-6) - rounding / step**order
        assert np.max(beyond, initial=-1.0) <= 0.0


@given(st.sampled_from([STOP, LOOK_AHEAD]), chains())
def test_what_each_block_is_said_to_reach_is_what_it_reaches(rule: Rule, chain: Trajectory) -> None:
    found = by(rule, chain, SMOOTH)
    clock = found.clock
    assert clock is not None and clock.jerks is not None
    moving = np.flatnonzero(np.diff(clock.reached) > 0.0)
    shares = np.abs(found.directions(moving, np.zeros(len(moving))))
    assert np.all(shares * clock.peaks[moving, None] <= LIMITS.speed * (1 + 1e-9))
    assert np.all(shares * clock.ramps[moving, None] <= LIMITS.acceleration * (1 + 1e-9))
    assert np.all(shares * clock.jerks[moving, None] <= JERKS * (1 + 1e-6))
    times = np.linspace(0.0, found.duration, FINE)
    blocks = np.minimum(np.searchsorted(found.times, times), len(found) - 1)
    assert np.all(clock.speeds_at(times) <= clock.peaks[blocks] * (1 + 1e-9) + 1e-9)


@given(chains())
def test_no_axis_exceeds_its_limits_in_a_corner(chain: Trajectory) -> None:
    found = by(LOOK_AHEAD, chain, SMOOTH)
    clock = found.clock
    assert clock is not None
    if clock.blends is None:
        return
    rows = np.flatnonzero(clock.blends.overlaps > 0.0)
    turns = np.abs(
        found.directions(clock.blends.following[rows], 0.0 * rows) - found.directions(rows, 0.0 * rows + 1.0)
    )
    assert np.all(turns * clock.blends.braking[rows, None] <= LIMITS.acceleration * (1 + 1e-6))
    # The acceleration sets in within the easing.
    easing = clock.blends.easing[rows, None]
    assert np.all(turns * clock.blends.braking[rows, None] <= JERKS * (1 + 1e-6) * easing)
    blocks, shares = np.repeat(np.arange(len(found)), 51), np.tile(np.linspace(0.0, 1.0, 51), len(found))
    off = np.abs(found.rounded(blocks, shares) - found.within(blocks, shares)) / [1, 1, 1, DEG / MM, 1, 1]
    assert np.max(off) <= 2 * 0.04 * MM * (1 + 1e-6)


@given(st.sampled_from([STOP, LOOK_AHEAD]), chains())
def test_the_speed_adds_up_to_the_blocks(rule: Rule, chain: Trajectory) -> None:
    clock = clock_of(rule, chain)
    assert clock.marks[-1] == pytest.approx(clock.reached[-1], rel=1e-9)
    times = np.linspace(0.0, clock.ends[-1], FINE)
    ways = np.append(0.0, np.cumsum(np.diff(times) * clock.speeds_at((times[1:] + times[:-1]) / 2.0)))
    assert np.interp(clock.ends, times, ways) == pytest.approx(clock.reached, abs=1e-5)
    assert np.all(clock.speeds_at(times) >= -1e-12)


@given(st.sampled_from([STOP, LOOK_AHEAD]), chains(), st.integers(0, 2**32 - 1))
def test_the_way_and_the_time_are_each_other_s_inverse(rule: Rule, chain: Trajectory, seed: int) -> None:
    clock = clock_of(rule, chain)
    moving = np.flatnonzero(np.diff(clock.reached) > 0.0)
    shares = np.random.default_rng(seed).uniform(0.0, 1.0, len(moving))
    times = clock.times(moving, shares)
    off = np.abs(clock.fractions(moving, times) - shares) * np.diff(clock.reached)[moving]
    assert np.max(off) < 1e-9


def test_a_run_takes_its_window_longer_and_as_long_as_one_move() -> None:
    """80 mm of X at 250 mm/s, 1500 mm/s2 and 30 m/s3: 50 ms for the jerk, in one block or in many."""
    seconds = rest_to_rest(np.array([0.08]), np.array([0.25]), np.array([1.5]), np.array([30.0]))[0]
    assert seconds == pytest.approx(0.536667, abs=5e-7)
    for count in (1, 2, 7, 40):
        whole = run([{"x": 0.08 / count}] * count, tolerance=0.04 * MM)
        assert by(LOOK_AHEAD, whole, SMOOTH).duration == pytest.approx(seconds, rel=1e-9)
        assert by(LOOK_AHEAD, whole).duration == pytest.approx(seconds - 0.05, rel=1e-9)


@pytest.mark.parametrize("length", [1e-4, 4e-3, 0.03, 0.2, 3.0])
@pytest.mark.parametrize("count", [1, 3])
def test_a_move_is_ruckig_s(length: float, count: int) -> None:
    """Place, speed and acceleration at any moment, in one block or three."""
    ruckig = pytest.importorskip("ruckig", reason="ruckig is an oracle, in the extra `test`")
    asked = ruckig.InputParameter(1)
    asked.current_position, asked.target_position = [0.0], [length]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [0.25], [1.5], [30.0]
    planned = ruckig.Trajectory(1)
    assert ruckig.Ruckig(1).calculate(asked, planned) >= 0
    found = by(LOOK_AHEAD, run([{"x": length / count}] * count, tolerance=0.04 * MM), SMOOTH)
    assert found.duration == pytest.approx(planned.duration, rel=1e-9)
    times = np.linspace(0.0, found.duration, 101)
    blocks = np.minimum(np.searchsorted(found.times, times), len(found) - 1)
    assert found.clock is not None
    places, speeds = found.within(blocks, found.fractions(blocks, times))[:, 0], found.clock.speeds_at(times)
    by_ruckig = np.array([[part[0] for part in planned.at_time(float(time))] for time in times])
    assert places == pytest.approx(by_ruckig[:, 0], abs=1e-9)
    assert speeds == pytest.approx(by_ruckig[:, 1], abs=1e-7)


def test_a_corner_is_as_slow_for_as_long_as_the_jerk_asks() -> None:
    """A right angle between long blocks: an even speed would turn in the time of the limits, and no axis jumps."""
    found = by(LOOK_AHEAD, run([{"x": 0.3}, {"y": 0.3}], tolerance=0.04 * MM), SMOOTH)
    clock = found.clock
    assert clock is not None and clock.blends is not None
    speed = float(clock.speeds_at(clock.ends[1:2])[0])
    width = float(clock.blends.overlaps[0])
    # 20 m/s3 in y bind: the acceleration rises and falls, v = j (t/2)^2, and the tolerance 8 x 0.04 mm is v t.
    assert speed * width == pytest.approx(8 * 0.04 * MM, rel=1e-9)
    assert speed == pytest.approx(20.0 * (width / 2) ** 2, rel=1e-9)
    rising = clock.ends[1] + np.array([0.0, 0.01, 0.02])
    assert np.all(np.diff(clock.speeds_at(rising)) > 0.0)
    assert clock.speeds_at(clock.ends[1] - rising + clock.ends[1]) == pytest.approx(clock.speeds_at(rising), rel=1e-6)


def test_only_what_states_a_jerk_is_slowed_by_it() -> None:
    chain = run([{"x": 0.1}, {"c": 0.5}], tolerance=0.0)
    only_x = replace(LIMITS, jerk=np.array([30.0, *[math.inf] * 5]))
    without, found = by(LOOK_AHEAD, chain), by(LOOK_AHEAD, chain, only_x)
    assert found.durations == pytest.approx(without.durations + [0.05, 0.0], rel=1e-9)


def test_linuxcnc_knows_of_no_jerk() -> None:
    chain = run([{"x": 0.1, "u": 0.1}, {"x": 0.2, "u": 0.1}], tolerance=0.04 * MM)
    found = by(LINUXCNC, chain, SMOOTH)
    assert np.array_equal(found.times, by(LINUXCNC, chain).times)
    assert found.clock is not None and found.clock.jerks is None


@pytest.mark.parametrize("count", [100_000])
def test_many_blocks_do_not_drift(count: int) -> None:
    few, many = (
        clock_of(LOOK_AHEAD, run([{"x": 0.003, "u": 0.003}] * blocks, tolerance=0.04 * MM)) for blocks in (1000, count)
    )
    settled = np.diff(few.ends)[500]
    assert many.ends[-1] == pytest.approx(few.ends[-1] + (count - 1000) * settled, rel=1e-9)
    assert np.max(np.abs(np.diff(many.ends)[500:-500] - settled)) < 1e-9
