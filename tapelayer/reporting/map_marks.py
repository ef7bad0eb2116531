"""Map marks: scale bars, arrows and labels on views from above."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.reporting.drawing import Panel, element, px, ticks
from tapelayer.reporting.words import plain

# Number of colours of a scale, and largest size of a plan's drawing in pixels.
COLOURS = 10
WIDTH, HEIGHT = 760.0, 560.0


def plan_panel(low: Floats, high: Floats) -> tuple[Panel, float]:
    """Return the panel of a plan to scale from corner (2,) to corner (2,) in mm, and its pixels per millimetre."""
    scale = float(min(WIDTH / (high[0] - low[0]), HEIGHT / (high[1] - low[1])))
    size = (high - low) * scale
    spans = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
    return Panel(64, 18, round(size[0]), round(size[1]), *spans), scale


def round_up(value: float) -> float:
    """Return the next 1, 2 or 5 times a power of ten, and at least 0.001, a micrometre in millimetres.

    Examples:
        >>> round_up(0.03), round_up(6.0), round_up(0.0)
        (0.05, 10.0, 0.001)
    """
    if not value > 1e-3:
        return 1e-3
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1 - 1e-9))


def heading(begin: Floats, end: Floats) -> Floats:
    """Return the unit vector (2,) from one point (2,) to another; up the page where they coincide.

    Examples:
        >>> heading(np.array([0.0, 0.0]), np.array([3.0, 4.0])).tolist()
        [0.6, 0.8]
    """
    length = float(np.hypot(*(end - begin)))
    direction: Floats = (end - begin) / length if length > 0.0 else np.array([0.0, -1.0])
    return direction


class MarkPlaces:
    """Places on the page taken by marks of equal height.

    Args:
        height: of a mark, pixels.
    """

    def __init__(self, height: float) -> None:
        self._height = height
        self._taken = np.zeros((0, 3))

    def take(self, centre: Floats, half_width: float) -> bool:
        """Take the place around a centre (2,) in pixels and return True, or return False where it is taken.

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


def arrowhead(tip: Floats, ahead: Floats, length: float, half_width: float) -> str:
    """Return the path of an arrowhead with its tip (2,) in pixels, along a unit vector (2,)."""
    left = np.array([ahead[1], -ahead[0]])
    corners = (tip, tip - length * ahead + half_width * left, tip - length * ahead - half_width * left)
    return "M" + "L".join(f"{px(x)} {px(y)}" for x, y in corners) + "z"


def colour_bar(
    left: float, top: float, words: tuple[str, str], highest: float, *, bound: bool = False, over: bool = False
) -> list[Element]:
    """Return a bar of the colours with their values.

    Args:
        left: of the bar, pixels.
        top: of the bar, pixels.
        words: what the colours mean, in two lines.
        highest: value at the end of the colours, which begin at 0.
        bound: whether the end is a limit.
        over: whether the colour for values beyond the limit is shown, too.
    """
    size = 14.0
    nodes = [
        element("text", line, x=px(left), y=px(top + down), class_="tick")
        for line, down in zip(words, (8, 20), strict=True)
    ]
    top += 30
    if over:
        nodes.append(element("rect", x=px(left), y=px(top), width=16, height=size, class_="fill over"))
        nodes.append(element("text", "beyond the limit", x=px(left + 21), y=px(top + 10), class_="tick bound"))
        top += size + 6
    for colour in range(COLOURS):
        down = top + size * (COLOURS - 1 - colour)
        nodes.append(element("rect", x=px(left), y=px(down), width=16, height=size, class_=f"fill e{colour}"))
    for i in range(0, COLOURS + 1, 2):
        at = top + size * (COLOURS - i)
        style = "tick bound" if i == COLOURS and bound else "tick"
        nodes.append(element("text", plain(highest * i / COLOURS), x=px(left + 21), y=px(at + 4), class_=style))
    return nodes


def scale_bar(panel: Panel, scale: float) -> Element:
    """Return a bar of a round length, to the right of the plan at its foot."""
    length = ticks(0.0, 90.0 / scale, 3)[-1]
    left, down = panel.left + panel.width + 24, panel.top + panel.height
    bar = element("path", d=f"M{px(left)} {px(down - 4)}v4h{px(length * scale)}v-4", class_="scale")
    return element("g", bar, element("text", f"{plain(length)} mm", x=px(left), y=px(down - 8), class_="tick"))
