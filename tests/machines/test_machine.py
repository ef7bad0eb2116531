"""Machine: the batch evaluator against Pinocchio and yourdfpy, limits, and every refusal."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.errors import ConfigurationRefused, ModelRefused
from tapelayer.machines.machine import CHUNK, Axis, Machine
from tests.helpers.machines import tape_layer
from urdf import TAPELAYER

ROBOTS = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
OWN = sorted(TAPELAYER.parent.glob("*.urdf"))
# Arms and hands: continuous joints (kinova, pr2, tiago_pro), mimic joints (panda, baxter, pr2, tiago_pro),
# unaligned axes (allegro, icub, alex).
FOREIGN = [
    ROBOTS / name
    for name in (
        "allegro_hand_description/urdf/allegro_left_hand.urdf",
        "alex_description/urdf/alex_sake_hands.urdf",
        "baxter_description/urdf/baxter.urdf",
        "icub_description/robots/icub.urdf",
        "kinova_description/robots/kinova.urdf",
        "panda_description/urdf/panda.urdf",
        "pr2_description/urdf/pr2.urdf",
        "talos_data/robots/talos_left_arm.urdf",
        "tiago_pro_description/robots/tiago_pro.urdf",
        "ur_description/urdf/ur5_robot.urdf",
    )
]
SPECIAL = np.radians([0.0, 30.0, -30.0, 45.0, -45.0, 90.0, -90.0, 180.0, -180.0, 360.0])


def sampled(machine: Machine, rows: int) -> Floats:
    """Poses over the whole travel: random ones, each end of travel, and round angles."""
    lower = np.array([max(axis.lower, -7.0) for axis in machine.axes])
    upper = np.array([min(axis.upper, 7.0) for axis in machine.axes])
    chance = np.random.default_rng(5)
    q = chance.uniform(lower, upper, (rows, len(lower)))
    round_angles = np.where(
        [axis.revolute for axis in machine.axes],
        SPECIAL[:, None],
        chance.uniform(lower, upper, (len(SPECIAL), 1, len(lower)))[:, 0],
    )
    mixed = np.where([axis.revolute for axis in machine.axes], chance.choice(SPECIAL, (rows, len(lower))), q)
    return np.vstack([q, lower, upper, 0.5 * (lower + upper), np.zeros(len(lower)), round_angles, mixed])


@pytest.mark.parametrize("path", [*OWN, *FOREIGN], ids=lambda path: path.stem)
def test_every_link_of_every_robot_is_where_pinocchio_puts_it(path: Path) -> None:
    machine = Machine.load(path)
    q = sampled(machine, 40)
    links = [frame.name for frame in machine.model.frames if frame.type == pinocchio.FrameType.BODY]
    poses = machine.forward_all(q, links)
    data = machine.model.createData()
    indices = [machine.model.getFrameId(link, pinocchio.FrameType.BODY) for link in links]
    for row, configuration in enumerate(machine.configurations(q)):
        pinocchio.framesForwardKinematics(machine.model, data, configuration)
        for link, index in zip(links, indices, strict=True):
            np.testing.assert_allclose(poses[link][row], data.oMf[index].homogeneous, rtol=0, atol=1e-12, err_msg=link)
    np.testing.assert_array_equal(machine.forward(q, links[-1]), poses[links[-1]])
    np.testing.assert_allclose(machine.forward_pinocchio(q, links[-1]), poses[links[-1]], rtol=0, atol=1e-12)


def test_the_samples_hold_what_they_are_meant_to_hold() -> None:
    machines = [Machine.load(path) for path in FOREIGN]
    kinds = {joint.shortname() for machine in machines for joint in machine.model.joints[1:]}
    assert {"JointModelRUBZ", "JointModelRevoluteUnaligned"} <= kinds
    assert any(len(machine.axes) < machine.model.njoints - 1 for machine in machines), "none has a mimic joint"


def test_mimic_with_multiplier_offset_and_a_skew_axis(tmp_path: Path) -> None:
    path = tmp_path / "skew.urdf"
    path.write_text(
        """<robot name="skew"><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
        <joint name="b" type="prismatic"><parent link="l0"/><child link="l1"/><axis xyz="1 2 -2"/>
          <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        <joint name="a" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="-2 1 2"/>
          <origin xyz="-0.1 0 0.7" rpy="1 2 3"/><limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
        <joint name="m" type="revolute"><parent link="l2"/><child link="l3"/><axis xyz="0 3 4"/>
          <origin xyz="0.3 0.3 0.3" rpy="-1 0 0"/><limit lower="-9" upper="9" velocity="1" effort="1"/>
          <mimic joint="a" multiplier="-2.5" offset="0.3"/></joint></robot>"""
    )
    machine = Machine.load(path)
    # The file's order, not Pinocchio's; a mimic joint is no axis.
    assert machine.names == ("b", "a")
    q = sampled(machine, 50)
    poses = machine.forward(q, "l3")
    np.testing.assert_allclose(poses, machine.forward_pinocchio(q, "l3"), rtol=0, atol=1e-12)

    def placed(xyz: list[float], rpy: list[float]) -> Floats:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = pinocchio.rpy.rpyToMatrix(*rpy), xyz
        return pose

    def turned(axis: list[float], angle: float) -> Floats:
        pose = np.eye(4)
        pose[:3, :3] = pinocchio.exp3(np.array(axis) / np.linalg.norm(axis) * angle)
        return pose

    for (b, a), pose in zip(q, poses, strict=True):
        by_hand = placed([0.1, 0.2, 0.3], [0.4, -0.5, 0.6]) @ placed([b / 3, b * 2 / 3, -b * 2 / 3], [0, 0, 0])
        by_hand = by_hand @ placed([-0.1, 0, 0.7], [1, 2, 3]) @ turned([-2, 1, 2], a)
        by_hand = by_hand @ placed([0.3, 0.3, 0.3], [-1, 0, 0]) @ turned([0, 3, 4], -2.5 * a + 0.3)
        np.testing.assert_allclose(pose, by_hand, rtol=0, atol=1e-12)


def test_the_built_in_machine_has_its_axes_in_the_order_of_the_file() -> None:
    machine = Machine.load()
    assert machine.path == TAPELAYER
    assert machine.names == tuple("xyzcauvdqe")
    assert machine.axis("x") == Axis("x", False, 0.0, 2.5, 1.0, 2.0)
    assert machine.axis("c") == Axis("c", True, -np.pi / 6, np.pi / 6, np.pi / 3, np.radians(1000))
    assert [axis.revolute for axis in machine.axes] == [name in "cade" for name in machine.names]
    assert [machine.column(name) for name in machine.names] == list(range(10))


def test_a_continuous_joint_has_no_ends_of_travel() -> None:
    machine = Machine.load(ROBOTS / "kinova_description/robots/kinova.urdf")
    endless = [axis for axis in machine.axes if np.isinf(axis.lower)]
    assert len(endless) == 3
    assert all(axis.upper == np.inf and axis.revolute for axis in endless)


@pytest.mark.parametrize("rows", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK + 7])
def test_chunks_join_without_a_seam(rows: int) -> None:
    machine = Machine.load()
    q = np.random.default_rng(1).uniform(-1, 1, (rows, 10))
    poses = machine.forward_all(q, ("roller", "tape"))
    assert poses["roller"].shape == poses["tape"].shape == (rows, 4, 4)
    for row in sorted({0, 1, CHUNK - 1, CHUNK, rows - 1} & set(range(rows))):
        np.testing.assert_array_equal(poses["roller"][row], machine.forward(q[row : row + 1], "roller")[0])
        np.testing.assert_array_equal(poses["tape"][row], machine.forward(q[row : row + 1], "tape")[0])


def test_rows_of_any_memory_layout_and_whole_numbers_are_taken() -> None:
    machine = Machine.load()
    q = np.random.default_rng(2).uniform(-1, 1, (9, 20))
    expected = machine.forward(np.ascontiguousarray(q[:, ::2]), "knife_2")
    np.testing.assert_array_equal(machine.forward(q[:, ::2], "knife_2"), expected)
    np.testing.assert_array_equal(machine.forward(np.asfortranarray(q[:, ::2]), "knife_2"), expected)
    whole = np.arange(10)[None, :]
    np.testing.assert_array_equal(
        machine.forward(whole, "contact"),  # type: ignore[arg-type]
        machine.forward(whole.astype(float), "contact"),
    )


def test_columns_are_the_entries_of_forward_and_constants_are_numbers() -> None:
    machine = Machine.load()
    q = sampled(machine, 30)
    rotation, translation = machine.columns(q, "roller")
    poses = machine.forward(q, "roller")
    for i in range(3):
        for j in range(3):
            np.testing.assert_array_equal(np.broadcast_to(rotation[i][j], len(q)), poses[:, i, j])
        np.testing.assert_array_equal(np.broadcast_to(translation[i], len(q)), poses[:, i, 3])
    # The heading stays level: a zero that no sample needs to carry.
    assert rotation[2][0] == 0.0 and isinstance(rotation[2][0], float)
    assert machine.columns(q, "machine").translation == (0.0, 0.0, 0.0)


@given(st.floats(-2000.0, 2000.0))
def test_rotations_stay_rotations(turn: float) -> None:
    machine = tape_layer()
    rotation = machine.forward(np.full((1, 10), turn), "knife_1")[0, :3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)


def test_with_limits_changes_only_what_is_named() -> None:
    changed = tape_layer().with_limits(
        {"c": (-3.0, 3.0), "a": (-0.5, 0.5)}, {"c": 2.0, "x": 0.25}, {"a": 4.0, "y": 1.5}, {"y": 30.0}
    )
    assert changed.axis("c") == Axis("c", True, -3.0, 3.0, 2.0, tape_layer().axis("c").acceleration)
    assert changed.axis("a") == Axis("a", True, -0.5, 0.5, tape_layer().axis("a").speed, 4.0)
    assert changed.axis("x") == Axis("x", False, 0.0, 2.5, 0.25, 2.0)
    assert changed.axis("y") == Axis("y", False, 0.0, 2.0, 1.0, 1.5, 30.0)
    for name in "zuvdqe":
        assert changed.axis(name) == tape_layer().axis(name)
    assert tape_layer().axis("x").speed == 1.0
    q = sampled(tape_layer(), 5)
    np.testing.assert_array_equal(changed.forward(q, "roller"), tape_layer().forward(q, "roller"))


@pytest.mark.parametrize(
    ("travel", "speeds", "sentence"),
    [
        ({"w": (0.0, 1.0)}, {}, "no axis 'w'; the axes are x, y, z, c, a, u, v, d, q, e"),
        ({}, {"w": 1.0}, "no axis 'w'; the axes are x, y, z, c, a, u, v, d, q, e"),
        ({"x": (1.0, 1.0)}, {}, "axis x has travel 1 to 1 m, expected lower < upper"),
        ({"c": (0.5, -0.5)}, {}, "axis c has travel 0.5 to -0.5 rad, expected lower < upper"),
        ({"c": (np.nan, 0.5)}, {}, "axis c has travel nan to 0.5 rad, expected lower < upper"),
        ({}, {"a": 0.0}, "axis a has speed 0 rad/s, expected more than 0"),
        ({}, {"y": np.nan}, "axis y has speed nan m/s, expected more than 0"),
    ],
)
def test_limits_that_cannot_be(travel: dict[str, tuple[float, float]], speeds: dict[str, float], sentence: str) -> None:
    with pytest.raises(ModelRefused) as refused:
        tape_layer().with_limits(travel, speeds)
    assert str(refused.value) == f"{TAPELAYER}: {sentence}"


@pytest.mark.parametrize(
    ("q", "sentence"),
    [
        (np.zeros(10), "axis values of shape (10,), expected (n, 10): columns x, y, z, c, a, u, v, d, q, e"),
        (np.zeros((4, 9)), "axis values of shape (4, 9), expected (n, 10): columns x, y, z, c, a, u, v, d, q, e"),
        (np.where(np.arange(40).reshape(4, 10) == 13, np.nan, 0.0), "row 1: axis c is nan, expected a finite number"),
        (np.where(np.arange(40).reshape(4, 10) >= 35, np.inf, 0.0), "row 3: axis u is inf, expected a finite number"),
    ],
)
def test_axis_values_that_cannot_be(q: Floats, sentence: str) -> None:
    for evaluate in (tape_layer().forward, tape_layer().forward_pinocchio, tape_layer().columns):
        with pytest.raises(ConfigurationRefused) as refused:
            evaluate(q, "roller")
        assert str(refused.value) == sentence


def test_opposite_infinities_do_not_cancel() -> None:
    q = np.zeros((2, 10))
    q[0, 0], q[1, 0] = np.inf, -np.inf
    with pytest.raises(ConfigurationRefused, match="row 0: axis x is inf"):
        tape_layer().forward(q, "roller")


def test_values_whose_sum_overflows_are_still_finite() -> None:
    q = np.zeros((2, 10))
    q[:, 0] = 1e308
    assert tape_layer().forward(q, "roller")[0, 0, 3] == 1e308


def test_an_unknown_frame_is_refused_with_the_nearest_name() -> None:
    for evaluate in (tape_layer().forward, tape_layer().forward_pinocchio, tape_layer().columns):
        with pytest.raises(ModelRefused) as refused:
            evaluate(np.zeros((1, 10)), "rolller")
        assert str(refused.value) == f"{TAPELAYER}: no frame 'rolller'; the nearest name is 'roller'"


JOINT = '<joint name="{name}" type="{kind}"><parent link="a"/><child link="b"/>{inside}</joint>'
LIMIT = '<limit lower="0" upper="1" velocity="1" effort="1"/>'


def robot(name: str = "x", kind: str = "prismatic", inside: str = LIMIT) -> str:
    return (
        f'<robot name="r"><link name="a"/><link name="b"/>{JOINT.format(name=name, kind=kind, inside=inside)}</robot>'
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "not a URDF: no element found: line 1, column 0"),
        ("1\nstart\n90\n", "not a URDF: syntax error: line 1, column 0"),
        ("<robot name='r'><link", "not a URDF: unclosed token: line 1, column 16"),
        ("<html/>", "not a URDF: the root element is <html>, expected <robot name=...>"),
        ("<robot/>", "not a URDF: the root element is <robot>, expected <robot name=...>"),
        ('<robot name="r"><link name="a"/></robot>', "no joint moves"),
        (
            robot(kind="floating"),
            "joint 'x' is of type 'floating', expected one of revolute, continuous, prismatic, fixed",
        ),
        (robot(kind="hinge"), "joint 'x' is of type 'hinge', expected one of revolute, continuous, prismatic, fixed"),
        (robot(inside=""), "joint 'x' needs a <limit> with lower, upper, velocity and effort"),
        (
            robot(inside='<limit lower="0" upper="1" effort="1"/>'),
            "joint 'x' needs a <limit> with lower, upper, velocity and effort",
        ),
        (
            robot(inside='<limit lower="1" upper="1" velocity="1" effort="1"/>'),
            "axis x has travel 1 to 1 m, expected lower < upper",
        ),
        (
            robot(inside='<limit lower="0" upper="1" velocity="0" effort="1"/>'),
            "axis x has speed 0 m/s, expected more than 0",
        ),
    ],
)
def test_files_that_are_no_machine(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(ModelRefused) as refused:
        Machine.load(path)
    place = ":1" if sentence.startswith("joint") else ""
    assert str(refused.value) == f"{path}{place}: {sentence}"


def linked(*joints: str) -> str:
    """Return a robot of links l0, l1 ..., one more than joints, each hung on the one before by a joint."""
    links = "".join(f'<link name="l{index}"/>' for index in range(len(joints) + 1))
    ends = '<parent link="l{}"/><child link="l{}"/>'
    hung = [joint.replace("|", ends.format(index, index + 1)) for index, joint in enumerate(joints)]
    return "\n".join([f'<robot name="r">{links}', *hung, "</robot>"])


DRIVEN = f'<joint name="x" type="prismatic">|{LIMIT}</joint>'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            linked(DRIVEN.replace('upper="1"', 'upper="2,5"')),
            ":2: joint 'x': <limit> upper is '2,5', expected a number; write decimals with a point",
        ),
        (
            linked(DRIVEN.replace('upper="1"', 'upper="nan"')),
            ":2: joint 'x': <limit> upper is 'nan', expected a number",
        ),
        (linked(DRIVEN.replace('upper="1"', 'upper="1e999"')), ":2: joint 'x': <limit> upper is '1e999', expected a n"),
        (linked(DRIVEN.replace('upper="1"', 'upper="\u0661"')), ":2: joint 'x': <limit> upper is '\u0661', expected"),
        (
            linked(DRIVEN.replace("|", '|<origin xyz="0 0"/>')),
            ":2: joint 'x': <origin> xyz is '0 0', expected 3 numbers separated by blanks",
        ),
        (
            linked(DRIVEN.replace("|", '|<axis xyz="0 0 0.0"/>')),
            ":2: joint 'x': <axis> xyz is '0 0 0.0', expected a dir",
        ),
        (
            linked(DRIVEN, "").replace(
                '<link name="l0"/>', '<link name="l0"><visual><origin rpy="1,5 0 0"/></visual></link>'
            ),
            ":1: link 'l0': <origin> rpy is '1,5 0 0', expected 3 numbers separated by blanks; write decimals with",
        ),
        (
            linked(DRIVEN.replace('"1"', '"${w}"')),
            ":2: joint 'x': <limit> upper is '${w}': this is a xacro file; expand",
        ),
        (
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:include filename="a"/></robot>',
            ":2: <xacro:include>: this is a xacro file; expand it first: xacro robot.urdf > expanded.urdf",
        ),
        (linked(DRIVEN, DRIVEN), ":3: a second joint 'x'; names must differ"),
        (linked(DRIVEN).replace('"l0"/><link', '"l1"/><link'), ":1: a second link 'l1'; names must differ"),
        (linked(DRIVEN.replace("|", "")), ":2: joint 'x': <parent> link is '', expected the name of a link"),
        (
            robot().replace('<child link="b"/>', '<child link="nowhere"/>'),
            ":1: joint 'x': <child> link is 'nowhere', expected the name of a link",
        ),
        (
            linked(DRIVEN).replace("</robot>", '<link name="loose"/></robot>'),
            ":3: link 'loose' hangs on no joint, nor does 'l0'; there can be one root link",
        ),
        (
            linked(DRIVEN, DRIVEN.replace('"x"', '"y"')).replace('link="l0"', 'link="l2"'),
            ":1: link 'l1' hangs on itself through its joints; the links must be a tree",
        ),
        (
            linked(DRIVEN, DRIVEN.replace('"x"', '"y"').replace("|", '<parent link="l2"/><child link="l2"/>')),
            ":1: link 'l2' hangs on itself through its joints; the links must be a tree",
        ),
        (
            linked(DRIVEN, DRIVEN.replace('"x"', '"y"').replace("|", '<parent link="l2"/><child link="l1"/>')),
            ":3: joint 'y': link 'l1' hangs on another joint already; it can have one",
        ),
    ],
)
def test_faults_of_a_urdf_are_named_with_their_line(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text, "utf-8")
    with pytest.raises(ModelRefused) as refused:
        Machine.load(path)
    assert str(refused.value).startswith(f"{path}{sentence}")


def test_all_numbers_that_are_none_are_named_at_once(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(linked(DRIVEN.replace('"1"', '"1,0"')))
    with pytest.raises(ModelRefused) as refused:
        Machine.load(path)
    found = [line.split("<limit> ")[1].split(" is ")[0] for line in str(refused.value).splitlines()]
    assert found == ["upper", "velocity", "effort"]


def follower(name: str, primary: str, numbers: str = "") -> str:
    return f'<joint name="{name}" type="revolute">|{LIMIT}<mimic joint="{primary}"{numbers}/></joint>'


@pytest.mark.parametrize(
    ("joints", "sentence"),
    [
        ((DRIVEN, follower("m", "x", ' multiplier="0"')), "joint 'm' mimics with multiplier 0: make it fixed"),
        ((DRIVEN, follower("m", "y")), "joint 'm': <mimic> joint is 'y', expected the name of a joint"),
        ((DRIVEN, follower("m", "")), "joint 'm': <mimic> joint is '', expected the name of a joint"),
        (
            (DRIVEN, follower("m", "m")),
            "joint 'm': <mimic> joint is 'm', so it follows itself; expected a driven joint",
        ),
        (
            ('<joint name="w" type="fixed">|</joint>', follower("m", "w")),
            "joint 'm': <mimic> joint is 'w', which is fixed; expected one that moves",
        ),
        ((DRIVEN, follower("m", "x", ' offset="a"')), "joint 'm': <mimic> offset is 'a', expected a number"),
    ],
)
def test_a_mimic_joint_that_follows_nothing(tmp_path: Path, joints: tuple[str, ...], sentence: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(linked(*joints))
    with pytest.raises(ModelRefused) as refused:
        Machine.load(path)
    assert str(refused.value) == f"{path}:3: {sentence}"


def test_mimics_in_a_circle_are_named_one_by_one(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(linked(DRIVEN, follower("m", "n"), follower("n", "m"), follower("o", "n")))
    with pytest.raises(ModelRefused) as refused:
        Machine.load(path)
    assert [line.split(": ")[1] for line in str(refused.value).splitlines()] == ["joint 'm'", "joint 'n'"]


def test_mimics_work_in_any_order_through_each_other_and_of_endless_joints(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    turning = '<joint name="z" type="continuous">|<limit velocity="1" effort="1"/></joint>'
    first = follower("a", "b", ' multiplier="2" offset="0.25"')
    path.write_text(linked(first, follower("b", "z", ' multiplier="-3" offset="0.5"'), turning))
    machine = Machine.load(path)
    assert machine.names == ("z",)
    values = np.linspace(-2.0, 2.0, 7)
    poses = machine.forward(values[:, None], "l3")
    np.testing.assert_allclose(poses, machine.forward_pinocchio(values[:, None], "l3"), rtol=0, atol=1e-12)
    # All turn about x: a = 2 b + 0.25, b = 0.5 - 3 z.
    turns = 2 * (0.5 - 3 * values) + 0.25 + (0.5 - 3 * values) + values
    np.testing.assert_allclose(poses[:, 2, 1], np.sin(turns), rtol=0, atol=1e-12)
    np.testing.assert_allclose(poses[:, 1, 1], np.cos(turns), rtol=0, atol=1e-12)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_a_urdf_in_any_declared_encoding(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "robot.urdf"
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + linked(DRIVEN.replace('"x"', '"größe"'))
    path.write_bytes(text.replace('robot name="r"', 'robot name="Anlage für Bänder"').encode(encoding))
    machine = Machine.load(path)
    assert (machine.names, machine.model.name) == (("größe",), "Anlage für Bänder")


def test_a_urdf_in_an_encoding_of_another_country_and_one_that_is_not_what_it_says(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    text = '<?xml version="1.0" encoding="GB2312"?>' + linked(DRIVEN).replace('robot name="r"', 'robot name="铺带机"')
    path.write_bytes(text.encode("gb2312"))
    assert Machine.load(path).model.name == "铺带机"
    path.write_bytes(text.replace("GB2312", "UTF-8").encode("gb2312"))
    with pytest.raises(ModelRefused, match=r"not a URDF: byte 52 is not UTF-8, the encoding that its first line decl"):
        Machine.load(path)
    path.write_bytes(text.replace("GB2312", "klingon").encode("gb2312"))
    with pytest.raises(ModelRefused, match="not a URDF: unknown encoding: klingon"):
        Machine.load(path)


def test_axes_that_turn_without_end_are_named_where_they_need_travel() -> None:
    machine = Machine.load(ROBOTS / "kinova_description/robots/kinova.urdf")
    endless = [axis.name for axis in machine.axes if not np.isfinite(axis.upper)][:2]
    with pytest.raises(ModelRefused) as refused:
        machine.check_travel(machine.names)
    assert str(refused.value).startswith(f"{machine.path}: axes {endless[0]} and ")
    assert f"limits_deg, e.g. {{{endless[0]} = [-180, 180]," in str(refused.value)
    machine.with_limits({axis.name: (-1.0, 1.0) for axis in machine.axes}, {}).check_travel(machine.names)


def test_a_missing_file_a_directory_and_a_binary_file(tmp_path: Path) -> None:
    missing = tmp_path / "none.urdf"
    binary = tmp_path / "binary.urdf"
    binary.write_bytes(bytes(range(256)))
    for path, sentence in (
        (missing, "cannot be read as a URDF: No such file or directory"),
        (tmp_path, "cannot be read as a URDF: Is a directory"),
        (binary, "not a URDF: not well-formed (invalid token): line 1, column 0"),
    ):
        with pytest.raises(ModelRefused) as refused:
            Machine.load(path)
        assert str(refused.value) == f"{path}: {sentence}"


def test_jerk_needs_an_acceleration() -> None:
    plain = replace(tape_layer().axis("v"), acceleration=math.inf)
    axes = tuple(plain if axis.name == "v" else axis for axis in tape_layer().axes)
    with pytest.raises(ModelRefused, match="axis v has a jerk but no acceleration; state both, or neither"):
        replace(tape_layer(), axes=axes).with_limits({}, {}, {}, {"v": 10.0})
