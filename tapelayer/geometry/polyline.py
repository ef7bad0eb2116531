"""Polylines: places along them, and points that they can do without."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask


def along(path: Floats, places: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Arc length (n,) of the polyline's point nearest to each point (n, 3), and the distance (n,), all in metres.

    The first is looked for on the whole polyline, the others near the way travelled since.

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
    """As `along`, on segments (n, k) of the polyline."""
    begins, ways = path[segments], path[segments + 1] - path[segments]
    away = points[:, None] - begins
    squares = np.einsum("nij,nij->ni", ways, ways)
    share = np.clip(np.einsum("nij,nij->ni", away, ways) / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
    distances = np.linalg.norm(away - share[..., None] * ways, axis=2)
    best = np.argmin(distances, axis=1)
    row = np.arange(len(points))
    chosen = segments[row, best]
    arcs = places[chosen] + share[row, best] * (places[chosen + 1] - places[chosen])
    return arcs, distances[row, best]


# A point is kept where the gun's direction would be off by more without it.
NORMAL_TOLERANCE = math.radians(0.5)


def kept(stations: Floats, points: Floats, normals: Floats, fixed: Mask, chord: float) -> Mask:
    """Vertices (n,) that remain when those are left out whose place and direction the others give well enough.

    Where the path leaves out a vertex it passes within the chord tolerance of it, and the gun's direction within
    `NORMAL_TOLERANCE` (Douglas and Peucker's choice of vertices).

    Args:
        stations: (n,) arc lengths of the vertices, metres, increasing.
        points: (n, 3) metres.
        normals: (n, 3) unit normals.
        fixed: (n,) vertices that remain anyway.
        chord: greatest distance, metres.

    Examples:
        >>> stations, normals = np.arange(4.0), np.tile([0.0, 0.0, 1.0], (4, 1))
        >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 1, 0]])
        >>> kept(stations, points, normals, np.zeros(4, dtype=bool), chord=1e-3).tolist()
        [True, False, True, True]
    """
    remain = fixed.copy()
    remain[[0, -1]] = True
    scaled = np.hstack([points / chord, normals / NORMAL_TOLERANCE])
    ends = np.flatnonzero(remain)
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
            remain[middle] = True
            open_ += [(first, middle), (middle, last)]
    return remain
