"""Map marks: scale bars, arrows and labels on views from above."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.reporting.drawing import Panel, element, px, ticks
from tapelayer.reporting.words import plain


def round_up(value: float) -> float:
    """The next of 1, 2 or 5 times a power of ten; for no error at all a micrometre in millimetres.

    Examples:
        >>> round_up(0.03), round_up(6.0), round_up(0.0)
        (0.05, 10.0, 0.001)
    """
    if not value > 1e-3:
        return 1e-3
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1 - 1e-9))


def heading(begin: Floats, end: Floats) -> Floats:
    """Unit vector (2,) from one point (2,) to another; up the page where they are one.

    Examples:
        >>> heading(np.array([0.0, 0.0]), np.array([3.0, 4.0])).tolist()
        [0.6, 0.8]
    """
    length = float(np.hypot(*(end - begin)))
    direction: Floats = (end - begin) / length if length > 0.0 else np.array([0.0, -1.0])
    return direction


class MarkPlaces:
    """Places on the page that are taken by marks of one height.

    Args:
        height: of a mark, pixels.
    """

    def __init__(self, height: float) -> None:
        self._height = height
        self._taken = np.zeros((0, 3))

    def take(self, centre: Floats, half_width: float) -> bool:
        """Take the place round a centre (2,) in pixels, unless it is taken.

        Examples:
            >>> places = MarkPlaces(height=10.0)
            >>> places.take(np.array([0.0, 0.0]), half_width=20.0), places.take(np.array([30.0, 0.0]), half_width=20.0)
            (True, False)
        """
        away = np.abs(self._taken[:, :2] - centre)
        if np.any((away[:, 0] < self._taken[:, 2] + half_width) & (away[:, 1] < self._height)):
            return False
        self._taken = np.vstack([self._taken, [*centre, half_width]])
        return True


def scale_bar(panel: Panel, scale: float) -> Element:
    """A bar of a round length, to the right of the plan at its foot."""
    length = ticks(0.0, 90.0 / scale, 3)[-1]
    left, down = panel.left + panel.width + 24, panel.top + panel.height
    bar = element("path", d=f"M{px(left)} {px(down - 4)}v4h{px(length * scale)}v-4", class_="scale")
    return element("g", bar, element("text", f"{plain(length)} mm", x=px(left), y=px(down - 8), class_="tick"))
