"""Map marks: scale bars, arrows and labels on views from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.reporting.drawing import Panel, element, px, ticks
from tapelayer.reporting.words import plain

# Number of colours of a scale, and largest size of a plan's drawing in pixels.
COLOURS = 10
WIDTH, HEIGHT = 760.0, 560.0
# Height in pixels of all marks beside a plan: heading and colours, those beyond the scale, and the scale bar.
MARKS = 280.0


def plan_panel(
    low: Floats, high: Floats, left: float = 64.0, largest: tuple[float, float] = (WIDTH, HEIGHT)
) -> tuple[Panel, float]:
    """Return the panel of a plan to scale from corner (2,) to corner (2,) in mm, and its pixels per millimetre.

    Args:
        low: least x and y.
        high: greatest x and y.
        left: of the panel, pixels.
        largest: width and height that it does not exceed, pixels.
    """
    scale = float(min(largest[0] / (high[0] - low[0]), largest[1] / (high[1] - low[1])))
    size = (high - low) * scale
    spans = (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
    return Panel(left, 18, round(size[0]), round(size[1]), *spans), scale


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


def arrows(paths: Sequence[Floats]) -> list[Element]:
    """Return an arrowhead in the middle of each path (n, 2) in pixels, without those that would overlap."""
    nodes = []
    places = MarkPlaces(10.0)
    for points in paths:
        middle = len(points) // 2
        begin, end = points[middle - 1], points[middle]
        ahead = heading(begin, end)
        if places.take((begin + end) / 2, 5.0):
            path = arrowhead((begin + end) / 2 + 5 * ahead, ahead, 10, 4)
            nodes.append(element("path", d=path, class_="arrow"))
    return nodes


def number_labels(numbers: Sequence[int], paths: Sequence[Floats]) -> list[Element]:
    """Return numbers before the starts of paths (n, 2) in pixels, without those that would overlap."""
    nodes = []
    places = MarkPlaces(11.0)
    for number, points in zip(numbers, paths, strict=True):
        across, down = points[0] - 9 * heading(points[0], points[1])
        if places.take(np.array([across, down]), 3.5 * len(str(number)) + 3):
            nodes.append(element("text", str(number), x=px(across), y=px(down + 4), class_="number middle"))
    return nodes


def colour_bar(
    left: float,
    top: float,
    words: tuple[str, str],
    span: tuple[float, float],
    beyond: Mapping[str, str],
    *,
    bound: bool = False,
) -> list[Element]:
    """Return a bar of the colours with their values.

    Args:
        left: of the bar, pixels.
        top: of the bar, pixels.
        words: what the colours mean, in two lines.
        span: values at the ends of the colours.
        beyond: names of the colours for values outside: `over` stands above the bar, the others below it.
        bound: whether the upper end is a limit.
    """
    low, high = span
    size = 14.0
    nodes = [
        element("text", line, x=px(left), y=px(top + down), class_="tick")
        for line, down in zip(words, (8, 20), strict=True)
    ]
    top += 30

    def swatch(style: str, down: float) -> None:
        nodes.append(element("rect", x=px(left), y=px(down), width=16, height=size, class_=f"fill {style}"))
        nodes.append(element("text", beyond[style], x=px(left + 21), y=px(down + 10), class_="tick"))

    if "over" in beyond:
        swatch("over", top)
        top += size + 6
    for colour in range(COLOURS):
        down = top + size * (COLOURS - 1 - colour)
        nodes.append(element("rect", x=px(left), y=px(down), width=16, height=size, class_=f"fill e{colour}"))
    for i in range(0, COLOURS + 1, 2):
        at = top + size * (COLOURS - i)
        style = "tick bound" if i == COLOURS and bound else "tick"
        value = low + (high - low) * i / COLOURS
        nodes.append(element("text", f"{value:z,.4g}", x=px(left + 21), y=px(at + 4), class_=style))
    top += size * COLOURS
    for style in beyond:
        if style != "over":
            top += 6
            swatch(style, top)
            top += size
    return nodes


def foot(panel: Panel) -> float:
    """Return where a plan ends, in pixels: at its own foot, or below the marks beside it."""
    return panel.top + max(float(panel.height), MARKS)


def scale_bar(panel: Panel, scale: float) -> Element:
    """Return a bar of a round length, to the right of the plan at its foot."""
    length = ticks(0.0, 90.0 / scale, 3)[-1]
    left, down = panel.left + panel.width + 24, foot(panel)
    bar = element("path", d=f"M{px(left)} {px(down - 4)}v4h{px(length * scale)}v-4", class_="scale")
    return element("g", bar, element("text", f"{plain(length)} mm", x=px(left), y=px(down - 8), class_="tick"))
