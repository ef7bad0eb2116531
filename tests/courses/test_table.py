"""Tables of course files: normals, angles and steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tapelayer.courses import table
from tapelayer.courses.table import CourseTable, TableSteps
from tests.helpers.course_files import NUMBERS


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(any), min_size=1))
def test_normals_are_made_unit_once(vectors: list[tuple[float, float, float]]) -> None:
    normals = np.array(vectors)
    units = table.unit_normals(normals)
    assert np.all(np.abs(np.linalg.norm(units, axis=1) - 1.0) <= 1e-15)
    assert np.array_equal(np.sign(units) * (units != 0), np.sign(normals) * (units != 0))
    assert table.unit_normals(units).tobytes() == units.tobytes()


@pytest.mark.parametrize(
    ("word", "degrees"),
    [
        (b"90", 90.0),
        (b"+45.5", 45.5),
        (b".5", 0.5),
        (b"1.5e2", 150.0),
        (b"179.999999", 179.999999),
        (b"1e-300", 1e-300),
    ],
)
def test_an_angle_is_read_in_degrees(word: bytes, degrees: float) -> None:
    assert table.cut_angle(word) == math.radians(degrees)


@pytest.mark.parametrize(
    "word", [b"0", b"-0", b"180", b"-45", b"nan", b"inf", b"1_0", b"0x1", b"", b"90,0", "९०".encode()]
)
def test_what_is_no_angle_between_0_and_180_is_nan(word: bytes) -> None:
    assert math.isnan(table.cut_angle(word))


def table_of(*courses: list[tuple[float, float, float]], growths: Sequence[float] = ()) -> CourseTable:
    """A table of courses of points in mm whose arc lengths are those of the chords, times the growths."""
    rows = []
    for course in courses:
        points = np.array(course)
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        lengths = np.append(0.0, np.cumsum(chords * (growths or np.ones(len(chords)))))
        rows.append(np.column_stack([points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), lengths]))
    counts = np.array([len(course) for course in courses])
    angles = [(1.0, 1.0)] * len(courses)
    return CourseTable(
        range(1, len(courses) + 1), angles, counts, np.vstack(rows), np.ones(counts.sum(), dtype=np.bool_)
    )


def test_steps_do_not_lead_from_course_to_course() -> None:
    steps = TableSteps.of(table_of([(0, 0, 0), (3, 4, 0)], [(0, 0, 0), (0, 0, 10), (0, 12, 15)]))
    assert steps.inside.tolist() == [True, False, True, True]
    np.testing.assert_allclose(steps.chords[steps.inside], [0.005, 0.010, 0.013], rtol=1e-12)
    np.testing.assert_allclose(steps.growths[steps.inside], [0.005, 0.010, 0.013], rtol=1e-12)
    assert not np.any(steps.standing | steps.falling | steps.off)


def test_a_row_that_could_not_be_read_has_no_steps() -> None:
    whole = table_of([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
    readable = np.array([True, False, True, True])
    assert TableSteps.of(replace(whole, readable=readable)).inside.tolist() == [False, False, True]


@given(st.floats(0.1, 1000.0), st.floats(0.9, 1.1))
def test_an_arc_length_may_differ_from_its_chord_by_a_share_and_a_slack(chord: float, growth: float) -> None:
    steps = TableSteps.of(table_of([(0, 0, 0), (chord, 0, 0)], growths=[growth]))
    difference, allowed = abs(growth - 1.0) * chord, 0.01 * chord + 0.05
    assume(abs(difference - allowed) > 1e-9)
    assert bool(steps.off[0]) == (difference > allowed)


@pytest.mark.parametrize("growth", [0.0, -1.0, -1e-9])
def test_an_arc_length_that_stands_or_falls_is_named(growth: float) -> None:
    steps = TableSteps.of(table_of([(0, 0, 0), (1, 0, 0)], growths=[growth]))
    assert steps.falling.tolist() == [True] and steps.standing.tolist() == [False]


def test_rows_at_one_place_stand() -> None:
    steps = TableSteps.of(table_of([(1, 2, 3), (1, 2, 3), (1, 2, 4)]))
    assert steps.standing.tolist() == [True, False]


@pytest.mark.parametrize("far", [1e308, np.inf, np.nan])
def test_chords_beyond_all_doubles_are_off(far: float) -> None:
    rows = table_of([(0, 0, 0), (1, 0, 0)]).rows.copy()
    rows[1, [0, 6]] = far, 1.0
    assert TableSteps.of(replace(table_of([(0, 0, 0), (1, 0, 0)]), rows=rows)).off.tolist() == [True]


def test_a_normal_of_signed_zeros_is_none() -> None:
    rows = table_of([(0, 0, 0), (1, 0, 0), (2, 0, 0)]).rows.copy()
    rows[1, 3:6], rows[2, 3:6] = [-0.0, 0.0, -0.0], [0.0, 5e-324, 0.0]
    assert replace(table_of([(0, 0, 0), (1, 0, 0), (2, 0, 0)]), rows=rows).without_normal.tolist() == [
        False,
        True,
        False,
    ]


def test_points_closer_than_any_file_states_are_at_one_place() -> None:
    """Curves through such points would divide by nothing."""
    rows = np.array([[0, 0, 0, 0, 0, 1, 0], [1e-7, 0, 0, 0, 0, 1, 1e-7], [1e-5, 0, 0, 0, 0, 1, 1e-5]], dtype=float)
    steps = TableSteps.of(CourseTable([1], [(1.0, 1.0)], np.array([3]), rows, np.ones(3, dtype=bool)))
    assert steps.standing.tolist() == steps.falling.tolist() == [True, False]
