"""Clock: when a control is where along the blocks of a program, and how fast, as the time law predicts it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask

# Shares of a time this close together are one, and no search for one takes more steps.
SAME_SHARE = 1e-14
MOST_STEPS = 100


@dataclass(frozen=True, eq=False)
class Blends(Frozen):
    """The overlaps of blocks with their successors: one begins while the other still brakes.

    Attributes:
        following: (n,) the block that each block runs into; the block itself where none.
        preceding: (n,) the block that runs into each block; the block itself where none.
        begins: (n,) seconds from the program's start to when the following block begins.
        overlaps: (n,) seconds of that overlap, 0 where the control stops or passes a straight corner.
        braking: (n,) path deceleration of each block in it, path units/s2.
        starting: (n,) path acceleration of the following block in it, path units/s2.
        easing: (n,) seconds at the beginning and at the end of it in which these set in and fade; 0 where at once.
    """

    following: Ints
    preceding: Ints
    begins: Floats
    overlaps: Floats
    braking: Floats
    starting: Floats
    easing: Floats

    @staticmethod
    def of(
        rows: Ints,
        joined: Ints,
        count: int,
        begins: Floats,
        overlaps: Floats,
        braking: Floats,
        starting: Floats,
        easing: Floats,
    ) -> Blends | None:
        """Return the blends of some moving blocks with the next moving ones; None where there are none.

        Args:
            rows: (m,) the moving blocks.
            joined: (j,) which of these overlap with the next.
            count: of all blocks.
            begins: (j,) seconds from the program's start to when the following block begins.
            overlaps: (j,) seconds of overlap.
            braking: (j,) path deceleration of the one block.
            starting: (j,) path acceleration of the other.
            easing: (j,) seconds in which these set in.
        """
        if not len(joined):
            return None
        blocks = np.arange(count)
        following, preceding = blocks.copy(), blocks.copy()
        following[rows[joined]], preceding[rows[joined + 1]] = rows[joined + 1], rows[joined]
        spread = np.zeros((5, count))
        for values, given in zip(spread, (begins, overlaps, braking, starting, easing), strict=True):
            values[rows[joined]] = given
        return Blends(following, preceding, *spread)

    def shifts(self, blocks: Ints, since: Floats) -> Floats:
        """Return the lengths (m,) for an acceleration of 1 that acts since (m,) seconds, and set in as the blend's.

        Args:
            blocks: (m,) blocks at whose ends the blends are.
            since: (m,) seconds, no more than half the overlap.
        """
        easing = self.easing[blocks]
        early = np.minimum(since, easing)
        late = since - early
        cubes = np.divide(early**3, 6.0 * easing, out=np.zeros(len(since)), where=easing > 0.0)
        shifts: Floats = cubes + late * (easing + late) / 2.0
        return shifts


@dataclass(frozen=True, eq=False)
class Clock(Frozen):
    """Time along the blocks of a program.

    The path coordinate adds up the lengths of the blocks' paths, in metres or radians, whichever axes each moves along;
    between two breakpoints the path speed changes linearly, or at a constant jerk as the bulges say.

    Attributes:
        reached: (n + 1,) path coordinate at the program's start and at each block's end.
        ends: (n + 1,) seconds there.
        stands: (n,) True where the control stands still at a block's end.
        moments: (m,) seconds at the breakpoints of the path speed, not decreasing.
        marks: (m,) path coordinate there.
        speeds: (m,) path speed there.
        peaks: (n,) greatest path speed of each block on its own.
        ramps: (n,) path acceleration of each block's ramps; 0 where it has none.
        blends: how blocks overlap; None where none do.
        bulges: (m,) path speed in the middle between a breakpoint and the next, beyond the mean of theirs; None where
            it changes linearly everywhere.
        jerks: (n,) greatest path jerk in each block; None where the control does not limit it.
    """

    reached: Floats
    ends: Floats
    stands: Mask
    moments: Floats
    marks: Floats
    speeds: Floats
    peaks: Floats
    ramps: Floats
    blends: Blends | None = None
    bulges: Floats | None = None
    jerks: Floats | None = None

    def through(self, rows: Ints, ends: Floats, stands: Mask, standing: Floats) -> Clock:
        """Return this clock with the ends of all blocks, those included that do not move.

        Args:
            rows: (m,) the moving blocks of n.
            ends: (m,) seconds at their ends.
            stands: (m,) True where the control stands still there.
            standing: (n,) seconds that each of the others takes.
        """
        # Blocks that do not move end where the last one that moves did, after the time they stand.
        moving = np.zeros(len(standing), np.int64)
        moving[rows] = 1
        last = np.cumsum(moving) - 1
        stood = np.cumsum(standing)
        since = stood - np.where(last >= 0, stood[rows[np.maximum(last, 0)]], 0.0)
        every = np.where(last >= 0, ends[np.maximum(last, 0)], 0.0) + since
        still = np.where(last >= 0, stands[np.maximum(last, 0)], True) | (standing > 0.0)
        return replace(self, ends=np.append(0.0, np.maximum.accumulate(every)), stands=still)

    @property
    def durations(self) -> Floats:
        """Seconds (n,) from block end to block end."""
        durations: Floats = np.diff(self.ends)
        return durations

    def times(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the seconds (m,) from the program's start to fractions (m,) of the way along blocks (m,)."""
        begins, ends = self.ends[blocks], self.ends[blocks + 1]
        even = np.where(fractions == 1.0, ends, begins + fractions * (ends - begins))
        lengths = self.reached[blocks + 1] - self.reached[blocks]
        moving = np.flatnonzero((lengths > 0.0) & (fractions > 0.0) & (fractions < 1.0))
        if not len(moving) or not len(self.marks):
            return even
        at = self.first_times(self.reached[blocks[moving]] + fractions[moving] * lengths[moving])
        even[moving] = np.clip(at, begins[moving], ends[moving])
        return even

    def fractions(self, blocks: Ints, times: Floats) -> Floats:
        """Return how far along blocks (m,), from 0 to 1, the control is at times (m,) in seconds."""
        begins, spans = self.ends[blocks], self.ends[blocks + 1] - self.ends[blocks]
        even = (times - begins) / np.where(spans > 0.0, spans, 1.0)
        lengths = self.reached[blocks + 1] - self.reached[blocks]
        moving = np.flatnonzero((lengths > 0.0) & (spans > 0.0))
        if len(moving) and len(self.marks):
            index, since = self._interval(times[moving])
            at = self.marks[index] + since * (self.speeds[index] + since * self._slopes(index) / 2.0)
            if self.bulges is not None:
                share = self._shares(index, since)
                at += since * share * self.bulges[index] * (2.0 - 4.0 / 3.0 * share)
            even[moving] = (at - self.reached[blocks[moving]]) / lengths[moving]
        # At its end a block is done, whatever is left of it by rounding.
        return np.where(times >= self.ends[blocks + 1], 1.0, np.clip(even, 0.0, 1.0))

    def speeds_at(self, times: Floats) -> Floats:
        """Return the path speed (m,) at times (m,) in seconds; path units/s."""
        index, since = self._interval(times)
        speeds: Floats = self.speeds[index] + since * self._slopes(index)
        if self.bulges is not None:
            share = self._shares(index, since)
            speeds += 4.0 * self.bulges[index] * share * (1.0 - share)
        return speeds

    def corners(self, blocks: Ints, fractions: Floats) -> tuple[Floats, Floats]:
        """Return how far blends round off the corners at the beginning and at the end of blocks.

        The control is off the straight block by these lengths, in path units, times the change of direction there.

        Args:
            blocks: (m,) blocks.
            fractions: (m,) of the way along them.

        Returns:
            Lengths (m,) at the corner before, and (m,) at the corner after.
        """
        if self.blends is None:
            return np.zeros(len(blocks)), np.zeros(len(blocks))
        times = self.times(blocks, fractions)
        blends, before = self.blends, self.blends.preceding[blocks]
        since = np.clip(times - blends.begins[blocks], 0.0, blends.overlaps[blocks])
        left = np.clip(blends.begins[before] + blends.overlaps[before] - times, 0.0, blends.overlaps[before])
        left = np.where(before == blocks, 0.0, left)
        return blends.braking[before] * blends.shifts(before, left), blends.starting[blocks] * blends.shifts(
            blocks, since
        )

    def _interval(self, times: Floats) -> tuple[Ints, Floats]:
        """Return the breakpoint (m,) before each of the times (m,), and the seconds (m,) since."""
        index = np.clip(np.searchsorted(self.moments, times, side="right") - 1, 0, len(self.moments) - 2)
        return index, np.clip(times - self.moments[index], 0.0, self.moments[index + 1] - self.moments[index])

    def _slopes(self, index: Ints) -> Floats:
        """Return the path acceleration (m,) after breakpoints (m,)."""
        spans = self.moments[index + 1] - self.moments[index]
        slopes: Floats = (self.speeds[index + 1] - self.speeds[index]) / np.where(spans > 0.0, spans, 1.0)
        return slopes

    def _shares(self, index: Ints, since: Floats) -> Floats:
        """Return the share (m,) of the time to the next breakpoint that has passed (m,) seconds after breakpoints."""
        spans = self.moments[index + 1] - self.moments[index]
        shares: Floats = since / np.where(spans > 0.0, spans, 1.0)
        return shares

    def first_times(self, coordinates: Floats) -> Floats:
        """Return the first seconds (m,) at which path coordinates (m,) are reached."""
        index = np.clip(np.searchsorted(self.marks, coordinates, side="left") - 1, 0, len(self.marks) - 2)
        along, speed = np.maximum(coordinates - self.marks[index], 0.0), self.speeds[index]
        spans = self.moments[index + 1] - self.moments[index]
        if self.bulges is not None:
            return self.moments[index] + spans * self._shares_of(index, along)
        root = speed + np.sqrt(np.maximum(speed**2 + 2.0 * self._slopes(index) * along, 0.0))
        since = 2.0 * along / np.where(root > 0.0, root, 1.0)
        return self.moments[index] + np.minimum(since, spans)

    def _shares_of(self, index: Ints, along: Floats) -> Floats:
        """Return the share (m,) of the time to the next breakpoint after which lengths (m,) have been covered.

        A cubic that never falls: steps by its slope, halved wherever one would leave what brackets the answer.
        """
        if self.bulges is None:
            raise ValueError("without bulges the way is a square of the time")
        spans = self.moments[index + 1] - self.moments[index]
        first, gain, bulge = self.speeds[index], self.speeds[index + 1] - self.speeds[index], self.bulges[index]
        low, high = np.zeros(len(index)), np.ones(len(index))
        whole = spans * (first + gain / 2.0 + 2.0 / 3.0 * bulge)
        share = np.clip(np.divide(along, whole, out=np.zeros(len(index)), where=whole > 0.0), 0.0, 1.0)
        for _ in range(MOST_STEPS):
            off = spans * share * (first + share * (gain / 2.0 + bulge * (2.0 - 4.0 / 3.0 * share))) - along
            low, high = np.where(off <= 0.0, share, low), np.where(off >= 0.0, share, high)
            if np.all(high - low <= SAME_SHARE):
                break
            slope = spans * (first + share * (gain + 4.0 * bulge * (1.0 - share)))
            step = np.divide(off, slope, out=np.full(len(index), np.inf), where=slope > 0.0)
            better = share - step
            share = np.where((better > low) & (better < high), better, (low + high) / 2.0)
        return share

    @staticmethod
    def even(reached: Floats, durations: Floats, stands: Mask) -> Clock:
        """Return the clock of a control without ramps, which goes through each block at an even speed.

        Args:
            reached: (n + 1,) path coordinate at the program's start and at each block's end.
            durations: (n,) seconds of each block.
            stands: (n,) True where the control stands still at a block's end.
        """
        nothing = np.zeros(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.nan_to_num(np.diff(reached) / durations)
        ends = np.append(0.0, np.cumsum(durations))
        return Clock(reached, ends, stands, nothing, nothing, nothing, speeds, np.zeros(len(durations)))
