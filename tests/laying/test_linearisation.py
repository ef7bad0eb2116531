"""Few blocks, straight in joint space, that follow a course within the tolerances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.errors import PoseUndefined
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.laying.linearisation import CourseMotion, Poses, block_ends, course_motion
from tapelayer.laying.placing import courses_in_machine
from tapelayer.machines import gantry
from tapelayer.units import DEG
from tests.helpers.machines import LENGTHS, tape_layer
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import circle_course, flat_course, helix, helix_course

ORIGIN = np.array([0.3, -1.9, -1.4])


def motion_of(course: Toolpath, kinematics: gantry.Kinematics = "roller", radius: float | None = None) -> CourseMotion:
    path = courses_in_machine([course], setup_of())[0]  # type: ignore[list-item]
    return course_motion(path, LENGTHS, kinematics, LENGTHS.radius if radius is None else radius)


def ends_of(motion: CourseMotion, tolerance: float = 2e-5, axis_tolerance: float = 0.005 * DEG) -> Poses:
    return block_ends(motion, tolerance, axis_tolerance)


def full(joints: Floats) -> Floats:
    rows = np.zeros((len(joints), len(tape_layer().axes)))
    rows[:, [tape_layer().column(name) for name in gantry.POSE]] = joints
    return rows


def between(joints: Floats, count: int) -> Floats:
    steps = np.linspace(0.0, 1.0, count + 1)[:-1]
    inner = joints[:-1, None] + steps[:, None] * np.diff(joints, axis=0)[:, None]
    return np.vstack([inner.reshape(-1, joints.shape[1]), joints[-1:]])


@settings(deadline=None, max_examples=40)
@given(
    radius=st.floats(0.4, 20.0),
    heading=st.floats(-math.pi, math.pi),
    angle=st.floats(-0.15, 0.15),
    n=st.integers(30, 400),
    tolerance=st.floats(2e-6, 1e-3),
    axis_tolerance=st.floats(1e-5, 1e-2),
)
def test_joint_lines_stay_within_the_tolerances(
    radius: float, heading: float, angle: float, n: int, tolerance: float, axis_tolerance: float
) -> None:
    """Against the exact helix and Pinocchio's forward kinematics, on 40 places a block."""
    shape = {"radius": radius, "heading": heading, "start": (0.5, angle)}
    motion = motion_of(helix_course(length=0.5, n=n, **shape))
    poses = ends_of(motion, tolerance, axis_tolerance)
    arc_lengths = between(poses.arc_lengths[:, None], 40)[:, 0]
    points, normals, tangents = helix(arc_lengths, **shape)
    pose = tape_layer().forward(full(between(poses.joints, 40)), "roller")
    off = pose[:, :3, 3] - (points + ORIGIN + LENGTHS.radius * normals)
    # The file's spline is not the helix itself.
    spline = 1e-8 + 2 * (0.5 / n) ** 4 / radius**3
    assert np.max(np.linalg.norm(off, axis=1)) <= 1.03 * tolerance + spline
    assert np.max(np.linalg.norm(-pose[:, :3, 1] - np.cross(tangents, normals), axis=1)) <= 1.03 * axis_tolerance + 1e-5


def test_a_flat_course_is_one_block() -> None:
    assert len(ends_of(motion_of(flat_course(n=1000))).arc_lengths) == 2


def test_dense_points_are_merged_and_sparse_ones_get_blocks_between() -> None:
    counts = [len(ends_of(motion_of(helix_course(n=n))).arc_lengths) for n in (13, 61, 601, 3001)]
    assert counts[0] > 13
    assert counts[3] < 3001 / 10
    assert max(counts) < 1.5 * min(counts)


def test_half_the_tolerance_takes_about_root_two_times_the_blocks() -> None:
    motion = motion_of(helix_course(n=2001))
    coarse, fine = (len(ends_of(motion, tolerance).arc_lengths) - 1 for tolerance in (2e-5, 5e-6))
    assert 1.7 <= fine / coarse <= 2.3


def test_c_is_unwrapped_along_the_course() -> None:
    """A circle anticlockwise from above: the heading, from +y towards +x, falls by one turn."""
    poses = ends_of(motion_of(circle_course(turns=1.0)))
    assert poses.joints[-1, 3] - poses.joints[0, 3] == pytest.approx(-2 * math.pi, abs=1e-6)
    assert np.max(np.abs(np.diff(poses.joints[:, 3]))) < 0.2


def test_effects_are_the_derivatives_of_the_forward_model() -> None:
    chance = np.random.default_rng(7)
    joints = chance.uniform(-1.5, 1.5, (200, 5))
    changes = chance.uniform(-1.0, 1.0, (200, 5))
    step = 1e-6
    reach = LENGTHS.l6 - LENGTHS.radius
    point, axis = gantry.tool_effects(LENGTHS, reach, joints, changes)
    points = [gantry.tool_points(LENGTHS, reach, joints + sign * step * changes) for sign in (1, -1)]
    axes = [gantry.roller_axes(joints + sign * step * changes) for sign in (1, -1)]
    assert np.allclose(point, (points[0] - points[1]) / (2 * step), atol=1e-9)
    assert np.allclose(axis, (axes[0] - axes[1]) / (2 * step), atol=1e-9)


def test_tool_points_and_roller_axes_are_pinocchios() -> None:
    joints = np.random.default_rng(8).uniform(-3.0, 3.0, (300, 5))
    for frame, reach in (("contact", LENGTHS.l6), ("roller", LENGTHS.l6 - LENGTHS.radius)):
        pose = tape_layer().forward_pinocchio(full(joints), frame)
        assert np.max(np.abs(gantry.tool_points(LENGTHS, reach, joints) - pose[:, :3, 3])) < 1e-12
        assert np.max(np.abs(gantry.roller_axes(joints) + pose[:, :3, 1])) < 1e-12
        assert np.max(np.abs(gantry.normals(joints) - pose[:, :3, 2])) < 1e-12


def test_the_papers_form_is_followed_at_the_nose() -> None:
    motion = motion_of(helix_course(heading=0.0), "published")
    poses = ends_of(motion)
    arc_lengths = between(poses.arc_lengths[:, None], 20)[:, 0]
    pose = tape_layer().forward(full(between(poses.joints, 20)), "contact")
    points, _, _ = helix(arc_lengths, heading=0.0)
    assert np.max(np.linalg.norm(pose[:, :3, 3] - points - ORIGIN, axis=1)) < 2.1e-5


def test_a_path_along_its_normal_has_no_pose() -> None:
    up = Toolpath(
        4, np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 0.1]]), np.tile([0.0, 0.0, 1.0], (2, 1)), np.array([0.0, 0.1])
    )
    with pytest.raises(
        PoseUndefined, match=r"course 4 point 1: the roller has no pose here.*expected a path that lies on"
    ):
        motion_of(up)


def test_a_kink_in_the_normals_is_named() -> None:
    course = flat_course(3, n=3)
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    kink = Toolpath(3, course.points, normals, course.arc_lengths)
    with pytest.raises(PoseUndefined, match=r"course 3 point 3: the roller has no pose here"):
        motion_of(kink)
