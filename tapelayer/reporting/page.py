"""Page: what the HTML reports of all machines are made of."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any
from xml.etree.ElementTree import Element

from tapelayer.reporting.drawing import element, px, svg, table
from tapelayer.reporting.words import plain, shown
from tapelayer.verification.axis_use import AxisUse

STYLE = files("tapelayer.reporting").joinpath("page.css").read_text(encoding="utf-8")


def axes_table(axes: Sequence[AxisUse], report: dict[str, Any]) -> Element:
    """Return the table of travel and top speed of every axis, as the report has them.

    Args:
        axes: in the order of the machine.
        report: plain values, with `axes` and `failures`.
    """
    # A speed may exceed its limit by the last digit of a feed word: what is red is verification's to say.
    failed = {failure["what"] for failure in report["failures"]}
    rows: list[list[Element | str]] = []
    for axis in axes:
        found = report["axes"][axis.name]
        travel, speed = axis.failures
        rows.append(
            [
                axis.name,
                found["unit"],
                *(shown(found[key], "", "z,.2f") for key in ("min", "max")),
                f"{plain(found['lower'])} to {plain(found['upper'])}",
                shown(found["margin"], "", "z,.2f"),
                range_bar(found["min"], found["max"], found["lower"], found["upper"], travel in failed),
                shown(found["max_speed"], "", "z,.2f"),
                plain(found["speed_limit"]),
                range_bar(0.0, found["max_speed"], 0.0, found["speed_limit"], speed in failed),
            ]
        )
    headings = ("axis", "", "least", "greatest", "travel", "margin", "", "top speed /s", "limit /s", "")
    return table(headings, rows, class_="axes")


def range_bar(begin: float | None, end: float | None, low: float, high: float, failed: bool) -> Element:
    """A range within its bounds as a small bar, red where it failed."""
    width = 90.0
    drawing = svg(width, 9, element("rect", class_="track", x=0, y=1.5, width=width, height=6))
    if begin is not None and end is not None:
        left, right = (min(max((value - low) / (high - low), 0.0), 1.0) * width for value in (begin, end))
        left = min(left, width - 1)
        style = "used beyond" if failed else "used"
        drawing.append(element("rect", class_=style, x=px(left), y=1.5, width=px(max(right - left, 1.0)), height=6))
    drawing.set("class", "bar")
    return drawing


def signatures() -> Element:
    """Return the lines on which a printed report is signed."""
    fields = (element("div", words) for words in ("Prepared by", "Checked by", "Released by", "Date"))
    return element("footer", *fields)
