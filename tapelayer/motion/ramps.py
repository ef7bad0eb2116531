"""Ramps: blocks at trapezoids of path speed, joined as the control joins them, and the clock of these."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.motion.clock import Blends, Clock
from tapelayer.motion.corners import Chain, Passing

# Moments this close together, in seconds, are one.
SAME_MOMENT = 1e-12
# A corner that turns within this time, in seconds, is straight.
LEAST_BLEND = 1e-9


@dataclass(frozen=True, eq=False)
class Ramps(Frozen):
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


def ramps_of(chain: Chain, passed: Passing, stood: Floats) -> Ramps:
    """Return the ramps of a chain.

    Args:
        chain: the moving blocks.
        passed: how the control passes them.
        stood: (m,) seconds stood still by non-moving blocks up to each block.
    """
    lengths = chain.lengths - passed.trims - np.append(0.0, passed.trims[:-1])
    speeds, rates = passed.speeds, passed.accelerations
    first, last = reachable(lengths, speeds, rates, passed.caps)
    tops = np.minimum(speeds, np.sqrt((2.0 * rates * lengths + first**2 + last**2) / 2.0))
    ramped = (2.0 * tops**2 - first**2 - last**2) / (2.0 * rates)
    seconds = (2.0 * tops - first - last) / rates + np.maximum(lengths - ramped, 0.0) / tops
    overlaps, pauses = passed.onsets / rates, passed.pauses
    rounding = np.divide(passed.arcs, last, out=passed.rounding.copy(), where=passed.arcs > 0.0)
    turned = np.where(passed.trims > 0.0, rounding, 0.0)
    waited = np.append(0.0, np.cumsum(pauses - overlaps + turned)[:-1])
    ends = np.cumsum(seconds) + waited + stood
    return Ramps(ends - seconds, ends, pauses, first, tops, last, rates, overlaps, rounding, passed.trims)


def reachable(lengths: Floats, speeds: Floats, rates: Floats, caps: Floats) -> tuple[Floats, Floats]:
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


def ramped_clock(ramps: Ramps, rows: Ints, reached: Floats, standing: Floats) -> Clock:
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
        moments = np.maximum.accumulate(moments, out=moments)
    speeds = speeds.ravel()
    passed = speeds[:-1] + speeds[1:]
    passed *= np.diff(moments)
    passed /= 2.0
    marks = np.append(0.0, np.cumsum(passed, out=passed))
    stands = (ramps.last == 0.0) & (ramps.overlaps == 0.0)
    peaks, rates = np.zeros(len(standing)), np.zeros(len(standing))
    peaks[rows] = ramps.tops
    rates[rows] = np.where((rise > 0.0) | (fall > 0.0), ramps.accelerations, 0.0)
    clock = Clock(reached, np.zeros(len(reached)), np.zeros(0, np.bool_), moments, marks, speeds, peaks, rates)
    # Where blocks overlap, one ends when the way of both has come to its end.
    reaches = clock.first_times(reached[rows + 1]) if np.any(ramps.overlaps) else ramps.ends + ramps.arcs
    ends = np.where(stands, ramps.ends + ramps.waits, reaches)
    return replace(clock, blends=_blends(ramps, rows, len(standing))).through(rows, ends, stands, standing)


def _blends(ramps: Ramps, rows: Ints, count: int) -> Blends | None:
    """Return how the blocks, `count` in all, overlap or round off their corners; None where none do."""
    overlaps = np.where(ramps.overlaps > 0.0, ramps.overlaps, ramps.rounding)
    joined = np.flatnonzero(overlaps[:-1] > LEAST_BLEND)
    turned = ramps.overlaps[joined] == 0.0
    finish = ramps.ends[joined] + ramps.arcs[joined]
    begins = np.where(turned, finish - overlaps[joined] / 2.0, ramps.begins[joined + 1])
    # A corner passed at speed turns evenly: as if one block gave up the speed while the other took it on.
    even = ramps.corners[joined] / overlaps[joined]
    braking = np.where(turned, even, ramps.accelerations[joined])
    starting = np.where(turned, even, ramps.accelerations[joined + 1])
    return Blends.of(rows, joined, count, begins, overlaps[joined], braking, starting, np.zeros(len(joined)))
