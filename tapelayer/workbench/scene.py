"""Scene: the data from which the page draws what a job made, as files of float32 in millimetres and degrees."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import fast_simplification
import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.kind import Scene, SceneTable
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM

# Between two rows an axis goes straight and at an even speed, which deviates from its motion by at most this; m or rad.
TOLERANCE = 0.05e-3
# Rows within a block are at least so many seconds apart, and from its ends.
LEAST_SPAN = 1e-4
MOST_TRIANGLES = 4000

# Kind of the row before the first block, numbered after those of `Kind`.
START = len(Kind)


def files(scene: Scene) -> dict[str, bytes]:
    """Return the scene's files by name, two for every table."""
    return _files({**scene.tables, **{name: part_table(mesh) for name, mesh in scene.surfaces.items()}})


def motion_files(numbers: list[int], trajectory: Trajectory, machine: Machine) -> dict[str, bytes]:
    """Return the files of a program's motion by name: `blocks.json`, and two files for every table.

    Args:
        numbers: of the courses or passes, by their index.
        trajectory: the judged trajectory.
        machine: the machine that it moves.
    """
    rows = TrajectoryRows.of(trajectory, machine)
    blocks = json.dumps(rows.blocks(np.array(numbers)), separators=(",", ":")).encode()
    return {"blocks.json": blocks, **_files({"poses": rows.poses(), "speeds": rows.speeds()})}


def _files(tables: Mapping[str, SceneTable]) -> dict[str, bytes]:
    contents: dict[str, bytes] = {}
    for name, table in tables.items():
        about = {"columns": table.columns, "rows": len(table.rows), **table.extra}
        # Little-endian float32, row by row.
        contents |= {f"{name}.f32": table.rows.astype("<f4").tobytes(), f"{name}.json": json.dumps(about).encode()}
    return contents


@dataclass(frozen=True, eq=False)
class TrajectoryRows:
    """A trajectory as rows: the start, then the end of every block, split where it turns or where its speed changes.

    Attributes:
        trajectory: the blocks.
        names: k columns with their units.
        scales: (k,) factors from metres and radians to these units.
        block: (n - 1,) block of each row but the first.
        spans: (n - 1,) seconds from the row before.
        times: (n,) seconds.
        positions: (n, k) metres and radians.
    """

    trajectory: Trajectory
    names: tuple[str, ...]
    scales: Floats
    block: Ints
    spans: Floats
    times: Floats
    positions: Floats

    @classmethod
    def of(cls, trajectory: Trajectory, machine: Machine) -> TrajectoryRows:
        """Build the rows of a trajectory."""
        block, shares = _places(trajectory)
        positions = np.vstack([trajectory.start, trajectory.positions[block]])
        between = np.flatnonzero(shares < 1.0)
        if len(between):
            positions[between + 1] = trajectory.within(block[between], shares[between])
        times = trajectory.moments(block, shares)
        spans = np.diff(times, prepend=0.0)
        turning = [machine.axis(name).revolute for name in trajectory.axes]
        return cls(
            trajectory=trajectory,
            names=tuple(
                f"{name}_{'deg' if turns else 'mm'}" for name, turns in zip(trajectory.axes, turning, strict=True)
            ),
            scales=np.where(turning, 1.0 / DEG, 1.0 / MM),
            block=block,
            spans=spans,
            times=np.append(0.0, times),
            positions=positions,
        )

    def poses(self) -> SceneTable:
        """Return the axis values at each row; NaN before an axis is first stated."""
        return SceneTable(("time_s", *self.names), np.column_stack([self.times, self.positions * self.scales]))

    def speeds(self) -> SceneTable:
        """Return the signed speed of each axis in the motion that ends at each row; NaN where it is unknown."""
        steps = np.diff(self.positions, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.where(steps == 0.0, 0.0, steps / np.where(self.spans > 0.0, self.spans, np.nan)[:, None])
        before = np.where(np.isnan(self.positions[:1]), np.nan, 0.0)
        return SceneTable(tuple(f"{name}_per_s" for name in self.names), np.vstack([before, speeds]) * self.scales)

    def blocks(self, numbers: Ints) -> dict[str, Any]:
        """Return the block, line, course, kind and event of each row; blocks count from 1, and 0 is the start.

        Args:
            numbers: number of each course or pass, by its index.
        """
        trajectory, index = self.trajectory, self.trajectory.courses[self.block]
        known = (index >= 0) & (index < len(numbers))
        courses = np.where(known, numbers[np.where(known, index, 0)], 0)
        return {
            "rows": len(self.times),
            "blocks": [0, *(self.block + 1).tolist()],
            "lines": [0, *trajectory.lines[self.block].tolist()],
            "courses": [0, *courses.tolist()],
            "kinds": [START, *trajectory.kinds[self.block].tolist()],
            "kind_names": [*(kind.name.lower() for kind in Kind), "start"],
            "events": [int(Event.NONE), *trajectory.events[self.block].tolist()],
            "event_names": [event.name.lower() for event in Event],
        }


def _places(trajectory: Trajectory) -> tuple[Ints, Floats]:
    """Return the block (m,) of every row but the first, and how far along it the row is, from 0 to 1, in order."""
    counts = _parts(trajectory)
    block = np.repeat(np.arange(len(counts)), counts)
    shares = (np.arange(len(block)) - (np.cumsum(counts) - counts)[block] + 1) / counts[block]
    changing, fractions = _changes(trajectory)
    block, shares = np.append(block, changing), np.append(shares, fractions)
    order = np.lexsort((shares, block))
    return block[order], shares[order]


def _changes(trajectory: Trajectory) -> tuple[Ints, Floats]:
    """Return blocks (m,), and how far along them rows have to be because the control speeds up or brakes there."""
    clock = trajectory.clock
    if clock is None or not len(clock.moments):
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    moved = np.max(np.abs(np.nan_to_num(trajectory.positions - trajectory.begins(np.arange(len(trajectory))))), axis=1)
    lengths = np.diff(clock.reached)
    spans = np.maximum(np.diff(clock.moments), 0.0)
    block = np.minimum(np.searchsorted(trajectory.times, clock.moments[:-1] + spans / 2.0), len(trajectory) - 1)
    ratios = np.divide(moved, lengths, out=np.zeros(len(moved)), where=lengths > 0.0)[block]
    # Over seconds h of an even acceleration a, the way deviates from that at an even speed by at most a h^2 / 8.
    bend = np.abs(np.diff(clock.speeds)) * spans * ratios
    if clock.bulges is not None:
        # At a constant jerk, that of a bulge is added, at most a quarter of what it covers.
        bend += 8.0 * np.abs(clock.bulges[:-1]) * spans * ratios
    counts = np.maximum(np.ceil(np.sqrt(bend / (8.0 * TOLERANCE))), 1.0).astype(np.int64)
    index = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(index)) - (np.cumsum(counts) - counts)[index]
    times = clock.moments[index] + spans[index] * step / counts[index]
    block = np.minimum(np.searchsorted(trajectory.times, times), len(trajectory) - 1)
    fractions = trajectory.fractions(block, times)
    ends, durations = trajectory.times[block], trajectory.durations[block]
    even = 1.0 - (ends - times) / np.maximum(durations, LEAST_SPAN)
    worst = np.zeros(len(trajectory))
    np.maximum.at(worst, block, np.abs(fractions - even) * moved[block])
    before = np.maximum(np.append(0.0, times[:-1]), ends - durations)
    apart = (times - before > LEAST_SPAN) & (ends - times > LEAST_SPAN)
    kept = apart & (worst[block] > TOLERANCE) & (fractions > 0.0) & (fractions < 1.0)
    return block[kept], fractions[kept]


def _parts(trajectory: Trajectory) -> Ints:
    """Return the number (n,) of parts into which each block is divided as it turns."""
    counts = np.ones(len(trajectory), dtype=np.int64)
    circular = np.flatnonzero(np.isin(trajectory.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    if len(circular):
        arcs = trajectory.arcs(circular)
        # A chord over a share h of the block deviates by at most h^2 / 8 times the largest second derivative.
        bend = np.max(arcs.radii, axis=0) * arcs.sweeps**2 + 2.0 * np.abs(np.diff(arcs.radii, axis=0)[0] * arcs.sweeps)
        # Before an axis is first stated, the circle is undefined (NaN).
        counts[circular] = np.maximum(np.ceil(np.sqrt(np.nan_to_num(bend) / (8.0 * TOLERANCE))), 1.0)
    return counts


def simplified(mesh: Mesh) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) in metres and facets (m, 3) of a mesh, of a large one about `MOST_TRIANGLES` to draw."""
    if len(mesh.facets) <= MOST_TRIANGLES:
        return mesh.vertices, mesh.facets
    vertices, facets = fast_simplification.simplify(
        np.array(mesh.vertices), mesh.facets.astype(np.int32), target_count=MOST_TRIANGLES
    )
    return vertices, facets.astype(np.int64)


def part_table(mesh: Mesh) -> SceneTable:
    """Return the corners of a mesh's facets in mm, three rows a facet; large meshes are simplified."""
    vertices, facets = simplified(mesh)
    return SceneTable(("x_mm", "y_mm", "z_mm"), vertices[facets].reshape(-1, 3) / MM)
