"""Arc runs: where a program has the arc on, pass by pass, and samples along these blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask, SampleTable
from tapelayer.motion.trajectory import MOTIONS, Event, Trajectory
from tapelayer.vectors import ramp
from tapelayer.verification.sampling import sample_counts

# Largest distance between the samples of a pass, in metres.
SPRAYED_SAMPLE_STEP = 2.5e-3


@dataclass(frozen=True, eq=False)
class ArcRun:
    """Consecutive blocks of one pass with the arc on: from ARC_ON or the pass's start to ARC_OFF or its end.

    Attributes:
        index: index of the pass.
        blocks: (b,) motions with the arc on.
        linked: whether the arc was already on when the run began.
    """

    index: int
    blocks: Ints
    linked: bool


def arc_on(trajectory: Trajectory) -> Mask:
    """Return a mask (n,) of the motions with the arc on."""
    last = np.maximum.accumulate(
        np.where(np.isin(trajectory.events, (Event.ARC_ON, Event.ARC_OFF)), np.arange(len(trajectory)), -1)
    )
    on: Mask = (last >= 0) & (trajectory.events[np.maximum(last, 0)] == Event.ARC_ON)
    return on & np.isin(trajectory.kinds, MOTIONS)


def arc_runs_of(trajectory: Trajectory) -> list[ArcRun]:
    """Return every run of blocks with the arc on, pass by pass."""
    rows = np.flatnonzero(arc_on(trajectory) & (trajectory.courses >= 0))
    if not len(rows):
        return []
    switches = np.cumsum(trajectory.events == Event.ARC_ON)[rows]
    passes = trajectory.courses[rows]
    new = np.append(True, (np.diff(switches) != 0) | (np.diff(passes) != 0))
    firsts = np.flatnonzero(new)
    return [
        ArcRun(int(passes[first]), blocks, bool(first and switches[first] == switches[first - 1]))
        for first, blocks in zip(firsts.tolist(), np.split(rows, firsts[1:]), strict=True)
    ]


def stops_of(trajectory: Trajectory) -> int:
    """Return the number of places where the gun stops between two motions with the arc on throughout."""
    if trajectory.clock is None:
        return 0
    rows = np.flatnonzero(arc_on(trajectory))
    switched = np.cumsum(np.isin(trajectory.events, (Event.ARC_ON, Event.ARC_OFF)))[rows]
    return int(np.sum(trajectory.clock.stands[rows[:-1]] & (np.diff(switched) == 0)))


@dataclass(frozen=True, eq=False)
class RunSamples(SampleTable):
    """Samples of an arc run, in order.

    Attributes:
        joints: (n, k) joint values, metres and radians.
        times: (n,) seconds from the program's start.
        asked: (n,) the same as the words ask for it, without ramps.
        speeds: (n,) m/s of P on the control.
        blocks: (n,) index of the block.
    """

    joints: Floats
    times: Floats
    asked: Floats
    speeds: Floats
    blocks: Ints

    @classmethod
    def of(cls, trajectory: Trajectory, blocks: Ints) -> RunSamples:
        """Return the samples in blocks (b,)."""
        lengths = lengths_of(trajectory, blocks)
        counts = sample_counts(lengths, SPRAYED_SAMPLE_STEP)
        block, step = ramp(counts)
        block, fractions = np.append(0, block), np.append(0.0, (step + 1) / counts[block])
        rows, requested = blocks[block], trajectory.requested
        times = trajectory.moments(rows, fractions)
        asked = np.cumsum(requested)[rows] - (1.0 - fractions) * requested[rows]
        speeds = trajectory.paces(rows, times) * lengths[block]
        return cls(trajectory.rounded(rows, fractions), times, asked, speeds, rows)


def lengths_of(trajectory: Trajectory, blocks: Ints) -> Floats:
    """Return the distance (b,) that P moves in each block, in metres; the chord for a circular block."""
    steps = trajectory.positions[blocks, :3] - trajectory.begins(blocks)[:, :3]
    lengths: Floats = np.linalg.norm(steps, axis=1)
    return lengths
