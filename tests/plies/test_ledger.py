"""Areas on surfaces with closed forms, and what tapes leave of a ply."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from tapelayer.arrays import Floats
from tapelayer.geometry.height_field import HeightField
from tapelayer.plies.ledger import ledger_of, surface_area


class Plane(HeightField):
    """A plane that rises by 3 m on 4 m along x."""

    def derivatives(self, plan: Floats) -> Floats:
        table = np.zeros((6, len(plan)))
        table[0], table[1] = 0.75 * plan[:, 0], 0.75
        return table


class Sphere(HeightField):
    """The top of a sphere of 2 m."""

    def derivatives(self, plan: Floats) -> Floats:
        x, y = plan.T
        z = np.sqrt(4.0 - x**2 - y**2)
        return np.array([z, -x / z, -y / z, -1 / z - x**2 / z**3, -x * y / z**3, -1 / z - y**2 / z**3])


@pytest.mark.parametrize("size", [0.004, 0.025, 0.3, 1.7])
def test_area_on_a_plane(size: float) -> None:
    triangle = shapely.Polygon([(0.1, -0.2), (0.1 + size, -0.2), (0.1, -0.2 + size)])
    assert surface_area(Plane(), [triangle]) == pytest.approx(1.25 * size**2 / 2, rel=1e-9)
    assert surface_area(Plane(), [triangle, triangle]) == pytest.approx(1.25 * size**2, rel=1e-9)


def test_area_of_a_cap() -> None:
    cap = shapely.Point(0.0, 0.0).buffer(1.0, quad_segs=200)
    assert surface_area(Sphere(), [cap]) == pytest.approx(2 * math.pi * 2.0 * (2.0 - math.sqrt(3.0)), rel=5e-5)


def test_nothing_has_no_area() -> None:
    assert surface_area(Plane(), []) == surface_area(Plane(), [shapely.Polygon()]) == 0.0


def test_two_tapes_on_a_ply_with_a_hole() -> None:
    ply = shapely.box(0.0, 0.0, 0.4, 0.4).difference(shapely.box(0.1, 0.1, 0.2, 0.2))
    # One tape to the left, 20 mm beyond the ply, one to the right; 10 mm lie under both, and 50 mm stay open.
    tapes = [shapely.box(-0.02, 0.0, 0.2, 0.4), shapely.box(0.19, 0.0, 0.35, 0.4)]
    ledger = ledger_of(Plane(), ply, tapes)
    assert ledger.ply == pytest.approx(1.25 * 0.15)
    assert ledger.tape == pytest.approx(1.25 * 0.4 * (0.22 + 0.16))
    assert ledger.gap == pytest.approx(1.25 * 0.05 * 0.4)
    assert ledger.overlap == pytest.approx(1.25 * 0.01 * 0.4)
    assert ledger.overhang == pytest.approx(1.25 * (0.02 * 0.4 + 0.01))
    assert ledger.coverage == pytest.approx(1 - 0.02 / 0.15)
    assert ledger.overhang_share == pytest.approx(0.018 / 0.15)
    assert len(ledger.tapes) == 2 and len(ledger.overlaps) == 1
