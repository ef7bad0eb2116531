"""Reach: where a part lies, and what of it can be sprayed, against the definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.geometry import slicing
from tapelayer.geometry.envelope import upper_envelope
from tapelayer.geometry.slicing import plane_direction, plane_heights
from tapelayer.machines.wrist import reachable
from tapelayer.spraying.reach import Reach, placement
from tests.helpers.machines import limited, sprayer
from tests.helpers.normals import unit
from tests.helpers.panels import flat, mesh_of, sheet
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import placed, roof

PLATE = sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat)


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


def reach_of(triangles: Floats, text: str) -> Reach:
    setup = spray_setup_of(text)
    return Reach(placed(mesh_of(triangles), setup), setup, limited(setup))


WAVY = sheet(np.linspace(0, 600, 25), np.linspace(0, 400, 17), lambda x, y: 60 * np.sin(x / 50) * np.cos(y / 60))
TIGHT = """
[machine]
limits_mm = {x = [1000, 1420], y = [900, 1150], z = [0, 0.09e3]}
limits_deg = {phi = [0, 20]}
[part]
x_mm = 950
y_mm = 800
z_mm = 60
rotation_deg = 10
"""


@pytest.mark.parametrize("degrees", [0, 30, 90, 200])
@pytest.mark.parametrize("text", ["", TIGHT])
def test_segments_are_what_lies_in_the_travel_at_an_angle_that_the_wrist_has(text: str, degrees: float) -> None:
    """Against ten thousand points of the sections as they are seen from above."""
    reach = reach_of(WAVY, text)
    direction = plane_direction(math.radians(degrees))
    heights = plane_heights(reach.mesh, direction, 0.05)
    segments, lost = reach.segments(direction, heights)
    sections = upper_envelope(reach.mesh, slicing.slice(reach.mesh, direction, heights), reach.min_normal_z)
    rows, shares = sections.segments, (np.arange(200) + 0.5) / 200
    inside = np.zeros(len(rows))
    for share in shares:
        points = sections.points[rows] + share * (sections.points[rows + 1] - sections.points[rows])
        inside += (
            np.all((points >= reach.box[0]) & (points <= reach.box[1]), axis=1) & reach.facets[sections.facets[rows]]
        )
    expected = inside / len(shares) * sections.lengths
    assert np.sum(segments.lengths) == pytest.approx(np.sum(expected), rel=1e-3)
    assert np.all(reach.holds((segments.begins + segments.ends) / 2, reach.normals[segments.facets]))
    assert np.all(reach.holds(segments.begins, reach.normals[segments.facets]))
    assert np.all(np.diff(segments.planes) >= 0) and not np.any(segments.goes_on)
    areas = sections.lengths * slicing.strip_widths(reach.normals[sections.facets[rows]], direction, 1.0)
    cut = 1.0 - inside / len(shares)
    assert lost == pytest.approx(np.sum(cut * areas) / np.sum(areas), abs=1e-3)
    assert (lost > 0.1) == bool(text)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_what_reach_holds_is_in_the_box_and_reachable(seed: int) -> None:
    chance = np.random.default_rng(seed)
    reach = reach_of(WAVY, TIGHT)
    points = np.round(chance.uniform(reach.box[0] - 0.1, reach.box[1] + 0.1, (200, 3)), 2)
    normals = unit(chance.normal(size=(200, 3)))
    leans = np.full(200, reach.wrist.max_deviation)
    expected = np.all((points >= reach.box[0]) & (points <= reach.box[1]), axis=1) & reachable(
        reach.wrist, normals, leans
    )
    assert reach.holds(points, normals).tolist() == expected.tolist()
    assert not np.any(reach.holds(np.where(chance.random((200, 1)) < 2, np.nan, points), normals))


def test_a_part_with_a_given_place_is_where_its_vertices_say() -> None:
    setup = spray_setup_of(TIGHT)
    mesh = mesh_of(WAVY)
    rotation, origin = placement(mesh, setup, limited(setup))
    np.testing.assert_allclose(mesh.moved(rotation, origin).vertices, mesh.vertices @ rotation.T + origin)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(origin, [0.95, 0.8, 0.06])
