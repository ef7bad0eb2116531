"""Evidence: every number that was measured on the courses planned for a ply."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import shapely

from tapelayer.arrays import Floats, Ints, Mask, SampleTable
from tapelayer.geometry.geodesics import tangents
from tapelayer.plies.judgement import Judgement
from tapelayer.plies.ledger import Ledger, ledger_of
from tapelayer.plies.pieces import Piece
from tapelayer.plies.plan import CoursePlan
from tapelayer.plies.strip import LATERAL_STEPS, LEFT, RIGHT, Strip
from tapelayer.units import MM
from tapelayer.vectors import dot
from tapelayer.verification.failures import Outcome

# Lines across the tape at which it is looked at: right edge, half way, centre, half way, left edge.
LINES = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
CENTRE = 2


@dataclass(frozen=True, eq=False)
class CourseSamples(SampleTable):
    """Measurements along the courses; rows are samples along the strips, course by course in the order of laying.

    Attributes:
        courses: (n,) index of the course.
        arcs: (n,) metres along the strip.
        plan: (n, 5, 2) points in plan from the right edge to the left, metres.
        laid: (n, 5) whether they lie between the course's cuts and in what is to be covered.
        strains: (n, 5) length of the tape along these points over that of its centre line, less 1.
        lifts: (n,) sag of the surface under a straight roller, metres.
        deviations: (n,) angle from the ply's direction, to its left, radians.
    """

    EMPTY: ClassVar = {
        "courses": np.zeros(0, np.int64),
        "plan": np.zeros((0, 5, 2)),
        "laid": np.zeros((0, 5), np.bool_),
        "strains": np.zeros((0, 5)),
    }

    courses: Ints
    arcs: Floats
    plan: Floats
    laid: Mask
    strains: Floats
    lifts: Floats
    deviations: Floats

    @property
    def laid_strains(self) -> Floats:
        """Strains (n, 5) where the tape is laid, NaN elsewhere."""
        strains: Floats = np.where(self.laid, self.strains, np.nan)
        return strains

    @property
    def largest_strains(self) -> Ints:
        """Which (n,) of the points across has the strain of largest magnitude."""
        lines: Ints = np.argmax(np.where(self.laid, np.abs(self.strains), -1.0), axis=1)
        return lines

    @property
    def laid_lifts(self) -> Floats:
        """Lifts (n,) where the tape is laid, NaN elsewhere."""
        lifts: Floats = np.where(np.any(self.laid, axis=1), self.lifts, np.nan)
        return lifts

    @property
    def laid_deviations(self) -> Floats:
        """Angles (n,) where the tape is laid, NaN elsewhere."""
        deviations: Floats = np.where(np.any(self.laid, axis=1), self.deviations, np.nan)
        return deviations


@dataclass(frozen=True, eq=False)
class GapSamples(SampleTable):
    """Gaps between neighbouring courses; rows are samples along the edges, from pair to pair.

    Attributes:
        rights: (n,) index of the course to the right.
        lefts: (n,) index of the course to the left.
        plan: (n, 2) points in plan in the middle of the gap, metres.
        widths: (n,) from edge to edge, negative for overlap, metres.
    """

    EMPTY: ClassVar = {
        "rights": np.zeros(0, np.int64),
        "lefts": np.zeros(0, np.int64),
        "plan": np.zeros((0, 2)),
    }

    rights: Ints
    lefts: Ints
    plan: Floats
    widths: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class PlyEvidence(Outcome):
    """Every number measured on the courses of a ply, in metres and radians.

    Attributes:
        plan: the courses, and what they were planned on.
        ledger: areas on the surface.
        samples: along the courses.
        gaps: between them.
        judgement: of the courses as their file has them, on the mould's own facets.
    """

    plan: CoursePlan
    ledger: Ledger
    samples: CourseSamples
    gaps: GapSamples
    judgement: Judgement

    def at(self, plan: Floats) -> tuple[float, float, float]:
        """Return the place over a point (2,) in plan, metres in the mould's frame."""
        x, y, z = self.plan.region.plane.out_of(self.plan.mould.field.points(plan[None]))[0].tolist()
        return x, y, z

    @cached_property
    def laid_length(self) -> float:
        """Length of all courses, metres."""
        return float(sum(piece.length for piece in self.plan.pieces))

    @property
    def lengthened(self) -> list[int]:
        """Numbers of the courses that were made longer than the ply needs."""
        return [number for number, piece in enumerate(self.plan.pieces, 1) if piece.lengthened > 0.0]

    @property
    def laid_through(self) -> list[int]:
        """Numbers of the courses that cross interruptions of the ply."""
        return [number for number, piece in enumerate(self.plan.pieces, 1) if piece.laid_through]

    @property
    def better_stagger(self) -> float | None:
        """Stagger with which no course is a sliver, metres; None where none is one."""
        (right, left), width = self.plan.family.breadths.tolist(), self.plan.ply.width
        if len(self.plan.family.strips) < 2 or min(right, left) >= width / 4.0:
            return None
        # Where both outer strips together are no wider than one, the narrower is moved out of the ply.
        shift = (left - right) / 2.0 if right + left > width else (-right if right < left else left)
        return float(self.plan.ply.courses.stagger_mm * MM + shift)


def measured(plan: CoursePlan) -> tuple[Ledger, CourseSamples, GapSamples]:
    """Return the areas of planned courses, and what is measured along and between them."""
    strips, field = plan.family.strips, plan.mould.field
    cuts = [((piece.start.offset, piece.start.slope), (piece.end.offset, piece.end.slope)) for piece in plan.pieces]
    tapes = [strips[piece.strip].polygon(*both) for piece, both in zip(plan.pieces, cuts, strict=True)]
    ledger = ledger_of(field, plan.region.outline, tapes)
    parts = [_samples(plan, index, piece) for index, piece in enumerate(plan.pieces)]
    return ledger, CourseSamples.joined(parts), GapSamples.joined([_gaps(plan, i) for i in range(len(strips) - 1)])


def _samples(plan: CoursePlan, index: int, piece: Piece) -> CourseSamples:
    """Return the samples of a course, at those of its strip."""
    strip, field = plan.family.strips[piece.strip], plan.mould.field
    across = LINES * strip.width / 2.0
    begins, ends = (cut.offset + cut.slope * across for cut in (piece.start, piece.end))
    rows = np.flatnonzero((strip.arcs >= begins.min()) & (strip.arcs <= ends.max()))
    half = LATERAL_STEPS // 2
    sides = (strip.right[-1], strip.right[half], strip.left[0], strip.left[half], strip.left[-1])
    points = np.stack([side[rows, :2] for side in sides], axis=1)
    strains = np.stack([side[rows, 4] for side in sides], axis=1) - 1.0
    arcs = strip.arcs[rows, None]
    laid = (arcs >= begins) & (arcs <= ends) & shapely.contains_xy(plan.target, points[..., 0], points[..., 1])
    states = strip.states[rows]
    _, slope_x, slope_y, bend_x, twist, bend_y = field.derivatives(states[:, :2])
    left_x, left_y = strip.left[0, rows, 2:4].T
    bends = (bend_x * left_x**2 + 2.0 * twist * left_x * left_y + bend_y * left_y**2) / np.sqrt(
        1.0 + slope_x**2 + slope_y**2
    )
    normals, along = field.normals(states[:, :2]), tangents(field, states)
    headings = plan.region.headings(normals)
    return CourseSamples(
        courses=np.full(len(rows), index),
        arcs=strip.arcs[rows],
        plan=points,
        laid=laid,
        strains=strains,
        lifts=np.abs(bends) * strip.width**2 / 8.0,
        deviations=np.arctan2(dot(np.cross(headings, along), normals), dot(headings, along)),
    )


def _gaps(plan: CoursePlan, index: int) -> GapSamples:
    """Return the gaps between a strip and the next one to its left, where they are in what is to be covered."""
    gap, strips = plan.family.gaps[index], plan.family.strips
    # Gaps were measured from the strip that is nearer to the reference.
    near, far, side = (index, index + 1, LEFT) if index >= plan.family.reference else (index + 1, index, RIGHT)
    edge = strips[near].edge(side)
    known = np.flatnonzero(gap.known)
    facing = edge[known, :2] + gap.widths[known, None] * edge[known, 2:4]
    inside = [shapely.contains_xy(plan.target, *points.T) for points in (gap.plan[known], facing)]
    kept = inside[0] | inside[1]
    known, facing = known[kept], facing[kept]
    one = _course_at(plan, near, strips[near].arcs[known], np.full(len(known), side * strips[near].width / 2.0))
    other = _course_at(plan, far, *_placed(strips[far], facing))
    both = (one >= 0) & (other >= 0)
    rights, lefts = (one, other) if near == index else (other, one)
    middle = (gap.plan[known] + facing) / 2.0
    return GapSamples(rights[both], lefts[both], middle[both], gap.widths[known][both])


def _placed(strip: Strip, plan: Floats) -> tuple[Floats, Floats]:
    return strip.coordinates(plan) if len(plan) else (np.zeros(0), np.zeros(0))


def _course_at(plan: CoursePlan, strip: int, arcs: Floats, across: Floats) -> Ints:
    """Return the index (n,) of the course of a strip that is nearest along it to strip coordinates; -1 for none."""
    indices = [index for index, piece in enumerate(plan.pieces) if piece.strip == strip]
    if not indices:
        return np.full(len(arcs), -1)
    away = np.stack([_beyond(plan.pieces[index], arcs, across) for index in indices])
    nearest: Ints = np.array(indices)[np.argmin(away, axis=0)]
    return nearest


def _beyond(piece: Piece, arcs: Floats, across: Floats) -> Floats:
    """Return how far strip coordinates (n,) are beyond a course's cuts along the strip, metres; 0 between them."""
    before = piece.start.offset + piece.start.slope * across - arcs
    after = arcs - piece.end.offset - piece.end.slope * across
    beyond: Floats = np.maximum(np.maximum(before, after), 0.0)
    return beyond
