"""Track: the motion of shapes past what they must stay clear of, proved interval by interval.

A place along a track is the metres that the shapes have moved at most until there. One query at an interval's middle,
at the limit and half the interval's length, proves all of it; an interval that is not proved is halved, until a shape
is nearer than the limit itself, or the interval is too short. So what is proved holds between block ends, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.geometry.nearness import UNCERTAINTY, Query
from tapelayer.progress import Tick
from tapelayer.units import MM
from tapelayer.vectors import ramp
from tapelayer.verification.known_motion import KnownMotion

# Intervals of motion are first this long at most, in metres, and are halved down to the other length.
LONGEST = 0.512
FINEST = 0.25 * MM
# Intervals of more than twice this length are proved by boxes alone, in metres.
COARSE = 16 * MM
# Intervals up to twice as long are proved by the full query, in metres, longer ones by the quicker one alone.
DETAILED = 2 * MM
# The least clearance is found to within this, in metres, where it is less than the other distance by as much.
BRACKET = 0.4 * MM
FARTHEST = 100 * MM
# So many of the places that are not proved are tried at the limit itself: a hit there decides the pair.
_TRIED = 16
_CHUNK = 1 << 14
# A clearance at one place is measured to within this, in metres.
_MEASURED = 0.02 * MM


class Tally:
    """A count of the queries made."""

    def __init__(self) -> None:
        self.queries = 0


@dataclass(frozen=True, eq=False)
class Pair:
    """A moving shape and what it must stay clear of.

    Attributes:
        pair: names of both.
        links: the links that they belong to.
        near: whether the moving one, with a pose in the still one's frame, is nearer than a margin.
        perhaps: the same, quicker: it never misses one that is nearer, and may hit one that is farther.
        before: (4, 4) from the frame in which the motion is seen to that of the still one.
        place: (4, 4) of the moving one in its joint's frame.
        far: whether (n,) the moving one, with poses (n, 4, 4), is farther than margins (n,) for sure.
        radii: sum of the radii of the balls round both, about their own origins, metres; inf where one has none.
    """

    pair: tuple[str, str]
    links: tuple[str, str]
    near: Query
    perhaps: Query
    before: Floats
    place: Floats
    far: Callable[[Floats, Floats], Mask]
    radii: float = np.inf

    def poses(self, seen: Floats) -> Floats:
        """Return the poses (n, 4, 4) of the moving one in the still one's frame, for those of its joint."""
        poses: Floats = self.before @ seen @ self.place
        return poses


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of the shapes of one joint, seen from what they must stay clear of.

    Attributes:
        motion: of the machine.
        bounds: (n,) how far the shapes move at most in each block, metres.
        spans: (s, 2) the places between which the motion is judged, metres.
        frames: poses (m, 4, 4) of the joint, seen from the still frame, for axis values (m, k).
        pairs: the shapes, each with what it must stay clear of.
        tally: counts the queries.
    """

    motion: KnownMotion
    bounds: Floats
    spans: Floats
    frames: Callable[[Floats], Floats]
    pairs: tuple[Pair, ...]
    tally: Tally = field(default_factory=Tally)

    @cached_property
    def ends(self) -> Floats:
        """Place (n + 1,) at which each block begins, and the last ends."""
        return np.append(0.0, np.cumsum(self.bounds))

    def located(self, places: Floats) -> tuple[Ints, Floats]:
        """Return the blocks (m,) at places (m,), and how far along them these are."""
        last = len(self.bounds) - 1
        blocks = np.clip(np.searchsorted(self.ends, places, side="right") - 1, self.motion.first, last)
        lengths = self.bounds[blocks]
        shares = np.divide(places - self.ends[blocks], lengths, out=np.zeros(len(places)), where=lengths > 0.0)
        return blocks, np.clip(shares, 0.0, 1.0)

    def seen(self, places: Floats) -> Floats:
        """Return the poses (m, 4, 4) of the joint at places (m,)."""
        return self.frames(self.motion.at(*self.located(places)))

    def intervals(self) -> tuple[Floats, Floats]:
        """Return the middles (m,) of the intervals that the motion is first cut into, and half their lengths (m,)."""
        lengths = self.spans[:, 1] - self.spans[:, 0]
        counts = np.maximum(np.ceil(lengths / LONGEST), 1).astype(np.int64)
        owners, numbers = ramp(counts)
        halves = lengths[owners] / counts[owners] / 2
        return self.spans[owners, 0] + (2 * numbers + 1) * halves, halves

    @cached_property
    def _balls(self) -> tuple[Floats, Floats, Floats]:
        """Centres (p, 3) of each pair's moving shape and of its still one, seen as the joint is, and radii (p,)."""
        moving = np.array([pair.place[:3, 3] for pair in self.pairs]).reshape(-1, 3)
        still = np.array([-pair.before[:3, :3].T @ pair.before[:3, 3] for pair in self.pairs]).reshape(-1, 3)
        return moving, still, np.array([pair.radii for pair in self.pairs])

    def balls_near(self, seen: Floats, margins: Floats) -> Mask:
        """Return whether (m, p) the balls round each pair are nearer than margins (m,), with poses (m, 4, 4)."""
        moving, still, radii = self._balls
        ways = np.einsum("nij,pj->npi", seen[:, :3, :3], moving) + seen[:, None, :3, 3] - still
        near: Mask = np.sqrt(np.einsum("npi,npi->np", ways, ways)) <= radii + margins[:, None]
        return near

    def near(self, number: int, pose: Floats, margin: float) -> bool:
        """Return whether a pair is nearer than a margin, with a pose (4, 4) of its moving shape."""
        self.tally.queries += 1
        return self.pairs[number].near(pose, margin)

    def open(self, number: int, pose: Floats, half: float, limit: float) -> bool:
        """Return whether a query leaves an interval of half a length unproved: a pair may come nearer than the limit.

        Long intervals take the quicker query, as they are halved again anyway, and the longest none: they are proved by
        their boxes alone.
        """
        if half > COARSE:
            return True
        if half <= DETAILED:
            return self.near(number, pose, limit + half)
        self.tally.queries += 1
        return self.pairs[number].perhaps(pose, limit + half)

    def measured(self, number: int, place: float, most: float) -> float:
        """Return the clearance of a pair at a place where it is at most so much, 0 where it touches, metres."""
        pose = self.pairs[number].poses(self.seen(np.array([place])))[0]
        least = 0.0
        if self.near(number, pose, 0.0):
            return 0.0
        while most - least > _MEASURED:
            middle = (least + most) / 2
            least, most = (least, middle) if self.near(number, pose, middle) else (middle, most)
        return most


@dataclass
class _Front:
    """Intervals that are yet to be proved, of each pair its own.

    Attributes:
        middles: (m,) places.
        halves: (m,) half their lengths, metres.
        open: (m, p) whether the interval is yet to be proved for each pair.
    """

    middles: Floats
    halves: Floats
    open: Mask

    def chunks(self) -> list[_Front]:
        """Return the intervals in parts whose arrays stay small."""
        rows = [slice(begin, begin + _CHUNK) for begin in range(0, len(self.middles), _CHUNK)]
        return [_Front(self.middles[part], self.halves[part], self.open[part]) for part in rows]

    def halved(self) -> _Front:
        """Return both halves of every interval that is open for any pair."""
        rows = np.flatnonzero(np.any(self.open, axis=1))
        quarters = self.halves[rows] / 2
        middles = np.concatenate([self.middles[rows] - quarters, self.middles[rows] + quarters])
        return _Front(middles, np.tile(quarters, 2), np.tile(self.open[rows], (2, 1)))

    @staticmethod
    def of(track: Track) -> _Front:
        """Return the intervals that a track is first cut into, open for all its pairs."""
        middles, halves = track.intervals()
        return _Front(middles, halves, np.ones((len(middles), len(track.pairs)), np.bool_))

    @staticmethod
    def joined(parts: Sequence[_Front]) -> _Front:
        """Return the intervals of several parts."""
        return _Front(
            np.concatenate([part.middles for part in parts]),
            np.concatenate([part.halves for part in parts]),
            np.concatenate([part.open for part in parts]),
        )


def unproved(track: Track, limit: float) -> dict[int, float]:
    """Return the pairs, by number, that are not proved to keep a limit in metres, each with a place."""
    failed: dict[int, float] = {}
    front = _Front.of(track)
    while len(front.middles):
        following = []
        for part in front.chunks():
            seen = track.seen(part.middles)
            part.open &= track.balls_near(seen, limit + part.halves + 2 * UNCERTAINTY)
            part.open[:, list(failed)] = False
            for number in np.flatnonzero(np.any(part.open, axis=0)).tolist():
                pair = track.pairs[number]
                rows, poses = _suspects(pair, seen, part.open[:, number], limit + part.halves)
                hits = [track.open(number, *at, limit) for at in zip(poses, part.halves[rows], strict=True)]
                part.open[:, number] = False
                part.open[rows[hits], number] = True
                place = _decided(track, number, part, rows[hits], poses[hits], limit)
                if place is not None:
                    failed[number] = place
                    part.open[:, number] = False
            following.append(part.halved())
        front = _Front.joined(following)
    return failed


def _decided(track: Track, number: int, part: _Front, rows: Ints, poses: Floats, limit: float) -> float | None:
    """Return a place where a pair fails for good: it is too near there, or the interval cannot be halved again."""
    tried = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _TRIED)).astype(np.int64))
    for row in tried.tolist():
        if track.near(number, poses[row], limit):
            return float(part.middles[rows[row]])
    short = rows[2 * part.halves[rows] <= FINEST]
    return float(part.middles[short[0]]) if len(short) else None


def _suspects(pair: Pair, seen: Floats, open: Mask, margins: Floats) -> tuple[Ints, Floats]:
    """Return the rows (m,) of poses that may be nearer than their margins, and the pair's poses (m, 4, 4)."""
    rows = np.flatnonzero(open)
    poses = pair.poses(seen[rows])
    keep = ~pair.far(poses, margins[rows] + 2 * UNCERTAINTY)
    return rows[keep], poses[keep]


@dataclass(frozen=True, eq=False)
class Least:
    """The least clearance along some tracks.

    Attributes:
        low: no point of the motion is nearer than this, metres; 0 where shapes touch.
        high: a clearance that was found, metres; inf where none was, as none comes nearer than `low`.
        track: on which it was found; None where none was.
        number: of the pair on that track.
        place: where on that track, metres.
    """

    low: float
    high: float
    track: Track | None = None
    number: int = 0
    place: float = 0.0


def least(tracks: Sequence[Track], tick: Tick, farthest: float = FARTHEST) -> Least:
    """Return the least clearance along some tracks to within `BRACKET`, by branch and bound.

    Args:
        tracks: any number of them.
        tick: called once per finished track.
        farthest: a clearance of more is only known to be that, metres.
    """
    best, where, left = farthest, None, 0.0
    for track in tracks:
        front = _Front.of(track)
        while len(front.middles) and best > 0.0:
            following = []
            for part in front.chunks():
                seen = track.seen(part.middles)
                wanted = max(best - BRACKET, 0.0)
                part.open &= track.balls_near(seen, wanted + part.halves + 2 * UNCERTAINTY)
                for number in np.flatnonzero(np.any(part.open, axis=0)).tolist():
                    pair = track.pairs[number]
                    rows, poses = _suspects(pair, seen, part.open[:, number], wanted + part.halves)
                    part.open[:, number] = False
                    for row, pose in zip(rows.tolist(), poses, strict=True):
                        if not track.open(number, pose, part.halves[row], wanted):
                            continue
                        if track.near(number, pose, wanted):
                            best = track.measured(number, float(part.middles[row]), wanted)
                            where = track, number, float(part.middles[row])
                            wanted = max(best - BRACKET, 0.0)
                        short = 2 * part.halves[row] <= FINEST
                        left = max(left, float(part.halves[row])) if short else left
                        part.open[row, number] = not short
                following.append(part.halved())
            front = _Front.joined(following)
        tick()
    low = max(best - BRACKET - left, 0.0)
    return Least(low, np.inf) if where is None else Least(low, best, *where)
