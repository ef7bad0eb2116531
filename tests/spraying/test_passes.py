"""Passes."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_forwards_again_is_the_pass_to_the_last_bit_of_its_points() -> None:
    for found in planned(roof(50))[0].passes:
        again = found.reversed().reversed()
        np.testing.assert_array_equal(again.path.points, found.path.points)
        np.testing.assert_array_equal(again.path.normals, found.path.normals)
        np.testing.assert_allclose(again.path.arc_lengths, found.path.arc_lengths, atol=1e-15)
        np.testing.assert_array_equal(again.leans, found.leans)
        np.testing.assert_allclose(again.exempt, found.exempt, atol=1e-15)
        assert (again.layer, again.plane, again.curve) == (found.layer, found.plane, found.curve)
        assert found.reversed().path.arc_lengths[0] == 0.0
        for name in ("leans", "facets", "bounds", "exempt"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(found, name)[0] = 0
