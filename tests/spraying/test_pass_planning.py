"""Planned passes: where they go, what they pass over, and what they leave out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tapelayer.errors import NothingToSpray
from tapelayer.spraying.passes import NO_FACET
from tapelayer.units import MM
from tests.helpers.panels import flat, sheet
from tests.helpers.sprayed import planned, roof

PLATE = sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat)


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
    assert (plan.too_steep, plan.hidden, plan.beyond_travel) == (0.0, 0.0, 0.0)
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


def test_what_is_beyond_the_travel_is_cut_out_and_measured() -> None:
    plan, _, _ = planned(PLATE, "[part]\nx_mm = -100\ny_mm = 500\nz_mm = 10")
    assert plan.beyond_travel == pytest.approx(0.1 * 0.205, rel=1e-7)
    assert plan.sprayed == pytest.approx(0.2 * 0.205, rel=1e-7)
    for found in plan.passes:
        assert np.min(found.path.points[:, 0]) == 0.0
        # At the travel's end there is no room to go on.
        np.testing.assert_allclose(found.path.length, 0.23, atol=1e-9)


def test_a_wrist_that_does_not_tilt_far_enough_leaves_out_steep_facets() -> None:
    text = "[machine]\nlimits_deg = {phi = [0, 20]}\n"
    plan, _, _ = planned(sheet([0, 100, 200, 300], [0, 30], lambda x, y: np.where(x <= 200, 0, x - 200) + 0 * y), text)
    assert plan.beyond_travel == pytest.approx(0.1 * math.sqrt(2) * 0.03, rel=1e-9)
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
    # The gun leans by up to 15 deg, less the 2 deg that straight blocks may cost.
    assert [len(planned(roof(fold))[0].passes[0].exempt) for fold in (25.9, 26.1)] == [0, 1]
    assert len(planned(roof(29.9), "[spray]\ntolerance_deg = 0.01")[0].passes[0].exempt) == 0


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
