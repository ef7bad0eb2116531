"""Clocks of chance chains: where a control is when, and when it is where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import Rule
from tapelayer.motion.trajectory import Trajectory
from tapelayer.units import MM
from tests.helpers.chains import LIMITS, LINUXCNC, LOOK_AHEAD, RULES, by, chains, run

SHARES = np.linspace(0.0, 1.0, 33)


def clock_of(rule: Rule, chain: Trajectory) -> Clock:
    clock = by(rule, chain).clock
    assert clock is not None
    return clock


def within(clock: Clock) -> tuple[np.ndarray, np.ndarray]:
    """Blocks that move, and fractions of the way along them."""
    moving = np.flatnonzero(np.diff(clock.reached) > 0.0)
    return np.repeat(moving, len(SHARES)), np.tile(SHARES, len(moving))


@given(st.sampled_from(RULES), chains())
def test_time_goes_on_and_blocks_end_when_they_do(rule: Rule, chain: Trajectory) -> None:
    clock = clock_of(rule, chain)
    blocks, shares = within(clock)
    times = clock.times(blocks, shares)
    assert np.all(np.diff(times) >= 0.0)
    assert np.array_equal(times[shares == 1.0], clock.ends[blocks[shares == 1.0] + 1])
    assert np.array_equal(times[shares == 0.0], clock.ends[blocks[shares == 0.0]])
    assert np.all(np.diff(clock.moments) >= 0.0) and np.all(np.diff(clock.marks) >= 0.0)
    assert clock.durations.sum() == pytest.approx(clock.ends[-1], rel=1e-12)


@given(st.sampled_from(RULES), chains())
def test_time_and_place_are_each_other_s_inverse(rule: Rule, chain: Trajectory) -> None:
    clock = clock_of(rule, chain)
    blocks, shares = within(clock)
    lengths = np.diff(clock.reached)[blocks]
    times = clock.times(blocks, shares)
    # Where the control crawls, a moment's rounding is no more than this much of the way.
    assert np.all(np.abs(clock.fractions(blocks, times) - shares) * lengths < 1e-8)
    later = clock.times(blocks, clock.fractions(blocks, times))
    standing = clock.stands[blocks]
    assert np.all(np.abs(later - times)[~standing | (shares < 1.0)] < 1e-4)


@given(st.sampled_from(RULES), chains())
def test_the_speed_adds_up_to_the_blocks(rule: Rule, chain: Trajectory) -> None:
    clock = clock_of(rule, chain)
    if not len(clock.marks):
        return
    assert clock.marks[-1] == pytest.approx(clock.reached[-1], rel=1e-9)
    # By the area under the speed, block by block.
    times = np.unique(np.concatenate([clock.ends, clock.moments]))
    middles = (times[1:] + times[:-1]) / 2.0
    ways = np.append(0.0, np.cumsum(np.diff(times) * clock.speeds_at(middles)))
    assert np.interp(clock.ends, times, ways) == pytest.approx(clock.reached, abs=1e-8)
    assert np.all(clock.speeds_at(times) >= -1e-12)


@given(st.sampled_from(RULES), chains())
def test_the_control_is_at_rest_where_it_stands_and_passes_through_that_point(rule: Rule, chain: Trajectory) -> None:
    found = by(rule, chain)
    clock = found.clock
    assert clock is not None
    moving = np.flatnonzero(np.diff(clock.reached) > 0.0)
    still = moving[clock.stands[moving]]
    assert np.max(np.abs(found.rounded(still, np.ones(len(still))) - found.positions[still])) < 1e-12
    assert clock.stands[moving[-1]]
    assert np.all(clock.stands[moving] | (chain.tolerances[moving] > 0.0) | (rule.corner == "linuxcnc"))
    assert clock.speeds_at(clock.ends[still + 1]) == pytest.approx(np.zeros(len(still)), abs=1e-5)


@given(chains())
def test_a_look_ahead_leaves_the_blocks_no_further_than_it_may(chain: Trajectory) -> None:
    """Where a block is so short that its turns run into each other, by no more than both."""
    found = by(LOOK_AHEAD, chain)
    clock = found.clock
    assert clock is not None
    blocks, shares = within(clock)
    off = np.abs(found.rounded(blocks, shares) - found.within(blocks, shares)) / [1, 1, 1, np.pi / 180 / MM, 1, 1]
    assert np.max(off) <= 2 * 0.04 * MM * (1 + 1e-6)
    if clock.blends is not None:
        turns = clock.blends.overlaps
        apart = turns[clock.blends.preceding] + turns <= clock.durations
        assert np.max(off[apart[blocks]], initial=0.0) <= 0.04 * MM * (1 + 1e-6)


@given(chains(stops=False))
def test_no_axis_exceeds_its_speed_or_its_acceleration(chain: Trajectory) -> None:
    """In the joints of a look ahead, sampled as a control would put them out."""
    found = by(LOOK_AHEAD, chain)
    clock = found.clock
    assert clock is not None
    times = np.linspace(0.0, clock.ends[-1], 4001)
    blocks = np.clip(np.searchsorted(clock.ends, times, side="right") - 1, 0, len(found) - 1)
    joints = found.rounded(blocks, found.fractions(blocks, times))
    speeds = np.diff(joints, axis=0) / times[1]
    assert np.all(np.abs(speeds) <= LIMITS.speed * (1 + 1e-6) + 1e-9)
    # Along each block, and over each corner as if it were passed at an even speed.
    slopes = np.diff(clock.speeds) / np.maximum(np.diff(clock.moments), 1e-9)
    ramps = clock.ramps[:, None] * np.abs(found.directions(np.arange(len(found)), np.ones(len(found))))
    assert np.all(ramps <= LIMITS.acceleration * (1 + 1e-9))
    assert np.all(np.abs(slopes[np.diff(clock.moments) > 1e-6]) <= np.max(clock.ramps) * (1 + 1e-6))
    if clock.blends is not None:
        rows = np.flatnonzero(clock.blends.overlaps > 0.0)
        turns = found.directions(clock.blends.following[rows], 0.0 * rows) - found.directions(rows, 0.0 * rows + 1.0)
        assert np.all(np.abs(turns) * clock.blends.braking[rows, None] <= LIMITS.acceleration * (1 + 1e-6))


@given(chains(stops=False), st.integers(0, 11), st.floats(0.05, 0.95))
def test_a_block_split_in_two_changes_nothing_for_a_look_ahead(chain: Trajectory, row: int, share: float) -> None:
    row %= len(chain)
    middle = chain.begins(np.array([row])) + share * (chain.positions[row] - chain.begins(np.array([row])))
    columns = {
        "positions": np.insert(chain.positions, row, middle, axis=0),
        "durations": np.insert(chain.durations, row, share * chain.durations[row]),
        "tolerances": np.insert(chain.tolerances, row, 0.04 * MM),
    }
    columns["durations"][row + 1] *= 1.0 - share
    for name in ("kinds", "events", "courses", "stated", "lines"):
        values = getattr(chain, name)
        columns[name] = np.insert(values, row, values[row])
    whole, split = by(LOOK_AHEAD, chain), by(LOOK_AHEAD, replace(chain, **columns))
    # A tenth of a block: a corner is rounded off in no more than half of either block.
    shorter = np.diff(whole.clock.reached) if whole.clock is not None else np.zeros(0)
    if np.min(shorter) > 0.01:
        assert np.delete(split.times, row) == pytest.approx(whole.times, rel=1e-9, abs=1e-9)
    assert split.duration >= whole.duration * (1 - 1e-9)


@pytest.mark.parametrize("rule", RULES)
def test_a_hundred_thousand_blocks_do_not_drift(rule: Rule) -> None:
    count = 100_000
    few, many = (
        clock_of(rule, run([{"x": 0.003, "u": 0.003}] * blocks, tolerance=0.04 * MM)) for blocks in (1000, count)
    )
    settled = np.diff(few.ends)[500]
    assert many.ends[-1] == pytest.approx(few.ends[-1] + (count - 1000) * settled, rel=1e-9)
    assert np.max(np.abs(np.diff(many.ends)[500:-500] - settled)) < 1e-9
    assert many.marks[-1] == pytest.approx(0.003 * count, rel=1e-9)
    blocks = np.arange(0, count, 997)
    middle = many.times(blocks, np.full(len(blocks), 0.5))
    assert many.fractions(blocks, middle) == pytest.approx(np.full(len(blocks), 0.5), abs=1e-6)


def test_a_control_without_ramps_goes_through_each_block_at_an_even_speed() -> None:
    clock = Clock.even(np.array([0.0, 2.0, 2.0, 3.0]), np.array([4.0, 1.0, 0.5]), np.zeros(3, np.bool_))
    blocks = np.array([0, 0, 1, 2])
    times = clock.times(blocks, np.array([0.25, 1.0, 0.5, 0.5]))
    assert times.tolist() == [1.0, 4.0, 4.5, 5.25]
    assert clock.fractions(blocks, times).tolist() == [0.25, 1.0, 0.5, 0.5]
    assert clock.peaks.tolist() == [0.5, 0.0, 2.0]
    before, after = clock.corners(blocks, np.full(4, 0.5))
    assert not np.any(before) and not np.any(after)


def test_a_blend_rounds_a_corner_within_what_is_stated() -> None:
    """LinuxCNC's P bounds the blend of X Y Z: 0.04 mm, and what half a cycle adds."""
    found = by(LINUXCNC, run([{"x": 0.1, "u": 0.1}, {"y": 0.1, "u": 0.1}], tolerance=0.04 * MM))
    blocks = np.repeat([0, 1], 2001)
    shares = np.tile(np.linspace(0.0, 1.0, 2001), 2)
    way = found.rounded(blocks, shares)[:, :2]
    distance = np.min(np.linalg.norm(way - [0.1, 0.0], axis=1))
    assert 0.03 * MM < distance <= 0.044 * MM
