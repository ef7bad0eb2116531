"""Neighbours over edges."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.adjacency import BLOCK, blocks, half_edges, neighbours
from tapelayer.geometry.mending import mended
from tests.helpers.meshes import surface


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
    for (begin, end), runs_there in runs.items():
        others = [facet for facet, _ in runs.get((end, begin), [])]
        found = [int(across[half_edge]) for half_edge in runs_there]
        paired = [other for other in found if other >= 0]
        assert len(paired) == min(len(runs_there), len(others))
        assert len(set(paired)) == len(paired) and set(paired) <= set(others)
        for (facet, _), other in zip(runs_there, found, strict=True):
            if other >= 0:
                back = dict(runs[end, begin])[other]
                assert across[other, back] == facet


def test_two_cubes_on_one_edge_have_neighbours_all_round():
    cube = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).triangles
    vertices, facets, mending = mended(np.concatenate([cube, cube + [1, 1, 0]]))
    assert mending.nonmanifold_edges == 1 and mending.open_edges == 0
    assert np.all(neighbours(facets, len(vertices)) >= 0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(3, 9))
@settings(max_examples=50, deadline=None)
def test_half_edges_are_those_of_the_facets_in_order(seed, facet_count, vertex_count):
    random = np.random.default_rng(seed)
    facets = np.array([random.permutation(vertex_count)[:3] for _ in range(facet_count)])
    order, first, forward = half_edges(facets, vertex_count)
    begin, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    keys = [(min(a, b), max(a, b), a > b, row) for row, (a, b) in enumerate(zip(begin, end, strict=True))]
    assert order.tolist() == [row for *_, row in sorted(keys)]
    assert forward.tolist() == (begin < end)[order].tolist()
    edges = [key[:2] for key in sorted(keys)]
    assert first.tolist() == [True, *(a != b for a, b in pairwise(edges)), True]


@given(st.integers(0, 3), st.integers(-2, 2))
def test_blocks_are_all_rows_in_order(whole, rest):
    count = max(whole * BLOCK + rest, 0)
    parts = list(blocks(count))
    assert all(part.stop - part.start <= BLOCK for part in parts)
    assert [row for part in parts for row in (part.start, part.stop)] == sorted(
        [*(part.start for part in parts), *(part.stop for part in parts)]
    )
    assert (parts[0].start, parts[-1].stop) == (0, count) if count else not parts


def test_areas_and_normals_of_a_mesh_of_several_blocks_are_those_of_every_facet():
    ball = trimesh.creation.icosphere(subdivisions=5)
    mesh = surface(ball.vertices, ball.faces)
    assert len(mesh.facets) > BLOCK
    np.testing.assert_allclose(mesh.areas, ball.area_faces, rtol=1e-9)
    np.testing.assert_allclose(mesh.normals, ball.face_normals, atol=1e-7)
    assert np.all(mesh.upward_normals[:, 2] >= 0)
    np.testing.assert_array_equal(np.abs(mesh.upward_normals), np.abs(mesh.normals))
