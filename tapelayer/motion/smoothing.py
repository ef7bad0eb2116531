"""Smoothing: path speeds averaged over a time, so that no axis exceeds its jerk, and the clock of these."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.motion.clock import Blends, Clock
from tapelayer.motion.corners import Chain, Passing, greatest
from tapelayer.motion.ramps import LEAST_BLEND, SAME_MOMENT, reachable

# No window is shorter than this, in seconds, so that rounding does not show in what is averaged over it.
LEAST_WINDOW = 1e-7
# A ramp no longer than this, in seconds, is rounding, and so is what an even speed is short of a window by this share.
NO_RAMP = 1e-7
CLOSE = 1e-6
# Between breakpoints this close together, in seconds, rounding hides the jerk.
HIDDEN = 1e-9


def eased(lengths: Floats, speeds: Floats, accelerations: Floats, jerks: Floats) -> tuple[Floats, Floats]:
    """Return the greatest path speed (n,) and acceleration (n,) that moves from rest to rest reach.

    The move is a trapezoid of that speed and acceleration, averaged over the time that the jerk takes to build up that
    acceleration; it keeps its top for at least that time.

    Args:
        lengths: (n,) path units.
        speeds: (n,) greatest path speed.
        accelerations: (n,) greatest path acceleration.
        jerks: (n,) greatest path jerk; inf for ramps of constant acceleration.
    """
    windows = accelerations / jerks
    with np.errstate(divide="ignore", invalid="ignore"):
        # The peak of a move too short for its speed: with a stretch of full acceleration, or without one.
        full = accelerations * windows
        long = (-full + np.sqrt(full**2 + 4 * accelerations * lengths)) / 2
        peaks = np.minimum(speeds, np.where(long >= full, long, np.cbrt(lengths**2 * jerks / 4)))
        return peaks, np.where(peaks >= full, accelerations, np.sqrt(peaks * jerks))


def smoothed_clock(chain: Chain, passed: Passing, rows: Ints, reached: Floats, standing: Floats) -> Clock:
    """Return the clock of moving blocks that a control passes within the axes' jerks.

    From stop to stop, the path speeds are those of trapezoids, each averaged over a window before it: the path is the
    same, a run takes the window longer, and the acceleration changes within the window from what one trapezoid says to
    what another says. What a block or corner allows holds as far around it as the window reaches.

    Args:
        chain: the moving blocks.
        passed: how the control passes them, without blends or arcs at corners.
        rows: (m,) their rows among n blocks.
        reached: (n + 1,) path coordinate at the program's start and at each block's end.
        standing: (n,) seconds that each of the other blocks takes.
    """
    stops = passed.caps == 0.0
    runs = np.append(0, np.cumsum(stops[:-1]))
    places = np.append(reached[rows], reached[rows[-1] + 1])
    with np.errstate(divide="ignore"):
        jerks = 1.0 / greatest(chain.shares, chain.jerks)
    first, last = reachable(chain.lengths, passed.speeds, passed.accelerations, passed.caps)
    tops = np.minimum(passed.speeds, np.sqrt((2.0 * passed.accelerations * chain.lengths + first**2 + last**2) / 2.0))
    # A run is no faster, and changes its speed no faster, than if it were one move.
    steepest, windows, fastest = np.zeros((3, runs[-1] + 1))
    np.maximum.at(steepest, runs, passed.accelerations)
    np.maximum.at(windows, runs, passed.accelerations / jerks)
    np.maximum.at(fastest, runs, tops)
    windows = np.where(windows > 0.0, np.maximum(windows, LEAST_WINDOW), 0.0)
    lengths: Floats = np.bincount(runs, chain.lengths).astype(np.float64)
    with np.errstate(divide="ignore"):
        peaks, rates = eased(lengths, fastest, steepest, steepest / windows)
    gentle = rates / steepest
    limits = _Limits(
        runs, places, np.minimum(passed.speeds, peaks[runs]), passed.accelerations * gentle[runs], passed.caps
    )
    stood = np.cumsum(standing)[rows]
    course = _course(limits, windows * gentle, stood)
    # Where it turns from speeding up to braking within a window, the acceleration changes by up to twice as much.
    if np.any(course.hasty):
        course = _course(limits, windows * gentle * np.where(course.hasty, 2.0, 1.0), stood)
    return _clock(course, passed, rows, reached, standing, stops)


@dataclass(frozen=True, eq=False)
class _Limits(Frozen):
    """What blocks and corners of runs from stop to stop allow, before anything is averaged.

    Attributes:
        runs: (m,) run of each block, from 0.
        places: (m + 1,) path coordinate at the blocks' ends, the first begin included.
        speeds: (m,) greatest path speed.
        rates: (m,) greatest path acceleration.
        caps: (m,) greatest path speed at each block's end; 0 for a stop.
    """

    runs: Ints
    places: Floats
    speeds: Floats
    rates: Floats
    caps: Floats


@dataclass(frozen=True, eq=False)
class _Course(Frozen):
    """Path speeds that change linearly, from stop to stop, and the windows to average them over.

    Attributes:
        moments: (b,) seconds at the breakpoints, not decreasing; each run is followed by the time of its window.
        marks: (b,) path coordinate there.
        speeds: (b,) path speed there.
        of: (b,) run of each.
        runs: (m,) run of each block.
        starts: (r,) seconds at which each run begins.
        stops: (r,) seconds at which its last trapezoid ends.
        windows: (r,) seconds.
        hasty: (r,) whether it changes from speeding up to braking, or back, within its window.
    """

    moments: Floats
    marks: Floats
    speeds: Floats
    of: Ints
    runs: Ints
    starts: Floats
    stops: Floats
    windows: Floats
    hasty: Mask

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Return the path coordinate (c,) and the path speed (c,) at times (c,)."""
        index = np.clip(np.searchsorted(self.moments, times, side="right") - 1, 0, len(self.moments) - 2)
        since, slopes = np.maximum(times - self.moments[index], 0.0), self.slopes(times)
        speeds = self.speeds[index] + since * slopes
        return self.marks[index] + since * (self.speeds[index] + speeds) / 2.0, speeds

    def slopes(self, times: Floats) -> Floats:
        """Return the path acceleration (c,) at times (c,), right after a breakpoint."""
        index = np.clip(np.searchsorted(self.moments, times, side="right") - 1, 0, len(self.moments) - 2)
        spans = np.diff(self.moments)
        slopes: Floats = (np.diff(self.speeds) / np.where(spans > 0.0, spans, 1.0))[index]
        return np.where(spans[index] > 0.0, slopes, 0.0)

    def before(self, times: Floats, runs: Ints) -> Floats:
        """Return the beginning (c,) of the window that ends at times (c,), no earlier than the runs (c,) begin."""
        return np.maximum(times - self.windows[runs], self.starts[runs])

    def averaged(self, times: Floats, runs: Ints) -> tuple[Floats, Floats]:
        """Return the path speed (c,) and acceleration (c,) at times (c,) in runs (c,), averaged over the window."""
        windows, (place, speed) = self.windows[runs], self.at(times)
        (place_before, speed_before), smooth = self.at(self.before(times, runs)), windows > 0.0
        shares = np.where(smooth, windows, 1.0)
        speeds = np.where(smooth, np.maximum(place - place_before, 0.0) / shares, speed)
        return speeds, np.where(smooth, (speed - speed_before) / shares, self.slopes(times))


def _course(limits: _Limits, windows: Floats, stood: Floats) -> _Course:
    """Return the path speeds of runs that keep what blocks and corners allow, as far around these as windows reach.

    Args:
        limits: of blocks and corners.
        windows: (r,) seconds of each run.
        stood: (m,) seconds stood still by non-moving blocks up to each block.
    """
    cuts, speeds, rates = _around(limits, windows)
    lengths = np.diff(cuts)
    block = np.searchsorted(limits.places, cuts[:-1], side="right") - 1
    of = limits.runs[block]
    ends = np.append(of[1:] != of[:-1], True)
    # Without a window, a corner's own place alone is as slow as the corner.
    caps = np.minimum(speeds, np.append(speeds[1:], 0.0))
    corners = np.searchsorted(cuts, limits.places[1:]) - 1
    caps[corners] = np.minimum(caps[corners], limits.caps)
    first, last = reachable(lengths, speeds, rates, caps)
    tops = np.minimum(speeds, np.sqrt((2.0 * rates * lengths + first**2 + last**2) / 2.0))
    rise, fall = np.maximum(tops - first, 0.0) / rates, np.maximum(tops - last, 0.0) / rates
    ramped = (rise * (first + tops) + fall * (last + tops)) / 2.0
    seconds = rise + fall + np.maximum(lengths - ramped, 0.0) / tops
    waited = np.append(0.0, np.cumsum(np.where(ends, windows[of], 0.0))[:-1]) + stood[block]
    finish = np.cumsum(seconds) + waited
    begins = finish - seconds
    times = np.column_stack([begins, begins + rise, finish - fall, finish]).ravel()
    path_speeds = np.column_stack([first, tops, tops, last]).ravel()
    # Only where the acceleration changes is a breakpoint.
    slopes = np.column_stack([rates, np.zeros(len(rates)), -rates, np.zeros(len(rates))]).ravel()
    lasting = np.flatnonzero((np.append(np.diff(times), 0.0) > SAME_MOMENT) & (np.tile([1, 1, 1, 0], len(rates)) > 0))
    run = np.repeat(of, 4)[lasting]
    changed = np.append(True, (np.diff(slopes[lasting]) != 0.0) | (np.diff(run) > 0))
    begun, stopped = lasting[changed], np.flatnonzero(np.repeat(ends, 4))[3::4]
    kept = np.sort(np.append(begun, stopped))
    moments = np.append(np.maximum.accumulate(times[kept]), finish[-1] + windows[-1])
    path_speeds = np.append(path_speeds[kept], 0.0)
    ways = np.diff(moments) * (path_speeds[1:] + path_speeds[:-1]) / 2.0
    firsts = np.append(True, of[1:] != of[:-1])
    return _Course(
        moments=moments,
        marks=cuts[0] + np.append(0.0, np.cumsum(ways)),
        speeds=path_speeds,
        of=np.append(np.repeat(of, 4)[kept], of[-1]),
        runs=limits.runs,
        starts=begins[firsts],
        stops=finish[ends],
        windows=windows,
        hasty=_hasty(begins, finish, rise, fall, of, windows),
    )


def _hasty(begins: Floats, ends: Floats, rise: Floats, fall: Floats, of: Ints, windows: Floats) -> Mask:
    """Return whether runs (r,) change from speeding up to braking, or back, within their windows (r,).

    Args:
        begins: (c,) seconds at which trapezoids begin.
        ends: (c,) seconds at which they end.
        rise: (c,) seconds in which each speeds up.
        fall: (c,) seconds in which each brakes.
        of: (c,) run of each.
        windows: (r,) seconds.
    """
    since, until = (np.column_stack(pair).ravel() for pair in ((begins, ends - fall), (begins + rise, ends)))
    lasting = np.flatnonzero(until - since > NO_RAMP)
    up, of = lasting % 2 == 0, np.repeat(of, 2)[lasting]
    gaps = since[lasting][1:] - until[lasting][:-1]
    turned = (up[1:] != up[:-1]) & (of[1:] == of[:-1]) & (gaps < windows[of[1:]] * (1.0 - CLOSE))
    hasty = np.zeros(len(windows), np.bool_)
    hasty[of[1:][turned]] = True
    return hasty


def _around(limits: _Limits, windows: Floats) -> tuple[Floats, Floats, Floats]:
    """Return cuts (c + 1,) of the path, and the greatest speed (c,) and acceleration (c,) between them.

    An averaged speed is that of a stretch as long as it drives in a window: half of that before a place, half after.
    """
    places, runs = limits.places, limits.runs
    starts = np.append(True, runs[1:] != runs[:-1])
    begin, end = places[:-1][starts][runs], np.append(places[:-1][starts][1:], places[-1])[runs]
    half = windows[runs] / 2.0
    corners = np.flatnonzero(limits.caps > 0.0)
    reach = half * limits.speeds
    low, high = places[:-1] - reach, places[1:] + reach
    corner_reach = (half * limits.caps)[corners]
    low = np.maximum(np.append(low, places[1:][corners] - corner_reach), np.append(begin, begin[corners]))
    high = np.minimum(np.append(high, places[1:][corners] + corner_reach), np.append(end, end[corners]))
    cuts = np.unique(np.concatenate([places, low, high]))
    spans = np.searchsorted(cuts, low), np.searchsorted(cuts, high)
    held = _least(*spans, np.append(limits.speeds, limits.caps[corners]), len(cuts) - 1)
    blocks = slice(len(runs))
    return cuts, held, _least(spans[0][blocks], spans[1][blocks], limits.rates, len(cuts) - 1)


def _least(low: Ints, high: Ints, values: Floats, count: int) -> Floats:
    """Return at each of `count` places the least of the values (m,) that hold from places low (m,) to high (m,).

    Every range is two overlapping ones as long as a power of two, and each of these two of half its length.
    """
    sizes = high - low
    kept = sizes > 0
    low, high, values, sizes = low[kept], high[kept], values[kept], sizes[kept]
    levels = np.frexp(sizes)[1] - 1
    least = np.full(count, np.inf)
    for level in range(int(np.max(levels)), -1, -1):
        long, half = np.flatnonzero(levels == level), 1 << level
        np.minimum.at(least, low[long], values[long])
        np.minimum.at(least, high[long] - half, values[long])
        if level:
            shorter = least.copy()
            np.minimum(shorter[half // 2 :], least[: -(half // 2)], out=shorter[half // 2 :])
            least = shorter
    return least


def _clock(course: _Course, passed: Passing, rows: Ints, reached: Floats, standing: Floats, stops: Mask) -> Clock:
    """Return the clock of a course that is averaged over its windows."""
    moments = np.concatenate([course.moments, course.moments + course.windows[course.of]])
    order = np.lexsort((moments, np.tile(course.of, 2)))
    moments, of = np.maximum.accumulate(moments[order]), np.tile(course.of, 2)[order]
    speeds = course.averaged(moments, of)[0]
    middles = course.averaged((moments[:-1] + moments[1:]) / 2.0, of[:-1])[0]
    bulges = np.append(middles - (speeds[:-1] + speeds[1:]) / 2.0, 0.0)
    ways = np.diff(moments) * ((speeds[:-1] + speeds[1:]) / 2.0 + 2.0 / 3.0 * bulges[:-1])
    marks = course.marks[0] + np.append(0.0, np.cumsum(np.maximum(ways, 0.0)))
    nothing = np.zeros(len(standing))
    clock = Clock(reached, np.zeros(len(reached)), stops, moments, marks, speeds, nothing, nothing, bulges=bulges)
    ends = clock.first_times(reached[rows + 1])
    # A run ends a window after its trapezoids do.
    ends[stops] = course.stops + course.windows
    peaks, ramps, jerks = _greatest(course, clock, ends)
    spread = np.zeros((3, len(standing)))
    spread[:, rows] = peaks, ramps, jerks
    clock = replace(clock, peaks=spread[0], ramps=spread[1], jerks=spread[2])
    joined = np.flatnonzero(passed.rounding[:-1] > LEAST_BLEND)
    turns, easing = passed.rounding[joined], passed.easing[joined]
    even = clock.speeds_at(ends[joined]) / (turns - easing)
    blends = Blends.of(rows, joined, len(standing), ends[joined] - turns / 2.0, turns, even, even, easing)
    return replace(clock, blends=blends).through(rows, ends, stops, standing)


def _greatest(course: _Course, clock: Clock, ends: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the greatest path speed (m,), acceleration (m,) and jerk (m,) in each moving block.

    Args:
        course: before it is averaged.
        clock: of the averaged speeds.
        ends: (m,) seconds at the blocks' ends.
    """
    times = np.sort(np.concatenate([clock.moments, ends]))
    middles, spans = (times[:-1] + times[1:]) / 2.0, np.diff(times)
    block = np.minimum(np.searchsorted(ends, middles), len(ends) - 1)
    runs = course.runs[block]
    greatest = np.zeros((3, len(ends)))
    for moments in (times[:-1], times[1:], middles):
        # A peak between two breakpoints is where the acceleration passes through 0.
        speeds, rates = course.averaged(moments, runs)
        np.maximum.at(greatest[0], block, speeds)
        np.maximum.at(greatest[1], block, np.where(spans > HIDDEN, np.abs(rates), 0.0))
    begin, finish = (course.averaged(moments, runs) for moments in (times[:-1], times[1:]))
    crossing = np.flatnonzero((begin[1] > 0.0) & (finish[1] < 0.0))
    share = begin[1][crossing] / (begin[1] - finish[1])[crossing]
    np.maximum.at(greatest[0], block[crossing], begin[0][crossing] + share * spans[crossing] * begin[1][crossing] / 2.0)
    windows = course.windows[runs]
    before = middles - windows
    change = np.abs(course.slopes(middles) - np.where(before > course.starts[runs], course.slopes(before), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        jerks = np.where((change > 0.0) & (spans > HIDDEN), change / windows, 0.0)
    np.maximum.at(greatest[2], block, jerks)
    return greatest[0], greatest[1], greatest[2]
