from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry import envelope, slicing
from tapelayer.geometry.models import read_mesh
from tests.helpers.meshes import box, from_triangles, inside, surface
from tests.helpers.parts import CLEAN, DIRTY, real_parts

X, Y, Z = np.eye(3)


def clear_of_vertices(mesh, direction, heights, clearance=1e-8):
    """The heights, moved up until they are clear of every vertex."""
    altitudes = np.unique(mesh.vertices @ direction)
    moved = []
    for height in heights:
        while np.min(np.abs(altitudes - height)) < clearance:
            height += clearance / 3
        moved.append(height)
    return np.array(moved)


def cut_one_by_one(mesh, direction, heights):
    """Ends of every segment by facet and plane, from the definition: a corner at a height or higher is above."""
    segments = {}
    for facet, corners in enumerate(mesh.facets):
        for plane, height in enumerate(heights):
            ends = []
            for a, b in pairwise([*corners, corners[0]]):
                p, q = mesh.vertices[a], mesh.vertices[b]
                s, t = p @ direction, q @ direction
                if (s >= height) != (t >= height):
                    ends.append(p + (height - s) / (t - s) * (q - p))
            if ends:
                segments[facet, plane] = np.array(ends)
    return segments


def check_sections(sections, mesh, direction, heights):
    """Every segment once, where it belongs, in curves that go on to a neighbour and end only where there is none."""
    expected = cut_one_by_one(mesh, direction, heights)
    with_length = {key: ends for key, ends in expected.items() if np.linalg.norm(ends[1] - ends[0]) > 1e-12}
    assert np.array_equal(sections.planes, np.sort(sections.planes))
    assert len(sections.offsets) == len(sections.planes) + 1 == len(sections.closed) + 1
    assert sections.offsets[-1] == len(sections.points) == len(sections.facets)
    assert np.all(np.diff(sections.offsets) >= 2)
    found = {}
    for curve, (begin, end) in enumerate(pairwise(sections.offsets)):
        plane = int(sections.planes[curve])
        for row in range(begin, end - 1):
            key = int(sections.facets[row]), plane
            assert key not in found
            found[key] = sections.points[row : row + 2]
        assert sections.facets[end - 1] == sections.facets[end - 2]
        if sections.closed[curve]:
            assert np.array_equal(sections.points[begin], sections.points[end - 1])
    assert with_length.keys() <= found.keys() <= expected.keys()
    for (facet, plane), ends in found.items():
        down_and_up = expected[facet, plane]
        apart = [np.max(np.abs(ends - down_and_up)), np.max(np.abs(ends - down_and_up[::-1]))]
        assert min(apart) < 1e-12
        step = ends[1] - ends[0]
        if np.linalg.norm(step) > 1e-9:
            assert step @ np.cross(direction, mesh.normals[facet]) > 0
    total = sum(float(np.linalg.norm(ends[1] - ends[0])) for ends in expected.values())
    assert float(np.sum(sections.lengths)) == pytest.approx(total, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", [*CLEAN, *DIRTY])
def test_sections_are_as_long_as_trimesh_cuts_them(part, name):
    mesh = read_mesh(part(name))
    # In millimetres, for which trimesh's fixed tolerances are made.
    other = trimesh.Trimesh(mesh.vertices * 1e3, mesh.facets, process=False)
    for travel in (0.0, np.pi / 6, np.pi / 2):
        direction = slicing.plane_direction(travel)
        heights = clear_of_vertices(mesh, direction, inside(mesh, direction, 37))
        sections = slicing.slice(mesh, direction, heights)
        lines, _, _ = trimesh.intersections.mesh_multiplane(other, np.zeros(3), direction, heights * 1e3)
        for plane, cut in enumerate(lines):
            own = sections.planes[np.repeat(np.arange(len(sections.planes)), np.diff(sections.offsets) - 1)] == plane
            expected = float(np.sum(np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1))) * 1e-3
            assert float(np.sum(sections.lengths[own])) == pytest.approx(expected, rel=1e-9)


def test_closed_curves_of_500_planes_through_200_000_facets():
    latitudes, longitudes = np.meshgrid(np.arange(400), np.arange(250), indexing="ij")
    around, across = longitudes.ravel() * 2 * np.pi / 250, latitudes.ravel() * 2 * np.pi / 400
    wave = 0.3 + 0.03 * np.sin(9 * around) * np.cos(7 * across)
    ring = 1 + wave * np.cos(across)
    vertices = np.stack([ring * np.cos(around), ring * np.sin(around), wave * np.sin(across)], axis=1)
    a = (latitudes * 250 + longitudes).ravel()
    b = (latitudes * 250 + (longitudes + 1) % 250).ravel()
    c, d = ((corner + 250) % len(vertices) for corner in (a, b))
    mesh = surface(vertices, np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]))
    assert len(mesh.facets) == 200_000 and np.all(mesh.neighbours >= 0)
    direction = np.array([0.36, 0.48, 0.8])
    heights = clear_of_vertices(mesh, direction, inside(mesh, direction, 500), 1e-9)
    sections = slicing.slice(mesh, direction, heights)
    assert np.array_equal(np.unique(sections.planes), np.arange(500))
    assert np.all(sections.closed)
    first, last = sections.offsets[:-1], sections.offsets[1:] - 1
    np.testing.assert_array_equal(sections.points[first], sections.points[last])
    planes = np.repeat(sections.planes, np.diff(sections.offsets))
    np.testing.assert_allclose(sections.points @ direction, heights[planes], atol=1e-14)
    other = trimesh.Trimesh(vertices * 1e3, mesh.facets, process=False)
    lines, _, _ = trimesh.intersections.mesh_multiplane(other, np.zeros(3), direction, heights * 1e3)
    expected = sum(float(np.sum(np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1))) for cut in lines) * 1e-3
    assert float(np.sum(sections.lengths)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("direction", [X, Y, Z, np.array([0.6, 0.8, 0.0]), np.array([2.0, -1.0, 2.0]) / 3])
def test_a_sphere_is_cut_into_circles(direction):
    sphere = trimesh.creation.icosphere(subdivisions=5)
    mesh = surface(sphere.vertices, sphere.faces)
    # The distance of the farthest facet's plane: one less the sagitta, and the cosine of the angle to its corners.
    cosine = float(np.min(np.einsum("ij,ij->i", sphere.face_normals, sphere.triangles[:, 0])))
    heights = np.linspace(-0.97, 0.97, 41)
    sections = slicing.slice(mesh, direction, heights)
    assert np.array_equal(sections.planes, np.arange(41)) and np.all(sections.closed)
    np.testing.assert_allclose(sections.points @ direction, np.repeat(heights, np.diff(sections.offsets)), atol=1e-15)
    rows = sections.segments
    for points in (sections.points[rows], (sections.points[rows] + sections.points[rows + 1]) / 2):
        distances = np.linalg.norm(points, axis=1)
        assert np.all((distances <= 1 + 1e-12) & (distances >= cosine - 1e-12))
        along_normals = np.einsum("ij,ij->i", points, mesh.normals[sections.facets[rows]])
        assert np.all(along_normals >= (cosine - 1e-12) * distances)
    curves = np.repeat(np.arange(41), np.diff(sections.offsets) - 1)
    lengths = np.bincount(curves, weights=sections.lengths)
    circles = 2 * np.pi * np.sqrt(1 - heights**2)
    inner = 2 * np.pi * np.sqrt(cosine**2 - heights**2)
    assert np.all((lengths <= circles) & (lengths >= inner))


def test_planes_exactly_through_vertices_edges_and_facets():
    mesh = from_triangles(box([0, 0, 0], [1, 1, 1]))
    for direction in (X, Y, Z):
        sections = slicing.slice(mesh, direction, np.array([-1.0, 0.0, 0.25, 1.0, 2.0]))
        # The facet at 0 is above its plane, with all of the box; the facet at 1 is above its plane, the box below.
        assert sections.planes.tolist() == [2, 3]
        assert np.all(sections.closed)
        np.testing.assert_array_equal(sections.points @ direction, np.repeat([0.25, 1.0], np.diff(sections.offsets)))
        assert float(np.sum(sections.lengths)) == pytest.approx(8.0, rel=1e-15)
        check_sections(sections, mesh, direction, sections.heights)


def test_a_plane_through_four_corners_and_through_the_tips_of_an_octahedron():
    corners = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    facets = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    sections = slicing.slice(surface(corners, facets), Z, np.array([-1.0, 0.0, 1.0]))
    assert sections.planes.tolist() == [1] and sections.closed.tolist() == [True]
    np.testing.assert_array_equal(np.sort(sections.points[:-1, :2], axis=0), np.sort(corners[:4, :2], axis=0))
    assert float(np.sum(sections.lengths)) == pytest.approx(4 * np.sqrt(2))


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.sampled_from([X, Y, Z, np.array([0.6, 0.0, 0.8])]))
@settings(max_examples=80, deadline=None)
def test_any_facets_are_cut_where_they_are(seed, facet_count, direction):
    """Facets on a lattice: planes through vertices, along edges and facets, edges of many facets, mixed winding."""
    random = np.random.default_rng(seed)
    vertices = np.array(list(product(range(3), repeat=3)), dtype=np.float64)
    facets = np.array([random.permutation(27)[:3] for _ in range(facet_count)])
    a, b, c = vertices[facets.T]
    facets = facets[np.any(np.cross(b - a, c - a) != 0, axis=1)]
    mesh = surface(vertices, facets)
    heights = np.unique(np.concatenate([vertices @ direction, [0.5, 1.3]]))
    sections = slicing.slice(mesh, direction, heights)
    check_sections(sections, mesh, direction, heights)


@given(st.sets(st.tuples(*[st.integers(0, 2)] * 3), min_size=1), st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 2]))
@settings(max_examples=60, deadline=None)
def test_solids_of_cubes_give_closed_curves_round_their_cubes(cubes, seed, axis):
    """Faces in planes, and edges of four facets where cubes touch."""
    sides = []
    for cube in cubes:
        low = np.array(cube)
        for triangle in box(low, low + 1):
            normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
            if tuple((low + np.sign(normal)).astype(int)) not in cubes:
                sides.append(triangle)
    mesh = from_triangles(np.random.default_rng(seed).permutation(np.array(sides)))
    heights = np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    sections = slicing.slice(mesh, np.eye(3)[axis], heights)
    check_sections(sections, mesh, np.eye(3)[axis], heights)
    assert np.all(sections.closed)
    solid = np.zeros((5, 5, 5))
    for cube in cubes:
        solid[tuple(np.array(cube) + 1)] = 1
    solid = np.moveaxis(solid, axis, 0)
    # What lies on a plane is above it: a plane at 1 cuts the cubes below 1.
    layers = solid[np.ceil(heights).astype(int)]
    perimeters = [np.sum(np.abs(np.diff(layer, axis=way))) for layer in layers for way in (0, 1)]
    assert float(np.sum(sections.lengths)) == pytest.approx(np.sum(perimeters), rel=1e-12)


@pytest.mark.parametrize("name", ["aircraft", *real_parts("yf23_2m")])
def test_curves_end_only_where_there_is_no_neighbour(part, name):
    mesh = read_mesh(part(name))
    direction = slicing.plane_direction(0.3)
    heights = inside(mesh, direction, 60)
    sections = slicing.slice(mesh, direction, heights)
    altitudes = mesh.vertices @ direction
    begin, end = altitudes[mesh.facets], altitudes[np.roll(mesh.facets, -1, axis=1)]
    alone = mesh.neighbours < 0
    up = alone[..., None] & (begin[..., None] < heights) & (end[..., None] >= heights)
    down = alone[..., None] & (begin[..., None] >= heights) & (end[..., None] < heights)
    assert np.sum(~sections.closed) == np.sum(up) == np.sum(down) > 0


def test_many_small_bodies_each_have_their_curve():
    tetrahedron = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    places = np.array(list(product(range(12), range(12), [0])), dtype=np.float64) * 2
    mesh = from_triangles(np.concatenate([tetrahedron + place for place in places]))
    heights = np.linspace(0.1, 0.9, 7)
    sections = slicing.slice(mesh, Z, heights)
    assert np.array_equal(sections.planes, np.repeat(np.arange(7), 144)) and np.all(sections.closed)
    assert np.array_equal(np.diff(sections.offsets), np.full(7 * 144, 4))
    expected = 144 * np.sum((1 - heights) * (2 + np.sqrt(2)))
    assert float(np.sum(sections.lengths)) == pytest.approx(expected, rel=1e-12)


def test_one_plane_along_a_strip_of_many_facets_is_one_curve():
    count = 20_000
    x = np.repeat(np.arange(count + 1.0), 2)
    vertices = np.stack([x, np.tile([-1.0, 1.0], count + 1), np.cos(x)], axis=1)
    first = 2 * np.arange(count)
    lower, upper = np.stack([first, first + 2, first + 1], axis=1), np.stack([first + 1, first + 2, first + 3], axis=1)
    facets = np.random.default_rng(1).permutation(np.concatenate([lower, upper]))
    sections = slicing.slice(surface(vertices, facets), Y, np.array([0.25]))
    assert sections.closed.tolist() == [False]
    assert len(sections.points) == 2 * count + 1
    # Normals are upward: the curve runs along direction x normal, +x.
    assert np.all(np.diff(sections.points[:, 0]) > 0)
    np.testing.assert_allclose(sections.points[[0, -1]], [[0, 0.25, 1], [count, 0.25, np.cos(count)]], atol=1e-12)


def test_nothing_cut_is_nothing():
    mesh = from_triangles(box([0, 0, 0], [1, 1, 1]))
    for heights in (np.array([]), np.array([5.0])):
        sections = slicing.slice(mesh, X, heights)
        assert sections.points.shape == (0, 3) and sections.offsets.tolist() == [0]
        upper = envelope.upper_envelope(mesh, sections, 0.02)
        assert upper.points.shape == (0, 3) and upper.offsets.tolist() == [0]


def test_sections_are_read_only_and_the_same_every_time():
    mesh = from_triangles(box([0, 0, 0], [1, 1, 1]))
    one, two = (slicing.slice(mesh, X, np.array([0.3, 0.6])) for _ in range(2))
    for name in ("direction", "heights", "points", "facets", "offsets", "planes", "closed"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
        with pytest.raises(ValueError, match="read-only"):
            getattr(one, name)[0] = 0


@pytest.mark.parametrize(
    ("direction", "heights", "sentence"),
    [
        (2 * X, [0.5], "expected a direction of length 1"),
        (np.nan * X, [0.5], "expected a direction of length 1"),
        (X, [0.5, 0.4], "expected finite heights that do not decrease"),
        (X, [0.5, np.nan], "expected finite heights that do not decrease"),
    ],
)
def test_planes_that_are_none_are_refused(direction, heights, sentence):
    with pytest.raises(ValueError, match=sentence):
        slicing.slice(from_triangles(box([0, 0, 0], [1, 1, 1])), direction, np.array(heights))


@pytest.mark.parametrize("degrees", [-180, -90, -45, 0, 30, 45, 60, 90, 135, 180, 270, 360])
def test_planes_contain_the_travel_direction(degrees):
    travel = np.radians(degrees)
    direction = slicing.plane_direction(travel)
    np.testing.assert_allclose(direction, [-np.sin(travel), np.cos(travel), 0], atol=1e-15)
    np.testing.assert_allclose(np.cross(direction, Z), [np.cos(travel), np.sin(travel), 0], atol=1e-15)
    if degrees % 90 == 0:
        assert sorted(np.abs(direction).tolist()) == [0, 0, 1]


@pytest.mark.parametrize(("width", "pitch", "count"), [(1.0, 0.3, 4), (1.0, 0.25, 4), (1.0, 2.0, 1), (1.0, 1.0, 1)])
def test_planes_are_a_pitch_apart_and_centred(width, pitch, count):
    mesh = from_triangles(box([0, 5, 0], [1, 5 + width, 1]))
    heights = slicing.plane_heights(mesh, Y, pitch)
    assert len(heights) == count
    np.testing.assert_allclose(np.diff(heights), pitch, rtol=1e-12)
    assert heights[0] + heights[-1] == pytest.approx(10 + width)


def test_a_part_without_width_has_one_plane():
    wall = surface([[0, 1, 0], [1, 1, 0], [0, 1, 1]], [(0, 1, 2)])
    np.testing.assert_array_equal(slicing.plane_heights(wall, Y, 0.025), [1.0])
