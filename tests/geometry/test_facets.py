"""Facets: triangles by themselves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.facets import distances_to


def test_distance_from_a_triangle_is_trimesh_s() -> None:
    chance = np.random.default_rng(5)
    triangles, points = chance.normal(size=(3000, 3, 3)), 2 * chance.normal(size=(3000, 3))
    points[:50] = triangles[:50, 0]
    points[50:100] = triangles[50:100].mean(axis=1)
    expected = np.linalg.norm(trimesh.triangles.closest_point(triangles, points) - points, axis=1)
    np.testing.assert_allclose(distances_to(triangles, points), expected, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_distance_is_the_least_of_many_points_on_the_facet_and_does_not_depend_on_its_corners_order(seed: int) -> None:
    chance = np.random.default_rng(seed)
    triangle, point = chance.normal(size=(1, 3, 3)), chance.normal(size=(1, 3))
    found = distances_to(triangle, point)
    shares = np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 2), axis=-1).reshape(-1, 2)
    shares = shares[shares.sum(axis=1) <= 1]
    points = triangle[0, 0] + shares @ (triangle[0, 1:] - triangle[0, 0])
    sampled = np.min(np.linalg.norm(points - point, axis=1))
    spacing = np.max(np.linalg.norm(triangle[0, 1:] - triangle[0, 0], axis=1)) / 100
    assert sampled - spacing <= found[0] <= sampled + 1e-12
    for order in itertools.permutations(range(3)):
        np.testing.assert_allclose(distances_to(triangle[:, order], point), found, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((0.2, 0.2, 0.7), 0.7),
        ((0.2, 0.2, -0.7), 0.7),
        ((0.5, -3.0, 4.0), 5.0),
        ((-3.0, -4.0, 0.0), 5.0),
        ((1.0, 1.0, 0.0), math.sqrt(0.5)),
        ((0.0, 0.0, 0.0), 0.0),
        ((0.5, 0.5, 0.0), 0.0),
        ((0.25, 0.25, 0.0), 0.0),
    ],
    ids=["above", "below", "beside an edge", "at a corner", "beyond the slope", "corner", "edge", "middle"],
)
def test_distance_where_it_is_known(point: tuple[float, ...], distance: float) -> None:
    triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    assert distances_to(triangle, np.array([point]))[0] == pytest.approx(distance, abs=1e-15)
