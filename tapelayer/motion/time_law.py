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
from tapelayer.motion.clock import Blends, Clock
from tapelayer.motion.corners import ARC_SHARE, Chain, Passing, Rule, passing
from tapelayer.motion.trajectory import CIRCULAR, MOTIONS, Event, Kind, Trajectory
from tapelayer.units import DEG, MM

Lengths = TypeVar("Lengths", float, Floats)
# An axis without a stated acceleration reaches its speed at once: within a microsecond.
AT_ONCE = 1e6
# Moments this close together, in seconds, are one.
SAME_MOMENT = 1e-12
# A corner that turns within this time, in seconds, is straight.
LEAST_BLEND = 1e-9
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
    jerks = np.broadcast_to(np.asarray(jerks, dtype=np.float64), lengths.shape)
    rounding = accelerations / jerks
    with np.errstate(divide="ignore", invalid="ignore"):
        ramps = np.where(
            speeds >= accelerations * rounding, speeds / accelerations + rounding, 2 * np.sqrt(speeds / jerks)
        )
        # The peak of a move too short for its speed: with a stretch of full acceleration, or without one.
        peaks = (-accelerations * rounding + np.sqrt((accelerations * rounding) ** 2 + 4 * accelerations * lengths)) / 2
        short = np.where(
            peaks >= accelerations * rounding,
            2 * (peaks / accelerations + rounding),
            4 * np.cbrt(lengths / (2 * jerks)),
        )
        seconds = np.where(lengths >= speeds * ramps, lengths / speeds + ramps, short)
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


def clock_of(trajectory: Trajectory, limits: Limits, rule: Rule) -> Clock:
    """Return when a control is where along a trajectory; arguments as `timed`."""
    blocks = np.arange(len(trajectory))
    steps = np.nan_to_num(trajectory.positions - trajectory.begins(blocks))
    steps[~np.isin(trajectory.kinds, MOTIONS)] = 0.0
    columns = [column for column in range(steps.shape[1]) if column not in rule.outputs]
    lengths, groups = _paths(trajectory, steps, columns, rule)
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
    rows = np.flatnonzero(moving)
    # One drain for all the words in a row that wait for the end of motion.
    drains = waits & ~np.append(False, waits[:-1])
    standing = np.where(moving, 0.0, asked + np.where(drains, rule.drain, 0.0))
    axes = np.minimum(limits.acceleration[columns], AT_ONCE)
    with np.errstate(divide="ignore"):
        moved = np.abs(steps[rows][:, columns])
        tops = lengths[rows] / np.max(moved / limits.speed[columns], axis=1)
        accelerations = np.minimum(lengths[rows] / np.max(moved / axes, axis=1), AT_ONCE)
        speeds = np.minimum(tops, lengths[rows] / asked[rows])
    begins, ends = (
        trajectory.derivatives(rows, np.full(len(rows), end))[:, columns] / lengths[rows, None] for end in (0.0, 1.0)
    )
    bends = np.max(trajectory.extremes(rows)[1][:, columns] / axes, axis=1) / lengths[rows] ** 2
    speeds, tops, accelerations = _turning(bends, speeds, tops, accelerations)
    chain = Chain(
        begins=begins,
        ends=ends,
        shares=moved / lengths[rows, None],
        xyz=tuple(columns.index(column) for column in (rule.paths or ((),))[0] if column in columns),
        lengths=lengths[rows],
        speeds=speeds,
        tops=tops,
        accelerations=accelerations,
        axes=axes,
        tolerances=trajectory.tolerances[rows],
        scales=np.where([column in rule.rotary for column in columns], DEG / MM, 1.0),
        rapid=rapid[rows],
        groups=groups[rows],
        broken=np.append(np.diff(np.cumsum(waits | turned)[rows]) > 0, True),
    )
    passed = passing(chain, rule)
    ramps = _ramps(chain, passed, limits.jerk[columns], np.cumsum(standing)[rows])
    return _clock(ramps, rows, reached, standing)


def _paths(trajectory: Trajectory, steps: Floats, columns: Sequence[int], rule: Rule) -> tuple[Floats, Ints]:
    """Return the path length (n,) of each block, and the number (n,) of the group of axes that it is along."""
    squares = steps**2
    groups = [*(list(group) for group in rule.paths), list(columns)]
    lengths, numbers = np.zeros(len(steps)), np.full(len(steps), len(groups))
    for number, group in enumerate(groups):
        along = np.sqrt(np.sum(squares[:, group], axis=1))
        unset = lengths == 0.0
        numbers[unset & (along > 0.0)] = number
        lengths = np.where(unset, along, lengths)
    circular = np.flatnonzero(np.isin(trajectory.kinds, CIRCULAR))
    if len(circular):
        arcs = trajectory.arcs(circular)
        turned = np.abs(arcs.sweeps) * np.max(arcs.radii, axis=0)
        rest = squares[circular[:, None], [trajectory.column(axis) for axis in "xyz"]]
        third = np.sum(rest, axis=1) - np.sum(np.take_along_axis(squares[circular], arcs.axes, axis=1), axis=1)
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


@dataclass(frozen=True, eq=False)
class _Ramps(Frozen):
    """Trapezoids of path speed, one a moving block, and halves of the arcs at its corners.

    Attributes:
        begins: (m,) seconds at which each trapezoid begins, after the arc at the corner before.
        ends: (m,) seconds at which each ends, before the arc at the corner after.
        waits: (m,) seconds after the end before the next may begin, if the control stops.
        first: (m,) path speed at the beginning.
        tops: (m,) greatest path speed.
        last: (m,) path speed at the end.
        accelerations: (m,) of both ramps.
        overlaps: (m,) seconds by which the next one begins before the end.
        rounding: (m,) seconds in which a corner passed at speed turns.
        trims: (m,) path units before and after the corner that an arc replaces, in all of that time.
    """

    begins: Floats
    ends: Floats
    waits: Floats
    first: Floats
    tops: Floats
    last: Floats
    accelerations: Floats
    overlaps: Floats
    rounding: Floats
    trims: Floats

    @property
    def arcs(self) -> Floats:
        """Seconds (m,) of half the arc at each block's end."""
        return np.where(self.trims > 0.0, self.rounding / 2.0, 0.0)

    @property
    def corners(self) -> Floats:
        """Path speed (m,) at each block's end: on an arc, path units that it replaces a second."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.trims > 0.0, self.trims / self.arcs, self.last)

    def beside(self, times: Floats, shift: int) -> Floats:
        """Return the path speed (m, c) that the block before (`shift` -1) or after (1) gives at times (m, c)."""
        rows = slice(max(-shift, 0), len(times) - max(shift, 0))
        other = slice(max(shift, 0), len(times) + min(shift, 0))
        found = np.zeros_like(times)
        since, left = times[rows] - self.begins[other, None], self.ends[other, None] - times[rows]
        rate = self.accelerations[other, None]
        ramps = np.minimum(self.first[other, None] + rate * since, self.last[other, None] + rate * left)
        # A block may begin with the one before; where the next begins, its own speed there is the one that counts.
        begun = since > -SAME_MOMENT if shift < 0 else since > SAME_MOMENT
        inside = begun & (left > SAME_MOMENT)
        speeds = np.where(inside, np.minimum(ramps, self.tops[other, None]), 0.0)
        # The halves of the arcs at its corners.
        arcs, corners = self.arcs[other, None], self.corners[other, None]
        before = np.append(0.0, self.arcs[:-1])[other, None], np.append(0.0, self.corners[:-1])[other, None]
        after = (left <= SAME_MOMENT) & (left + arcs > SAME_MOMENT)
        ahead = ~begun & (since + before[0] > SAME_MOMENT)
        found[rows] = speeds + np.where(after, corners, 0.0) + np.where(ahead, before[1], 0.0)
        return found


def _ramps(chain: Chain, passed: Passing, jerks: Floats, stood: Floats) -> _Ramps:
    """Return the ramps of a chain.

    Args:
        chain: the moving blocks.
        passed: how the control passes them.
        jerks: (k,) greatest jerk of every axis.
        stood: (m,) seconds stood still by non-moving blocks up to each block.
    """
    lengths = chain.lengths - passed.trims - np.append(0.0, passed.trims[:-1])
    speeds, rates = passed.speeds, passed.accelerations
    first, last = _reachable(lengths, speeds, rates, passed.caps)
    tops = np.minimum(speeds, np.sqrt((2.0 * rates * lengths + first**2 + last**2) / 2.0))
    ramped = (2.0 * tops**2 - first**2 - last**2) / (2.0 * rates)
    seconds = (2.0 * tops - first - last) / rates + np.maximum(lengths - ramped, 0.0) / tops
    overlaps, pauses = passed.onsets / rates, passed.pauses
    rounding = np.divide(passed.arcs, last, out=passed.rounding.copy(), where=passed.arcs > 0.0)
    if np.any(np.isfinite(jerks)):
        stretch = _stretch(chain, seconds, last, overlaps, speeds, rates, jerks)
        seconds, overlaps, rounding = seconds * stretch, overlaps * stretch, rounding * stretch
        first, tops, last, rates = first / stretch, tops / stretch, last / stretch, rates / stretch**2
    turned = np.where(passed.trims > 0.0, rounding, 0.0)
    waited = np.append(0.0, np.cumsum(pauses - overlaps + turned)[:-1])
    ends = np.cumsum(seconds) + waited + stood
    return _Ramps(ends - seconds, ends, pauses, first, tops, last, rates, overlaps, rounding, passed.trims)


def _reachable(lengths: Floats, speeds: Floats, rates: Floats, caps: Floats) -> tuple[Floats, Floats]:
    """Return the path speed (m,) at each block's beginning and end: two passes over its square, none a loop.

    Over a block the square of the speed changes by at most 2 a L, so that it is a running minimum once the sum of all
    changes up to there is taken off.
    """
    if not np.any(caps):
        return np.zeros(len(lengths)), np.zeros(len(lengths))
    gains = np.cumsum(2.0 * rates * lengths)
    squares = np.minimum(caps, speeds) ** 2
    # Backward: at a block's end no faster than the next one, with all of its length, can brake from.
    braked = np.minimum.accumulate((squares + gains)[::-1])[::-1] - gains
    # Forward: no faster than it could have become since the last stop.
    squares = np.minimum.accumulate(np.append(0.0, braked - gains))[1:] + gains
    squares = np.where(caps > 0.0, np.maximum(squares, 0.0), 0.0)
    last = np.sqrt(squares)
    return np.append(0.0, last[:-1]), last


def _stretch(
    chain: Chain, seconds: Floats, last: Floats, overlaps: Floats, speeds: Floats, rates: Floats, jerks: Floats
) -> Floats:
    """Return the factor (m,) by which limits of jerk lengthen the time of each block.

    A block alone from rest to rest has its closed form. A run of blocks without a stop takes longer by the time that an
    axis needs to reach its acceleration: the speed is averaged over that time.
    """
    with np.errstate(divide="ignore"):
        along = 1.0 / np.max(chain.shares / jerks, axis=1)
    stops = (last == 0.0) & (overlaps == 0.0)
    runs = np.cumsum(np.append(0, stops[:-1]))
    total = np.bincount(runs, seconds) - np.bincount(runs, overlaps)
    longest = np.zeros(runs[-1] + 1)
    np.maximum.at(longest, runs, rates / along)
    alone = np.bincount(runs)[runs] == 1
    stretch: Floats = 1.0 + (longest / total)[runs]
    rested = rest_to_rest(chain.lengths[alone], speeds[alone], rates[alone], along[alone])
    stretch[alone] = rested / seconds[alone]
    return stretch


def _clock(ramps: _Ramps, rows: Ints, reached: Floats, standing: Floats) -> Clock:
    """Return the clock of ramps, whose blocks are these rows (m,) of a program of n blocks."""
    rise = (ramps.tops - ramps.first) / ramps.accelerations
    fall = (ramps.tops - ramps.last) / ramps.accelerations
    times = np.column_stack([ramps.begins, ramps.begins + rise, ramps.ends - fall, ramps.ends])
    speeds = np.column_stack([ramps.first, ramps.tops, ramps.tops, ramps.last])
    if np.any(ramps.trims):
        # The half arcs before and after: the straight path that they replace passes at a constant speed.
        arcs, corners = ramps.arcs, ramps.corners
        before = np.append(0.0, arcs[:-1]), np.append(ramps.first[0], corners[:-1])
        times = np.column_stack([ramps.begins - before[0], ramps.begins, times, ramps.ends, ramps.ends + arcs])
        speeds = np.column_stack([before[1], before[1], speeds, corners, corners])
    moments = times.ravel()
    if np.any(ramps.overlaps):
        speeds = speeds + ramps.beside(times, -1) + ramps.beside(times, 1)
        order = np.argsort(moments, kind="stable")
        moments, speeds = moments[order], speeds.ravel()[order]
    else:
        moments = np.maximum.accumulate(moments)
    speeds = speeds.ravel()
    marks = np.append(0.0, np.cumsum(np.diff(moments) * (speeds[:-1] + speeds[1:]) / 2.0))
    stands = (ramps.last == 0.0) & (ramps.overlaps == 0.0)
    peaks, rates = np.zeros(len(standing)), np.zeros(len(standing))
    peaks[rows] = ramps.tops
    rates[rows] = np.where((rise > 0.0) | (fall > 0.0), ramps.accelerations, 0.0)
    clock = Clock(reached, np.zeros(len(reached)), np.zeros(0, np.bool_), moments, marks, speeds, peaks, rates)
    ends = np.where(stands, ramps.ends + ramps.waits, clock.first_times(reached[rows + 1]))
    # Blocks that do not move end where the last one that moves did, after the time they stand.
    last = np.searchsorted(rows, np.arange(len(standing)), side="right") - 1
    stood = np.cumsum(standing)
    since = stood - np.where(last >= 0, stood[rows[np.maximum(last, 0)]], 0.0)
    every = np.where(last >= 0, ends[np.maximum(last, 0)], 0.0) + since
    still = np.where(last >= 0, stands[np.maximum(last, 0)], True) | (standing > 0.0)
    return replace(
        clock,
        ends=np.append(0.0, np.maximum.accumulate(every)),
        stands=still,
        blends=_blends(ramps, rows, len(standing)),
    )


def _blends(ramps: _Ramps, rows: Ints, count: int) -> Blends | None:
    """Return how the blocks, `count` in all, overlap or round off their corners; None where none do."""
    overlaps = np.where(ramps.overlaps > 0.0, ramps.overlaps, ramps.rounding)
    joined = np.flatnonzero(overlaps[:-1] > LEAST_BLEND)
    if not len(joined):
        return None
    blocks = np.arange(count)
    following, preceding = blocks.copy(), blocks.copy()
    following[rows[joined]], preceding[rows[joined + 1]] = rows[joined + 1], rows[joined]
    begins, spans, braking, starting = (np.zeros(count) for _ in range(4))
    turned = ramps.overlaps[joined] == 0.0
    finish = ramps.ends[joined] + ramps.arcs[joined]
    begins[rows[joined]] = np.where(turned, finish - overlaps[joined] / 2.0, ramps.begins[joined + 1])
    spans[rows[joined]] = overlaps[joined]
    # A corner passed at speed turns evenly: as if one block gave up the speed while the other took it on.
    even = ramps.corners[joined] / overlaps[joined]
    braking[rows[joined]] = np.where(turned, even, ramps.accelerations[joined])
    starting[rows[joined]] = np.where(turned, even, ramps.accelerations[joined + 1])
    return Blends(following, preceding, begins, spans, braking, starting)
