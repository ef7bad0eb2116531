"""Known motion: the part of a program whose poses are known, as values of the machine's axes anywhere along it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.machines.body import Rates
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import CIRCULAR, Trajectory


@dataclass(frozen=True, eq=False)
class KnownMotion(Frozen):
    """The motion of a program from the block on at whose beginning every axis is known.

    Rapids count as straight, and corners as sharp: a control that moves its axes one after the other in a rapid, or
    rounds off corners, leaves this motion.

    Attributes:
        trajectory: the blocks.
        first: the first block of the known motion; the number of blocks where none is known.
        held: (k,) values of the machine's axes that the program does not move; 0 for those that it moves.
        columns: (m,) column of the machine's axes for each column of the trajectory.
        steps: (n, k) how far each axis goes in each block, metres and radians; on an arc, its length for both axes
            of its plane; 0 before the first block.
        arcs: (a,) the blocks that are arcs.
        planes: (a, 2) columns of the machine's axes in the plane of each.
        reach: (k,) farthest from 0 that each axis goes, metres and radians.
    """

    trajectory: Trajectory
    first: int
    held: Floats
    columns: Ints
    steps: Floats
    arcs: Ints
    planes: Ints
    reach: Floats

    @staticmethod
    def of(trajectory: Trajectory, machine: Machine, held: Mapping[str, float] = MappingProxyType({})) -> KnownMotion:
        """Return the known motion of a program.

        Args:
            trajectory: planned, or read back from a program.
            machine: the machine that it moves.
            held: values of the axes that it does not move, metres and radians.

        Raises:
            ValueError: an axis is neither moved nor held, or an arc has no centre.
        """
        missing = set(machine.names) - set(trajectory.axes) - set(held)
        if missing:
            raise ValueError(f"axes {', '.join(sorted(missing))} are neither moved nor held")
        columns = np.array([machine.column(name) for name in trajectory.axes], dtype=np.int64)
        values = np.zeros(len(machine.axes))
        for name, value in held.items():
            values[machine.column(name)] = value
        unknown = np.flatnonzero(~np.all(np.isfinite(np.vstack([trajectory.start, trajectory.positions])), axis=1))
        # Row i of this stack is where block i begins.
        first = int(unknown[-1]) + 1 if len(unknown) else 0
        blocks = np.arange(min(first, len(trajectory)), len(trajectory))
        begins, ends = trajectory.begins(blocks), trajectory.positions[blocks]
        steps = np.zeros((len(trajectory), len(machine.axes)))
        steps[blocks[:, None], columns] = np.abs(ends - begins)
        reach = np.abs(values)
        np.maximum.at(reach, columns, np.max(np.abs(np.concatenate([begins, ends])), axis=0, initial=0.0))
        arcs = blocks[np.isin(trajectory.kinds[blocks], CIRCULAR)]
        planes = np.zeros((0, 2), dtype=np.int64)
        if len(arcs):
            geometry = trajectory.arcs(arcs)
            planes = columns[geometry.axes]
            lengths = np.max(geometry.radii, axis=0) * np.abs(geometry.sweeps) + np.abs(
                np.diff(geometry.radii, axis=0)[0]
            )
            steps[arcs[:, None], planes] = lengths[:, None]
            # An arc may bulge beyond its ends.
            farthest = np.abs(geometry.centres) + np.max(geometry.radii, axis=0)[:, None]
            np.maximum.at(reach, planes, farthest)
        if not np.all(np.isfinite(steps)):
            block = int(np.argmax(~np.all(np.isfinite(steps), axis=1)))
            raise ValueError(f"block {block} has no known length")
        return KnownMotion(trajectory, min(first, len(trajectory)), values, columns, steps, arcs, planes, reach)

    def __len__(self) -> int:
        """Number of blocks, known or not."""
        return len(self.trajectory)

    def bounds(self, rates: Rates) -> Floats:
        """Return how far (n,) the shapes with these rates move at most in each block, metres."""
        return rates.bounds(self.steps, (self.arcs, self.planes))

    def at(self, blocks: Ints, shares: Floats) -> Floats:
        """Return the values (m, k) of all the machine's axes at (m,) shares of the way along known blocks (m,)."""
        values = np.tile(self.held, (len(blocks), 1))
        values[:, self.columns] = self.trajectory.within(blocks, shares)
        return values
