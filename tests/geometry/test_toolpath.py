"""Toolpath, its curve and its placement."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.geometry.curves import Curve
from tapelayer.geometry.toolpath import Toolpath, to_machine

RADIUS = 1.5
UP = np.array([0.0, 0.0, 1.0])


def arc(n: int = 101, length: float = 2.0) -> Toolpath:
    """A course up a cylinder of 1.5 m about the y axis."""
    angle = np.linspace(0, length / RADIUS, n)
    normals = np.stack([np.sin(angle), np.zeros(n), np.cos(angle)], axis=1)
    return Toolpath(1, RADIUS * normals, normals, RADIUS * angle)


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        arc().points[0, 0] = 1.0


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


def test_stack_on_a_cylinder_lengthens_the_course() -> None:
    """5 mm of stack on R = 1.5 m is 6.7 mm over a 2 m course."""
    lifted = to_machine(arc(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.005)
    assert lifted.length - 2.0 == pytest.approx(2.0 * 0.005 / RADIUS, abs=1e-7)
    assert np.allclose(np.linalg.norm(lifted.points, axis=1), RADIUS + 0.005, atol=1e-14)


def test_placement_by_the_papers_formula() -> None:
    path = arc()
    moved = to_machine(path, (0.0, 0.0, 0.0), (0.3, -1.9, -1.4), 0.0)
    assert np.array_equal(moved.points, path.points + [0.3, -1.9, -1.4])
    assert np.array_equal(moved.normals, path.normals)
    assert np.array_equal(moved.arc_lengths, path.arc_lengths)


def test_quarter_turns_are_about_fixed_axes_in_order() -> None:
    path = Toolpath(1, np.eye(3), np.eye(3), np.array([0.0, 1.0, 2.0]))
    quarter = math.pi / 2
    about_z = to_machine(path, (0.0, 0.0, quarter), (0.0, 0.0, 0.0), 0.0)
    assert np.allclose(about_z.points, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    about_x_then_z = to_machine(path, (quarter, 0.0, quarter), (0.0, 0.0, 0.0), 0.0)
    assert np.allclose(about_x_then_z.normals, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


@given(st.tuples(*[st.floats(-4, 4)] * 3), st.tuples(*[st.floats(-5, 5)] * 3), st.floats(0, 0.02))
def test_placement_keeps_lengths_and_angles(
    rotation: tuple[float, float, float], origin: tuple[float, float, float], thickness: float
) -> None:
    path = arc(21)
    moved = to_machine(path, rotation, origin, thickness)
    lifted = to_machine(path, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), thickness)
    assert np.allclose(np.linalg.norm(moved.points - origin, axis=1), RADIUS + thickness, atol=1e-12)
    assert np.allclose(moved.normals @ moved.normals.T, path.normals @ path.normals.T, atol=1e-12)
    assert np.array_equal(moved.arc_lengths, lifted.arc_lengths)
