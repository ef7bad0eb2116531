"""Page: the HTML report of a spraying program."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from tapelayer.motion.trajectory import Trajectory
from tapelayer.reporting.axis_plots import axis_plots
from tapelayer.reporting.drawing import element, table
from tapelayer.reporting.page import (
    Cells,
    axes_table,
    document,
    facts,
    failures_table,
    listing,
    printable,
    quantities_table,
    signatures,
    verdict,
)
from tapelayer.spraying.plan_view import coat_plots, plan_view
from tapelayer.spraying.quantities import ROWS, Judged
from tapelayer.spraying.settings import SpraySetup

# The paths of the passes are drawn thin, over the coat's colours.
PATHS = ".line.way { stroke: var(--ink); stroke-width: 0.6px; opacity: 0.55; }\n"


def html(judged: Judged, trajectory: Trajectory, report: dict[str, Any], setup: SpraySetup, title: str) -> str:
    """Return the report as one HTML page with plots, for light, dark and print.

    Args:
        judged: the evidence on the program, and its coat.
        trajectory: the program.
        report: its report as plain values.
        setup: the job's values.
        title: title of the report, the program's name.
    """
    limits = judged.evidence.limits
    more = [
        ("process", "; ".join(setup.process.notes()).removeprefix("process ")),
        ("controller", printable(setup.output.controller)),
    ]
    coat = (
        [] if judged.coat is None else [element("h2", "Thickness of the coat"), *coat_plots(judged.plan, judged.coat)]
    )
    sections = [
        facts(ROWS, report, more),
        *failures_table(report["failures"]),
        element("h2", "Plan view"),
        *plan_view(judged.plan, judged.coat),
        *coat,
        element("h2", "Largest errors"),
        quantities_table(ROWS, report, limits),
        element("h2", "Axes"),
        axes_table(judged.evidence.axes, report),
        *_surface(report),
        *listing("Splits", report["splits"], _split, ("pass", "x mm", "y mm", "z mm", "reason")),
        *listing("Slow places", report["slowdowns"], _slow, ("pass", "x mm", "y mm", "z mm", "axis", "gun mm/s")),
        element("h2", "Axis positions and speeds"),
        *axis_plots(judged.evidence.axes, trajectory),
        signatures(),
    ]
    return document(title, verdict(ROWS, report, limits, "passes"), sections, PATHS)


def surface_facts(report: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the mended faults of the model and the areas out of reach, each as words and a value."""
    pairs = [(f"out of reach: {area['reason']}", f"{area['area_m2']:.4f} m2") for area in report["unreachable"]]
    pairs.append(("splits", str(len(report["splits"]))))
    mended = report["mesh"]["mended"]
    return [*pairs, *((words.replace("_", " "), f"{count:,}") for words, count in mended.items() if count)]


def _surface(report: dict[str, Any]) -> list[Element]:
    rows: list[Cells] = [["facets", f"{report['mesh']['facets']:,}"]]
    rows += [[words, value] for words, value in surface_facts(report)]
    return [element("h2", "Surface"), table(("of the model", ""), rows, class_="numbers")]


def _split(split: dict[str, Any]) -> Cells:
    return [str(split["pass"]), *_place(split), split["reason"] or "not planned"]


def _slow(slow: dict[str, Any]) -> Cells:
    return [str(slow["pass"]), *_place(slow), slow["axis"], f"{slow['speed_mm_per_s']:.1f}"]


def _place(place: dict[str, Any]) -> list[str]:
    return [f"{place[f'{axis}_mm']:.1f}" for axis in "xyz"]
