"""Adjacency: which facets share an edge, and which lie near each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from tapelayer.arrays import Floats, Ints, Mask

BLOCK = 16384  # rows


def blocks(count: int) -> Iterator[slice]:
    """Yield consecutive rows block by block, so that the working data of one block stays in the cache."""
    for begin in range(0, count, BLOCK):
        yield slice(begin, min(begin + BLOCK, count))


def neighbours(facets: Ints, vertex_count: int) -> NDArray[np.int32]:
    """Return the facet (m, 3) across the edge from each corner to the next, or -1 where there is none.

    Neighbours run along their edge in opposite directions. Where more than two facets meet, the last of one direction
    and the first of the other in facet order are neighbours, then the next two outwards; the rest have none.

    Args:
        facets: (m, 3) vertex indices, no vertex twice in a facet.
        vertex_count: number of vertices.
    """
    order, first, forward = half_edges(facets, vertex_count)
    across = np.full(len(order), -1, dtype=np.int32)
    right = np.flatnonzero(~first[1:-1] & forward[:-1] & ~forward[1:]) + 1
    left = right - 1
    while len(right):
        one, other = order.take(left), order.take(right)
        across[one], across[other] = other // 3, one // 3
        more = ~(first.take(left) | first.take(right + 1))
        left, right = left[more] - 1, right[more] + 1
    return across.reshape(-1, 3)


def half_edges(facets: Ints, vertex_count: int) -> tuple[NDArray[np.int32], Mask, Mask]:
    """Return half-edges (h,) by edge, direction and facet, whether each starts an edge (h + 1,) or runs forward (h,).

    Half-edge 3 f + c runs from corner c of facet f to the next; forward means from the lower vertex to the higher.
    """
    narrow = facets.astype(np.int32)  # half the memory to move; a larger mesh would not fit in memory anyway
    begin, end = narrow.ravel(), np.roll(narrow, -1, axis=1).ravel()
    low, high, forward = np.minimum(begin, end), np.maximum(begin, end), begin < end
    order = _counting_order(2 * high + ~forward, 2 * vertex_count)
    order = order.take(_counting_order(low.take(order), vertex_count))
    low, high = low.take(order), high.take(order)
    first = np.ones(len(order) + 1, dtype=np.bool_)
    first[1:-1] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    return order, first, forward.take(order)


def _counting_order(keys: NDArray[np.int32], key_count: int) -> NDArray[np.int32]:
    """Return the stable order of integer keys by counting, as SciPy's row compression does, without comparisons."""
    entries = np.arange(len(keys), dtype=np.int32)
    table = coo_array((np.ones(len(keys), dtype=np.int8), (keys, entries)), shape=(key_count, len(keys)))
    order: NDArray[np.int32] = table.tocsr().indices
    return order


def facet_spans(vertices: Floats, facets: Ints) -> Floats:
    """Return the cross product (m, 3) of two edges of each facet: along its normal, twice its area long, in m^2."""
    a, b, c = (vertices[facets[:, corner]] for corner in range(3))
    spans: Floats = np.cross(b - a, c - a)
    return spans
