"""Words that ask for what blocks reach, on a control that looks ahead: the motion stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import AS_SET, SPARE, at_reach, within_reach
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.chains import LIMITS, LINUXCNC, LOOK_AHEAD, STOP, by, chains, run

SMOOTH = replace(LIMITS, jerk=np.array([30.0, 20.0, 30.0, 6000 * DEG, 60.0, 100.0]))


def asked_speeds(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Speeds that feeds ask for and reach."""
    assert trajectory.clock is not None
    lengths = np.diff(trajectory.clock.reached)
    feeds = np.flatnonzero((trajectory.kinds == Kind.LINEAR) & (lengths > 0.0))
    return lengths[feeds] / trajectory.requested[feeds], trajectory.clock.peaks[feeds]


def on_ramps(trajectory: Trajectory) -> np.ndarray:
    """Whether feeds do nothing but speed up or brake, and are fastest where the next or last block goes on."""
    clock = trajectory.clock
    assert clock is not None
    feeds = np.flatnonzero((trajectory.kinds == Kind.LINEAR) & (np.diff(clock.reached) > 0.0))
    ends = np.stack([clock.speeds_at(clock.ends[feeds]), clock.speeds_at(clock.ends[feeds + 1])])
    even = np.abs(np.diff(clock.reached)[feeds] / clock.durations[feeds] - np.mean(ends, axis=0))
    return (np.max(ends, axis=0) >= clock.peaks[feeds] * (1 - 2 * AS_SET)) & (even <= 2 * AS_SET * clock.peaks[feeds])


@given(chains())
def test_every_word_asks_for_what_its_block_reaches_and_nothing_moves_otherwise(chain: Trajectory) -> None:
    before = by(LOOK_AHEAD, chain)
    found = within_reach(before, LIMITS, LOOK_AHEAD)
    assert found.times == pytest.approx(before.times, abs=1e-9)
    # As a control that reads the words will take them.
    again = by(LOOK_AHEAD, replace(found, durations=found.requested, asked=None, clock=None))
    assert again.times == pytest.approx(before.times, abs=1e-6)
    asked, reached = asked_speeds(found)
    assert np.all(asked >= reached * (1 - 1e-12))
    assert np.all((asked <= reached * (1 + AS_SET) * (1 + 1e-12)) | on_ramps(found))
    assert np.all(found.requested >= before.requested)


@given(chains())
def test_limits_of_jerk_leave_the_motion_too(chain: Trajectory) -> None:
    before = by(LOOK_AHEAD, chain, SMOOTH)
    found = within_reach(before, SMOOTH, LOOK_AHEAD)
    assert found.times == pytest.approx(before.times, abs=1e-7)
    asked, reached = asked_speeds(found)
    assert np.all(asked >= reached * (1 - 1e-9))


def test_a_short_block_asks_for_its_own_speed_and_a_long_one_for_the_set_one() -> None:
    """5 mm from rest to rest at 1500 mm/s2 reach sqrt(1500 x 5) = 86.6 mm/s."""
    found = within_reach(by(LOOK_AHEAD, run([{"x": 0.005}, {"x": 0.5}])), LIMITS, LOOK_AHEAD)
    asked, _ = asked_speeds(found)
    assert asked == pytest.approx([np.sqrt(1.5 * 0.005) * (1 + SPARE), 0.25], rel=1e-9)


def test_blocks_on_one_ramp_ask_for_its_top() -> None:
    """From a stop through short blocks to the set speed, and back: one word for all."""
    steps = [{"x": 0.004}] * 3 + [{"x": 0.2}] + [{"x": 0.004}] * 3
    found = within_reach(by(LOOK_AHEAD, run(steps, tolerance=0.04 * MM)), LIMITS, LOOK_AHEAD)
    asked, reached = asked_speeds(found)
    assert asked == pytest.approx(np.full(7, 0.25), rel=1e-9)
    assert reached[0] < 0.12
    # Too short a way for the set speed: all ask for the top.
    found = within_reach(by(LOOK_AHEAD, run(steps[:3], tolerance=0.04 * MM)), LIMITS, LOOK_AHEAD)
    assert asked_speeds(found)[0][0] == pytest.approx(np.max(asked_speeds(found)[1]) * (1 + SPARE), rel=1e-9)


@pytest.mark.parametrize("rule", [LINUXCNC, STOP])
def test_other_controls_words_stay(rule: Rule) -> None:
    before = by(rule, run([{"x": 0.005}, {"x": 0.5}]))
    assert within_reach(before, LIMITS, rule) is before


@given(chains(), st.floats(1.0, 10.0))
def test_slow_words_are_no_excuse_for_themselves(chain: Trajectory, slower: float) -> None:
    """What blocks reach at set speed does not depend on words that ask for less."""
    set_speed = np.where(chain.kinds == Kind.LINEAR, chain.durations, np.inf)
    slow = replace(chain, durations=np.where(chain.kinds == Kind.LINEAR, slower, 1.0) * chain.durations)
    by_set, by_slow = (at_reach(each, set_speed, LIMITS, LOOK_AHEAD) for each in (chain, slow))
    assert by_slow == pytest.approx(by_set, rel=1e-9)
    assert np.all(by_set >= set_speed)
    assert np.array_equal(at_reach(slow, set_speed, LIMITS, LINUXCNC), set_speed)
