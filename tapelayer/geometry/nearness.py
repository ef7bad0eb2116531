"""Nearness: whether a rigid solid comes nearer to a mesh, or to another solid, than a margin.

A query at a margin costs microseconds where a distance costs milliseconds, because it stops at the first triangle that
is near enough, and passes over those that are not by their bounding boxes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.vectors import ramp

# Metres by which a query may misjudge a distance: every margin is wider by this.
UNCERTAINTY = 1e-5
# A relief has at most so many cells along a side, and at most so many in all its triangles' boxes.
_SIDE = 256
_CELLS = 4_000_000
# A patch of so few facets is not replaced unless it is flat.
_KEPT = 8

# Whether a solid with a pose (4, 4) is nearer than a margin in metres.
Query = Callable[[Floats, float], bool]


def query(solid: Any, still: Any) -> Query:
    """Return the query that tells whether a solid, with a pose in the frame of a still one, is nearer than a margin.

    It never misses a solid that is nearer, and may hit one that is farther by twice `UNCERTAINTY`.

    Args:
        solid: coal's geometry of what moves.
        still: coal's geometry of what stands still at the origin: a solid, or the triangles of a mesh.

    Examples:
        >>> near = query(coal.Sphere(0.1), coal.Box(2.0, 2.0, 2.0))
        >>> pose = np.eye(4)
        >>> pose[2, 3] = 1.3
        >>> near(pose, 0.199), near(pose, 0.201)
        (False, True)
    """
    request, result, origin = coal.CollisionRequest(), coal.CollisionResult(), coal.Transform3s()
    collide = coal.collide

    def near(pose: Floats, margin: float) -> bool:
        result.clear()
        request.security_margin = margin + UNCERTAINTY
        return bool(collide(solid, coal.Transform3s(pose[:3, :3], pose[:3, 3]), still, origin, request, result))

    return near


def triangles(vertices: Floats, facets: Ints) -> Any:
    """Return coal's geometry of the triangles of a mesh: an open sheet, which has no inside.

    Args:
        vertices: (n, 3) metres.
        facets: (m, 3) vertex indices.
    """
    sheet = coal.BVHModelOBBRSS()
    sheet.beginModel(len(facets), len(vertices))
    sheet.addVertices(np.array(vertices, dtype=np.float64))
    sheet.addTriangles(np.array(facets, dtype=np.int64))
    sheet.endModel()
    return sheet


def flattened(vertices: Floats, facets: Ints, off: float) -> tuple[Floats, Ints]:
    """Return a mesh of few triangles from which no point of a mesh is farther than `off`.

    Patches of facets are replaced by the rectangles round them in their planes, where that is near enough. Queries on
    it cost a fraction; what is clear of it by `off` more is clear of the mesh.

    Args:
        vertices: (n, 3) metres.
        facets: (m, 3) vertex indices, at least one.
        off: metres.

    Examples:
        >>> grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), [0.0]), axis=-1).reshape(-1, 3)
        >>> first = (9 * np.arange(8)[:, None] + np.arange(8)).ravel()
        >>> facets = np.concatenate([first[:, None] + [0, 1, 10], first[:, None] + [0, 10, 9]])
        >>> facets.shape, flattened(grid, facets, 1e-6)[1].shape
        ((128, 3), (2, 3))
    """
    corners, centres = vertices[facets], vertices[facets].mean(axis=1)
    kept, rectangles = [], []
    waiting = [np.arange(len(facets))]
    while waiting:
        patch = waiting.pop()
        points = corners[patch].reshape(-1, 3)
        middle = points.mean(axis=0)
        # Directions of the patch, the one across its plane last.
        ways = np.linalg.svd((points - middle).T @ (points - middle))[2]
        along = (points - middle) @ ways.T
        lower, upper = along.min(axis=0), along.max(axis=0)
        if (upper[2] - lower[2]) / 2 <= off:
            level = (lower[2] + upper[2]) / 2
            plan = [(lower[0], lower[1]), (upper[0], lower[1]), (upper[0], upper[1]), (lower[0], upper[1])]
            rectangles.append(np.array([(*corner, level) for corner in plan]) @ ways + middle)
        elif len(patch) <= _KEPT:
            kept.append(patch)
        else:
            spread = centres[patch] @ ways[0]
            halves = np.argpartition(spread, len(patch) // 2)
            waiting += [patch[halves[: len(patch) // 2]], patch[halves[len(patch) // 2 :]]]
    own = corners[np.concatenate(kept)].reshape(-1, 3) if kept else np.zeros((0, 3))
    flat = np.array(rectangles).reshape(-1, 3)
    first = len(own) + 4 * np.arange(len(rectangles))
    halved = np.concatenate([first[:, None] + [0, 1, 2], first[:, None] + [0, 2, 3]])
    return np.concatenate([own, flat]), np.concatenate([np.arange(len(own)).reshape(-1, 3), halved])


def meets_ray(vertices: Floats, facets: Ints, origin: Floats) -> bool:
    """Return whether a ray from an origin (3,) along z meets a triangle, or touches one.

    Args:
        vertices: (n, 3) in the origin's unit.
        facets: (m, 3) vertex indices.
        origin: (3,) where it begins.

    Examples:
        >>> corners, facet = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]), np.array([[0, 1, 2]])
        >>> [meets_ray(corners, facet, np.array([0.2, 0.2, z])) for z in (0.0, 2.0)]
        [True, False]
    """
    ahead = vertices - origin
    a, b, c = (ahead[facets[:, corner], :2] for corner in range(3))
    areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
    over = np.all(areas >= 0.0, axis=0) | np.all(areas <= 0.0, axis=0)
    areas, heights = areas[:, over], ahead[facets[over], 2].T
    whole = np.sum(areas, axis=0)
    # An upright triangle is met where any of it is above the origin.
    upright = whole == 0.0
    shares = np.divide(areas, whole, out=np.zeros_like(areas), where=~upright)
    return bool(
        np.any(np.where(upright, np.max(heights, axis=0, initial=-np.inf), np.sum(shares * heights, axis=0)) >= 0.0)
    )


def _cross(left: Floats, right: Floats) -> Floats:
    crossed: Floats = left[:, 0] * right[:, 1] - left[:, 1] * right[:, 0]
    return crossed


class Relief:
    """The greatest height of a mesh over rectangles in plan, of many boxes at once.

    Args:
        vertices: (n, 3) metres.
        facets: (m, 3) vertex indices, at least one.
    """

    def __init__(self, vertices: Floats, facets: Ints) -> None:
        corners = vertices[facets]
        lower, upper = corners.min(axis=1), corners.max(axis=1)
        self._lower = lower.min(axis=0)
        self._upper = upper.max(axis=0)
        extent = np.maximum(self._upper - self._lower, 1e-9)[:2]
        side = _SIDE
        while True:
            self._cell = extent / side
            first, last = self._cells(lower[:, :2], side), self._cells(upper[:, :2], side)
            counts = np.prod(last - first + 1, axis=1)
            if np.sum(counts) <= _CELLS or side == 1:
                break
            side //= 2
        owners, numbers = ramp(counts)
        breadth = (last - first)[owners, 1] + 1
        heights = np.full((side, side), -np.inf)
        rows, columns = first[owners, 0] + numbers // breadth, first[owners, 1] + numbers % breadth
        np.maximum.at(heights, (rows, columns), upper[owners, 2])
        self._side = side
        self._tables = _maxima(heights)

    def _cells(self, plan: Floats, side: int) -> Ints:
        cells: Ints = np.clip(np.floor((plan - self._lower[:2]) / self._cell), 0, side - 1).astype(np.int64)
        return cells

    def below(self, lower: Floats, upper: Floats) -> Mask:
        """Return whether (n,) the mesh is wholly below each box, or beside it in plan.

        Args:
            lower: (n, 3) least corners of the boxes, metres.
            upper: (n, 3) greatest corners.
        """
        beside = np.any((upper < self._lower)[:, :2] | (lower > self._upper)[:, :2], axis=1)
        first, last = self._cells(lower[:, :2], self._side), self._cells(upper[:, :2], self._side)
        powers = np.floor(np.log2(last - first + 1)).astype(np.int64)
        after = last - (1 << powers) + 1
        heights = np.full(len(lower), -np.inf)
        for i in (first[:, 0], after[:, 0]):
            for j in (first[:, 1], after[:, 1]):
                np.maximum(heights, self._tables[powers[:, 0], powers[:, 1], i, j], out=heights)
        clear: Mask = beside | (lower[:, 2] > heights)
        return clear


def _maxima(heights: Floats) -> Floats:
    """Return the maxima (p, p, s, s) over the rectangles of 2^a by 2^b cells that begin at each cell (s, s)."""
    side = len(heights)
    powers = side.bit_length()
    tables = np.full((powers, powers, side, side), -np.inf)
    tables[0, 0] = heights
    for a in range(powers):
        if a:
            half = 1 << (a - 1)
            tables[a, 0] = tables[a - 1, 0]
            np.maximum(tables[a, 0, :-half], tables[a - 1, 0, half:], out=tables[a, 0, :-half])
        for b in range(1, powers):
            half = 1 << (b - 1)
            tables[a, b] = tables[a, b - 1]
            np.maximum(tables[a, b, :, :-half], tables[a, b - 1, :, half:], out=tables[a, b, :, :-half])
    return tables
