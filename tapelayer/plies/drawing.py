"""Drawing: what of a plan is drawn over its mould."""

from __future__ import annotations

from dataclasses import dataclass

from tapelayer.arrays import Floats, Frozen
from tapelayer.courses.course import Course
from tapelayer.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Ribbon(Frozen):
    """The tape of one course in pairs of edge points, from the first corner of its start cut to the last of its end.

    Attributes:
        number: of the course.
        arcs: (n,) metres along the course of each pair, rising; below 0 and beyond its length at slanted cuts.
        left: (n, 3) left edge of the tape in the mould's frame, metres; at a slanted cut a point of the cut's line.
        right: (n, 3) right edge likewise.
        strains: (n,) larger of the two edges' strains by magnitude, with its sign; NaN where it is not known.
        lifts: (n,) height of the surface's sag under a straight roller, metres.
        angles: (n,) deviation from the ply's angle, radians.
        residuals: (n,) the smooth surface off the mould, metres.
    """

    number: int
    arcs: Floats
    left: Floats
    right: Floats
    strains: Floats
    lifts: Floats
    angles: Floats
    residuals: Floats


@dataclass(frozen=True, eq=False)
class GapLine(Frozen):
    """The gap between two neighbouring courses.

    Attributes:
        right: number of the course on its right.
        left: number of the course on its left.
        points: (n, 3) on the edge of one of them, in the mould's frame, metres.
        gaps: (n,) metres; negative where they overlap, NaN where there is none.
    """

    right: int
    left: int
    points: Floats
    gaps: Floats


@dataclass(frozen=True, eq=False)
class Drawing:
    """A plan over its mould.

    Attributes:
        mould: all its facets.
        courses: in the order of laying.
        ribbons: of the courses, in the same order.
        gaps: between neighbouring courses.
        rings: (n, 3) each of the ply's boundary on the mould in metres, the outer one first, then those of holes;
            closed, the first point is not repeated.
    """

    mould: Mesh
    courses: tuple[Course, ...]
    ribbons: tuple[Ribbon, ...]
    gaps: tuple[GapLine, ...]
    rings: tuple[Floats, ...]
