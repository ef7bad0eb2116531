"""Course line: a course's centre line as its file gives it, and the strip coordinates of points beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.courses.course import Course
from tapelayer.units import MM
from tapelayer.vectors import dot, norms, unit

STEP = 5 * MM
# Length at an end whose mean bend and twist the line keeps beyond the end.
_END = 80 * MM
# Opposite normals have no mean; below this its square counts as this.
NO_SIDE = 1e-12


@dataclass(frozen=True, eq=False)
class CourseLine(Frozen):
    """Samples of a centre line, which goes on beyond both ends as far as the cuts reach, as bent and twisted as there.

    Attributes:
        number: of the course.
        length: from its first point to its last, metres.
        half_width: of the tape, metres.
        slants: cotangents of the cut angles at the start and at the end.
        arcs: (n,) arc lengths of the samples, rising; 0 at the first point of the course.
        points: (n, 3) metres.
        tangents: (n, 3) unit.
        normals: (n, 3) unit, out of the surface.
        bends: (n, 3) second derivatives of the points by arc length, 1/m.
        turns: (n, 3) derivatives of the normals by arc length, 1/m.
    """

    number: int
    length: float
    half_width: float
    slants: tuple[float, float]
    arcs: Floats
    points: Floats
    tangents: Floats
    normals: Floats
    bends: Floats
    turns: Floats

    @staticmethod
    def of(course: Course, width: float, beyond: float) -> CourseLine:
        """Return the line of a course.

        Args:
            course: in any frame.
            width: of its tape, metres.
            beyond: how far the line goes beyond what the cuts reach, metres.
        """
        arcs = course.arc_lengths - course.arc_lengths[0]
        length = float(arcs[-1])
        spline = make_interp_spline(arcs, np.hstack([course.points, course.normals]), min(3, len(arcs) - 1))
        slope = spline.derivative()
        inner = np.linspace(0.0, length, max(math.ceil(length / STEP), 2) + 1)
        values, slopes = spline(inner), slope(inner)
        bends = slope.derivative()(inner)[:, :3] if len(arcs) > 2 else np.zeros((len(inner), 3))
        tangents, normals = unit(slopes[:, :3]), unit(values[:, 3:])
        middle = (inner, values[:, :3], tangents, normals, bends, slopes[:, 3:])
        slants = (1.0 / math.tan(course.cut_angles[0]), 1.0 / math.tan(course.cut_angles[1]))
        before = _beyond(middle, -(width / 2 * abs(slants[0]) + beyond))
        after = _beyond(middle, width / 2 * abs(slants[1]) + beyond)
        columns = [np.concatenate(parts) for parts in zip(before, middle, after, strict=True)]
        return CourseLine(course.number, length, width / 2, slants, *columns)

    @cached_property
    def lefts(self) -> Floats:
        """Unit directions (n, 3) to the left of travel in the surface."""
        return np.cross(self.normals, self.tangents)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    @cached_property
    def inner(self) -> Mask:
        """Samples (n,) of the course itself, from its first point to its last."""
        return (self.arcs >= 0.0) & (self.arcs <= self.length)

    def coordinates(self, points: Floats, normals: Floats) -> tuple[Floats, Floats, Ints]:
        """Return the strip coordinates of points on the surface: arc lengths (n,), distances (n,) to the left.

        Also the nearest samples (n,). Distances are along the surface, as bent as its normals at both ends say.

        Args:
            points: (n, 3) metres.
            normals: (n, 3) unit normals of the surface there.
        """
        _, nearest = self._tree.query(points)
        away = points - self.points[nearest]
        steps = dot(away, self.tangents[nearest]) / (1.0 - dot(away, self.bends[nearest]))
        # Beyond the last samples there is no line.
        steps = np.clip(steps, -STEP, STEP)
        tangents = self.tangents[nearest] + steps[:, None] * self.bends[nearest]
        away = away - steps[:, None] * (self.tangents[nearest] + tangents) / 2
        there = unit(self.normals[nearest] + steps[:, None] * self.turns[nearest])
        lefts = np.cross(there, unit(tangents))
        # A chord of the surface is square to the mean of its normals; what is left is a point off the surface.
        upright = normals + there
        away = away - (dot(away, upright) / np.maximum(dot(upright, upright), NO_SIDE))[:, None] * upright
        chords = norms(away)
        with np.errstate(invalid="ignore", divide="ignore"):
            half_turns = np.where(chords > 0.0, np.abs(dot(normals - there, away)) / (2.0 * chords), 0.0)
        half_turns = np.clip(half_turns, 0.0, 0.9)
        bent = np.where(half_turns > 1e-6, np.arcsin(half_turns) / np.maximum(half_turns, 1e-6), 1.0)
        return self.arcs[nearest] + steps, np.copysign(chords * bent, dot(away, lefts)), nearest

    def outside(self, arcs: Floats, lefts: Floats) -> tuple[Floats, Floats]:
        """Return how far (n,) strip coordinates lie beside the tape and beyond its cuts, metres; negative inside.

        Args:
            arcs: (n,) metres along the line.
            lefts: (n,) metres to the left of it.

        Examples:
            >>> points, normals = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
            >>> course = Course(1, points, normals, np.array([0.0, 1.0]), (math.pi / 2, math.pi / 2))
            >>> beside, beyond = CourseLine.of(course, 0.5, 0.1).outside(np.array([1.5]), np.array([0.5]))
            >>> beside.round(9).tolist(), beyond.round(9).tolist()
            ([0.25], [0.5])
        """
        start, end = self.slants
        before = (start * lefts - arcs) / math.hypot(1.0, start)
        after = (arcs - self.length - end * lefts) / math.hypot(1.0, end)
        return np.abs(lefts) - self.half_width, np.maximum(before, after)


Samples = tuple[Floats, Floats, Floats, Floats, Floats, Floats]


def _beyond(samples: Samples, reach: float) -> Samples:
    """Return the samples of a geodesic beyond the end of a line: a helix as bent and twisted as the line near the end.

    Args:
        samples: arc lengths, points, tangents, normals, bends and turns of the line.
        reach: beyond the end, metres; negative before the start.
    """
    arcs, points, tangents, normals, _, turns = samples
    end = -1 if reach > 0.0 else 0
    near = np.abs(arcs - arcs[end]) <= _END
    lefts = np.cross(normals, tangents)
    twist, bend = -np.mean(dot(turns, lefts)[near]), np.mean(dot(turns, tangents)[near])
    normal = normals[end]
    tangent = unit((tangents[end] - (tangents[end] @ normal) * normal)[None])[0]
    steps = np.arange(1, math.ceil(abs(reach) / STEP) + 1) * STEP * math.copysign(1.0, reach)
    if reach < 0.0:
        steps = steps[::-1]
    # The frame of tangent, left and normal turns about one axis in space at one rate.
    axis = twist * tangent + bend * np.cross(normal, tangent)
    rate = float(np.linalg.norm(axis))
    axis = axis / rate if rate > 1e-9 else tangent
    angle = (rate * steps)[:, None]
    across, towards = np.cross(axis, tangent), np.cross(axis, np.cross(axis, tangent))
    inclined, risen = np.cross(axis, normal), np.cross(axis, np.cross(axis, normal))
    sine, versed = np.sin(angle), 2.0 * np.sin(angle / 2) ** 2
    pace = max(rate, 1e-9)
    along = points[end] + steps[:, None] * tangent + versed / pace * across + (steps[:, None] - sine / pace) * towards
    headings = tangent + sine * across + versed * towards
    outwards = normal + sine * inclined + versed * risen
    return (
        arcs[end] + steps,
        along,
        headings,
        outwards,
        -bend * outwards,
        rate * np.cross(axis, outwards),
    )
