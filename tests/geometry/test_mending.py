"""Mending: faults that are mended, counted, and leave the surface where it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.adjacency import neighbours
from tapelayer.geometry.mending import Mending, mended
from tapelayer.geometry.models import read_mesh
from tests.helpers.parts import DIRTY, DUPLICATES, SLIVERS, real_parts
from tests.helpers.stl_files import TETRAHEDRON


def as_set(triangles):
    """Triangles as a set, whatever the order of facets, the corner they begin with, and the winding."""
    return {tuple(sorted(map(tuple, corners))) for corners in triangles.tolist()}


@pytest.mark.parametrize("name", DIRTY)
def test_dirty_parts_are_mended_and_the_surface_stays(part, name):
    path = part(name)
    mesh, other = read_mesh(path), trimesh.load_mesh(path, process=False)
    mending = mesh.mending
    dropped = mending.degenerate_facets + mending.duplicate_facets
    assert len(mesh.facets) == mending.facets_read - dropped == len(other.faces) - dropped
    before = as_set(np.float64(other.triangles) * 1e-3)
    after = as_set(mesh.vertices[mesh.facets])
    # A dissolved facet takes its neighbour along.
    assert len(after - before) <= 2 * mending.dissolved_facets
    assert len(after & before) >= len(before) - mending.degenerate_facets - 2 * mending.dissolved_facets
    unique = [np.array(corners) for corners in before]
    area = sum(float(np.linalg.norm(np.cross(b - a, c - a))) / 2 for a, b, c in unique)
    assert float(np.sum(mesh.areas)) == pytest.approx(area, rel=1e-6)
    assert mending.seam_edges == 0
    one, two = np.nonzero(mesh.neighbours >= 0)
    assert np.array_equal(runs_of(mesh.facets, one, two), np.ones(len(one), dtype=bool))


@pytest.mark.parametrize(
    ("name", "facets", "duplicates", "nonmanifold"),
    [("aircraft", 4467, DUPLICATES, 128), *((name, 15576, 51, 260) for name in real_parts("yf23_2m"))],
)
def test_the_dirty_aircraft_is_reported_as_it_is(part, name, facets, duplicates, nonmanifold):
    mending = read_mesh(part(name)).mending
    assert (mending.facets_read, mending.duplicate_facets) == (facets, duplicates)
    assert mending.dissolved_facets >= SLIVERS and mending.degenerate_facets == 0
    assert mending.flipped_facets > 0 and mending.nonmanifold_edges >= 0.75 * nonmanifold


@pytest.mark.parametrize("name", ["wing_wound_wrongly", *real_parts("c172_wing")])
def test_the_flipped_skin_of_the_wing_is_turned(part, name):
    path = part(name)
    mesh, other = read_mesh(path), trimesh.load_mesh(path, process=False)
    sure = other.area_faces > 1e-5 * np.max(other.area_faces)
    turned = sure & (np.einsum("ij,ij->i", mesh.normals, other.face_normals) < 0)
    assert mesh.mending.flipped_facets == np.sum(turned) > 1000


def runs_of(facets, rows, corners):
    """Whether the edge of a facet from a corner to the next is run the other way in some neighbour's facet."""
    edges = {(int(a), int(b)) for f in facets for a, b in zip(f, np.roll(f, -1), strict=True)}
    begin, end = facets[rows, corners], facets[rows, (corners + 1) % 3]
    return np.array([(int(b), int(a)) in edges for a, b in zip(begin, end, strict=True)])


@given(st.sets(st.integers(0, 79), max_size=80), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_winding_is_made_consistent_with_the_fewest_turns(turned, seed):
    ball = trimesh.creation.icosphere(subdivisions=1).triangles.copy()
    rows = sorted(turned)
    ball[rows] = ball[rows, ::-1]
    ball = np.random.default_rng(seed).permutation(ball)
    vertices, facets, mending = mended(ball)
    assert mending == Mending(facets_read=80, flipped_facets=min(len(turned), 80 - len(turned)))
    assert np.all(neighbours(facets, len(vertices)) >= 0)
    assert as_set(vertices[facets]) == as_set(ball)
    volume = np.sum(np.linalg.det(vertices[facets])) / 6
    expected = trimesh.creation.icosphere(subdivisions=1).volume
    assert abs(volume) == pytest.approx(expected, rel=1e-12)


def test_a_surface_with_one_side_keeps_its_facets_and_a_seam():
    turns = np.linspace(0, np.pi, 25)
    middle = np.stack([np.cos(2 * turns), np.sin(2 * turns), 0 * turns], axis=1)
    arm = np.stack([np.cos(turns) * np.cos(2 * turns), np.cos(turns) * np.sin(2 * turns), np.sin(turns)], axis=1)
    upper, lower = middle + 0.3 * arm, middle - 0.3 * arm
    upper[-1], lower[-1] = lower[0], upper[0]
    strip = [(upper[i], lower[i], upper[i + 1]) for i in range(24)] + [
        (lower[i], lower[i + 1], upper[i + 1]) for i in range(24)
    ]
    _, facets, mending = mended(np.array(strip))
    assert len(facets) == 48
    assert mending.seam_edges >= 1 and mending.flipped_facets == 0 and mending.open_edges == 48


def test_equal_corners_are_one_vertex_in_order_of_appearance():
    triangles = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [-0.0, 1, -0.0]]])
    vertices, facets, _ = mended(triangles)
    np.testing.assert_array_equal(vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    np.testing.assert_array_equal(facets, [[0, 1, 2], [1, 3, 2]])


def test_duplicates_are_dropped_whatever_their_winding():
    doubled = np.concatenate([TETRAHEDRON, TETRAHEDRON[:2, ::-1], np.roll(TETRAHEDRON[3:], 1, axis=1)])
    vertices, facets, mending = mended(doubled)
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=7, duplicate_facets=3)


def test_facets_with_a_corner_twice_are_dropped():
    spoiled = np.concatenate([TETRAHEDRON, TETRAHEDRON[:1, [0, 0, 1]], TETRAHEDRON[1:2, [2, 2, 2]]])
    vertices, facets, mending = mended(spoiled)
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=6, degenerate_facets=2)


@pytest.mark.parametrize("share", [0.5, 0.25, 1e-3])
def test_a_thin_facet_on_an_edge_is_dissolved_and_the_solid_stays_closed(share):
    a, b, c, d = TETRAHEDRON[0][[0, 2, 1]][[0, 1, 2]].tolist() + [TETRAHEDRON[1][2].tolist()]
    a, b, c, d = (np.array(corner) for corner in (a, b, c, d))
    on = a + share * (b - a)
    # Facet a c b is cut at a point on its edge a b, facet a b d is not: between them lies a facet without area.
    solid = np.array([[a, c, on], [on, c, b], [a, on, b], [a, b, d], [b, c, d], [a, d, c]])
    vertices, facets, mending = mended(solid)
    assert mending == Mending(facets_read=6, dissolved_facets=1)
    assert np.all(neighbours(facets, len(vertices)) >= 0)
    assert np.sum(np.linalg.det(vertices[facets])) / 6 == pytest.approx(60 * 70 * 80 / 6, rel=1e-12)
    assert np.all(trimesh.triangles.area(vertices[facets]) > 0.5)


def test_a_thin_facet_without_neighbour_is_dropped():
    loose = np.array([[[500.0, 0, 0], [600, 0, 0], [550, 1e-6, 0]]])
    vertices, facets, mending = mended(np.concatenate([TETRAHEDRON, loose]))
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=5, degenerate_facets=1)


def test_nothing_left_is_nothing():
    vertices, facets, mending = mended(TETRAHEDRON * 0)
    assert vertices.shape == facets.shape == (0, 3)
    assert mending == Mending(facets_read=4, degenerate_facets=4)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_the_facets_that_are_counted_add_up(seed):
    random = np.random.default_rng(seed)
    lattice = random.integers(0, 4, (60, 3)).astype(np.float64)
    triangles = lattice[random.integers(0, 60, (40, 3))]
    vertices, facets, mending = mended(triangles)
    assert mending.facets_read - mending.degenerate_facets - mending.duplicate_facets == len(facets)
    assert np.array_equal(np.unique(facets), np.arange(len(vertices)))
    assert len({tuple(sorted(facet)) for facet in facets.tolist()}) == len(facets)
    again = mended(vertices[facets])
    np.testing.assert_array_equal(again[0][again[1]], vertices[facets])
    assert again[2] == dataclasses.replace(
        mending, facets_read=len(facets), degenerate_facets=0, dissolved_facets=0, duplicate_facets=0, flipped_facets=0
    )
