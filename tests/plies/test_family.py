import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.geodesics import aimed
from tapelayer.plies.family import Family, GapLimits, family_of
from tapelayer.plies.reach import Reach
from tapelayer.units import MM
from tests.helpers.height_fields import Cone, Cylinder, Polynomial, Sphere, fitted, plane, saddle

PLY = shapely.box(-0.5, -0.75, 0.5, 0.75)
CLOSED = GapLimits(0.0, 0.0, 2.0 * MM)


def family_on(field, degrees=20.0, width=0.075, limits=CLOSED, ply=PLY, step=0.01, at=(0.0, 0.0)) -> Family:
    angle = math.radians(degrees)
    seed = aimed(field, np.array([at]), np.array([[-math.sin(angle), math.cos(angle)]]))[0]
    return family_of(field, ply, seed, Reach.around(ply, 2 * width), limits, width, step)


def widths(family):
    return np.concatenate([gap.widths[gap.known] for gap in family.gaps])


@pytest.mark.parametrize(("width", "largest"), [(0.075, 0.995), (0.150, 1.990), (0.300, 3.93)])
def test_gaps_on_a_sphere(width, largest):
    gaps = widths(family_on(Sphere(5.0), width=width)) / MM
    assert gaps.min() > -1e-4
    assert gaps.max() == pytest.approx(largest, abs=0.01)


@pytest.mark.parametrize(("width", "largest"), [(0.075, 0.995), (0.150, 1.990)])
def test_gaps_on_a_sphere_known_by_its_facets(width, largest):
    gaps = widths(family_on(fitted(Sphere(5.0), half=1.0), width=width)) / MM
    assert gaps.min() > -1e-4
    assert gaps.max() == pytest.approx(largest, abs=0.01)


@pytest.mark.parametrize(("width", "largest"), [(0.075, 1.5), (0.150, 3.0), (0.300, 6.0)])
def test_gaps_on_a_saddle(width, largest):
    gaps = widths(family_on(saddle(), width=width)) / MM
    assert gaps.min() > -1e-4
    assert gaps.max() == pytest.approx(largest, rel=0.05)


@pytest.mark.parametrize("field", [plane(0.2, -0.1), Cylinder(), Cone()], ids=lambda field: type(field).__name__)
@pytest.mark.parametrize("degrees", [0.0, 45.0, -45.0, 90.0, 20.0])
def test_a_developable_mould_leaves_the_nominal_gap_everywhere(field, degrees):
    for nominal in (0.0, 0.5 * MM):
        gaps = widths(family_on(field, degrees, limits=GapLimits(0.0, nominal, 2 * MM)))
        np.testing.assert_allclose(gaps, nominal, atol=1e-6)


def test_the_nominal_gap_is_aimed_at_from_both_sides():
    closed = widths(family_on(Sphere(5.0))) / MM
    gaps = widths(family_on(Sphere(5.0), limits=GapLimits(0.0, 0.5 * MM, 2 * MM))) / MM
    assert gaps.min() >= -1e-4
    assert gaps.max() - 0.5 == pytest.approx(closed.max() / 2, abs=0.01)


def test_overlap_is_shared_where_it_is_allowed():
    gaps = widths(family_on(Sphere(5.0), limits=GapLimits(-0.5 * MM, 0.0, 0.5 * MM))) / MM
    assert gaps.min() == pytest.approx(-0.5, abs=0.01) and gaps.max() == pytest.approx(0.5, abs=0.01)


def test_where_no_turn_keeps_the_limits_the_family_goes_on():
    limits = GapLimits(-0.1 * MM, 0.0, 0.1 * MM)
    # Courses over a steep peak come together again beyond it.
    peak = Polynomial([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    gaps = widths(family_on(peak, 0.0, 0.1, limits, shapely.box(-0.15, -0.8, 0.15, 0.8), step=0.005)) / MM
    assert np.abs(gaps).max() > 10.0


@settings(max_examples=12, deadline=None)
@given(st.floats(-90.0, 90.0), st.floats(0.04, 0.2), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_the_ply_is_covered_but_for_its_gaps(degrees, width, x, y):
    family = family_on(saddle(8.0), degrees, width, at=(x, y))
    covered = shapely.union_all([strip.polygon() for strip in family.strips])
    rest = PLY.difference(covered.buffer(widths(family).max() / 2 + 1e-6))
    left_out = float(np.sum(family.left_out)) * 4.0
    assert rest.area <= left_out + 1e-9
    # No strip is beside the ply.
    assert all(strip.polygon().intersects(PLY) for strip in family.strips)


def test_a_sliver_is_left_to_the_gap_and_told():
    # Strips 0.1 m broad about the middle: at 0.05 + 2 x 0.1 the third ends, and the ply goes on for half a millimetre.
    ply = shapely.box(-0.2505, -0.5, 0.2505, 0.5)
    family = family_on(plane(), 0.0, width=0.1, ply=ply, limits=GapLimits(0.0, 0.0, 2 * MM))
    assert len(family.strips) == 5
    np.testing.assert_allclose(family.left_out, 0.5 * MM, atol=1e-6)
    strict = family_on(plane(), 0.0, width=0.1, ply=ply, limits=GapLimits(0.0, 0.0, 0.2 * MM))
    assert len(strict.strips) == 7
    np.testing.assert_allclose(strict.breadths, 0.5 * MM, atol=1e-6)


def test_strips_go_from_right_to_left_and_one_is_through_the_seed():
    family = family_on(Cylinder(), 0.0)
    middles = [strip.states[len(strip.arcs) // 2, 0] for strip in family.strips]
    assert np.all(np.diff(middles) < 0)
    reference = family.strips[family.reference]
    np.testing.assert_allclose(reference.states[np.searchsorted(reference.arcs, 0.0), :2], 0.0, atol=1e-12)


def test_the_family_on_the_mirrored_mould_is_mirrored():
    family, mirrored = family_on(saddle(3.0), 25.0), family_on(saddle(-3.0), -25.0)
    assert len(family.strips) == len(mirrored.strips)
    for strip, other in zip(family.strips, mirrored.strips[::-1], strict=True):
        np.testing.assert_allclose(strip.states * [-1, 1, -1, 1], other.states, atol=1e-8)


def test_the_same_family_from_the_same_input():
    first, second = family_on(saddle(), 10.0), family_on(saddle(), 10.0)
    for strip, other in zip(first.strips, second.strips, strict=True):
        assert replace(strip).states.tobytes() == other.states.tobytes()
