"""Laid ply: the courses of a file on their mould, with the terms that they are judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from shapely import Polygon

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.geometry.plane import Plane
from tapelayer.plies.course_line import CourseLine
from tapelayer.plies.facet_surface import FacetSurface, Spots
from tapelayer.units import MM
from tapelayer.vectors import dot, unit

# How far lines go beyond what their cuts reach, metres, where no margin is wanted.
BEYOND = 20 * MM


@dataclass(frozen=True, eq=False)
class Terms:
    """What a ply asks of its courses, in metres and radians.

    Attributes:
        width: of the tape.
        angle: of the courses to the rosette, to its left.
        rosette: (3,) direction in the mould's frame.
        seed: (2,) in plan, in the plane's frame.
        margin: tape wanted beyond the outline.
        stagger: shift of the family to the left of the seed.
        minimum_length: of a course.
        minimum_hole: longest interruption that a course may be laid through.
        minimum_cut_angle: between a cut and the tape's edge.
        order: one way, or there and back.
        start_corner: side of the first course, seen along the ply's direction.
        reverse: whether courses are laid against the ply's direction.
        max_gap: between edges.
        max_overlap: of edges; negative where a gap is asked for.
        max_strain: of the tape's edges, 1.
        max_lift: sag of the surface under a straight roller.
        max_angle_deviation: of a course from the ply's angle.
        max_surface_residual: of points off the surface that the facets stand for.
        max_off_mould: of a centre line beyond the mould's edge.
    """

    width: float
    angle: float
    rosette: Floats
    seed: Floats
    margin: float
    stagger: float
    minimum_length: float
    minimum_hole: float
    minimum_cut_angle: float
    order: Literal["one_way", "there_and_back"]
    start_corner: Literal["right", "left"]
    reverse: bool
    max_gap: float
    max_overlap: float
    max_strain: float
    max_lift: float
    max_angle_deviation: float
    max_surface_residual: float
    max_off_mould: float


@dataclass(frozen=True)
class Fault:
    """One thing that a laid ply does wrong.

    Attributes:
        sentence: what, where in mm in the mould's frame, what was expected, and where it helps what to do.
        courses: numbers of the courses.
        place: in the mould's frame, metres; None where there is none.
    """

    sentence: str
    courses: tuple[int, ...] = ()
    place: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class LaidPly:
    """Courses on a mould.

    Attributes:
        terms: of the ply.
        plane: of the ply, in the mould's frame.
        surface: of the mould, in the plane's frame.
        outline: of the ply in plan, metres, without its holes.
        courses: in the order of the file, in the plane's frame.
    """

    terms: Terms
    plane: Plane
    surface: FacetSurface
    outline: Polygon
    courses: Sequence[Course]

    @staticmethod
    def of(courses: Sequence[Course], terms: Terms, plane: Plane, surface: FacetSurface, outline: Polygon) -> LaidPly:
        """Return the ply of courses in the mould's frame."""
        turned = [
            replace(course, points=plane.into(course.points), normals=plane.turned_into(course.normals))
            for course in courses
        ]
        return LaidPly(terms, plane, surface, outline, turned)

    @cached_property
    def lines(self) -> list[CourseLine]:
        """Centre lines of the courses."""
        return [CourseLine.of(course, self.terms.width, BEYOND + self.terms.margin) for course in self.courses]

    @cached_property
    def spots(self) -> list[Spots]:
        """Spots of each course's points on the mould."""
        return [self.surface.spots(course.points[:, :2]) for course in self.courses]

    @cached_property
    def target(self) -> Polygon:
        """What tape is wanted on, in plan: the outline grown by the margin."""
        margin = self.terms.margin
        return self.outline.buffer(margin, join_style="mitre") if margin else self.outline

    @cached_property
    def ways(self) -> Floats:
        """1 for each course (n,) that runs in the ply's direction in its middle, -1 for one against it."""
        ways = np.empty(len(self.lines))
        for row, line in enumerate(self.lines):
            middle = np.flatnonzero(line.inner)[[np.sum(line.inner) // 2]]
            along = dot(line.tangents[middle], self.headings(line.normals[middle]))
            ways[row] = -1.0 if along[0] < 0.0 else 1.0
        return ways

    def headings(self, normals: Floats) -> Floats:
        """Return the ply's directions (n, 3) in the surface with unit normals (n, 3), unit, in the plane's frame."""
        rosette = self.plane.turned_into(self.terms.rosette[None])
        ahead = unit(rosette - dot(np.broadcast_to(rosette, normals.shape), normals)[:, None] * normals)
        headings: Floats = np.cos(self.terms.angle) * ahead + np.sin(self.terms.angle) * np.cross(normals, ahead)
        return headings

    def place(self, point: Floats) -> tuple[float, float, float]:
        """Return a point (3,) of the plane's frame in the mould's frame, metres."""
        x, y, z = self.plane.out_of(point[None])[0].tolist()
        return x, y, z

    def at(self, point: Floats) -> str:
        """Return a point (3,) of the plane's frame in words: mm in the mould's frame."""
        return "(" + ", ".join(f"{value / MM:z.1f}" for value in self.place(point)) + ")"
