"""Curves through the samples of toolpaths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.geometry.curves import Curve
from tapelayer.geometry.toolpath import Toolpath
from tests.helpers.surfaces import arc

RADIUS = 1.5


UP = np.array([0.0, 0.0, 1.0])


def test_two_points_are_a_line_and_three_a_parabola() -> None:
    line = Curve(Toolpath(1, np.array([[0.0, 0, 0], [0, 2, 0]]), np.array([UP, UP]), np.array([5.0, 7.0])))
    points, normals, tangents = line.at(np.array([0.0, 0.5, 2.0]))
    assert np.allclose(points, [[0, 0, 0], [0, 0.5, 0], [0, 2, 0]], atol=1e-15)
    assert np.allclose(normals, UP, atol=1e-15)
    assert np.allclose(tangents, [0, 1, 0], atol=1e-15)
    s = np.array([0.0, 1.0, 3.0])
    parabola = Curve(Toolpath(1, np.stack([s, s**2, 0 * s], axis=1), np.array([UP] * 3), s))
    assert np.allclose(parabola.at(np.array([2.0]))[0], [[2, 4, 0]], atol=1e-14)


def test_curve_of_an_arc_is_the_arc() -> None:
    curve = Curve(arc())
    s = np.linspace(0, curve.length, 777)
    points, normals, tangents = curve.at(s)
    assert np.max(np.abs(np.linalg.norm(points, axis=1) - RADIUS)) < 1e-8
    exact = np.stack([np.cos(s / RADIUS), 0 * s, -np.sin(s / RADIUS)], axis=1)
    assert np.max(np.abs(tangents - exact)) < 1e-6
    assert np.max(np.abs(np.linalg.norm(normals, axis=1) - 1)) < 1e-15


def test_a_curve_goes_through_its_samples() -> None:
    curve = Curve(arc(21))
    for known, found in zip(curve.at_knots(), curve.at(curve.knots), strict=True):
        assert np.max(np.abs(known - found)) < 1e-15


@given(st.integers(2, 40), st.floats(-5.0, 5.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_cubic_is_its_own_curve(count: int, shift: float, bend: float, twist: float) -> None:
    """Not-a-knot ends give back every cubic, a line from two points, a parabola from three."""
    s = np.sort(np.random.default_rng(count).choice(200, count, replace=False)) / 100
    square, cube = bend * (count > 2), twist * (count > 3)

    def places(t: Floats) -> Floats:
        return np.stack([t, square * t**2, cube * t**3 - t], axis=1)

    def slopes(t: Floats) -> Floats:
        steps = np.stack([0 * t + 1, 2 * square * t, 3 * cube * t**2 - 1], axis=1)
        return steps / np.linalg.norm(steps, axis=1)[:, None]

    curve = Curve(Toolpath(1, places(s), np.array([UP] * count), s + shift))
    t = np.linspace(0.0, curve.length, 57)
    points, normals, tangents = curve.at(t)
    np.testing.assert_allclose(points, places(t + s[0]), atol=1e-9)
    np.testing.assert_allclose(tangents, slopes(t + s[0]), atol=1e-7)
    np.testing.assert_allclose(normals, np.tile(UP, (57, 1)), atol=1e-12)
    np.testing.assert_allclose(curve.at_knots()[2], slopes(s), atol=1e-7)


def test_a_curve_begins_at_0_whatever_its_arc_lengths_begin_with() -> None:
    path = arc(21)
    shifted = Curve(Toolpath(1, path.points, path.normals, path.arc_lengths + 3.0))
    assert shifted.knots[0] == 0.0 and shifted.length == pytest.approx(path.length, abs=1e-15)
    for one, other in zip(shifted.at(np.array([0.3])), Curve(path).at(np.array([0.3])), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        shifted.knots[0] = 1.0


def test_the_error_of_an_arc_falls_with_the_fourth_power_of_the_spacing() -> None:
    errors = []
    for count in (11, 21, 41, 81):
        curve = Curve(arc(count))
        points, _, _ = curve.at(np.linspace(0.3 * curve.length, 0.7 * curve.length, 501))
        errors.append(np.max(np.abs(np.linalg.norm(points, axis=1) - RADIUS)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 3.7)
