"""Scene: the measured errors, the laid tape and the mould of a tape-laying program, for a page to draw."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.courses.course import Course
from tapelayer.geometry.curves import Curve
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.kind import Scene, SceneTable, point_table
from tapelayer.laying.evidence import Samples
from tapelayer.laying.job import LayingResult
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.units import DEG, MM

# Pairs of edge points are dropped where straight lines stay this close to the tape's edges, metres.
EDGE_TOLERANCE = 0.1e-3
# Spacing of the samples of the edges, and largest distance between pairs, which lets the tape grow visibly; metres.
EDGE_STEP = 5e-3
PAIR_STEP = 25e-3
# A cut that runs less than this along the tape, over its width, is square; metres.
SQUARE = 1e-5


def scene(result: LayingResult, mould: Mesh | None) -> Scene:
    """Return the scene of a result.

    Args:
        result: of a job.
        mould: in the part's frame, if there is one.
    """
    job, samples = result.job, result.evidence.samples
    numbers = np.array([course.number for course in job.courses])
    tables = {
        "errors": error_table(samples, numbers),
        "tape": tape_table(samples, job.courses, job.setup),
        "points": point_table("course", job.courses),
    }
    surfaces = {}
    if mould is not None:
        part = job.setup.part
        rotation = Rotation.from_euler("xyz", part.rotation_rad()).as_matrix()
        surfaces["part"] = mould.moved(rotation, np.array([part.l1_mm, part.l2_mm, -part.l3_mm]) * MM)
    return Scene(numbers.tolist(), tables, surfaces)


def error_table(samples: Samples, numbers: Ints) -> SceneTable:
    """Return the measurements along the courses.

    Args:
        samples: along the courses.
        numbers: number of each course, by index.
    """
    columns = {
        "time_s": samples.times,
        "course": numbers[samples.courses.astype(np.int64)],
        "arc_length_mm": samples.arc_lengths / MM,
        "speed_mm_per_s": samples.speeds / MM,
        "normal_error_mm": samples.normal_errors / MM,
        "lateral_error_mm": samples.lateral_errors / MM,
        "position_error_mm": samples.position_errors / MM,
        "tape_error_mm": samples.tape_errors / MM,
        "roller_tilt_deg": samples.tilts / DEG,
        "heading_error_deg": samples.heading_errors / DEG,
    }
    return SceneTable(tuple(columns), np.column_stack(list(columns.values())))


def tape_table(samples: Samples, courses: Sequence[Course], setup: Setup) -> SceneTable:
    """Return the edge points of the laid tape in pairs, left and right, each across the course at an arc length.

    `left_mm` is how far left of the course its left point lies, so that a point between a pair has a place across.
    At a slanted cut the points lie on its line, so that the first and the last pair of a course are one corner each.

    Args:
        samples: along the courses.
        courses: in the part's frame.
        setup: the job's values.
    """
    parts = [np.zeros((0, 10))]
    for index, path in enumerate(courses_in_machine(courses, setup)):
        rows = slice(*np.searchsorted(samples.courses, [index, index + 1]).tolist())
        measured = np.isfinite(samples.arc_lengths[rows])
        arcs, times = np.maximum.accumulate(samples.arc_lengths[rows][measured]), samples.times[rows][measured]
        if len(arcs) and arcs[-1] > 0.0:
            curve = Curve(path)
            ribbon = _Ribbon(curve, min(curve.length, float(arcs[-1])), setup.tape.width_mm * MM, courses[index])
            places, left, edges = ribbon.pairs()
            laid = np.interp(places, arcs, times)
            own = np.full(len(laid), path.number)
            parts.append(np.column_stack([laid, own, edges / MM, places / MM, left / MM]))
    edge = tuple(f"{side}_{axis}_mm" for side in ("left", "right") for axis in "xyz")
    return SceneTable(("time_s", "course", *edge, "arc_length_mm", "left_mm"), np.vstack(parts))


class _Ribbon:
    """The tape of one course on its surface.

    Args:
        curve: the course's curve in `machine` axes.
        end: arc length up to which it is laid, metres.
        width: width of the tape, metres.
        course: the course, for the angles of its cuts.
    """

    def __init__(self, curve: Curve, end: float, width: float, course: Course) -> None:
        self.curve, self.end, self.half = curve, end, width / 2
        slopes = (1.0 / math.tan(angle) for angle in course.cut_angles)
        # Slopes of the cuts, along the course over across to the left: sigma(w) = sigma_0 + w cot(alpha).
        self.slopes = [slope if abs(slope) * width > SQUARE else 0.0 for slope in slopes]

    def pairs(self) -> tuple[Floats, Floats, Floats]:
        """Return arc lengths (n,), the left edge off the course (n,) and both edge points (n, 6) there, all metres."""
        first, last = (self.half * abs(slope) for slope in self.slopes)
        low, high = -first, self.end + last
        corners = np.array([low, first, self.end - last, high])
        steps = np.linspace(low, high, math.ceil((high - low) / EDGE_STEP) + 1)
        places = np.union1d(steps, corners[(corners >= low) & (corners <= high)])
        left, edges = self._edges(places)
        kept = np.isin(places, corners)
        kept[:: math.floor(PAIR_STEP / EDGE_STEP)] = True
        kept = needed(places, edges, kept)
        return places[kept], left[kept], edges[kept]

    def _edges(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the left edge off the course (n,), and left and right edge points (n, 6), straight on beyond the ends.

        Args:
            places: (n,) arc lengths, metres.
        """
        right, left = np.full(len(places), -self.half), np.full(len(places), self.half)
        # There is tape at s along and w across if s >= w slope for the first cut and s <= end + w slope for the last.
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
        return left, np.hstack([points + left[:, None] * across, points + right[:, None] * across])


def needed(places: Floats, edges: Floats, kept: Mask) -> Mask:
    """Return a mask (n,) of the rows needed so that straight lines between them stay close to all other rows.

    Args:
        places: (n,) metres, rising.
        edges: (n, 6) two points a row, metres.
        kept: (n,) rows that are needed anyway, including the first and the last.
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
