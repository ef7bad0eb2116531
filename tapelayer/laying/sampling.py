"""Sampling: when a program lays its courses, and where they are sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.vectors import ramp
from tapelayer.verification.sampling import sample_counts

# Largest distance between the samples of a course, in metres.
LAID_SAMPLE_STEP = 5e-3


@dataclass(frozen=True)
class Laying:
    """An interval with the shoe down, in seconds from the program's start; its blocks are `first` to before `last`."""

    begin: float
    end: float
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class SamplePlaces(Frozen):
    """Samples of a program while it lays some courses, rows in laying order.

    Attributes:
        courses: (n,) index of the course, rising.
        blocks: (n,) index of the block.
        times: (n,) seconds from the program's start.
        asked: (n,) the same as the words ask for it, without ramps.
        feeds: (n,) m/s of the tape.
        joints: (n, k) joint values, metres and radians.
        ends: (n,) True at block ends and at each course's start.
    """

    courses: Ints
    blocks: Ints
    times: Floats
    asked: Floats
    feeds: Floats
    joints: Floats
    ends: Mask

    @classmethod
    def along(cls, trajectory: Trajectory, layings: Sequence[Laying], indices: Ints) -> SamplePlaces:
        """Return the samples of the layings of courses with rising indices (m,)."""
        chosen = [layings[index] for index in indices]
        rows = np.concatenate([np.arange(laying.first, laying.last) for laying in chosen])
        lengths = [laying.last - laying.first for laying in chosen]
        courses = np.repeat(indices, lengths)
        start = np.repeat([laying.begin for laying in chosen], lengths)
        stop = np.repeat([laying.end for laying in chosen], lengths)
        ends = trajectory.times[rows]
        begins = ends - trajectory.durations[rows]
        # A block too short for the clock gets no sample; a move in it fails for its speed.
        timed = (ends > begins) & (ends > start) & (begins < stop)
        rows, courses, begins, ends = rows[timed], courses[timed], begins[timed], ends[timed]
        from_, to = np.maximum(begins, start[timed]), np.minimum(ends, stop[timed])
        u = trajectory.column("u")
        distance = np.abs(trajectory.positions[rows, u] - trajectory.begins(rows)[:, u])
        steps = sample_counts(distance, LAID_SAMPLE_STEP)
        # A block is sampled after its start up to its end, the first block of a course at its start, too.
        first = np.diff(courses, prepend=-1) > 0
        counts = steps + first
        block, number = ramp(counts)
        step = number + 1 - first[block]
        # Even steps along a block, not in time, so that ramps leave no gap.
        edges = (trajectory.fractions(rows, from_), trajectory.fractions(rows, to))
        shares = edges[0][block] + (edges[1] - edges[0])[block] * step / steps[block]
        shares = np.where(step == steps[block], edges[1][block], shares)
        times = np.where(step == steps[block], to[block], trajectory.moments(rows[block], shares))
        joints = trajectory.rounded(rows[block], shares)
        requested = trajectory.requested
        asked = np.cumsum(requested)[rows[block]] - (1.0 - shares) * requested[rows[block]]
        feeds = trajectory.paces(rows[block], times) * distance[block]
        edge = (step == 0) | (step == steps[block])
        return cls(courses[block], rows[block], times, asked, feeds, joints, edge)

    def rows(self, course: int) -> slice:
        """Return the rows of the course with this index."""
        return slice(*np.searchsorted(self.courses, [course, course + 1]).tolist())


def layings_of(trajectory: Trajectory, setup: Setup) -> list[Laying]:
    """Return every interval with the shoe down, timed by when the words take effect."""
    delay = setup.head.delays_ms.shoe * 1e-3
    down = np.flatnonzero(trajectory.events == Event.SHOE_DOWN)
    up = np.flatnonzero(trajectory.events == Event.SHOE_UP)
    layings = []
    for start in down:
        later = up[up > start]
        if not len(later):
            break
        begin, end = trajectory.times[start] + delay, trajectory.times[later[0]] + delay
        first, last = np.searchsorted(trajectory.times, begin, side="right"), np.searchsorted(trajectory.times, end)
        if end > begin:
            layings.append(Laying(float(begin), float(end), int(first), int(last) + 1))
    return layings
