"""Reach: where a part lies, and what of it can be sprayed, against the definition."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.spraying.reach import placement
from tests.helpers.machines import sprayer
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
