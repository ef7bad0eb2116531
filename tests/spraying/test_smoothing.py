"""The gun's direction along a section: near to every facet, without leaps, and creases where no direction serves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.machines.wrist import angles_between
from tapelayer.spraying.smoothing import brought_near, creases, enclosing, smooth
from tests.helpers.normals import tilted, unit

LIMIT = math.radians(15)
CHANCE = np.random.default_rng(11)


def test_enclosing_direction_is_the_best_of_all() -> None:
    for _ in range(20):
        normals = unit(CHANCE.normal(size=(int(CHANCE.integers(1, 9)), 3)) * 0.4 + [0, 0, 1])
        direction, angle = enclosing(normals)
        assert abs(np.linalg.norm(direction) - 1.0) <= 1e-12
        others = unit(direction + 0.05 * CHANCE.normal(size=(4000, 3)))
        widest = np.max(angles_between(others[:, None], normals), axis=1)
        assert np.min(widest) >= angle - 1e-9


def test_enclosing_direction_of_two_is_between_and_of_three_round_a_cone_its_axis() -> None:
    direction, angle = enclosing(tilted([10.0, 40.0]))
    np.testing.assert_allclose(direction, tilted([25.0])[0], atol=1e-12)
    assert math.degrees(angle) == pytest.approx(15.0, abs=1e-9)
    cone = np.vstack([tilted([16.0], azimuth) for azimuth in (0, 120, 240)])
    direction, angle = enclosing(cone)
    np.testing.assert_allclose(direction, [0, 0, 1], atol=1e-12)
    assert math.degrees(angle) == pytest.approx(16.0, abs=1e-9)


@pytest.mark.parametrize(("turn", "found"), [(29.999, False), (30.001, True), (39.0, True)])
def test_a_fold_is_a_crease_beyond_twice_the_limit(turn: float, found: bool) -> None:
    stations = np.array([0.0, 0.1, 0.2])
    intervals = creases(stations, tilted([0.0, turn]), 0.03, LIMIT)
    np.testing.assert_array_equal(intervals, np.array([[0.1, 0.1]]) if found else np.zeros((0, 2)))


def test_a_turn_over_more_than_the_reach_is_no_crease() -> None:
    normals = tilted([0.0, 20.0, 40.0])
    assert len(creases(np.array([0.0, 0.1, 0.1301, 0.2]), normals, 0.03, LIMIT)) == 0
    np.testing.assert_array_equal(creases(np.array([0.0, 0.1, 0.13, 0.2]), normals, 0.031, LIMIT), [[0.1, 0.13]])


def test_three_facets_without_a_common_direction_are_a_crease_though_every_two_have_one() -> None:
    normals = np.vstack([tilted([16.0], azimuth) for azimuth in (0, 120, 240)])
    assert np.max(angles_between(normals[:, None], normals)) < 2 * LIMIT
    np.testing.assert_array_equal(creases(np.array([0.0, 0.01, 0.02, 0.03]), normals, 0.03, LIMIT), [[0.01, 0.02]])


def test_creases_are_the_shortest_of_their_places_and_pass_over_gaps() -> None:
    normals = tilted([0.0, 0.0, 50.0, 50.0])
    stations = np.array([0.0, 0.01, 0.02, 0.03, 0.04])
    np.testing.assert_array_equal(creases(stations, normals, 0.03, LIMIT), [[0.02, 0.02]])
    normals[1] = np.nan
    np.testing.assert_array_equal(creases(stations, normals, 0.03, LIMIT), [[0.01, 0.02]])
    assert len(creases(stations, normals, 0.009, LIMIT)) == 0


def test_brought_near_is_the_nearest_of_all_that_are_near_enough() -> None:
    first = unit(CHANCE.normal(size=(40, 3)))
    second = unit(first + 0.3 * CHANCE.normal(size=(40, 3)))
    directions = unit(first + 0.6 * CHANCE.normal(size=(40, 3)))
    limits = CHANCE.uniform(0.05, 0.3, 40)
    found = brought_near(directions, first, second, limits)
    off = np.maximum(angles_between(found, first), angles_between(found, second))
    apart = angles_between(first, second)
    possible = apart <= 2 * limits
    assert np.any(possible) and np.any(~possible)
    assert np.all(off[possible] <= limits[possible] + 1e-9)
    np.testing.assert_allclose(off[~possible], apart[~possible] / 2, atol=1e-9)
    grid = unit(CHANCE.normal(size=(200_000, 3)))
    for row in np.flatnonzero(possible):
        near = np.maximum(angles_between(grid, first[row]), angles_between(grid, second[row])) <= limits[row]
        if np.any(near):
            best = np.min(angles_between(grid[near], directions[row]))
            assert angles_between(found[row], directions[row]) <= best + 1e-9


def test_a_plane_keeps_its_normal_and_an_arc_its_middle() -> None:
    stations = np.linspace(0.0, 0.5, 51)
    even = smooth(stations, np.tile(tilted([20.0]), (50, 1)), np.zeros(51, bool), 0.06, 0.03, LIMIT)
    np.testing.assert_allclose(even.normals, np.tile(tilted([20.0]), (51, 1)), atol=1e-12)
    assert np.max(even.deviations) <= 1e-7
    # Facets of a circle: at a vertex the mean of a window in the middle is the circle's own normal.
    turns = np.linspace(-20.0, 20.0, 51)
    arc = smooth(stations, tilted((turns[1:] + turns[:-1]) / 2), np.zeros(51, bool), 0.06, 0.03, LIMIT)
    np.testing.assert_allclose(arc.normals[4:-4], tilted(turns)[4:-4], atol=1e-12)


@given(st.lists(st.floats(-12.0, 12.0), min_size=2, max_size=40), st.floats(0.002, 0.05), st.sampled_from([0.0, 0.06]))
def test_no_direction_is_beyond_the_limit_where_there_is_no_crease(
    turns: list[float], step: float, window: float
) -> None:
    """Neighbours at most 24 deg apart: wherever they stand, the direction is within the limit of both."""
    stations = step * np.arange(len(turns) + 1)
    normals = tilted(turns)
    found = smooth(stations, normals, np.zeros(len(stations), bool), window, 0.03, LIMIT)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, atol=1e-12)
    off = np.maximum(
        np.append(0.0, angles_between(found.normals[1:], normals)),
        np.append(angles_between(found.normals[:-1], normals), 0.0),
    )
    np.testing.assert_allclose(found.deviations, off, atol=1e-12)
    assert np.max(off) <= LIMIT


def test_the_gun_turns_ahead_of_a_bump_and_not_at_it() -> None:
    stations = np.concatenate([np.arange(0, 0.1, 0.005), [0.1, 0.104], np.arange(0.105, 0.205, 0.005)])
    turns = np.zeros(len(stations) - 1)
    turns[20] = 27.0
    found = smooth(stations, tilted(turns), np.zeros(len(stations), bool), 0.06, 0.03, LIMIT)
    assert np.max(found.deviations) <= LIMIT
    angles = np.degrees(np.arctan2(found.normals[:, 0], found.normals[:, 2]))
    # 13.5 deg at the bump; far from it none; and no more than 1 deg a millimetre on the way.
    assert angles[20] == pytest.approx(13.5, abs=0.6)
    assert abs(angles[0]) < 0.5 and abs(angles[-1]) < 0.5
    assert np.max(np.abs(np.diff(angles) / np.diff(stations))) <= 1000.0
