"""Clearance: proof that a machine's whole motion stays clear of the mould, of its table and of itself.

Every joint's shapes move past the mould on one track, and past each other's on one track for each pair of joints. Two
shapes fail where they are too near at some place, or cannot be proved to be far enough.

The mould is an open sheet of triangles, which has no inside: a machine wholly beneath it is far from all of it. The
motion therefore has to begin above the mould.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from tapelayer.arrays import Floats, Frozen, Mask
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.nearness import Relief, flattened, meets_ray, query, triangles
from tapelayer.machines.body import ROOT, Body, Shape
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.units import MM
from tapelayer.verification.known_motion import KnownMotion
from tapelayer.verification.track import FINEST, Least, Pair, Tally, Track, least, unproved

MOULD = "mould"
# What is pressed on the mould may touch it within this much motion before it is pressed on and after it is lifted.
TOUCHING = 3 * MM
# Clearances between the machine's own shapes are measured only where they are less than this more than the limit.
OWN_MEASURED = 10 * MM
# No point of the mould is farther from the flattened mould than this, in metres.
FLATTENED = 0.5 * MM


@dataclass(frozen=True)
class ClearanceLimits:
    """The least clearances that a motion must keep, in metres.

    Attributes:
        mould: between any shape and the mould with the plies already laid.
        own: between the machine's own shapes, its table among them.
        laid: thickness of the plies already laid on the mould.
    """

    mould: float
    own: float
    laid: float = 0.0


@dataclass(frozen=True, eq=False)
class Pressed(Frozen):
    """A shape that is pressed on the mould at times, when it is judged by its position instead.

    Attributes:
        shape: its name.
        blocks: (n,) the blocks during any part of which it is pressed on.
    """

    shape: str
    blocks: Mask


@dataclass(frozen=True)
class Spot:
    """A place in a program.

    Attributes:
        block: index of the block.
        share: how far along it, from 0 to 1.
        course: index of the course or pass that the block serves, -1 before the first.
    """

    block: int
    share: float
    course: int


@dataclass(frozen=True)
class Nearest:
    """The least clearance of a motion.

    Attributes:
        pair: names of the two shapes that come nearest, `MOULD` for the mould; empty where none is near.
        links: the links that they belong to, likewise.
        low: no point of the motion is nearer than this, metres; 0 where the shapes touch.
        high: a clearance that was found, metres; inf where none was, as none comes nearer than `low`.
        spot: where it was found.
    """

    pair: tuple[str, ...]
    links: tuple[str, ...]
    low: float
    high: float
    spot: Spot | None


@dataclass(frozen=True)
class TooNear:
    """Two shapes that come nearer to each other than they may.

    Attributes:
        pair: names of the two shapes, `MOULD` for the mould.
        links: the links that they belong to, likewise.
        clearance: a clearance that was found, metres; 0 where they touch.
        limit: the least that is allowed, metres.
        spot: where it was found.
    """

    pair: tuple[str, str]
    links: tuple[str, str]
    clearance: float
    limit: float
    spot: Spot


@dataclass(frozen=True)
class Clearances:
    """What was found out about the clearance of a motion.

    Attributes:
        judged_from: the first block that was judged; before it the machine's pose is not known.
        judged: whether there was anything to judge, so that a motion of unknown poses does not pass.
        beneath: whether the motion begins with the mould above the tool.
        mould: least clearance from the mould, of all but what is pressed on; None without a mould.
        own: least clearance between the machine's own shapes.
        failures: the pairs that come too near, the nearest first.
        queries: how many pairs of shapes were compared in single poses.
    """

    judged_from: int
    judged: bool
    beneath: bool
    mould: Nearest | None
    own: Nearest | None
    failures: tuple[TooNear, ...]
    queries: int

    @property
    def passed(self) -> bool:
        """Whether every limit is proved to be kept."""
        return self.judged and not self.beneath and not self.failures


def clearance(
    body: Body,
    trajectory: Trajectory,
    mould: Mesh | None,
    limits: ClearanceLimits,
    tool: str,
    pressed: Pressed | None = None,
    held: Mapping[str, float] = MappingProxyType({}),
    tick: Tick = silent,
) -> Clearances:
    """Return the clearance of a motion from the mould, where there is one, from the machine's table and of itself.

    Args:
        body: the machine's shapes.
        trajectory: planned, or read back from a program.
        mould: in `machine` axes; None to judge the machine against itself alone.
        limits: the least clearances allowed.
        tool: the frame that has to be above the mould when the motion begins.
        pressed: the shape that is pressed on the mould, if any.
        held: values of the axes that the program does not move, metres and radians.
        tick: called once per finished pair of moving parts, `ticks` times in all.

    Raises:
        ModelRefused: there is no shape of the pressed one's name, or no frame of the tool's.
    """
    motion = KnownMotion.of(trajectory, body.machine, held)
    tally = Tally()
    if motion.first >= len(motion):
        return Clearances(len(motion), False, False, None, None, (), 0)
    failures: list[TooNear] = []
    nearest, beneath = None, False
    if mould is not None:
        beneath = _begins_beneath(motion, body, mould, tool)
        free, touching = _against_mould(body, motion, mould, pressed, tally)
        needed = limits.mould + limits.laid
        found = least(free, tick)
        if not found.low >= needed:
            failures += _too_near(free, needed, limits.laid)
        failures += _too_near(touching, 0.0, 0.0)
        for _ in touching:
            tick()
        nearest = _nearest(found, limits.laid)
    own = _against_itself(body, motion, tally)
    among = least(own, tick, limits.own + OWN_MEASURED)
    if not among.low >= limits.own:
        failures += _too_near(own, limits.own, 0.0)
    failures.sort(key=lambda failure: (failure.clearance - failure.limit, failure.pair))
    return Clearances(motion.first, True, beneath, nearest, _nearest(among, 0.0), tuple(failures), tally.queries)


def ticks(body: Body, mould: Mesh | None, pressed: Pressed | None = None) -> int:
    """Return how often `clearance` calls its tick."""
    moving = len([joint for joint in body.joints if joint != ROOT])
    return len(body.meetings) + (0 if mould is None else moving + (pressed is not None))


def _too_near(tracks: Sequence[Track], limit: float, laid: float) -> list[TooNear]:
    """Return the pairs that are not proved to keep a limit in metres, of which a thickness in metres is laid."""
    failures = []
    for track in tracks:
        for number, place in sorted(unproved(track, limit).items()):
            pair = track.pairs[number]
            found = track.measured(number, place, limit + FINEST)
            clear = min(max(found - laid, 0.0), limit - laid)
            failures.append(TooNear(pair.pair, pair.links, clear, limit - laid, _spot(track, place)))
    return failures


def _nearest(found: Least, laid: float) -> Nearest:
    """Return a clearance in metres, less the thickness of the plies laid, as the program has it."""
    low, high = max(found.low - laid, 0.0), max(found.high - laid, 0.0)
    if found.track is None:
        return Nearest((), (), low, high, None)
    pair = found.track.pairs[found.number]
    return Nearest(pair.pair, pair.links, low, high, _spot(found.track, found.place))


def _spot(track: Track, place: float) -> Spot:
    """Return a place of a track as the program has it."""
    blocks, shares = track.located(np.array([place]))
    block = int(blocks[0])
    return Spot(block, float(shares[0]), int(track.motion.trajectory.courses[block]))


def _begins_beneath(motion: KnownMotion, body: Body, mould: Mesh, tool: str) -> bool:
    """Return whether the mould is above a frame of the machine where the motion begins."""
    q = motion.at(np.array([motion.first]), np.zeros(1))
    return meets_ray(mould.vertices, mould.facets, body.machine.forward(q, tool)[0, :3, 3])


def _against_mould(
    body: Body, motion: KnownMotion, mould: Mesh, pressed: Pressed | None, tally: Tally
) -> tuple[list[Track], list[Track]]:
    """Return the tracks of all that moves against the mould, and those of what is pressed on, where it is lifted."""
    relief = Relief(mould.vertices, mould.facets)
    sheets = triangles(mould.vertices, mould.facets), triangles(*flattened(mould.vertices, mould.facets, FLATTENED))
    excused = None if pressed is None else body.shape(pressed.shape)
    free, touching = [], []
    for joint in body.joints:
        if joint == ROOT:
            continue
        carrier = body.carriers[joint]
        bounds = motion.bounds(body.rates(joint, reach=motion.reach))
        whole = np.array([[0.0, np.sum(bounds)]])

        def frames(q: Floats, carrier: str = carrier) -> Floats:
            return body.machine.forward(q, carrier)

        pairs = {shape: _with_mould(shape, sheets, relief) for shape in body.carried(joint)}
        others = tuple(pair for shape, pair in pairs.items() if shape is not excused)
        free.append(Track(motion, bounds, whole, frames, others, tally))
        if pressed is not None and excused in pairs:
            spans = _lifted(bounds, pressed.blocks, motion.first)
            touching.append(Track(motion, bounds, spans, frames, (pairs[excused],), tally))
    return free, touching


def _lifted(bounds: Floats, pressed: Mask, first: int) -> Floats:
    """Return the places (s, 2) between which nothing is pressed on, less `TOUCHING` where it is about to be or was."""
    ends = np.append(0.0, np.cumsum(bounds))
    up = np.flatnonzero(~pressed)
    up = up[up >= first]
    breaks = np.flatnonzero(np.diff(up) > 1) + 1
    spans = []
    for run in np.split(up, breaks):
        if not len(run):
            continue
        begin, end = ends[run[0]], ends[run[-1] + 1]
        begin += TOUCHING if run[0] > 0 and pressed[run[0] - 1] else 0.0
        end -= TOUCHING if run[-1] + 1 < len(pressed) and pressed[run[-1] + 1] else 0.0
        if end >= begin:
            spans.append((begin, end))
    return np.array(spans).reshape(-1, 2)


def _with_mould(shape: Shape, sheets: tuple[object, object], relief: Relief) -> Pair:
    """Return a shape and the mould, which is given as it is and flattened."""
    half = shape.half
    exactly, roughly = (query(shape.solid, sheet) for sheet in sheets)

    def far(poses: Floats, margins: Floats) -> Mask:
        reach = np.abs(poses[:, :3, :3]) @ half + margins[:, None]
        return relief.below(poses[:, :3, 3] - reach, poses[:, :3, 3] + reach)

    def perhaps(pose: Floats, margin: float) -> bool:
        return roughly(pose, margin + FLATTENED)

    def near(pose: Floats, margin: float) -> bool:
        # Most that is clear is clear of the flattened mould already.
        return perhaps(pose, margin) and exactly(pose, margin)

    return Pair((shape.name, MOULD), (shape.link, MOULD), near, perhaps, np.eye(4), shape.place, far)


def _against_itself(body: Body, motion: KnownMotion, tally: Tally) -> list[Track]:
    """Return the tracks of all that the machine moves against its other parts."""
    tracks = []
    for upper, lower in body.meetings:
        above = body.meeting(upper, lower)
        bounds = motion.bounds(body.rates(lower, above, motion.reach))
        if upper != above:
            # Each moves against the joint above both, and their distance changes by no more than both together.
            bounds = bounds + motion.bounds(body.rates(upper, above, motion.reach))
        names = body.carriers[upper], body.carriers[lower]

        def frames(q: Floats, names: tuple[str, str] = names) -> Floats:
            poses = body.machine.forward_all(q, names)
            return _inverse(poses[names[0]]) @ poses[names[1]]

        pairs = tuple(_with_other(moving, still) for still, moving in body.may_meet(upper, lower))
        tracks.append(Track(motion, bounds, np.array([[0.0, np.sum(bounds)]]), frames, pairs, tally))
    return tracks


def _with_other(moving: Shape, still: Shape) -> Pair:
    def far(poses: Floats, margins: Floats) -> Mask:
        turned, way = np.abs(poses[:, :3, :3]), poses[:, :3, 3]
        # The gap of their boxes along the axes of the still one, and along those of the moving one.
        gap = np.maximum(np.abs(way) - still.half - turned @ moving.half, 0.0)
        seen = np.abs(np.einsum("nji,nj->ni", poses[:, :3, :3], way))
        other = np.maximum(seen - moving.half - np.einsum("nji,j->ni", turned, still.half), 0.0)
        squares = np.maximum(np.sum(gap * gap, axis=1), np.sum(other * other, axis=1))
        apart: Mask = squares > margins * margins
        return apart

    near = query(moving.solid, still.solid)
    radii = still.ball + moving.ball
    return Pair((still.name, moving.name), (still.link, moving.link), near, near, still.back, moving.place, far, radii)


def _inverse(poses: Floats) -> Floats:
    """Return the inverses (n, 4, 4) of poses (n, 4, 4)."""
    inverses = np.zeros_like(poses)
    inverses[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
    inverses[:, :3, 3] = -np.einsum("nji,nj->ni", poses[:, :3, :3], poses[:, :3, 3])
    inverses[:, 3, 3] = 1.0
    return inverses
