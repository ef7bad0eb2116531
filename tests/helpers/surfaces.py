"""Courses on surfaces whose points, normals and tangents are known exactly."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.geometry.toolpath import Toolpath

SQUARE = (math.pi / 2, math.pi / 2)


def helix(
    arc_lengths: Floats, radius: float = 1.5, heading: float = 0.3, start: tuple[float, float] = (0.5, 0.0)
) -> tuple[Floats, Floats, Floats]:
    """Points, normals and tangents (n, 3) of a geodesic on a cylinder about the x axis, in the part's frame.

    Args:
        arc_lengths: (n,) metres.
        radius: of the cylinder, metres.
        heading: from +y towards +x, radians.
        start: x in metres and angle round the cylinder in radians, 0 on top.
    """
    angle = start[1] + arc_lengths * math.cos(heading) / radius
    x = start[0] + arc_lengths * math.sin(heading)
    normals = np.stack([np.zeros_like(x), np.sin(angle), np.cos(angle)], axis=1)
    points = radius * normals + np.stack([x, 0 * x, 0 * x], axis=1) + np.array([0.0, 1.0, -radius])
    tangents = np.stack(
        [np.full_like(x, math.sin(heading)), math.cos(heading) * np.cos(angle), -math.cos(heading) * np.sin(angle)],
        axis=1,
    )
    return points, normals, tangents


def helix_course(number: int = 1, length: float = 0.6, n: int = 61, **shape: object) -> Course:
    """A course along `helix`."""
    arc_lengths = np.linspace(0.0, length, n)
    points, normals, _ = helix(arc_lengths, **shape)  # type: ignore[arg-type]
    return Course(number, points, normals, arc_lengths, SQUARE)


def flat_course(number: int = 1, length: float = 0.6, n: int = 61, heading: float = 0.0, x: float = 0.5) -> Course:
    """A straight course on a level table."""
    arc_lengths = np.linspace(0.0, length, n)
    along = np.array([math.sin(heading), math.cos(heading), 0.0])
    normals = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Course(number, np.array([x, 0.5, 0.0]) + arc_lengths[:, None] * along, normals, arc_lengths, SQUARE)


def circle_course(number: int = 1, radius: float = 0.1, turns: float = 1.0, n: int = 721, phase: float = 0.0) -> Course:
    """A level circle, anticlockwise seen from above, from the angle `phase`; one turn is a closed course."""
    angle = np.linspace(0.0, 2 * math.pi * turns, n)
    points = np.stack([0.5 + radius * np.cos(angle + phase), 0.5 + radius * np.sin(angle + phase), 0 * angle], axis=1)
    return Course(number, points, np.tile([0.0, 0.0, 1.0], (n, 1)), radius * angle, SQUARE)


def bracket_courses(count: int = 4, step: float = 0.7e-3) -> tuple[Course, ...]:
    """Closed courses inside each other round a bent bracket with a waist, both ways round, as way-points of a file.

    Their curvature changes sign, and they turn within 8 mm; the points are even only to a tenth of a micrometre.
    """
    return tuple(_round_bracket(number, 2e-3 * number, step) for number in range(1, count + 1))


def _round_bracket(number: int, inset: float, step: float) -> Course:
    """A course about as far inside the bracket's edge as the inset, metres; odd numbers go anticlockwise."""
    turn = np.linspace(0.3, 0.3 + 2 * math.pi, 40001) * (1 if number % 2 else -1)
    waist = 1 - 0.5 * np.sin(turn) ** 2
    x, y = (0.087 - inset) * np.cos(turn), (0.028 - inset) * waist * np.sin(turn)
    points = np.stack([x, y, 0.036 - 4 * x**2 + 2 * x * y], axis=1)
    normals = np.stack([8 * x - 2 * y, -2 * x, np.ones_like(x)], axis=1)
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()])
    rows = np.searchsorted(along, np.arange(0.0, along[-1] - step / 2, step))
    points, normals = np.round(points[rows], 7), normals[rows] / np.linalg.norm(normals[rows], axis=1)[:, None]
    lengths = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()])
    return Course(number, points, normals, lengths, (math.pi / 4, math.pi / 4))


def arc(n: int = 101, length: float = 2.0, radius: float = 1.5) -> Toolpath:
    """A course up a cylinder of 1.5 m about the y axis."""
    angle = np.linspace(0, length / radius, n)
    normals = np.stack([np.sin(angle), np.zeros(n), np.cos(angle)], axis=1)
    return Toolpath(1, radius * normals, normals, radius * angle)
