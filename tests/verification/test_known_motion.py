"""Known motion: where it begins, and that its bounds hold for straight blocks, arcs and axes that are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.machines.body import Body
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.verification.known_motion import KnownMotion
from tests.helpers.machines import sprayer, tape_layer
from tests.helpers.moving_balls import swung
from tests.helpers.trajectories import straight


def by_chance(names: tuple[str, ...], seed: int, count: int = 6) -> Trajectory:
    """Straight blocks and spiral arcs in all planes, of all axes at once."""
    chance = np.random.default_rng(seed)
    ends = chance.uniform(-0.5, 0.5, (count, len(names)))
    start = chance.uniform(-0.5, 0.5, len(names))
    kinds = chance.choice([Kind.LINEAR, Kind.RAPID, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE], count)
    centres = chance.uniform(-0.5, 0.5, (count, 3))
    planes = chance.integers(0, 3, count).astype(np.uint8)
    return replace(straight(names, ends, start=start, kinds=kinds), centres=centres, planes=planes)


@pytest.mark.parametrize("machine", [tape_layer, sprayer])
@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_point_moves_farther_in_a_block_than_its_bound(machine: type, seed: int) -> None:
    """Nor in any part of it than that part of the bound."""
    body = Body.of(machine())
    trajectory = by_chance(body.machine.names, seed)
    motion = KnownMotion.of(trajectory, body.machine)
    shares = np.linspace(0.0, 1.0, 17)
    for joint in body.joints[1:]:
        bounds = motion.bounds(body.rates(joint, reach=motion.reach))
        corners = np.concatenate([shape.corners for shape in body.carried(joint)])
        for block in range(len(trajectory)):
            q = motion.at(np.full(len(shares), block), shares)
            poses = body.machine.forward(q, body.carriers[joint])
            points = np.einsum("nij,mj->nmi", poses[:, :3, :3], corners) + poses[:, None, :3, 3]
            moved = np.max(np.linalg.norm(points[1:] - points[:-1], axis=2), axis=1)
            assert np.all(moved <= bounds[block] / (len(shares) - 1) + 1e-12)


def test_the_bound_of_a_swing_is_the_length_of_its_arc() -> None:
    """A half circle in x and z of radius 0.4, which y crosses by 0.2, of a carriage on three slides."""
    trajectory, machine = swung(0.3), tape_layer()
    held = {name: 0.0 for name in machine.names if name not in trajectory.axes}
    motion = KnownMotion.of(trajectory, machine, held)
    bounds = motion.bounds(Body.of(machine).rates(machine.model.getJointId("z"), reach=motion.reach))
    assert bounds == pytest.approx([np.hypot(np.pi * 0.4, 0.2)], abs=1e-12)
    assert motion.reach[:3] == pytest.approx([0.4, 0.2, 1.1])


def test_motion_is_known_once_every_axis_is() -> None:
    ends = np.array([[np.nan, 1.0], [0.5, 1.0], [0.6, 1.0], [0.6, 1.5]])
    machine = tape_layer()
    held = {name: 0.0 for name in machine.names if name not in ("x", "y")}
    for start, first in ((np.full(2, np.nan), 2), (np.zeros(2), 2)):
        motion = KnownMotion.of(straight(("x", "y"), ends, start=start), machine, held)
        assert motion.first == first and not np.any(motion.steps[:first])
        assert motion.at(np.array([2]), np.array([0.5]))[0, :2] == pytest.approx([0.55, 1.0])
    assert KnownMotion.of(straight(("x", "y"), ends[2:], start=np.full(2, np.nan)), machine, held).first == 1
    assert KnownMotion.of(straight(("x", "y"), ends[2:], start=np.zeros(2)), machine, held).first == 0
    assert KnownMotion.of(straight(("x", "y"), ends[:1]), machine, held).first == 1


def test_axes_that_are_neither_moved_nor_held_are_an_error() -> None:
    with pytest.raises(ValueError, match="axes a, c, d, e, q, u, v, z are neither moved nor held"):
        KnownMotion.of(straight(("x", "y"), np.zeros((1, 2))), tape_layer())


def test_an_arc_without_a_centre_is_an_error() -> None:
    trajectory = replace(swung(0.3), centres=np.full((1, 3), np.nan))
    held = {name: 0.0 for name in tape_layer().names if name not in trajectory.axes}
    with pytest.raises(ValueError, match="block 0 has no known length"):
        KnownMotion.of(trajectory, tape_layer(), held)


def test_axes_that_are_held_keep_their_value() -> None:
    names = ("x", "y", "z", "theta", "phi")
    ends: Floats = np.array([[0.1, 0.2, 0.3, 0.4, 0.5]])
    motion = KnownMotion.of(straight(names, ends), sprayer(), {"standoff": 0.12})
    assert motion.at(np.array([0]), np.array([1.0]))[0] == pytest.approx([*ends[0], 0.12])
    assert motion.reach[sprayer().column("standoff")] == 0.12
