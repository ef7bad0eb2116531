"""Neighbours over edges."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.adjacency import neighbours
from tapelayer.geometry.mending import mended


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(3, 9))
@settings(max_examples=100, deadline=None)
def test_neighbours_are_mutual_and_none_is_left_out(seed, facet_count, vertex_count):
    """Any facets on few vertices: many edges of three facets or more."""
    random = np.random.default_rng(seed)
    facets = np.array([random.permutation(vertex_count)[:3] for _ in range(facet_count)])
    across = neighbours(facets, vertex_count)
    runs = {}
    for facet, corners in enumerate(facets.tolist()):
        for corner in range(3):
            runs.setdefault((corners[corner], corners[(corner + 1) % 3]), []).append((facet, corner))
    for (begin, end), half_edges in runs.items():
        others = [facet for facet, _ in runs.get((end, begin), [])]
        found = [int(across[half_edge]) for half_edge in half_edges]
        paired = [other for other in found if other >= 0]
        assert len(paired) == min(len(half_edges), len(others))
        assert len(set(paired)) == len(paired) and set(paired) <= set(others)
        for (facet, _), other in zip(half_edges, found, strict=True):
            if other >= 0:
                back = dict(runs[end, begin])[other]
                assert across[other, back] == facet


def test_two_cubes_on_one_edge_have_neighbours_all_round():
    cube = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).triangles
    vertices, facets, mending = mended(np.concatenate([cube, cube + [1, 1, 0]]))
    assert mending.nonmanifold_edges == 1 and mending.open_edges == 0
    assert np.all(neighbours(facets, len(vertices)) >= 0)
