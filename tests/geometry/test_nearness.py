"""Nearness: queries at a margin, rays and reliefs against closed forms and against the triangles one by one."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.facets import distances_to
from tapelayer.geometry.nearness import UNCERTAINTY, Relief, flattened, meets_ray, query, triangles
from tests.helpers.panels import mesh_of, sheet


def wavy(x: Floats, y: Floats) -> Floats:
    return np.asarray(20.0 * np.sin(x / 30.0) * np.cos(y / 50.0))


def rough(count: int = 12) -> tuple[Floats, Ints]:
    """Vertices in metres and facets of a wavy sheet of 200 by 300 mm."""
    mesh = mesh_of(sheet(np.linspace(0.0, 200.0, count), np.linspace(0.0, 300.0, count), wavy))
    return mesh.vertices, mesh.facets


def at(place: Floats) -> Floats:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


@given(
    radius=st.floats(0.001, 0.1),
    place=st.tuples(st.floats(-0.1, 0.3), st.floats(-0.1, 0.4), st.floats(-0.2, 0.3)),
)
def test_a_ball_is_near_where_the_nearest_triangle_is(radius: float, place: tuple[float, ...]) -> None:
    vertices, facets = rough()
    near, point = query(coal.Sphere(radius), triangles(vertices, facets)), np.array(place)
    distance = float(np.min(distances_to(vertices[facets], np.broadcast_to(point, (len(facets), 3))))) - radius
    if distance > 1e-6:
        assert near(at(point), distance)
        assert near(at(point), distance + 1e-3)
        assert not near(at(point), max(distance - 3 * UNCERTAINTY, -1e-6)) or distance < 2 * UNCERTAINTY
    else:
        assert near(at(point), 0.0)


@pytest.mark.parametrize("margin", [0.0, 0.005, 0.1])
def test_a_turned_box_is_near_by_its_nearest_corner(margin: float) -> None:
    """Over a plane its distance is its height less the reach of its corners."""
    corners = np.array([[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [5.0, 5.0, 0.0], [-5.0, 5.0, 0.0]])
    near = query(coal.Box(0.2, 0.4, 0.6), triangles(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    for chance in np.random.default_rng(3).normal(size=(100, 4)):
        w, x, y, z = chance / np.linalg.norm(chance)
        down = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
        pose = np.eye(4)
        pose[:3, :3] = turned(w, x, y, z)
        reach = float(np.abs(pose[2, :3]) @ [0.1, 0.2, 0.3])
        assert np.allclose(pose[2, :3], down)
        pose[2, 3] = reach + margin + 5e-5
        assert not near(pose, margin)
        pose[2, 3] = reach + margin
        assert near(pose, margin)


@pytest.mark.parametrize("margin", [0.0, 0.005, 0.1])
def test_a_turned_cylinder_is_near_by_its_lowest_rim(margin: float) -> None:
    corners = np.array([[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [5.0, 5.0, 0.0], [-5.0, 5.0, 0.0]])
    near = query(coal.Cylinder(0.1, 0.5), triangles(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    for chance in np.random.default_rng(5).normal(size=(100, 4)):
        pose = np.eye(4)
        pose[:3, :3] = turned(*(chance / np.linalg.norm(chance)).tolist())
        reach = 0.1 * float(np.hypot(pose[2, 0], pose[2, 1])) + 0.25 * abs(float(pose[2, 2]))
        pose[2, 3] = reach + margin + 5e-5
        assert not near(pose, margin)
        pose[2, 3] = reach + margin
        assert near(pose, margin)


@given(place=st.tuples(*[st.floats(-0.6, 0.6)] * 3), margin=st.floats(0.0, 0.2))
def test_solids_are_near_by_their_closed_forms(place: tuple[float, ...], margin: float) -> None:
    """A ball of 0.1 at a box of 0.4 x 0.2 x 0.6, and at a standing cylinder of radius 0.15 and length 0.3."""
    x, y, z = (abs(value) for value in place)
    to_box = float(np.linalg.norm(np.maximum([x - 0.2, y - 0.1, z - 0.3], 0.0)))
    to_cylinder = float(np.hypot(max(np.hypot(x, y) - 0.15, 0.0), max(z - 0.15, 0.0)))
    for solid, distance in ((coal.Box(0.4, 0.2, 0.6), to_box), (coal.Cylinder(0.15, 0.3), to_cylinder)):
        near = query(coal.Sphere(0.1), solid)
        if distance - 0.1 <= margin:
            assert near(at(np.array(place)), margin)
        elif distance - 0.1 > margin + 5 * UNCERTAINTY:
            assert not near(at(np.array(place)), margin)


def turned(w: float, x: float, y: float, z: float) -> Floats:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@given(x=st.floats(-0.05, 0.25), y=st.floats(-0.05, 0.35), z=st.floats(-0.1, 0.1))
def test_a_ray_meets_what_is_above_its_origin(x: float, y: float, z: float) -> None:
    vertices, facets = rough(80)
    inside = 0.0 <= x <= 0.2 and 0.0 <= y <= 0.3
    height = float(wavy(np.array(x * 1e3), np.array(y * 1e3))) * 1e-3
    beside = min(abs(x), abs(x - 0.2), abs(y), abs(y - 0.3)) < 1e-9
    if not beside and (abs(z - height) > 1e-4 or not inside):
        assert meets_ray(vertices, facets, np.array([x, y, z])) == (inside and z < height)


def test_a_ray_meets_edges_corners_and_upright_triangles() -> None:
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 3.0]])
    level, upright = np.array([[0, 1, 2]]), np.array([[0, 1, 3]])
    assert all(meets_ray(corners, level, np.array([*plan, 0.0])) for plan in ((0.0, 0.0), (0.5, 0.0), (0.5, 0.5)))
    assert not meets_ray(corners, level, np.array([0.6, 0.6, 0.0]))
    assert meets_ray(corners, upright, np.array([0.25, 0.0, 2.0]))
    assert not meets_ray(corners, upright, np.array([0.25, 0.0, 3.5]))
    assert not meets_ray(corners, upright, np.array([0.25, 0.1, 0.0]))
    assert not meets_ray(corners, np.zeros((0, 3), np.int64), np.zeros(3))


@pytest.mark.parametrize("count", [2, 12, 40])
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_triangle_reaches_into_a_box_above_the_relief(count: int, seed: int) -> None:
    """A box that is said to be clear has no corner of a triangle's box above its floor in its plan."""
    vertices, facets = rough(count)
    relief, chance = Relief(vertices, facets), np.random.default_rng(seed)
    lower = chance.uniform([-0.1, -0.1, -0.05], [0.3, 0.4, 0.05], (200, 3))
    upper = lower + chance.uniform(0.0, 0.1, (200, 3))
    clear = relief.below(lower, upper)
    least, most = vertices[facets].min(axis=1), vertices[facets].max(axis=1)
    over = np.all((least[None, :, :2] <= upper[:, None, :2]) & (most[None, :, :2] >= lower[:, None, :2]), axis=2)
    highest = np.max(np.where(over, most[None, :, 2], -np.inf), axis=1)
    assert np.all(highest[clear] < lower[clear, 2])
    assert np.all(clear[lower[:, 2] > vertices[:, 2].max()])
    assert not np.any(clear[np.any(over, axis=1) & (lower[:, 2] < vertices[:, 2].min())])


@pytest.mark.parametrize(("count", "off"), [(12, 1e-3), (40, 5e-4), (12, 1e-9)])
def test_no_point_of_a_mesh_is_far_from_the_flattened_one(count: int, off: float) -> None:
    vertices, facets = rough(count)
    flat, few = flattened(vertices, facets, off)
    shares = np.random.default_rng(4).dirichlet(np.ones(3), len(facets))
    points = np.concatenate([vertices, np.einsum("ij,ijk->ik", shares, vertices[facets])])
    near = [np.min(distances_to(flat[few], np.broadcast_to(point, (len(few), 3)))) for point in points]
    assert np.max(near) <= off + 1e-12


def test_flat_and_gently_curved_meshes_are_flattened_to_a_few_rectangles() -> None:
    bent = mesh_of(
        sheet(np.linspace(0.0, 1000.0, 60), np.linspace(0.0, 1000.0, 60), lambda x, y: x * x / 4000.0 + 0 * y)
    )
    assert len(flattened(bent.vertices, bent.facets, 5e-4)[1]) < len(bent.facets) / 20
    level = mesh_of(sheet(np.linspace(0.0, 1000.0, 9), np.linspace(0.0, 1000.0, 9), lambda x, y: 0 * (x + y)))
    assert len(flattened(level.vertices, level.facets, 1e-9)[1]) == 2
