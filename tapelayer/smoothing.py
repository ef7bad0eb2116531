"""Smoothing: the direction that a gun takes along a section, creases that no direction serves, and points left out.

A section is a polyline over arc length. Each stretch from a vertex to the next runs on one facet and has its normal, or
bridges a gap and has none (NaN).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from tapelayer.arrays import Floats, Mask, frozen
from tapelayer.wrist import angles_between

# Shares of the full window that are tried; at none of it a vertex has the mean of the two normals beside it.
_WINDOWS = (1.0, 0.5, 0.25, 0.125, 0.0625, 0.0)
# Share of the permitted deviation that smoothing takes where a narrower window needs less: the rest is the wrist's.
_SMOOTHING_SHARE = 0.5
# Share of the full window that stays at the ends of a section, where it has only one side.
_END_SHARE = 0.25
# A point is kept where the gun's direction would be off by more without it.
NORMAL_TOLERANCE = math.radians(0.5)


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The gun's direction along a section.

    Attributes:
        normals: (n, 3) unit, at the vertices.
        deviations: (n,) angle to the farther of the two facet normals beside each vertex, radians.
    """

    normals: Floats
    deviations: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "normals", frozen(self.normals))
        object.__setattr__(self, "deviations", frozen(self.deviations))


def creases(stations: Floats, normals: Floats, reach: float, limit: float) -> Floats:
    """Intervals (k, 2) of arc length, in order, across which no single direction is near enough to all normals.

    Each is the shortest of its place: from the end of one facet to the beginning of another, no more than `reach` on.

    Args:
        stations: (n,) arc lengths of the vertices, metres, not decreasing.
        normals: (n - 1, 3) unit normals of the stretches, NaN where there is none.
        reach: metres along the section within which facets are looked at together.
        limit: greatest angle between the direction and a normal, radians.
    """
    real = np.flatnonzero(np.isfinite(normals[:, 0]))
    begins, ends, normals = stations[real], stations[real + 1], normals[real]
    nearest = np.full(len(real), -1)
    widest = np.zeros(len(real))
    for apart in range(1, len(real)):
        near = begins[apart:] - ends[:-apart] <= reach
        if not np.any(near):
            break
        angles = np.where(near, angles_between(normals[apart:], normals[:-apart]), 0.0)
        widest[apart:] = np.maximum(widest[apart:], angles)
        found = (angles > 2 * limit) & (nearest[apart:] < 0)
        nearest[apart:][found] = np.flatnonzero(found)
    # Three normals or more may lack a direction that every two of them have, but only where two are this far apart.
    doubtful = (nearest < 0) & (widest > 2 * math.asin(math.sin(limit) * math.sqrt(3) / 2) - 1e-12)
    for last in np.flatnonzero(doubtful):
        first = int(np.searchsorted(ends, begins[last] - reach))
        while first < last and enclosing_angle(normals[first : last + 1]) > limit:
            nearest[last] = first
            first += 1
    before = np.maximum.accumulate(np.append(-1, nearest[:-1])) if len(nearest) else nearest
    shortest = np.flatnonzero(nearest > before)
    return np.column_stack([ends[nearest[shortest]], begins[shortest]])


def enclosing_angle(normals: Floats) -> float:
    """Least angle in radians within which one direction meets all unit normals (m, 3), all of one half space.

    With d of least length such that n d >= 1 for every n, the angle is acos(1 / |d|): least distance programming
    (Lawson and Hanson, Solving Least Squares Problems, 23.4).
    """
    system = np.vstack([normals.T, np.ones(len(normals))])
    target = np.array([0.0, 0.0, 0.0, 1.0])
    residual = system @ nnls(system, target)[0] - target
    return math.atan2(
        math.sqrt(max(float(residual[:3] @ residual[:3]) - float(residual[3]) ** 2, 0.0)), abs(float(residual[3]))
    )


def smooth(stations: Floats, normals: Floats, exempt: Mask, window: float, limit: float) -> Smoothed:
    """The gun's direction: the mean normal of a window round each vertex, narrower where the facets need it.

    Args:
        stations: (n,) arc lengths of the vertices, metres, not decreasing.
        normals: (n - 1, 3) unit normals of the stretches, NaN where there is none.
        exempt: (n,) vertices near a crease, where no window is too wide.
        window: full width, metres.
        limit: greatest angle between the gun and a facet's normal, radians.
    """
    edge = np.minimum(stations - stations[0], stations[-1] - stations)
    full = np.minimum(window, np.maximum(2 * edge, _END_SHARE * window))
    candidates = [_means(stations, normals, share * full) for share in _WINDOWS]
    deviations = np.stack([_deviations(candidate, normals) for candidate in candidates])
    fits = (deviations <= _SMOOTHING_SHARE * limit) | exempt
    best = np.argmin(deviations, axis=0)
    chosen = np.where(np.any(fits, axis=0), np.argmax(fits, axis=0), best)
    widths = np.array(_WINDOWS)[chosen] * full
    # A window that grows no faster than it moves: the direction has no jumps but those of the facets.
    widths = np.minimum.accumulate(widths - 2 * stations) + 2 * stations
    widths = np.minimum.accumulate((widths + 2 * stations)[::-1])[::-1] - 2 * stations
    means = _means(stations, normals, np.maximum(widths, 0.0))
    off = _deviations(means, normals)
    worse = ~exempt & (off > _SMOOTHING_SHARE * limit) & (off > deviations[best, np.arange(len(stations))])
    means[worse] = np.stack(candidates)[best[worse], worse]
    return Smoothed(means, _deviations(means, normals))


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


def _means(stations: Floats, normals: Floats, widths: Floats) -> Floats:
    """Unit mean (n, 3) of the normals in windows of (n,) metres round the vertices; of none, of the two beside."""
    real = np.isfinite(normals[:, :1])
    weighted = np.where(real, normals, 0.0)
    total = np.zeros((len(stations), 3))
    np.cumsum(weighted * np.diff(stations)[:, None], axis=0, out=total[1:])
    low, high = stations - widths / 2, stations + widths / 2
    means = np.stack([np.interp(high, stations, column) - np.interp(low, stations, column) for column in total.T], 1)
    beside = np.vstack([weighted, np.zeros(3)]) + np.vstack([np.zeros(3), weighted])
    # So narrow a window differs by rounding alone.
    narrow = np.linalg.norm(means, axis=1) < 1e-9
    means = np.where(narrow[:, None], beside, means)
    unit: Floats = means / np.linalg.norm(means, axis=1)[:, None]
    return unit


def _deviations(means: Floats, normals: Floats) -> Floats:
    """Greater angle (n,) of each direction (n, 3) to the normals of the two stretches beside it, radians."""
    before, after = angles_between(means[1:], normals), angles_between(means[:-1], normals)
    greater: Floats = np.fmax(np.append(0.0, before), np.append(after, 0.0))
    return greater
