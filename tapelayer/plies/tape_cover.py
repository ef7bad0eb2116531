"""Tape cover: which points of a ply tapes cover, and how far the others are from tape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.plies.course_line import CourseLine
from tapelayer.units import MM

# Lanes of a tape by which its part outside the ply is measured, in half widths to the left.
_LANES = np.linspace(-0.95, 0.95, 9)


@dataclass(frozen=True, eq=False)
class TapeCover(Frozen):
    """Points on a mould against tapes.

    Attributes:
        counts: (n,) tapes over each point.
        depths: (n,) breadth of the overlap of two tapes there, metres; 0 where fewer than two lie.
        over: (n, 2) indices of the two tapes that lie deepest over it; -1 for none.
        beside: (n,) distance to the nearest edge of a tape between its cuts, metres; 0 where covered, infinite where
            none is near.
        short: (n,) how far the cut of a course in whose breadth the point lies falls short of it, metres; infinite
            where there is none near.
        ends: (n,) 2 i for the start, 2 i + 1 for the end of that course i; -1 for none.
    """

    counts: Ints
    depths: Floats
    over: Ints
    beside: Floats
    short: Floats
    ends: Ints

    @staticmethod
    def of(lines: Sequence[CourseLine], points: Floats, normals: Floats, reach: float, slack: float) -> TapeCover:
        """Return the cover of points (n, 3) of the surface, with its unit normals (n, 3) there.

        Args:
            lines: of the courses.
            points: metres, in the plane's frame.
            normals: of the surface.
            reach: how far beside a tape a point may lie, metres; the lines go on as far beyond their cuts.
            slack: how far a point beyond a cut still counts as covered, metres.
        """
        count = len(points)
        counts, over = np.zeros(count, dtype=np.int64), np.full((count, 2), -1)
        deepest, depths = np.full((count, 2), -np.inf), np.zeros(count)
        beside, short, ends = np.full(count, np.inf), np.full(count, np.inf), np.full(count, -1)
        tree = shapely.STRtree(shapely.points(points[:, :2]))
        for number, line in enumerate(lines):
            # Steep ground shortens distances in plan, never lengthens them.
            near = shapely.linestrings(line.points[:, :2]).buffer(line.half_width + reach)
            rows = np.sort(tree.query(near, predicate="contains"))
            if not len(rows):
                continue
            arcs, lefts, _ = line.coordinates(points[rows], normals[rows])
            aside, beyond = line.outside(arcs, lefts)
            within = (arcs > line.arcs[0]) & (arcs < line.arcs[-1])
            covered = rows[(aside <= 0.0) & (beyond <= slack)]
            counts[covered] += 1
            depth = -aside[(aside <= 0.0) & (beyond <= slack)]
            first = depth > deepest[covered, 0]
            second = ~first & (depth > deepest[covered, 1])
            moved = covered[first]
            deepest[moved, 1], over[moved, 1] = deepest[moved, 0], over[moved, 0]
            deepest[moved, 0], over[moved, 0] = depth[first], number
            deepest[covered[second], 1], over[covered[second], 1] = depth[second], number
            between = beyond <= slack
            beside[rows[between]] = np.minimum(beside[rows[between]], np.maximum(aside[between], 0.0))
            lacking = (aside <= 0.0) & ~between & within & (beyond < short[rows])
            short[rows[lacking]] = beyond[lacking]
            ends[rows[lacking]] = 2 * number + (arcs[lacking] > line.length / 2)
        twice = counts > 1
        depths[twice] = deepest[twice].sum(axis=1)
        return TapeCover(counts, depths, over, beside, short, ends)


@dataclass(frozen=True)
class Overhang:
    """What of a tape lies outside the ply.

    Attributes:
        area: of the tape, m^2.
        outside: of that the part outside the ply, m^2.
        laid_through: longest interruption of the ply within the tape, over its whole width, metres.
        sample: index of the line's sample in its middle.
    """

    area: float
    outside: float
    laid_through: float
    sample: int


def overhang(line: CourseLine, outline: Polygon) -> Overhang:
    """Return what of a tape lies outside the outline of the ply in plan, by samples of its breadth."""
    lanes = _LANES * line.half_width
    lefts = np.broadcast_to(lanes, (len(line.arcs), len(lanes)))
    arcs = np.broadcast_to(line.arcs[:, None], lefts.shape)
    places = line.points[:, None] + lefts[..., None] * line.lefts[:, None]
    inside = shapely.contains_xy(outline, places[..., :2].reshape(-1, 2)).reshape(lefts.shape)
    taped = line.outside(arcs.ravel(), lefts.ravel())[1].reshape(lefts.shape) <= 0.0
    area = 2 * line.half_width * line.length
    share = np.sum(taped & ~inside) / max(np.sum(taped), 1)
    longest, sample = 0.0, 0
    crossed = np.flatnonzero(np.any(taped & inside, axis=1))
    for one, other in zip(crossed[:-1].tolist(), crossed[1:].tolist(), strict=True):
        if other > one + 1 and line.arcs[other] - line.arcs[one] > longest:
            longest, sample = float(line.arcs[other] - line.arcs[one]), (one + other) // 2
    return Overhang(area, float(area * share), longest, sample)


def boundary_points(target: Polygon, step: float = 2 * MM) -> Floats:
    """Return points (n, 2) along the loops of a target in plan, at most a step apart, metres.

    Examples:
        >>> len(boundary_points(shapely.box(0.0, 0.0, 1.0, 1.0), step=0.25))
        17
    """
    loops = [loop for part in getattr(target, "geoms", [target]) for loop in (part.exterior, *part.interiors)]
    return np.concatenate([shapely.get_coordinates(shapely.segmentize(loop, step)) for loop in loops])
