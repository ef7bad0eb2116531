"""Steep sides: further planes between the planes."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.spraying.reach import Segments
from tapelayer.spraying.steep_sides import WIDEST, flank_heights, on_steep_sides


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


@given(st.integers(1, 12), st.floats(1e-3, 0.1), st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_further_planes_are_the_odd_sixteenths_and_wider_ones_within_the_surface(
    count: int, pitch: float, first: float, below: float, above: float
) -> None:
    planes = first + pitch * np.arange(count)
    extent = (float(planes[0] - below * pitch), float(planes[-1] + above * pitch))
    heights, widths = flank_heights(planes, pitch, extent)
    assert np.all(np.diff(heights) >= 0) and np.all((heights > extent[0]) & (heights < extent[1]))
    expected = []
    for place in range(-16, 16 * count):
        height = first + pitch * place / 16
        if place % 16 and extent[0] + 1e-9 * pitch < height < extent[1] - 1e-9 * pitch:
            expected.append((height, WIDEST * 8 / math.gcd(place, 8)))
    inside = (heights > extent[0] + 1e-9 * pitch) & (heights < extent[1] - 1e-9 * pitch)
    np.testing.assert_allclose(np.column_stack([heights, widths])[inside], np.reshape(expected, (-1, 2)), atol=1e-9)


def by_hand(joined: list[bool], chosen: list[bool], lengths: list[float], gap: float, short: float) -> list[bool]:
    """Which of the segments remain; `joined` is whether each goes on from the one before it."""
    chosen = list(chosen)
    for value in (False, True):
        before = list(chosen)
        first = 0
        while first < len(before):
            last = first
            while last + 1 < len(before) and joined[last + 1] and before[last + 1] == before[first]:
                last += 1
            length = sum(lengths[first : last + 1])
            if before[first] == value:
                between = joined[first] and last + 1 < len(before) and joined[last + 1]
                if (between and length <= gap) if not value else length <= short:
                    chosen[first : last + 1] = [not value] * (last + 1 - first)
            first = last + 1
    return chosen


@given(st.integers(0, 2**32 - 1), st.integers(1, 30))
@settings(max_examples=100)
def test_chains_of_any_segments_are_those_by_hand(seed: int, count: int) -> None:
    chance = np.random.default_rng(seed)
    planes = np.sort(chance.integers(0, 3, count))
    steps = chance.integers(1, 5, count).astype(float)
    apart = chance.random(count) < 0.2
    ends = np.cumsum(steps + apart)
    level = np.zeros((count, 2))
    segments = Segments(
        np.column_stack([ends - steps, level]),
        np.column_stack([ends, level]),
        np.arange(count),
        planes,
        np.zeros((count, 2), dtype=bool),
    )
    widths, least = chance.choice([1.0, 2.0, 4.0], count), chance.choice([1.5, 3.0], count)
    gap, short = float(chance.integers(0, 6)), float(chance.integers(0, 6))
    found = on_steep_sides(segments, widths, least, gap, short)
    joined = [False, *(((np.diff(planes) == 0) & ~apart[1:]).tolist())]
    chosen = by_hand(joined, (widths > least).tolist(), steps.tolist(), gap, short)
    kept = [row for row in range(count) if chosen[row]]
    assert found.facets.tolist() == kept
    on = [*joined[1:], False]
    assert found.goes_on.tolist() == [
        [joined[row] and not chosen[row - 1], on[row] and not chosen[row + 1] if row + 1 < count else False]
        for row in kept
    ]


def test_nothing_is_left_as_it_is() -> None:
    nothing = Segments(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2), bool))
    assert on_steep_sides(nothing, np.zeros(0), np.zeros(0), 1.0, 1.0) is nothing
