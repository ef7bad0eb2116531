"""Plan cells: what of polygons in plan lies in each cell of a square grid, as areas and centroids.

No polygon is cut. By Green's theorem the area between an edge and the left end of its row of cells is an integral along
the edge: of the cell in which the edge lies it takes a part, of the cells to the left of that the whole breadth.
"""

from __future__ import annotations

import numpy as np
import shapely

from tapelayer.arrays import Floats, Ints
from tapelayer.vectors import ramp

# A smaller share of a cell than this is rounding.
LEAST_SHARE = 1e-12


def cells_within(polygons: Floats, lower: Floats, size: float) -> tuple[Floats, Floats]:
    """Return the areas (m,) and the centroids (m, 2) of what lies of each polygon in each cell that it meets.

    Args:
        polygons: (k,) valid polygons in plan, metres; what they share counts for each.
        lower: a corner (2,) of the grid, metres, with no polygon to its left or below.
        size: of a cell, metres.

    Examples:
        >>> areas, centroids = cells_within(np.array([shapely.box(0.0, 0.0, 3.0, 1.0)]), np.zeros(2), 2.0)
        >>> areas.tolist(), centroids.tolist()
        ([1.0, 2.0], [[2.5, 0.5], [1.0, 0.5]])
    """
    parts, begins, ends, signs = _edges(polygons, lower, size)
    cells = np.floor((begins + ends) / 2.0).astype(np.int64)
    (x0, y0), (x1, y1) = (begins - cells).T, (ends - cells).T
    rises = signs * (y1 - y0)
    # Of the edge's own cell: area and both moments; of each cell to its left: area and moment along y.
    integrals = rises * [
        (x0 + x1) / 2.0,
        (x0 * x0 + x0 * x1 + x1 * x1) / 6.0,
        (2.0 * (x0 * y0 + x1 * y1) + x0 * y1 + x1 * y0) / 6.0,
        np.ones(len(rises)),
        (y0 + y1) / 2.0,
    ]
    # Row by row of each polygon, from the right to the left.
    columns, rows = (int(count) + 1 for count in np.max(cells, axis=0, initial=0))
    keys = (parts * rows + cells[:, 1]) * columns + (columns - 1 - cells[:, 0])
    order = np.argsort(keys, kind="stable")
    keys, firsts = np.unique(keys[order], return_index=True)
    area, along, aside, whole, upright = np.add.reduceat(integrals[:, order], firsts, axis=1)
    row, column = keys // columns, columns - 1 - keys % columns
    # What the edges to the right of a cell bring into it; those of a row add up to nothing.
    before, moment = (np.concatenate([[0.0], np.cumsum(values)]) for values in (whole, upright))
    area, along, aside = area + before[:-1], along + before[:-1] / 2.0, aside + moment[:-1]
    kept = area > LEAST_SHARE
    shares = np.clip(np.column_stack([along, aside])[kept] / area[kept, None], 0.0, 1.0)
    partly = (np.column_stack([column, row % rows])[kept] + shares) * size + lower
    # Between two cells with edges lie cells without one, which are in the polygon or not.
    counts = np.where((row[1:] == row[:-1]) & (before[1:-1] > 0.5), column[:-1] - column[1:] - 1, 0)
    owner, number = ramp(counts)
    wholly = np.column_stack([column[owner] - 1 - number, row[owner] % rows]) + 0.5
    areas = np.concatenate([area[kept], np.ones(len(owner))]) * size**2
    return areas, np.concatenate([partly, wholly * size + lower])


def _edges(polygons: Floats, lower: Floats, size: float) -> tuple[Ints, Floats, Floats, Floats]:
    """Return the edges of polygons, cut at the lines of the grid, with lengths in cells.

    Returns:
        Polygons (n,), begins (n, 2), ends (n, 2), and signs (n,): 1 where the polygon is on the left, -1 on the right.
    """
    rings, parts = shapely.get_rings(polygons, return_index=True)
    outer = np.diff(parts, prepend=-1) > 0
    signs = np.where(shapely.is_ccw(rings) == outer, 1.0, -1.0)
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    corners = (corners - lower) / size
    edges = np.flatnonzero(ring[1:] == ring[:-1])
    begins, ends, ring = corners[edges], corners[edges + 1], ring[edges]
    every = np.arange(len(edges))
    cuts, shares = [every, every], [np.zeros(len(edges)), np.ones(len(edges))]
    for axis in (0, 1):
        one, other = begins[:, axis], ends[:, axis]
        first = np.floor(np.minimum(one, other)) + 1.0
        counts = np.maximum(np.ceil(np.maximum(one, other)) - first, 0.0).astype(np.int64)
        owner, number = ramp(counts)
        cuts.append(owner)
        shares.append((first[owner] + number - one[owner]) / (other[owner] - one[owner]))
    cut, share = np.concatenate(cuts), np.concatenate(shares)
    order = np.lexsort((share, cut))
    cut, share = cut[order], share[order, None]
    # Exact at both ends.
    points = begins[cut] * (1.0 - share) + ends[cut] * share
    kept = np.flatnonzero(cut[1:] == cut[:-1])
    owner = ring[cut[kept]]
    return parts[owner], points[kept], points[kept + 1], signs[owner]
