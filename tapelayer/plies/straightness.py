"""Straightness: how far courses wander sideways from geodesics, from their points and normals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.plies.course_line import CourseLine
from tapelayer.units import MM
from tapelayer.vectors import dot

# Length over which a course's wander is measured, metres, and the step from one such stretch to the next.
STRETCH = 1.0
_MOVE = 0.25
# Length over which steering is averaged, metres.
_WINDOW = 70 * MM


@dataclass(frozen=True)
class Wander:
    """How far a course wanders from straight, laid flat.

    Attributes:
        distance: largest from the line through the ends of a stretch of `STRETCH` or the whole course, metres.
        sample: where, an index of the points.
    """

    distance: float
    sample: int


def wander(points: Floats, normals: Floats, arcs: Floats) -> Wander:
    """Return the wander of a course, whose chords are laid flat one after the other: each turns in its points' planes.

    Args:
        points: (n, 3) metres.
        normals: (n, 3) unit normals of the surface there.
        arcs: (n,) arc lengths, rising.

    Examples:
        >>> points = np.array([[0.0, 0.0, 0.0], [0.1, 0.001, 0.0], [0.2, 0.0, 0.0]])
        >>> found = wander(points, np.tile([0.0, 0.0, 1.0], (3, 1)), np.array([0.0, 0.1, 0.2]))
        >>> round(found.distance, 6), found.sample
        (0.001, 1)
    """
    chords = np.diff(points, axis=0)
    before, after, middle = chords[:-1], chords[1:], normals[1:-1]
    before = before - dot(before, middle)[:, None] * middle
    after = after - dot(after, middle)[:, None] * middle
    turns = np.arctan2(dot(np.cross(before, after), middle), dot(before, after))
    headings = np.concatenate([[0.0], np.cumsum(turns)])
    lengths = np.sqrt(dot(chords, chords))
    flat = np.zeros((len(points), 2))
    flat[1:] = np.cumsum(np.stack([lengths * np.cos(headings), lengths * np.sin(headings)], axis=1), axis=0)
    worst = Wander(0.0, 0)
    last = max(float(arcs[-1]) - STRETCH, 0.0)
    for begin in np.linspace(0.0, last, math.ceil(last / _MOVE) + 1).tolist():
        rows = np.flatnonzero((arcs >= begin - MM) & (arcs <= begin + STRETCH + MM))
        way = flat[rows[-1]] - flat[rows[0]]
        away = flat[rows] - flat[rows[0]]
        distances = np.abs(way[0] * away[:, 1] - way[1] * away[:, 0]) / np.hypot(*way)
        largest = int(np.argmax(distances))
        if not distances[largest] <= worst.distance:
            worst = Wander(float(distances[largest]), int(rows[largest]))
    return worst


def steering(line: CourseLine) -> Floats:
    """Return the geodesic curvature (n,) at a line's own samples, averaged over 70 mm or all of it, 1/m."""
    inner = np.flatnonzero(line.inner)
    arcs, curvatures = line.arcs[inner], dot(line.bends[inner], line.lefts[inner])
    sums = np.concatenate([[0.0], np.cumsum(np.diff(arcs) * (curvatures[1:] + curvatures[:-1]) / 2)])
    window = min(_WINDOW, line.length)
    begins = np.clip(arcs - window / 2, 0.0, line.length - window)
    means: Floats = (np.interp(begins + window, arcs, sums) - np.interp(begins, arcs, sums)) / window
    return means
