"""Error plots: the errors along the courses, drawn for the report's page."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.laying.evidence import Evidence, Samples
from tapelayer.laying.quantities import ROWS
from tapelayer.reporting.drawing import Panel, PlotCurve, element, extent, heading_of, range_of, svg
from tapelayer.reporting.quantity import Quantity, quantities
from tapelayer.reporting.words import ENGLISH, Say
from tapelayer.units import DEG, MM

# Number of courses with plots of their own; the page counts the others.
SHOWN_COURSES = 40
PLOTS_A_LINE = 4
STYLES = ("first", "second")
PLOTTED = [row for row in quantities(ROWS) if row.curves]


def course_plots(evidence: Evidence, say: Say = ENGLISH) -> list[Element]:
    """Return plots of the errors along the courses; of many courses, only those that come nearest to a limit."""
    samples, limits = evidence.samples, evidence.limits
    if not len(samples.courses):
        return [element("p", say("Nothing was measured along the courses.", "沿道次没有测量数据。"), class_="note")]
    starts = np.unique(samples.courses, return_index=True)[1]
    shares = np.max(
        [
            np.maximum.reduceat(np.abs(getattr(samples, row.samples) * _scale(row)), starts) / limits[row.key].value
            for row in PLOTTED
        ],
        axis=0,
    )
    shares = np.where(np.isfinite(shares), shares, np.inf)
    order = np.argsort(-shares, kind="stable")
    chosen = np.sort(order[:SHOWN_COURSES])
    curves = {row.key: _curves(row, samples) for row in PLOTTED}
    ranges = {key: range_of(lines, [-limits[key].value, limits[key].value]) for key, lines in curves.items()}
    ends = np.append(starts[1:], len(samples.courses))
    nodes = [
        element(
            "p",
            say(
                "Over arc length in mm; the scale of errors is one for all courses. Dashed: limits of the setup{grey}; "
                "the one of position holds for normal and lateral together.",
                "横轴：弧长 mm；各道次误差比例相同。虚线：参数中的限值{grey}；位置限值对法向与侧向合成误差有效。",
                grey=""
                if all(limit.judged for limit in limits.values())
                else say(" (grey: not judged)", "（灰色：未作判定）"),
            ),
            class_="note",
        )
    ]
    for row in chosen:
        part = slice(int(starts[row]), int(ends[row]))
        nodes.append(_course_figure(evidence, part, curves, ranges, say))
    rest = order[SHOWN_COURSES:]
    if len(rest):
        most = float(shares[rest[0]])
        if math.isfinite(most):
            others = say("none reaches more than {most:.1%} of one", "均不超过限值的 {most:.1%}", most=most)
        else:
            others = say("some were not measured", "有的未测得")
        words = say(
            "Shown are the {chosen} courses that come nearest to a limit; of the other {rest:,} {others}.",
            "所示为最接近限值的 {chosen} 个道次；其余 {rest:,} 个道次{others}。",
            chosen=len(chosen),
            rest=len(rest),
            others=others,
        )
        nodes.append(element("p", words, class_="note"))
    return nodes


def _scale(row: Quantity[Evidence]) -> float:
    """Return the factor from the samples' metres or radians to the row's unit."""
    return 1 / DEG if row.unit == "deg" else 1 / MM


def _curves(row: Quantity[Evidence], samples: Samples) -> list[PlotCurve]:
    """Return the curves of a quantity's plot over arc length, in its unit."""
    arcs = samples.arc_lengths / MM
    return [
        PlotCurve(style, arcs, getattr(samples, field) * _scale(row))
        for style, (_, field) in zip(STYLES, row.curves, strict=False)
    ]


def _course_figure(
    evidence: Evidence,
    part: slice,
    curves: dict[str, list[PlotCurve]],
    ranges: dict[str, tuple[float, float]],
    say: Say,
) -> Element:
    """Return the plots of one course's errors, captioned with its number and its worst place."""
    samples = evidence.samples
    number = evidence.tape.rows[int(samples.courses[part.start])].course
    arcs = samples.arc_lengths[part] / MM
    known = np.isfinite(arcs)
    nodes: list[Element] = []
    for place, row in enumerate(PLOTTED):
        limit = evidence.limits[row.key]
        down, across = divmod(place, PLOTS_A_LINE)
        panel = Panel(48 + 252 * across, 18 + 106 * down, 194, 70, extent(arcs[known]), ranges[row.key])
        lines = [PlotCurve(curve.style, arcs[known], curve.y[part][known]) for curve in curves[row.key]]
        names = [(f"{say.words(name)} ", style) for style, (name, _) in zip(STYLES, row.curves, strict=False)]
        nodes += panel.drawn(heading_of(*names, (row.unit, "")), lines, [-limit.value, limit.value], limit.judged)
    measured = known & np.all(
        [np.isfinite(curve.y[part]) for panel_curves in curves.values() for curve in panel_curves], axis=0
    )
    if np.all(measured):
        errors = samples.position_errors[part] / MM
        worst = int(np.argmax(errors))
        words = say(
            "{length:,.1f} mm; largest position error {error:.4f} mm at {at:,.1f} mm, x {x:,.1f}  y {y:,.1f} mm",
            "{length:,.1f} mm；最大位置误差 {error:.4f} mm，在 {at:,.1f} mm 处，x {x:,.1f}  y {y:,.1f} mm",
            length=arcs[-1],
            error=errors[worst],
            at=arcs[worst],
            x=samples.nips[part][worst, 0] / MM,
            y=samples.nips[part][worst, 1] / MM,
        )
    else:
        words = say(
            "{lost:,} of {all:,} samples were not measured and are not drawn",
            "{all:,} 个采样点中 {lost:,} 个未测得，未绘出",
            lost=np.sum(~measured),
            all=len(arcs),
        )
    caption = element("figcaption", element("b", say("Course {n}", "道次 {n}", n=number)), f"  {words}")
    return element(
        "figure",
        caption,
        svg(
            1016,
            106 * math.ceil(len(PLOTTED) / PLOTS_A_LINE),
            *nodes,
            label=say("Errors along course {n}", "道次 {n} 的误差", n=number),
        ),
    )
