"""Plan view: the part from above with its coat and passes, a histogram of the thickness, and sections of the coat."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from tapelayer.arrays import Floats, Ints
from tapelayer.reporting.drawing import Panel, PlotCurve, element, extent, heading_of, polyline, px, range_of, svg
from tapelayer.reporting.map_marks import COLOURS, arrowhead, colour_bar, foot, heading, plan_panel, scale_bar
from tapelayer.reporting.words import ENGLISH, Say
from tapelayer.spraying.coat import Coat
from tapelayer.spraying.passes import Plan
from tapelayer.units import MM

# Smallest cell of the map in pixels; on the part a cell is never smaller than the spacing of the samples.
LEAST_CELL = 3.0
BINS = 60
# The colours go from the mean less this share to the mean and this share; below the trace is the far edge of a spot.
SPAN, TRACE = 0.2, 0.01
MICROMETRES = 1e6


def plan_view(plan: Plan, coat: Coat | None, say: Say = ENGLISH) -> list[Element]:
    """Return the part from above to scale, in `machine` axes: the passes, and the thickness of any coat."""
    paths = [one.path.points[:, :2] / MM for one in plan.passes]
    corners = np.vstack(paths if coat is None else [*paths, coat.surface.points[:, :2] / MM])
    low, high = corners.min(axis=0), corners.max(axis=0)
    panel, scale = plan_panel(low, high)
    nodes = panel.drawn(heading_of((say("y over x, mm", "y 对 x，mm"), "")), [], [])
    if coat is not None:
        values, unit = _shown(coat)
        mean = _mean(coat)
        nodes += _map(panel, coat, values, scale, mean)
        words = (say("thickness", "厚度"), unit.strip() or say("of the mean", "相对于平均值"))
        outside = {
            "over": say("above", "超过上限"),
            "under": say("below", "低于下限"),
            "bare": say("no coat", "无涂层"),
        }
        bar = (panel.left + panel.width + 24, panel.top)
        nodes += colour_bar(*bar, words, ((1 - SPAN) * mean, (1 + SPAN) * mean), beyond=outside)
    lines = "".join(polyline(panel.across(path[:, 0]), panel.down(path[:, 1])) for path in paths)
    nodes.append(element("path", d=lines, transform="scale(.1)", class_="line way"))
    arrows = [_arrow(panel.across(path[:, 0]), panel.down(path[:, 1])) for path in paths]
    nodes.append(element("path", d="".join(arrows), class_="arrow"))
    nodes.append(scale_bar(panel, scale))
    note = say(
        "x and y of the machine in mm, to scale. Lines: the way of the sprayed point with the arc on, overrun "
        "included.",
        "机床坐标 x 与 y，单位 mm，按比例。线：电弧开启时喷点的轨迹，含超程。",
    )
    if coat is not None:
        note += say(
            " Colours: thickness {unit}, from {low:.4g} to {high:.4g}, which is the mean less and more {span:.0%}.",
            "颜色：厚度（{unit}），{low:.4g} 至 {high:.4g}，即平均值减与加 {span:.0%}。",
            unit=say("relative to its mean", "相对于平均值") if coat.relative else say("in micrometres", "微米"),
            low=(1 - SPAN) * mean,
            high=(1 + SPAN) * mean,
            span=SPAN,
        )
    label = say("Plan view of the passes", "喷涂道次俯视图")
    figure = svg(panel.left + panel.width + 150, foot(panel) + 24, *nodes, label=label)
    return [element("figure", figure), element("p", note, class_="note")]


def coat_plots(plan: Plan, coat: Coat, say: Say = ENGLISH) -> list[Element]:
    """Return a histogram of the thickness, and sections of the coat along the longest pass and across the passes."""
    values, unit = _shown(coat)
    even = coat.evenness
    mean = _mean(coat)
    longest = max(plan.passes, key=lambda one: float(one.path.arc_lengths[-1]))
    begin, end = longest.path.points[[0, -1], :2]
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([-along[1], along[0]])
    away = coat.surface.points[:, :2] - (begin + end) / 2
    words = say(
        "Mean {mean:.4g}{unit}; standard deviation {cv:.2f} % of the mean, without a border band of one spot radius "
        "{interior:.2f} %; {coverage:.2f} % of the area has more than half of what is the mean without that band. "
        "Dashed: the mean.",
        "平均 {mean:.4g}{unit}；标准差为平均值的 {cv:.2f} %，不含一个斑点半径宽的边缘带为 {interior:.2f} %；"
        "{coverage:.2f} % 的面积厚度超过不含边缘平均值的一半。虚线：平均值。",
        mean=mean,
        unit=unit,
        cv=even.cv_percent,
        interior=even.cv_interior_percent,
        coverage=even.coverage_percent,
    )
    nodes = [element("p", words, class_="note"), _histogram(values, coat.surface.areas, mean, unit, say)]
    number = longest.path.number
    middle = say("across the passes, through the middle of pass {n}", "横跨各喷涂道次，经喷涂道次 {n} 的中点", n=number)
    for name, axis, other in (
        (say("along pass {n}", "沿喷涂道次 {n}", n=number), along, across),
        (middle, across, along),
    ):
        near = np.abs(away @ other) <= coat.spacing / 2
        order = np.argsort(away[near] @ axis)
        places = (away[near] @ axis)[order] / MM
        curve = PlotCurve("first", places, values[near][order])
        if len(places):
            panel = Panel(66, 18, 930, 110, extent(places), range_of([curve], [0.0, mean]))
            heading = heading_of(
                (f"{say('thickness', '厚度')}{unit} ", "first"),
                (say("over mm {name}", "横轴 mm，{name}", name=name), ""),
            )
            drawn = panel.drawn(heading, [curve], [mean], False)
            nodes.append(element("figure", svg(1016, 150, *drawn, label=f"{say('Thickness', '厚度')} {name}")))
    return nodes


def _shown(coat: Coat) -> tuple[Floats, str]:
    """Return the thickness (m,) in the unit of the page, and that unit with a space before it."""
    if coat.relative:
        return coat.thickness, ""
    return coat.thickness * MICROMETRES, " um"


def _mean(coat: Coat) -> float:
    """Return the mean thickness in the unit of the page."""
    return coat.evenness.mean * (1.0 if coat.relative else MICROMETRES)


def _map(panel: Panel, coat: Coat, values: Floats, scale: float, mean: float) -> list[Element]:
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
    styles = _styles(sums[filled] / weights[filled] / mean)
    return [
        element("path", d=_runs(filled[styles == style], width, cell, panel), class_=f"fill {style}")
        for style in np.unique(styles).tolist()
    ]


def _styles(shares: Floats) -> npt.NDArray[np.str_]:
    """Return the style (m,) of each thickness, relative to the mean: a colour of the scale, or one beyond its ends.

    Examples:
        >>> _styles(np.array([0.0, 0.7, 0.8, 1.0, 1.1999, 1.2, 1.3])).tolist()
        ['bare', 'under', 'e0', 'e5', 'e9', 'e9', 'over']
    """
    places = np.clip(((shares - 1 + SPAN) / (2 * SPAN) * COLOURS).astype(np.int64), 0, COLOURS - 1)
    inside = np.array([f"e{colour}" for colour in range(COLOURS)])[places]
    # The last digits of a bound are rounding.
    low, high = (1 - SPAN) * (1 - 1e-9), (1 + SPAN) * (1 + 1e-9)
    conditions = [~(shares > TRACE), shares < low, shares > high]
    styles: npt.NDArray[np.str_] = np.select(conditions, ["bare", "under", "over"], inside)
    return styles


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


def _histogram(values: Floats, areas: Floats, mean: float, unit: str, say: Say) -> Element:
    """Return a histogram of the share of the area by thickness."""
    low, high = extent(values)
    low = min(low, 0.0)
    shares, edges = np.histogram(values, bins=BINS, range=(low, high), weights=areas / np.sum(areas) * 100.0)
    panel = Panel(66, 18, 930, 110, (low, high), (0.0, float(shares.max()) * 1.08))
    heading = (say("% of the area ", "面积占比 % "), "first"), (f"{say('over thickness', '横轴厚度')}{unit}", "")
    nodes = panel.drawn(heading_of(*heading), [], [])
    sides, tops, foot = panel.across(edges).tolist(), panel.down(shares).tolist(), px(panel.down(0.0))
    bars = "".join(
        f"M{px(left)} {foot}V{px(top)}H{px(right)}V{foot}z"
        for left, right, top, share in zip(sides[:-1], sides[1:], tops, shares.tolist(), strict=True)
        if share > 0.0
    )
    nodes.append(element("path", d=bars, class_="used"))
    at = px(panel.across(mean))
    nodes.append(element("path", d=f"M{at} {px(panel.top)}v{panel.height}", class_="limit free"))
    return element("figure", svg(1016, 150, *nodes, label=say("Histogram of the thickness", "厚度直方图")))


def _arrow(across: Floats, down: Floats) -> str:
    """Return an arrowhead in the middle of a path."""
    middle = max(len(across) // 2, 1)
    tip = np.array([across[middle], down[middle]])
    before = np.array([across[middle - 1], down[middle - 1]])
    ahead = heading(before, tip)
    return arrowhead(tip + 3 * ahead, ahead, 6, 2.2) if np.any(tip != before) else ""
