"""Gap profiles: the gaps and overlaps between facing edges of courses, from the course file alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.plies.course_line import CourseLine
from tapelayer.units import MM
from tapelayer.vectors import dot, norms

# How far away a neighbour's centre line is looked for, in widths: across the place of a course that is missing.
_REACH = 2.2
# Edges face each other as far as their cuts, and a little further, so that none looks past an edge that ends with it.
_FURTHER = 0.5 * MM
# Steeper than this to the neighbour, an edge faces nothing.
_LEAST_COSINE = 0.5


@dataclass(frozen=True, eq=False)
class GapProfiles(Frozen):
    """Gaps to the left neighbours of courses, where both edges and the middle of the gap lie in the ply.

    Attributes:
        rights: (n,) index of the course on the right of the gap, seen along the ply's direction.
        lefts: (n,) index of its neighbour.
        gaps: (n,) metres from edge to facing edge; negative where they overlap.
        points: (n, 3) middles of the gaps, metres.
    """

    rights: Ints
    lefts: Ints
    gaps: Floats
    points: Floats

    @property
    def pairs(self) -> Ints:
        """Return the pairs (m, 2) of right and left neighbours, each once."""
        pairs: Ints = np.unique(np.stack([self.rights, self.lefts], axis=1), axis=0)
        return pairs

    @staticmethod
    def of(lines: Sequence[CourseLine], ways: Floats, outline: Polygon) -> GapProfiles:
        """Return the gaps of all courses.

        Args:
            lines: of the courses, in the plane's frame.
            ways: (n,) 1 for a course laid in the ply's direction, -1 against it.
            outline: of the ply in plan, metres.
        """
        paths = [shapely.linestrings(line.points[:, :2]) for line in lines]
        reach = _REACH * 2 * lines[0].half_width
        asked, found = shapely.STRtree(paths).query(paths, predicate="dwithin", distance=reach)
        parts = []
        for right in range(len(lines)):
            others = [other for other in found[asked == right].tolist() if other != right]
            parts.append(_to_the_left(lines, right, others, float(ways[right]), reach))
        rights, near, gaps, points, edges = (np.concatenate(column) for column in zip(*parts, strict=True))
        # Both edges and the middle lie in the ply.
        inside = shapely.contains_xy(outline, points[:, :2])
        for edge in (0, 1):
            inside &= shapely.contains_xy(outline, edges[:, edge, :2])
        return GapProfiles(rights[inside], near[inside], gaps[inside], points[inside])


def _to_the_left(
    lines: Sequence[CourseLine], right: int, others: Sequence[int], way: float, reach: float
) -> tuple[Ints, Ints, Floats, Floats, Floats]:
    """Return the gaps of a course to the nearest of others on its left, as the columns of `GapProfiles`, and the edges.

    The edges (n, 2, 3) are about those of the course and of its neighbour where they face each other.
    """
    line = lines[right]
    half = line.half_width
    nearest = np.full(len(line.arcs), reach)
    lefts, gaps, middles = np.full(len(line.arcs), -1), np.full(len(line.arcs), np.nan), np.zeros((len(line.arcs), 3))
    edges = np.zeros((len(line.arcs), 2, 3))
    # The edge that faces the neighbour ends at the cuts there.
    faces = line.outside(line.arcs, np.full(len(line.arcs), way * half))[1] <= _FURTHER
    for other in others:
        facing = lines[other]
        arcs, distances, samples = facing.coordinates(line.points, line.normals)
        towards = facing.points[samples] - line.points
        towards = towards + (arcs - facing.arcs[samples])[:, None] * facing.tangents[samples]
        lengths = norms(towards)
        aside = way * dot(towards, line.lefts) >= 0.0
        sines = dot(towards, line.tangents) / np.maximum(lengths, MM)
        cosines = np.sqrt(np.maximum(1.0 - sines**2, 0.0))
        within = facing.outside(arcs, np.copysign(half, distances))[1] <= _FURTHER
        near = np.abs(distances)
        taken = np.flatnonzero(faces & aside & within & (cosines > _LEAST_COSINE) & (near < nearest))
        nearest[taken], lefts[taken] = near[taken], other
        gaps[taken] = near[taken] - half - half / cosines[taken]
        middles[taken] = line.points[taken] + towards[taken] / 2
        step = half * towards[taken] / np.maximum(lengths[taken], half)[:, None]
        edges[taken] = np.stack([line.points[taken] + step, line.points[taken] + towards[taken] - step], axis=1)
    met = np.flatnonzero(lefts >= 0)
    return np.full(len(met), right), lefts[met], gaps[met], middles[met], edges[met]
