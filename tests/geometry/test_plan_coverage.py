"""Distances from a part in plan."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.geometry.plan_coverage import PlanCoverage
from tapelayer.units import MM
from tests.helpers.panels import flat, mesh_of, sheet


def test_distance_from_a_part_in_plan() -> None:
    outline = PlanCoverage(
        mesh_of(sheet(np.arange(0, 301, 20.0), np.arange(0, 201, 20.0), flat, hole=(100, 160, 60, 120)))
    )
    points = np.array([[50, 50], [-10, 50], [-30, -40], [130, 90], [310, 210]]) * MM
    np.testing.assert_allclose(outline.distances(points, 0.0) / MM, [0, 10, 50, 30, math.hypot(10, 10)], atol=1e-9)
    np.testing.assert_allclose(outline.distances(points[:1], 1.0) / MM, [50], atol=1e-9)
    assert len(outline.distances(np.zeros((0, 2)), 0.0)) == 0
