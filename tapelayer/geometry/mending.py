"""Mending: faulty facets of a file are repaired and counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csgraph

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.geometry.adjacency import blocks, facet_spans, half_edges, neighbours
from tapelayer.vectors import dot

RESOLUTION = 2.0**-23  # of an STL's single-precision numbers, relative to the largest one


@dataclass(frozen=True)
class Mending:
    """The repairs to a mesh, and the faults left in it.

    Attributes:
        facets_read: facets in the file.
        bytes_ignored: bytes after the last facet of a binary file.
        degenerate_facets: facets dropped because they have a corner twice, or are thinner than the file's numbers
            resolve and have no neighbour to swap an edge with.
        dissolved_facets: facets as thin that were removed by swapping the edge they share with a neighbour.
        duplicate_facets: facets dropped because another one has the same corners.
        flipped_facets: facets whose winding was reversed to agree with their neighbours'.
        open_edges: edges of a single facet.
        nonmanifold_edges: edges of three facets or more.
        seam_edges: edges of two facets that no winding makes agree.
    """

    facets_read: int
    bytes_ignored: int = 0
    degenerate_facets: int = 0
    dissolved_facets: int = 0
    duplicate_facets: int = 0
    flipped_facets: int = 0
    open_edges: int = 0
    nonmanifold_edges: int = 0
    seam_edges: int = 0


def mended(triangles: Floats) -> tuple[Floats, Ints, Mending]:
    """Return the vertices (n, 3) and facets (k, 3) of loose triangles, with the repairs made.

    Args:
        triangles: (m, 3, 3) finite corners in metres.

    Examples:
        >>> triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        >>> vertices, facets, mending = mended(np.stack([triangle, triangle]))
        >>> facets.tolist(), mending.duplicate_facets, mending.open_edges
        ([[0, 1, 2]], 1, 3)
    """
    vertices, facets = _merged(triangles.reshape(-1, 3))
    whole = np.all(facets != np.roll(facets, 1, axis=1), axis=1)
    facets, duplicates = _without_duplicates(facets[whole], len(vertices))
    facets, flipped = _wound(facets, len(vertices))
    facets, dissolved, thin = _without_thin(vertices, facets)
    if dissolved or thin:
        # The swaps changed which facets meet.
        facets, doubled = _without_duplicates(facets, len(vertices))
        facets, turned = _wound(facets, len(vertices))
        duplicates, flipped = duplicates + doubled, flipped + turned
    used, facets = np.unique(facets, return_inverse=True)
    facets = facets.reshape(-1, 3)
    sizes, forward = _edge_sizes(facets, len(used))
    mending = Mending(
        facets_read=len(triangles),
        degenerate_facets=int(np.sum(~whole)) + thin,
        dissolved_facets=dissolved,
        duplicate_facets=duplicates,
        flipped_facets=flipped,
        open_edges=int(np.sum(sizes == 1)),
        nonmanifold_edges=int(np.sum(sizes > 2)),
        seam_edges=int(np.sum((sizes == 2) & (forward != 1))),
    )
    return vertices[used], facets, mending


def _edge_sizes(facets: Ints, vertex_count: int) -> tuple[Ints, Ints]:
    """Count the facets at each edge (e,), and those of them that run forward (e,)."""
    _, first, forward = half_edges(facets, vertex_count)
    begins = np.flatnonzero(first)
    return np.diff(begins), np.diff(np.concatenate([[0], np.cumsum(forward)])[begins])


def _merged(corners: Floats) -> tuple[Floats, Ints]:
    """Return the distinct corners (n, 3) in order of appearance, and facets (m, 3) of their indices."""
    order = np.lexsort(corners.T)
    ranked = corners[order]
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = np.any(ranked[1:] != ranked[:-1], axis=1)
    appeared = order[new]
    number = np.empty(len(appeared), dtype=np.int64)
    number[np.argsort(appeared)] = np.arange(len(appeared))
    facets = np.empty(len(order), dtype=np.int64)
    facets[order] = number[np.cumsum(new) - 1]
    return corners[np.sort(appeared)], facets.reshape(-1, 3)


def _without_duplicates(facets: Ints, vertex_count: int) -> tuple[Ints, int]:
    """Return the first facet on each three vertices, and the number of others dropped."""
    low, middle, high = np.sort(facets, axis=1).T
    pair = low * vertex_count + middle
    order = np.lexsort((high, pair))
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = (np.diff(pair[order]) != 0) | (np.diff(high[order]) != 0)
    return facets[np.sort(order[new])], int(np.sum(~new))


def _wound(facets: Ints, vertex_count: int) -> tuple[Ints, int]:
    """Return facets whose winding agrees across edges of two facets, and the number reversed, as few as possible.

    A graph holds each facet twice, as it is and reversed, and joins those that agree. A two-sided surface splits into
    two mirrored parts, of which the one with more facets as they are is kept. A one-sided surface stays as it is.
    """
    order, first, forward = half_edges(facets, vertex_count)
    two = np.flatnonzero(first[:-2] & ~first[1:-1] & first[2:])
    turned = forward[two] == forward[two + 1]
    if not np.any(turned):
        return facets, 0
    count = len(facets)
    one, other = order[two] // 3, order[two + 1] // 3
    begin = np.concatenate([one, one + count])
    end = np.concatenate([other + count * turned, other + count * ~turned])
    graph = coo_array((np.ones(len(begin), dtype=np.int8), (begin, end)), shape=(2 * count, 2 * count))
    _, labels = csgraph.connected_components(graph, directed=False)
    stays, turns = labels[:count], labels[count:]
    votes = np.bincount(stays, minlength=len(labels))
    flip = (votes[turns] > votes[stays]) | ((votes[turns] == votes[stays]) & (turns < stays))
    return np.where(flip[:, None], facets[:, ::-1], facets), int(np.sum(flip))


def _without_thin(vertices: Floats, facets: Ints) -> tuple[Ints, int, int]:
    """Return facets without thin ones, the number of these dissolved, which leaves no crack, and the number dropped.

    A thin facet A B C has C on its longest edge A B; with the neighbour B A D it becomes C A D and D B C.
    """
    dissolved = 0
    thin = _thin(vertices, facets)
    while np.any(thin):
        where = np.flatnonzero(thin)
        longest = np.argmax(_squared_sides(vertices, facets[where]), axis=0)
        # Each facet takes part in only one swap at a time.
        neighbour, chosen = np.unique(neighbours(facets, len(vertices))[where, longest], return_index=True)
        free = (neighbour >= 0) & ~thin[neighbour]
        neighbour, where, longest = neighbour[free], where[chosen][free], longest[chosen][free]
        a, b, c = (facets[where, (longest + corner) % 3] for corner in range(3))
        d = np.sum(facets[neighbour], axis=1) - a - b
        one, other = np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)
        good = ~_thin(vertices, one) & ~_thin(vertices, other)
        if not np.any(good):
            break
        facets = facets.copy()
        facets[where[good]], facets[neighbour[good]] = one[good], other[good]
        thin[where[good]] = False
        dissolved += int(np.sum(good))
    return facets[~thin], dissolved, int(np.sum(thin))


def _thin(vertices: Floats, facets: Ints) -> Mask:
    """Return whether each facet (m,) is thinner than the file's numbers resolve, so that its normal is arbitrary."""
    least = RESOLUTION * np.max(np.abs(vertices))
    broad = np.empty(len(facets), dtype=np.bool_)
    for block in blocks(len(facets)):
        longest = np.max(_squared_sides(vertices, facets[block]), axis=0)
        spans = facet_spans(vertices, facets[block])
        broad[block] = dot(spans, spans) > least**2 * longest
    return ~broad


def _squared_sides(vertices: Floats, facets: Ints) -> Floats:
    """Return the squared lengths (3, m) of the edges from each corner to the next, in square metres."""
    a, b, c = (vertices[facets[:, corner]] for corner in range(3))
    return np.stack([dot(edge, edge) for edge in (b - a, c - b, a - c)])
