"""Heading range: the travel of the head's turn that courses need, known before any program is made of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.courses.course import Course
from tapelayer.laying.course_splines import CourseSpline
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.machines.gantry import POSE, inverse
from tapelayer.machines.machine import Machine

TURN = 2.0 * np.pi
# Angles this close, in turns, are one.
ROUNDING = 1e-9


def heading_range(courses: Sequence[Course], setup: Setup, machine: Machine) -> tuple[float, float]:
    """Return the least and the greatest c of courses, in radians, with whole turns that make the range smallest.

    Args:
        courses: in the part's frame.
        setup: says where the part is.
        machine: the gantry.

    Examples:
        >>> points, normals = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
        >>> there = Course(1, points, normals, np.array([0.0, 1.0]), (np.pi / 2, np.pi / 2))
        >>> back = Course(2, points[::-1], normals, np.array([0.0, 1.0]), (np.pi / 2, np.pi / 2))
        >>> np.degrees(heading_range([there], Setup(), Machine.load())).round(6).tolist()
        [0.0, 0.0]
        >>> np.degrees(np.ptp(heading_range([there, back], Setup(), Machine.load()))).round(6).tolist()
        180.0
    """
    axis = machine.axis("c")
    ranges = []
    for path in courses_in_machine(courses, setup):
        spline = CourseSpline(path)
        joints = inverse(machine, path.points, path.normals, spline.slopes(spline.knots))[0]
        turned = joints[:, POSE.index("c")]
        turned = np.unwrap(turned[np.isfinite(turned)])
        if len(turned):
            ranges.append((np.min(turned), np.max(turned)))
    if not ranges:
        return np.nan, np.nan
    lows, highs = np.array(ranges).T
    # The range begins with one of the courses, and all others follow within a turn of its least angle.
    turns = np.ceil((lows[:, None] - lows) / TURN - ROUNDING)
    greatest = np.max(highs + turns * TURN, axis=1)
    begin = int(np.argmin(np.round(greatest - lows, 9)))
    least, most = float(lows[begin]), float(greatest[begin])
    into = TURN * round(((axis.lower + axis.upper) / 2.0 - (least + most) / 2.0) / TURN)
    return least + into, most + into
