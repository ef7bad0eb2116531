"""Polylines: places along them, and the points that they keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.geometry.polyline import NORMAL_TOLERANCE, along, kept
from tests.helpers.normals import tilted, unit


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


def nearest(path: Floats, places: Floats, point: Floats) -> tuple[float, float]:
    """Arc length of the nearest point of a polyline and its distance, by a thousand points on every segment."""
    shares = np.linspace(0.0, 1.0, 1001)[:, None]
    found = []
    for begin, end, first, last in zip(path, path[1:], places, places[1:], strict=False):
        away = np.linalg.norm(begin + shares * (end - begin) - point, axis=1)
        best = int(np.argmin(away))
        found.append((float(away[best]), float(first + shares[best, 0] * (last - first))))
    distance, arc = min(found)
    return arc, distance


@pytest.mark.parametrize("seed", range(6))
def test_places_along_a_polyline_are_the_nearest_ones(seed: int) -> None:
    """A path that winds upwards like a spring, so that what is near in space may be far along it."""
    chance = np.random.default_rng(seed)
    turns = np.linspace(0, 6 * np.pi, 200)
    path = np.column_stack([np.cos(turns), np.sin(turns), 0.1 * turns])
    places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    # As near to each other as samples of a program are, for places are looked for near the way travelled.
    stations = np.linspace(0.0, places[-1], 1500)
    on = np.column_stack([np.interp(stations, places, column) for column in path.T])
    points = on + [0, 0, chance.uniform(-0.1, 0.1)] + chance.uniform(-1e-4, 1e-4, on.shape)
    arcs, distances = along(path, places, points)
    for point, arc, distance in zip(points[::149], arcs[::149], distances[::149], strict=True):
        expected, near = nearest(path, places, point)
        assert distance == pytest.approx(near, abs=1e-5)
        assert arc == pytest.approx(expected, abs=1e-3)
    exact = along(path, places, on)
    np.testing.assert_allclose(exact[0], stations, atol=1e-12)
    np.testing.assert_allclose(exact[1], 0.0, atol=1e-12)


def test_before_the_begin_and_behind_the_end_the_ends_are_nearest() -> None:
    path = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])
    arcs, distances = along(path, np.array([0.0, 1.0, 2.0]), np.array([[-1.0, 0, 0], [0.5, 0, 0.2], [1, 3, 0]]))
    np.testing.assert_allclose(arcs, [0.0, 0.5, 2.0])
    np.testing.assert_allclose(distances, [1.0, 0.2, 2.0])


def test_a_path_that_crosses_itself_is_followed_and_not_left_at_the_crossing() -> None:
    turns = np.linspace(-0.2, 2 * np.pi + 0.2, 400)
    path = np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    arcs, distances = along(path, places, path[50:])
    np.testing.assert_allclose(arcs, places[50:], atol=1e-9)
    np.testing.assert_allclose(distances, 0.0, atol=1e-9)


def test_one_segment_and_equal_points() -> None:
    path, places = np.array([[0.0, 0, 0], [0, 0, 0], [2, 0, 0]]), np.array([0.0, 0.0, 2.0])
    arcs, distances = along(path, places, np.array([[0.0, 1, 0], [1.5, 0, 0]]))
    np.testing.assert_allclose(arcs, [0.0, 1.5])
    np.testing.assert_allclose(distances, [1.0, 0.0])


@given(st.integers(0, 2**32 - 1), st.floats(1e-4, 1e-2))
@settings(max_examples=60)
def test_what_is_left_out_of_any_way_is_within_both_tolerances(seed: int, chord: float) -> None:
    chance = np.random.default_rng(seed)
    count = int(chance.integers(2, 80))
    stations = np.cumsum(chance.uniform(1e-3, 0.02, count))
    points = np.cumsum(chance.normal(0.0, 0.003, (count, 3)), axis=0)
    normals = unit(np.cumsum(chance.normal(0.0, 0.01, (count, 3)), axis=0) + [0, 0, 1])
    fixed = chance.random(count) < 0.1
    remain = kept(stations, points, normals, fixed, chord)
    assert np.all(remain[fixed]) and remain[0] and remain[-1]
    for values, most in ((points, chord), (normals, NORMAL_TOLERANCE)):
        between = np.column_stack([np.interp(stations, stations[remain], column[remain]) for column in values.T])
        assert np.max(np.linalg.norm(between - values, axis=1)) <= most * (1 + 1e-9)
    # Of what remains nothing more can be left out.
    again = kept(stations[remain], points[remain], normals[remain], fixed[remain], chord)
    assert np.all(again[fixed[remain]])
