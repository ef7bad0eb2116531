"""Smoothing: the direction that a gun takes along a section, creases that no direction serves, and points left out.

A section is a polyline over arc length. Each stretch from a vertex to the next runs on one facet and has its normal, or
bridges a gap and has none (NaN).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.machines.wrist import angles_between
from tapelayer.vectors import dot

# Share of the permitted deviation that smoothing takes where the facets do not need more: the rest is the wrist's.
_SMOOTHING_SHARE = 0.5
# What smoothing leaves to the wrist in any case where one direction can serve all facets near by, radians.
_LEFT = math.radians(1.5)
# Share of the full window that stays at the ends of a section, where it has only one side.
_END_SHARE = 0.25
# Times that directions are brought near to their facets' normals; the surroundings go along but for the last.
_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class Smoothed(Frozen):
    """The gun's direction along a section.

    Attributes:
        normals: (n, 3) unit, at the vertices.
        deviations: (n,) angle to the farther of the two facet normals beside each vertex, radians.
    """

    normals: Floats
    deviations: Floats


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
    widest, nearest = _pairs(begins, ends, normals, reach, 2 * limit)
    # Three normals or more may lack a direction that every two of them have, but only where two are this far apart.
    doubtful = (nearest < 0) & (widest > 2 * math.asin(math.sin(limit) * math.sqrt(3) / 2) - 1e-12)
    for last in np.flatnonzero(doubtful):
        first = int(np.searchsorted(ends, begins[last] - reach))
        while first < last and enclosing(normals[first : last + 1])[1] > limit:
            nearest[last] = first
            first += 1
    before = np.maximum.accumulate(np.append(-1, nearest))[:-1]
    shortest = np.flatnonzero(nearest > before)
    return np.column_stack([ends[nearest[shortest]], begins[shortest]])


def enclosing(normals: Floats) -> tuple[Floats, float]:
    """The direction (3,) whose greatest angle to unit normals (m, 3) of one half space is least, and that angle.

    It is that of the shortest d with n d >= 1 for every n: least distance programming (Lawson and Hanson, Solving
    Least Squares Problems, 23.4).
    """
    system = np.vstack([normals.T, np.ones(len(normals))])
    target = np.array([0.0, 0.0, 0.0, 1.0])
    residual = system @ nnls(system, target)[0] - target
    direction = -np.sign(residual[3]) * residual[:3] / np.linalg.norm(residual[:3])
    return direction, float(np.max(angles_between(direction, normals)))


def smooth(stations: Floats, normals: Floats, exempt: Mask, window: float, reach: float, limit: float) -> Smoothed:
    """The gun's direction: the mean normal of a window round each vertex, as near to the facets as they let it be.

    Within half the limit of the normals beside each vertex, or, where facets within `reach` are farther apart, within
    what one direction for all of them needs. Where the mean is farther off it is brought as near, and its surroundings
    go along, so that the gun turns ahead of such a place and not at it.

    Args:
        stations: (n,) arc lengths of the vertices, metres, not decreasing.
        normals: (n - 1, 3) unit normals of the stretches, NaN where there is none.
        exempt: (n,) vertices near a crease, where no deviation counts.
        window: full width, metres.
        reach: metres within which facets are looked at together, as in `creases`.
        limit: greatest angle between the gun and a facet's normal, radians.
    """
    edge = np.minimum(stations - stations[0], stations[-1] - stations)
    full = np.minimum(window, np.maximum(2 * edge, _END_SHARE * window))
    means = _means(stations, normals, full)
    # At a section's end, or beside a gap, one facet stands for both.
    ahead, behind = np.vstack([normals, normals[-1:]]), np.vstack([normals[:1], normals])
    ahead, behind = (np.where(np.isnan(one), other, one) for one, other in ((ahead, behind), (behind, ahead)))
    radii = np.where(exempt, np.inf, _radii(stations, normals, reach, limit))
    for last in range(_ROUNDS):
        off = np.maximum(angles_between(means, ahead), angles_between(means, behind))
        far = np.flatnonzero(off > radii)
        if not len(far):
            break
        turns = brought_near(means[far], behind[far], ahead[far], radii[far]) - means[far]
        # The turn is given to the surroundings as well, less and less up to the reach.
        shares = np.maximum(1.0 - np.abs(stations[:, None] - stations[far]) / reach, 0.0)
        most = np.argmax(shares * np.linalg.norm(turns, axis=1), axis=1)
        if last < _ROUNDS - 1:
            means = _unit(means + shares[np.arange(len(stations)), most][:, None] * turns[most])
        else:
            means[far] += turns
    return Smoothed(means, np.maximum(angles_between(means, ahead), angles_between(means, behind)))


def brought_near(directions: Floats, first: Floats, second: Floats, limits: Floats) -> Floats:
    """The direction (n, 3) nearest to each one that is within the limit of both of its normals, all unit (n, 3).

    Between normals that are more than twice the limit apart, the one in the middle.

    Args:
        directions: each beyond the limit of one of its normals or of both.
        first: one normal of each.
        second: the other one.
        limits: (n,) greatest angles in radians.
    """
    cosine = np.clip(dot(first, second), -1.0, 1.0)[:, None]
    middle = (first + second) / np.linalg.norm(first + second, axis=1)[:, None]
    # Where the circles round both normals meet: height above and distance along their common great circle.
    height = np.cos(limits)[:, None] / (1.0 + cosine)
    cross = np.cross(first, second)
    square = np.sum(cross**2, axis=1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = cross * np.sqrt((1.0 - 2.0 * height**2 * (1.0 + cosine)) / square)
    found = np.stack(
        [
            _turned_to(directions, first, limits),
            _turned_to(directions, second, limits),
            height * (first + second) + along,
            height * (first + second) - along,
        ]
    )
    angles = np.maximum(angles_between(found, first), angles_between(found, second))
    ways = np.where(angles <= limits + 1e-9, angles_between(found, directions), np.inf)
    nearest = found[np.argmin(ways, axis=0), np.arange(len(directions))]
    chosen: Floats = np.where(np.all(np.isinf(ways), axis=0)[:, None], middle, nearest)
    return chosen


def _pairs(begins: Floats, ends: Floats, normals: Floats, reach: float, apart: float) -> tuple[Floats, Ints]:
    """Widest angle (m,) of each facet's normal to one within reach, and the nearest facet (m,) before it that is apart.

    Args:
        begins: (m,) arc lengths in metres.
        ends: (m,) arc lengths in metres.
        normals: (m, 3) unit normals.
        reach: metres from the end of a facet to the beginning of another.
        apart: angle in radians beyond which two normals are apart; -1 stands for no such facet.
    """
    widest, nearest = np.zeros(len(begins)), np.full(len(begins), -1)
    for step in range(1, len(begins)):
        near = begins[step:] - ends[:-step] <= reach
        if not np.any(near):
            break
        angles = np.where(near, angles_between(normals[step:], normals[:-step]), 0.0)
        widest[step:] = np.maximum(widest[step:], angles)
        widest[:-step] = np.maximum(widest[:-step], angles)
        found = np.flatnonzero((angles > apart) & (nearest[step:] < 0))
        nearest[step + found] = found
    return widest, nearest


def _radii(stations: Floats, normals: Floats, reach: float, limit: float) -> Floats:
    """Angle (n,) within which the direction at each vertex stays of the normals beside it, radians."""
    real = np.flatnonzero(np.isfinite(normals[:, 0]))
    halves = np.zeros(len(normals))
    halves[real] = _pairs(stations[real], stations[real + 1], normals[real], reach, math.inf)[0] / 2
    needed = np.maximum(np.append(halves, 0.0), np.append(0.0, halves))
    radii: Floats = np.clip(needed, _SMOOTHING_SHARE * limit, max(limit - _LEFT, _SMOOTHING_SHARE * limit))
    return radii


def _means(stations: Floats, normals: Floats, widths: Floats) -> Floats:
    """Unit mean (n, 3) of the normals in windows of (n,) metres round the vertices; of none, of the two beside."""
    real = np.nan_to_num(normals)
    total = np.vstack([np.zeros(3), np.cumsum(real * np.diff(stations)[:, None], axis=0)])
    low, high = stations - widths / 2, stations + widths / 2
    means = np.stack([np.interp(high, stations, column) - np.interp(low, stations, column) for column in total.T], 1)
    beside = np.vstack([real, np.zeros(3)]) + np.vstack([np.zeros(3), real])
    # A window this narrow differs by rounding alone.
    narrow = np.linalg.norm(means, axis=1) < 1e-9
    return _unit(np.where(narrow[:, None], beside, means))


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return unit


def _turned_to(directions: Floats, normals: Floats, limits: Floats) -> Floats:
    """Each direction (n, 3) turned towards its normal (n, 3) until it is within its limit (n,), radians."""
    cosine = dot(directions, normals)[:, None]
    across = directions - cosine * normals
    length = np.linalg.norm(across, axis=1)[:, None]
    near = np.arctan2(length, cosine) <= limits[:, None]
    turned = np.cos(limits)[:, None] * normals + np.sin(limits)[:, None] * across / np.where(near, 1.0, length)
    nearest: Floats = np.where(near, directions, turned)
    return nearest
