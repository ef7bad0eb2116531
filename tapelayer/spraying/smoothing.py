"""Smoothing: the direction of the gun along a section, and the creases that no single direction can serve.

A section is a polyline over arc length. Each segment runs on one facet and has its normal, or bridges a gap and has
none (NaN).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.machines.wrist import angles_between
from tapelayer.vectors import dot

# Share of the permitted deviation that smoothing may use unless the facets need more; the rest is for the wrist.
_SMOOTHING_SHARE = 0.5
# Deviation in radians that smoothing always leaves to the wrist if one direction can serve all facets nearby.
_LEFT = math.radians(1.5)
# Smallest share of the full window, at the ends of a section, where the window has only one side.
_END_SHARE = 0.25
# Rounds in which directions are turned towards their facets' normals; all but the last also turn the vicinity.
_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class Smoothed(Frozen):
    """The gun's direction along a section, and how far it is off the facets.

    Attributes:
        normals: (n, 3) unit directions at the vertices.
        deviations: (n,) larger angle to the two facet normals beside each vertex, radians.
    """

    normals: Floats
    deviations: Floats


def creases(stations: Floats, normals: Floats, vicinity: float, limit: float) -> Floats:
    """Return sorted intervals (k, 2) of arc length across which no single direction is close enough to all normals.

    Each is the shortest one possible: from the end of one facet to the start of another, at most `vicinity` long.

    Args:
        stations: (n,) arc lengths of the vertices, metres, not decreasing.
        normals: (n - 1, 3) unit normals of the segments, NaN where there is none.
        vicinity: distance in metres along the section within which facets must share a direction.
        limit: largest angle between the direction and a normal, radians.
    """
    real = np.flatnonzero(np.isfinite(normals[:, 0]))
    begins, ends, normals = stations[real], stations[real + 1], normals[real]
    widest, nearest = _pairs(begins, ends, normals, vicinity, 2 * limit)
    # Three or more normals may have no common direction though every two have one, but only if two are this far apart.
    doubtful = (nearest < 0) & (widest > 2 * math.asin(math.sin(limit) * math.sqrt(3) / 2) - 1e-12)
    for last in np.flatnonzero(doubtful):
        first = int(np.searchsorted(ends, begins[last] - vicinity))
        while first < last and enclosing(normals[first : last + 1])[1] > limit:
            nearest[last] = first
            first += 1
    before = np.maximum.accumulate(np.append(-1, nearest))[:-1]
    shortest = np.flatnonzero(nearest > before)
    return np.column_stack([ends[nearest[shortest]], begins[shortest]])


def enclosing(normals: Floats) -> tuple[Floats, float]:
    """Return the direction (3,) with the least largest angle to unit normals (m, 3) of one half space, and that angle.

    The direction is that of the shortest vector d with n d >= 1 for every n: least distance programming (Lawson and
    Hanson, Solving Least Squares Problems, 23.4).
    """
    system = np.vstack([normals.T, np.ones(len(normals))])
    target = np.array([0.0, 0.0, 0.0, 1.0])
    residual = system @ nnls(system, target)[0] - target
    direction = -np.sign(residual[3]) * residual[:3] / np.linalg.norm(residual[:3])
    return direction, float(np.max(angles_between(direction, normals)))


def smooth(stations: Floats, normals: Floats, exempt: Mask, window: float, vicinity: float, limit: float) -> Smoothed:
    """Return the gun's direction: the mean normal of a window round each vertex, turned to stay close to the facets.

    It stays within half the limit of the normals beside each vertex or, where facets within `vicinity` differ more,
    within the angle that one direction for all of them needs. Where the mean is farther off, it is turned to that
    angle and its vicinity with it, so that the gun turns before such a place and not at it.

    Args:
        stations: (n,) arc lengths of the vertices, metres, not decreasing.
        normals: (n - 1, 3) unit normals of the segments, NaN where there is none.
        exempt: (n,) vertices near a crease, where deviations are not judged.
        window: full width, metres.
        vicinity: distance in metres within which facets must share a direction, as in `creases`.
        limit: largest angle between the gun and a facet's normal, radians.
    """
    edge = np.minimum(stations - stations[0], stations[-1] - stations)
    full = np.minimum(window, np.maximum(2 * edge, _END_SHARE * window))
    means = _means(stations, normals, full)
    # At a section's end, or beside a gap, the one facet counts as both.
    ahead, behind = np.vstack([normals, normals[-1:]]), np.vstack([normals[:1], normals])
    ahead, behind = (np.where(np.isnan(one), other, one) for one, other in ((ahead, behind), (behind, ahead)))
    radii = np.where(exempt, np.inf, _radii(stations, normals, vicinity, limit))
    for last in range(_ROUNDS):
        off = np.maximum(angles_between(means, ahead), angles_between(means, behind))
        far = np.flatnonzero(off > radii)
        if not len(far):
            break
        turns = brought_near(means[far], behind[far], ahead[far], radii[far]) - means[far]
        # The vicinity turns too, less and less towards its ends.
        shares = np.maximum(1.0 - np.abs(stations[:, None] - stations[far]) / vicinity, 0.0)
        most = np.argmax(shares * np.linalg.norm(turns, axis=1), axis=1)
        if last < _ROUNDS - 1:
            means = _unit(means + shares[np.arange(len(stations)), most][:, None] * turns[most])
        else:
            means[far] += turns
    return Smoothed(means, np.maximum(angles_between(means, ahead), angles_between(means, behind)))


def brought_near(directions: Floats, first: Floats, second: Floats, limits: Floats) -> Floats:
    """Return the nearest direction (n, 3) to each one that is within the limit of both its normals, all unit (n, 3).

    For normals more than twice the limit apart, that is the direction in the middle.

    Args:
        directions: each beyond the limit of one or both of its normals.
        first: one normal of each.
        second: the other normal.
        limits: (n,) largest angles in radians.
    """
    cosine = np.clip(dot(first, second), -1.0, 1.0)[:, None]
    middle = (first + second) / np.linalg.norm(first + second, axis=1)[:, None]
    # The circles round both normals meet at a height along their sum and a distance along their cross product.
    height = np.cos(limits)[:, None] / (1.0 + cosine)
    cross = np.cross(first, second)
    square = np.sum(cross**2, axis=1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = cross * np.sqrt((1.0 - 2.0 * height**2 * (1.0 + cosine)) / square)
    candidates = np.stack(
        [
            _turned_to(directions, first, limits),
            _turned_to(directions, second, limits),
            height * (first + second) + along,
            height * (first + second) - along,
        ]
    )
    angles = np.maximum(angles_between(candidates, first), angles_between(candidates, second))
    distances = np.where(angles <= limits + 1e-9, angles_between(candidates, directions), np.inf)
    nearest = candidates[np.argmin(distances, axis=0), np.arange(len(directions))]
    chosen: Floats = np.where(np.all(np.isinf(distances), axis=0)[:, None], middle, nearest)
    return chosen


def _pairs(begins: Floats, ends: Floats, normals: Floats, vicinity: float, apart: float) -> tuple[Floats, Ints]:
    """Return each facet's widest angle (m,) to a normal nearby, and the nearest earlier facet (m,) that is apart.

    Args:
        begins: (m,) arc lengths in metres.
        ends: (m,) arc lengths in metres.
        normals: (m, 3) unit normals.
        vicinity: largest distance in metres from the end of one facet to the start of another.
        apart: angle in radians beyond which two normals are apart.

    Returns:
        Angles in radians, and indices of facets, -1 where there is none.
    """
    widest, nearest = np.zeros(len(begins)), np.full(len(begins), -1)
    for step in range(1, len(begins)):
        near = begins[step:] - ends[:-step] <= vicinity
        if not np.any(near):
            break
        angles = np.where(near, angles_between(normals[step:], normals[:-step]), 0.0)
        widest[step:] = np.maximum(widest[step:], angles)
        widest[:-step] = np.maximum(widest[:-step], angles)
        new = np.flatnonzero((angles > apart) & (nearest[step:] < 0))
        nearest[step + new] = new
    return widest, nearest


def _radii(stations: Floats, normals: Floats, vicinity: float, limit: float) -> Floats:
    """Return the largest angle (n,) of the direction at each vertex off the normals beside it, radians."""
    real = np.flatnonzero(np.isfinite(normals[:, 0]))
    halves = np.zeros(len(normals))
    halves[real] = _pairs(stations[real], stations[real + 1], normals[real], vicinity, math.inf)[0] / 2
    needed = np.maximum(np.append(halves, 0.0), np.append(0.0, halves))
    radii: Floats = np.clip(needed, _SMOOTHING_SHARE * limit, max(limit - _LEFT, _SMOOTHING_SHARE * limit))
    return radii


def _means(stations: Floats, normals: Floats, widths: Floats) -> Floats:
    """Return the unit mean (n, 3) of the normals in windows of (n,) metres round the vertices, or of the two beside."""
    real = np.nan_to_num(normals)
    total = np.vstack([np.zeros(3), np.cumsum(real * np.diff(stations)[:, None], axis=0)])
    low, high = stations - widths / 2, stations + widths / 2
    means = np.stack([np.interp(high, stations, column) - np.interp(low, stations, column) for column in total.T], 1)
    beside = np.vstack([real, np.zeros(3)]) + np.vstack([np.zeros(3), real])
    # The sum over so narrow a window is nothing but rounding.
    narrow = np.linalg.norm(means, axis=1) < 1e-9
    return _unit(np.where(narrow[:, None], beside, means))


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return unit


def _turned_to(directions: Floats, normals: Floats, limits: Floats) -> Floats:
    """Return each direction (n, 3) turned towards its normal (n, 3) until it is within its limit (n,), radians."""
    cosine = dot(directions, normals)[:, None]
    across = directions - cosine * normals
    length = np.linalg.norm(across, axis=1)[:, None]
    near = np.arctan2(length, cosine) <= limits[:, None]
    turned = np.cos(limits)[:, None] * normals + np.sin(limits)[:, None] * across / np.where(near, 1.0, length)
    nearest: Floats = np.where(near, directions, turned)
    return nearest
