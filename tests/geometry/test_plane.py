"""The best plane lies along the facets, faces the side that they face, and turns there and back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plane import Plane, best_plane, plane_across
from tests.helpers.panels import flat, mesh_of, sheet

TURNS = [Rotation.from_rotvec(turn).as_matrix() for turn in ([0, 0, 0], [0.3, -0.2, 1.1], [2.5, 0.4, 0], [0, 1.6, 0])]


def plane_of(mesh: Mesh) -> Plane:
    return best_plane(mesh.vertices[mesh.facets], mesh.areas, mesh.normals)


def arch(x: Floats, y: Floats) -> Floats:
    return 100.0 - (x - 300.0) ** 2 / 3000.0 + 0.0 * y


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("height", [flat, arch])
def test_it_turns_with_the_facets_and_keeps_to_their_side(turn: Floats, height: object) -> None:
    mesh = mesh_of(sheet(np.linspace(0, 600, 13), np.linspace(0, 900, 5), height))
    turned = mesh.moved(turn, np.array([3.0, -1.0, 2.0]))
    plane = plane_of(turned)
    assert plane.normal == pytest.approx(turn @ plane_of(mesh).normal, abs=1e-12)
    assert plane.normal == pytest.approx(turn[:, 2], abs=1e-9)
    assert np.linalg.det(plane.rotation) == pytest.approx(1.0)
    assert plane.rotation @ plane.rotation.T == pytest.approx(np.eye(3), abs=1e-12)


def test_the_number_of_facets_does_not_move_it() -> None:
    """Areas count: a mesh that is fine on one side has the same plane."""
    even = mesh_of(sheet(np.linspace(0, 600, 61), np.linspace(0, 900, 4), arch))
    uneven = mesh_of(sheet(np.r_[np.linspace(0, 300, 301), np.linspace(310, 600, 30)], np.linspace(0, 900, 4), arch))
    assert plane_of(uneven).normal == pytest.approx(plane_of(even).normal, abs=1e-4)
    assert plane_of(uneven).origin == pytest.approx(plane_of(even).origin, abs=1e-4)


def test_a_deep_channel_is_seen_from_its_open_side() -> None:
    """Its nearest plane stands across it, where it would be no height field."""
    x = np.linspace(-50, 50, 21)
    mesh = mesh_of(sheet(x, np.linspace(0, 1000, 3), lambda x, y: x**2 / 10.0 + 0.0 * y))
    assert np.linalg.svd(mesh.vertices - mesh.vertices.mean(axis=0))[2][2] @ [0, 0, 1] == pytest.approx(0, abs=1e-6)
    assert plane_of(mesh).normal == pytest.approx([0, 0, 1], abs=1e-6)


@pytest.mark.parametrize("normal", [[0, 0, 1], [0, 0, -3], [1, 0, 0], [-2, 0, 0], [0, 1, 0], [0.6, -0.3, 0.2]])
def test_there_and_back(normal: list[float]) -> None:
    plane = plane_across(np.array(normal, dtype=float), np.array([1.0, 2.0, 3.0]))
    points = np.random.default_rng(5).normal(size=(20, 3))
    assert plane.out_of(plane.into(points)) == pytest.approx(points, abs=1e-14)
    assert plane.turned_out_of(plane.turned_into(points)) == pytest.approx(points, abs=1e-14)
    assert plane.into(points)[:, 2] == pytest.approx((points - plane.origin) @ plane.normal)
    assert np.linalg.det(plane.rotation) == pytest.approx(1.0)
    assert plane.normal @ normal > 0
