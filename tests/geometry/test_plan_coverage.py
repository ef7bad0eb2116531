"""Distances from a part in plan."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.geometry.plan_coverage import PlanCoverage
from tapelayer.units import MM
from tests.helpers.meshes import box, from_triangles
from tests.helpers.panels import flat, mesh_of, sheet


def test_distance_from_a_part_in_plan() -> None:
    outline = PlanCoverage(
        mesh_of(sheet(np.arange(0, 301, 20.0), np.arange(0, 201, 20.0), flat, hole=(100, 160, 60, 120)))
    )
    points = np.array([[50, 50], [-10, 50], [-30, -40], [130, 90], [310, 210]]) * MM
    np.testing.assert_allclose(outline.distances(points, 0.0) / MM, [0, 10, 50, 30, math.hypot(10, 10)], atol=1e-9)
    np.testing.assert_allclose(outline.distances(points[:1], 1.0) / MM, [50], atol=1e-9)
    assert len(outline.distances(np.zeros((0, 2)), 0.0)) == 0


def from_above(triangles: Floats, point: Floats) -> float:
    """Distance of a point from the nearest of triangles (m, 3, 2) in plan, one by one."""
    least = math.inf
    for corners in triangles:
        sides = []
        for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            way, away = end - begin, point - begin
            sides.append(way[0] * away[1] - way[1] * away[0])
            share = min(1.0, max(0.0, float(away @ way / (way @ way)))) if way @ way else 0.0
            least = min(least, float(np.linalg.norm(away - share * way)))
        if min(sides) >= 0 or max(sides) <= 0:
            return 0.0
    return least


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.3))
@settings(max_examples=60)
def test_distances_are_those_of_the_triangles_one_by_one(seed: int, limit: float) -> None:
    """Any facets, upright ones and such as cover each other among them."""
    chance = np.random.default_rng(seed)
    mesh = from_triangles(np.round(chance.uniform(-1, 1, (int(chance.integers(1, 12)), 3, 3)), 1))
    assume(len(mesh.facets))
    points = np.round(chance.uniform(-2, 2, (40, 2)), int(chance.integers(1, 4)))
    found = PlanCoverage(mesh).distances(points, limit)
    for point, distance in zip(points, found, strict=True):
        exact = from_above(mesh.vertices[mesh.facets][..., :2], point)
        # Up to the limit the distance is that to the nearest edge, over the part or not.
        if distance > limit:
            assert distance == pytest.approx(exact, abs=1e-12)
        else:
            assert exact <= limit + 1e-12


def test_a_closed_body_covers_its_shadow() -> None:
    coverage = PlanCoverage(from_triangles(box([0, 0, 0], [3, 2, 1])))
    points = np.array([[1.5, 1.0], [0.0, 0.0], [3.0, 1.0], [4.0, 1.0], [-3.0, -4.0]])
    np.testing.assert_allclose(coverage.distances(points, 0.0), [0, 0, 0, 1, 5], atol=1e-15)


def test_many_points_are_looked_at_in_parts() -> None:
    even = np.linspace(0, 1000, 31)
    coverage = PlanCoverage(mesh_of(sheet(even, even, flat)))
    points = np.random.default_rng(1).uniform(-0.5, 1.5, (3_000, 2))
    expected = np.linalg.norm(points - np.clip(points, 0.0, 1.0), axis=1)
    np.testing.assert_allclose(coverage.distances(points, 0.0), expected, atol=1e-12)
