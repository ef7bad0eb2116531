"""Corner rules against what a real control was seen to do, in numbers found with a stopwatch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import ON_THE_FLY, Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.chains import AXES, LIMITS, LINUXCNC, LOOK_AHEAD, STOP, at_feed, by, chains, run
from tests.helpers.trajectories import straight

ROUNDED = 0.04 * MM


@pytest.mark.parametrize(("length", "exact", "blended"), [(20, 86.6, 122.3), (40, 122.5, 173.2), (84, 167.0, 250.0)])
def test_equal_blocks_are_passed_at_the_speed_measured(length: float, exact: float, blended: float) -> None:
    """In mm and mm/s, 250 asked for, with u moving along."""
    steps = [{"x": length * MM, "u": length * MM}] * 41
    for tolerance, speed in ((0.0, exact), (ROUNDED, blended)):
        times = by(LINUXCNC, run(steps, tolerance=tolerance)).times
        assert 20 * length / (times[30] - times[10]) == pytest.approx(speed, rel=3e-3)


def test_a_speed_is_held_where_a_block_is_twice_its_braking_way() -> None:
    lengths = np.array([0.02, 0.04, 0.0833])
    assert LINUXCNC.held(lengths, np.full(3, 1.5)) == pytest.approx([0.1225, 0.1732, 0.25], rel=1e-3)
    assert np.all(np.isinf(LOOK_AHEAD.held(lengths, np.full(3, 1.5))))
    held = by(LINUXCNC, run([{"x": 0.0834, "u": 0.0834}] * 9, tolerance=ROUNDED))
    middle = np.linspace(held.times[2], held.times[5], 400)
    assert held.clock is not None
    assert np.min(held.clock.speeds_at(middle)) == pytest.approx(0.25, rel=0.01)


def test_a_kink_between_plain_blocks_costs_a_tenth_of_the_acceleration() -> None:
    """50 mm of Z: 0.448 s alone, 0.472 s after a block in X, Y, Z under an exact stop."""
    alone = by(LINUXCNC, run([{"z": 0.05}]))
    assert alone.durations == pytest.approx([0.448], abs=1e-3)
    after = by(LINUXCNC, run([{"x": 0.1, "y": 0.02, "z": 0.03}, {"z": 0.05}]))
    assert after.durations[1] == pytest.approx(0.472, abs=1e-3)


def test_a_knife_stroke_from_rest_to_rest() -> None:
    assert by(LINUXCNC, run([{"v": 0.095}], speed=1.0)).durations == pytest.approx([0.276], abs=1e-3)


def test_a_blended_block_before_a_word_that_waits_has_half_its_acceleration() -> None:
    """5.906 mm of Z before M68: 0.218 s under G64, 0.154 s under G61."""
    for tolerance, seconds in ((ROUNDED, 0.218), (0.0, 0.154)):
        blocks = run([{"z": 5.906 * MM}, {}, {"x": 0.1}], tolerance=tolerance)
        kinds = np.array([Kind.LINEAR, Kind.SWITCH, Kind.LINEAR], dtype=np.uint8)
        blocks = replace(blocks, kinds=kinds, tolerances=np.array([tolerance, 0.0, tolerance]))
        found = by(LINUXCNC, replace(blocks, durations=np.array([0.02, 0.0, 0.4])))
        assert found.durations[0] == pytest.approx(seconds, abs=1e-3)
        assert found.durations[1] == pytest.approx(LINUXCNC.drain)


def test_a_corner_of_plain_blocks_is_an_arc_within_its_tolerance() -> None:
    """Turns of a gun between passes: 360 mm at 300 mm/s with 2 m/s2 took 1.3348 s from middle to middle of its arcs.

    A right angle rounded off by 1 mm is an arc of 2.414 mm, passed at 64.66 mm/s.
    """
    limits = replace(LIMITS, acceleration=np.full(6, 2.0))
    steps = np.zeros((7, 6))
    steps[::2, 0] = [0.36, -0.36, 0.36, -0.36]
    steps[1::2, 1] = 0.1
    found = by(LINUXCNC, at_feed(steps, np.full(7, 0.3), np.full(7, 1 * MM)), limits)
    assert found.durations[2] == pytest.approx(1.3348, abs=5e-4)
    assert found.clock is not None and not np.any(found.clock.stands[:-1])
    blends = found.clock.blends
    assert blends is not None
    assert blends.overlaps[:6] == pytest.approx(np.full(6, np.pi / 2 * 2.414 * MM / 0.06466), rel=1e-3)
    # Half of each arc is of either block: 360 mm less two arcs' ends, and the ramps from 64.66 mm/s and back.
    ramps = 2 * (0.3 - 0.06466) ** 2 / (2 * 2.0 * 0.3)
    assert found.durations[2] == pytest.approx((0.36 - 2 * 2.414 * MM) / 0.3 + ramps + blends.overlaps[0], abs=1e-5)


def test_a_reversal_stops_even_where_blocks_are_blended() -> None:
    found = by(LINUXCNC, run([{"x": 0.1}, {"x": -0.1}], tolerance=ROUNDED))
    assert found.clock is not None and found.clock.stands.tolist() == [True, True]


def test_a_rapid_and_a_feed_part_with_a_stop() -> None:
    for rule in (LINUXCNC, LOOK_AHEAD):
        blocks = run([{"x": 0.1}] * 4, tolerance=ROUNDED)
        found = by(rule, replace(blocks, kinds=np.array([0, 0, 1, 1], dtype=np.uint8)))
        assert found.clock is not None and found.clock.stands.tolist() == [False, True, False, True]


def switched(rule: Rule, waits: bool) -> Trajectory:
    """Two blended blocks with a switching word between."""
    kinds = np.array([Kind.LINEAR, Kind.SWITCH, Kind.LINEAR], dtype=np.uint8)
    tolerances = np.array([ROUNDED, 0.0 if waits else ON_THE_FLY, ROUNDED])
    blocks = run([{"x": 0.2, "u": 0.2}, {}, {"x": 0.2, "u": 0.2}])
    blocks = replace(blocks, kinds=kinds, tolerances=tolerances, durations=np.array([0.8, 0.0, 0.8]))
    return by(rule, replace(blocks, events=np.array([0, Event.SHOE_DOWN, 0], dtype=np.uint8)))


@pytest.mark.parametrize("rule", [LINUXCNC, LOOK_AHEAD])
def test_a_word_on_the_fly_costs_nothing_and_one_that_waits_stops(rule: Rule) -> None:
    smooth, stopped = switched(rule, waits=False), switched(rule, waits=True)
    assert smooth.clock is not None and stopped.clock is not None
    assert not smooth.clock.stands[0] and stopped.clock.stands[0]
    assert smooth.durations[1] == 0.0 and stopped.durations[1] == pytest.approx(rule.drain)
    plain = by(rule, run([{"x": 0.2, "u": 0.2}] * 2, tolerance=ROUNDED))
    assert smooth.duration == pytest.approx(plain.duration, abs=1e-12)
    # A control whose words stop stops at each.
    halting = switched(replace(rule, switching="stops"), waits=False)
    assert halting.duration == pytest.approx(stopped.duration, abs=1e-12)


def test_an_output_that_turns_an_axis_lets_the_motion_finish() -> None:
    rule = replace(LINUXCNC, outputs=frozenset({5}), paths=((0, 1, 2), (4,), (3,)))
    blocks = run([{"x": 0.2, "u": 0.2}, {"v": 0.01}, {"x": 0.2, "u": 0.2}], tolerance=ROUNDED)
    found = by(rule, replace(blocks, durations=np.array([0.8, 0.5, 0.8])))
    assert found.clock is not None and found.clock.stands[0]
    assert found.durations[1] == pytest.approx(0.5 + rule.drain)


def test_words_in_a_row_that_wait_do_so_once() -> None:
    steps: list[dict[str, float]] = [{"x": 0.1}, {}, {}, {"x": 0.1}]
    kinds = np.array([Kind.LINEAR, Kind.SWITCH, Kind.SWITCH, Kind.LINEAR], dtype=np.uint8)
    blocks = replace(run(steps), kinds=kinds, durations=np.array([0.4, 0.0, 0.0, 0.4]), tolerances=np.zeros(4))
    assert by(LINUXCNC, blocks).durations[1:3] == pytest.approx([LINUXCNC.drain, 0.0])


@pytest.mark.parametrize("degrees", [0.1, 1.0, 30.0, 90.0])
def test_a_look_ahead_rounds_a_corner_by_what_it_may(degrees: float) -> None:
    """Fast and slow alike: never further than the tolerance, and that far where the speed lets it."""
    turn = degrees * DEG
    way = np.array([[1.0, 0.0], [np.cos(turn), np.sin(turn)]])
    steps = np.zeros((2, 6))
    steps[:, :2] = 0.5 * way
    found = by(LOOK_AHEAD, at_feed(steps, np.full(2, 0.25), np.full(2, ROUNDED)))
    assert found.clock is not None
    blocks, middle = np.zeros(1, np.int64), np.ones(1)
    off = np.abs(found.rounded(blocks, middle) - found.positions[0])[0]
    assert np.all(off <= ROUNDED * (1 + 1e-9))
    speed = float(found.clock.speeds_at(found.times[:1])[0])
    if speed < 0.25 * (1 - 1e-9):
        assert np.max(off) == pytest.approx(ROUNDED, rel=1e-6)
    else:
        assert degrees <= 1.0


def test_a_rule_knows_its_tolerance() -> None:
    assert LINUXCNC.rounding(0.02 * MM) == 0.0
    assert replace(LINUXCNC, stated=True).rounding(0.02 * MM) == 0.04 * MM
    assert replace(LINUXCNC, stated=True, tolerance=0.05 * MM).rounding(0.02 * MM) == 0.05 * MM
    assert LOOK_AHEAD.rounding(0.5 * MM) == 0.02 * MM
    assert (STOP.blends, LINUXCNC.blends, LOOK_AHEAD.blends) == (False, True, True)
    assert (LINUXCNC.ramp_share, LOOK_AHEAD.ramp_share) == (0.5, 1.0)


@given(chains())
def test_a_look_ahead_is_never_slower_than_a_stop_at_every_block(chain: Trajectory) -> None:
    assert by(LOOK_AHEAD, chain).duration <= by(STOP, chain).duration * (1 + 1e-12)


def test_axes_without_accelerations_need_no_time_for_ramps() -> None:
    blocks = straight(AXES, np.array([[0.5, 0, 0, 0, 0, 0], [0.5, 0.5, 0, 0, 0, 0]]), 2.0, ROUNDED)
    for rule in (STOP, LINUXCNC, LOOK_AHEAD):
        assert by(rule, blocks, Limits.speeds(LIMITS.speed)).durations.tolist() == [2.0, 2.0]


def test_a_block_that_an_arc_shortens_overlaps_the_one_before_by_no_more_than_is_left() -> None:
    """A fast turning pass, a slow straight 12 mm, a link at a right angle: the way adds up, and no joint jumps."""
    steps = np.zeros((4, 6))
    steps[:, 0], steps[:, 1], steps[:, 3] = [0.032, 0.012, 0.0, 0.0], [0.0, 0.0, 0.015, 0.044], [0.03, 0.0, 0.0, 0.3]
    found = by(LINUXCNC, at_feed(steps, np.array([0.24, 0.1, 0.33, 0.21]), np.full(4, 2 * MM)))
    clock = found.clock
    assert clock is not None and not np.any(clock.stands[:-1])
    assert clock.marks[-1] == pytest.approx(clock.reached[-1], rel=1e-9)
    times = np.linspace(0.0, clock.ends[-1], 20001)
    blocks = np.clip(np.searchsorted(clock.ends, times, side="right") - 1, 0, len(found) - 1)
    joints = found.rounded(blocks, found.fractions(blocks, times))
    assert np.max(np.abs(np.diff(joints[:, :2], axis=0))) <= 0.4 * times[1]
