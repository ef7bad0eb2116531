"""Columns: placements of many samples at once, entry by entry, so that constant entries cost nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tapelayer.arrays import Floats

# One number for all rows, or (n,) one for each.
Entry = float | Floats

# rpy angles such as pi/2 leave rounding of a few 1e-16 in entries of 0 and 1; folding needs the exact values.
_ROUNDING = 1e-15


class Columns(NamedTuple):
    """Poses as separate entries, constants as floats; entries may share one array, so do not write to them.

    Attributes:
        rotation: rows of the rotation matrix; its columns are the frame's x, y, z in root axes.
        translation: origin of the frame in root axes, metres.
    """

    rotation: tuple[tuple[Entry, Entry, Entry], ...]
    translation: tuple[Entry, ...]


def snapped(values: Floats) -> list[float]:
    """Return the entries of values of any shape, row by row, rounded where they are close to an integer."""
    entries: list[float] = values.ravel().tolist()
    return [float(round(entry)) if abs(entry - round(entry)) <= _ROUNDING else entry for entry in entries]


def constant(rotation: Floats, translation: Floats) -> Columns:
    """Return a placement that is the same for all samples: a rotation (3, 3) and a translation (3,) in metres."""
    rows = rows_of(snapped(rotation))
    return Columns(UNTURNED if rows == UNTURNED else rows, tuple(snapped(translation)))


def rows_of(entries: Sequence[Entry]) -> tuple[tuple[Entry, Entry, Entry], ...]:
    """Return the rows of a rotation matrix from its nine entries."""
    return tuple((entries[i], entries[i + 1], entries[i + 2]) for i in (0, 3, 6))


# The identity is always this very object, so that `is` recognises it.
UNTURNED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
STILL = Columns(UNTURNED, (0.0, 0.0, 0.0))


def cosine_and_sine(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosines and sines of angles of any shape in radians, within 4e-16.

    Both come from one tangent, the function that NumPy vectorises best.

    Examples:
        >>> cosines, sines = cosine_and_sine(np.radians([0.0, 60.0, 90.0]))
        >>> np.round(cosines, 6).tolist(), np.round(sines, 6).tolist()
        ([1.0, 0.5, 0.0], [0.0, 0.866025, 1.0])
    """
    half = np.tan(0.5 * angles)
    share = 2.0 / (1.0 + half * half)
    return share - 1.0, half * share


def compose(parent: Columns, child: Columns) -> Columns:
    """Return the placement of a child that stands in its parent."""
    # Unrolled over entries, not samples, so that zeros and ones fold away before any array is touched.
    if parent.rotation is UNTURNED:
        return Columns(child.rotation, tuple(map(add, parent.translation, child.translation)))
    moved = tuple(
        add(start, _dot(row, child.translation)) for start, row in zip(parent.translation, parent.rotation, strict=True)
    )
    if child.rotation is UNTURNED:
        return Columns(parent.rotation, moved)
    columns = tuple(zip(*child.rotation, strict=True))
    turned = tuple((_dot(row, columns[0]), _dot(row, columns[1]), _dot(row, columns[2])) for row in parent.rotation)
    return Columns(turned, moved)


def _dot(row: Sequence[Entry], column: Sequence[Entry]) -> Entry:
    return add(add(product(row[0], column[0]), product(row[1], column[1])), product(row[2], column[2]))


def product(a: Entry, b: Entry) -> Entry:
    """Return the product of two entries; constants 0 and 1 cost nothing."""
    if isinstance(b, float):
        a, b = b, a
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    return a * b


def add(a: Entry, b: Entry) -> Entry:
    """Return the sum of two entries; a constant 0 costs nothing."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def fill(poses: Floats, columns: Columns) -> None:
    """Write entries into (n, 4, 4) zeros."""
    poses[:, 3, 3] = 1.0
    for i in range(3):
        for j, entry in enumerate((*columns.rotation[i], columns.translation[i])):
            if not (isinstance(entry, float) and entry == 0.0):
                poses[:, i, j] = entry
