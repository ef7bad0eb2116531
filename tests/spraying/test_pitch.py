"""Pitches: how even a raster is, and the widest that is even enough."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tapelayer.errors import PitchNotFound
from tapelayer.spraying.footprint import Footprint, Gaussian, ParabolicFlux, ParabolicPass
from tapelayer.spraying.pitch import raster_cv, widest_pitch
from tests.helpers.footprints import each_footprint


def test_gaussian_raster_table() -> None:
    found = [100 * raster_cv(Gaussian(0.015), share * 0.015) for share in (1.5, 1.8, 2.0, 2.2, 2.5, 3.0)]
    assert [round(value, 2) for value in found[:2]] == [0.02, 0.32]
    assert [round(value, 1) for value in found[2:]] == [1.0, 2.4, 6.0, 15.8]


def least_cv_pitch(footprint: Footprint) -> float:
    """Widest pitch at which the coefficient of variation has a minimum."""
    pitches = np.arange(0.5, 1.9, 0.002)
    values = np.array([raster_cv(footprint, pitch) for pitch in pitches])
    minima = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] < values[2:])) + 1
    return float(pitches[minima[-1]])


def test_widest_good_pitch_of_the_parabolic_pass() -> None:
    footprint = ParabolicPass(1.0)
    assert least_cv_pitch(footprint) == pytest.approx(1.40, abs=0.005)
    found = [round(100 * raster_cv(footprint, pitch), 1) for pitch in (1.0, 1.1, 1.4)]
    assert found == [11.2, 12.3, 5.3]
    # Variance in units of the peak squared, where 0.30 of the width overlaps.
    x = (np.arange(1000) + 0.5) / 1000 * 1.4
    profile = np.sum(np.maximum(1 - (x[:, None] - 1.4 * np.arange(-1, 3)) ** 2, 0), axis=1)
    mean = 4 / 3 / 1.4
    assert np.var(profile) == pytest.approx((raster_cv(footprint, 1.4) * mean) ** 2, rel=1e-3)
    assert round(float(np.var(profile)), 4) == 0.0026


def test_widest_good_pitch_of_the_parabolic_flux() -> None:
    assert least_cv_pitch(ParabolicFlux(1.0)) == pytest.approx(1.22, abs=0.005)
    assert round(100 * raster_cv(ParabolicFlux(1.0), 1.22), 1) == 2.7


@each_footprint
@pytest.mark.parametrize("target", [0.01, 0.05, 0.2])
def test_every_pitch_up_to_the_widest_keeps_the_target(footprint: Footprint, target: float) -> None:
    widest = widest_pitch(footprint, target)
    narrower = widest * np.linspace(0.15, 1.0, 150)
    assert all(raster_cv(footprint, pitch) <= target * (1 + 1e-3) for pitch in narrower)
    assert raster_cv(footprint, widest * 1.001) > target


def test_a_wider_pitch_behind_one_that_fails_is_not_taken() -> None:
    footprint = ParabolicPass(0.03)
    assert raster_cv(footprint, 1.4 * 0.03) < 0.06
    assert widest_pitch(footprint, 0.06) < 1.0 * 0.03
    assert widest_pitch(footprint, 0.125) > 1.4 * 0.03


def test_passes_overlap_however_uneven_they_may_be() -> None:
    assert widest_pitch(ParabolicFlux(0.03), 50.0) == pytest.approx(0.06)


def test_no_pitch_is_even_enough() -> None:
    for target in (1e-9, 0.0, math.nan):
        with pytest.raises(PitchNotFound, match=r"no pitch above 1\.88 mm keeps .* raise target_cv_percent"):
            widest_pitch(ParabolicPass(0.03), target)
