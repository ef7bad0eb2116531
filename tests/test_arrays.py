"""Arrays of samples that nobody changes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tapelayer.arrays import Floats, Frozen, Ints, SampleTable


@dataclass(frozen=True, eq=False)
class Way(Frozen):
    """A way with a name."""

    name: str
    points: Floats
    facets: Ints | None = None


@dataclass(frozen=True, eq=False)
class Table(SampleTable):
    """Two columns."""

    EMPTY = {"points": np.zeros((0, 3))}

    times: Floats
    points: Floats


def test_the_arrays_of_a_frozen_class_are_read_only_and_the_caller_s_are_not() -> None:
    points = np.zeros((2, 3))
    way = Way("way", points)
    points[0] = 1.0
    assert (way.name, way.facets, way.points[0, 0]) == ("way", None, 1.0)
    for frozen in (way, replace(way, facets=np.zeros(2, np.int64))):
        with pytest.raises(ValueError, match="read-only"):
            frozen.points[0] = 2.0
    assert not replace(way, facets=np.zeros(2, np.int64)).facets.flags.writeable


def test_tables_are_joined_row_by_row() -> None:
    one, two = Table(np.zeros(2), np.zeros((2, 3))), Table(np.ones(1), np.ones((1, 3)))
    joined = Table.joined([one, two])
    assert joined.times.tolist() == [0.0, 0.0, 1.0] and joined.points.shape == (3, 3)
    assert not joined.times.flags.writeable
    assert [column.shape for column in (Table.joined([]).times, Table.joined([]).points)] == [(0,), (0, 3)]
