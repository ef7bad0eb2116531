"""What of polygons lies in cells is what shapely cuts out of them, cell by cell."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.geometry.plan_cells import cells_within

LOWER, SIZE = np.array([-3.0, -2.0]), 0.7


def star(radii: list[float], middle: tuple[float, float] = (0.0, 0.0)) -> shapely.Polygon:
    turns = np.linspace(0.0, 2.0 * math.pi, len(radii), endpoint=False)
    return shapely.Polygon(np.column_stack([np.cos(turns), np.sin(turns)]) * np.array(radii)[:, None] + middle)


def cut_out(polygon: shapely.Polygon) -> list[tuple[float, ...]]:
    """Area and centroid of what lies in each cell."""
    found = []
    left, bottom, right, top = polygon.bounds
    for i in range(math.floor((left - LOWER[0]) / SIZE), math.ceil((right - LOWER[0]) / SIZE) + 1):
        for j in range(math.floor((bottom - LOWER[1]) / SIZE), math.ceil((top - LOWER[1]) / SIZE) + 1):
            x, y = LOWER + SIZE * np.array([i, j])
            piece = polygon.intersection(shapely.box(x, y, x + SIZE, y + SIZE))
            if piece.area > 1e-9:
                found.append((piece.area, piece.centroid.x, piece.centroid.y))
    return sorted(found, key=lambda one: one[1:])


def rows_of(areas: Floats, centroids: Floats) -> list[tuple[float, ...]]:
    rows = np.column_stack([areas, centroids])
    return sorted(map(tuple, rows[areas > 1e-9].tolist()), key=lambda one: one[1:])


@given(
    st.lists(st.floats(0.3, 1.9), min_size=3, max_size=12),
    st.lists(st.floats(0.02, 0.1), min_size=3, max_size=6),
    st.sampled_from([0.0, 0.35, 0.7, 0.123]),
)
def test_each_cell_holds_what_is_cut_out_of_it(radii: list[float], hole: list[float], across: float) -> None:
    polygon = star(radii, (across, 0.1)).difference(star(hole, (across, 0.1)))
    for one in shapely.get_parts(polygon):
        for turned in (one, shapely.reverse(one)):
            areas, centroids = cells_within(np.array([turned]), LOWER, SIZE)
            found, expected = np.array(rows_of(areas, centroids)), np.array(cut_out(one))
            assert areas.sum() == pytest.approx(one.area, rel=1e-12)
            assert found.shape == expected.shape
            # The order may differ where centroids are the same to rounding.
            gaps = np.abs(found[:, None] - expected[None])
            assert np.max(np.min(np.max(gaps, axis=2), axis=1)) < 1e-6


@pytest.mark.parametrize("size", [(0.7, 0.7), (2.1, 1.4), (0.35, 3.5), (2.8, 0.07)])
def test_edges_on_the_lines_of_the_grid(size: tuple[float, float]) -> None:
    box = shapely.box(*LOWER, *(LOWER + size))
    areas, centroids = cells_within(np.array([box]), LOWER, SIZE)
    across, up = (math.ceil(round(length / SIZE, 9)) for length in size)
    assert len(areas) == across * up
    assert areas == pytest.approx(np.full(across * up, size[0] * size[1] / across / up))
    assert areas @ centroids / areas.sum() == pytest.approx(LOWER + np.array(size) / 2)


def test_what_polygons_share_counts_for_each() -> None:
    box = shapely.box(0.1, 0.1, 2.3, 1.9)
    one, two = (cells_within(np.array([box] * count), LOWER, SIZE)[0] for count in (1, 2))
    assert len(two) == 2 * len(one) and two.sum() == pytest.approx(2 * box.area)
