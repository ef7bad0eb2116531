"""Time law: the one place that turns distance into seconds; today axes have a top speed, and reach it at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tapelayer.arrays import Floats, Mask, frozen
from tapelayer.machines.machine import Axis

Lengths = TypeVar("Lengths", float, Floats)


@dataclass(frozen=True, eq=False)
class Limits:
    """What axes can do, a row an axis.

    Attributes:
        speed: (k,) m/s or rad/s.
    """

    speed: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "speed", frozen(self.speed))

    @staticmethod
    def of(axes: Iterable[Axis]) -> Limits:
        """Return the limits of axes, in their order."""
        return Limits(np.array([axis.speed for axis in axes]))


def rapids(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n,) of rapids, each as long as its slowest axis takes.

    Args:
        steps: (n, k) change of every axis, metres or radians; NaN where nothing has stated where the axis stood: the
            time is not known, and counts as none.
        limits: of the k axes.
    """
    seconds: Floats = np.max(np.nan_to_num(axis_times(steps, limits)), axis=1, initial=0.0)
    return seconds


def feeds(steps: Floats, limits: Limits, least: Floats) -> Floats:
    """Return the seconds (n,) of feeds, in which no axis exceeds its limits.

    Args:
        steps: (n, k) change of every axis, metres or radians.
        limits: of the k axes.
        least: (n,) seconds that are asked for each; where an axis cannot follow, it takes longer.
    """
    seconds: Floats = np.maximum(np.max(axis_times(steps, limits), axis=1, initial=0.0), least)
    return seconds


def axis_times(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n, k) that each axis would take for its own steps (n, k), metres or radians."""
    return np.abs(steps) / limits.speed


def at_speed(lengths: Lengths, speed: float) -> Lengths:
    """Return the seconds that lengths, of any shape and in metres, take at a set speed in m/s."""
    return lengths / speed


def by_feed_word(lengths: Floats, feeds: Floats, inverse: Mask) -> Floats:
    """Return the seconds (n,) that a control's feed words ask for.

    Args:
        lengths: (n,) in the unit of the feed.
        feeds: (n,) feed words: units per minute, or one over the minutes of the block.
        inverse: (n,) where they are the latter.
    """
    return 60.0 * np.where(inverse, 1.0, lengths) / feeds
