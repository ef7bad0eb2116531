"""Columns: the rounded numbers of each axis for every block, and where they are written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from post.controllers.table import AxisWord
from post.words import rounded
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import NotWritable
from tapelayer.motion.trajectory import MOTIONS, Kind, Trajectory

# Blocks rounded at once, so that they stay in the cache.
CHUNK = 1 << 14


@dataclass(frozen=True, eq=False)
class Column:
    """An axis's words.

    Attributes:
        axis: the axis word.
        joint: the joint behind it.
        numbers: (n + 1,) number at the start and after each block, in units of the last decimal; while the axis is
            unknown, its first known number.
        written: (n,) blocks in which the word is written.
    """

    axis: AxisWord
    joint: str
    numbers: Ints
    written: Mask

    def steps(self, blocks: Ints) -> Floats:
        """Return the change (m,) within blocks (m,), in written units."""
        return (self.numbers[blocks + 1] - self.numbers[blocks]) / 10.0**self.axis.decimals

    @cached_property
    def moved(self) -> Mask:
        """Blocks (n,) in which the rounded number changes."""
        changed: Mask = self.numbers[1:] != self.numbers[:-1]
        return changed

    def check(self, limit: float) -> None:
        """Refuse words beyond the largest magnitude, in written units."""
        numbers = self.numbers[1:]
        largest = limit * 10**self.axis.decimals
        if max(numbers.max(), -numbers.min()) > largest:
            block = int(np.argmax(np.abs(numbers) > largest))
            value = numbers[block] / 10**self.axis.decimals
            largest = f"{limit:.{self.axis.decimals}f}"
            raise NotWritable(
                f"block {block}: axis {self.joint} would be at {value:.3f} {self.axis.unit}, beyond the largest word "
                f"of this control, {largest}; choose a control with longer words, or one that resets the tape's axis"
            )


def columns_of(trajectory: Trajectory, motions: Mask, axes: Sequence[tuple[AxisWord, int]]) -> list[Column]:
    """Return the columns of axes, each given with its index in the trajectory, whose `motions` (n,) may move them."""
    count = len(trajectory)
    numbers = [np.empty(count + 1, dtype=np.int64) for _ in axes]
    # The number of unknown values and the position after the last one agree where only the beginning is unknown.
    unknown, unknown_to = [0] * len(axes), [0] * len(axes)
    for first in range(0, count + 1, CHUNK):
        page = trajectory.positions[max(first - 1, 0) : first - 1 + CHUNK]
        if first == 0:
            page = np.vstack([trajectory.start, page])
        gaps = bool(np.isnan(page.sum()))
        for place, (axis, index) in enumerate(axes):
            values = page[:, index] * (1e3 if axis.unit == "mm" else 180.0 / np.pi)
            if gaps:
                gap = np.flatnonzero(np.isnan(values))
                values[gap] = 0.0
                unknown[place] += len(gap)
                unknown_to[place] = first + int(gap[-1]) + 1 if len(gap) else unknown_to[place]
            try:
                numbers[place][first : first + CHUNK] = rounded(values, axis.decimals)
            except ValueError as error:
                raise NotWritable(f"axis {trajectory.axes[index]}: {error}") from None
    return [
        _column(axis, trajectory, index, numbers[place], unknown[place], unknown_to[place], motions)
        for place, (axis, index) in enumerate(axes)
    ]


def _column(
    axis: AxisWord, trajectory: Trajectory, index: int, numbers: Ints, unknown: int, unknown_to: int, motions: Mask
) -> Column:
    """Return the column of one axis from its rounded numbers, of which only the first `unknown` may be unknown."""
    joint = trajectory.axes[index]
    if unknown != unknown_to:
        gap = np.isnan(trajectory.positions[:, index])
        first = int(np.argmin(np.isnan(np.append(trajectory.start[index], trajectory.positions[:, index]))))
        block = first + int(np.argmax(gap[first:]))
        raise NotWritable(f"block {block}: the position of axis {joint} is not a number, though it was known before")
    stated = np.flatnonzero((trajectory.stated & np.uint16(1 << index)) > 0)
    early = slice(0, max(unknown - 1, 0))
    feeding = motions[early] & (trajectory.kinds[early] != Kind.RAPID)
    used = [*np.flatnonzero(feeding).tolist(), *stated[stated < early.stop].tolist()]
    if used:
        raise NotWritable(f"block {min(used)}: axis {joint} is used before a rapid has stated it")
    numbers[:unknown] = numbers[unknown] if unknown < len(numbers) else 0
    written = numbers[1:] != numbers[:-1]
    still = written & ~motions
    if still.any():
        raise NotWritable(f"block {int(np.argmax(still))}: axis {joint} changes in a block that is no motion")
    written[stated[motions[stated]]] = True
    # The text must state every axis once, even if the trajectory gives its start.
    written[early.stop + np.flatnonzero(motions[early.stop :])[:1]] = True
    return Column(axis, joint, numbers, written)


def moving(trajectory: Trajectory) -> Mask:
    """Return the blocks (n,) that are motions."""
    motions = np.zeros(256, dtype=bool)
    motions[list(MOTIONS)] = True
    return motions[trajectory.kinds]
