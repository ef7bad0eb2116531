"""Scene: what the page draws of a judged program, as tables of single-precision numbers in millimetres and degrees."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import fast_simplification
import numpy as np
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.courses.course import Course
from tapelayer.geometry.curves import Curve
from tapelayer.geometry.mesh import Mesh
from tapelayer.laying.evidence import Samples
from tapelayer.laying.job import Job, Made
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.spraying.coat import Coat, growth
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.job import SprayJob, SprayMade
from tapelayer.spraying.reach import mesh_in_machine
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM

# Circular blocks are divided until a straight line is as near to them, metres.
ARC_TOLERANCE = 0.05e-3
# Pairs of the tape's edge points are left out where a straight line is as near to the edges, metres.
EDGE_TOLERANCE = 0.1e-3
# The edges are looked at so often, and pairs lie no farther apart, so that the tape is seen to grow; metres.
EDGE_STEP = 5e-3
PAIR_STEP = 25e-3
# A cut that runs less than this along the tape's width is square, metres.
SQUARE = 1e-5
MOST_TRIANGLES = 4000
MOST_COAT_SAMPLES = 20_000
COAT_MOMENTS = 64

# Kind of the row before the first block, behind those of `Kind`.
START = len(Kind)


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of numbers with their columns' names.

    Attributes:
        columns: k names, with their units.
        rows: (n, k), in these units.
        extra: what else a reader has to know.
    """

    columns: tuple[str, ...]
    rows: Floats
    extra: dict[str, Any] = field(default_factory=dict)

    def files(self, name: str) -> dict[str, bytes]:
        """The table's two files by name: the numbers, little-endian and row by row, and what their columns are."""
        told = {"columns": self.columns, "rows": len(self.rows), **self.extra}
        return {f"{name}.f32": self.rows.astype("<f4").tobytes(), f"{name}.json": json.dumps(told).encode()}


def files(made: Made | SprayMade, job: Job | SprayJob, mould: Mesh | None) -> dict[str, bytes]:
    """The scene's files by name: `blocks.json`, and every table that this kind of job has.

    Args:
        made: what became of the job.
        job: what it was made from.
        mould: the mould of a ply in the part's frame, where there is one.
    """
    if isinstance(made, SprayMade) and isinstance(job, SprayJob):
        numbers = np.array([found.path.number for found in job.plan.passes])
        tables = _spray_tables(made, job, numbers)
    elif isinstance(made, Made) and isinstance(job, Job):
        numbers = np.array([course.number for course in job.courses])
        tables = _lay_tables(made, job, numbers, mould)
    else:
        raise TypeError(f"{type(made).__name__} is not made from a {type(job).__name__}")
    path = _Path.of(made.trajectory, job.machine)
    tables |= {"poses": path.poses(), "speeds": path.speeds()}
    found = {"blocks.json": json.dumps(path.blocks(numbers), separators=(",", ":")).encode()}
    for name, table in tables.items():
        found |= table.files(name)
    return found


def _lay_tables(made: Made, job: Job, numbers: Ints, mould: Mesh | None) -> dict[str, Table]:
    samples = made.evidence.samples
    tables = {"errors": lay_errors(samples, numbers), "tape": tape(samples, job.courses, job.setup)}
    if mould is not None:
        part = job.setup.part
        rotation = Rotation.from_euler("xyz", part.rotation_rad()).as_matrix()
        tables["part"] = part_table(
            mesh_in_machine(mould, rotation, np.array([part.l1_mm, part.l2_mm, -part.l3_mm]) * MM)
        )
    return tables


def _spray_tables(made: SprayMade, job: SprayJob, numbers: Ints) -> dict[str, Table]:
    samples, coat = made.evidence.samples, made.judged.coat
    tables = {"errors": spray_errors(samples, numbers), "part": part_table(job.mesh)}
    if coat is not None:
        tables["coat"] = coat_table(coat, samples, job.setup)
    return tables


@dataclass(frozen=True, eq=False)
class _Path:
    """A trajectory row by row: the start, then every block's end, circular blocks in parts.

    Attributes:
        trajectory: the blocks.
        names: k columns with their units.
        scales: (k,) of these units, from metres and radians.
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
    def of(cls, trajectory: Trajectory, machine: Machine) -> _Path:
        """The rows of a trajectory."""
        counts = _parts(trajectory)
        block = np.repeat(np.arange(len(counts)), counts)
        step = np.arange(len(block)) - (np.cumsum(counts) - counts)[block] + 1
        shares = step / counts[block]
        spans = trajectory.durations[block] / counts[block]
        positions = np.vstack([trajectory.start, trajectory.positions[block]])
        between = np.flatnonzero(step < counts[block])
        if len(between):
            positions[between + 1] = trajectory.within(block[between], shares[between])
        times = trajectory.times[block] - trajectory.durations[block] * (1.0 - shares)
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

    def poses(self) -> Table:
        """Axis values at each row; NaN while an axis is not stated yet."""
        return Table(("time_s", *self.names), np.column_stack([self.times, self.positions * self.scales]))

    def speeds(self) -> Table:
        """Speed of each axis, with its sign, on the way to each row; NaN where that is not known."""
        ways = np.diff(self.positions, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.where(ways == 0.0, 0.0, ways / np.where(self.spans > 0.0, self.spans, np.nan)[:, None])
        before = np.where(np.isnan(self.positions[:1]), np.nan, 0.0)
        return Table(tuple(f"{name}_per_s" for name in self.names), np.vstack([before, speeds]) * self.scales)

    def blocks(self, numbers: Ints) -> dict[str, Any]:
        """What each row belongs to.

        Args:
            numbers: number of each course or pass, by its index.
        """
        found, index = self.trajectory, self.trajectory.courses[self.block]
        known = (index >= 0) & (index < len(numbers))
        courses = np.where(known, numbers[np.where(known, index, 0)], 0)
        return {
            "rows": len(self.times),
            "lines": [0, *found.lines[self.block].tolist()],
            "courses": [0, *courses.tolist()],
            "kinds": [START, *found.kinds[self.block].tolist()],
            "kind_names": [*(kind.name.lower() for kind in Kind), "start"],
            "events": [int(Event.NONE), *found.events[self.block].tolist()],
            "event_names": [event.name.lower() for event in Event],
        }


def _parts(trajectory: Trajectory) -> Ints:
    """Parts (n,) into which each block is divided."""
    counts = np.ones(len(trajectory), dtype=np.int64)
    circular = np.flatnonzero(np.isin(trajectory.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    if len(circular):
        arcs = trajectory.arcs(circular)
        # A chord of a share h of the block is no farther off than h^2 / 8 of the largest second derivative.
        bend = np.max(arcs.radii, axis=0) * arcs.sweeps**2 + 2.0 * np.abs(np.diff(arcs.radii, axis=0)[0] * arcs.sweeps)
        # Where an axis is not stated yet there is no circle.
        counts[circular] = np.maximum(np.ceil(np.sqrt(np.nan_to_num(bend) / (8.0 * ARC_TOLERANCE))), 1.0)
    return counts


def lay_errors(samples: Samples, numbers: Ints) -> Table:
    """What was measured along the courses.

    Args:
        samples: along the courses.
        numbers: number of each course, by its index.
    """
    columns = {
        "time_s": samples.times,
        "course": numbers[samples.courses.astype(np.int64)],
        "arc_length_mm": samples.arc_lengths / MM,
        "normal_error_mm": samples.normal_errors / MM,
        "lateral_error_mm": samples.lateral_errors / MM,
        "position_error_mm": samples.position_errors / MM,
        "tape_error_mm": samples.tape_errors / MM,
        "roller_tilt_deg": samples.tilts / DEG,
        "heading_error_deg": samples.heading_errors / DEG,
    }
    return Table(tuple(columns), np.column_stack(list(columns.values())))


def spray_errors(samples: SpraySamples, numbers: Ints) -> Table:
    """What was measured with the arc on; `beside_crease` is 1 where no deviation counts.

    Args:
        samples: with the arc on.
        numbers: number of each pass, by its index.
    """
    columns = {
        "time_s": samples.times,
        "pass": numbers[samples.passes.astype(np.int64)],
        "arc_length_mm": samples.arc_lengths / MM,
        "position_error_mm": samples.position_errors / MM,
        "surface_distance_mm": samples.surface_distances / MM,
        "deviation_deg": samples.deviations / DEG,
        "beside_crease": samples.exempt,
    }
    return Table(tuple(columns), np.column_stack(list(columns.values())))


def tape(samples: Samples, courses: Sequence[Course], setup: Setup) -> Table:
    """Edge points of the tape as it was laid, in pairs: what lies between two pairs lies across the course.

    At a slanted cut the pairs end on its line, so that the first and the last pair of a course are one corner each.

    Args:
        samples: along the courses.
        courses: in the part's frame.
        setup: the job's values.
    """
    parts = [np.zeros((0, 8))]
    for index, path in enumerate(courses_in_machine(courses, setup)):
        rows = slice(*np.searchsorted(samples.courses, [index, index + 1]).tolist())
        measured = np.isfinite(samples.arc_lengths[rows])
        arcs, times = np.maximum.accumulate(samples.arc_lengths[rows][measured]), samples.times[rows][measured]
        if len(arcs) and arcs[-1] > 0.0:
            curve = Curve(path)
            ribbon = _Ribbon(curve, min(curve.length, float(arcs[-1])), setup.tape.width_mm * MM, courses[index])
            places, edges = ribbon.pairs()
            laid = np.interp(places, arcs, times)
            parts.append(np.column_stack([laid, np.full(len(laid), path.number), edges / MM]))
    edge = tuple(f"{side}_{axis}_mm" for side in ("left", "right") for axis in "xyz")
    return Table(("time_s", "course", *edge), np.vstack(parts))


class _Ribbon:
    """The tape of one course on its surface.

    Args:
        curve: of the course, in `machine` axes.
        end: arc length to which it is laid, metres.
        width: of the tape, metres.
        course: with the angles of its cuts.
    """

    def __init__(self, curve: Curve, end: float, width: float, course: Course) -> None:
        self.curve, self.end, self.half = curve, end, width / 2
        slopes = (1.0 / math.tan(angle) for angle in course.cut_angles)
        # Along the course over across it, to the left: sigma(w) = sigma_0 + w cot(alpha).
        self.slopes = [slope if abs(slope) * width > SQUARE else 0.0 for slope in slopes]

    def pairs(self) -> tuple[Floats, Floats]:
        """Arc lengths (n,) in metres, and left and right edge points (n, 6) there, metres."""
        first, last = (self.half * abs(slope) for slope in self.slopes)
        low, high = -first, self.end + last
        corners = np.array([low, first, self.end - last, high])
        steps = np.linspace(low, high, math.ceil((high - low) / EDGE_STEP) + 1)
        places = np.union1d(steps, corners[(corners >= low) & (corners <= high)])
        edges = self._edges(places)
        kept = np.isin(places, corners)
        kept[:: math.floor(PAIR_STEP / EDGE_STEP)] = True
        kept = _needed(places, edges, kept)
        return places[kept], edges[kept]

    def _edges(self, places: Floats) -> Floats:
        """Left and right edge points (n, 6) in metres at (n,) arc lengths; beyond its ends the course goes straight."""
        right, left = np.full(len(places), -self.half), np.full(len(places), self.half)
        # There is tape at w across and s along where w slope <= s by its first cut, and s <= end + w slope by its last.
        for away, slope, side in ((places, self.slopes[0], 1.0), (self.end - places, self.slopes[1], -1.0)):
            if side * slope > 0.0:
                left = np.minimum(left, away / (side * slope))
            elif slope:
                right = np.maximum(right, away / (side * slope))
        left = np.maximum(left, right)
        inside = np.clip(places, 0.0, self.curve.length)
        points, normals, tangents = self.curve.at(inside)
        points = points + (places - inside)[:, None] * tangents
        across = np.cross(normals, tangents)
        across /= np.linalg.norm(across, axis=1)[:, None]
        return np.hstack([points + left[:, None] * across, points + right[:, None] * across])


def _needed(places: Floats, edges: Floats, kept: Mask) -> Mask:
    """Rows (n,) that are needed beside those kept, so that straight lines between them stay near to all others.

    Args:
        places: (n,) metres, rising.
        edges: (n, 6) two points a row, metres.
        kept: (n,) rows that are needed anyhow, the first and the last among them.
    """
    kept = kept.copy()
    while True:
        rows = np.flatnonzero(kept)
        chords = np.column_stack([np.interp(places, places[rows], column[rows]) for column in edges.T])
        off = np.max(np.linalg.norm((edges - chords).reshape(-1, 2, 3), axis=2), axis=1)
        far = np.flatnonzero(np.maximum.reduceat(off, rows)[:-1] > EDGE_TOLERANCE)
        if not len(far):
            return kept
        kept[(rows[far] + rows[far + 1]) // 2] = True


def part_table(mesh: Mesh) -> Table:
    """Corners of the facets of a mesh in `machine`, three rows a facet; made coarser where there are too many."""
    vertices, facets = mesh.vertices, mesh.facets
    if len(facets) > MOST_TRIANGLES:
        vertices, facets = fast_simplification.simplify(
            np.array(vertices), facets.astype(np.int32), target_count=MOST_TRIANGLES
        )
    return Table(("x_mm", "y_mm", "z_mm"), vertices[facets].reshape(-1, 3) / MM)


def coat_table(coat: Coat, samples: SpraySamples, setup: SpraySetup) -> Table:
    """Samples of the surface with their thickness while the coat grows; `times` of these moments, and the `unit`.

    Args:
        coat: what the program leaves.
        samples: places and times with the arc on.
        setup: the job's values.
    """
    chosen = _spread(coat.surface.points, float(np.sum(coat.surface.areas)))
    times, thickness = growth(coat, samples, setup, chosen, COAT_MOMENTS)
    scale, unit = (1.0, "relative") if coat.relative else (1e6, "um")
    moments = tuple(f"t{number}" for number in range(COAT_MOMENTS))
    rows = np.hstack([coat.surface.points[chosen] / MM, thickness * scale])
    return Table(("x_mm", "y_mm", "z_mm", *moments), rows, {"times": times.tolist(), "unit": unit})


def _spread(points: Floats, area: float) -> Mask:
    """Points (m,), of at most so many, that are chosen evenly from those of a surface of that area (m^2)."""
    chosen = np.ones(len(points), dtype=np.bool_)
    cell = math.sqrt(area / MOST_COAT_SAMPLES)
    while np.count_nonzero(chosen) > MOST_COAT_SAMPLES:
        _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
        chosen = np.zeros(len(points), dtype=np.bool_)
        chosen[first] = True
        cell *= 1.1
    return chosen
