"""Body: the shapes of both machines, which of them may meet, and the bound on how far a motion moves them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.errors import ModelRefused
from tapelayer.machines import gantry, wrist
from tapelayer.machines.body import Body, Shape
from tapelayer.machines.machine import Machine
from tests.helpers.machines import sprayer, tape_layer
from urdf import TAPELAYER

MACHINES = {"tape layer": tape_layer, "sprayer": sprayer}
each_machine = pytest.mark.parametrize("name", MACHINES)


@cache
def body_of(name: str) -> Body:
    return Body.of(MACHINES[name](), {"tape layer": gantry, "sprayer": wrist}[name].TOUCHING)


def joint_of(body: Body, name: str) -> int:
    return int(body.machine.model.getJointId(name))


def seen_from(body: Body, joint: int, above: int, q: Floats) -> Floats:
    """Poses (n, 4, 4) of a joint's frame in the frame of a joint above it."""
    poses = body.machine.forward_all(q, (body.carriers[joint], body.carriers[above]))
    return np.linalg.inv(poses[body.carriers[above]]) @ poses[body.carriers[joint]]


@each_machine
def test_the_shapes_are_those_that_pinocchio_reads(name: str) -> None:
    body = body_of(name)
    model = body.machine.model
    geometry = pinocchio.buildGeomFromUrdf(model, str(body.machine.path), pinocchio.GeometryType.COLLISION)
    theirs = {found.name: found for found in geometry.geometryObjects}
    assert len(theirs) == len(body.shapes)
    for link in {shape.link for shape in body.shapes}:
        own = [shape for shape in body.shapes if shape.link == link]
        for number, shape in enumerate(own):
            found = theirs[f"{link}_{number}"]
            assert shape.name in (found.name, "tyre") and shape.joint == found.parentJoint
            np.testing.assert_allclose(shape.place, found.placement.homogeneous, rtol=0, atol=1e-15)
            assert shape.solid == found.geometry
    assert body_of("tape layer").shape("tyre").link == "roller"


@each_machine
def test_a_shape_lies_in_the_hull_of_its_corners(name: str) -> None:
    """In every direction the hull reaches at least as far as the solid, and little farther."""
    ways = np.random.default_rng(1).normal(size=(500, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    for shape in body_of(name).shapes:
        local = ways @ shape.place[:3, :3]
        if hasattr(shape.solid, "halfSide"):
            reach = np.abs(local) @ shape.solid.halfSide
        else:
            reach = np.hypot(local[:, 0], local[:, 1]) * shape.solid.radius
            reach += np.abs(local[:, 2]) * shape.solid.halfLength
        hull = np.max((shape.corners - shape.place[:3, 3]) @ ways.T, axis=0)
        assert np.all(hull >= reach - 1e-12) and np.all(hull <= 1.01 * reach + 1e-12), shape.name


@each_machine
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), near=st.floats(1e-3, 1.0))
def test_no_point_moves_farther_than_the_bound(name: str, seed: int, near: float) -> None:
    """For every joint and every joint above it, along random straight intervals of all axes."""
    body, chance = body_of(name), np.random.default_rng(seed)
    lower, upper = np.array([(max(axis.lower, -10.0), min(axis.upper, 10.0)) for axis in body.machine.axes]).T
    begin, end = lower + chance.random((2, len(lower))) * (upper - lower)
    end = begin + near * (end - begin) * (chance.random(len(lower)) < 0.6)
    reach = np.maximum(np.abs(begin), np.abs(end))
    q = begin + np.linspace(0.0, 1.0, 9)[:, None] * (end - begin)
    for joint in body.joints:
        for above in (0, *body.chain(joint)[:-1]):
            if joint == above:
                continue
            poses = seen_from(body, joint, above, q)
            corners = np.concatenate([shape.corners for shape in body.carried(joint)])
            points = np.einsum("nij,mj->nmi", poses[:, :3, :3], corners) + poses[:, None, :3, 3]
            moved = float(np.max(np.linalg.norm(points - points[:1], axis=2)))
            for known in (reach, None):
                bound = float(body.rates(joint, above, known).bounds(np.abs(end - begin)[None])[0])
                assert moved <= bound + 1e-12, (body.machine.model.names[joint], above)


def test_the_bound_of_slides_is_the_length_of_their_vector() -> None:
    body = body_of("tape layer")
    steps = np.zeros((1, 10))
    steps[0, :3] = 0.3, 0.4, 1.2
    for name, bound in (("x", 0.3), ("y", 0.5), ("z", 1.3), ("a", 1.3), ("d", 1.3)):
        assert body.rates(joint_of(body, name)).bounds(steps)[0] == pytest.approx(bound, abs=1e-12)
    assert body.rates(joint_of(body, "a"), joint_of(body, "z")).bounds(steps)[0] == 0.0


def test_the_bound_of_an_arc_is_its_length() -> None:
    """A half circle of radius 0.2 in x and y with 0.3 in z, and one in z and x, of which the carriage sees x alone."""
    body = body_of("tape layer")
    length = np.pi * 0.2
    steps = np.zeros((2, 10))
    steps[0, :3], steps[1, :3] = (length, length, 0.3), (length, 0.1, length)
    arcs = np.array([0, 1]), np.array([[0, 1], [2, 0]])
    head = body.rates(joint_of(body, "a")).bounds(steps, arcs)
    assert head == pytest.approx([np.hypot(length, 0.3), np.hypot(length, 0.1)], abs=1e-12)
    carriage = body.rates(joint_of(body, "y")).bounds(steps, arcs)
    assert carriage == pytest.approx([length, np.hypot(length, 0.1)], abs=1e-12)


def test_rods_that_turn_against_each_other_shift_what_they_carry() -> None:
    """BCE stays parallel to axis I, so phi shifts all of it along AB's circle; EF turns about E besides."""
    body = body_of("sprayer")
    phi = body.machine.column("phi")
    assert body.rates(joint_of(body, "phi_b")).rates[phi] == pytest.approx(0.4, abs=1e-12)
    farthest = max(shape.radius for shape in body.carried(joint_of(body, "phi_e")))
    assert body.rates(joint_of(body, "phi_e")).rates[phi] == pytest.approx(0.4 + farthest, abs=1e-12)
    assert body.rates(joint_of(body, "phi_g")).rates[phi] == pytest.approx(0.25, abs=1e-12)


def met(body: Body) -> set[frozenset[str]]:
    pairs = [pair for joints in body.meetings for pair in body.may_meet(*joints)]
    return {frozenset(shape.link for shape in pair) for pair in pairs}


def test_neighbours_are_not_judged_against_each_other() -> None:
    found = met(body_of("tape layer"))
    for pair in (("machine", "bridge"), ("carriage", "ram"), ("fork", "head"), ("cutter", "knife_1_slide")):
        assert frozenset(pair) not in found
    assert frozenset(("cutter", "knife_1")) not in found and frozenset(("cutter", "knife_2")) not in found
    for pair in (("fork", "cutter"), ("ram", "head"), ("machine", "head"), ("head", "knife_1"), ("fork", "roller")):
        assert frozenset(pair) in found
    # What is fixed to each other does not move against each other.
    assert frozenset(("head", "cutter")) not in found and frozenset(("roller", "auxiliary_roller")) not in found
    assert {frozenset(("machine", "gun")), frozenset(("fork", "gun"))} <= met(body_of("sprayer"))
    assert frozenset(("rod_bce", "gun")) not in met(body_of("sprayer"))


def test_touching_links_touch_where_all_axes_stand_at_zero() -> None:
    """So does every pair on the written lists, up to the gap at the anvil; no pair is excused for another reason."""
    for name, gap in (("tape layer", 0.0051), ("sprayer", 0.0)):
        body = body_of(name)
        written = {"tape layer": gantry, "sprayer": wrist}[name].TOUCHING
        for pair in written:
            assert nearest(body, *pair) <= gap, pair


def test_rod_fg_passes_the_shaft_of_d() -> None:
    """At phi = 0, where both stand on axis I."""
    assert nearest(body_of("sprayer"), "fork", "rod_fg") == pytest.approx(0.012, abs=1e-6)


def nearest(body: Body, link: str, other: str) -> float:
    """Least distance of two links' corners' boxes from each other, by Pinocchio at zero; metres, negative inside."""
    model = body.machine.model
    geometry = pinocchio.buildGeomFromUrdf(model, str(body.machine.path), pinocchio.GeometryType.COLLISION)
    frames = [model.frames[found.parentFrame].name for found in geometry.geometryObjects]
    geometry.addAllCollisionPairs()
    data = pinocchio.GeometryData(geometry)
    q = body.machine.configurations(np.zeros((1, len(body.machine.axes))))[0]
    pinocchio.computeDistances(model, model.createData(), geometry, data, q)
    return min(
        float(result.min_distance)
        for pair, result in zip(geometry.collisionPairs, data.distanceResults, strict=True)
        if {frames[pair.first], frames[pair.second]} == {link, other}
    )


def test_a_joint_is_not_above_any_other() -> None:
    body = body_of("tape layer")
    assert body.meeting(joint_of(body, "d"), joint_of(body, "q")) == joint_of(body, "a")
    assert body.meeting(joint_of(body, "z"), joint_of(body, "d")) == joint_of(body, "z")
    with pytest.raises(ValueError, match="is not above"):
        body.chain(joint_of(body, "v"), joint_of(body, "q"))


@pytest.mark.parametrize(
    ("pattern", "by", "sentence"),
    [
        (
            r'(<link name="ram">.*?)<collision>.*?</collision>(.*?)<collision>.*?</collision>',
            r"\1\2",
            "no <collision> on link 'ram', which is drawn; give it boxes, cylinders or spheres",
        ),
        (
            r'(<collision name="tyre">.*?)<cylinder .*?/>',
            r'\1<mesh filename="tyre.stl"/>',
            "link 'roller': <collision> holds <mesh>, expected one of box, cylinder, sphere that contains the part",
        ),
        (
            r'(<collision name="tyre">.*?)<cylinder .*?/>',
            r"\1",
            "link 'roller': <collision> holds nothing, expected one of box, cylinder, sphere that contains the part",
        ),
        (
            r'(<collision name="tyre">.*?)radius="0.04"',
            r'\1radius="0"',
            "link 'roller': <cylinder> radius is '0', expected more than 0",
        ),
        (
            r'(<collision name="tyre">.*?)radius="0.04"',
            r"\1",
            "link 'roller': <cylinder> radius is '', expected more than 0",
        ),
    ],
)
def test_shapes_that_are_none_are_refused(pattern: str, by: str, sentence: str, tmp_path: Path) -> None:
    text, count = re.subn(pattern, by, TAPELAYER.read_text(), count=1, flags=re.DOTALL)
    assert count == 1
    path = tmp_path / "m.urdf"
    path.write_text(text)
    machine = Machine.load(path)
    with pytest.raises(ModelRefused) as refused:
        Body.of(machine)
    assert re.fullmatch(rf"{re.escape(str(path))}:\d+: {re.escape(sentence)}", str(refused.value))


def test_a_machine_without_shapes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(re.sub(r"<(visual|collision)\b.*?</\1>", "", TAPELAYER.read_text(), flags=re.DOTALL))
    with pytest.raises(ModelRefused) as refused:
        Body.of(Machine.load(path))
    sentence = "no link has a <collision>; give boxes, cylinders or spheres to each"
    assert str(refused.value) == f"{path}: {sentence}"


def test_a_sphere_is_a_shape(tmp_path: Path) -> None:
    path = tmp_path / "ball.urdf"
    text = re.sub(r'(<collision name="tyre">.*?)<cylinder .*?/>', r'\1<sphere radius="0.04"/>', TAPELAYER.read_text())
    path.write_text(text)
    ball: Shape = Body.of(Machine.load(path)).shape("tyre")
    assert ball.solid.radius == 0.04 and len(ball.corners) == 8
    with pytest.raises(ModelRefused, match="no <collision> named 'tire'; name the one that is meant"):
        Body.of(Machine.load(path)).shape("tire")
