"""Page on a spraying program: the report to print and sign, as one HTML file that asks the network for nothing."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, tostring

from tapelayer.motion.trajectory import Trajectory
from tapelayer.reporting.axis_plots import axis_plots
from tapelayer.reporting.drawing import element, table
from tapelayer.reporting.page import STYLE
from tapelayer.reporting.words import plain, shown, worded
from tapelayer.spraying.plan_view import coat_plots, plan_view
from tapelayer.spraying.report import FACTS, QUANTITIES, Judged, numbers
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM

# Failures, splits and slow places in the page; beyond them it gives a count.
SHOWN_ROWS = 100
# Ways lie on the coat's colours.
WAYS = ".line.way { stroke: var(--ink); stroke-width: 0.6px; opacity: 0.55; }\n"


def html(judged: Judged, trajectory: Trajectory, setup: SpraySetup, title: str) -> str:
    """The report as one HTML page with plots, light and dark, to be printed.

    Args:
        judged: the program, judged.
        trajectory: the program.
        setup: the job's values, for the limits.
        title: of the report, as the program is called.
    """
    report = numbers(judged)
    # A file name may hold bytes that are no text; they are shown as escapes.
    name = title.encode(errors="backslashreplace").decode()
    body = [
        element("header", element("h1", "Verification of ", element("span", name, class_="name")), _verdict(report)),
        _facts(report, setup),
        *_rows("Failures", report["failures"], _failure, ("pass", "point", "line", "what", "found", "limit")),
        element("h2", "Plan view"),
        *plan_view(judged.plan, judged.coat),
        *_coat(judged),
        element("h2", "Largest errors"),
        _quantities(report, setup),
        *_surface(report),
        *_rows("Splits", report["splits"], _split, ("pass", "x mm", "y mm", "z mm", "reason")),
        *_rows("Slow places", report["slowdowns"], _slow, ("pass", "x mm", "y mm", "z mm", "axis", "gun mm/s")),
        element("h2", "Axis positions and speeds"),
        *axis_plots(judged.evidence.axes, trajectory),
        element("footer", *(element("div", words) for words in ("Prepared by", "Checked by", "Released by", "Date"))),
    ]
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content="default-src 'none'; style-src 'unsafe-inline'"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", f"Verification of {name}"),
        element("style", STYLE + WAYS),
    )
    page = element("html", head, element("body", *body), lang="en")
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def _coat(judged: Judged) -> list[Element]:
    if judged.coat is None:
        return []
    return [element("h2", "Thickness of the coat"), *coat_plots(judged.plan, judged.coat)]


def _verdict(report: dict[str, Any]) -> Element:
    failures = report["failures"]
    if failures:
        first = " ".join(_failure(failures[0])).strip()
        words = f"FAILED: {len(failures):,} failure{'s' if len(failures) > 1 else ''}, the first: {first}"
        return element("p", words, class_="verdict failed")
    words = f"PASSED: {report['blocks']:,} blocks over {report['passes']:,} passes keep every limit"
    return element("p", words, class_="verdict passed")


def _facts(report: dict[str, Any], setup: SpraySetup) -> Element:
    facts = [(words, shown(report[key], unit, form)) for key, words, unit, form in FACTS]
    facts += [
        ("process", "; ".join(setup.process.notes()).removeprefix("process ")),
        ("standoff", f"{plain(setup.standoff / MM)} mm"),
        ("controller", setup.output.controller.encode(errors="backslashreplace").decode()),
        ("tapelayer", report["version"]),
        ("SHA-256 of the program", report["program_sha256"]),
    ]
    return element("dl", *(element("div", element("dt", words), element("dd", value)) for words, value in facts))


def _quantities(report: dict[str, Any], setup: SpraySetup) -> Element:
    limits = {
        "max_position_error_mm": setup.verification.max_position_error_mm,
        "max_surface_distance_mm": setup.spray.chord_tolerance_mm + setup.verification.max_position_error_mm,
        "max_deviation_deg": setup.spray.max_deviation_deg,
    }
    rows = [
        [words, shown(report[key], "", form, "none"), unit, plain(limits[key]) if key in limits else ""]
        for key, words, unit, form in QUANTITIES
    ]
    return table(("quantity", "found", "", "limit"), rows, class_="numbers")


def _surface(report: dict[str, Any]) -> list[Element]:
    """What was mended in the model, and what of its surface is out of reach."""
    mesh = report["mesh"]
    rows = [[words.replace("_", " "), f"{count:,}"] for words, count in mesh["mended"].items() if count]
    rows += [[f"out of reach: {area['reason']}", f"{area['area_m2']:.4f} m2"] for area in report["unreachable"]]
    rows.insert(0, ["facets", f"{mesh['facets']:,}"])
    return [element("h2", "Surface"), table(("of the model", ""), rows, class_="numbers")]


def _rows(title: str, found: list[dict[str, Any]], row: Any, headings: tuple[str, ...]) -> list[Element]:
    if not found:
        return []
    nodes = [element("h2", title), table(headings, [row(one) for one in found[:SHOWN_ROWS]])]
    more = len(found) - SHOWN_ROWS
    if more > 0:
        nodes.append(element("p", f"and {more:,} more", class_="note"))
    return nodes


def _failure(failure: dict[str, Any]) -> list[str]:
    words, unit = worded(failure["what"])
    limit = "" if failure["limit"] is None else f"{failure['limit']:.6g} {unit}"
    places = [str(failure.get(key) or "") for key in ("pass", "point", "line")]
    return [*places, words, shown(failure["value"], unit, ".6g", "no finite value"), limit]


def _split(split: dict[str, Any]) -> list[str]:
    return [str(split["pass"]), *_place(split), split["reason"] or "not planned"]


def _slow(slow: dict[str, Any]) -> list[str]:
    return [str(slow["pass"]), *_place(slow), slow["axis"], f"{slow['speed_mm_per_s']:.1f}"]


def _place(found: dict[str, Any]) -> list[str]:
    return [f"{found[f'{name}_mm']:.1f}" for name in "xyz"]
