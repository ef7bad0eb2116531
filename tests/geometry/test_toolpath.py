"""Toolpath, its curve and its placement."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.geometry.toolpath import Toolpath, to_machine
from tests.helpers.surfaces import arc

RADIUS = 1.5


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        arc().points[0, 0] = 1.0


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
