"""Cut lines: where a strip is cut so that it covers the ply and wastes least, within the angles that a head can cut."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from tapelayer.arrays import Floats
from tapelayer.units import MM

# Offsets this close together cost the same tape, metres.
SAME_COST = 1e-6 * MM
# What a squarer cut may cost, metres for a slope of 1.
SQUARENESS = 1e-6


@dataclass(frozen=True)
class CutLine:
    """A straight cut in strip coordinates: s = offset + slope v.

    Attributes:
        offset: metres along the centre line, where it is cut.
        slope: metres along per metre across, to the left.
    """

    offset: float
    slope: float

    @property
    def angle(self) -> float:
        """Angle from the direction of travel towards the left, radians, between 0 and pi.

        Examples:
            >>> round(math.degrees(CutLine(0.0, 1.0).angle), 6), round(math.degrees(CutLine(0.0, -1.0).angle), 6)
            (45.0, 135.0)
        """
        return math.atan2(1.0, self.slope)

    def at(self, across: float) -> float:
        """Return the arc length in metres at a distance across in metres."""
        return self.offset + self.slope * across


def start_cut(arcs: Floats, across: Floats, steepest: float) -> CutLine:
    """Return the start cut that leaves all points beyond it and costs the least tape.

    The tape before a line costs the width times its offset, so the offset is to be greatest: the concave function
    c(m) = min(s - m v) has its maximum at an edge of the points' hull, or where the slope is at its limit. Of equal
    costs the squarest is taken.

    Args:
        arcs: (n,) strip coordinates along, metres.
        across: (n,) strip coordinates across, metres.
        steepest: greatest slope either way.

    Examples:
        >>> start_cut(np.array([0.0, 0.25, 0.5]), np.array([-0.125, 0.125, 0.0]), 3.7)
        CutLine(offset=0.125, slope=1.0)
    """
    arcs, across = _hull(arcs, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.diff(arcs) / np.diff(across)
    slopes = np.clip(slopes[np.isfinite(slopes)], -steepest, steepest)
    slopes = np.concatenate([[0.0, -steepest, steepest], slopes])
    offsets = np.min(arcs - slopes[:, None] * across, axis=1)
    best = np.flatnonzero(offsets >= np.max(offsets) - SAME_COST)
    chosen = best[np.argmin(np.abs(slopes[best]))]
    return CutLine(float(offsets[chosen]) + 0.0, float(slopes[chosen]) + 0.0)


def end_cut(arcs: Floats, across: Floats, steepest: float) -> CutLine:
    """Return the end cut that leaves all points before it and costs the least tape; arguments as `start_cut`.

    Examples:
        >>> end_cut(np.array([1.0, 0.75, 0.5]), np.array([-0.125, 0.125, 0.0]), 3.7)
        CutLine(offset=0.875, slope=-1.0)
    """
    mirrored = start_cut(-arcs, across, steepest)
    return CutLine(-mirrored.offset, -mirrored.slope)


def cut_pair(
    arcs: Floats, across: Floats, steepest: float, width: float, least_length: float, least_edge: float
) -> tuple[CutLine, CutLine, float]:
    """Return the start and the end cut of a course that covers all points and costs the least tape.

    Alone, each is as `start_cut` and `end_cut` say. Where these would make the course too short, or meet in the tape,
    it is lengthened at both ends alike, by as little as any two slopes allow: a linear programme.

    Args:
        arcs: (n,) strip coordinates along, metres.
        across: (n,) strip coordinates across, metres.
        steepest: greatest slope either way.
        width: of the tape, metres.
        least_length: of the centre line, metres.
        least_edge: of either edge, metres.

    Returns:
        Both cuts, and the metres that were added at either end.

    Examples:
        >>> corner = np.array([0.0, 0.004, 0.002]), np.array([0.0375, 0.0375, 0.0355])
        >>> start, end, added = cut_pair(*corner, 3.7, 0.075, 0.1, 0.001)
        >>> start.slope, end.slope, round(end.offset - start.offset, 6), round(added, 6)
        (0.0, 0.0, 0.1, 0.048)
    """
    start, end = start_cut(arcs, across, steepest), end_cut(arcs, across, steepest)
    if end.offset - start.offset >= max(least_length, abs(end.slope - start.slope) * width / 2.0 + least_edge):
        return start, end, 0.0
    arcs, across = _hull(arcs, across)
    one, none = np.ones(len(arcs)), np.zeros(len(arcs))
    # Offsets and slopes of both cuts, the length, and the sizes of both slopes, of which a little is made least, too.
    beyond = np.column_stack([one, across, none, none, none, none, none])
    before = np.column_stack([none, none, -one, -across, none, none, none])
    half = width / 2.0
    apart = [[-1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0]]
    apart += [[0.0, -side * half, 0.0, side * half, -1.0, 0.0, 0.0] for side in (-1.0, 1.0)]
    sizes = [[0.0, side, 0.0, 0.0, 0.0, -1.0, 0.0] for side in (-1.0, 1.0)]
    sizes += [[0.0, 0.0, 0.0, side, 0.0, 0.0, -1.0] for side in (-1.0, 1.0)]
    free, steep = (None, None), (-steepest, steepest)
    solved = linprog(
        [0.0, 0.0, 0.0, 0.0, 1.0, SQUARENESS, SQUARENESS],
        A_ub=np.vstack([beyond, before, apart, sizes]),
        b_ub=np.concatenate([arcs, -arcs, [0.0, -least_edge, -least_edge], np.zeros(4)]),
        bounds=[free, steep, free, steep, (least_length, None), free, free],
    )
    first, last = (float(np.clip(solved.x[index], -steepest, steepest)) + 0.0 for index in (1, 3))
    begin, finish = float(np.min(arcs - first * across)), float(np.max(arcs - last * across))
    length = max(finish - begin, least_length, abs(last - first) * half + least_edge)
    added = (length - finish + begin) / 2.0
    return CutLine(begin - added, first), CutLine(finish + added, last), added


def _hull(arcs: Floats, across: Floats) -> tuple[Floats, Floats]:
    """Return the corners (k,) and (k,) of the convex hull of points (n,) and (n,), its first one again at the end."""
    try:
        corners = ConvexHull(np.column_stack([arcs, across])).vertices
    except QhullError:
        # All on a line, or too few for a hull.
        corners = np.arange(len(arcs))
    corners = np.append(corners, corners[0])
    return arcs[corners], across[corners]
