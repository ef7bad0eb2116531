"""One course of tape."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tapelayer.courses.course import Course
from tapelayer.geometry.toolpath import Toolpath


def test_a_course_is_a_toolpath_with_cuts_that_nothing_changes() -> None:
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    course = Course(7, points, np.array([[0.0, 0.0, 1.0]] * 2), np.array([1.0, 6.0]), (0.5, 1.5))
    assert isinstance(course, Toolpath)
    assert (course.number, course.length, course.cut_angles) == (7, 5.0, (0.5, 1.5))
    for name in ("points", "normals", "arc_lengths"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(course, name)[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        course.number = 8  # type: ignore[misc]
