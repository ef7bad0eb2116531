"""Drawing: elements of a page, and plots as SVG.

Everything is built as an element tree, so that the serialiser escapes every name from a file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.reporting.words import plain


def element(tag: str, *content: Element | str, **attributes: object) -> Element:
    """Return an element; underscores in attributes become hyphens, and a final one avoids Python's keywords.

    Examples:
        >>> from xml.etree.ElementTree import tostring
        >>> tostring(element("p", "at most ", element("b", "5 < 6"), " mm", class_="note")).decode()
        '<p class="note">at most <b>5 &lt; 6</b> mm</p>'
    """
    node = Element(tag, {name.rstrip("_").replace("_", "-"): str(value) for name, value in attributes.items()})
    for part in content:
        if isinstance(part, Element):
            node.append(part)
        elif len(node):
            node[-1].tail = (node[-1].tail or "") + part
        else:
            node.text = (node.text or "") + part
    return node


def table(headings: Sequence[str], rows: Iterable[Sequence[Element | str]], **attributes: object) -> Element:
    """Return a table of headings and rows.

    Examples:
        >>> from xml.etree.ElementTree import tostring
        >>> tostring(table(["axis", "mm"], [["x", "2500"]])[1]).decode()
        '<tbody><tr><td>x</td><td>2500</td></tr></tbody>'
    """
    return element(
        "table",
        element("thead", element("tr", *(element("th", heading, scope="col") for heading in headings))),
        element("tbody", *(element("tr", *(element("td", cell) for cell in row)) for row in rows)),
        **attributes,
    )


def svg(width: float, height: float, *content: Element, label: str = "") -> Element:
    """Return a drawing of a size in pixels; without a label it is decoration.

    Examples:
        >>> from xml.etree.ElementTree import tostring
        >>> tostring(svg(600, 100.25, label="pitch over time")).decode()
        '<svg viewBox="0 0 600 100.2" width="600" role="img" aria-label="pitch over time" />'
    """
    attributes = {"role": "img", "aria_label": label} if label else {"aria_hidden": "true"}
    return element("svg", *content, viewBox=f"0 0 {px(width)} {px(height)}", width=px(width), **attributes)


def heading_of(*parts: tuple[str, str]) -> Element:
    """Return a plot's heading of words, each in the colour of its line.

    Examples:
        >>> from xml.etree.ElementTree import tostring
        >>> tostring(heading_of(("pitch, deg", "first"))).decode()
        '<text class="heading"><tspan class="first">pitch, deg</tspan></text>'
    """
    return element("text", *(element("tspan", words, class_=style) for words, style in parts), class_="heading")


@dataclass(frozen=True, eq=False)
class PlotCurve:
    """A curve of a plot.

    Attributes:
        style: CSS class.
        x: (n,) finite, in the plot's unit.
        y: (n,) in the plot's unit; a non-finite value is a gap.
    """

    style: str
    x: Floats
    y: Floats


@dataclass(frozen=True)
class Panel:
    """The position and ranges of one plot in its figure, in pixels and the plot's units.

    Attributes:
        left: of the plot's area.
        top: of the plot's area.
        width: of the plot's area.
        height: of the plot's area.
        x: lowest and highest.
        y: lowest and highest.
    """

    left: float
    top: float
    width: int
    height: int
    x: tuple[float, float]
    y: tuple[float, float]

    def across(self, x: Floats | float) -> Any:
        """Return pixels from the figure's left edge.

        Examples:
            >>> panel = Panel(left=50, top=20, width=400, height=100, x=(0.0, 8.0), y=(-1.0, 1.0))
            >>> panel.across(2.0)
            150.0
        """
        return self.left + (x - self.x[0]) * (self.width / (self.x[1] - self.x[0]))

    def down(self, y: Floats | float) -> Any:
        """Return pixels from the figure's top edge.

        Examples:
            >>> panel = Panel(left=50, top=20, width=400, height=100, x=(0.0, 8.0), y=(-1.0, 1.0))
            >>> panel.down(np.array([1.0, 0.0, -1.0])).tolist()
            [20.0, 70.0, 120.0]
        """
        return self.top + (self.y[1] - y) * (self.height / (self.y[1] - self.y[0]))

    def drawn(
        self, heading: Element, curves: Sequence[PlotCurve], limits: Sequence[float], judged: bool = True
    ) -> list[Element]:
        """Return the elements of the plot: frame, ticks, limits with their values, curves."""
        right, bottom = self.left + self.width, self.top + self.height
        heading.attrib.update(x=px(self.left), y=px(self.top - 5))
        nodes = [heading]
        for tick in ticks(*self.x, max(2, self.width // 56)):
            at = px(self.across(tick))
            nodes.append(element("path", d=f"M{at} {px(bottom)}v3", class_="axis"))
            nodes.append(element("text", plain(tick), x=at, y=px(bottom + 14), class_="tick middle"))
        taken = [self.down(limit) for limit in limits]
        for tick in ticks(*self.y, min(max(3, self.height // 26), 10)):
            at = self.down(tick)
            nodes.append(element("path", d=f"M{px(self.left)} {px(at)}h{self.width}", class_="grid"))
            if all(abs(at - other) > 11 for other in taken):
                nodes.append(element("text", plain(tick), x=px(self.left - 4), y=px(at + 4), class_="tick end"))
        nodes.append(
            element("rect", x=px(self.left), y=px(self.top), width=self.width, height=self.height, class_="frame")
        )
        last = -math.inf
        for limit, at in sorted(zip(limits, taken, strict=True), reverse=True):
            style = "limit" if judged else "limit free"
            nodes.append(element("path", d=f"M{px(self.left)} {px(at)}H{px(right)}", class_=style))
            if at - last > 11:
                style = "tick end bound" if judged else "tick end"
                nodes.append(element("text", plain(limit), x=px(self.left - 4), y=px(at + 4), class_=style))
                last = at
        for curve in curves:
            kept = extremes(curve.x, curve.y, self.width)
            line = polyline(self.across(curve.x[kept]), self.down(curve.y[kept]))
            nodes.append(element("path", d=line, transform="scale(.1)", class_=f"line {curve.style}"))
        return nodes


def range_of(curves: Sequence[PlotCurve], limits: Sequence[float]) -> tuple[float, float]:
    """Return lowest and highest y of the curves and the limits, with a margin to show untouched limits.

    Examples:
        >>> range_of([PlotCurve("first", np.arange(3.0), np.array([0.0, np.nan, 10.0]))], limits=[50.0])
        (-4.0, 54.0)
    """
    values = [*limits]
    for curve in curves:
        finite = curve.y[np.isfinite(curve.y)]
        values += [float(np.min(finite)), float(np.max(finite))] if len(finite) else []
    low, high = min(values), max(values)
    margin = 0.08 * (high - low) or 1.0
    return low - margin, high + margin


def extent(values: Floats) -> tuple[float, float]:
    """Return the lowest and highest of finite values (n,), never equal.

    Examples:
        >>> extent(np.array([3.0, 1.0, 2.0])), extent(np.array([3.0]))
        ((1.0, 3.0), (3.0, 4.0))
    """
    if not len(values):
        return 0.0, 1.0
    low, high = float(np.min(values)), float(np.max(values))
    return low, high if high > low else low + 1.0


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return round values in steps of 1, 2 or 5 times a power of ten, at most about `count` of them.

    Examples:
        >>> ticks(0.0, 7.0, 4), ticks(-1.0, 1.0, 4)
        ([0.0, 2.0, 4.0, 6.0], [-1.0, -0.5, 0.0, 0.5, 1.0])
    """
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= rough * (1 - 1e-9))
    return [i * step for i in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def extremes(x: Floats, y: Floats, columns: int) -> Ints:
    """Return the indices (m,) of the rows that a plot `columns` pixels wide needs.

    In each pixel column the first, last, least and greatest values are kept, and the first non-finite one: the line
    through them covers the same pixels as the line through all (M4, Jugel et al., VLDB 2014).

    Args:
        x: (n,) finite; consecutive rows in one column are one group.
        y: (n,) any unit.
        columns: pixel columns over the range of x.

    Examples:
        >>> extremes(np.arange(100.0), np.sin(np.arange(100.0) / 20), columns=2).tolist()
        [0, 31, 49, 50, 94, 99]
    """
    if not len(x):
        return np.zeros(0, np.int64)
    low, high = float(np.min(x)), float(np.max(x))
    place = (x - low) / (high - low) * columns if high > low else np.zeros(len(x))
    column = np.minimum(place.astype(np.int64), columns - 1)
    firsts = np.flatnonzero(np.append(True, column[1:] != column[:-1]))
    group = np.cumsum(np.append(False, column[1:] != column[:-1]))
    values = np.where(np.isfinite(y), y, np.nan)
    kept = [firsts, np.append(firsts[1:], len(x)) - 1]
    for mask in (
        values == np.fmin.reduceat(values, firsts)[group],
        values == np.fmax.reduceat(values, firsts)[group],
        np.isnan(values),
    ):
        hits = np.flatnonzero(mask)
        kept.append(hits[np.append(True, np.diff(group[hits]) > 0)[: len(hits)]])
    return np.unique(np.concatenate(kept))


def polyline(across: Floats, down: Floats) -> str:
    """Return the path in tenths of a pixel through points (n,), (n,); a non-finite point is a gap.

    Examples:
        >>> polyline(np.array([0.0, 10.0, 20.0]), np.array([5.0, 0.0, 5.0]))
        'M0 50l100-50 100 50'
        >>> polyline(np.array([0.0, 10.0, np.nan, 20.0]), np.array([5.0, 5.0, 5.0, 5.0]))
        'M0 50l100 0M200 50l0 0'
    """
    finite = np.isfinite(across) & np.isfinite(down)
    points = np.column_stack([across, down])[finite]
    tenths = np.rint(10 * points).astype(np.int64)
    first = np.flatnonzero(np.append(True, np.diff(np.flatnonzero(finite)) > 1)[: len(tenths)])
    parts = []
    for run in np.split(tenths, first[1:]) if len(tenths) else []:
        steps = np.diff(run, axis=0)
        steps = steps[np.any(steps != 0, axis=1)]
        # A lone point becomes a line of zero length, which round caps draw as a dot.
        steps = steps if len(steps) else np.zeros((1, 2), np.int64)
        parts.append(f"M{run[0, 0]} {run[0, 1]}l" + " ".join(map(str, steps.ravel().tolist())).replace(" -", "-"))
    return "".join(parts)


def px(value: float) -> str:
    """Return a pixel coordinate rounded to a tenth.

    Examples:
        >>> px(12.0), px(12.345)
        ('12', '12.3')
    """
    return f"{value:.1f}".removesuffix(".0")
