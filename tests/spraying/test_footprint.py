"""Footprints, each by two ways, and the files of profiles."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from tapelayer.errors import FootprintRefused
from tapelayer.spraying.footprint import Footprint, Gaussian, ParabolicFlux, ParabolicPass, footprint_of, read_profile
from tapelayer.spraying.settings import SpraySetup
from tests.helpers.footprints import RING, each_footprint


@each_footprint
def test_all_material_arrives_somewhere(footprint: Footprint) -> None:
    kinks = RING.radii[1:-1] if footprint is RING else None
    total, _ = quad(
        lambda r: 2 * np.pi * r * float(footprint.flux(np.array(r))), 0, footprint.reach, points=kinks, epsabs=1e-10
    )
    assert total == pytest.approx(1, abs=1e-5)
    assert footprint.flux(np.array([footprint.reach * 1.001, 1.0])).tolist() == [0, 0]


@each_footprint
@pytest.mark.parametrize("share", [0.0, 0.1, 0.33, 0.5, 0.7, 0.9, 0.99, 1.0, 1.2])
def test_across_a_pass_is_the_flux_summed_along_it(footprint: Footprint, share: float) -> None:
    scale = 3 * footprint.sigma if isinstance(footprint, Gaussian) else footprint.reach
    offset = share * scale
    if offset > footprint.reach:
        expected = 0.0
    else:
        half = math.sqrt(footprint.reach**2 - offset**2)
        kinks = [math.sqrt(r**2 - offset**2) for r in RING.radii[1:-1] if r > offset] if footprint is RING else None
        expected, _ = quad(
            lambda y: 2 * float(footprint.flux(np.array(math.hypot(offset, y)))), 0, half, points=kinks, limit=200
        )
    found = footprint.across(np.array([offset, -offset]))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5 / scale)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", Gaussian(0.015)),
        ("[spray]\nspot_mm = 80", Gaussian(0.02)),
        ("[footprint]\nsigma_mm = 9", Gaussian(0.009)),
        ("[footprint]\nmodel = 'parabolic_flux'", ParabolicFlux(0.03)),
        ("[footprint]\nmodel = 'parabolic_pass'\nradius_mm = 25", ParabolicPass(0.025)),
    ],
)
def test_footprint_of_a_setup(text: str, expected: Footprint) -> None:
    found = footprint_of(SpraySetup.model_validate(tomllib.loads(text)))
    assert type(found) is type(expected)
    assert found.reach == pytest.approx(expected.reach, rel=1e-12)


def test_a_profile_is_read(tmp_path: Path) -> None:
    path = tmp_path / "profile.txt"
    path.write_text("# radius flux\r\n0 2\n\n 10\t5 # peak\n18 1\n30 1\n")
    found = read_profile(path)
    np.testing.assert_allclose(found.radii, RING.radii, rtol=1e-15)
    np.testing.assert_allclose(found.fluxes, RING.fluxes, rtol=1e-12)
    setup = SpraySetup.model_validate({"footprint": {"model": "profile", "profile": str(path)}})
    assert footprint_of(setup).reach == 0.03


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1\n5 x\n", "{}:2: expected a radius in mm and a flux, two finite numbers, got '5 x'"),
        ("0 1\n5\n", "{}:2: expected a radius in mm and a flux, two finite numbers, got '5'"),
        ("0 1\n1_0 1\n", "{}:2: expected a radius in mm and a flux, two finite numbers, got '1_0 1'"),
        ("0 1\nnan 1\n", "{}:2: expected a radius in mm and a flux, two finite numbers, got 'nan 1'"),
        ("0 1\n5 inf\n", "{}:2: expected a radius in mm and a flux, two finite numbers, got '5 inf'"),
        (
            f"0 1\n{'7' * 50}\n",
            "{}:2: expected a radius in mm and a flux, two finite numbers, got '" + "7" * 37 + "...'",
        ),
        (
            "1 1\n5 -1\n5 2\n",
            "{0}:1: expected radius 0 first, got 1 mm; begin on the gun's axis\n"
            "{0}:2: expected a flux of 0 or more, got -1\n"
            "{0}:3: expected a radius above 5 mm, got 5 mm",
        ),
        ("0 1\n", "{}: expected two pairs of radius and flux or more, got 1"),
        ("0 0\n5 0\n", "{}: expected a flux above 0 somewhere, got none"),
    ],
)
def test_a_profile_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "profile.txt"
    path.write_text(text)
    with pytest.raises(FootprintRefused) as refused:
        read_profile(path)
    assert str(refused.value) == message.format(path)


def test_a_profile_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(FootprintRefused, match="cannot be read: no such file or directory"):
        read_profile(tmp_path / "none.txt")
    path = tmp_path / "binary.txt"
    path.write_bytes(b"0 1\n\xff\xfe")
    with pytest.raises(FootprintRefused, match="byte 4 is not UTF-8"):
        read_profile(path)
