"""Normal check: one damaged normal is named, while creases, coarse points and random plies pass."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses
from tests.helpers.course_files import refusal
from tests.helpers.plies import Chance
from tests.helpers.surfaces import SQUARE, bracket_courses, circle_course, flat_course, helix_course


def with_normal(course: Course, row: int, normal: Floats) -> Course:
    normals = course.normals.copy()
    normals[row] = normal
    return replace(course, normals=normals)


def turned(course: Course, row: int, degrees: float, sideways: bool) -> Course:
    """The course with one normal turned about its tangent (sideways) or about the roller's axis."""
    tangent = np.gradient(course.points, axis=0)[row]
    across = np.cross(tangent, course.normals[row])
    aim = across if sideways else np.cross(course.normals[row], across)
    angle = np.radians(degrees)
    normal = np.cos(angle) * course.normals[row] + np.sin(angle) * aim / np.linalg.norm(aim)
    return with_normal(course, row, normal)


@pytest.mark.parametrize("course", [flat_course(), helix_course(), *bracket_courses(1)], ids=["flat", "helix", "bent"])
@pytest.mark.parametrize("sideways", [True, False])
@pytest.mark.parametrize("row", [1, 2, 20, -3, -2])
def test_a_single_damaged_normal_is_named(course: Course, sideways: bool, row: int) -> None:
    damaged = turned(course, row, 8.0, sideways)
    point = np.arange(len(course.points))[row] + 1
    text = refusal(format_courses([damaged]))
    assert "\n" not in text
    assert re.search(rf"course 1, point {point}: the normal turns (7\.[5-9]|8\.0) deg", text)


@pytest.mark.parametrize("row", [0, -1])
def test_a_damaged_normal_at_an_end_leans_along_the_course(row: int) -> None:
    text = refusal(format_courses([turned(helix_course(), row, 12.0, False)]))
    assert "deg off the perpendicular of the course" in text and "\n" not in text


def test_two_damaged_normals_do_not_excuse_each_other() -> None:
    course = turned(turned(helix_course(), 20, 20.0, True), 22, 20.0, True)
    assert [line.split(":")[2] for line in refusal(format_courses([course])).splitlines()] == [
        " course 1, point 21",
        " course 1, point 23",
    ]


@pytest.mark.parametrize("course", [flat_course(), helix_course()], ids=["flat", "helix"])
@pytest.mark.parametrize("rows", [slice(0, 1), slice(-1, None), slice(10, None), slice(10, 12), slice(10, 11)])
def test_normals_to_the_other_side_are_named_where_they_begin_and_end(course: Course, rows: slice) -> None:
    normals = course.normals.copy()
    normals[rows] *= -1.0
    text = refusal(format_courses([replace(course, normals=normals)]))
    first, last, _ = rows.indices(len(normals))
    points = [row + 1 for row in (first, last) if 0 < row < len(normals)]
    told = [int(line.split("point ")[1].split(":")[0]) for line in text.splitlines()]
    if last - first == 1 and len(points) == 2:
        assert told == points[:1] and "away from those of both neighbours" in text
    else:
        assert told == points and text.count("one of the two points into the surface; reverse") == len(points)


def folded(n: int, degrees: float, offset: float) -> Course:
    """A course over a crease; the normal turns within one step, as the surface does."""
    angle = np.radians(degrees)
    arcs = np.linspace(0.0, 0.2, n)
    beyond = np.maximum(arcs - 0.1 - offset, 0.0)
    before = arcs - beyond
    points = np.stack([0 * arcs, before + beyond * np.cos(angle), -beyond * np.sin(angle)], axis=1)
    normals = np.where(beyond[:, None] > 0, [0.0, np.sin(angle), np.cos(angle)], [0.0, 0.0, 1.0])
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Course(1, points, normals, np.concatenate([[0.0], np.cumsum(chords)]), SQUARE)


@given(st.integers(5, 41), st.floats(0.0, 60.0), st.floats(-0.01, 0.01))
def test_a_crease_passes(n: int, degrees: float, offset: float) -> None:
    parse_courses(format_courses([folded(n, degrees, offset)]), "f")


@pytest.mark.parametrize("count", [3, 4, 5, 7, 20])
def test_coarse_points_pass(count: int) -> None:
    parse_courses(format_courses([helix_course(n=count, length=0.05 * count, radius=0.4 * count / 3)]), "f")
    parse_courses(format_courses([*bracket_courses(4), circle_course(9)]), "f")


def test_normals_of_alternating_facets_pass() -> None:
    """A course that runs along the edge between two rows of facets takes its normals from one and the other."""
    course = flat_course(n=40)
    tilt = np.radians(6.0) * (np.arange(40) % 2)
    normals = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1)
    parse_courses(format_courses([replace(course, normals=normals)]), "f")


@given(st.integers(0, 2**32 - 1))
def test_random_plies_pass(seed: int) -> None:
    courses, _ = Chance(seed).ply()
    parse_courses(format_courses(courses), "f")
