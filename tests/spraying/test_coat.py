"""Coats: what a program leaves, against the definition, and how it grows."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.spraying.coat import Coat, coat_of, growth
from tapelayer.spraying.deposition import Spots, exposure
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.footprint import footprint_of
from tapelayer.spraying.inspection import SprayInspector
from tapelayer.spraying.program import spray
from tapelayer.spraying.reach import Reach
from tapelayer.spraying.settings import SpraySetup
from tests.helpers.machines import limited
from tests.helpers.panels import flat, sheet
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import planned

PLATE = "plate"
WAVE = "wave"
SHEETS = {
    PLATE: sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat),
    WAVE: sheet(np.linspace(0, 300, 31), np.linspace(0, 200, 5), lambda x, y: 15 * np.sin(x / 40) + 0.1 * y),
}
MOMENTS = 7


@cache
def measured(name: str) -> tuple[SpraySamples, Reach]:
    """Samples of the program over a sheet, and what of the sheet can be reached."""
    plan, mesh, setup = planned(SHEETS[name])
    spraying = spray(plan.passes, setup, limited(setup), float(mesh.vertices[:, 2].max()))
    evidence = (
        SprayInspector(plan.passes, spraying.splits, mesh, setup, limited(setup)).verify(spraying.trajectory).evidence
    )
    return evidence.samples, Reach(mesh, setup, limited(setup))


def coat(name: str, text: str = "") -> tuple[Coat, SpraySetup]:
    setup = spray_setup_of(text)
    return coat_of(*measured(name), setup), setup


def one_by_one(name: str, setup: SpraySetup, points: Floats, normals: Floats) -> Floats:
    """Exposure of points by a spot in the middle of every pair of samples, none merged with another."""
    samples, _ = measured(name)
    same = np.diff(samples.pieces) == 0
    axes = samples.axes[:-1] + samples.axes[1:]
    spots = Spots(
        (samples.points[:-1] + samples.points[1:])[same] / 2,
        (axes / np.linalg.norm(axes, axis=1)[:, None])[same],
        np.diff(samples.times)[same],
    )
    surface = type(coat(name)[0].surface)(points, normals, np.ones(len(points)))
    return exposure(footprint_of(setup), setup.standoff, spots, surface)


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("model", ["gaussian", "parabolic_flux", "parabolic_pass"])
def test_thickness_is_the_rate_times_what_every_moment_leaves(name: str, model: str) -> None:
    found, setup = coat(name, f"[footprint]\nmodel = '{model}'\nrate_mm3_per_s = 80")
    assert not found.relative
    expected = one_by_one(name, setup, found.surface.points, found.surface.normals) * 80e-9
    np.testing.assert_allclose(found.thickness, expected, rtol=0, atol=0.01 * np.max(expected))
    assert np.sum(found.thickness * found.surface.areas) == pytest.approx(
        np.sum(expected * found.surface.areas), rel=1e-3
    )


def test_the_plate_keeps_what_does_not_fall_beside_it() -> None:
    found, _ = coat(PLATE, "[footprint]\nrate_mm3_per_s = 80")
    samples, _ = measured(PLATE)
    runs = np.where(np.diff(samples.pieces) == 0, np.diff(samples.times), 0.0)
    sprayed = 80e-9 * np.sum(runs)
    share = np.sum(found.thickness * found.surface.areas) / sprayed
    # The overrun of 30 mm at both ends and the ways from pass to pass miss the plate.
    assert 0.7 < share < 0.9
    assert found.evenness.interior_mean == pytest.approx(80e-9 / (0.3 * 0.0295), rel=0.2)


def test_twice_the_rate_is_twice_the_coat_and_no_rate_is_relative_to_the_mean() -> None:
    one, two, relative = (
        coat(WAVE, text)[0] for text in ("[footprint]\nrate_mm3_per_s = 10", "[footprint]\nrate_mm3_per_s = 20", "")
    )
    np.testing.assert_allclose(two.thickness, 2 * one.thickness, rtol=1e-12)
    assert relative.relative and np.average(relative.thickness, weights=relative.surface.areas) == pytest.approx(1.0)
    np.testing.assert_allclose(relative.thickness * one.evenness.mean, one.thickness, rtol=1e-9)
    assert relative.evenness.cv_percent == pytest.approx(one.evenness.cv_percent, rel=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        one.thickness[0] = 0.0


def test_what_the_wrist_does_not_reach_is_no_part_of_the_coat() -> None:
    samples, reach = measured(WAVE)
    setup = spray_setup_of(
        "[machine]\nlimits_deg = {phi = [0, 10]}\n[spray]\nmax_deviation_deg = 5\ntolerance_deg = 1e-6"
    )
    narrow = Reach(reach.mesh, setup, limited(setup))
    found = coat_of(samples, narrow, setup)
    assert np.all(found.surface.normals[:, 2] >= math.cos(math.radians(15)) - 1e-9)
    whole, _ = coat(WAVE)
    assert 0 < len(found.surface.points) < len(whole.surface.points)
    # But of what is to be covered.
    share = np.sum(found.surface.areas) / np.sum(whole.surface.areas)
    assert found.evenness.coverage_percent <= 100.0 * share + 1e-9 < whole.evenness.coverage_percent


@pytest.mark.parametrize("text", ["", "[footprint]\nrate_mm3_per_s = 80"])
def test_a_coat_grows_from_nothing_to_what_it_is(text: str) -> None:
    found, setup = coat(WAVE, text)
    samples, _ = measured(WAVE)
    chosen = np.arange(len(found.thickness)) % 3 == 0
    times, thickness = growth(found, samples, setup, chosen, MOMENTS)
    assert thickness.shape == (np.count_nonzero(chosen), MOMENTS) and times.shape == (MOMENTS,)
    assert np.all(thickness[:, 0] == 0.0)
    np.testing.assert_array_equal(thickness[:, -1], found.thickness[chosen])
    assert np.all(np.diff(thickness, axis=1) >= -1e-9 * np.max(thickness))
    assert times[0] == pytest.approx(samples.times[0]) and times[-1] == pytest.approx(samples.times[-1])
    # Evenly in the time with the arc on, as far as spots divide it.
    steps = np.where(np.diff(samples.pieces) == 0, np.diff(samples.times), 0.0)
    lit = np.interp(times, samples.times, np.append(0.0, np.cumsum(steps)))
    np.testing.assert_allclose(lit, lit[-1] * np.arange(MOMENTS) / (MOMENTS - 1), atol=0.02 * lit[-1])


def test_the_growth_of_half_the_time_is_the_first_half_of_the_spots() -> None:
    found, setup = coat(PLATE)
    samples, _ = measured(PLATE)
    chosen = np.ones(len(found.thickness), dtype=bool)
    _, halves = growth(found, samples, setup, chosen, 3)
    _, quarters = growth(found, samples, setup, chosen, 5)
    np.testing.assert_allclose(halves[:, 1], quarters[:, 2], rtol=0, atol=1e-9 * np.max(halves))
