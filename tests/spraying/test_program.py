"""Passes and their program: where they go, how they are joined, and how long they take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.models import read_mesh
from tapelayer.machines.wrist import AXES, angles_between, gun_axes
from tapelayer.motion.trajectory import Event, Kind
from tapelayer.spraying.pass_planning import plan_passes
from tapelayer.spraying.passes import NO_FACET, Pass, Reason
from tapelayer.spraying.program import Spraying, spray
from tapelayer.units import DEG
from tests.helpers.machines import sprayer
from tests.helpers.panels import flat, sheet
from tests.helpers.parts import OPEN_SKINS, REAL_OPEN_SKINS
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import placed, roof, sprayed

PLATE = sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat)


def events(spraying: Spraying) -> list[Event]:
    trajectory = spraying.trajectory
    return [Event(event) for event in trajectory.events[trajectory.kinds == Kind.SWITCH].tolist()]


def test_a_plate_s_program_switches_once_and_takes_the_time_of_its_way() -> None:
    spraying, plan = sprayed(PLATE)
    trajectory = spraying.trajectory
    assert trajectory.axes == AXES
    assert events(spraying) == [Event.AIR_ON, Event.ARC_ON, Event.ARC_OFF, Event.AIR_OFF]
    on = np.flatnonzero(trajectory.events == Event.ARC_ON)[0]
    off = np.flatnonzero(trajectory.events == Event.ARC_OFF)[0]
    length = sum(found.path.length for found in plan.passes) + 8 * 0.025
    assert np.sum(trajectory.durations[on:off]) == pytest.approx(length / 0.3, rel=1e-9)
    np.testing.assert_allclose(trajectory.positions[on:off, 4], 0.0, atol=1e-9)
    # What is straight is one block, the way from pass to pass too.
    lengths = np.linalg.norm(np.diff(trajectory.positions[on:off, :3], axis=0), axis=1)
    np.testing.assert_allclose(lengths, [*[0.36, 0.025] * 8, 0.36], atol=1e-12)
    assert spraying.splits == () and spraying.slowdowns == ()
    assert [piece.index for piece in spraying.pieces] == list(range(9))


def test_a_program_begins_above_the_part_and_ends_drawn_off() -> None:
    spraying, plan = sprayed(PLATE)
    trajectory = spraying.trajectory
    assert trajectory.kinds[:4].tolist() == [Kind.RAPID, Kind.RAPID, Kind.RAPID, Kind.LINEAR]
    assert np.all(np.isnan(trajectory.positions[0, [0, 1, 3, 4]])) and trajectory.positions[0, 2] == 0.05
    np.testing.assert_allclose(trajectory.positions[2, :3], plan.passes[0].path.points[0] + [0, 0, 0.05], atol=1e-12)
    np.testing.assert_allclose(trajectory.positions[-1, :3], plan.passes[-1].path.points[-1] + [0, 0, 0.05], atol=1e-12)
    assert trajectory.stated[0] == 0b100 and trajectory.stated[1] == 0b11111


def test_passes_far_apart_are_each_switched_and_reached_from_above() -> None:
    spraying, plan = sprayed(PLATE, "[spray]\nmax_gap_mm = 20\n[process]\nair_lead_s = 0.7")
    trajectory = spraying.trajectory
    assert events(spraying) == [Event.AIR_ON, Event.ARC_ON, Event.ARC_OFF, Event.AIR_OFF] * 9
    air, arc = (np.flatnonzero(trajectory.events == event) for event in (Event.AIR_ON, Event.ARC_ON))
    np.testing.assert_allclose(trajectory.times[arc] - trajectory.times[air], 0.7, rtol=1e-12)
    rapid = trajectory.kinds == Kind.RAPID
    assert np.min(trajectory.positions[rapid, 2]) >= 0.05 - 1e-12


def test_between_layers_the_gun_waits_or_stops() -> None:
    spraying, _ = sprayed(PLATE, "[spray]\nlayers = 2\ninterlayer_dwell_s = 5\ninterlayer_stop = true\npitch_mm = 50")
    trajectory = spraying.trajectory
    stop = int(np.flatnonzero(trajectory.events == Event.STOP)[0])
    assert np.sum(trajectory.events == Event.STOP) == 1
    assert trajectory.kinds[stop - 1] == Kind.DWELL and trajectory.durations[stop - 1] == pytest.approx(5.0, abs=1e-12)
    switched = events(spraying)
    assert switched[2:5] == [Event.ARC_OFF, Event.AIR_OFF, Event.STOP]


def test_an_axis_that_is_too_slow_holds_the_gun_back_and_is_named() -> None:
    spraying, _ = sprayed(PLATE, "[machine]\nspeeds_mm_per_s = {x = 200}")
    assert {slow.axis for slow in spraying.slowdowns} == {"x"}
    assert {slow.number for slow in spraying.slowdowns} == set(range(1, 10))
    assert [slow.speed for slow in spraying.slowdowns] == pytest.approx([0.2] * 9)


def test_a_ridge_that_the_wrist_cannot_follow_splits_the_pass() -> None:
    spraying, plan = sprayed(roof(120), "[machine]\nlimits_deg = {phi = [-90, 90]}\n[spray]\npitch_mm = 80")
    assert len(plan.passes) == 1
    assert [split.reason for split in spraying.splits] == [Reason.CREASE] * len(spraying.splits)
    assert len(spraying.splits) == len(spraying.pieces) - 1 >= 1
    arc = [event for event in events(spraying) if event in (Event.ARC_ON, Event.ARC_OFF)]
    assert arc == [Event.ARC_ON, Event.ARC_OFF] * len(spraying.pieces)
    for split in spraying.splits:
        assert abs(split.point[0] - 1.25) <= 0.04


def in_part(passes: Sequence[Pass], mesh: Mesh, spraying: Spraying) -> Floats:
    """Greatest angle between gun and facet normal of each piece, at its points and outside what is exempt."""
    worst = []
    for piece in spraying.pieces:
        found = passes[piece.index]
        arcs = piece.arc_lengths
        facet = found.facets[np.clip(np.searchsorted(found.bounds, arcs, "right") - 1, 0, len(found.facets) - 1)]
        judged = facet != NO_FACET
        for low, high in found.exempt:
            judged &= (arcs < low) | (arcs > high)
        axes = gun_axes(piece.joints[:, 3], piece.joints[:, 4])
        worst.append(np.max(angles_between(axes[judged], mesh.upward_normals[facet[judged]]), initial=0.0))
    return np.array(worst)


@pytest.mark.parametrize("name", [*OPEN_SKINS, *REAL_OPEN_SKINS])
def test_whole_parts_keep_the_gun_within_its_limit(part: Callable[[str], Path], name: str) -> None:
    setup = spray_setup_of("[spray]\npitch_mm = 100\ndirection_deg = 30\nmax_gap_mm = 60")
    mesh = read_mesh(part(name))
    mesh = placed(mesh, setup)
    plan = plan_passes(mesh, setup, sprayer(), 0.1)
    spraying = spray(plan.passes, setup, sprayer(), float(mesh.vertices[:, 2].max()))
    assert np.max(in_part(plan.passes, mesh, spraying)) <= 15 * DEG
    if name.endswith("hood"):
        assert spraying.splits == ()
    assert plan.sprayed == pytest.approx(np.sum(mesh.areas) - plan.too_steep - plan.hidden, rel=1e-9)


def dome(radius: float, slope: float) -> Floats:
    """A cap of a sphere up to a slope in degrees, mm."""
    turns, tilts = np.radians(np.arange(0, 361, 6.0)), np.radians(np.linspace(0, slope, 25))
    turn, tilt = np.meshgrid(turns, tilts, indexing="ij")
    points = radius * np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    points[-1] = points[0]
    points[:, 0] = [0, 0, radius]
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, c, d], axis=2)[:, 1:], np.stack([a, b, c], axis=2)[:, 1:],
                           np.stack([a, c, d], axis=2)[:, :1]], axis=1).reshape(-1, 3, 3)  # fmt: skip


@pytest.mark.parametrize(("text", "most"), [("", 2), ("[machine]\nlimits_deg = {theta = [-180, 540]}\n", 0)])
def test_a_dome_hardly_splits(text: str, most: int) -> None:
    spraying, plan = sprayed(dome(400, 70), text + "[spray]\ndirection_deg = 30\npitch_mm = 50")
    assert sum(found.plane <= 16 for found in plan.passes) == 16
    assert len(spraying.splits) <= most
    for piece in spraying.pieces:
        assert np.max(np.abs(np.diff(piece.joints[:, 3]))) <= 60 * DEG
