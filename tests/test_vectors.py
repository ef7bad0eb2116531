"""Rows of vectors, and rows that are parts of others."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.vectors import dot, norms, ramp, unit


def test_every_row_has_its_own_product_length_and_direction() -> None:
    vectors = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, -2.0]])
    assert dot(vectors, vectors[::-1]).tolist() == [0.0, 0.0]
    assert norms(vectors).tolist() == [5.0, 2.0]
    assert unit(vectors).tolist() == [[0.6, 0.8, 0.0], [0.0, 0.0, -1.0]]


def test_a_vector_without_length_has_no_direction() -> None:
    with np.errstate(invalid="ignore"):
        assert np.all(np.isnan(unit(np.zeros((2, 3)))))


@pytest.mark.parametrize(
    ("counts", "owners", "numbers"),
    [([2, 0, 3], [0, 0, 2, 2, 2], [0, 1, 0, 1, 2]), ([1, 1], [0, 1], [0, 0]), ([0], [], []), ([], [], [])],
)
def test_a_ramp_numbers_the_parts_of_each_thing(counts: list[int], owners: list[int], numbers: list[int]) -> None:
    assert [column.tolist() for column in ramp(np.array(counts, np.int64))] == [owners, numbers]
