from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.trajectory import Kind, Trajectory

PLANES = {0: ("x", "y"), 1: ("z", "x"), 2: ("y", "z")}


def arc(
    plane: int, kind: Kind, centre: tuple[float, float], radius: float, begin: float, sweep: float, **others: Any
) -> Trajectory:
    """One circular block, by its circle in the plane; the other axes go from 0 to 1."""
    axes = ("u", "z", "y", "x")
    signed = sweep if kind == Kind.COUNTERCLOCKWISE else -sweep
    start, end = np.zeros(4), np.ones(4)
    for axis, wave, place in zip(PLANES[plane], (np.cos, np.sin), centre, strict=True):
        start[axes.index(axis)] = place + radius * wave(begin)
        end[axes.index(axis)] = place + radius * wave(begin + signed)
    centres = np.full((1, 3), np.nan)
    centres[0, ["xyz".index(axis) for axis in PLANES[plane]]] = centre
    return Trajectory(
        axes,
        start,
        end[None],
        np.array([kind], dtype=np.uint8),
        np.ones(1),
        np.zeros(1, dtype=np.uint8),
        np.zeros(1, dtype=np.int32),
        np.zeros(1, dtype=np.uint16),
        np.zeros(1, dtype=np.int32),
        centres,
        np.array([plane], dtype=np.uint8),
    )


@given(
    st.sampled_from([0, 1, 2]),
    st.sampled_from([Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE]),
    st.floats(1e-2, 5),
    st.floats(-np.pi, np.pi),
    st.floats(0.01, 2 * np.pi - 0.01),
)
def test_circular_blocks_turn_about_their_centre(
    plane: int, kind: Kind, radius: float, begin: float, sweep: float
) -> None:
    path = arc(plane, kind, (0.3, -0.7), radius, begin, sweep)
    fractions = np.linspace(0, 1, 9)
    values = path.within(np.zeros(9, dtype=np.int64), fractions)
    signed = sweep if kind == Kind.COUNTERCLOCKWISE else -sweep
    for axis, wave, place in zip(PLANES[plane], (np.cos, np.sin), (0.3, -0.7), strict=True):
        expected = place + radius * wave(begin + signed * fractions)
        assert values[:, path.column(axis)] == pytest.approx(expected, abs=1e-12)
    (third,) = {"x", "y", "z"} - set(PLANES[plane])
    assert values[:, path.column(third)].tolist() == fractions.tolist()
    assert values[:, path.column("u")].tolist() == fractions.tolist()
    assert (values[0] == path.start).all() and (values[-1] == path.positions[0]).all()


@pytest.mark.parametrize(
    ("plane", "kind", "quarter"),
    [
        (0, Kind.COUNTERCLOCKWISE, {"x": 0.0, "y": 1.0}),
        (0, Kind.CLOCKWISE, {"x": 0.0, "y": -1.0}),
        (1, Kind.COUNTERCLOCKWISE, {"z": 0.0, "x": 1.0}),
        (1, Kind.CLOCKWISE, {"z": 0.0, "x": -1.0}),
        (2, Kind.COUNTERCLOCKWISE, {"y": 0.0, "z": 1.0}),
        (2, Kind.CLOCKWISE, {"y": 0.0, "z": -1.0}),
    ],
)
def test_turning_sense_in_each_plane(plane: int, kind: Kind, quarter: dict[str, float]) -> None:
    path = arc(plane, kind, (0.0, 0.0), 1.0, 0.0, np.pi)
    middle = path.within(np.array([0]), np.array([0.5]))[0]
    assert {axis: round(float(middle[path.column(axis)]), 12) + 0.0 for axis in quarter} == quarter


def test_a_circle_that_ends_where_it_begins_is_a_full_turn() -> None:
    path = arc(0, Kind.CLOCKWISE, (0.0, 0.0), 1.0, 0.0, 0.0)
    assert path.arcs(np.array([0])).sweeps == pytest.approx([-2 * np.pi])


def test_straight_blocks_beside_circular_ones_stay_straight() -> None:
    one = arc(0, Kind.COUNTERCLOCKWISE, (0.0, 0.0), 1.0, 0.0, np.pi / 2)
    path = Trajectory(
        one.axes,
        one.start,
        np.vstack([one.positions, [[0, 0, 2, 2]]]),
        np.array([Kind.COUNTERCLOCKWISE, Kind.LINEAR], dtype=np.uint8),
        *(np.repeat(rows, 2) for rows in (one.durations, one.events, one.courses, one.stated, one.lines)),
        np.vstack([one.centres, np.full((1, 3), np.nan)]),
        np.zeros(2, dtype=np.uint8),
    )
    values = path.within(np.array([1, 0, 1]), np.array([0.5, 1.0, 0.0]))
    assert values[0].tolist() == [0.5, 0.5, 1.5, pytest.approx(1.0)]
    assert (values[1] == one.positions[0]).all() and (values[2] == one.positions[0]).all()


def test_circular_blocks_need_centres_of_the_same_length() -> None:
    one = arc(0, Kind.CLOCKWISE, (0.0, 0.0), 1.0, 0.0, 1.0)
    rows = (
        one.axes,
        one.start,
        one.positions,
        one.kinds,
        one.durations,
        one.events,
        one.courses,
        one.stated,
        one.lines,
    )
    with pytest.raises(ValueError, match="needs their centres and planes"):
        Trajectory(*rows).within(np.array([0]), np.array([0.5]))
    with pytest.raises(ValueError, match="centres has 2 rows, positions 1"):
        Trajectory(*rows, np.zeros((2, 3)), one.planes)
