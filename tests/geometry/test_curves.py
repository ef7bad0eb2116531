"""Curves through the samples of toolpaths."""

from __future__ import annotations

import numpy as np

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
