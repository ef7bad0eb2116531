"""Facets tell the surface that they stand for: its points, normals and curvature."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tapelayer.units import MM
from tests.helpers.natural_paths import CYLINDER, HEIGHTS, SPHERE, facets_of


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize(("name", "radius", "round_axis"), [("cylinder", CYLINDER, 0.0), ("sphere", SPHERE, 1.0)])
def test_the_surface_is_that_of_the_vertices(name: str, radius: float, round_axis: float, jitter: float) -> None:
    surface = facets_of(HEIGHTS[name], 1.2, 1.6, 25 * MM, jitter)
    plan = np.random.default_rng(1).uniform(-1.0, 1.0, (5000, 2)) * [0.59, 0.79]
    spots = surface.spots(plan)
    assert spots.inside.all()
    away = surface.points(spots) + [0.0, 0.0, radius]
    away[:, 0] *= round_axis
    distances = np.linalg.norm(away, axis=1)
    assert np.abs(distances - radius).max() <= 0.001 * MM
    assert np.linalg.norm(surface.normals(spots) - away / distances[:, None], axis=1).max() <= 1e-4
    traces = np.einsum("nii->n", surface.shapes(spots))
    assert traces == pytest.approx(np.full(len(plan), -(1.0 + round_axis) / radius), rel=2e-3)
    assert surface.doubts(spots).max() <= 1e-5
    assert np.linalg.norm(surface.on_facets(spots)[:, :2] - plan, axis=1).max() <= 1e-12


def test_spots_beside_the_mould_are_the_nearest() -> None:
    surface = facets_of(HEIGHTS["plane"], 1.0, 1.0)
    spots = surface.spots(np.array([[0.7, 0.1], [0.9, -0.9]]))
    assert not spots.inside.any()
    assert surface.on_facets(spots)[:, :2] == pytest.approx(np.array([[0.5, 0.1], [0.5, -0.5]]), abs=1e-6)


def test_ten_thousand_points_are_found_at_once() -> None:
    surface = facets_of(HEIGHTS["cylinder"], 1.4, 2.4, 12.5 * MM)
    assert len(surface.facets) > 43_000 - 1
    plan = np.random.default_rng(1).uniform(-0.6, 0.6, (10_000, 2))
    surface.spots(plan[:1])
    begun = time.process_time()
    surface.points(surface.spots(plan))
    assert time.process_time() - begun < 1.0
