"""Planned blocks: rows of a program during planning, in tables that are joined once at the end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, SampleTable
from tapelayer.motion.time_law import Limits, feeds, rapids
from tapelayer.motion.trajectory import ON_THE_FLY, Event, Kind, Trajectory


@dataclass(frozen=True, eq=False)
class PlannedBlocks(SampleTable):
    """Blocks in execution order, ready for a trajectory.

    Attributes:
        joints: (n, k) joint values at each block's end, metres and radians.
        kinds: (n,) `Kind`.
        durations: (n,) seconds that the words ask for.
        events: (n,) `Event`.
        stated: (n,) bit i is set where axis i is written even if it does not change.
        arcs: (n,) metres along the course, for messages; 0 off a course.
        tolerances: (n,) metres by which the control may round off the block's end; 0 where it stops there exactly.
    """

    joints: Floats
    kinds: NDArray[np.uint8]
    durations: Floats
    events: NDArray[np.uint8]
    stated: NDArray[np.uint16]
    arcs: Floats
    tolerances: Floats

    def __len__(self) -> int:
        """Number of blocks."""
        return len(self.kinds)

    def stating(self, block: int, axes: int) -> Self:
        """Return the same blocks, with one of them stating the axes of these bits."""
        stated = self.stated.copy()
        stated[block] = axes
        return replace(self, stated=stated)

    def trajectory(self, axes: tuple[str, ...], courses: Ints) -> Trajectory:
        """Return the trajectory of these blocks, with every axis unstated at its start.

        Args:
            axes: names of the k joints.
            courses: (n,) index of the course or pass that each block serves.
        """
        return Trajectory(
            axes=axes,
            start=np.full(len(axes), np.nan),
            positions=self.joints,
            kinds=self.kinds,
            durations=self.durations,
            events=self.events,
            courses=courses.astype(np.int32),
            stated=self.stated,
            lines=np.zeros(len(self), np.int32),
            tolerances=self.tolerances,
        )


def rapid_blocks(begin: Floats, nodes: Floats, limits: Limits) -> PlannedBlocks:
    """Return rapids from joint values (k,), NaN where unknown, through nodes (m, k)."""
    return _motions(nodes, Kind.RAPID, rapids(np.diff(nodes, axis=0, prepend=begin[None]), limits))


def feed_blocks(begin: Floats, nodes: Floats, limits: Limits, least: Floats) -> PlannedBlocks:
    """Return straight blocks from joint values (k,) through nodes (m, k), each in `least` (m,) seconds or more."""
    return _motions(nodes, Kind.LINEAR, feeds(np.diff(nodes, axis=0, prepend=begin[None]), limits, least))


def dwell_block(joints: Floats, seconds: float) -> PlannedBlocks:
    """Return a dwell at joint values (k,)."""
    return _motions(joints[None], Kind.DWELL, np.array([seconds]))


def switch_block(joints: Floats, event: Event) -> PlannedBlocks:
    """Return a switching block at joint values (k,)."""
    block = _motions(joints[None], Kind.SWITCH, np.zeros(1))
    return replace(block, events=np.array([event], np.uint8), tolerances=np.array([ON_THE_FLY]))


def _motions(nodes: Floats, kind: Kind, durations: Floats) -> PlannedBlocks:
    """Return blocks of one kind that end at nodes (m, k) and take (m,) seconds."""
    count = len(nodes)
    return PlannedBlocks(
        joints=nodes,
        kinds=np.full(count, kind, np.uint8),
        durations=durations,
        events=np.zeros(count, np.uint8),
        stated=np.zeros(count, np.uint16),
        arcs=np.zeros(count),
        tolerances=np.zeros(count),
    )
