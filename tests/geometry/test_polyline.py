"""Polylines: places along them, and the points that they keep."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.geometry.polyline import kept
from tests.helpers.normals import tilted


@given(st.lists(st.floats(-3e-4, 3e-4), min_size=3, max_size=60))
def test_what_is_left_out_is_near_to_what_remains(bumps: list[float]) -> None:
    stations = 0.01 * np.arange(len(bumps))
    points = np.column_stack([stations, np.zeros(len(bumps)), bumps])
    normals = np.tile([0.0, 0.0, 1.0], (len(bumps), 1))
    fixed = np.zeros(len(bumps), bool)
    remain = kept(stations, points, normals, fixed, 1e-4)
    assert remain[0] and remain[-1]
    heights = np.interp(stations, stations[remain], points[remain, 2])
    assert np.max(np.abs(heights - points[:, 2])) <= 1e-4 + 1e-15
    flat = kept(stations, points * [1, 1, 0], normals, fixed, 1e-4)
    assert np.sum(flat) == 2


def test_a_turn_of_the_direction_is_kept_on_a_straight_way() -> None:
    stations = np.linspace(0.0, 0.1, 11)
    points = np.column_stack([stations, np.zeros(11), np.zeros(11)])
    remain = kept(stations, points, tilted(np.where(stations < 0.05, 0.0, 10.0)), np.zeros(11, bool), 1e-4)
    assert remain[4] and remain[5] and np.sum(remain) == 4
