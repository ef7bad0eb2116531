"""Plots of a page: errors along the courses, axis positions and speeds over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.laying.evidence import Evidence, Samples
from tapelayer.laying.quantities import limits_of
from tapelayer.laying.settings import Setup
from tapelayer.reporting.drawing import Panel, PlotCurve, element, extent, heading_of, range_of, svg
from tapelayer.units import DEG, MM

# Courses with plots of their own; beyond them the page gives a count.
SHOWN_COURSES = 40


def course_plots(evidence: Evidence, setup: Setup) -> list[Element]:
    """Errors along the courses; where they are many, the ones that come nearest to a limit."""
    samples = evidence.samples
    if not len(samples.courses):
        return [element("p", "Nothing was measured along the courses.", class_="note")]
    limits = limits_of(setup)
    signed = {
        "max_position_error_mm": samples.position_errors / MM,
        "max_roller_tilt_deg": samples.tilts / DEG,
        "max_heading_error_deg": samples.heading_errors / DEG,
        "max_tape_error_mm": samples.tape_errors / MM,
    }
    starts = np.unique(samples.courses, return_index=True)[1]
    shares = np.max(
        [np.maximum.reduceat(np.abs(values), starts) / limits[key][0] for key, values in signed.items()], axis=0
    )
    shares = np.where(np.isfinite(shares), shares, np.inf)
    order = np.argsort(-shares, kind="stable")
    shown = np.sort(order[:SHOWN_COURSES])
    curves = _errors(samples)
    ranges = [range_of([curve for curve in panel], [-limits[key][0], limits[key][0]]) for key, panel in curves.items()]
    ends = np.append(starts[1:], len(samples.courses))
    nodes = [
        element(
            "p",
            "Over arc length in mm; the scale of errors is one for all courses. Dashed: limits of the setup"
            + ("" if all(judged for _, judged in limits.values()) else " (grey: not judged)")
            + "; the one of position holds for normal and lateral together.",
            class_="note",
        )
    ]
    for row in shown:
        part = slice(int(starts[row]), int(ends[row]))
        nodes.append(_course_figure(evidence, part, curves, ranges, limits))
    rest = order[SHOWN_COURSES:]
    if len(rest):
        most = float(shares[rest[0]])
        nodes.append(
            element(
                "p",
                f"Shown are the {len(shown)} courses that come nearest to a limit; of the other {len(rest):,} "
                + (f"none reaches more than {most:.1%} of one." if math.isfinite(most) else "some were not measured."),
                class_="note",
            )
        )
    return nodes


def _errors(samples: Samples) -> dict[str, list[PlotCurve]]:
    """Lines of the four plots of errors over arc length, millimetres and degrees."""
    arcs = samples.arc_lengths / MM
    return {
        "max_position_error_mm": [
            PlotCurve("first", arcs, samples.normal_errors / MM),
            PlotCurve("second", arcs, samples.lateral_errors / MM),
        ],
        "max_roller_tilt_deg": [PlotCurve("first", arcs, samples.tilts / DEG)],
        "max_heading_error_deg": [PlotCurve("first", arcs, samples.heading_errors / DEG)],
        "max_tape_error_mm": [PlotCurve("first", arcs, samples.tape_errors / MM)],
    }


def _course_figure(
    evidence: Evidence,
    part: slice,
    curves: dict[str, list[PlotCurve]],
    ranges: Sequence[tuple[float, float]],
    limits: dict[str, tuple[float, bool]],
) -> Element:
    """One course's errors: four plots in a row under its number and its worst place."""
    samples = evidence.samples
    number = evidence.tape.rows[int(samples.courses[part.start])].course
    arcs = samples.arc_lengths[part] / MM
    placed = np.isfinite(arcs)
    headings = {
        "max_position_error_mm": heading_of(("normal ", "first"), ("lateral ", "second"), ("mm", "")),
        "max_roller_tilt_deg": heading_of(("tilt ", "first"), ("deg", "")),
        "max_heading_error_deg": heading_of(("heading ", "first"), ("deg", "")),
        "max_tape_error_mm": heading_of(("tape ", "first"), ("mm", "")),
    }
    nodes: list[Element] = []
    for column, (key, heading) in enumerate(headings.items()):
        limit, judged = limits[key]
        panel = Panel(48 + 252 * column, 18, 194, 70, extent(arcs[placed]), ranges[column])
        lines = [PlotCurve(curve.style, arcs[placed], curve.y[part][placed]) for curve in curves[key]]
        nodes += panel.drawn(heading, lines, [-limit, limit], judged)
    measured = placed & np.all(
        [np.isfinite(curve.y[part]) for panel_curves in curves.values() for curve in panel_curves], axis=0
    )
    if np.all(measured):
        errors = samples.position_errors[part] / MM
        worst = int(np.argmax(errors))
        told = (
            f"{arcs[-1]:,.1f} mm; largest position error {errors[worst]:.4f} mm at {arcs[worst]:,.1f} mm, "
            f"x {samples.nips[part][worst, 0] / MM:,.1f}  y {samples.nips[part][worst, 1] / MM:,.1f} mm"
        )
    else:
        told = f"{np.sum(~measured):,} of {len(arcs):,} samples were not measured and are not drawn"
    caption = element("figcaption", element("b", f"Course {number}"), f"  {told}")
    return element("figure", caption, svg(1016, 106, *nodes, label=f"Errors along course {number}"))
