"""Rings are the closed lines along which a mesh ends, in the order of its facets."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.geometry.rings import MOST_RINGS, rings
from tests.helpers.panels import flat, mesh_of, sheet


def around(ring: np.ndarray) -> float:
    """Length of a closed line in mm."""
    return float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum() * 1e3)


def test_a_sheet_with_a_hole_has_two_rings_the_longest_first() -> None:
    x, y = np.arange(0.0, 101, 10), np.arange(0.0, 61, 10)
    outer, hole = rings(mesh_of(sheet(x, y, flat, (40, 60, 20, 40))))
    assert around(outer) == pytest.approx(320) and around(hole) == pytest.approx(80)
    assert (len(outer), len(hole)) == (32, 8)
    steps = np.roll(outer, -1, axis=0) - outer
    assert np.allclose(np.linalg.norm(steps, axis=1), 0.01)
    # Facets run counterclockwise, and so does the ring around them; that around the hole runs the other way.
    turns = [np.sum(np.cross(ring, np.roll(ring, -1, axis=0))[:, 2]) / 2 for ring in (outer, hole)]
    assert turns == pytest.approx([0.006, -0.0004])


def test_rings_that_meet_in_a_vertex_stay_closed() -> None:
    one = sheet([0, 10, 20], [0, 10], flat)
    two = sheet([20, 30], [10, 20], flat)
    found = rings(mesh_of(np.concatenate([one, two])))
    steps = [np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1) for ring in found]
    assert np.allclose(np.concatenate(steps), 0.01)
    assert sum(map(around, found)) == pytest.approx(100)


def test_a_closed_body_has_no_ring_and_a_torn_one_not_all() -> None:
    a, b, c, d = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], float)
    assert rings(mesh_of(np.array([[a, c, b], [a, b, d], [b, c, d], [a, d, c]]))) == []
    apart = np.array([[a, b, c]]) + np.arange(MOST_RINGS + 20)[:, None, None] * np.array([20.0, 0, 0])
    assert len(rings(mesh_of(apart))) == MOST_RINGS
