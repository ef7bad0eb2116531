"""Time law: the only module that turns distance into seconds; for now axes have a top speed and reach it at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tapelayer.arrays import Floats, Frozen, Mask
from tapelayer.machines.machine import Axis

Lengths = TypeVar("Lengths", float, Floats)


@dataclass(frozen=True, eq=False)
class Limits(Frozen):
    """The limits of axes, one row per axis.

    Attributes:
        speed: (k,) m/s or rad/s.
    """

    speed: Floats

    @staticmethod
    def of(axes: Iterable[Axis]) -> Limits:
        """Return the limits of axes, in their order."""
        return Limits(np.array([axis.speed for axis in axes]))


def rapids(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n,) of rapids, each as long as its slowest axis takes.

    Args:
        steps: (n, k) change of every axis, metres or radians; NaN where the axis's position was unknown, so that its
            time is unknown and counts as 0.
        limits: of the k axes.

    Examples:
        >>> limits = Limits(np.array([0.5, 0.1]))
        >>> rapids(np.array([[1.0, 0.1], [1.0, np.nan]]), limits).tolist()
        [2.0, 2.0]
    """
    seconds: Floats = np.max(np.nan_to_num(axis_times(steps, limits)), axis=1, initial=0.0)
    return seconds


def feeds(steps: Floats, limits: Limits, least: Floats) -> Floats:
    """Return the seconds (n,) of feeds, in which no axis exceeds its limits.

    Args:
        steps: (n, k) change of every axis, metres or radians.
        limits: of the k axes.
        least: (n,) seconds requested for each; a feed takes longer where an axis cannot follow.

    Examples:
        >>> limits = Limits(np.array([0.5, 0.1]))
        >>> feeds(np.array([[1.0, 0.1], [1.0, 0.5]]), limits, least=np.array([3.0, 3.0])).tolist()
        [3.0, 5.0]
    """
    seconds: Floats = np.maximum(np.max(axis_times(steps, limits), axis=1, initial=0.0), least)
    return seconds


def axis_times(steps: Floats, limits: Limits) -> Floats:
    """Return the seconds (n, k) that each axis would take for its own steps (n, k), metres or radians.

    Examples:
        >>> axis_times(np.array([[1.0, -0.1]]), Limits(np.array([0.5, 0.1]))).tolist()
        [[2.0, 1.0]]
    """
    return np.abs(steps) / limits.speed


def at_speed(lengths: Lengths, speed: float) -> Lengths:
    """Return the seconds that lengths of any shape in metres take at a constant speed in m/s.

    Examples:
        >>> at_speed(1.5, 0.5)
        3.0
    """
    return lengths / speed


def by_feed_word(lengths: Floats, feeds: Floats, inverse: Mask) -> Floats:
    """Return the seconds (n,) that a control's feed words specify.

    Args:
        lengths: (n,) in the unit of the feed.
        feeds: (n,) feed words: units per minute, or one over the minutes of the block.
        inverse: (n,) where they are the latter.

    Examples:
        >>> lengths, feeds = np.array([100.0, 100.0]), np.array([600.0, 2.0])
        >>> by_feed_word(lengths, feeds, inverse=np.array([False, True])).tolist()
        [10.0, 30.0]
    """
    return 60.0 * np.where(inverse, 1.0, lengths) / feeds
