"""What is seen from above, against rays and in itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry import envelope, slicing
from tapelayer.geometry.models import read_mesh
from tests.helpers.meshes import box, from_triangles, inside
from tests.helpers.parts import CLEAN, DIRTY, OPEN_SKINS, REAL_OPEN_SKINS, real_parts

X, Y, Z = np.eye(3)


def highest(mesh, direction, height, x):
    """Height (k,) of the uppermost cut of a plane at x (k,) along the travel, -inf where there is none, and its facet.

    Only what lies broadside: facets cut straight above x, from the definition.
    """
    along = np.cross(direction, Z)
    top, on = np.full(len(x), -np.inf), np.full(len(x), -1)
    a, b, c = mesh.vertices[mesh.facets.T]
    points = x[:, None] * along + height * direction
    for facet in range(len(mesh.facets)):
        p, q, r = a[facet], b[facet], c[facet]
        double_area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        if double_area == 0:
            continue
        u = ((points[:, 0] - p[0]) * (r[1] - p[1]) - (points[:, 1] - p[1]) * (r[0] - p[0])) / double_area
        v = ((q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])) / double_area
        z = p[2] + u * (q[2] - p[2]) + v * (r[2] - p[2])
        above = (u >= 0) & (v >= 0) & (u + v <= 1) & (z > top)
        top[above], on[above] = z[above], facet
    return top, on


def check_envelope(mesh, direction, heights, least, seed=0, samples=200):
    """The envelope against rays from above at random places, and in itself."""
    sections = slicing.slice(mesh, direction, heights)
    upper = envelope.upper_envelope(mesh, sections, least)
    along = np.cross(direction, Z)
    x, z = upper.points @ along, upper.points[:, 2]
    rows = upper.segments
    planes = np.repeat(upper.planes, np.diff(upper.offsets))
    assert not np.any(upper.closed)
    assert np.array_equal(upper.planes, np.sort(upper.planes))
    assert np.all(x[rows + 1] > x[rows])
    np.testing.assert_allclose(upper.points @ direction, heights[planes], atol=1e-12)
    assert np.all(np.abs(mesh.normals[upper.facets, 2]) >= least)
    assert np.all(mesh.upward_normals[:, 2] >= 0)
    for plane, height in enumerate(heights):
        own = rows[planes[rows] == plane]
        assert np.all(x[own][1:] >= x[own + 1][:-1] - 1e-12)
        reach = mesh.vertices @ along
        at = np.random.default_rng(seed + plane).uniform(reach.min(), reach.max(), samples)
        top, on = highest(mesh, direction, height, at)
        # Off the ends of pieces, where rounding decides.
        ends = np.unique(np.concatenate([x[own], x[own + 1], (sections.points @ along)]))
        nearest = np.min(np.abs(at[:, None] - ends[None]), axis=1) if len(ends) else np.full(len(at), np.inf)
        for place, z_top, facet in zip(at[nearest > 1e-9], top[nearest > 1e-9], on[nearest > 1e-9], strict=True):
            row = own[(x[own] <= place) & (x[own + 1] >= place)]
            if facet < 0 or abs(mesh.normals[facet, 2]) < least:
                assert len(row) == 0
                continue
            assert len(row) == 1
            share = (place - x[row[0]]) / (x[row[0] + 1] - x[row[0]])
            assert z[row[0]] + share * (z[row[0] + 1] - z[row[0]]) == pytest.approx(z_top, abs=1e-9)
            spot = place * along + height * direction + z_top * Z
            offset = spot - mesh.vertices[mesh.facets[upper.facets[row[0]], 0]]
            assert abs(offset @ mesh.normals[upper.facets[row[0]]]) < 1e-9
    return upper


@given(st.integers(0, 2**32 - 1), st.integers(1, 25), st.floats(0, 2 * np.pi))
@settings(max_examples=60, deadline=None)
def test_the_envelope_is_what_rays_from_above_meet(seed, facet_count, travel):
    """Facets that cross each other anywhere."""
    random = np.random.default_rng(seed)
    mesh = from_triangles(random.uniform(-1, 1, (facet_count, 3, 3)))
    check_envelope(mesh, slicing.plane_direction(travel), np.array([-0.3, 0.0, 0.4]), 0.1, seed, samples=40)


@given(st.sets(st.tuples(*[st.integers(0, 2)] * 3), min_size=1), st.sampled_from([0, 1]))
@settings(max_examples=40, deadline=None)
def test_the_envelope_of_cubes_is_their_tops(cubes, axis):
    """Faces on faces, walls upright, bodies that touch."""
    mesh = from_triangles(np.concatenate([box(cube, np.array(cube) + 1) for cube in sorted(cubes)]))
    direction = np.eye(3)[1 - axis]
    upper = check_envelope(mesh, direction, np.array([0.5, 1.5, 2.5]), 0.02, samples=30)
    columns = {(cube[0], cube[1]) for cube in cubes}
    assert float(np.sum(upper.lengths)) == pytest.approx(len(columns), rel=1e-12)
    for top in {cube[2] + 1 for cube in cubes}:
        there = [max(cube[2] for cube in cubes if cube[:2] == column) + 1 == top for column in columns]
        on_top = upper.points[upper.segments, 2] == top
        assert float(np.sum(upper.lengths[on_top])) == pytest.approx(np.sum(there), rel=1e-12)


@pytest.mark.parametrize("name", DIRTY)
@pytest.mark.parametrize("degrees", [0, 37])
def test_the_envelope_of_a_dirty_part(part, name, degrees):
    mesh = read_mesh(part(name))
    direction = slicing.plane_direction(np.radians(degrees))
    check_envelope(mesh, direction, inside(mesh, direction, 3), 0.02, samples=60)


@pytest.mark.parametrize("name", [*OPEN_SKINS, *REAL_OPEN_SKINS])
def test_a_skin_that_hides_nothing_is_seen_whole(part, name):
    mesh = read_mesh(part(name))
    for degrees in (0, 30, 90):
        direction = slicing.plane_direction(np.radians(degrees))
        sections = slicing.slice(mesh, direction, slicing.plane_heights(mesh, direction, 0.025))
        upper = envelope.upper_envelope(mesh, sections, 0.02)
        # Windings are upward, so sections run along the travel already; the envelope's go from left to right.
        assert np.array_equal(upper.planes, sections.planes)
        assert sorted(np.diff(upper.offsets)) == sorted(np.diff(sections.offsets))
        assert np.array_equal(np.sort(upper.facets), np.sort(sections.facets))
        if np.all(np.diff(upper.planes) > 0):
            np.testing.assert_allclose(upper.points, sections.points, atol=1e-14)
        assert float(np.sum(upper.lengths)) == pytest.approx(float(np.sum(sections.lengths)), rel=1e-12)


def test_a_box_over_a_plate_ends_the_plate_where_it_begins():
    plate = np.array([[[0.0, 0, 0], [10, 0, 0], [10, 10, 0]], [[0, 0, 0], [10, 10, 0], [0, 10, 0]]])
    mesh = from_triangles(np.concatenate([plate, box([2, 2, 1], [4, 4, 2])]))
    upper = envelope.upper_envelope(mesh, slicing.slice(mesh, Y, np.array([1.0, 3.0])), 0.02)
    assert upper.planes.tolist() == [0, 1, 1, 1]
    curves = np.split(upper.points, upper.offsets[1:-1])
    ends = [(curve[0].tolist(), curve[-1].tolist()) for curve in curves]
    assert ends == [
        ([0, 1, 0], [10, 1, 0]),
        ([0, 3, 0], [2, 3, 0]),
        ([2, 3, 2], [4, 3, 2]),
        ([4, 3, 0], [10, 3, 0]),
    ]


def test_two_roofs_that_cross_are_one_curve():
    roofs = [[[0.0, -1, 0], [4, -1, 4], [0, 3, 0]], [[0, -1, 4], [0, 3, 4], [4, -1, 0]]]
    mesh = from_triangles(roofs)
    upper = envelope.upper_envelope(mesh, slicing.slice(mesh, Y, np.array([0.0])), 0.02)
    np.testing.assert_allclose(upper.points, [[0, 0, 4], [2, 0, 2], [3, 0, 3]], atol=1e-12)
    assert len(set(upper.facets.tolist())) == 2 and upper.facets[1] == upper.facets[2]


def test_a_wall_hides_and_is_left_out():
    lean = 0.01
    wall = [[[5.0, -1, 0], [5 + lean, -1, 1], [5, 1, 0]], [[5 + lean, -1, 1], [5 + lean, 1, 1], [5, 1, 0]]]
    floor = [[[0.0, -1, 0], [10, -1, 0], [10, 1, 0]], [[0, -1, 0], [10, 1, 0], [0, 1, 0]]]
    mesh = from_triangles(np.array(floor + wall))
    sections = slicing.slice(mesh, Y, np.array([0.0]))
    upper = envelope.upper_envelope(mesh, sections, 0.02)
    curves = np.split(upper.points, upper.offsets[1:-1])
    np.testing.assert_allclose([curve[0] for curve in curves], [[0, 0, 0], [5 + lean, 0, 0]], atol=1e-12)
    np.testing.assert_allclose([curve[-1] for curve in curves], [[5, 0, 0], [10, 0, 0]], atol=1e-12)
    assert len(envelope.upper_envelope(mesh, sections, 0.005).planes) == 2


def test_only_upright_planes_are_seen_from_above():
    mesh = from_triangles(box([0, 0, 0], [1, 1, 1]))
    with pytest.raises(ValueError, match="expected vertical planes"):
        envelope.upper_envelope(mesh, slicing.slice(mesh, Z, np.array([0.5])), 0.02)


@pytest.mark.parametrize("name", [*CLEAN, *DIRTY])
def test_areas_add_up_to_the_whole(part, name):
    mesh = read_mesh(part(name))
    areas = envelope.areas_from_above(mesh, 0.4, 0.01, 0.02)
    assert areas.seen + areas.too_steep + areas.hidden == pytest.approx(float(np.sum(mesh.areas)), rel=1e-12)
    steep = np.abs(mesh.normals[:, 2]) < 0.02
    assert areas.too_steep == pytest.approx(float(np.sum(mesh.areas[steep])), rel=1e-12)
    assert areas.hidden >= 0


@pytest.mark.parametrize("name", ["cylinder", *real_parts("cylinder_1m")])
def test_of_a_closed_cylinder_only_the_top_is_seen(part, name):
    mesh = read_mesh(part(name))
    areas = envelope.areas_from_above(mesh, 0.0, 0.005, 0.02)
    cap = float(np.sum(mesh.areas[mesh.normals[:, 2] > 0.99]))
    assert areas.seen == pytest.approx(cap, rel=1e-6)
    assert areas.hidden == pytest.approx(cap, rel=1e-6)


@pytest.mark.parametrize("travel", [0.0, 0.7, np.pi / 2])
def test_a_box_hides_the_plate_below_it(travel):
    plate = np.array([[[0.0, 0, 0], [10, 0, 0], [10, 10, 0]], [[0, 0, 0], [10, 10, 0], [0, 10, 0]]])
    mesh = from_triangles(np.concatenate([plate, box([2, 3, 1], [4, 8, 2])]))
    areas = envelope.areas_from_above(mesh, travel, 0.01, 0.02)
    assert areas.seen == pytest.approx(100, rel=2e-3)
    assert areas.too_steep == pytest.approx(2 * (2 + 5), rel=1e-12)
    assert areas.hidden == pytest.approx(20, rel=1e-2)


@pytest.mark.parametrize("name", ["aircraft", *real_parts("yf23_2m")])
def test_the_area_seen_of_an_aircraft_is_what_rays_find(part, name):
    mesh = read_mesh(part(name))
    areas = envelope.areas_from_above(mesh, 0.2, 0.004, 0.02)
    steep = np.abs(mesh.normals[:, 2]) < 0.02
    random = np.random.default_rng(3)
    weights = np.where(steep, 0.0, mesh.areas)
    chosen = random.choice(len(weights), 800, p=weights / weights.sum())
    share = np.sort(random.uniform(size=(800, 2)), axis=1)
    shares = np.stack([share[:, 0], share[:, 1] - share[:, 0], 1 - share[:, 1]], axis=1)
    points = np.einsum("ij,ijk->ik", shares, mesh.vertices[mesh.facets[chosen]])
    top = np.full(800, -np.inf)
    for point in range(800):
        top[point] = highest_above(mesh, points[point])
    seen = np.mean(points[:, 2] >= top - 1e-9)
    spread = np.sqrt(seen * (1 - seen) / 800)
    assert areas.seen / (areas.seen + areas.hidden) == pytest.approx(seen, abs=4 * spread)


def highest_above(mesh, point):
    """Height of the uppermost facet on the vertical through a point."""
    a, b, c = mesh.vertices[mesh.facets.T]
    double_areas = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    flat = double_areas != 0
    a, b, c, double_areas = a[flat], b[flat], c[flat], double_areas[flat]
    u = ((point[0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (point[1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / double_areas
    v = ((b[:, 0] - a[:, 0]) * (point[1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (point[0] - a[:, 0])) / double_areas
    met = (u >= 0) & (v >= 0) & (u + v <= 1)
    return np.max((a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2]))[met], initial=-np.inf)
