"""Page: the report to print and sign, as one HTML file with plots that asks the network for nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, tostring

from tapelayer.laying.error_plots import course_plots
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.plan_view import plan_view
from tapelayer.laying.quantities import FACTS, QUANTITIES, absent, limits_of
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_view import tape_view
from tapelayer.motion.trajectory import Trajectory
from tapelayer.reporting.axis_plots import axis_plots
from tapelayer.reporting.drawing import element, table
from tapelayer.reporting.page import STYLE, axes_table, range_bar, signatures
from tapelayer.reporting.words import plain, shown, worded

# Failures in the page; beyond them it gives a count.
SHOWN_FAILURES = 200


def html(evidence: Evidence, trajectory: Trajectory, report: dict[str, Any], setup: Setup, title: str) -> str:
    """The report as one HTML page with plots, light and dark, to be printed.

    Args:
        evidence: what verification measured.
        trajectory: the program that was judged.
        report: `numbers` of the evidence.
        setup: the job's values, for the limits.
        title: of the report, as the program is called.
    """
    # A file name may hold bytes that are no text; they are shown as escapes.
    name = title.encode(errors="backslashreplace").decode()
    body = [
        element(
            "header", element("h1", "Verification of ", element("span", name, class_="name")), _verdict(report, setup)
        ),
        _facts(report, setup),
        *_failures(report["failures"]),
        element("h2", "Largest errors"),
        _quantities(report, setup),
        element("h2", "Axes"),
        axes_table(evidence.axes, report),
        signatures(),
        element("h2", "Plan view"),
        *plan_view(evidence, setup),
        element("h2", "Tape"),
        *tape_view(evidence, report, setup),
        element("h2", "Errors along the courses"),
        *course_plots(evidence, setup),
        element("h2", "Axis positions and speeds"),
        *axis_plots(evidence.axes, trajectory),
    ]
    page = element(
        "html",
        element(
            "head",
            element("meta", charset="utf-8"),
            element(
                "meta",
                http_equiv="Content-Security-Policy",
                content="default-src 'none'; style-src 'unsafe-inline'",
            ),
            element("meta", name="viewport", content="width=device-width, initial-scale=1"),
            element("title", f"Verification of {name}"),
            element("style", STYLE),
        ),
        element("body", *body),
        lang="en",
    )
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def _verdict(report: dict[str, Any], setup: Setup) -> Element:
    """The verdict in one line; what is not judged and beyond its limit is said in it."""
    failures = report["failures"]
    if failures:
        words = f"FAILED: {len(failures):,} failure{'s' if len(failures) > 1 else ''}, the first: {_told(failures[0])}"
        return element("p", words, class_="verdict failed")
    limits = limits_of(setup)
    kept = "every limit" if all(judged for _, judged in limits.values()) else "every limit that is judged"
    words = f"PASSED: {report['blocks']:,} blocks over {report['courses']:,} courses keep {kept}"
    words += f"; position error {shown(report['max_position_error_mm'], 'mm', 'z.4f')}"
    beyond = [
        f"{name} {shown(report[key], unit, form)}"
        for key, name, unit, form in QUANTITIES
        if key in limits and not limits[key][1] and not report[key] <= limits[key][0]
    ]
    if not beyond:
        return element("p", words, class_="verdict passed")
    return element("p", f"{words}. NOT JUDGED: {', '.join(beyond)}", class_="verdict unjudged")


def _told(failure: dict[str, Any]) -> str:
    words, unit = worded(failure["what"])
    place = "".join(f"{key} {failure[key]} " for key in ("course", "point") if failure[key])
    if failure["value"] is None:
        return f"{place}{words} has no finite value"
    limit = "" if failure["limit"] is None else f", limit {failure['limit']:.6g} {unit}"
    return f"{place}{words} is {failure['value']:.6g} {unit}".rstrip() + limit.rstrip()


def _facts(report: dict[str, Any], setup: Setup) -> Element:
    facts = [(words, shown(report[key], unit, form)) for key, words, unit, form in FACTS]
    shares = report["time_shares"]
    facts += [
        ("time " + ", ".join(shares), ", ".join(shown(share, "%", "z.1f") for share in shares.values())),
        ("kinematics", setup.process.kinematics),
        ("controller", setup.output.controller.encode(errors="backslashreplace").decode()),
        ("tapelayer", report["version"]),
        ("SHA-256 of the program", report["program_sha256"]),
    ]
    return element("dl", *(element("div", element("dt", words), element("dd", value)) for words, value in facts))


def _failures(failures: Sequence[dict[str, Any]]) -> list[Element]:
    if not failures:
        return []
    rows = []
    for failure in failures[:SHOWN_FAILURES]:
        words, unit = worded(failure["what"])
        places = [str(failure.get(key) or "") for key in ("course", "point", "line")]
        limit = "" if failure["limit"] is None else f"{failure['limit']:.6g} {unit}"
        rows.append([*places, words, shown(failure["value"], unit, ".6g", "no finite value"), limit])
    nodes = [
        element("h2", "Failures"),
        table(("course", "point", "line", "what", "found", "limit"), rows, class_="failures"),
    ]
    more = len(failures) - SHOWN_FAILURES
    if more > 0:
        nodes.append(element("p", f"and {more:,} more failure{'s' if more > 1 else ''}", class_="note"))
    return nodes


def _quantities(report: dict[str, Any], setup: Setup) -> Element:
    limits = limits_of(setup)
    rows: list[list[Element | str]] = []
    for key, words, unit, form in QUANTITIES:
        value = report[key]
        row: list[Element | str] = [words, shown(value, "", form, absent(key)), unit]
        if key in limits:
            limit, judged = limits[key]
            share = "" if value is None else f"{value / limit:,.0%}"
            bar = range_bar(0.0, value, 0.0, limit, value is None or value > limit)
            row += [plain(limit), share if judged else f"{share}, not judged", bar]
        else:
            row += ["at least 0" if key == "least_link_clearance_mm" else "", "", ""]
        rows.append(row)
    return table(("quantity", "found", "", "limit", "of limit", ""), rows, class_="numbers")
