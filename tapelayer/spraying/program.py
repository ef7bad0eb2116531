"""Program: the passes of a job become the blocks of a spraying program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tapelayer.arrays import Floats, Frozen
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES, angles_between, gun_axes
from tapelayer.motion.corners import Rule
from tapelayer.motion.layout import even_blocks
from tapelayer.motion.planned_blocks import PlannedBlocks, dwell_block, feed_blocks, rapid_blocks, switch_block
from tapelayer.motion.time_law import Limits, at_speed, axis_times, feeds, rapids, timed, within_reach
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.spraying.passes import Pass, Split
from tapelayer.spraying.reach import wrist_of
from tapelayer.spraying.settings import SpraySetup
from tapelayer.spraying.wrist_path import follow
from tapelayer.units import DEG, MM

# A link between passes keeps the arc on only if the axes can follow at this share of the gun's speed.
SLOWEST = 0.5
# A block is slow if an axis needs more time than the gun would, by more than this share.
_SLOW = 1e-3
_EVERY_AXIS = (1 << len(AXES)) - 1


@dataclass(frozen=True, eq=False)
class Piece(Frozen):
    """A pass, or a part of it between splits, with the wrist's angles.

    Attributes:
        index: index of the pass.
        arc_lengths: (n,) metres along the pass.
        joints: (n, 5) values of `AXES`, metres and radians.
    """

    index: int
    arc_lengths: Floats
    joints: Floats


@dataclass(frozen=True)
class Slowdown:
    """The slowest place of a pass in which an axis slows the gun down.

    Attributes:
        number: the pass's number, from 1.
        point: in `machine`, metres.
        axis: name of the axis.
        speed: of the gun, m/s.
    """

    number: int
    point: tuple[float, float, float]
    axis: str
    speed: float


@dataclass(frozen=True, eq=False)
class Spraying:
    """A planned spraying program.

    Attributes:
        trajectory: its blocks.
        pieces: the pieces it sprays, in order.
        splits: where passes are split into pieces.
        slowdowns: where axes slow the gun down, at most one per pass.
    """

    trajectory: Trajectory
    pieces: tuple[Piece, ...]
    splits: tuple[Split, ...]
    slowdowns: tuple[Slowdown, ...]


# A control that reaches every speed at once: for planning without one.
AT_ONCE = Rule()


def spray(
    passes: Sequence[Pass],
    setup: SpraySetup,
    machine: Machine,
    highest: float,
    tick: Tick = silent,
    rule: Rule = AT_ONCE,
) -> Spraying:
    """Return the program of passes: every pass approached, sprayed and left, or linked to the next with the arc on.

    Args:
        passes: in spraying order.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        highest: z of the part's highest point in `machine`, metres.
        tick: called after every pass.
        rule: how the control turns blocks into motion.
    """
    wrist = wrist_of(setup, machine)
    theta = min(max(0.0, wrist.theta.lower), wrist.theta.upper)
    splits: list[Split] = []
    sprayed: list[SprayedPass] = []
    for index, planned in enumerate(passes):
        path = planned.path
        followed = follow(wrist, path.normals, path.arc_lengths, planned.leans, theta)
        theta = float(followed.theta[-1])
        joints = np.column_stack([path.points[followed.points], followed.theta, followed.phi])
        arcs = path.arc_lengths[followed.points]
        ends = np.append(followed.starts[1:], len(joints))
        pieces = [
            laid_out(Piece(index, arcs[first:last], joints[first:last]), setup, machine)
            for first, last in zip(followed.starts.tolist(), ends.tolist(), strict=True)
        ]
        for reason, piece in zip(followed.reasons, pieces[1:], strict=True):
            x, y, z = piece.joints[0, :3].tolist()
            splits.append(Split(path.number, (x, y, z), reason))
        sprayed.append(SprayedPass(index, planned, tuple(p for p in pieces if p.arc_lengths[-1] > p.arc_lengths[0])))
        tick()
    axes = [machine.axis(name) for name in AXES]
    gun = Gun(
        setup=setup,
        limits=Limits.of(axes),
        lower=np.array([axis.lower for axis in axes[:3]]),
        upper=np.array([axis.upper for axis in axes[:3]]),
        height=min(highest + setup.spray.retract_mm * MM, axes[2].upper),
        rule=rule,
    )
    trajectory = _trajectory(gun, [each for each in sprayed if each.pieces])
    timely = timed(replace(trajectory, positions=rule.written(trajectory.positions)), gun.limits, rule)
    return Spraying(
        trajectory=within_reach(timely, gun.limits, rule),
        pieces=tuple(piece for each in sprayed for piece in each.pieces),
        splits=tuple(splits),
        slowdowns=tuple(slow for each in sprayed if (slow := _slowest(gun, each))),
    )


@dataclass(frozen=True, eq=False)
class SprayedPass:
    """A pass with the pieces in which it is sprayed.

    Attributes:
        index: index of the pass, from 0.
        planned: the pass.
        pieces: its pieces of nonzero length, in order.
    """

    index: int
    planned: Pass
    pieces: tuple[Piece, ...]


@dataclass(frozen=True, eq=False)
class Gun:
    """Everything that the passes of a program share, and the blocks that they are made of.

    Attributes:
        setup: the job's values.
        limits: of `AXES`.
        lower: (3,) lower ends of the travel of x, y, z, metres.
        upper: (3,) upper ends, metres.
        height: of axis z on a link from pass to pass, metres, unless one of its ends is higher.
        rule: how the control turns blocks into motion.
    """

    setup: SpraySetup
    limits: Limits
    lower: Floats
    upper: Floats
    height: float
    rule: Rule

    def fed(self, begin: Floats, nodes: Floats) -> PlannedBlocks:
        """Return straight blocks from joint values (5,) through nodes (m, 5) at the gun's speed or the axes' limits."""
        lengths = np.linalg.norm(np.diff(nodes[:, :3], axis=0, prepend=begin[None, :3]), axis=1)
        return feed_blocks(begin, nodes, self.limits, at_speed(lengths, self.setup.speed))

    def passed(self, begin: Floats, nodes: Floats) -> PlannedBlocks:
        """Return blocks with the arc on, as `fed`: without stops, at most at the speed that the control holds."""
        steps = np.diff(nodes, axis=0, prepend=begin[None])
        lengths = np.linalg.norm(steps[:, :3], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            accelerations = lengths / np.max(np.abs(steps) / self.limits.acceleration, axis=1)
            speeds = np.minimum(self.setup.speed, self.rule.held(lengths, accelerations))
            least = np.where(lengths > 0.0, lengths / speeds, 0.0)
        blocks = feed_blocks(begin, nodes, self.limits, least)
        rounding = self.rule.rounding(self.setup.spray.tolerance_mm * MM)
        return replace(blocks, tolerances=np.full(len(blocks), rounding))

    def retracted(self, joints: Floats) -> Floats:
        """Return joint values (5,) with P retracted along the gun's axis as far as the travel permits."""
        axis = gun_axes(joints[3], joints[4])
        with np.errstate(divide="ignore", invalid="ignore"):
            distances = np.where(axis > 0, (self.upper - joints[:3]) / axis, (self.lower - joints[:3]) / axis)
        free = max(float(np.min(distances[axis != 0])), 0.0)
        away = joints.copy()
        away[:3] += min(self.setup.spray.retract_mm * MM, free) * axis
        return np.concatenate([np.clip(away[:3], self.lower, self.upper), away[3:]])

    def stopped(self, blocks: PlannedBlocks) -> PlannedBlocks:
        """Return the blocks of a pass, ending in a stop where a retraction would overlap their blended end too fast."""
        if self.rule.ramp_share == 1.0:
            return blocks
        return replace(blocks, tolerances=np.append(blocks.tolerances[:-1], 0.0))

    def near(self, end: Floats, start: Floats) -> bool:
        """Return whether the gun may move from joint values `end` to `start` (5,) with the arc on."""
        distance = float(np.linalg.norm(start[:3] - end[:3]))
        turning = float(rapids((start - end)[None], self.limits)[0])
        if not 0.0 < distance <= self.setup.spray.max_gap_mm * MM:
            return False
        return turning * SLOWEST <= at_speed(distance, self.setup.speed)

    def linked(self, end: Floats, start: Floats) -> PlannedBlocks:
        """Return blocks from the end of a pass straight to the start of the next, with the arc on."""
        turn = abs(float(start[3] - end[3]))
        steps = max(math.ceil(turn / (self.setup.verification.max_theta_step_deg * DEG) - 1e-9), 1)
        return self.passed(end, np.linspace(end, start, steps + 1)[1:]).stating(0, _EVERY_AXIS)

    def approached(self, begin: Floats, start: Floats) -> PlannedBlocks:
        """Return blocks over the part to the start of a pass, then air and arc on; joints of `begin` may be NaN."""
        approach = self.retracted(start)
        up, over = begin.copy(), approach.copy()
        up[2] = over[2] = max(self.height, float(np.nanmax([begin[2], approach[2]])))
        link = rapid_blocks(begin, np.stack([up, over, approach]), self.limits)
        lead = self.setup.process.air_lead_s
        return PlannedBlocks.joined(
            [
                link.stating(0, 1 << AXES.index("z")).stating(1, _EVERY_AXIS),
                self.fed(approach, start[None]),
                switch_block(start, Event.AIR_ON),
                *([dwell_block(start, lead)] if lead else []),
                switch_block(start, Event.ARC_ON),
            ]
        )

    def sprayed(self, pieces: Sequence[Piece]) -> PlannedBlocks:
        """Return blocks along the pieces of a pass from the start of the first, with the arc off between pieces."""
        parts = [self.passed(pieces[0].joints[0], pieces[0].joints[1:])]
        for before, piece in zip(pieces, pieces[1:], strict=False):
            end, start = before.joints[-1], piece.joints[0]
            left, approach = self.retracted(end), self.retracted(start)
            parts[-1] = self.stopped(parts[-1])
            parts += [
                switch_block(end, Event.ARC_OFF),
                self.fed(end, left[None]),
                rapid_blocks(left, approach[None], self.limits),
                self.fed(approach, start[None]),
                switch_block(start, Event.ARC_ON),
                self.passed(start, piece.joints[1:]),
            ]
        return PlannedBlocks.joined(parts)

    def left(self, end: Floats, layer_done: bool) -> PlannedBlocks:
        """Return blocks that switch off and retract the gun after a pass; between layers it waits or stops."""
        away, spray = self.retracted(end), self.setup.spray
        parts = [switch_block(end, Event.ARC_OFF), switch_block(end, Event.AIR_OFF), self.fed(end, away[None])]
        if layer_done and spray.interlayer_dwell_s:
            parts.append(dwell_block(away, spray.interlayer_dwell_s))
        if layer_done and spray.interlayer_stop:
            parts.append(switch_block(away, Event.STOP))
        return PlannedBlocks.joined(parts)


def _trajectory(gun: Gun, sprayed: Sequence[SprayedPass]) -> Trajectory:
    """Return the program of passes that have pieces, in order, to the end: gun retracted, arc and air off."""
    parts: list[tuple[int, PlannedBlocks]] = []
    at = np.full(len(AXES), np.nan)
    for before, each in zip([None, *sprayed], sprayed, strict=False):
        start = each.pieces[0].joints[0]
        layer_done = before is not None and before.planned.layer != each.planned.layer
        if before is not None and not layer_done and gun.near(at, start):
            parts.append((each.index, gun.linked(at, start)))
        else:
            if before is not None:
                parts[-1] = (before.index, gun.stopped(parts[-1][1]))
                parts.append((before.index, gun.left(at, layer_done)))
                at = parts[-1][1].joints[-1]
            parts.append((each.index, gun.approached(at, start)))
        parts.append((each.index, gun.sprayed(each.pieces)))
        at = each.pieces[-1].joints[-1]
    parts[-1] = (sprayed[-1].index, gun.stopped(parts[-1][1]))
    parts.append((sprayed[-1].index, gun.left(at, layer_done=False)))
    passes = np.repeat([index for index, _ in parts], [len(blocks) for _, blocks in parts])
    return PlannedBlocks.joined([blocks for _, blocks in parts]).trajectory(AXES, passes)


def laid_out(piece: Piece, setup: SpraySetup, machine: Machine) -> Piece:
    """Return a piece with few nodes, straight from node to node, within the tolerances of P and of the gun's direction.

    As on a course, P stands off its path at a node by as much as midway between two, on the other side, as far as the
    travel goes.
    """
    slides = [machine.axis(name) for name in AXES[:3]]
    travel = np.array([axis.lower for axis in slides]), np.array([axis.upper for axis in slides])
    spray, arcs = setup.spray, piece.arc_lengths
    if len(arcs) < 3 or not arcs[-1] > arcs[0]:
        return piece
    kept = np.append(True, np.diff(arcs) > 0.0)
    arcs, dense = arcs[kept], piece.joints[kept]
    axes = gun_axes(dense[:, 3], dense[:, 4])
    limits = spray.tolerance_mm * MM, spray.tolerance_deg * DEG
    turn = setup.verification.max_theta_step_deg * DEG

    def excess(ends: Floats) -> Floats:
        nodes = _nodes(arcs, dense, ends, travel)
        straight = _between(arcs, ends, nodes)
        off = np.linalg.norm(straight[:, :3] - dense[:, :3], axis=1) / limits[0]
        # The excess is to grow with the square of a block's length: the direction lags with the length itself.
        lean = angles_between(gun_axes(straight[:, 3], straight[:, 4]), axes) / limits[1]
        worst = np.maximum(off, lean)
        block = np.clip(np.searchsorted(ends, arcs, side="right") - 1, 0, len(ends) - 2)
        found = np.zeros(len(ends) - 1)
        np.maximum.at(found, block, worst)
        return np.maximum(found, (np.abs(np.diff(nodes[:, 3])) / turn) ** 2)

    layout = even_blocks(arcs, np.zeros(len(arcs) - 1), arcs[[0, -1]], excess)
    if layout.faulty is not None:
        return Piece(piece.index, arcs, dense)
    return Piece(piece.index, layout.ends, _nodes(arcs, dense, layout.ends, travel))


def _nodes(arcs: Floats, dense: Floats, ends: Floats, travel: tuple[Floats, Floats]) -> Floats:
    """Return the joint values (m, 5) at block ends (m,) of a path (n, 5), P balanced about it within its travel.

    Args:
        arcs: (n,) metres along the path.
        dense: (n, 5) joint values there.
        ends: (m,) metres.
        travel: lower and upper ends (3,) of the travel of x, y, z, metres.
    """
    nodes, middles = _between(ends, arcs, dense), _between((ends[1:] + ends[:-1]) / 2.0, arcs, dense)
    sags = middles[:, :3] - (nodes[1:, :3] + nodes[:-1, :3]) / 2.0
    nodes[1:-1, :3] = np.clip(nodes[1:-1, :3] + (sags[1:] + sags[:-1]) / 4.0, *travel)
    return nodes


def _between(at: Floats, places: Floats, values: Floats) -> Floats:
    """Return values (m, k) at (m,) places by straight interpolation of values (n, k) at places (n,)."""
    return np.column_stack([np.interp(at, places, column) for column in values.T])


def _slowest(gun: Gun, sprayed: SprayedPass) -> Slowdown | None:
    """Return the slowest place of a pass where an axis slows the gun down, if any."""
    slow = [place for piece in sprayed.pieces if (place := _slowdown(gun, sprayed.planned.path.number, piece))]
    return min(slow, key=lambda place: place.speed, default=None)


def _slowdown(gun: Gun, number: int, piece: Piece) -> Slowdown | None:
    """Return the slowest place of a piece, of the pass with this number, where an axis slows the gun down, if any."""
    steps, lengths = np.diff(piece.joints, axis=0), np.diff(piece.arc_lengths)
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = lengths / feeds(steps, gun.limits, at_speed(lengths, gun.setup.speed))
    worst = int(np.nanargmin(speeds))
    if not speeds[worst] < gun.setup.speed * (1 - _SLOW):
        return None
    x, y, z = piece.joints[worst + 1, :3].tolist()
    axis = AXES[int(np.argmax(axis_times(steps[worst], gun.limits)))]
    return Slowdown(number, (x, y, z), axis, float(speeds[worst]))
