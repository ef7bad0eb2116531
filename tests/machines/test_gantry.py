"""Gantry: the closed form against Pinocchio, the paper's form and its errata, and every refusal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.errors import ModelRefused
from tapelayer.machines import gantry
from tapelayer.machines.gantry import POSE, Lengths, Published, Roller
from tapelayer.machines.machine import CHUNK, Machine
from tests.helpers.machines import LENGTHS, tape_layer
from tests.helpers.paths import EXAMPLES
from urdf import TAPELAYER

BARE = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.0)

BODY = pinocchio.FrameType.BODY
ROUND = np.radians([0.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0]).tolist()
HEADINGS = np.radians([0.0, 30.0, -30.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0, 180.0, -180.0]).tolist()
heading = st.one_of(st.sampled_from(HEADINGS), st.floats(-np.pi, np.pi))
roll = st.one_of(st.sampled_from(ROUND), st.floats(-1.5, 1.5))
slide = st.one_of(st.sampled_from([0.0, 0.8, 2.0, 2.5]), st.floats(0.0, 2.5))
component = st.floats(-1.0, 1.0)
vector = st.tuples(component, component, component)


def reached(joints: Floats, frame: str) -> Floats:
    """Poses (n, 4, 4) of a frame by Pinocchio for (n, 5) pose values."""
    q = np.zeros((len(joints), len(tape_layer().axes)))
    q[:, [tape_layer().column(name) for name in POSE]] = joints
    return tape_layer().forward_pinocchio(q, frame)


def rows(*values: float) -> Floats:
    return np.array([values])


def course_file(name: str) -> list[Floats]:
    """Courses of a file as (n, 6) points in `machine` axes and normals, metres, by the default l1, l2, l3."""
    courses: list[Floats] = []
    for block in (EXAMPLES / name).read_text().split("start")[1:]:
        samples = np.array([line.split() for line in block.split("end")[0].strip().splitlines()[1:]], dtype=float)
        samples[:, :3] = (samples[:, :3] + [300.0, -1900.0, -1400.0]) / 1000.0
        samples[:, 3:6] /= np.linalg.norm(samples[:, 3:6], axis=1)[:, None]
        courses.append(samples[:, :6])
    return courses


def along(course: Floats) -> Floats:
    """Travel directions by central differences: enough for angles of a tenth of a degree."""
    return np.gradient(course[:, :3], axis=0)


def test_lengths_are_those_of_the_file() -> None:
    assert gantry.lengths(tape_layer()) == LENGTHS


@given(d1=slide, d2=slide, d3=slide, c=heading, a=roll, pitch=st.one_of(st.sampled_from(ROUND), st.floats(-1.5, 1.5)))
def test_the_inverse_gives_back_the_pose_that_was_taken(
    d1: float, d2: float, d3: float, c: float, a: float, pitch: float
) -> None:
    pose = rows(d1, d2, d3, c, a)
    roller = reached(pose, "roller")
    h, m = roller[:, :3, 0], roller[:, :3, 2]
    # The surface touches the roller anywhere round it: at `pitch` from the nose.
    n = np.cos(pitch) * m - np.sin(pitch) * h
    t = np.cos(pitch) * h + np.sin(pitch) * m
    point = roller[:, :3, 3] - LENGTHS.radius * n
    found = gantry.inverse(tape_layer(), point, n, t)
    difference = found[0] - pose
    difference[:, 3] = np.remainder(difference[:, 3] + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[1, :, 3:], [[found[0, 0, 3] + np.pi, -found[0, 0, 4]]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(gantry.wrap(pose, t), pitch, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(Roller(LENGTHS).joints(point, n, t), found[0])


@given(point=vector, normal=vector, tangent=vector)
def test_both_branches_put_the_roller_on_the_surface(
    point: tuple[float, ...], normal: tuple[float, ...], tangent: tuple[float, ...]
) -> None:
    p, n, t = rows(*point), rows(*normal), rows(*tangent)
    assume(np.linalg.norm(n) > 0.1 and np.linalg.norm(t) > 0.1)
    n /= np.linalg.norm(n)
    axis = np.cross(t, n)
    assume(np.linalg.norm(axis) > 0.01 * np.linalg.norm(t))
    axis /= np.linalg.norm(axis)
    assume(np.hypot(axis[0, 0], axis[0, 1]) > 0.01)
    found = gantry.inverse(tape_layer(), p, n, t)
    for joints, sense in zip(found, (1.0, -1.0), strict=True):
        roller = reached(joints, "roller")[0]
        np.testing.assert_allclose(-roller[:3, 1], sense * axis[0], rtol=0, atol=1e-12)
        # The contact line lies in the tangent plane and goes through the point.
        assert abs(roller[:3, 1] @ n[0]) <= 1e-12
        np.testing.assert_allclose(roller[:3, 3] - LENGTHS.radius * n[0], p[0], rtol=0, atol=1e-12)
        # The heading is level, square to the roller, and along the travel (branch 0) or against it (branch 1).
        assert abs(roller[2, 0]) <= 1e-12
        assert abs(roller[:3, 0] @ axis[0]) <= 1e-12
    assert -np.pi / 2 < found[0, 0, 4] < np.pi / 2


@given(c=heading, a=roll, t=vector)
def test_normals_wrap_and_slides_are_those_of_pinocchio(c: float, a: float, t: tuple[float, ...]) -> None:
    pose = rows(0.3, 0.4, 0.5, c, a)
    contact = reached(pose, "contact")[0]
    direction = rows(*t)
    np.testing.assert_allclose(gantry.normals(pose)[0], contact[:3, 2], rtol=0, atol=1e-12)
    level, climb = direction[0] @ contact[:3, 0], direction[0] @ contact[:3, 2]
    assume(np.hypot(level, climb) > 1e-3)
    angle = gantry.wrap(pose, direction)[0]
    np.testing.assert_allclose(
        [np.cos(angle), np.sin(angle)], np.array([level, climb]) / np.hypot(level, climb), atol=1e-9
    )
    moved = pose.copy()
    moved[0, :3] += gantry.slides(direction[0])
    np.testing.assert_allclose(reached(moved, "contact")[0, :3, 3] - contact[:3, 3], direction[0], rtol=0, atol=1e-12)


@given(d1=slide, d2=slide, d3=slide, c=heading, a=roll, changes=st.tuples(*[component] * 5))
@pytest.mark.parametrize(("frame", "reach"), [("contact", LENGTHS.l6), ("roller", LENGTHS.l6 - LENGTHS.radius)])
def test_tool_points_roller_axes_and_their_changes_are_those_of_pinocchio(
    frame: str, reach: float, d1: float, d2: float, d3: float, c: float, a: float, changes: tuple[float, ...]
) -> None:
    pose, change = rows(d1, d2, d3, c, a), rows(*changes)
    seen = reached(pose, frame)[0]
    np.testing.assert_allclose(gantry.tool_points(LENGTHS, reach, pose)[0], seen[:3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(gantry.roller_axes(pose)[0], -seen[:3, 1], rtol=0, atol=1e-12)
    model = tape_layer().model
    q, speed = np.zeros(model.nq), np.zeros(model.nv)
    for name, value, rate in zip(POSE, pose[0], change[0], strict=True):
        q[model.idx_qs[model.getJointId(name)]] = value
        speed[model.idx_vs[model.getJointId(name)]] = rate
    aligned = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pinocchio.computeFrameJacobian(model, model.createData(), q, model.getFrameId(frame, BODY), aligned)
    twist = jacobian @ speed
    moved, turned = gantry.tool_effects(LENGTHS, reach, pose, change)
    np.testing.assert_allclose(moved[0], twist[:3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(turned[0], np.cross(twist[3:], -seen[:3, 1]), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("normal", "tangent"),
    [
        ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
        ((0.6, 0.0, 0.8), (-1.2, 0.0, -1.6)),
        ((0.6, 0.0, 0.8), (0.6 + 1e-12, 0.0, 0.8)),
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
        ((1.0, 1e-12, 0.0), (0.0, 1.0, 1e-12)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
        ((np.nan, 0.0, 1.0), (0.0, 1.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, np.nan, 0.0)),
    ],
)
def test_a_point_without_a_pose_is_nan_in_every_axis_and_alone(
    normal: tuple[float, ...], tangent: tuple[float, ...]
) -> None:
    n = np.array([(0.0, 0.0, 1.0), normal, (0.0, 0.0, 1.0)])
    t = np.array([(0.0, 1.0, 0.0), tangent, (0.0, 1.0, 0.0)])
    found = gantry.inverse(tape_layer(), np.zeros((3, 3)), n, t)
    assert np.isnan(found[:, 1]).all()
    assert np.isfinite(found[:, [0, 2]]).all()


def test_a_vertical_path_still_has_a_heading() -> None:
    # Straight up a wall that faces -y: the roller lies level, and the head comes from above.
    found = gantry.inverse(tape_layer(), rows(0.0, 0.0, -1.0), rows(0.0, -1.0, 0.0), rows(0.0, 0.0, 1.0))
    np.testing.assert_allclose(found[0, 0, 3:], [0.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(gantry.wrap(found[0], rows(0.0, 0.0, 1.0)), np.pi / 2, rtol=0, atol=1e-15)


def test_without_a_roller_on_level_square_courses_the_exact_form_is_the_papers() -> None:
    chance = np.random.default_rng(3)
    for theta4, theta5 in zip(chance.uniform(-3, 3, 50), chance.uniform(0.0, 1.5, 50), strict=True):
        t = rows(np.sin(theta4), np.cos(theta4), 0.0)
        n = rows(-np.cos(theta4) * np.sin(theta5), np.sin(theta4) * np.sin(theta5), np.cos(theta5))
        points = rows(0.1, -1.2, -1.3) + np.linspace(0.0, 1.0, 5)[:, None] * t
        n, t = np.repeat(n, 5, axis=0), np.repeat(t, 5, axis=0)
        printed = gantry.closed_form(BARE, "published", points[0], points[-1])
        np.testing.assert_allclose(printed.joints(points, n, t), Roller(BARE).joints(points, n, t), rtol=0, atol=1e-9)


@given(point=vector, theta4=heading, normal=vector)
def test_the_papers_form_puts_frame_contact_on_the_point(
    point: tuple[float, ...], theta4: float, normal: tuple[float, ...]
) -> None:
    n = rows(*normal)
    assume(np.linalg.norm(n) > 0.1)
    n /= np.linalg.norm(n)
    joints = Published(LENGTHS, theta4).joints(rows(*point), n, np.zeros((1, 3)))
    np.testing.assert_allclose(reached(joints, "contact")[0, :3, 3], point, rtol=0, atol=1e-12)
    assert joints[0, 3] == theta4
    np.testing.assert_allclose(np.cos(joints[0, 4]), n[0, 2], rtol=0, atol=1e-12)


def test_a_closed_course_has_no_chord_and_so_no_published_pose() -> None:
    end = np.array([1.0, 2.0, 3.0])
    joints = gantry.closed_form(LENGTHS, "published", end, end + [0.0, 0.0, 0.1]).joints(
        end[None], rows(0.0, 0.0, 1.0), rows(0.0, 1.0, 0.0)
    )
    assert np.isnan(joints).all()
    nan = Published(LENGTHS, 0.0).joints(end[None], rows(0.0, 0.0, np.nan), rows(0.0, 1.0, 0.0))
    assert np.isnan(nan).all()


def rotation(axis: int, degrees: float) -> Floats:
    """Homogeneous rotation about a coordinate axis."""
    pose = np.eye(4)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    pose[first, first] = pose[second, second] = cosine
    pose[first, second], pose[second, first] = -sine, sine
    return pose


def test_e3_the_translation_of_equation_4() -> None:
    l1, l2, l3 = 0.3, -1.9, 1.4
    shift = np.eye(4)
    shift[:3, 3] = l1, l2, l3
    product = rotation(2, -90) @ rotation(1, 180) @ shift
    printed = np.array([[0, 1, 0, l1], [1, 0, 0, l2], [0, 0, -1, -l3], [0, 0, 0, 1]])
    np.testing.assert_allclose(product[:3, :3], printed[:3, :3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(product[:3, 3], [l2, l1, -l3], rtol=0, atol=1e-15)
    assert np.max(np.abs(product[:3, 3] - printed[:3, 3])) == pytest.approx(2.2, abs=1e-12)


def test_e4_the_printed_d2_lays_the_mirror_image() -> None:
    points = np.array([[0.2, 0.9, -1.3], [1.2, 1.9, -1.3]])
    theta4, theta5 = np.pi / 4, 0.3
    pose = np.empty((2, 5))
    pose[:, 0] = points[:, 0] - np.cos(theta4) * np.sin(theta5) * 0.45 + np.sin(theta4) * 0.06
    pose[:, 1] = points[:, 1] - np.sin(theta4) * np.sin(theta5) * 0.45 - np.cos(theta4) * 0.06
    pose[:, 2] = -points[:, 2] - 0.35 - np.cos(theta5) * 0.45
    pose[:, 3:] = theta4, theta5
    laid = reached(pose, "contact")[:, :3, 3]
    np.testing.assert_allclose(laid, points * [1.0, -1.0, 1.0], rtol=0, atol=1e-12)
    (dx, dy), (lx, ly) = (points[1] - points[0])[:2], (laid[1] - laid[0])[:2]
    assert np.degrees(np.arctan2(dx, dy)) == pytest.approx(45.0)
    # +45 deg becomes 135 deg, which as a fibre direction is -45 deg.
    assert np.degrees(np.arctan2(lx, ly)) == pytest.approx(135.0)


@pytest.mark.parametrize(
    ("last", "theta4"), [((1.0, 0.0), 90.0), ((-1.0, 0.0), -90.0), ((0.0, -1.0), 180.0), ((-1.0, -1.0), -135.0)]
)
def test_e5_a_quotient_loses_the_quadrant(last: tuple[float, float], theta4: float) -> None:
    published = gantry.closed_form(LENGTHS, "published", np.zeros(3), np.array([*last, 0.0]))
    assert isinstance(published, Published)
    assert np.degrees(published.theta4) == pytest.approx(theta4)
    if last[1] == 0.0:
        with pytest.raises(ZeroDivisionError):
            np.arctan(last[0] / last[1])
    else:
        printed = np.degrees(np.arctan(last[0] / last[1]))
        assert abs(np.remainder(printed - theta4, 360.0)) == pytest.approx(180.0)


@pytest.mark.parametrize(("name", "worst"), [("cylinder_panel_15.txt", 28.4), ("boss_panel_20.txt", 5.5)])
def test_e6_the_published_roll_lifts_the_roller_off_the_surface(name: str, worst: float) -> None:
    tilts = {"roller": 0.0, "published": 0.0}
    kinds: tuple[gantry.Kinematics, ...] = ("roller", "published")
    for course in course_file(name):
        points, normals = course[:, :3], course[:, 3:]
        for kind in kinds:
            joints = gantry.closed_form(LENGTHS, kind, points[0], points[-1]).joints(points, normals, along(course))
            axes = reached(joints, "roller")[:, :3, 1]
            tilt = np.degrees(np.max(np.abs(np.arcsin(np.sum(axes * normals, axis=1)))))
            tilts[kind] = max(tilts[kind], float(tilt))
    assert tilts["published"] == pytest.approx(worst, abs=0.05)
    assert tilts["roller"] < 1e-12


def test_e7_one_heading_a_course_is_off_by_nearly_a_degree() -> None:
    worst = 0.0
    for course in course_file("cylinder_panel_15.txt"):
        points, normals = course[:, :3], course[:, 3:]
        published = gantry.closed_form(LENGTHS, "published", points[0], points[-1])
        exact = Roller(LENGTHS).joints(points, normals, along(course))
        assert isinstance(published, Published)
        worst = max(worst, float(np.degrees(np.max(np.abs(exact[:, 3] - published.theta4)))))
    assert worst == pytest.approx(0.92, abs=0.01)


@pytest.mark.parametrize("count", [0, 1, CHUNK, CHUNK + 1, 2 * CHUNK + 3])
def test_chunks_join_without_a_seam(count: int) -> None:
    chance = np.random.default_rng(4)
    points, tangents = chance.normal(size=(count, 3)), chance.normal(size=(count, 3))
    normals = chance.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = gantry.inverse(tape_layer(), points, normals, tangents)
    assert found.shape == (2, count, 5)
    for row in sorted({0, CHUNK - 1, CHUNK, count - 1} & set(range(count))):
        alone = slice(row, row + 1)
        np.testing.assert_array_equal(
            found[:, alone], gantry.inverse(tape_layer(), points[alone], normals[alone], tangents[alone])
        )


@pytest.mark.parametrize(
    ("shapes", "sentence"),
    [
        (((4,), (4, 3), (4, 3)), r"points have shape (4,), expected (4, 3)"),
        (((4, 3), (3, 3), (4, 3)), r"normals have shape (3, 3), expected (4, 3)"),
        (((4, 3), (4, 3), (4, 2)), r"tangents have shape (4, 2), expected (4, 3)"),
    ],
)
def test_rows_that_do_not_match(shapes: tuple[tuple[int, ...], ...], sentence: str) -> None:
    for form in (Roller(LENGTHS), Published(LENGTHS, 0.0)):
        with pytest.raises(ValueError) as refused:
            form.joints(*(np.ones(shape) for shape in shapes))
        assert str(refused.value) == sentence


def changed(tmp_path: Path, *replacements: tuple[str, str]) -> Machine:
    """The built-in machine with parts of its text replaced."""
    text = TAPELAYER.read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "changed.urdf"
    path.write_text(text)
    return Machine.load(path)


def test_other_lengths_are_read_and_used(tmp_path: Path) -> None:
    other = changed(
        tmp_path,
        ('<origin xyz="-0.06 0 -0.35"/>', '<origin xyz="-0.1 0 -0.5"/>'),
        ('<origin xyz="0 0 -0.41"/>', '<origin xyz="0 0 -0.6"/>'),
        ('<origin xyz="0 0 -0.04"/>', '<origin xyz="0 0 -0.025"/>'),
    )
    assert gantry.lengths(other) == Lengths(l4=0.5, l5=0.1, l6=0.625, radius=0.025)
    point, normal = rows(0.5, -1.0, -1.6), rows(0.0, 0.0, 1.0)
    found = gantry.inverse(other, point, normal, rows(1.0, 1.0, 0.0))
    for joints in found:
        q = np.zeros((1, 10))
        q[:, :5] = joints
        np.testing.assert_allclose(other.forward_pinocchio(q, "contact")[0, :3, 3], point[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("replacements", "sentence"),
    [
        (
            [('<joint name="c"', '<joint name="w"')],
            "the tape layer needs revolute axis 'c'; the axes are x, y, z, w, a, u",
        ),
        (
            [('<joint name="c" type="revolute">', '<joint name="c" type="prismatic">')],
            "the tape layer needs revolute axis 'c'; this one is prismatic",
        ),
        (
            [('<joint name="x" type="prismatic">', '<joint name="x" type="revolute">')],
            "the tape layer needs prismatic axis 'x'; this one is revolute",
        ),
        ([('"contact"', '"nose"')], "no frame 'contact'; the nearest name is 'contact_fixed'"),
        ([('<axis xyz="0 -1 0"/>', '<axis xyz="0 1 0"/>')], "not the chain of the tape layer: at x"),
        ([('<axis xyz="-1 0 0"/>', '<axis xyz="1 0 0"/>')], "not the chain of the tape layer: at x"),
        (
            [('<origin xyz="-0.06 0 -0.35"/>', '<origin xyz="-0.06 0.01 -0.35"/>')],
            "not the chain of the tape layer: at x",
        ),
        ([('rpy="0 0 1.5707963267948966"', 'rpy="0 0 1.5708"')], "not the chain of the tape layer: at x"),
        ([('xyz="0 0 -0.41"/>', 'xyz="0 0 -0.41" rpy="0 0.001 0"/>')], "not the chain of the tape layer: at x"),
        ([('<parent link="cutter"/><child link="tape"/>', '<parent link="knife_1"/><child link="tape"/>')], ""),
        (
            [('<origin xyz="0 0 -0.04"/>', '<origin xyz="0 0 0.04"/>')],
            "the roller's radius is -40.000 mm (frames roller and contact), expected 0 to less than l6 = 370.000 mm",
        ),
    ],
)
def test_a_chain_that_is_not_the_tape_layers_is_refused(
    tmp_path: Path, replacements: list[tuple[str, str]], sentence: str
) -> None:
    machine = changed(tmp_path, *replacements)
    if not sentence:
        # What hangs on the tape does not matter to the pose.
        assert gantry.lengths(machine) == LENGTHS
        return
    with pytest.raises(ModelRefused) as refused:
        gantry.inverse(machine, np.zeros((1, 3)), rows(0.0, 0.0, 1.0), rows(0.0, 1.0, 0.0))
    assert str(refused.value).startswith(f"{machine.path}: {sentence}")
    assert "\n" not in str(refused.value)


def test_the_refusal_of_a_chain_says_where_and_by_how_much(tmp_path: Path) -> None:
    machine = changed(tmp_path, ('<origin xyz="0 0 -0.41"/>', '<origin xyz="0 0.001 -0.41"/>'))
    with pytest.raises(ModelRefused) as refused:
        gantry.lengths(machine)
    assert "frame contact is 1.000000 mm and 0.000000 deg from eq. (3)" in str(refused.value)
    assert "l4 = 350.000, l5 = 60.000, l6 = 450.000 mm" in str(refused.value)
