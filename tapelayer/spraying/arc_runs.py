"""Stretches: where a program has the arc on, as samples, and how near these are to a way and to facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.motion.trajectory import MOTIONS, Event, Trajectory

# Between two block ends the path is looked at this often, and at least every so many metres.
LEAST_SAMPLES = 4
SAMPLE_STEP = 2.5e-3


@dataclass(frozen=True, eq=False)
class Stretch:
    """Blocks of one pass from where the arc goes on, or the pass begins, to where it goes off, or the pass ends.

    Attributes:
        index: of the pass.
        blocks: (b,) motions with the arc on.
        linked: whether the arc was on already.
    """

    index: int
    blocks: Ints
    linked: bool


def arc_on(trajectory: Trajectory) -> Mask:
    """Motions (n,) with the arc on."""
    last = np.maximum.accumulate(
        np.where(np.isin(trajectory.events, (Event.ARC_ON, Event.ARC_OFF)), np.arange(len(trajectory)), -1)
    )
    on: Mask = (last >= 0) & (trajectory.events[np.maximum(last, 0)] == Event.ARC_ON)
    return on & np.isin(trajectory.kinds, MOTIONS)


def stretches_of(trajectory: Trajectory) -> list[Stretch]:
    """Every stretch with the arc on, pass by pass."""
    rows = np.flatnonzero(arc_on(trajectory) & (trajectory.courses >= 0))
    if not len(rows):
        return []
    switches = np.cumsum(trajectory.events == Event.ARC_ON)[rows]
    passes = trajectory.courses[rows]
    new = np.append(True, (np.diff(switches) != 0) | (np.diff(passes) != 0))
    firsts = np.flatnonzero(new)
    return [
        Stretch(int(passes[first]), blocks, bool(first and switches[first] == switches[first - 1]))
        for first, blocks in zip(firsts.tolist(), np.split(rows, firsts[1:]), strict=True)
    ]


def sampled(trajectory: Trajectory, blocks: Ints) -> tuple[Floats, Floats, Ints]:
    """Joint values (n, k), times (n,) in seconds and blocks (n,) at the ends of blocks (b,) and between."""
    counts = np.maximum(LEAST_SAMPLES, np.ceil(ways_of(trajectory, blocks) / SAMPLE_STEP).astype(np.int64))
    rows = np.repeat(blocks, counts)
    step = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
    fractions = step / np.repeat(counts, counts)
    rows, fractions = np.append(blocks[0], rows), np.append(0.0, fractions)
    times = trajectory.times[rows] - (1.0 - fractions) * trajectory.durations[rows]
    return trajectory.within(rows, fractions), times, rows


def ways_of(trajectory: Trajectory, blocks: Ints) -> Floats:
    """Way (b,) of P in the blocks, in metres; that of a circular block is its chord."""
    steps = trajectory.positions[blocks, :3] - trajectory.begins(blocks)[:, :3]
    lengths: Floats = np.linalg.norm(steps, axis=1)
    return lengths


def along(path: Floats, places: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Arc length (n,) of the polyline's point nearest to each point (n, 3), and the distance (n,), all in metres.

    The first is looked for on the whole polyline, the others near the way travelled since.
    """
    near, _ = _nearest(path, places, points[:1], np.arange(len(path) - 1)[None])
    travelled = near[0] + np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    segment = np.clip(np.searchsorted(places, travelled) - 1, 0, len(path) - 2)
    around = np.clip(segment[:, None] + np.arange(-2, 3), 0, len(path) - 2)
    return _nearest(path, places, points, around)


def _nearest(path: Floats, places: Floats, points: Floats, segments: Ints) -> tuple[Floats, Floats]:
    """As `along`, on segments (n, k) of the polyline."""
    begins, ways = path[segments], path[segments + 1] - path[segments]
    away = points[:, None] - begins
    squares = np.einsum("nij,nij->ni", ways, ways)
    share = np.clip(np.einsum("nij,nij->ni", away, ways) / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
    distances = np.linalg.norm(away - share[..., None] * ways, axis=2)
    best = np.argmin(distances, axis=1)
    row = np.arange(len(points))
    chosen = segments[row, best]
    arcs = places[chosen] + share[row, best] * (places[chosen + 1] - places[chosen])
    return arcs, distances[row, best]


def distances_to(triangles: Floats, points: Floats) -> Floats:
    """Distance (n,) of each point (n, 3) from its triangle (n, 3, 3), in their unit."""
    begins, ways = triangles, np.roll(triangles, -1, axis=1) - triangles
    away = points[:, None] - begins
    normals = np.cross(ways[:, 0], ways[:, 1])
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    over = np.all(np.einsum("nij,nij->ni", np.cross(ways, away), normals[:, None]) >= 0.0, axis=1)
    share = np.einsum("nij,nij->ni", away, ways) / np.einsum("nij,nij->ni", ways, ways)
    to_edges = np.linalg.norm(away - np.clip(share, 0.0, 1.0)[..., None] * ways, axis=2).min(axis=1)
    distances: Floats = np.where(over, np.abs(np.einsum("ij,ij->i", away[:, 0], normals)), to_edges)
    return distances
