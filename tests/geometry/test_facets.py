"""Facets: triangles by themselves."""

from __future__ import annotations

import numpy as np
import trimesh

from tapelayer.geometry.facets import distances_to


def test_distance_from_a_triangle_is_trimesh_s() -> None:
    chance = np.random.default_rng(5)
    triangles, points = chance.normal(size=(3000, 3, 3)), 2 * chance.normal(size=(3000, 3))
    points[:50] = triangles[:50, 0]
    points[50:100] = triangles[50:100].mean(axis=1)
    expected = np.linalg.norm(trimesh.triangles.closest_point(triangles, points) - points, axis=1)
    np.testing.assert_allclose(distances_to(triangles, points), expected, atol=1e-12)
