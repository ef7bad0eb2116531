"""Plan view: the part from above with its coat and passes, a histogram of the thickness, and sections of the coat."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.reporting.drawing import Panel, PlotCurve, element, extent, heading_of, polyline, px, range_of, svg
from tapelayer.reporting.map_marks import COLOURS, arrowhead, colour_bar, heading, plan_panel, scale_bar
from tapelayer.spraying.coat import Coat
from tapelayer.spraying.passes import Plan
from tapelayer.units import MM

# Smallest cell of the map in pixels; on the part a cell is never smaller than the spacing of the samples.
LEAST_CELL = 3.0
BINS = 60
MICROMETRES = 1e6


def plan_view(plan: Plan, coat: Coat | None) -> list[Element]:
    """Return the part from above to scale, in `machine` axes: the passes, and the thickness of any coat."""
    paths = [one.path.points[:, :2] / MM for one in plan.passes]
    corners = np.vstack(paths if coat is None else [*paths, coat.surface.points[:, :2] / MM])
    low, high = corners.min(axis=0), corners.max(axis=0)
    panel, scale = plan_panel(low, high)
    nodes = panel.drawn(heading_of(("y over x, mm", "")), [], [])
    if coat is not None:
        values, _ = _shown(coat)
        highest = _highest(values)
        nodes += _map(panel, coat, values, scale, highest)
        unit = "of the mean" if coat.relative else "um"
        nodes += colour_bar(panel.left + panel.width + 24, panel.top, ("thickness", unit), highest)
    lines = "".join(polyline(panel.across(path[:, 0]), panel.down(path[:, 1])) for path in paths)
    nodes.append(element("path", d=lines, transform="scale(.1)", class_="line way"))
    arrows = [_arrow(panel.across(path[:, 0]), panel.down(path[:, 1])) for path in paths]
    nodes.append(element("path", d="".join(arrows), class_="arrow"))
    nodes.append(scale_bar(panel, scale))
    words = (
        "x and y of the machine in mm, to scale. Lines: the way of the sprayed point with the arc on, overrun included."
    )
    if coat is not None:
        words += f" Colours: thickness{' relative to its mean' if coat.relative else ' in micrometres'}."
    figure = svg(panel.left + panel.width + 150, panel.top + panel.height + 24, *nodes, label="Plan view of the passes")
    return [element("figure", figure), element("p", words, class_="note")]


def coat_plots(plan: Plan, coat: Coat) -> list[Element]:
    """Return a histogram of the thickness, and sections of the coat along the longest pass and across the passes."""
    values, unit = _shown(coat)
    even = coat.evenness
    scale = MICROMETRES if not coat.relative else 1.0
    mean = even.mean * scale
    longest = max(plan.passes, key=lambda one: float(one.path.arc_lengths[-1]))
    begin, end = longest.path.points[[0, -1], :2]
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([-along[1], along[0]])
    away = coat.surface.points[:, :2] - (begin + end) / 2
    words = f"Mean {mean:.4g}{unit}; standard deviation {even.cv_percent:.2f} % of the mean, "
    words += f"without a border band of one spot radius {even.cv_interior_percent:.2f} %; {even.coverage_percent:.2f} %"
    words += " of the area has more than half of what is the mean without that band. Dashed: the mean."
    nodes = [element("p", words, class_="note"), _histogram(values, coat.surface.areas, mean, unit)]
    for name, axis, other in (
        (f"along pass {longest.path.number}", along, across),
        (f"across the passes, through the middle of pass {longest.path.number}", across, along),
    ):
        near = np.abs(away @ other) <= coat.spacing / 2
        order = np.argsort(away[near] @ axis)
        places = (away[near] @ axis)[order] / MM
        curve = PlotCurve("first", places, values[near][order])
        if len(places):
            panel = Panel(66, 18, 930, 110, extent(places), range_of([curve], [0.0, mean]))
            heading = heading_of((f"thickness{unit} ", "first"), (f"over mm {name}", ""))
            drawn = panel.drawn(heading, [curve], [mean], False)
            nodes.append(element("figure", svg(1016, 150, *drawn, label=f"Thickness {name}")))
    return nodes


def _shown(coat: Coat) -> tuple[Floats, str]:
    """Return the thickness (m,) in the unit of the page, and that unit with a space before it."""
    if coat.relative:
        return coat.thickness, ""
    return coat.thickness * MICROMETRES, " um"


def _highest(values: Floats) -> float:
    """Return the top of the colour scale: a round value that all but the thickest 1 % stay below."""
    most = float(np.quantile(values, 0.99))
    if not most > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(most))
    return next(
        step * power for step in (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0) if step * power >= most
    )


def _map(panel: Panel, coat: Coat, values: Floats, scale: float, highest: float) -> list[Element]:
    """Return the map's cells by colour, each coloured by the mean of its samples."""
    surface = coat.surface
    cell = max(LEAST_CELL, 1.1 * coat.spacing / MM * scale)
    columns = ((panel.across(surface.points[:, 0] / MM) - panel.left) / cell).astype(np.int64)
    rows = ((panel.down(surface.points[:, 1] / MM) - panel.top) / cell).astype(np.int64)
    width = int(columns.max()) + 1
    place = rows * width + columns
    weights = np.bincount(place, weights=surface.areas)
    sums = np.bincount(place, weights=surface.areas * values)
    filled = np.flatnonzero(weights > 0.0)
    classes = np.clip((sums[filled] / weights[filled] / highest * COLOURS).astype(np.int64), 0, COLOURS - 1)
    nodes = []
    for colour in range(COLOURS):
        path = _runs(filled[classes == colour], width, cell, panel)
        if path:
            nodes.append(element("path", d=path, class_=f"fill e{colour}"))
    return nodes


def _runs(cells: Ints, width: int, cell: float, panel: Panel) -> str:
    """Return the SVG path of cells, with adjacent cells of a row drawn as one."""
    if not len(cells):
        return ""
    new = np.append(True, (np.diff(cells) != 1) | (cells[1:] % width == 0))
    first = np.flatnonzero(new)
    counts = np.diff(np.append(first, len(cells)))
    parts = []
    for start, count in zip(cells[first].tolist(), counts.tolist(), strict=True):
        left, top = panel.left + start % width * cell, panel.top + start // width * cell
        # A little overlap hides the seams between cells.
        parts.append(f"M{px(left)} {px(top)}h{px(count * cell + 0.2)}v{px(cell + 0.2)}H{px(left)}z")
    return "".join(parts)


def _histogram(values: Floats, areas: Floats, mean: float, unit: str) -> Element:
    """Return a histogram of the share of the area by thickness."""
    low, high = extent(values)
    low = min(low, 0.0)
    shares, edges = np.histogram(values, bins=BINS, range=(low, high), weights=areas / np.sum(areas) * 100.0)
    panel = Panel(66, 18, 930, 110, (low, high), (0.0, float(shares.max()) * 1.08))
    nodes = panel.drawn(heading_of(("% of the area ", "first"), (f"over thickness{unit}", "")), [], [])
    sides, tops, foot = panel.across(edges).tolist(), panel.down(shares).tolist(), px(panel.down(0.0))
    bars = "".join(
        f"M{px(left)} {foot}V{px(top)}H{px(right)}V{foot}z"
        for left, right, top, share in zip(sides[:-1], sides[1:], tops, shares.tolist(), strict=True)
        if share > 0.0
    )
    nodes.append(element("path", d=bars, class_="used"))
    at = px(panel.across(mean))
    nodes.append(element("path", d=f"M{at} {px(panel.top)}v{panel.height}", class_="limit free"))
    return element("figure", svg(1016, 150, *nodes, label="Histogram of the thickness"))


def _arrow(across: Floats, down: Floats) -> str:
    """Return an arrowhead in the middle of a path."""
    middle = max(len(across) // 2, 1)
    tip = np.array([across[middle], down[middle]])
    before = np.array([across[middle - 1], down[middle - 1]])
    ahead = heading(before, tip)
    return arrowhead(tip + 3 * ahead, ahead, 6, 2.2) if np.any(tip != before) else ""
