import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.errors import NoNaturalPaths
from tapelayer.geometry.geodesics import aimed
from tapelayer.plies.reach import Reach
from tapelayer.plies.strip import LEFT, RIGHT, strip_through
from tests.helpers.height_fields import Cylinder, Sphere, Torus, plane, saddle

WIDTH = 0.15
PLY = shapely.box(-0.5, -0.6, 0.5, 0.6)
REACH = Reach.around(PLY, 2 * WIDTH)
FIELDS = [plane(0.1, -0.2), Cylinder(), Sphere(), Torus(), saddle()]


def strip_on(field, degrees, at=(0.0, 0.0)):
    angle = math.radians(degrees)
    state = aimed(field, np.array([at]), np.array([[-math.sin(angle), math.cos(angle)]]))[0]
    return strip_through(field, state, REACH, WIDTH, 0.005)


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)
@pytest.mark.parametrize("degrees", [0.0, 45.0, -45.0, 90.0, 17.0])
def test_strip_coordinates_and_back(field, degrees):
    strip = strip_on(field, degrees)
    random = np.random.default_rng(1)
    arcs = random.uniform(strip.arcs[1], strip.arcs[-2], 200)
    across = random.uniform(-WIDTH / 2, WIDTH / 2, 200)
    found = strip.coordinates(strip.plan(arcs, across))
    np.testing.assert_allclose(found, (arcs, across), atol=1e-9)


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)
def test_the_edges_lie_at_half_the_width(field):
    strip = strip_on(field, 30.0)
    for side in (LEFT, RIGHT):
        np.testing.assert_allclose(
            strip.plan(strip.arcs, np.full(len(strip.arcs), side * WIDTH / 2)), strip.edge(side)[:, :2], atol=1e-12
        )


def test_on_a_plane_strip_coordinates_are_lengths():
    strip = strip_on(plane(), 0.0)
    plan = np.array([[0.02, 0.3], [-0.05, -0.4]])
    np.testing.assert_allclose(strip.coordinates(plan), [[0.3, -0.4], [-0.02, 0.05]], atol=1e-12)


def test_strain_on_a_sphere():
    strip = strip_on(Sphere(5.0), 20.0)
    # Edges lie on circles of latitude: cos(w / 2 R), by half the square of it to first order.
    np.testing.assert_allclose(strip.strains, math.cos(WIDTH / 2 / 5.0) - 1.0, rtol=1e-6)
    assert np.abs(strip.strains).max() == pytest.approx(WIDTH**2 / 8 / 25, rel=1e-2)


def test_a_developable_surface_strains_nothing():
    assert np.abs(strip_on(Cylinder(), 33.0).strains).max() < 1e-12


@settings(max_examples=25, deadline=None)
@given(st.floats(-180.0, 180.0), st.floats(-0.6, 0.6), st.floats(-0.7, 0.7))
def test_a_strip_begins_and_ends_outside_the_reach_and_is_inside_between(degrees, x, y):
    strip = strip_on(saddle(), degrees, (x, y))
    inside = REACH.holds(strip.states[:, :2])
    assert not inside[0] and not inside[-1]
    assert np.all(inside[1:-1])
    assert np.any(strip.arcs == 0.0)


def test_the_piece_between_two_lines_is_a_polygon_of_their_corners():
    strip = strip_on(plane(), 0.0)
    polygon = strip.polygon((-0.2, 1.0), (0.3, -1.0))
    assert polygon.is_valid
    half = WIDTH / 2
    corners = shapely.Polygon([(-half, -0.2 + half), (-half, 0.3 - half), (half, 0.3 + half), (half, -0.2 - half)])
    assert polygon.symmetric_difference(corners).area < 1e-9


def test_a_strip_that_does_not_leave_the_ply_is_refused(monkeypatch):
    # As on a surface that leads round and round: the end is not reached within the length that is allowed.
    monkeypatch.setattr("tapelayer.plies.strip.LONGEST", 0.1)
    monkeypatch.setattr("tapelayer.plies.strip.MOST_STEPS", 10)
    with pytest.raises(NoNaturalPaths, match="does not leave the ply near .* split the ply"):
        strip_on(plane(), 0.0)
