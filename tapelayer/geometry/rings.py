"""Rings: the closed lines along which a mesh ends."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, depth_first_order

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.mesh import Mesh

# A mesh with more rings than this is torn everywhere; the longest are told.
MOST_RINGS = 100


def rings(mesh: Mesh) -> list[Floats]:
    """Return the vertices (n, 3) of each ring of edges without a facet across, in metres, the longest ring first.

    A ring runs as its facets do, and its first vertex is not repeated.

    Args:
        mesh: the mesh; of more than `MOST_RINGS` rings the longest are returned.

    Examples:
        >>> from tapelayer.geometry.mending import mended
        >>> corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
        >>> [ring.tolist() for ring in rings(Mesh(*mended(corners)[:2], "a.stl", "", "m", mended(corners)[2]))]
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    facets, corners = np.nonzero(mesh.neighbours < 0)
    begins, ends = mesh.facets[facets, corners], mesh.facets[facets, (corners + 1) % 3]
    if not len(begins):
        return []
    after = _followers(begins, ends)
    linked = after >= 0
    graph = coo_array((np.ones(linked.sum()), (np.flatnonzero(linked), after[linked])), shape=(len(after), len(after)))
    count, labels = connected_components(graph, directed=False)
    lengths = np.bincount(labels, np.linalg.norm(mesh.vertices[ends] - mesh.vertices[begins], axis=1), count)
    graph = graph.tocsr()
    # Half-edges of a chain that is not closed are ordered from the one that follows none.
    heads = np.ones(len(after), dtype=np.bool_)
    heads[after[linked]] = False
    starts = np.zeros(count, dtype=np.int64)
    starts[labels[::-1]] = np.arange(len(after))[::-1]
    starts[labels[heads]] = np.flatnonzero(heads)
    longest = np.argsort(-lengths, kind="stable")[:MOST_RINGS]
    orders = [depth_first_order(graph, starts[label], return_predecessors=False) for label in longest]
    return [mesh.vertices[begins[order]] for order in orders]


def _followers(begins: Ints, ends: Ints) -> Ints:
    """Return the edge (n,) that begins where each edge ends, each edge once; -1 where none is left.

    Args:
        begins: (n,) vertex at which each edge begins.
        ends: (n,) vertex at which each edge ends.
    """
    arriving, leaving = np.argsort(ends, kind="stable"), np.argsort(begins, kind="stable")
    # The k-th edge that arrives at a vertex is followed by the k-th that leaves it.
    first = np.searchsorted(begins[leaving], ends[arriving])
    rank = np.arange(len(ends)) - np.searchsorted(ends[arriving], ends[arriving])
    there = rank < np.searchsorted(begins[leaving], ends[arriving], side="right") - first
    after = np.full(len(ends), -1, dtype=np.int64)
    after[arriving[there]] = leaving[(first + rank)[there]]
    return after
