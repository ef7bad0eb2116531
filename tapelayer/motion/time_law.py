"""Time law: the only module that turns distance into seconds, for planner, reader, judges and reports alike.

Two durations: the seconds that a block's words ask for, and the seconds that it takes on its control, with the axes'
accelerations and the way the control passes from block to block.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.machines.machine import Axis
from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import ARC_SHARE, Chain, Rule, greatest, passing
from tapelayer.motion.ramps import ramped_clock, ramps_of
from tapelayer.motion.smoothing import eased, smoothed_clock
from tapelayer.motion.trajectory import CIRCULAR, MOTIONS, Event, Kind, Trajectory
from tapelayer.units import DEG, MM

Lengths = TypeVar("Lengths", float, Floats)
# An axis without a stated acceleration reaches its speed at once: within a microsecond.
AT_ONCE = 1e6
# Words ask for this share more than a block reaches, so that their last digit does not make it slower; where a block
# reaches all but this share of what is set, they ask for that.
SPARE = 5e-3
AS_SET = 1e-2
# A block that takes this much longer or shorter, in seconds, moves otherwise.
SAME_MOTION = 1e-9
# A path shorter than this, in metres or radians, is rounding.
NO_MOTION = 1e-9


@dataclass(frozen=True, eq=False)
class Limits(Frozen):
    """The limits of axes, one row per axis.

    Attributes:
        speed: (k,) m/s or rad/s.
        acceleration: (k,) m/s2 or rad/s2; inf where none is stated, also for the next one.
        jerk: (k,) m/s3 or rad/s3.
    """

    speed: Floats
    acceleration: Floats
    jerk: Floats

    @staticmethod
    def of(axes: Iterable[Axis]) -> Limits:
        """Return the limits of axes, in their order."""
        chosen = list(axes)
        return Limits(
            *(np.array([getattr(axis, name) for axis in chosen]) for name in ("speed", "acceleration", "jerk"))
        )

    @staticmethod
    def speeds(speed: Floats) -> Limits:
        """Return limits of (k,) speeds alone.

        Examples:
            >>> Limits.speeds(np.array([0.5])).acceleration.tolist()
            [inf]
        """
        unlimited = np.full(len(speed), np.inf)
        return Limits(speed, unlimited, unlimited)

    @property
    def ramped(self) -> bool:
        """Whether any axis needs time to reach its speed."""
        return bool(np.any(np.isfinite(self.acceleration)))


def rapids(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n,) of rapids, each as long as its slowest axis takes.

    Args:
        steps: (n, k) change of every axis, metres or radians; NaN where the axis's position was unknown, so that its
            time is unknown and counts as 0.
        limits: of the k axes.

    Examples:
        >>> limits = Limits.speeds(np.array([0.5, 0.1]))
        >>> rapids(np.array([[1.0, 0.1], [1.0, np.nan]]), limits).tolist()
        [2.0, 2.0]
    """
    seconds: Floats = np.max(np.nan_to_num(axis_times(steps, limits)), axis=1, initial=0.0)
    return seconds


def feeds(steps: Floats, limits: Limits, least: Floats) -> Floats:
    """Return the seconds (n,) of feeds, in which no axis exceeds its limits.

    Args:
        steps: (n, k) change of every axis, metres or radians.
        limits: of the k axes.
        least: (n,) seconds requested for each; a feed takes longer where an axis cannot follow.

    Examples:
        >>> limits = Limits.speeds(np.array([0.5, 0.1]))
        >>> feeds(np.array([[1.0, 0.1], [1.0, 0.5]]), limits, least=np.array([3.0, 3.0])).tolist()
        [3.0, 5.0]
    """
    seconds: Floats = np.maximum(np.max(axis_times(steps, limits), axis=1, initial=0.0), least)
    return seconds


def axis_times(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n, k) that each axis would take for its own steps (n, k), metres or radians.

    Examples:
        >>> axis_times(np.array([[1.0, -0.1]]), Limits.speeds(np.array([0.5, 0.1]))).tolist()
        [[2.0, 1.0]]
    """
    return np.abs(steps) / limits.speed


def at_speed(lengths: Lengths, speed: float) -> Lengths:
    """Return the seconds that lengths of any shape in metres take at a constant speed in m/s.

    Examples:
        >>> at_speed(1.5, 0.5)
        3.0
    """
    return lengths / speed


def by_feed_word(lengths: Floats, feeds: Floats, inverse: Mask) -> Floats:
    """Return the seconds (n,) that a control's feed words specify.

    Args:
        lengths: (n,) in the unit of the feed.
        feeds: (n,) feed words: units per minute, or one over the minutes of the block.
        inverse: (n,) where they are the latter.

    Examples:
        >>> lengths, feeds = np.array([100.0, 100.0]), np.array([600.0, 2.0])
        >>> by_feed_word(lengths, feeds, inverse=np.array([False, True])).tolist()
        [10.0, 30.0]
    """
    return 60.0 * np.where(inverse, 1.0, lengths) / feeds


def rest_to_rest(lengths: Floats, speeds: Floats, accelerations: Floats, jerks: Floats | float = np.inf) -> Floats:
    """Return the seconds (n,) of moves from rest to rest.

    Args:
        lengths: (n,) path units.
        speeds: (n,) greatest path speed.
        accelerations: (n,) greatest path acceleration.
        jerks: (n,) greatest path jerk; inf for ramps of constant acceleration.

    Examples:
        >>> one = np.ones(1)
        >>> rest_to_rest(0.08 * one, 0.25 * one, 1.5 * one).round(6).tolist()
        [0.486667]
        >>> rest_to_rest(0.08 * one, 0.25 * one, 1.5 * one, 30.0 * one).round(6).tolist()
        [0.536667]
    """
    peaks, rates = eased(lengths, speeds, accelerations, np.broadcast_to(jerks, lengths.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        seconds = lengths / peaks + peaks / rates + rates / jerks
    return np.where(lengths > 0.0, seconds, 0.0)


def timed(trajectory: Trajectory, limits: Limits, rule: Rule) -> Trajectory:
    """Return a trajectory with the time that its blocks take on a control.

    Args:
        trajectory: its durations are the seconds that the words ask for; for a rapid they do not count.
        limits: of its axes.
        rule: of the control.
    """
    clock = clock_of(trajectory, limits, rule)
    return replace(trajectory, asked=trajectory.requested, durations=clock.durations, clock=clock)


def within_reach(trajectory: Trajectory, limits: Limits, rule: Rule) -> Trajectory:
    """Return a timed trajectory whose words ask for no more speed than blocks reach, where the control looks ahead.

    Blocks on one ramp ask for the speed at its top, so that words do not change along it and arcs stay whole. The
    motion stays as it is: where limits of jerk would make a run from stop to stop another one, its words stay.

    Args:
        trajectory: with its clock.
        limits: of its axes.
        rule: of the control.
    """
    clock, asked = trajectory.clock, trajectory.requested
    if clock is None or rule.corner != "look_ahead" or not len(clock.marks):
        return trajectory
    lengths, runs = np.diff(clock.reached), np.append(0, np.cumsum(clock.stands[:-1]))
    feeds = np.flatnonzero((trajectory.kinds == Kind.LINEAR) & (lengths > 0.0))
    if not len(feeds):
        return trajectory
    peaks = _headed_for(clock, feeds, runs[feeds])
    high = lengths[feeds] > peaks * asked[feeds] * (1.0 + AS_SET)
    lowered = asked.copy()
    lowered[feeds[high]] = lengths[feeds[high]] / (peaks[high] * (1.0 + SPARE))
    if not np.any(np.isfinite(limits.jerk)):
        # Ramps of constant acceleration are the same to the last bit when no word is below their tops.
        return replace(trajectory, asked=lowered)
    found = timed(replace(trajectory, asked=lowered), limits, rule)
    worst = np.zeros(runs[-1] + 1)
    np.maximum.at(worst, runs, np.abs(found.durations - clock.durations))
    other = worst[runs] > SAME_MOTION
    if not np.any(other):
        return found
    return timed(replace(trajectory, asked=np.where(other, asked, lowered)), limits, rule)


def _headed_for(clock: Clock, feeds: Ints, runs: Ints) -> Floats:
    """Return the greatest speed (m,) that blocks reach, or the ramp that they are on.

    A block is on a ramp if all of it speeds up or brakes.

    Args:
        clock: of all blocks.
        feeds: (m,) moving blocks in order.
        runs: (m,) number of the run from stop to stop of each.
    """
    begins, ends = clock.speeds_at(clock.ends[feeds]), clock.speeds_at(clock.ends[feeds + 1])
    peaks, means = clock.peaks[feeds], np.diff(clock.reached)[feeds] / clock.durations[feeds]
    ramp = np.abs(means - (begins + ends) / 2.0) <= AS_SET * peaks
    up, down = (ramp & (to >= peaks * (1.0 - AS_SET)) & (to > other) for other, to in ((begins, ends), (ends, begins)))
    joined = (up[:-1] | down[1:]) & (runs[1:] == runs[:-1])
    ramps = np.append(0, np.cumsum(~joined))
    tops = np.zeros(ramps[-1] + 1)
    np.maximum.at(tops, ramps, peaks)
    headed: Floats = tops[ramps]
    return headed


def at_reach(trajectory: Trajectory, seconds: Floats, limits: Limits, rule: Rule) -> Floats:
    """Return the seconds (n,) of blocks at the greatest speed that they reach where words ask for no more than these.

    On a control that looks ahead a block may be too short, or its corners too sharp, for its speed; on others the
    seconds are those given.

    Args:
        trajectory: as its words ask.
        seconds: (n,) that each block needs at its set speed; inf where its own words count.
        limits: of its axes.
        rule: of the control.
    """
    if rule.corner != "look_ahead":
        return seconds
    quick = np.minimum(trajectory.requested, seconds)
    clock = clock_of(replace(trajectory, asked=quick), limits, rule)
    lengths, moving = np.diff(clock.reached), clock.peaks > 0.0
    reached = np.divide(lengths, clock.peaks, out=np.zeros(len(lengths)), where=moving)
    return np.maximum(seconds, reached)


def clock_of(trajectory: Trajectory, limits: Limits, rule: Rule) -> Clock:
    """Return when a control is where along a trajectory; arguments as `timed`."""
    blocks = np.arange(len(trajectory))
    # Column by column, as all that follows: it compares the axes of a block, and needs a fraction of the memory.
    steps: Floats = np.empty(trajectory.positions.shape, order="F")
    steps[:1] = trajectory.positions[:1] - trajectory.start
    np.subtract(trajectory.positions[1:], trajectory.positions[:-1], out=steps[1:])
    steps[np.isnan(steps)] = 0.0
    steps[~np.isin(trajectory.kinds, MOTIONS)] = 0.0
    circular = np.flatnonzero(np.isin(trajectory.kinds, CIRCULAR))
    columns = [column for column in range(steps.shape[1]) if column not in rule.outputs]
    lengths, groups = _paths(trajectory, steps, circular, columns, rule)
    moving = lengths > 0.0
    rapid = trajectory.kinds == Kind.RAPID
    asked = np.where(rapid, 0.0, trajectory.requested)
    reached = np.append(0.0, np.cumsum(lengths))
    # A word that turns an axis for the control, or states it again, takes effect before the block's own motion.
    outputs = sum(1 << column for column in rule.outputs)
    turned = np.any(steps[:, sorted(rule.outputs)] != 0.0, axis=1) | (trajectory.stated & outputs > 0)
    waits = ~moving & ((asked > 0.0) | turned | (trajectory.events == Event.STOP))
    waits |= (trajectory.kinds == Kind.SWITCH) & ((trajectory.tolerances == 0.0) | (rule.switching == "stops"))
    if rule.corner == "none" or not limits.ramped or not np.any(moving):
        needed = np.max(axis_times(steps, limits), axis=1, initial=0.0)
        spent = np.where(waits, asked, np.maximum(asked, needed))
        return Clock.even(reached, spent, np.full(len(blocks), rule.corner == "stop"))
    # An axis that never moves bounds nothing.
    columns = [column for column in columns if np.any(steps[:, column])]
    rows = np.flatnonzero(moving)
    # One drain for all the words in a row that wait for the end of motion.
    drains = waits & ~np.append(False, waits[:-1])
    standing = np.where(moving, 0.0, asked + np.where(drains, rule.drain, 0.0))
    axes = np.minimum(limits.acceleration[columns], AT_ONCE)
    jerks = limits.jerk[columns] if rule.eases else np.full(len(columns), np.inf)
    # In place of the steps, which are not needed any more: a million blocks' fill 80 MB.
    directions = steps[: len(rows), : len(columns)]
    for place, column in enumerate(columns):
        np.divide(steps[rows, column], lengths[rows], out=directions[:, place])
    with np.errstate(divide="ignore"):
        tops = 1.0 / greatest(directions, limits.speed[columns])
        accelerations = np.minimum(1.0 / greatest(directions, axes), AT_ONCE)
        speeds = np.minimum(tops, lengths[rows] / asked[rows])
    begins, ends, bends = directions, directions, np.zeros(len(rows))
    turning = circular[moving[circular]]
    if len(turning):
        bent, along = np.searchsorted(rows, turning), lengths[turning, None]
        begins, ends = directions.copy(order="K"), directions.copy(order="K")
        for places, end in ((begins, 0.0), (ends, 1.0)):
            changes = trajectory.derivatives(turning, np.full(len(turning), end))
            places[bent] = changes[:, columns] / along
        bends[bent] = np.max(trajectory.extremes(turning)[1][:, columns] / axes / along**2, axis=1)
    speeds, tops, accelerations = _turning(bends, speeds, tops, accelerations)
    chain = Chain(
        begins=begins,
        ends=ends,
        shares=directions,
        xyz=tuple(columns.index(column) for column in (rule.paths or ((),))[0] if column in columns),
        lengths=lengths[rows],
        speeds=speeds,
        tops=tops,
        accelerations=accelerations,
        axes=axes,
        jerks=jerks,
        tolerances=trajectory.tolerances[rows],
        scales=np.where([column in rule.rotary for column in columns], DEG / MM, 1.0),
        rapid=rapid[rows],
        groups=groups[rows],
        broken=np.append(np.diff(np.cumsum(waits | turned)[rows]) > 0, True),
    )
    passed = passing(chain, rule)
    if np.any(np.isfinite(jerks)):
        return smoothed_clock(chain, passed, rows, reached, standing)
    return ramped_clock(ramps_of(chain, passed, np.cumsum(standing)[rows]), rows, reached, standing)


def _paths(
    trajectory: Trajectory, steps: Floats, circular: Ints, columns: Sequence[int], rule: Rule
) -> tuple[Floats, Ints]:
    """Return the path length (n,) of each block, and the number (n,) of the group of axes that it is along."""
    groups = [*(list(group) for group in rule.paths), list(columns)]
    lengths, numbers = np.zeros(len(steps)), np.full(len(steps), len(groups))
    for number, group in enumerate(groups):
        along = np.sqrt(sum((steps[:, column] ** 2 for column in group), np.zeros(len(steps))))
        unset = lengths == 0.0
        numbers[unset & (along > 0.0)] = number
        lengths = np.where(unset, along, lengths)
    if len(circular):
        arcs = trajectory.arcs(circular)
        turned = np.abs(arcs.sweeps) * np.max(arcs.radii, axis=0)
        squares = steps[circular] ** 2
        rest = squares[:, [trajectory.column(axis) for axis in "xyz"]]
        third = np.sum(rest, axis=1) - np.sum(np.take_along_axis(squares, arcs.axes, axis=1), axis=1)
        lengths[circular] = np.sqrt(turned**2 + np.maximum(third, 0.0))
        # Each axis of the plane moves as fast as the path somewhere on the arc.
        steps[circular[:, None], arcs.axes] = turned[:, None]
    # What is shorter than rounding leaves is no motion.
    return np.where(lengths > NO_MOTION, lengths, 0.0), numbers


def _turning(bends: Floats, speeds: Floats, tops: Floats, accelerations: Floats) -> tuple[Floats, Floats, Floats]:
    """Return speeds, tops and path accelerations (m,) of blocks that turn, so that no axis exceeds its acceleration.

    On an arc the turning takes up to a set share of the acceleration, the ramps what is left of it.

    Args:
        bends: (m,) share of an axis's acceleration that turning takes per square of the path speed; 0 for straights.
        speeds: (m,) greatest path speed.
        tops: (m,) greatest path speed by the axes alone.
        accelerations: (m,) greatest path acceleration.
    """
    with np.errstate(divide="ignore"):
        bound = np.sqrt(ARC_SHARE / bends)
    speeds, tops = np.minimum(speeds, bound), np.minimum(tops, bound)
    return speeds, tops, accelerations * np.sqrt(1.0 - (bends * speeds**2) ** 2)
