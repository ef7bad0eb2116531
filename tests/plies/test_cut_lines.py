import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.plies.cut_lines import CutLine, cut_pair, end_cut, start_cut

HALF = 0.0375
STEEPEST = 1.0 / math.tan(math.radians(15.0))

points = st.lists(
    st.tuples(st.floats(-2.0, 2.0), st.floats(-HALF, HALF)).map(lambda p: (round(p[0], 6), round(p[1], 6))),
    min_size=1,
    max_size=40,
).map(np.array)


@given(points)
def test_every_point_is_beyond_the_start_cut_and_before_the_end_cut(pairs):
    arcs, across = pairs.T
    start, end = start_cut(arcs, across, STEEPEST), end_cut(arcs, across, STEEPEST)
    assert np.all(arcs - start.offset - start.slope * across >= -1e-12)
    assert np.all(arcs - end.offset - end.slope * across <= 1e-12)
    assert abs(start.slope) <= STEEPEST and abs(end.slope) <= STEEPEST


@given(points)
def test_no_angle_costs_less_tape(pairs):
    arcs, across = pairs.T
    slopes = np.linspace(-STEEPEST, STEEPEST, 2001)
    best = np.max(np.min(arcs - slopes[:, None] * across, axis=1))
    assert start_cut(arcs, across, STEEPEST).offset >= best - 1e-9


@given(points)
def test_the_end_cut_is_the_start_cut_of_the_way_back(pairs):
    arcs, across = pairs.T
    # Seen from the other end left is right, too.
    start, end = start_cut(-arcs, -across, STEEPEST), end_cut(arcs, across, STEEPEST)
    assert -start.offset == pytest.approx(end.offset, abs=1e-12)
    assert start.slope == pytest.approx(end.slope, abs=1e-9)


@pytest.mark.parametrize("degrees", [15.0, 30.0, 45.0, 90.0, 135.0, 165.0])
def test_a_straight_boundary_is_cut_along(degrees):
    across = np.linspace(-HALF, HALF, 26)
    slope = 1.0 / math.tan(math.radians(degrees))
    line = start_cut(0.3 + slope * across, across, STEEPEST)
    assert math.degrees(line.angle) == pytest.approx(degrees, abs=1e-9)
    assert line.offset == pytest.approx(0.3, abs=1e-12)


def test_a_boundary_flatter_than_the_head_cuts_is_cut_as_flat_as_it_can():
    across = np.linspace(-HALF, HALF, 26)
    assert start_cut(9.0 * across, across, STEEPEST).slope == pytest.approx(STEEPEST)
    assert end_cut(-9.0 * across, across, STEEPEST).slope == pytest.approx(-STEEPEST)


def test_of_equal_costs_the_squarest_cut_is_taken():
    # A point on the centre line: every line through it costs the same.
    assert start_cut(np.array([0.5]), np.zeros(1), STEEPEST) == CutLine(0.5, 0.0)


@given(points)
def test_no_pair_of_angles_costs_less_tape(pairs):
    arcs, across = pairs.T
    start, end, added = cut_pair(arcs, across, STEEPEST, 2 * HALF, 0.1, 0.001)
    assert np.all(arcs - start.offset - start.slope * across >= -1e-12)
    assert np.all(arcs - end.offset - end.slope * across <= 1e-12)
    length = end.offset - start.offset
    assert added >= 0.0 and length >= 0.1 - 1e-12
    assert min(end.at(v) - start.at(v) for v in (-HALF, HALF)) >= 0.001 - 1e-12
    slopes = np.linspace(-STEEPEST, STEEPEST, 121)
    starts = np.min(arcs - slopes[:, None] * across, axis=1)
    ends = np.max(arcs - slopes[:, None] * across, axis=1)
    edges = np.abs(slopes - slopes[:, None]) * HALF + 0.001
    assert length <= np.min(np.maximum(ends - starts[:, None], np.maximum(edges, 0.1))) + 1e-5
