"""urdf/tapelayer.urdf against the paper, against yourdfpy, and against the conventions of the tape."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tests.helpers.machines import by_yourdfpy
from urdf import TAPELAYER

AXES = tuple("xyzcauvdqe")
FRAMES = ("base_0", "roller", "contact", "knife_1", "knife_2", "tape")
L4, L5, L6, RADIUS, KNIFE_PITCH = 0.35, 0.06, 0.45, 0.04, 0.1
LIMITS = {
    "x": (0.0, 2.5),
    "y": (0.0, 2.0),
    "z": (0.0, 0.8),
    "c": (-np.pi / 6, np.pi / 6),
    "a": (-np.pi, np.pi),
    "u": (0.0, 2000.0),
    "v": (-0.2, 0.2),
    "d": (-np.pi * 4 / 9, np.pi * 4 / 9),
    "q": (-0.2, 0.2),
    "e": (-np.pi * 4 / 9, np.pi * 4 / 9),
}

# Thousandths, because yourdfpy's scene graph drops a joint that stands closer than 1e-8 to its zero.
fractions = st.tuples(*[st.integers(0, 1000).map(lambda share: share / 1000)] * len(AXES))
angle = st.one_of(
    st.sampled_from(np.radians([-180, -90, -45, -30, 0, 30, 45, 90, 180]).tolist()), st.floats(-np.pi, np.pi)
)
length = st.floats(0.0, 3.0)


@cache
def model() -> pinocchio.Model:
    return pinocchio.buildModelFromUrdf(str(TAPELAYER), mimic=True)


def pinocchio_pose(values: dict[str, float], frame: str) -> Floats:
    q = np.zeros(model().nq)
    for name, value in values.items():
        q[model().idx_qs[model().getJointId(name)]] = value
    data = model().createData()
    pinocchio.framesForwardKinematics(model(), data, q)
    pose: Floats = data.oMf[model().getFrameId(frame, pinocchio.FrameType.BODY)].homogeneous.copy()
    return pose


def modified_dh(link_length: float, alpha: float, offset: float, theta: float) -> Floats:
    """Craig's matrix: the paper's eq. (1) with the sign of E1 mended."""
    ct, sn, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -sn, 0.0, link_length],
            [sn * ca, ct * ca, -sa, -offset * sa],
            [sn * sa, ct * sa, ca, offset * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def chain(d1: float, d2: float, d3: float, theta4: float, theta5: float, fifth_length: float) -> Floats:
    """Table 1 multiplied out, with the link length of row 5 given."""
    right = np.pi / 2
    pose = np.eye(4)
    for row in (
        (0.0, 0.0, d1, 0.0),
        (0.0, right, d2, right),
        (0.0, right, d3, 0.0),
        (0.0, 0.0, L4, theta4),
        (fifth_length, -right, L5, theta5),
    ):
        pose = pose @ modified_dh(*row)
    last = np.eye(4)
    last[1, 3] = -L6
    return pose @ last


def equation_3(d1: float, d2: float, d3: float, theta4: float, theta5: float) -> Floats:
    return np.array(
        [
            np.cos(theta5) * L6 + L4 + d3,
            -np.sin(theta4) * np.sin(theta5) * L6 - np.cos(theta4) * L5 - d2,
            np.cos(theta4) * np.sin(theta5) * L6 - np.sin(theta4) * L5 + d1,
        ]
    )


def contact_in_base(values: dict[str, float]) -> Floats:
    return np.asarray(np.linalg.inv(pinocchio_pose(values, "base_0")) @ pinocchio_pose(values, "contact"))


def test_the_axes_are_those_of_the_paper_with_the_travel_of_table_1() -> None:
    assert sorted(model().names[1:]) == sorted(AXES)
    assert {joint.shortname() for joint in model().joints[1:]} <= {
        f"JointModel{kind}" for kind in ("PX", "PY", "RX", "RZ", "PrismaticUnaligned", "RevoluteUnaligned")
    }
    for name, (lower, upper) in LIMITS.items():
        column = model().idx_qs[model().getJointId(name)]
        assert model().lowerPositionLimit[column] == pytest.approx(lower, abs=1e-15)
        assert model().upperPositionLimit[column] == pytest.approx(upper, abs=1e-15)
        assert model().velocityLimit[column] > 0


def test_the_root_is_machine_and_every_frame_is_there() -> None:
    assert by_yourdfpy(str(TAPELAYER)).base_link == "machine"
    for frame in FRAMES:
        assert model().existFrame(frame, pinocchio.FrameType.BODY)
    u = next(joint for joint in by_yourdfpy(str(TAPELAYER)).robot.joints if joint.name == "u")
    assert u.child == "tape"


@given(d1=length, d2=length, d3=length, theta4=angle, theta5=angle)
def test_contact_in_base_0_is_equation_3(d1: float, d2: float, d3: float, theta4: float, theta5: float) -> None:
    pose = contact_in_base({"x": d1, "y": d2, "z": d3, "c": theta4, "a": theta5})
    np.testing.assert_allclose(pose[:3, 3], equation_3(d1, d2, d3, theta4, theta5), rtol=0, atol=1e-12)


@given(d1=length, d2=length, d3=length, theta4=angle, theta5=angle)
def test_the_mended_dh_chain_is_the_urdf(d1: float, d2: float, d3: float, theta4: float, theta5: float) -> None:
    mended = chain(d1, d2, d3, theta4, theta5, fifth_length=0.0)
    pose = contact_in_base({"x": d1, "y": d2, "z": d3, "c": theta4, "a": theta5})
    # Frame 6 has y = head normal and z = minus the heading; `contact` has x = heading, z = head normal.
    turned = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_allclose(mended @ turned, pose, rtol=0, atol=1e-12)


@given(theta4=angle, theta5=angle)
def test_e2_the_printed_table_is_off_by_l6_along_the_course(theta4: float, theta5: float) -> None:
    printed = chain(1.0, 0.5, 0.25, theta4, theta5, fifth_length=L6)[:3, 3]
    surplus = np.array([0.0, -L6 * np.sin(theta4), L6 * np.cos(theta4)])
    np.testing.assert_allclose(printed, equation_3(1.0, 0.5, 0.25, theta4, theta5) + surplus, rtol=0, atol=1e-12)


@pytest.mark.parametrize("alpha", [np.pi / 2, -np.pi / 2])
def test_e1_equation_1_as_printed_is_no_rotation(alpha: float) -> None:
    mended = modified_dh(0.1, alpha, 0.2, 0.3)
    printed = mended.copy()
    printed[1, 2] = np.sin(alpha)
    assert np.linalg.det(printed[:3, :3]) == pytest.approx(-1.0, abs=1e-12)
    assert np.linalg.det(mended[:3, :3]) == pytest.approx(1.0, abs=1e-12)


@given(c=angle, a=angle)
def test_contact_and_roller_carry_heading_left_and_head_normal(c: float, a: float) -> None:
    contact = pinocchio_pose({"x": 1.0, "y": 0.5, "z": 0.2, "c": c, "a": a}, "contact")
    roller = pinocchio_pose({"x": 1.0, "y": 0.5, "z": 0.2, "c": c, "a": a}, "roller")
    heading = np.array([np.sin(c), np.cos(c), 0.0])
    normal = np.array([-np.cos(c) * np.sin(a), np.sin(c) * np.sin(a), np.cos(a)])
    axis = np.array([np.cos(c) * np.cos(a), -np.sin(c) * np.cos(a), np.sin(a)])
    np.testing.assert_allclose(contact[:3, :3], np.stack([heading, -axis, normal], axis=1), rtol=0, atol=1e-12)
    np.testing.assert_allclose(roller[:3, :3], contact[:3, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(roller[:3, 3] - contact[:3, 3], RADIUS * normal, rtol=0, atol=1e-12)


@given(fractions)
def test_pinocchio_and_yourdfpy_agree_on_every_frame(shares: tuple[float, ...]) -> None:
    values = {
        name: lower + share * (upper - lower)
        for (name, (lower, upper)), share in zip(LIMITS.items(), shares, strict=True)
    }
    yourdf = by_yourdfpy(str(TAPELAYER))
    yourdf.update_cfg({name: values[name] for name in yourdf.actuated_joint_names})
    # Double precision carries 1e-12 m only while the tape is short: beyond 10 m of feed the comparison is relative.
    bound = 1e-12 * max(1.0, values["u"] / 10.0)
    for frame in FRAMES:
        np.testing.assert_allclose(
            pinocchio_pose(values, frame),
            yourdf.get_transform(frame, "machine"),
            rtol=0,
            atol=bound if frame == "tape" else 1e-12,
        )


@given(u=st.floats(0.0, 10.0), across=st.floats(-0.2, 0.2), turn=st.floats(-1.3962634, 1.3962634), c=angle, a=angle)
@pytest.mark.parametrize(("knife", "slide", "blade", "upstream"), [(1, "v", "d", 0.0), (2, "q", "e", KNIFE_PITCH)])
def test_a_knife_in_the_tape_reads_station_and_offset(
    knife: int, slide: str, blade: str, upstream: float, u: float, across: float, turn: float, c: float, a: float
) -> None:
    values = {"x": 0.4, "y": 1.1, "z": 0.3, "c": c, "a": a, "u": u, slide: across, blade: turn}
    tape = pinocchio_pose(values, "tape")
    seen = np.linalg.inv(tape) @ pinocchio_pose(values, f"knife_{knife}")
    np.testing.assert_allclose(seen[:3, 3], [-(u + upstream), across, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(seen[:3, 1], [np.sin(turn), np.cos(turn), 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(seen[:3, 2], [0.0, 0.0, 1.0], rtol=0, atol=1e-12)
    left = pinocchio_pose(values, "contact")[:3, 1]
    np.testing.assert_allclose(tape[:3, 1], left, rtol=0, atol=1e-12)


def test_the_tape_comes_straight_down_onto_the_roller() -> None:
    tape, roller, contact = (pinocchio_pose({}, frame) for frame in ("tape", "roller", "contact"))
    seen = np.linalg.inv(tape) @ roller
    # The tape's line is tangent to the roller on its mould side, and the path from knife 1 to the nip is 350 mm.
    assert seen[2, 3] == pytest.approx(-RADIUS, abs=1e-12)
    wrap = np.arccos(tape[:3, 0] @ -contact[:3, 0])
    assert seen[0, 3] + RADIUS * wrap == pytest.approx(0.35, abs=1e-12)
    assert tape[:3, 2] @ contact[:3, 2] < 0


def shapes_of(link: ElementTree.Element, tag: str) -> list[tuple[str, ...]]:
    """Name, place and size of each shape of a link, as text."""
    texts = []
    for element in link.findall(tag):
        origin, geometry = element.find("origin"), element.find("geometry")
        assert origin is not None and geometry is not None and len(geometry) == 1
        place = (origin.attrib["xyz"], origin.get("rpy", "0 0 0"))
        texts.append((element.get("name", ""), *place, geometry[0].tag, str(sorted(geometry[0].attrib.items()))))
    return texts


def test_what_is_drawn_can_be_collided_with_but_for_tape_and_paper() -> None:
    robot = ElementTree.parse(TAPELAYER).getroot()
    colours = {material.attrib["name"] for material in robot.findall("material")}
    bare = []
    for link in robot.findall("link"):
        drawn = shapes_of(link, "visual")
        rigid = [shape for shape in drawn if shape[0] not in ("tape", "paper")]
        bare += [shape[0] for shape in drawn if shape not in rigid]
        assert shapes_of(link, "collision") == rigid, link.attrib["name"]
        materials = {visual.find("material").attrib["name"] for visual in link.findall("visual")}  # type: ignore[union-attr]
        assert materials <= colours
    assert bare == ["tape", "paper"]


def test_the_auxiliary_roller_stands_still_above_the_mould() -> None:
    auxiliary, contact = (pinocchio_pose({}, frame) for frame in ("auxiliary_roller", "contact"))
    seen = np.linalg.inv(contact) @ auxiliary
    np.testing.assert_allclose(seen[:3, 3], [-0.105, 0.0, 0.05], rtol=0, atol=1e-12)
    np.testing.assert_allclose(seen[:3, :3], np.eye(3), rtol=0, atol=1e-12)
    robot = by_yourdfpy(str(TAPELAYER)).robot
    assert next(joint for joint in robot.joints if joint.child == "auxiliary_roller").type == "fixed"


def test_pinocchio_and_yourdfpy_read_every_collision_shape() -> None:
    shapes = ElementTree.parse(TAPELAYER).getroot().findall("link/collision")
    geometry = pinocchio.buildGeomFromUrdf(model(), str(TAPELAYER), pinocchio.GeometryType.COLLISION)
    links = by_yourdfpy(str(TAPELAYER)).robot.links
    assert len(shapes) == len(geometry.geometryObjects) == sum(len(link.collisions) for link in links) == 66
