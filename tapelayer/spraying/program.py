"""Spraying: passes and a setup become the blocks of a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, frozen
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES, gun_axes
from tapelayer.motion.time_law import Limits, at_speed, axis_times, feeds, rapids
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.spraying.passes import Pass, Split
from tapelayer.spraying.reach import wrist_of
from tapelayer.spraying.settings import SpraySetup
from tapelayer.spraying.wrist_path import follow
from tapelayer.units import MM

# A way between passes keeps the arc on only if the axes can follow at this share of the gun's speed.
SLOWEST = 0.5
# A block is called slow where an axis takes longer than the gun would by more than this share.
_SLOW = 1e-3


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
    """Program of passes: every pass approached, sprayed and left, or linked to the next with the arc on.

    Args:
        passes: in the order in which they are sprayed.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        highest: z of the part's highest point in `machine`, metres.
        tick: called for every pass that is done.
    """
    wrist = wrist_of(setup, machine)
    theta = min(max(0.0, wrist.theta.lower), wrist.theta.upper)
    program = _Program(setup, machine, highest)
    splits: list[Split] = []
    for index, found in enumerate(passes):
        path = found.path
        followed = follow(wrist, path.normals, path.arc_lengths, found.leans, theta)
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
        program.add(found, [piece for piece in pieces if piece.arc_lengths[-1] > piece.arc_lengths[0]])
        tick()
    return Spraying(program.finished(), tuple(program.pieces), tuple(splits), tuple(program.slowdowns))


class _Program:
    """Blocks of a program as they are added, pass by pass."""

    def __init__(self, setup: SpraySetup, machine: Machine, highest: float) -> None:
        self.setup = setup
        axes = [machine.axis(name) for name in AXES]
        self.limits = Limits.of(axes)
        self.lower, self.upper = (np.array([getattr(axis, end) for axis in axes[:3]]) for end in ("lower", "upper"))
        self.height = min(highest + setup.spray.retract_mm * MM, float(self.upper[2]))
        self.at = np.full(len(AXES), np.nan)
        self.before: Pass | None = None
        self.pieces: list[Piece] = []
        self.slowdowns: list[Slowdown] = []
        self._joints: list[Floats] = []
        self._kinds: list[NDArray[np.uint8]] = []
        self._durations: list[Floats] = []
        self._events: list[NDArray[np.uint8]] = []
        self._courses: list[Ints] = []
        self._stated: list[tuple[int, int]] = []
        self._count = 0

    def add(self, found: Pass, pieces: Sequence[Piece]) -> None:
        """Add the blocks of one pass in its pieces."""
        slowest: Slowdown | None = None
        for row, piece in enumerate(pieces):
            start = piece.joints[0]
            if row:
                self._switch(piece.index, Event.ARC_OFF)
                self._feed(piece.index, self._drawn_off(self.at)[None])
                self._rapid(piece.index, self._drawn_off(start))
                self._feed(piece.index, start[None])
                self._switch(piece.index, Event.ARC_ON)
            elif not self._linked(found, piece):
                self._leave(found)
                self._reach(piece)
            slow = self._sprayed(found, piece)
            slowest = slow if slowest is None or (slow and slow.speed < slowest.speed) else slowest
            self.pieces.append(piece)
        if slowest:
            self.slowdowns.append(slowest)
        self.before = found

    def finished(self) -> Trajectory:
        """The program, once the gun is drawn off and arc and air are off."""
        self._off(len(self._courses) and int(self._courses[-1][-1]))
        joints = np.vstack(self._joints)
        stated = np.zeros(len(joints), dtype=np.uint16)
        for block, bits in self._stated:
            stated[block] = bits
        return Trajectory(
            axes=AXES,
            start=np.full(len(AXES), np.nan),
            positions=joints,
            kinds=np.concatenate(self._kinds),
            durations=np.concatenate(self._durations),
            events=np.concatenate(self._events),
            courses=np.concatenate(self._courses).astype(np.int32),
            stated=stated,
            lines=np.zeros(len(joints), dtype=np.int32),
        )

    def _linked(self, found: Pass, piece: Piece) -> bool:
        """Go straight on to a pass that is near, with the arc on; whether it is."""
        before, start = self.before, piece.joints[0]
        if before is None or before.layer != found.layer:
            return False
        way = float(np.linalg.norm(start[:3] - self.at[:3]))
        turning = float(rapids((start - self.at)[None], self.limits)[0])
        near = 0.0 < way <= self.setup.spray.max_gap_mm * MM
        if not (near and turning * SLOWEST <= at_speed(way, self.setup.speed)):
            return False
        self._state_all()
        steps = max(math.ceil(way / (self.setup.spray.max_point_spacing_mm * MM) - 1e-9), 1)
        self._feed(piece.index, np.linspace(self.at, start, steps + 1)[1:])
        return True

    def _leave(self, found: Pass) -> None:
        """Go away from the last pass, if there is one; between layers, wait or stop."""
        if self.before is None:
            return
        last = int(self._courses[-1][-1])
        self._off(last)
        if self.before.layer != found.layer:
            if self.setup.spray.interlayer_dwell_s:
                self._block(last, self.at, Kind.DWELL, self.setup.spray.interlayer_dwell_s)
            if self.setup.spray.interlayer_stop:
                self._switch(last, Event.STOP)

    def _reach(self, piece: Piece) -> None:
        """Go to the start of a pass above the part, and switch on."""
        start = piece.joints[0]
        approach = self._drawn_off(start)
        up, over = self.at.copy(), approach.copy()
        up[2] = over[2] = max(self.height, float(np.nanmax([self.at[2], approach[2]])))
        self._stated.append((self._count, 1 << AXES.index("z")))
        self._rapid(piece.index, up)
        self._state_all()
        self._rapid(piece.index, over)
        self._rapid(piece.index, approach)
        self._feed(piece.index, start[None])
        self._switch(piece.index, Event.AIR_ON)
        if self.setup.process.air_lead_s:
            self._block(piece.index, start, Kind.DWELL, self.setup.process.air_lead_s)
        self._switch(piece.index, Event.ARC_ON)

    def _off(self, index: int) -> None:
        """Switch off and draw the gun off."""
        self._switch(index, Event.ARC_OFF)
        self._switch(index, Event.AIR_OFF)
        self._feed(index, self._drawn_off(self.at)[None])

    def _sprayed(self, found: Pass, piece: Piece) -> Slowdown | None:
        """Go along a piece; its slowest place, where an axis holds the gun back."""
        steps, lengths = np.diff(piece.joints, axis=0), np.diff(piece.arc_lengths)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = lengths / feeds(steps, self.limits, at_speed(lengths, self.setup.speed))
        self._feed(piece.index, piece.joints[1:])
        worst = int(np.nanargmin(speeds))
        if not speeds[worst] < self.setup.speed * (1 - _SLOW):
            return None
        x, y, z = piece.joints[worst + 1, :3].tolist()
        axis = AXES[int(np.argmax(axis_times(steps[worst], self.limits)))]
        return Slowdown(found.path.number, (x, y, z), axis, float(speeds[worst]))

    def _drawn_off(self, joints: Floats) -> Floats:
        """Joint values (5,) with P drawn off along the gun's axis as far as the travel permits."""
        axis = gun_axes(joints[3], joints[4])
        with np.errstate(divide="ignore", invalid="ignore"):
            rooms = np.where(axis > 0, (self.upper - joints[:3]) / axis, (self.lower - joints[:3]) / axis)
        room = max(float(np.min(rooms[axis != 0])), 0.0)
        away = joints.copy()
        away[:3] += min(self.setup.spray.retract_mm * MM, room) * axis
        return np.concatenate([np.clip(away[:3], self.lower, self.upper), away[3:]])

    def _state_all(self) -> None:
        self._stated.append((self._count, (1 << len(AXES)) - 1))

    def _feed(self, index: int, joints: Floats) -> None:
        """Straight blocks to the joint values (m, 5) at the gun's speed, no axis faster than it may."""
        steps = np.diff(np.vstack([self.at, joints]), axis=0)
        times = feeds(steps, self.limits, at_speed(np.linalg.norm(steps[:, :3], axis=1), self.setup.speed))
        self._blocks(index, joints, np.full(len(joints), Kind.LINEAR, np.uint8), times)

    def _rapid(self, index: int, joints: Floats) -> None:
        self._block(index, joints, Kind.RAPID, float(rapids((joints - self.at)[None], self.limits)[0]))

    def _switch(self, index: int, event: Event) -> None:
        self._block(index, self.at, Kind.SWITCH, 0.0)
        self._events[-1] = np.array([event], np.uint8)

    def _block(self, index: int, joints: Floats, kind: Kind, duration: float) -> None:
        self._blocks(index, joints[None], np.array([kind], np.uint8), np.array([duration]))

    def _blocks(self, index: int, joints: Floats, kinds: NDArray[np.uint8], durations: Floats) -> None:
        self._joints.append(joints)
        self._kinds.append(kinds)
        self._durations.append(durations)
        self._events.append(np.zeros(len(joints), np.uint8))
        self._courses.append(np.full(len(joints), index))
        self._count += len(joints)
        self.at = joints[-1]
