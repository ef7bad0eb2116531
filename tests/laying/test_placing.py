"""Courses where the setup puts the part."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.laying.placing import courses_in_machine
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course, helix_course

mm = st.floats(-3000.0, 3000.0)


@given(mm, mm, mm, st.tuples(*[st.floats(-180.0, 180.0)] * 3))
def test_courses_are_turned_about_fixed_axes_and_moved_by_l1_l2_and_minus_l3(
    l1: float, l2: float, l3: float, degrees: tuple[float, float, float]
) -> None:
    setup = setup_of(f"[part]\nl1_mm = {l1!r}\nl2_mm = {l2!r}\nl3_mm = {l3!r}\nrotation_deg = {list(degrees)}")
    (sx, sy, sz), (cx, cy, cz) = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    turn = (
        np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    )
    courses = (flat_course(3), helix_course(4))
    for course, path in zip(courses, courses_in_machine(courses, setup), strict=True):
        assert path.number == course.number
        expected = course.points @ turn.T + np.array([l1, l2, -l3]) / 1e3
        np.testing.assert_allclose(path.points, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(path.normals, course.normals @ turn.T, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(path.arc_lengths, course.arc_lengths)


def test_one_angle_turns_about_the_vertical() -> None:
    (path,) = courses_in_machine(
        [flat_course()], setup_of("[part]\nl1_mm = 0\nl2_mm = 0\nl3_mm = 0\nrotation_deg = 90")
    )
    np.testing.assert_allclose(
        path.points,
        np.stack([-flat_course().points[:, 1], flat_course().points[:, 0], 0 * flat_course().points[:, 2]], axis=1),
        atol=1e-15,
    )


@pytest.mark.parametrize("thickness", [0.0, 1.5, 5.0])
def test_laid_plies_lift_a_course_along_its_normals_and_lengthen_it_over_a_cylinder(thickness: float) -> None:
    course = helix_course(heading=0.0)
    (path,) = courses_in_machine([course], setup_of(f"[part]\nlaid_thickness_mm = {thickness}"))
    (before,) = courses_in_machine([course], setup_of())
    np.testing.assert_allclose(path.points, before.points + thickness / 1e3 * before.normals, atol=1e-14)
    assert path.length == pytest.approx(course.length * (1.5 + thickness / 1e3) / 1.5, abs=1e-8)


def test_where_a_course_counts_from_does_not_matter() -> None:
    course = flat_course()
    shifted = type(course)(1, course.points, course.normals, course.arc_lengths + math.pi, course.cut_angles)
    (path,) = courses_in_machine([shifted], setup_of())
    np.testing.assert_allclose(path.arc_lengths, course.arc_lengths, atol=1e-12)
