"""Ribbons: the tape of each course between its cuts, with what was measured on it, in plan and over the mould."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Frozen
from tapelayer.plies.cut_lines import CutLine
from tapelayer.plies.drawing import Drawing, GapLine, Ribbon
from tapelayer.plies.evidence import PlyEvidence
from tapelayer.plies.pieces import Piece
from tapelayer.units import MM

# Points of a boundary are at most this far apart, metres.
STEP = 10.0 * MM


@dataclass(frozen=True, eq=False)
class PlanRibbon(Frozen):
    """The tape of a course in plan, in pairs of edge points along its strip; values where it is laid, NaN elsewhere.

    Attributes:
        number: of the course.
        piece: the course as a part of its strip.
        arcs: (n,) metres along the strip, rising.
        left: (n, 2) left edge, seen along the strip, or a point of a slanted cut.
        right: (n, 2) right edge likewise.
        strains: (n,) the strain of largest magnitude across the tape.
        lifts: (n,) sag of the surface under a straight roller, metres.
        angles: (n,) deviation from the ply's angle, to its left, radians.
        residuals: (n,) the smooth surface off the nearest corner of a facet, metres.
    """

    number: int
    piece: Piece
    arcs: Floats
    left: Floats
    right: Floats
    strains: Floats
    lifts: Floats
    angles: Floats
    residuals: Floats


def ribbons_of(evidence: PlyEvidence) -> tuple[PlanRibbon, ...]:
    """Return the ribbons of all courses, in the order of laying."""
    return tuple(_ribbons(evidence))


def _ribbons(evidence: PlyEvidence) -> Iterator[PlanRibbon]:
    plan, samples = evidence.plan, evidence.samples
    corners = cKDTree(plan.mould.corners[:, :2])
    borders = np.searchsorted(samples.courses, np.arange(len(plan.pieces) + 1)).tolist()
    largest = samples.laid_strains[np.arange(len(samples.arcs)), samples.largest_strains]
    for index, piece in enumerate(plan.pieces):
        strip, rows = plan.family.strips[piece.strip], slice(borders[index], borders[index + 1])
        half = strip.width / 2.0
        ends = [cut.at(across) for cut in (piece.start, piece.end) for across in (-half, half)]
        along = samples.arcs[rows]
        arcs = np.unique(np.concatenate([along, ends]))
        arcs = arcs[(arcs >= strip.arcs[0]) & (arcs <= strip.arcs[-1])]
        lowest, highest = _across(piece.start, piece.end, arcs, half)
        left, right = strip.plan(arcs, highest), strip.plan(arcs, lowest)
        nearest = corners.query(strip.at(arcs))[1]
        yield PlanRibbon(
            index + 1,
            piece,
            arcs,
            left,
            right,
            _between(arcs, along, largest[rows]),
            _between(arcs, along, samples.laid_lifts[rows]),
            _between(arcs, along, samples.laid_deviations[rows]),
            plan.mould.residuals[nearest],
        )


def _between(arcs: Floats, along: Floats, values: Floats) -> Floats:
    """Return values (m,) given at arc lengths (n,) at others (m,)."""
    return np.interp(arcs, along, values) if len(along) else np.full(len(arcs), np.nan)


def _across(start: CutLine, end: CutLine, arcs: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the strip coordinates across (n,) between which there is tape at arc lengths (n,), metres."""
    lowest, highest = np.full(len(arcs), -half), np.full(len(arcs), half)
    for cut, after in ((start, True), (end, False)):
        if cut.slope == 0.0:
            continue
        line = np.clip((arcs - cut.offset) / cut.slope, -half, half)
        if (cut.slope > 0.0) == after:
            highest = np.minimum(highest, line)
        else:
            lowest = np.maximum(lowest, line)
    return lowest, np.maximum(highest, lowest)


def drawing_of(evidence: PlyEvidence) -> Drawing:
    """Return what of a plan is drawn over its mould."""
    plan = evidence.plan
    return Drawing(
        mould=plan.region.mould,
        courses=plan.courses,
        ribbons=tuple(_over_mould(evidence, ribbon) for ribbon in ribbons_of(evidence)),
        gaps=tuple(_gap_lines(evidence)),
        rings=tuple(
            _raised(evidence, shapely.get_coordinates(shapely.segmentize(ring, STEP))[:-1])
            for ring in (plan.region.outline.exterior, *plan.region.outline.interiors)
        ),
    )


def _over_mould(evidence: PlyEvidence, ribbon: PlanRibbon) -> Ribbon:
    """Return a ribbon over the mould, as its course is laid."""
    left, right = _raised(evidence, ribbon.left), _raised(evidence, ribbon.right)
    arcs, rows = ribbon.arcs - ribbon.piece.start.offset, slice(None)
    if ribbon.piece.backwards:
        left, right, rows = right, left, slice(None, None, -1)
        arcs = ribbon.piece.end.offset - ribbon.arcs
    values = (ribbon.strains, ribbon.lifts, ribbon.angles, ribbon.residuals)
    return Ribbon(ribbon.number, arcs[rows], left[rows], right[rows], *(value[rows] for value in values))


def _gap_lines(evidence: PlyEvidence) -> Iterator[GapLine]:
    gaps = evidence.gaps
    changes = np.any(np.diff(np.column_stack([gaps.rights, gaps.lefts]), axis=0) != 0, axis=1)
    for rows in np.split(np.arange(len(gaps.widths)), np.flatnonzero(changes) + 1):
        if len(rows):
            right, left = int(gaps.rights[rows[0]]) + 1, int(gaps.lefts[rows[0]]) + 1
            yield GapLine(right, left, _raised(evidence, gaps.plan[rows]), gaps.widths[rows])


def _raised(evidence: PlyEvidence, plan: Floats) -> Floats:
    """Return the points (n, 3) of the surface over points (n, 2) in plan, in the mould's frame."""
    points: Floats = evidence.plan.region.plane.out_of(evidence.plan.mould.field.points(plan))
    return points
