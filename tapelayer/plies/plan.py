"""Plan: from a ply and its mould to courses on natural paths, cut to the ply."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from scipy.interpolate import CubicSpline

from tapelayer.arrays import Floats, Frozen
from tapelayer.courses.course import Course
from tapelayer.courses.table import from_mm
from tapelayer.errors import BeyondSurface
from tapelayer.geometry.geodesics import aimed, halved, lateral, trace
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.models import read_mesh
from tapelayer.jobs.stages import FITTING, PLANNING_COURSES
from tapelayer.plies.family import Family, GapLimits, family_of
from tapelayer.plies.fitting import FittedMould, fitted
from tapelayer.plies.limits import ACCURACY
from tapelayer.plies.pieces import CutRules, Piece, pieces_of
from tapelayer.plies.ply import Ply
from tapelayer.plies.reach import Reach
from tapelayer.plies.region import Region, region_of
from tapelayer.plies.strip import LATERAL_STEPS, Strip
from tapelayer.progress import UNSEEN, Steps
from tapelayer.units import DEG, MM
from tapelayer.vectors import norms

# Steps along a geodesic, metres: as long as halving them moves no course by more than the accuracy.
STEP = 5.0 * MM
SHORTEST_STEP = 0.6 * MM
# A program's spline needs a few points.
LEAST_POINTS = 4
# Decimals of the course file: millimetres, normals, degrees.
LENGTH_DECIMALS, NORMAL_DECIMALS, ANGLE_DECIMALS = 6, 9, 6


@dataclass(frozen=True, eq=False)
class CoursePlan(Frozen):
    """The courses of a ply, and what they were planned on.

    Attributes:
        ply: what was asked for.
        name: of the ply's file, for messages.
        region: the ply on its mould.
        target: what is covered, in plan: the region's outline with the margin.
        mould: the smooth surface.
        family: the strips, and the gaps between them.
        pieces: the courses as parts of strips, in the order of laying.
        courses: the same in the mould's frame, numbered from 1.
        path_error: metres by which halving the steps moves a course.
        spacing_error: metres between a course and the spline through its points.
        ambiguity: metres by which another smooth surface through the same mould moves a course within the ply.
    """

    ply: Ply
    name: str
    region: Region
    target: shapely.Polygon
    mould: FittedMould
    family: Family
    pieces: tuple[Piece, ...]
    courses: tuple[Course, ...]
    path_error: float
    spacing_error: float
    ambiguity: float


def plan_courses(ply: Ply, mould: Mesh | None = None, steps: Steps = UNSEEN, name: str = "ply") -> CoursePlan:
    """Return the courses of a ply on its mould.

    Args:
        ply: what is asked for.
        mould: its facets; None to read the file that the ply names.
        steps: receiver of progress.
        name: of the ply's file, for messages.

    Raises:
        MeshRefused: the mould's file cannot be used.
        PlyRefused: the ply does not fit its mould, or the mould is not smooth there; all faults at once.
        NoNaturalPaths: the mould is too strongly curved for natural paths.
    """
    region = region_of(ply, read_mesh(Path(ply.mould.file), ply.mould.unit) if mould is None else mould, name)
    steps.begin(FITTING.name)
    rules = cut_rules(ply)
    target = region.outline.buffer(ply.ply.margin_mm * MM, join_style="mitre")
    reach = Reach.around(target, ply.width * max(2.0, rules.steepest / 2.0 + 0.2) + rules.least_length / 2.0)
    surface = fitted(region, ply, reach, name)
    family, path_error = _settled_family(ply, region, surface, target, reach, steps)
    pieces = tuple(_in_order(ply, family, [pieces_of(s, i, target, rules) for i, s in enumerate(family.strips)]))
    spacings = ply.courses.point_spacing_mm * MM
    made = [
        _course(n, piece, family.strips[piece.strip], surface, region, spacings) for n, piece in enumerate(pieces, 1)
    ]
    return CoursePlan(
        ply=ply,
        name=name,
        region=region,
        target=target,
        mould=surface,
        family=family,
        pieces=pieces,
        courses=tuple(course for course, _ in made),
        path_error=path_error,
        spacing_error=max((error for _, error in made), default=0.0),
        ambiguity=max((_moved(strip, surface, target) for strip in family.strips), default=0.0),
    )


def cut_rules(ply: Ply) -> CutRules:
    """Return what the cuts and courses of a ply must keep."""
    courses = ply.courses
    return CutRules(courses.minimum_cut_angle_deg * DEG, courses.minimum_length_mm * MM, courses.minimum_hole_mm * MM)


def _settled_family(
    ply: Ply, region: Region, surface: FittedMould, target: shapely.Polygon, reach: Reach, steps: Steps
) -> tuple[Family, float]:
    """Return the strips of a ply, with steps so short that halving them moves none by more than the accuracy.

    Returns:
        The strips, and by how much the halving moves them, metres.
    """
    gap, field = ply.gap, surface.field
    limits = GapLimits(gap.least_mm * MM, gap.nominal_mm * MM, gap.largest_mm * MM)
    step = STEP
    while True:
        seed = _seed(ply, region, surface)
        steps.begin(PLANNING_COURSES.name, _strips_across(target, seed, ply.width + limits.nominal))
        family = family_of(field, target, seed, reach, limits, ply.width, step, steps.tick)
        error = max(_halving_moves(strip, target) for strip in family.strips)
        if error <= ACCURACY or step / 2.0 < SHORTEST_STEP:
            return family, error
        step /= 2.0


def _strips_across(target: shapely.Polygon, seed: Floats, pitch: float) -> int:
    """Return about how many strips a pitch apart, along the one at a state (4,), cover a target in plan."""
    aside = shapely.get_coordinates(target.exterior) @ np.array([-seed[3], seed[2]]) / np.hypot(*seed[2:])
    return max(round(float(np.ptp(aside)) / pitch), 1)


def _seed(ply: Ply, region: Region, surface: FittedMould) -> Floats:
    """Return the state (4,) of the strip through the seed, moved by the stagger to its left."""
    field, plan = surface.field, region.seed[None]
    states = aimed(field, plan, region.headings(field.normals(plan))[:, :2])
    stagger = ply.courses.stagger_mm * MM
    if stagger:
        plan = lateral(field, states, stagger, LATERAL_STEPS)[-1, :, :2]
        states = aimed(field, plan, region.headings(field.normals(plan))[:, :2])
    state: Floats = states[0]
    return state


def _halving_moves(strip: Strip, target: shapely.Polygon) -> float:
    """Return by how much half the steps move a strip where it is near a target in plan, metres."""
    at = int(np.searchsorted(strip.arcs, 0.0))
    finer = trace(strip.field, strip.states[at], halved(strip.arcs))[::2]
    return _farthest(strip, finer, target)


def _moved(strip: Strip, surface: FittedMould, target: shapely.Polygon) -> float:
    """Return by how much the other smooth surface moves a strip within a target in plan, metres."""
    near = np.flatnonzero(_near(strip, target))
    at = int(np.searchsorted(strip.arcs, 0.0))
    rows = slice(min(near[0], at), max(near[-1], at) + 1) if len(near) else slice(at, at + 1)
    start = strip.states[at]
    try:
        begun = aimed(surface.twin, start[None, :2], start[None, 2:])[0]
        other = trace(surface.twin, begun, strip.arcs[rows])
    except (ArithmeticError, BeyondSurface):
        return float("inf")
    return _farthest(replace(strip, arcs=strip.arcs[rows], states=strip.states[rows]), other, target)


def _near(strip: Strip, target: shapely.Polygon) -> Floats:
    near: Floats = shapely.contains_xy(target.buffer(strip.width / 2.0), *strip.states[:, :2].T)
    return near


def _farthest(strip: Strip, states: Floats, target: shapely.Polygon) -> float:
    """Return the largest distance in plan of a strip's samples near a target from other states (n, 4), metres."""
    distances = norms(states[:, :2] - strip.states[:, :2])[_near(strip, target)]
    return float(np.max(distances, initial=0.0))


def _in_order(ply: Ply, family: Family, pieces: Sequence[tuple[Piece, ...]]) -> Iterator[Piece]:
    """Yield pieces, given strip by strip from right to left, in the order and the direction in which they are laid."""
    courses = ply.courses
    order = range(len(family.strips))
    for turn, index in enumerate(order if courses.start_corner == "right" else reversed(order)):
        back = courses.reverse != (courses.order == "there_and_back" and turn % 2 == 1)
        of_strip = pieces[index][::-1] if back else pieces[index]
        yield from (replace(piece, backwards=back) for piece in of_strip)


def _course(
    number: int, piece: Piece, strip: Strip, surface: FittedMould, region: Region, spacing: float
) -> tuple[Course, float]:
    """Return the course of a piece, and how far the spline through its points is off its path, metres.

    Its points are evenly spaced, and so close that the spline through them is within the accuracy.
    """
    count = max(int(np.ceil(piece.length / spacing)) + 1, LEAST_POINTS)
    while True:
        arcs = np.linspace(piece.start.offset, piece.end.offset, 2 * count - 1)
        plan = strip.at(arcs)
        points = surface.field.points(plan)
        between = CubicSpline(arcs[::2], points[::2])(arcs[1::2])
        error = float(np.max(norms(between - points[1::2])))
        if error <= ACCURACY or piece.length / count < SHORTEST_STEP:
            break
        count = 2 * count - 1
    rows = slice(None, None, -2) if piece.backwards else slice(None, None, 2)
    along = np.abs(arcs[rows] - arcs[rows][0])
    outside = region.plane.out_of(points[rows])
    normals = region.plane.turned_out_of(surface.field.normals(plan[rows]))
    start, end = np.radians(np.round(np.degrees(piece.cut_angles), ANGLE_DECIMALS)).tolist()
    course = Course(
        number,
        from_mm(np.round(outside / MM, LENGTH_DECIMALS)),
        np.round(normals, NORMAL_DECIMALS),
        from_mm(np.round(along / MM, LENGTH_DECIMALS)),
        (start, end),
    )
    return course, error
