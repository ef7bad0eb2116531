"""Table: all courses of a file as rows, before they become courses."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.vectors import dot, norms

# An arc length may differ from the chord by this share of the chord plus this slack in metres.
CHORD_SHARE = 0.01
CHORD_SLACK = 0.05e-3
# Points at most this far apart, in metres, are at one place: no file states more digits of a part.
SAME_PLACE = 1e-9
# Most characters of a line without its comment; a point takes fewer than 200 however it is printed.
LONGEST_LINE = 1000
# Python's float() also takes underscores and the digits of other scripts; a course file's numbers are plain ASCII.
NUMBER = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True, eq=False)
class CourseTable:
    """All courses of a file in one table.

    Attributes:
        numbers: (m) course numbers.
        cut_angles: (m) pairs, radians.
        counts: (m,) points of each course.
        rows: (n, 7) points in mm, normals of any length, arc lengths in mm.
        readable: (n,) the row has seven finite numbers; the contents of other rows mean nothing.
    """

    numbers: Sequence[int]
    cut_angles: Sequence[tuple[float, float]]
    counts: Ints
    rows: Floats
    readable: Mask

    @property
    def without_normal(self) -> Mask:
        """Rows (n,) whose normal has length zero.

        Examples:
            >>> rows = np.array([[0, 0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0, 1], [10, 0, 0, 0, 0, 1, 30]], dtype=float)
            >>> table = CourseTable([1], [(1.0, 1.0)], np.array([3]), rows, np.ones(3, dtype=bool))
            >>> table.without_normal.tolist()
            [False, True, False]
        """
        zero: Mask = (self.rows[:, 3] == 0.0) & (self.rows[:, 4] == 0.0) & (self.rows[:, 5] == 0.0)
        return zero

    @cached_property
    def normals(self) -> Floats:
        """Unit normals (n, 3); NaN where a row cannot be read or has none."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return unit_normals(self.rows[:, 3:6])


@dataclass(frozen=True, eq=False)
class TableSteps:
    """The steps from each row of a table to the next.

    Attributes:
        inside: (n - 1,) both rows belong to one course and could be read.
        chords: (n - 1,) metres.
        growths: (n - 1,) of the arc length, metres.
    """

    inside: Mask
    chords: Floats
    growths: Floats

    @classmethod
    def of(cls, table: CourseTable) -> TableSteps:
        """Return the steps of a table.

        Examples:
            >>> rows = np.array([[0, 0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0, 1], [10, 0, 0, 0, 0, 1, 30]], dtype=float)
            >>> table = CourseTable([1], [(1.0, 1.0)], np.array([3]), rows, np.ones(3, dtype=bool))
            >>> steps = TableSteps.of(table)
            >>> steps.chords.tolist(), np.round(steps.growths, 6).tolist()
            ([0.0, 0.01], [0.001, 0.029])
        """
        rows = from_mm(table.rows[:, [0, 1, 2, 6]])
        inside = np.ones(max(len(rows) - 1, 0), dtype=np.bool_)
        borders = np.cumsum(table.counts)[:-1] - 1
        inside[borders[(borders >= 0) & (borders < len(inside))]] = False
        inside &= table.readable[:-1] & table.readable[1:]
        with np.errstate(over="ignore", invalid="ignore"):
            steps = np.diff(rows, axis=0)
            chords = norms(steps[:, :3])
        return cls(inside, chords, steps[:, 3])

    @property
    def standing(self) -> Mask:
        """Steps (n - 1,) between two rows at one place.

        Examples:
            >>> TableSteps(np.array([True, True]), np.array([0.0, 0.1]), np.array([0.1, 0.1])).standing.tolist()
            [True, False]
        """
        return self.inside & ~(self.chords > SAME_PLACE)

    @property
    def falling(self) -> Mask:
        """Steps (n - 1,) along which the arc length does not increase.

        Examples:
            >>> TableSteps(np.array([True, True]), np.array([0.1, 0.1]), np.array([0.1, -0.1])).falling.tolist()
            [False, True]
        """
        return self.inside & ~(self.growths > SAME_PLACE)

    @property
    def off(self) -> Mask:
        """Steps (n - 1,) along which the arc length is not that of the chord.

        Examples:
            >>> TableSteps(np.array([True, True]), np.array([0.1, 0.1]), np.array([0.1005, 0.102])).off.tolist()
            [False, True]
        """
        with np.errstate(over="ignore", invalid="ignore"):
            # An infinite chord must not allow every difference.
            allowed = np.minimum(CHORD_SHARE * self.chords + CHORD_SLACK, np.finfo(np.float64).max)
            return self.inside & ~(np.abs(self.growths - self.chords) <= allowed)


def in_mm(rows: Floats, scale: float) -> Floats:
    """Return the rows (n, 7) of a file with their lengths in millimetres.

    Args:
        rows: (n, 7) points and arc lengths in the file's unit, normals of any length.
        scale: millimetres in that unit.

    Examples:
        >>> in_mm(np.array([[1.0, 2.0, 0.0, 0.0, 0.0, 1.0, 5.0]]), 25.4).tolist()
        [[25.4, 50.8, 0.0, 0.0, 0.0, 1.0, 127.0]]
    """
    return rows if scale == 1.0 else rows * np.array([scale, scale, scale, 1.0, 1.0, 1.0, scale])


def from_mm(mm: Floats) -> Floats:
    """Return metres for the millimetres of a file; any shape.

    Examples:
        >>> from_mm(np.array([[75.0, 0.15]])).tolist()
        [[0.075, 0.00015]]
    """
    return mm / 1000.0


def unit_normals(normals: Floats) -> Floats:
    """Return unit normals (n, 3), leaving those that are unit vectors within rounding as they are.

    Examples:
        >>> unit_normals(np.array([[0.0, 0.0, 2.0], [3.0, 0.0, 4.0]])).tolist()
        [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]
    """
    units = np.ascontiguousarray(normals)
    with np.errstate(over="ignore"):
        squares = dot(units, units)
    if np.any(extreme := ~((squares > 1e-200) & (squares < 1e200))):
        units[extreme] /= np.max(np.abs(units[extreme]), axis=1)[:, None]
        squares[extreme] = dot(units[extreme], units[extreme])
    done = np.abs(squares - 1.0) <= 8 * np.finfo(np.float64).eps
    units /= np.where(done, 1.0, np.sqrt(squares))[:, None]
    return units


def cut_angle(word: bytes) -> float:
    """Return an angle in radians; NaN where the word is not an angle between 0 and 180 degrees.

    Examples:
        >>> round(cut_angle(b"45"), 6), cut_angle(b"180")
        (0.785398, nan)
    """
    angle = math.radians(float(word)) if NUMBER.fullmatch(word) else math.nan
    return angle if 0.0 < angle < math.pi else math.nan
