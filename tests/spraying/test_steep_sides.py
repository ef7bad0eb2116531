"""Steep sides: further planes between the planes."""

from __future__ import annotations

import numpy as np

from tapelayer.spraying.reach import Segments
from tapelayer.spraying.steep_sides import flank_heights, on_steep_sides


def test_heights_of_further_planes_halve_the_distance() -> None:
    heights, widths = flank_heights(np.array([10.0, 12.0]), 2.0, (9.0, 13.0))
    np.testing.assert_allclose(heights[widths == 1.5], [11.0], atol=1e-12)
    np.testing.assert_allclose(heights[widths == 3.0], [9.5, 10.5, 11.5, 12.5], atol=1e-12)
    everything = np.sort(np.concatenate([heights, [10.0, 12.0]]))
    np.testing.assert_allclose(np.diff(everything), 0.125, atol=1e-12)


def test_a_chain_on_a_flank_passes_over_short_stretches_and_says_where_the_section_goes_on() -> None:
    x = np.array([0.0, 10, 40, 45, 70, 72, 100, 101, 200]) / 1e3
    points = np.column_stack([x, 0 * x, 0 * x])
    count = len(x) - 1
    segments = Segments(points[:-1], points[1:], np.arange(count), np.zeros(count, int), np.zeros((count, 2), bool))
    widths = np.array([1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 1.0])
    found = on_steep_sides(segments, widths, np.full(count, 1.5), 0.006, 0.025)
    assert found.facets.tolist() == [1, 2, 3, 4, 5]
    assert found.goes_on.tolist() == [[True, False], [False, False], [False, False], [False, False], [False, True]]
    # 5 mm are too long to pass over, and chains of 30 mm and 55 mm remain.
    assert on_steep_sides(segments, widths, np.full(count, 1.5), 0.004, 0.025).facets.tolist() == [1, 3, 4, 5]
    assert on_steep_sides(segments, widths, np.full(count, 1.5), 0.004, 0.035).facets.tolist() == [3, 4, 5]
    assert len(on_steep_sides(segments, widths, np.full(count, 3.0), 0.1, 0.01).facets) == 0
    edges = on_steep_sides(segments, np.full(count, 2.0), np.full(count, 1.5), 0.1, 0.01)
    assert len(edges.facets) == count and not np.any(edges.goes_on)
