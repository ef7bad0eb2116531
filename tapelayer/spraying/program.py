"""Spraying: passes and a setup become the blocks of a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, frozen
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES, gun_axes
from tapelayer.motion.planned_blocks import PlannedBlocks, dwell_block, feed_blocks, rapid_blocks, switch_block
from tapelayer.motion.time_law import Limits, at_speed, axis_times, feeds, rapids
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.spraying.passes import Pass, Split
from tapelayer.spraying.reach import wrist_of
from tapelayer.spraying.settings import SpraySetup
from tapelayer.spraying.wrist_path import follow
from tapelayer.units import MM

# A way between passes keeps the arc on only if the axes can follow at this share of the gun's speed.
SLOWEST = 0.5
# A block is slow where an axis takes longer than the gun would by more than this share.
_SLOW = 1e-3
_EVERY_AXIS = (1 << len(AXES)) - 1


@dataclass(frozen=True, eq=False)
class Piece:
    """A pass, or a part of it between splits, with the wrist's angles.

    Attributes:
        index: of the pass.
        arc_lengths: (n,) metres along the pass.
        joints: (n, 5) values of `AXES`, metres and radians.
    """

    index: int
    arc_lengths: Floats
    joints: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("arc_lengths", "joints"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True)
class Slowdown:
    """The slowest place of a pass in which an axis holds the gun back.

    Attributes:
        number: of the pass, from 1.
        point: in `machine`, metres.
        axis: the axis.
        speed: of the gun, m/s.
    """

    number: int
    point: tuple[float, float, float]
    axis: str
    speed: float


@dataclass(frozen=True, eq=False)
class Spraying:
    """A planned program.

    Attributes:
        trajectory: its blocks.
        pieces: what it sprays, in order.
        splits: where passes are in pieces.
        slowdowns: where axes hold the gun back, one a pass.
    """

    trajectory: Trajectory
    pieces: tuple[Piece, ...]
    splits: tuple[Split, ...]
    slowdowns: tuple[Slowdown, ...]


def spray(passes: Sequence[Pass], setup: SpraySetup, machine: Machine, highest: float, tick: Tick = silent) -> Spraying:
    """Return the program of passes: every pass approached, sprayed and left, or linked to the next with the arc on.

    Args:
        passes: in the order in which they are sprayed.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        highest: z of the part's highest point in `machine`, metres.
        tick: called for every pass that is done.
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
            Piece(index, arcs[first:last], joints[first:last])
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
    )
    return Spraying(
        trajectory=_trajectory(gun, [each for each in sprayed if each.pieces]),
        pieces=tuple(piece for each in sprayed for piece in each.pieces),
        splits=tuple(splits),
        slowdowns=tuple(slow for each in sprayed if (slow := _slowest(gun, each))),
    )


@dataclass(frozen=True, eq=False)
class SprayedPass:
    """A pass as it is sprayed.

    Attributes:
        index: of the pass, from 0.
        planned: the pass.
        pieces: those of it that are longer than nothing, in order.
    """

    index: int
    planned: Pass
    pieces: tuple[Piece, ...]


@dataclass(frozen=True, eq=False)
class Gun:
    """What all passes of a program have in common, and the blocks that they are made of.

    Attributes:
        setup: the job's values.
        limits: of `AXES`.
        lower: (3,) lower ends of the travel of x, y, z, metres.
        upper: (3,) upper ends, metres.
        height: of axis z on the way from pass to pass, metres, where the ends of the way are not higher.
    """

    setup: SpraySetup
    limits: Limits
    lower: Floats
    upper: Floats
    height: float

    def fed(self, begin: Floats, nodes: Floats) -> PlannedBlocks:
        """Straight blocks from joint values (5,) through nodes (m, 5) at the gun's speed, or as fast as the axes go."""
        ways = np.linalg.norm(np.diff(nodes[:, :3], axis=0, prepend=begin[None, :3]), axis=1)
        return feed_blocks(begin, nodes, self.limits, at_speed(ways, self.setup.speed))

    def drawn_off(self, joints: Floats) -> Floats:
        """Joint values (5,) with P drawn off along the gun's axis as far as the travel permits."""
        axis = gun_axes(joints[3], joints[4])
        with np.errstate(divide="ignore", invalid="ignore"):
            rooms = np.where(axis > 0, (self.upper - joints[:3]) / axis, (self.lower - joints[:3]) / axis)
        room = max(float(np.min(rooms[axis != 0])), 0.0)
        away = joints.copy()
        away[:3] += min(self.setup.spray.retract_mm * MM, room) * axis
        return np.concatenate([np.clip(away[:3], self.lower, self.upper), away[3:]])

    def near(self, end: Floats, start: Floats) -> bool:
        """Whether the gun may go on from joint values to joint values (5,) with the arc on."""
        way = float(np.linalg.norm(start[:3] - end[:3]))
        turning = float(rapids((start - end)[None], self.limits)[0])
        if not 0.0 < way <= self.setup.spray.max_gap_mm * MM:
            return False
        return turning * SLOWEST <= at_speed(way, self.setup.speed)

    def linked(self, end: Floats, start: Floats) -> PlannedBlocks:
        """Blocks from the end of a pass straight on to the start of the next, with the arc on."""
        way = float(np.linalg.norm(start[:3] - end[:3]))
        steps = max(math.ceil(way / (self.setup.spray.max_point_spacing_mm * MM) - 1e-9), 1)
        return self.fed(end, np.linspace(end, start, steps + 1)[1:]).stating(0, _EVERY_AXIS)

    def approached(self, begin: Floats, start: Floats) -> PlannedBlocks:
        """Blocks above the part to the start of a pass, where air and arc go on; unknown joints of `begin` are NaN."""
        approach = self.drawn_off(start)
        up, over = begin.copy(), approach.copy()
        up[2] = over[2] = max(self.height, float(np.nanmax([begin[2], approach[2]])))
        way = rapid_blocks(begin, np.stack([up, over, approach]), self.limits)
        lead = self.setup.process.air_lead_s
        return PlannedBlocks.joined(
            [
                way.stating(0, 1 << AXES.index("z")).stating(1, _EVERY_AXIS),
                self.fed(approach, start[None]),
                switch_block(start, Event.AIR_ON),
                *([dwell_block(start, lead)] if lead else []),
                switch_block(start, Event.ARC_ON),
            ]
        )

    def sprayed(self, pieces: Sequence[Piece]) -> PlannedBlocks:
        """Blocks along the pieces of a pass from the start of the first, the arc off between them."""
        parts = [self.fed(pieces[0].joints[0], pieces[0].joints[1:])]
        for before, piece in zip(pieces, pieces[1:], strict=False):
            end, start = before.joints[-1], piece.joints[0]
            left, approach = self.drawn_off(end), self.drawn_off(start)
            parts += [
                switch_block(end, Event.ARC_OFF),
                self.fed(end, left[None]),
                rapid_blocks(left, approach[None], self.limits),
                self.fed(approach, start[None]),
                switch_block(start, Event.ARC_ON),
                self.fed(start, piece.joints[1:]),
            ]
        return PlannedBlocks.joined(parts)

    def left(self, end: Floats, layer_done: bool) -> PlannedBlocks:
        """Blocks that switch off and draw the gun off after a pass; between layers it waits or stops."""
        away, spray = self.drawn_off(end), self.setup.spray
        parts = [switch_block(end, Event.ARC_OFF), switch_block(end, Event.AIR_OFF), self.fed(end, away[None])]
        if layer_done and spray.interlayer_dwell_s:
            parts.append(dwell_block(away, spray.interlayer_dwell_s))
        if layer_done and spray.interlayer_stop:
            parts.append(switch_block(away, Event.STOP))
        return PlannedBlocks.joined(parts)


def _trajectory(gun: Gun, sprayed: Sequence[SprayedPass]) -> Trajectory:
    """The program of passes that have pieces, in order, until the gun is drawn off and arc and air are off."""
    parts: list[tuple[int, PlannedBlocks]] = []
    at = np.full(len(AXES), np.nan)
    for before, each in zip([None, *sprayed], sprayed, strict=False):
        start = each.pieces[0].joints[0]
        layer_done = before is not None and before.planned.layer != each.planned.layer
        if before is not None and not layer_done and gun.near(at, start):
            parts.append((each.index, gun.linked(at, start)))
        else:
            if before is not None:
                parts.append((before.index, gun.left(at, layer_done)))
                at = parts[-1][1].joints[-1]
            parts.append((each.index, gun.approached(at, start)))
        parts.append((each.index, gun.sprayed(each.pieces)))
        at = each.pieces[-1].joints[-1]
    parts.append((sprayed[-1].index, gun.left(at, layer_done=False)))
    passes = np.repeat([index for index, _ in parts], [len(blocks) for _, blocks in parts])
    return PlannedBlocks.joined([blocks for _, blocks in parts]).trajectory(AXES, passes)


def _slowest(gun: Gun, sprayed: SprayedPass) -> Slowdown | None:
    """The slowest place of a pass, where an axis holds the gun back."""
    slow = [found for piece in sprayed.pieces if (found := _slowdown(gun, sprayed.planned.path.number, piece))]
    return min(slow, key=lambda found: found.speed, default=None)


def _slowdown(gun: Gun, number: int, piece: Piece) -> Slowdown | None:
    """The slowest place of a piece of the pass with this number, where an axis holds the gun back."""
    steps, lengths = np.diff(piece.joints, axis=0), np.diff(piece.arc_lengths)
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = lengths / feeds(steps, gun.limits, at_speed(lengths, gun.setup.speed))
    worst = int(np.nanargmin(speeds))
    if not speeds[worst] < gun.setup.speed * (1 - _SLOW):
        return None
    x, y, z = piece.joints[worst + 1, :3].tolist()
    axis = AXES[int(np.argmax(axis_times(steps[worst], gun.limits)))]
    return Slowdown(number, (x, y, z), axis, float(speeds[worst]))
