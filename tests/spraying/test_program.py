"""Passes and their program: where they go, how they are joined, and how long they take."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.errors import NothingToSpray
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plan_coverage import PlanCoverage
from tapelayer.geometry.stl import read_mesh
from tapelayer.machines.wrist import AXES, angles_between, gun_axes
from tapelayer.motion.trajectory import Event, Kind
from tapelayer.spraying.pass_planning import plan_passes
from tapelayer.spraying.passes import NO_FACET, Pass, Reason
from tapelayer.spraying.program import Spraying, spray
from tapelayer.spraying.reach import Segments, placement
from tapelayer.spraying.steep_sides import flank_heights, on_steep_sides
from tapelayer.units import DEG, MM
from tests.helpers.machines import sprayer
from tests.helpers.panels import flat, mesh_of, sheet
from tests.helpers.parts import OPEN_SKINS, REAL_OPEN_SKINS
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import placed, planned, roof, sprayed

PLATE = sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat)


def events(spraying: Spraying) -> list[Event]:
    trajectory = spraying.trajectory
    return [Event(event) for event in trajectory.events[trajectory.kinds == Kind.SWITCH].tolist()]


@pytest.mark.parametrize("rotation", [0.0, 30.0, -90.0])
def test_the_part_is_centred_with_its_lowest_point_at_zero(rotation: float) -> None:
    mesh = mesh_of(roof(60) + [1234.0, -777.0, 55.0])
    setup = spray_setup_of(f"[part]\nrotation_deg = {rotation}")
    found = placed(mesh, setup).vertices
    low, high = found.min(axis=0), found.max(axis=0)
    np.testing.assert_allclose((low + high)[:2] / 2, [1.25, 1.0], atol=1e-12)
    assert abs(low[2]) <= 1e-12
    np.testing.assert_allclose(np.linalg.norm(np.diff(found, axis=0)), np.linalg.norm(np.diff(mesh.vertices, axis=0)))


def test_the_part_s_origin_can_be_given() -> None:
    mesh = mesh_of(PLATE)
    rotation, origin = placement(
        mesh, spray_setup_of("[part]\nx_mm = 10\ny_mm = 20\nz_mm = 30\nrotation_deg = 90"), sprayer()
    )
    np.testing.assert_allclose(origin, [0.01, 0.02, 0.03])
    np.testing.assert_allclose(rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_a_plate_has_passes_the_pitch_apart_with_overruns() -> None:
    plan, mesh, _ = planned(PLATE)
    assert len(plan.passes) == math.ceil(205 / 25)
    middle = mesh.vertices.min(axis=0) + np.ptp(mesh.vertices, axis=0) / 2
    for row, found in enumerate(plan.passes):
        path = found.path
        assert (path.number, found.layer, found.plane, found.curve) == (row + 1, 1, row + 1, 1)
        across = path.points[:, 1] - middle[1]
        np.testing.assert_allclose(across, (row - 4) * 0.025, atol=1e-12)
        ends = path.points[[0, -1], 0] - middle[0]
        np.testing.assert_allclose(ends, [-0.18, 0.18] if row % 2 == 0 else [0.18, -0.18], atol=1e-12)
        np.testing.assert_allclose(path.normals, np.tile([0, 0, 1], (len(path.normals), 1)), atol=1e-12)
        assert np.max(np.diff(path.arc_lengths)) <= 0.01 + 1e-12
        np.testing.assert_allclose(np.diff(path.arc_lengths), np.linalg.norm(np.diff(path.points, axis=0), axis=1))
        assert found.facets[0] == found.facets[-1] == NO_FACET
        np.testing.assert_allclose(found.bounds[[0, 1, -2, -1]], [0.0, 0.03, 0.33, 0.36], atol=1e-12)
    assert (plan.facing, plan.hidden, plan.travel) == (0.0, 0.0, 0.0)
    assert plan.sprayed == pytest.approx(0.3 * 0.205, rel=1e-9)


@pytest.mark.parametrize("direction", [0.0, 30.0, 45.0, 90.0, 180.0, -90.0])
def test_passes_go_in_their_direction(direction: float) -> None:
    plan, _, _ = planned(PLATE, f"[spray]\ndirection_deg = {direction}\npattern = 'one_way'")
    along = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction)), 0.0])
    for found in plan.passes:
        way = found.path.points[-1] - found.path.points[0]
        np.testing.assert_allclose(way / np.linalg.norm(way), along, atol=1e-9)


def test_facets_under_a_path_are_those_of_the_mesh() -> None:
    """Every stretch lies on its facet: by barycentric coordinates, which planning does not use."""
    plan, mesh, _ = planned(
        sheet(np.linspace(0, 300, 9), np.linspace(0, 200, 6), lambda x, y: 20 * np.sin(x / 60) + 0.1 * y)
    )
    for found in plan.passes:
        middles = (found.bounds[1:] + found.bounds[:-1]) / 2
        points = np.stack(
            [np.interp(middles, found.path.arc_lengths, column) for column in found.path.points.T], axis=1
        )
        on = found.facets != NO_FACET
        a, b, c = (mesh.vertices[mesh.facets[found.facets[on]][:, corner]] for corner in range(3))
        system = np.stack([a - c, b - c], axis=2)[:, :2]
        shares = np.linalg.solve(system, (points[on] - c)[:, :2, None])[..., 0]
        shares = np.column_stack([shares, 1 - shares.sum(axis=1)])
        assert np.min(shares) >= -0.02
        heights = np.einsum("ij,ij->i", shares, np.stack([a[:, 2], b[:, 2], c[:, 2]], axis=1))
        assert np.max(np.abs(heights - points[on][:, 2])) <= 0.1 * MM


def test_a_short_gap_is_bridged_and_a_long_one_ends_the_pass() -> None:
    grid = np.arange(0, 301, 20.0), np.arange(0, 41, 10.0)
    for width, passes in ((60, 2), (80, 4)):
        plan, _, _ = planned(sheet(*grid, flat, hole=(100, 100 + width, -1, 41)), "[spray]\npattern = 'one_way'")
        assert len(plan.passes) == passes
        lengths = [found.path.length for found in plan.passes]
        if passes == 2:
            np.testing.assert_allclose(lengths, 0.36)
            for found in plan.passes:
                gap = found.facets[1:-1] == NO_FACET
                np.testing.assert_allclose(np.diff(found.bounds)[1:-1][gap], 0.06, atol=1e-12)
                inside = (found.path.arc_lengths > 0.1301) & (found.path.arc_lengths < 0.1899)
                assert np.all(np.isinf(found.leans[inside])) and np.all(np.isfinite(found.leans[~inside]))
        else:
            np.testing.assert_allclose(lengths, [0.16, 0.18, 0.16, 0.18], atol=1e-12)
            assert [(found.plane, found.curve) for found in plan.passes] == [(1, 1), (1, 2), (2, 1), (2, 2)]


def test_a_backward_plane_begins_with_its_last_curve() -> None:
    grid = np.arange(0, 301, 20.0), np.arange(0, 41, 10.0)
    plan, _, _ = planned(sheet(*grid, flat, hole=(100, 180, -1, 41)))
    assert [(found.plane, found.curve) for found in plan.passes] == [(1, 1), (1, 2), (2, 2), (2, 1)]
    for found in plan.passes:
        assert (found.path.points[-1, 0] > found.path.points[0, 0]) == (found.plane == 1)


def test_backwards_is_the_same_way() -> None:
    plan, _, _ = planned(roof(50))
    found = plan.passes[0]
    back = found.reversed()
    np.testing.assert_array_equal(back.path.points[::-1], found.path.points)
    np.testing.assert_allclose(np.diff(back.bounds)[::-1], np.diff(found.bounds), atol=1e-15)
    np.testing.assert_array_equal(back.facets[::-1], found.facets)
    np.testing.assert_allclose(back.exempt[:, ::-1], found.path.length - found.exempt[::-1], atol=1e-15)
    again = back.reversed()
    np.testing.assert_allclose(again.bounds, found.bounds, atol=1e-15)


def test_what_is_beyond_the_travel_is_cut_out_and_measured() -> None:
    plan, _, _ = planned(PLATE, "[part]\nx_mm = -100\ny_mm = 500\nz_mm = 10")
    assert plan.travel == pytest.approx(0.1 * 0.205, rel=1e-7)
    assert plan.sprayed == pytest.approx(0.2 * 0.205, rel=1e-7)
    for found in plan.passes:
        assert np.min(found.path.points[:, 0]) == 0.0
        # At the travel's end there is no room to go on.
        np.testing.assert_allclose(found.path.length, 0.23, atol=1e-9)


def test_a_wrist_that_does_not_tilt_far_enough_leaves_out_steep_facets() -> None:
    text = "[machine]\nlimits_deg = {phi = [0, 20]}\n"
    plan, _, _ = planned(sheet([0, 100, 200, 300], [0, 30], lambda x, y: np.where(x <= 200, 0, x - 200) + 0 * y), text)
    assert plan.travel == pytest.approx(0.1 * math.sqrt(2) * 0.03, rel=1e-9)
    assert plan.sprayed == pytest.approx(0.2 * 0.03, rel=1e-9)


def test_an_overrun_that_would_go_below_the_travel_goes_on_level() -> None:
    plan, _, _ = planned(roof(60), "[spray]\npattern = 'one_way'")
    found = plan.passes[0]
    lead = found.path.points[found.path.arc_lengths <= 0.03 + 1e-12]
    np.testing.assert_allclose(lead[:, 2], 0.0, atol=1e-12)
    assert found.path.arc_lengths[len(lead) - 1] == pytest.approx(0.03)
    assert np.ptp(lead[:, 0]) == pytest.approx(0.03)


def test_nothing_to_spray_is_said() -> None:
    wall = PLATE[..., [0, 2, 1]]
    with pytest.raises(NothingToSpray) as caught:
        planned(wall)
    assert str(caught.value) == (
        "panel.stl: no pass can be sprayed on it: of the surface 615 cm2 too steep, 0 cm2 hidden, 0 cm2 beyond the "
        "travel; turn the part or place it elsewhere"
    )
    with pytest.raises(NothingToSpray, match="615 cm2 beyond the travel"):
        planned(PLATE, "[part]\nx_mm = 5000")


def test_a_roof_s_ridge_is_a_crease_and_its_surroundings_are_exempt() -> None:
    plan, mesh, _ = planned(roof(39))
    found = plan.passes[0]
    ridge = 0.03 + 0.15 / math.cos(math.radians(19.5))
    np.testing.assert_allclose(found.exempt, [[ridge - 0.03, ridge + 0.03]], atol=1e-9)
    inside = (found.path.arc_lengths > ridge - 0.0299) & (found.path.arc_lengths < ridge + 0.0299)
    assert np.all(np.isinf(found.leans[inside])) and np.all(np.isfinite(found.leans[~inside]))
    assert len(planned(roof(29.9))[0].passes[0].exempt) == 0


def test_layers_are_turned_and_the_next_along_the_same_lines_lies_between() -> None:
    plan, _, _ = planned(PLATE, "[spray]\nlayers = 4\npattern = 'one_way'")
    ways = {layer: [one.path.points for one in plan.passes if one.layer == layer] for layer in (1, 2, 3, 4)}
    for layer, points in ways.items():
        across = 1 if layer % 2 else 0
        assert np.max([np.ptp(one[:, across]) for one in points]) <= 1e-9
        assert np.min([np.ptp(one[:, 1 - across]) for one in points]) > 0.2
    first, third = (sorted(float(one[0, 1]) for one in ways[layer]) for layer in (1, 3))
    assert len(third) == len(first) - 1
    np.testing.assert_allclose(np.array(third) - first[:-1], 0.0125, atol=1e-9)
    assert [one.path.number for one in plan.passes] == list(range(1, len(plan.passes) + 1))


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
    assert np.max(np.linalg.norm(np.diff(trajectory.positions[on:off, :3], axis=0), axis=1)) <= 0.01 + 1e-12
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
    assert trajectory.kinds[stop - 1] == Kind.DWELL and trajectory.durations[stop - 1] == 5.0
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
    mesh = read_mesh(part(name), spot=0.06)
    mesh = placed(mesh, setup)
    plan = plan_passes(mesh, setup, sprayer(), 0.1)
    spraying = spray(plan.passes, setup, sprayer(), float(mesh.vertices[:, 2].max()))
    assert np.max(in_part(plan.passes, mesh, spraying)) <= 15 * DEG
    if name.endswith("hood"):
        assert spraying.splits == ()
    assert plan.sprayed == pytest.approx(np.sum(mesh.areas) - plan.facing - plan.hidden, rel=1e-9)


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


def test_distance_from_a_part_in_plan() -> None:
    outline = PlanCoverage(
        mesh_of(sheet(np.arange(0, 301, 20.0), np.arange(0, 201, 20.0), flat, hole=(100, 160, 60, 120)))
    )
    points = np.array([[50, 50], [-10, 50], [-30, -40], [130, 90], [310, 210]]) * MM
    np.testing.assert_allclose(outline.distances(points, 0.0) / MM, [0, 10, 50, 30, math.hypot(10, 10)], atol=1e-9)
    np.testing.assert_allclose(outline.distances(points[:1], 1.0) / MM, [50], atol=1e-9)
    assert len(outline.distances(np.zeros((0, 2)), 0.0)) == 0


def test_a_flank_across_the_passes_gets_planes_between() -> None:
    """A flat and a flank of 75 deg: on neither are passes farther apart on the surface than a pitch and a half."""
    slope = math.tan(math.radians(75))
    panel = sheet([0, 100, 200, 300], [0, 50, 100, 150], lambda x, y: slope * np.maximum(y - 100, 0) + 0 * x)
    plan, mesh, _ = planned(panel, "[spray]\npattern = 'one_way'")
    low = float(np.min(mesh.vertices[:, 1]))
    places = np.array([found.path.points[0, 1] - low for found in plan.passes]) / MM
    flat_ones, steep = np.sort(places[places < 100]), np.sort(places[places > 100])
    np.testing.assert_allclose(np.diff(places[:6]), 25.0, atol=1e-6)
    np.testing.assert_allclose(np.diff(flat_ones), 25.0, atol=1e-6)
    apart = np.diff(steep) / math.cos(math.radians(75))
    np.testing.assert_allclose(apart, 6.25 / math.cos(math.radians(75)), atol=1e-5)
    assert np.all(apart <= 37.5)
    assert [found.plane for found in plan.passes] == list(range(1, len(plan.passes) + 1))


def test_no_planes_lie_between_where_the_slope_is_along_the_passes() -> None:
    slope = math.tan(math.radians(75))
    panel = sheet([0, 50, 100, 150], [0, 100, 200], lambda x, y: slope * np.maximum(x - 100, 0) + 0 * y)
    assert len(planned(panel)[0].passes) == 8


def test_heights_of_further_planes_halve_the_distance() -> None:
    heights, widths = flank_heights(np.array([10.0, 12.0]), 2.0, (9.0, 13.0))
    np.testing.assert_allclose(heights[widths == 1.5], [11.0], atol=1e-12)
    np.testing.assert_allclose(heights[widths == 3.0], [9.5, 10.5, 11.5, 12.5], atol=1e-12)
    everything = np.sort(np.concatenate([heights, [10.0, 12.0]]))
    np.testing.assert_allclose(np.diff(everything), 0.125, atol=1e-12)


def test_a_chain_on_a_flank_passes_over_short_stretches_and_says_where_the_section_goes_on() -> None:
    x = np.array([0.0, 10, 40, 45, 70, 72, 100, 101, 200]) / 1e3
    points = np.column_stack([x, 0 * x, 0 * x])
    count = len(x) - 1
    segments = Segments(points[:-1], points[1:], np.arange(count), np.zeros(count, int), np.zeros((count, 2), bool))
    widths = np.array([1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 1.0])
    found = on_steep_sides(segments, widths, np.full(count, 1.5), 0.006, 0.025)
    assert found.facets.tolist() == [1, 2, 3, 4, 5]
    assert found.goes_on.tolist() == [[True, False], [False, False], [False, False], [False, False], [False, True]]
    # 5 mm are too long to pass over, and chains of 30 mm and 55 mm remain.
    assert on_steep_sides(segments, widths, np.full(count, 1.5), 0.004, 0.025).facets.tolist() == [1, 3, 4, 5]
    assert on_steep_sides(segments, widths, np.full(count, 1.5), 0.004, 0.035).facets.tolist() == [3, 4, 5]
    assert len(on_steep_sides(segments, widths, np.full(count, 3.0), 0.1, 0.01).facets) == 0
    edges = on_steep_sides(segments, np.full(count, 2.0), np.full(count, 1.5), 0.1, 0.01)
    assert len(edges.facets) == count and not np.any(edges.goes_on)
