import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.geometry.geodesics import aimed
from tapelayer.plies.cut_lines import CutLine
from tapelayer.plies.pieces import CutRules, Piece, pieces_of
from tapelayer.plies.reach import Reach
from tapelayer.plies.strip import strip_through
from tapelayer.units import MM
from tests.helpers.height_fields import Sphere, plane

WIDTH = 0.075
RULES = CutRules(math.radians(15.0), 100.0 * MM, 100.0 * MM)


def strip_over(ply, degrees=0.0, at=(0.0, 0.0), field=None):
    field, angle = field or plane(), math.radians(degrees)
    state = aimed(field, np.array([at]), np.array([[-math.sin(angle), math.cos(angle)]]))[0]
    return strip_through(field, state, Reach.around(ply, 3 * WIDTH), WIDTH, 0.005)


def pieces(ply, degrees=0.0, at=(0.0, 0.0), rules=RULES, field=None):
    strip = strip_over(ply, degrees, at, field)
    return strip, pieces_of(strip, 0, ply, rules)


def test_square_to_a_rectangle():
    _, (piece,) = pieces(shapely.box(-0.5, -0.75, 0.5, 0.75))
    assert piece.start.offset == pytest.approx(-0.75) and piece.end.offset == pytest.approx(0.75)
    np.testing.assert_allclose(np.degrees(piece.cut_angles), 90.0)
    assert piece.lengthened == 0.0 and piece.laid_through == 0


def test_askew_to_a_rectangle():
    _, (piece,) = pieces(shapely.box(-2.0, -0.5, 2.0, 0.5), degrees=30.0)
    # A border 60 degrees to the left of a travel turned 30 degrees to the left.
    np.testing.assert_allclose(np.degrees(piece.cut_angles), 60.0, atol=1e-6)
    assert piece.length == pytest.approx(1.0 / math.cos(math.radians(30.0)))


def test_a_way_back_swaps_the_angles_and_keeps_them():
    piece = Piece(0, CutLine(0.0, 1.0), CutLine(1.0, 0.0))
    back = Piece(0, CutLine(0.0, 1.0), CutLine(1.0, 0.0), backwards=True)
    np.testing.assert_allclose(np.degrees(piece.cut_angles), [45.0, 90.0])
    np.testing.assert_allclose(np.degrees(back.cut_angles), [90.0, 45.0])


def test_a_hole_parts_a_strip():
    ply = shapely.box(-0.5, -0.75, 0.5, 0.75) - shapely.box(-0.2, -0.1, 0.2, 0.1)
    _, parts = pieces(ply)
    ends = [end for piece in parts for end in (piece.start.offset, piece.end.offset)]
    np.testing.assert_allclose(ends, [-0.75, -0.1, 0.1, 0.75], atol=1e-9)


def test_a_short_hole_is_laid_through():
    ply = shapely.box(-0.5, -0.75, 0.5, 0.75) - shapely.box(-0.2, -0.04, 0.2, 0.04)
    _, (piece,) = pieces(ply)
    assert piece.laid_through == 1
    assert piece.length == pytest.approx(1.5)


def test_parts_beside_each_other_in_a_strip_are_one_course():
    ply = shapely.box(-0.5, -0.75, 0.5, 0.75) - shapely.box(-0.01, -0.8, 0.01, 0.0)
    _, (piece,) = pieces(ply)
    assert piece.start.offset == pytest.approx(-0.75) and piece.end.offset == pytest.approx(0.75)


def test_a_short_course_is_lengthened_at_both_ends_alike():
    _, (piece,) = pieces(shapely.box(-0.5, -0.02, 0.5, 0.04))
    assert piece.length == pytest.approx(100.0 * MM)
    assert piece.lengthened == pytest.approx(20.0 * MM)
    assert piece.start.offset + piece.end.offset == pytest.approx(0.02)


def test_cuts_that_would_cross_are_moved_apart():
    rules = CutRules(math.radians(15.0), 0.0, 0.0)
    ply = shapely.Polygon([(-0.5, -0.5), (0.0375, 0.0), (-0.5, 0.5)])
    _, (piece,) = pieces(ply, rules=rules)
    half = WIDTH / 2
    assert min(piece.end.at(v) - piece.start.at(v) for v in (-half, half)) >= 1.0 * MM - 1e-9


def rounded(corners):
    ring = [
        (r * math.cos(a), r * math.sin(a)) for a, r in zip(np.linspace(0, 2 * math.pi, 9)[:-1], corners, strict=True)
    ]
    return shapely.Polygon(ring)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0.25, 0.6), min_size=8, max_size=8),
    st.floats(-180.0, 180.0),
    st.floats(-0.15, 0.15),
    st.floats(-0.15, 0.15),
)
def test_pieces_cover_the_strips_part_of_any_ply(corners, degrees, x, y):
    ply = rounded(corners)
    strip, parts = pieces(ply, degrees, (x, y), field=Sphere(2.0))
    tapes = [
        strip.polygon((piece.start.offset, piece.start.slope), (piece.end.offset, piece.end.slope)) for piece in parts
    ]
    left = strip.polygon().intersection(ply).difference(shapely.union_all(tapes).buffer(1e-4))
    assert left.area < 1e-7
    for piece in parts:
        assert all(math.radians(15.0) - 1e-9 <= angle <= math.radians(165.0) + 1e-9 for angle in piece.cut_angles)
        assert piece.length >= RULES.least_length - 1e-9
