"""Adjacency: which facets share an edge, and which lie near each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from tapelayer.arrays import Floats, Ints, Mask

BLOCK = 16384  # rows


def blocks(count: int) -> Iterator[slice]:
    """Consecutive rows, block by block; what is computed of one at a time stays in the cache.

    Examples:
        >>> list(blocks(20_000))
        [slice(0, 16384, None), slice(16384, 20000, None)]
    """
    for begin in range(0, count, BLOCK):
        yield slice(begin, min(begin + BLOCK, count))


def neighbours(facets: Ints, vertex_count: int) -> NDArray[np.int32]:
    """Facet (m, 3) across the edge from each corner to the next, or -1 where there is none.

    Neighbours run along their edge in opposite directions. Where more than two facets meet, the last of one direction
    and the first of the other in facet order are neighbours, then the next two outwards; what is left over has none.

    Args:
        facets: (m, 3) vertex indices, no vertex twice in a facet.
        vertex_count: number of vertices.

    Examples:
        >>> facets = np.array([[0, 1, 2], [0, 2, 3]])  # a square of two facets
        >>> neighbours(facets, 4).tolist()
        [[-1, -1, 1], [0, -1, -1]]
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
    """Half-edges (h,) by edge, direction and facet; where the next edge begins (h + 1,); which run forward (h,).

    Half-edge 3 f + c runs from corner c of facet f to the next; forward is from the lower vertex to the higher.

    Examples:
        >>> facets = np.array([[0, 1, 2], [0, 2, 3]])  # a square of two facets
        >>> order, first, forward = half_edges(facets, 4)
        >>> order.tolist(), forward.tolist()
        ([0, 3, 2, 5, 1, 4], [True, True, False, False, True, True])
    """
    narrow = facets.astype(np.int32)  # half the memory to move; a mesh that does not fit would not fit anywhere
    begin, end = narrow.ravel(), np.roll(narrow, -1, axis=1).ravel()
    low, high, forward = np.minimum(begin, end), np.maximum(begin, end), begin < end
    order = _counting_order(2 * high + ~forward, 2 * vertex_count)
    order = order.take(_counting_order(low.take(order), vertex_count))
    low, high = low.take(order), high.take(order)
    first = np.ones(len(order) + 1, dtype=np.bool_)
    first[1:-1] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    return order, first, forward.take(order)


def _counting_order(keys: NDArray[np.int32], key_count: int) -> NDArray[np.int32]:
    """Stable order of integer keys by counting, which is what SciPy's row compression does: no comparison sort."""
    entries = np.arange(len(keys), dtype=np.int32)
    table = coo_array((np.ones(len(keys), dtype=np.int8), (keys, entries)), shape=(key_count, len(keys)))
    order: NDArray[np.int32] = table.tocsr().indices
    return order


def facet_spans(vertices: Floats, facets: Ints) -> Floats:
    """Cross products (m, 3) of two edges of each facet: along its normal, twice its area long, in square metres.

    Examples:
        >>> vertices = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
        >>> facet_spans(vertices, np.array([[0, 1, 2]])).tolist()
        [[0.0, 0.0, 6.0]]
    """
    a, b, c = (vertices[facets[:, corner]] for corner in range(3))
    spans: Floats = np.cross(b - a, c - a)
    return spans


def squared_lengths(vectors: Floats) -> Floats:
    """Squared lengths (m,) of vectors (m, 3).

    Examples:
        >>> squared_lengths(np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]])).tolist()
        [25.0, 0.0]
    """
    squares: Floats = np.einsum("ij,ij->i", vectors, vectors)
    return squares
