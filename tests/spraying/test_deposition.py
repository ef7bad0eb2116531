"""Deposition: what arrives on any surface, and how even it is, each by two ways."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.models import read_mesh
from tapelayer.spraying.deposition import (
    Evenness,
    Spots,
    Surface,
    evenness,
    exposure,
    inside_of,
    spots_along,
    surface_from_above,
)
from tapelayer.spraying.footprint import Footprint, Gaussian
from tapelayer.spraying.pitch import raster_cv
from tests.helpers.footprints import FOOTPRINTS, H, each_footprint
from tests.helpers.meshes import of_shape
from tests.helpers.parts import real_parts


def level(width: float, spacing: float) -> Surface:
    """A level square about the origin."""
    count = round(width / spacing)
    places = (np.arange(count) + 0.5) * spacing - width / 2
    x, y = (values.ravel() for values in np.meshgrid(places, places))
    points = np.column_stack([x, y, np.zeros(len(x))])
    return Surface(points, np.tile([0.0, 0.0, 1.0], (len(x), 1)), np.full(len(x), spacing**2))


def one_spot(axis: Floats | None = None) -> Spots:
    upright = np.array([0.0, 0.0, 1.0])
    return Spots(np.zeros((1, 3)), (upright if axis is None else axis)[None], np.ones(1))


def turned(surface: Surface, turn: Floats, shift: Floats) -> Surface:
    return Surface(surface.points @ turn.T + shift, surface.normals @ turn.T, surface.areas)


def surface_of(vertices: Floats, facets: Ints) -> Surface:
    """Facets as samples, for fine meshes."""
    corners = vertices[facets]
    spans = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(spans, axis=1)
    return Surface(corners.mean(axis=1), spans / sizes[:, None], sizes / 2)


@each_footprint
def test_square_on_a_plane_the_footprint_itself_arrives(footprint: Footprint) -> None:
    surface = level(0.2, 0.004)
    found = exposure(footprint, H, one_spot(), surface)
    expected = footprint.flux(np.linalg.norm(surface.points, axis=1))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.max(expected))


@each_footprint
@pytest.mark.parametrize("tilt", [0, 15, 40])
def test_a_slope_catches_all_material(footprint: Footprint, tilt: float) -> None:
    surface = level(0.5, 0.001)
    axis = Rotation.from_euler("yz", [tilt, 30], degrees=True).apply([0.0, 0.0, 1.0])
    found = exposure(footprint, H, one_spot(axis), surface)
    assert found @ surface.areas == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("height", [0.02, -0.02])
def test_humps_and_hollows_catch_all_material(height: float) -> None:
    x, y = np.meshgrid(np.linspace(-0.12, 0.12, 161), np.linspace(-0.12, 0.12, 161))
    z = height * np.exp(-((x**2 + (y - 0.01) ** 2) / 0.03**2))
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    corner = (np.arange(160)[:, None] * 161 + np.arange(160)).ravel()
    facets = np.vstack(
        [
            np.column_stack([corner, corner + 1, corner + 162]),
            np.column_stack([corner, corner + 162, corner + 161]),
        ]
    )
    surface = surface_of(vertices, facets)
    for footprint in FOOTPRINTS:
        found = exposure(footprint, H, one_spot(), surface)
        assert found @ surface.areas == pytest.approx(1, abs=2e-3)


def test_incidence_and_distance_on_the_axis() -> None:
    normals = np.array([[0.0, 0.0, 1.0], [math.sin(0.6), 0.0, math.cos(0.6)], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -0.05], [0.0, 0.0, 0.0]])
    surface = Surface(points, normals, np.ones(4))
    found = exposure(Gaussian(0.03), H, one_spot(), surface)
    expected = [1.0, math.cos(0.6), (0.15 / 0.20) ** 2, 0.0]
    np.testing.assert_allclose(found / found[0], expected, rtol=0, atol=1e-12)


def test_what_faces_away_or_lies_behind_the_nozzle_gets_nothing() -> None:
    down, up = [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]
    surface = Surface(np.array([[0.0, 0, 0], [0, 0, 0.03], [0, 0, 0.05]]), np.array([down, up, down]), np.ones(3))
    assert exposure(Gaussian(0.03), 0.02, one_spot(), surface).tolist() == [0, 0, 0]


def summed_one_by_one(footprint: Footprint, spots: Spots, surface: Surface) -> Floats:
    """Exposure by angles: intensity over the angle off the axis, the incidence, the distance."""
    total = np.zeros(len(surface.points))
    for point, axis, seconds in zip(spots.points, spots.axes, spots.seconds, strict=True):
        rays = surface.points - (point + H * axis)
        distance = np.linalg.norm(rays, axis=1)
        rays = rays / distance[:, None]
        off = np.arccos(np.clip(rays @ -axis, -1, 1))
        incidence = -np.sum(rays * surface.normals, axis=1)
        with np.errstate(over="ignore"):
            intensity = footprint.flux(H * np.tan(off)) * H**2 / np.cos(off) ** 3
        arrived = np.where((off < np.pi / 2) & (incidence > 0), intensity * incidence / distance**2, 0.0)
        near = np.linalg.norm(surface.points - point, axis=1) <= 2 * footprint.reach
        total += seconds * np.where(near, arrived, 0.0)
    return total


@each_footprint
def test_many_spots_on_a_rough_surface_one_by_one(footprint: Footprint) -> None:
    chance = np.random.default_rng(2)
    count = 700
    points = chance.uniform([-0.2, -0.2, -0.03], [0.2, 0.2, 0.03], (count, 3))
    normals = chance.normal(size=(count, 3)) + [0, 0, 1.5]
    surface = Surface(points, normals / np.linalg.norm(normals, axis=1)[:, None], np.ones(count))
    axes = chance.normal(size=(600, 3)) * 0.3 + [0, 0, 1]
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    spots = Spots(chance.uniform([-0.25, -0.25, -0.02], [0.25, 0.25, 0.02], (600, 3)), axes, chance.uniform(0, 1, 600))
    found = exposure(footprint, H, spots, surface)
    expected = summed_one_by_one(footprint, spots, surface)
    # A sample on the very edge of a footprint may be in or out by rounding.
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.max(expected))
    assert np.count_nonzero(found) > 600


def test_layers_add_up() -> None:
    surface = level(0.2, 0.01)
    chance = np.random.default_rng(4)
    layers = [
        Spots(chance.uniform(-0.1, 0.1, (50, 3)) * [1, 1, 0], np.tile([0.0, 0, 1], (50, 1)), chance.uniform(0, 1, 50))
        for _ in range(2)
    ]
    both = Spots(*(np.concatenate([getattr(one, name) for one in layers]) for name in ("points", "axes", "seconds")))
    one, two, all_ = (exposure(Gaussian(0.015), H, spots, surface) for spots in (*layers, both))
    np.testing.assert_allclose(one + two, all_, rtol=1e-12)


@given(
    st.tuples(*[st.floats(-180, 180)] * 3),
    st.tuples(*[st.floats(-2, 2)] * 3),
)
@settings(max_examples=30)
def test_where_all_of_it_stands_does_not_matter(angles: tuple[float, ...], shift: tuple[float, ...]) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    surface = level(0.12, 0.01)
    spots = Spots(np.array([[0.01, 0.0, 0.0]]), np.array([[0.2, 0.1, 0.9]]) / math.sqrt(0.86), np.ones(1))
    moved = Spots(spots.points @ turn.T + shift, spots.axes @ turn.T, spots.seconds)
    here = exposure(Gaussian(0.015), H, spots, surface)
    there = exposure(Gaussian(0.015), H, moved, turned(surface, turn, np.array(shift)))
    np.testing.assert_allclose(there, here, rtol=1e-9, atol=1e-9 * np.max(here))


def test_a_footprint_needs_a_standoff() -> None:
    for standoff in (0.0, -0.1, math.nan):
        with pytest.raises(ValueError, match="a footprint needs a standoff above 0, got"):
            exposure(Gaussian(0.015), standoff, one_spot(), level(0.1, 0.05))


def test_spots_lie_evenly_on_the_pieces_and_keep_their_time() -> None:
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.03, 0], [0.5, 0.5, 0], [0.5, 0.6, 0.01]])
    axes = np.array([[0.0, 0, 1], [0.6, 0, 0.8], [0, 0, 1], [0, 0, 1], [0, 0, 1]])
    times = np.array([0.0, 1.0, 1.6, 9.0, 9.5])
    spots = spots_along(points, axes, times, np.array([0, 0, 0, 1, 1]), 0.02)
    assert len(spots.points) == 5 + 2 + 6
    assert np.sum(spots.seconds) == pytest.approx(2.1, abs=1e-12)
    np.testing.assert_allclose(spots.points[:5, 0], [0.01, 0.03, 0.05, 0.07, 0.09], atol=1e-12)
    np.testing.assert_allclose(spots.seconds[:7], [0.2] * 5 + [0.3] * 2, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(spots.axes, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(spots.axes[2], np.array([0.3, 0, 0.9]) / math.sqrt(0.9), atol=1e-12)


def raster(pitch: float, passes: int, half_length: float, spacing: float) -> Spots:
    """Parallel passes along x over the origin at 0.3 m/s, there and back."""
    heights = pitch * (np.arange(passes) - (passes - 1) / 2)
    x = np.where(np.arange(passes)[:, None] % 2, [half_length, -half_length], [-half_length, half_length])
    points = np.column_stack([x.ravel(), np.repeat(heights, 2), np.zeros(2 * passes)])
    times = np.cumsum(np.tile([1.0, 2 * half_length / 0.3], passes))
    axes = np.tile([0.0, 0.0, 1.0], (2 * passes, 1))
    return spots_along(points, axes, times, np.repeat(np.arange(passes), 2), spacing)


@each_footprint
@pytest.mark.parametrize("pitch", [0.02, 0.035])
def test_a_sprayed_plane_is_as_even_as_the_raster_says(footprint: Footprint, pitch: float) -> None:
    spots = raster(pitch, 15, 0.12, footprint.reach / 10)
    y = (np.arange(60) + 0.5) / 60 * pitch
    surface = Surface(
        np.column_stack([np.zeros(60), y, np.zeros(60)]), np.tile([0.0, 0, 1], (60, 1)), np.full(60, pitch / 60)
    )
    found = evenness(
        exposure(footprint, H, spots, surface), surface, np.ones(60, dtype=np.bool_), float(np.sum(surface.areas))
    )
    # Everything that a metre of pass leaves in its strip.
    assert found.mean == pytest.approx(1 / (0.3 * pitch), rel=2e-3)
    assert found.cv_percent == pytest.approx(100 * raster_cv(footprint, pitch), abs=0.25)
    assert found.cv_interior_percent == found.cv_percent


def test_evenness_by_hand() -> None:
    areas = np.array([1.0, 2.0, 1.0, 4.0])
    thickness = np.array([2.0, 4.0, 6.0, 0.5])
    surface = Surface(np.zeros((4, 3)), np.zeros((4, 3)), areas)
    found = evenness(thickness, surface, np.array([True, True, True, False]), float(np.sum(surface.areas)))
    mean = (2 + 8 + 6 + 2) / 8
    variance = (1 * (2 - mean) ** 2 + 2 * (4 - mean) ** 2 + 1 * (6 - mean) ** 2 + 4 * (0.5 - mean) ** 2) / 8
    assert found == Evenness(
        mean=pytest.approx(mean),
        cv_percent=pytest.approx(100 * math.sqrt(variance) / mean),
        interior_mean=pytest.approx(4.0),
        cv_interior_percent=pytest.approx(100 * math.sqrt(2) / 4),
        # Half the interior mean, 2, is not reached by the first and the last.
        coverage_percent=pytest.approx(100 * 3 / 8),
    )


def test_evenness_of_nothing_is_no_number() -> None:
    surface = level(0.1, 0.05)
    bare = evenness(np.zeros(4), surface, np.ones(4, dtype=np.bool_), float(np.sum(surface.areas)))
    assert bare.mean == bare.interior_mean == 0
    assert math.isnan(bare.cv_percent) and math.isnan(bare.cv_interior_percent) and math.isnan(bare.coverage_percent)
    rim = evenness(np.ones(4), surface, np.zeros(4, dtype=np.bool_), float(np.sum(surface.areas)))
    assert rim.mean == 1 and rim.cv_percent == 0
    assert math.isnan(rim.interior_mean) and math.isnan(rim.cv_interior_percent) and math.isnan(rim.coverage_percent)


def test_samples_of_a_box_are_its_top() -> None:
    surface, border = surface_from_above(of_shape(trimesh.creation.box((0.3, 0.2, 0.1))), 0.01, 0.02)
    assert np.sum(surface.areas) == pytest.approx(0.06, rel=1e-9)
    np.testing.assert_allclose(surface.points[:, 2], 0.05, atol=1e-12)
    np.testing.assert_allclose(surface.normals, np.tile([0.0, 0.0, 1.0], (len(surface.points), 1)), atol=1e-12)
    edge = np.maximum(np.abs(border[:, 0]) / 0.15, np.abs(border[:, 1]) / 0.1)
    np.testing.assert_allclose(edge, 1, atol=1e-9)
    x, y = np.abs(surface.points[:, 0]), np.abs(surface.points[:, 1])
    distance = np.minimum(0.15 - x, 0.1 - y)
    inside = inside_of(surface, border, 0.03)
    assert np.all(inside[distance > 0.0305]) and not np.any(inside[distance < 0.0295])
    assert 0 < np.count_nonzero(inside) < len(inside)


def test_samples_of_a_ball_are_its_upper_half() -> None:
    surface, border = surface_from_above(of_shape(trimesh.creation.icosphere(5, 0.2)), 0.005, 0.02)
    assert np.sum(surface.areas) == pytest.approx(2 * np.pi * 0.04 * 0.98, rel=0.01)
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), 0.2, atol=1e-3)
    assert np.all(np.sum(surface.points * surface.normals, axis=1) > 0.199)
    assert np.all(border[:, 2] < 0.02)


def test_no_border_no_band() -> None:
    surface = level(0.1, 0.05)
    assert np.all(inside_of(surface, np.empty((0, 3)), 1.0))
    chosen = surface.only(np.array([True, False, True, False]))
    np.testing.assert_array_equal(chosen.points, surface.points[[0, 2]])


@pytest.mark.parametrize("name", ["hood", *real_parts("drivaer_hood")])
def test_the_border_of_the_hood_is_its_edge(part: Callable[[str], Path], name: str) -> None:
    mesh = read_mesh(part(name))
    surface, border = surface_from_above(mesh, 0.02, 0.02)
    assert np.sum(surface.areas) == pytest.approx(np.sum(mesh.areas), rel=0.02)
    shape = trimesh.Trimesh(mesh.vertices, mesh.facets, process=False)
    edges = shape.edges_sorted[trimesh.grouping.group_rows(shape.edges_sorted, require_count=1)]
    begins, ends = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]]
    ways = ends - begins
    shares = np.einsum("pek,ek->pe", border[:, None] - begins, ways) / np.sum(ways**2, axis=1)
    nearest = begins + np.clip(shares, 0, 1)[..., None] * ways
    off = np.min(np.linalg.norm(border[:, None] - nearest, axis=2), axis=1)
    assert np.max(off) < 1e-9
