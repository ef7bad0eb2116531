"""Passes."""

from __future__ import annotations

import numpy as np

from tests.helpers.sprayed import planned, roof


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
