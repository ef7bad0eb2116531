"""Polylines: positions along them, and vertices that can be left out."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask


def along(path: Floats, places: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return arc length (n,) of the polyline's point nearest to each point (n, 3), and distance (n,), in metres.

    The first is searched for on the whole polyline, the others near the distance travelled since.

    Examples:
        >>> path, places = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.array([0.0, 2.0])
        >>> arcs, distances = along(path, places, np.array([[0.5, 0.0, 0.1], [1.5, 0.0, 0.2]]))
        >>> arcs.tolist(), distances.tolist()
        ([0.5, 1.5], [0.1, 0.2])
    """
    near, _ = _nearest(path, places, points[:1], np.arange(len(path) - 1)[None])
    travelled = near[0] + np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    segment = np.clip(np.searchsorted(places, travelled) - 1, 0, len(path) - 2)
    around = np.clip(segment[:, None] + np.arange(-2, 3), 0, len(path) - 2)
    return _nearest(path, places, points, around)


def _nearest(path: Floats, places: Floats, points: Floats, segments: Ints) -> tuple[Floats, Floats]:
    """Return the same as `along`, restricted to segments (n, k) of the polyline."""
    begins, steps = path[segments], path[segments + 1] - path[segments]
    away = points[:, None] - begins
    squares = np.einsum("nij,nij->ni", steps, steps)
    share = np.clip(np.einsum("nij,nij->ni", away, steps) / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
    distances = np.linalg.norm(away - share[..., None] * steps, axis=2)
    best = np.argmin(distances, axis=1)
    row = np.arange(len(points))
    chosen = segments[row, best]
    arcs = places[chosen] + share[row, best] * (places[chosen + 1] - places[chosen])
    return arcs, distances[row, best]


# A vertex is kept where leaving it out would tilt the gun by more than this.
NORMAL_TOLERANCE = math.radians(0.5)


def kept(stations: Floats, points: Floats, normals: Floats, fixed: Mask, chord: float) -> Mask:
    """Return the vertices (n,) to keep when dropping those that the others interpolate well enough.

    The path passes every dropped vertex within the chord tolerance, with the gun's direction within
    `NORMAL_TOLERANCE` (Douglas and Peucker's choice of vertices).

    Args:
        stations: (n,) arc lengths of the vertices, metres, increasing.
        points: (n, 3) metres.
        normals: (n, 3) unit normals.
        fixed: (n,) vertices to keep in any case.
        chord: greatest distance, metres.

    Examples:
        >>> stations, normals = np.arange(4.0), np.tile([0.0, 0.0, 1.0], (4, 1))
        >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 1, 0]])
        >>> kept(stations, points, normals, np.zeros(4, dtype=bool), chord=1e-3).tolist()
        [True, False, True, True]
    """
    keep = fixed.copy()
    keep[[0, -1]] = True
    scaled = np.hstack([points / chord, normals / NORMAL_TOLERANCE])
    ends = np.flatnonzero(keep)
    open_ = list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        share = (stations[first + 1 : last] - stations[first]) / (stations[last] - stations[first])
        off = scaled[first + 1 : last] - scaled[first] - share[:, None] * (scaled[last] - scaled[first])
        errors = np.maximum(np.sum(off[:, :3] ** 2, axis=1), np.sum(off[:, 3:] ** 2, axis=1))
        worst = int(np.argmax(errors))
        if errors[worst] > 1.0:
            middle = first + 1 + worst
            keep[middle] = True
            open_ += [(first, middle), (middle, last)]
    return keep
