"""Trajectory: blocks of joint motion with their times and switching words, as a program before it is text."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Frozen, Ints, frozen
from tapelayer.motion.clock import Clock
from tapelayer.vectors import dot


class Kind(IntEnum):
    """The kind of motion or action of a block."""

    RAPID = 0
    LINEAR = 1
    CLOCKWISE = 2
    COUNTERCLOCKWISE = 3
    DWELL = 4
    SWITCH = 5


class Event(IntEnum):
    """The event of a switching block; a controller table gives each its word."""

    NONE = 0
    SHOE_DOWN = 1
    SHOE_UP = 2
    ROLLER_DOWN = 3
    ROLLER_UP = 4
    KNIFE_1_DOWN = 5
    KNIFE_1_UP = 6
    KNIFE_2_DOWN = 7
    KNIFE_2_UP = 8
    SUPPLY_MODE = 9
    HEATER_ON = 10
    HEATER_OFF = 11
    STOP = 12
    AIR_ON = 13
    AIR_OFF = 14
    ARC_ON = 15
    ARC_OFF = 16


CIRCULAR = (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)
MOTIONS = (Kind.RAPID, Kind.LINEAR, *CIRCULAR)


@dataclass(frozen=True, eq=False)
class Arcs:
    """Circular blocks in their planes.

    Attributes:
        axes: (m, 2) columns of the plane's axes in the positions.
        centres: (m, 2) joint values along these axes, in metres.
        radii: (2, m) metres, at the beginning and at the end.
        angles: (m,) of the beginning, radians from the first axis towards the second.
        sweeps: (m,) radians turned from there to the end, at most a full turn.
    """

    axes: Ints
    centres: Floats
    radii: Floats
    angles: Floats
    sweeps: Floats


ON_THE_FLY = np.inf
# The attributes of a trajectory that have a row a block.
ROWS = ("kinds", "durations", "events", "courses", "stated", "lines", "centres", "planes", "tolerances", "asked")
# Where a trajectory states no tolerances, the control stops at every block's end.
NOT_ROUNDED = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Trajectory(Frozen):
    """Blocks in execution order; row i is block i.

    Attributes:
        axes: joint names, the columns of `positions`.
        start: (k,) joint values before the first block, in metres and radians; NaN where nothing has stated them yet.
        positions: (n, k) joint values at each block's end, in metres and radians.
        kinds: (n,) `Kind` of each block.
        durations: (n,) seconds that each takes; where the time law was not asked yet, those that its words ask for.
        events: (n,) `Event` of each switching block, NONE elsewhere.
        courses: (n,) index (from 0) of the course or pass that the block serves, -1 before the first.
        stated: (n,) bit i is set where axis i is written even if it does not change.
        centres: (n, 3) centre of each circular block in joint coordinates x, y, z (metres), NaN elsewhere.
        planes: (n,) plane of each circular block: 0 XY, 1 ZX, 2 YZ.
        lines: (n,) line of the program (from 1) that the block was read from, 0 if it was not read.
        tolerances: (n,) metres by which the control may round off the block's end; 0 where it stops there exactly. For
            a switching word, 0 where the control finishes all motion first, `ON_THE_FLY` where motion may go on.
        asked: (n,) seconds that the words ask for; None where the durations are these.
        clock: when the control is where; None before the time law was asked.
    """

    axes: tuple[str, ...]
    start: Floats
    positions: Floats
    kinds: NDArray[np.uint8]
    durations: Floats
    events: NDArray[np.uint8]
    courses: NDArray[np.int32]
    stated: NDArray[np.uint16]
    lines: NDArray[np.int32]
    centres: Floats | None = None
    planes: NDArray[np.uint8] | None = None
    tolerances: Floats = field(default_factory=lambda: NOT_ROUNDED)
    asked: Floats | None = None
    clock: Clock | None = None

    def __post_init__(self) -> None:
        """Check that the rows match, and freeze the arrays."""
        n, k = self.positions.shape
        if len(self.axes) != k or self.start.shape != (k,):
            raise ValueError(f"{len(self.axes)} axes do not fit positions of shape {self.positions.shape}")
        if self.tolerances is NOT_ROUNDED:
            object.__setattr__(self, "tolerances", np.where(self.kinds == Kind.SWITCH, ON_THE_FLY, 0.0))
        for name in ROWS:
            rows = getattr(self, name)
            if rows is not None and len(rows) != n:
                raise ValueError(f"{name} has {len(rows)} rows, positions {n}")
        super().__post_init__()

    def __len__(self) -> int:
        """Number of blocks."""
        return len(self.kinds)

    @property
    def duration(self) -> float:
        """Seconds from the first block to the last."""
        return float(np.sum(self.durations))

    @cached_property
    def times(self) -> Floats:
        """Seconds (n,) from the program's start to each block's end."""
        return frozen(np.cumsum(self.durations) if self.clock is None else self.clock.ends[1:])

    @property
    def requested(self) -> Floats:
        """Seconds (n,) that the words of each block ask for; a rapid asks for none in particular."""
        return self.durations if self.asked is None else self.asked

    def moments(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the seconds (m,) from the program's start to (m,) fractions of the way along blocks (m,)."""
        if self.clock is None:
            return self.times[blocks] - (1.0 - fractions) * self.durations[blocks]
        return self.clock.times(blocks, fractions)

    def fractions(self, blocks: Ints, times: Floats) -> Floats:
        """Return how far along blocks (m,), from 0 to 1, the control is at times (m,) in seconds."""
        if self.clock is not None:
            return self.clock.fractions(blocks, times)
        spent = self.durations[blocks]
        left = (self.times[blocks] - times) / np.where(spent > 0.0, spent, 1.0)
        return np.clip(1.0 - left, 0.0, 1.0)

    def progress(self, times: Floats) -> Floats:
        """Return how many blocks that take time (m,), parts included, are done at times (m,) in seconds."""
        blocks = np.minimum(np.searchsorted(self.times, times, side="left"), len(self) - 1)
        before, after = self._lasting[blocks], self._lasting[blocks + 1]
        done: Floats = np.where(after > before, self.fractions(blocks, times), 0.0)
        return done + before

    @cached_property
    def _lasting(self) -> Ints:
        """Return how many blocks that take time (n + 1,) are done at the program's start and at each block's end."""
        return frozen(np.append(0, np.cumsum(np.diff(self.times, prepend=0.0) > 0.0)))

    def paces(self, blocks: Ints, times: Floats) -> Floats:
        """Return the share of blocks (m,) that the control covers a second at times (m,) in seconds.

        Where two blocks overlap, both count: the share is that of the motion along both.
        """
        spent = self.durations[blocks]
        even = np.divide(1.0, spent, out=np.zeros(len(blocks)), where=spent > 0.0)
        if self.clock is None or not len(self.clock.marks):
            return even
        lengths = self.clock.reached[blocks + 1] - self.clock.reached[blocks]
        return np.divide(self.clock.speeds_at(times), lengths, out=even, where=lengths > 0.0)

    def rounded(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the joint values (m, k) as `within`, with corners rounded off as the control rounds them."""
        values = self.within(blocks, fractions)
        blends = None if self.clock is None else self.clock.blends
        if self.clock is None or blends is None:
            return values
        for off, before, after in zip(
            self.clock.corners(blocks, fractions),
            (blends.preceding[blocks], blocks),
            (blocks, blends.following[blocks]),
            strict=True,
        ):
            turned = np.flatnonzero(off > 0.0)
            leaving = self.directions(before[turned], np.ones(len(turned)))
            values[turned] += off[turned, None] * (self.directions(after[turned], np.zeros(len(turned))) - leaving)
        return values

    def directions(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the change (m, k) of every axis per path unit at (m,) fractions of the way along moving blocks (m,).

        Raises:
            ValueError: the time law was not asked, so no path is known.
        """
        if self.clock is None:
            raise ValueError("a trajectory has paths only after the time law was asked")
        lengths = self.clock.reached[blocks + 1] - self.clock.reached[blocks]
        directions: Floats = self.derivatives(blocks, fractions) / lengths[:, None]
        return directions

    def column(self, axis: str) -> int:
        """Return the column of an axis in `positions`."""
        return self.axes.index(axis)

    def begins(self, blocks: Ints) -> Floats:
        """Return the joint values (m, k) at the beginning of blocks (m,), in metres and radians."""
        values = self.positions[np.maximum(blocks - 1, 0)]
        first = blocks == 0
        if np.any(first):
            values[first] = self.start
        return values

    def within(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the joint values (m, k) at (m,) fractions (0 beginning, 1 end) of blocks (m,).

        Blocks are straight in joint space, except in the two axes of a circular block's plane: those turn about its
        centre at a constant rate, while the radius changes linearly from the beginning to the end.
        """
        begin = self.begins(blocks)
        values = begin + fractions[:, None] * (self.positions[blocks] - begin)
        circular = np.flatnonzero(np.isin(self.kinds[blocks], CIRCULAR))
        if len(circular):
            rows = np.arange(len(circular))
            arcs, along = self.arcs(blocks[circular]), fractions[circular]
            angles = arcs.angles + along * arcs.sweeps
            radii = arcs.radii[0] + along * (arcs.radii[1] - arcs.radii[0])
            turned = arcs.centres + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
            # Take the ends from the program, free of the rounding of the radius.
            turned[along == 1.0] = self.positions[blocks[circular]][rows[:, None], arcs.axes][along == 1.0]
            turned[along == 0.0] = begin[circular][rows[:, None], arcs.axes][along == 0.0]
            values[circular[:, None], arcs.axes] = turned
        return values

    def derivatives(self, blocks: Ints, fractions: Floats) -> Floats:
        """Return the change (m, k) of every axis per block at (m,) fractions of the way along blocks (m,).

        An axis that nothing has stated before a block changes by 0 there.
        """
        changes: Floats = np.nan_to_num(self.positions[blocks] - self.begins(blocks))
        circular = np.flatnonzero(np.isin(self.kinds[blocks], CIRCULAR))
        if len(circular):
            arcs, along = self.arcs(blocks[circular]), fractions[circular]
            angles, widening = arcs.angles + along * arcs.sweeps, arcs.radii[1] - arcs.radii[0]
            turning = (arcs.radii[0] + along * widening) * arcs.sweeps
            outward, forward = np.array([np.cos(angles), np.sin(angles)]), np.array([-np.sin(angles), np.cos(angles)])
            changes[circular[:, None], arcs.axes] = (widening * outward + turning * forward).T
        return changes

    def extremes(self, blocks: Ints) -> tuple[Floats, Floats]:
        """Return the greatest change (m, k) of every axis per block of blocks (m,), and the greatest change of that.

        The second is the turning of arcs, 0 elsewhere. Each axis of an arc's plane counts as if it took all of both
        somewhere on the arc.
        """
        changes = np.abs(self.derivatives(blocks, np.zeros(len(blocks))))
        bends = np.zeros_like(changes)
        circular = np.flatnonzero(np.isin(self.kinds[blocks], CIRCULAR))
        if len(circular):
            arcs = self.arcs(blocks[circular])
            turned = np.max(arcs.radii, axis=0) * np.abs(arcs.sweeps)
            changes[circular[:, None], arcs.axes] = turned[:, None]
            bends[circular[:, None], arcs.axes] = (turned * np.abs(arcs.sweeps))[:, None]
        return changes, bends

    def arcs(self, blocks: Ints) -> Arcs:
        """Return the geometry of circular blocks (m,).

        Raises:
            ValueError: the trajectory has no centres or planes.
        """
        if self.centres is None or self.planes is None:
            raise ValueError("a trajectory with circular blocks needs their centres and planes")
        columns = np.array([self.column(axis) for axis in "xyz"])
        # In each plane a counterclockwise block turns from the first of these axes to the second.
        pairs = np.array([[0, 1], [2, 0], [1, 2]])[self.planes[blocks]]
        axes, rows = columns[pairs], np.arange(len(blocks))[:, None]
        centres = self.centres[blocks][rows, pairs]
        begins, ends = self.begins(blocks)[rows, axes] - centres, self.positions[blocks][rows, axes] - centres
        cross = begins[:, 0] * ends[:, 1] - begins[:, 1] * ends[:, 0]
        sweeps = np.arctan2(cross, dot(begins, ends))
        turn = np.where(self.kinds[blocks] == Kind.COUNTERCLOCKWISE, 2.0 * np.pi, -2.0 * np.pi)
        sweeps = np.where(sweeps * turn > 0.0, sweeps, sweeps + turn)
        return Arcs(
            axes=axes,
            centres=centres,
            radii=np.array([np.hypot(*begins.T), np.hypot(*ends.T)]),
            angles=np.arctan2(begins[:, 1], begins[:, 0]),
            sweeps=sweeps,
        )
