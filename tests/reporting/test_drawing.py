"""Plots are thinned without losing what they show."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tapelayer.arrays import Floats
from tapelayer.reporting import drawing

rows = arrays.arrays(np.float64, st.integers(1, 80), elements=st.floats(-1e3, 1e3) | st.just(np.nan) | st.just(np.inf))


@given(rows, st.data(), st.integers(1, 12))
def test_thinning_keeps_what_each_column_shows(y: Floats, data: st.DataObject, columns: int) -> None:
    steps = data.draw(arrays.arrays(np.float64, len(y), elements=st.floats(0, 5)))
    x = np.cumsum(steps)
    kept = drawing.extremes(x, y, columns)
    assert np.all(np.diff(kept) > 0) and kept[0] == 0 and kept[-1] == len(y) - 1
    edges = np.linspace(x[0], x[-1], columns + 1)
    column = np.clip(np.searchsorted(edges[1:-1], x, side="right"), 0, columns - 1)
    per_column = np.bincount(column[kept], minlength=columns)
    # Rounding may put a row that lies on an edge into the column beside it.
    on_edge = np.min(np.abs(x[:, None] - edges), axis=1) < 1e-9 * max(1.0, float(x[-1]))
    for i in range(columns):
        of_column = column == i
        if np.any(on_edge & of_column):
            continue
        assert per_column[i] <= 5
        inner, kept_inner = y[of_column], y[np.intersect1d(np.flatnonzero(of_column), kept)]
        finite, kept_finite = inner[np.isfinite(inner)], kept_inner[np.isfinite(kept_inner)]
        assert np.any(~np.isfinite(inner)) == np.any(~np.isfinite(kept_inner))
        assert len(finite) == 0 or (np.min(finite), np.max(finite)) == (np.min(kept_finite), np.max(kept_finite))


@given(st.integers(0, 99_999), st.integers(1, 5000))
def test_a_single_spike_survives_thinning(row: int, columns: int) -> None:
    y = np.zeros(100_000)
    y[row] = 1.0
    kept = drawing.extremes(np.arange(100_000.0), y, columns)
    assert row in kept
    assert len(kept) <= 5 * columns


def test_nothing_to_thin() -> None:
    assert len(drawing.extremes(np.zeros(0), np.zeros(0), 10)) == 0
    assert list(drawing.extremes(np.ones(3), np.array([1.0, 2.0, 1.5]), 10)) == [0, 1, 2]
