"""Page: the report to print and sign, as one HTML file with plots that needs no network."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import Any
from xml.etree.ElementTree import Element, tostring

from tapelayer.reporting.drawing import element, px, svg, table
from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.quantity import Group, Measured, Quantity, Row, quantities
from tapelayer.reporting.words import plain, shown, worded
from tapelayer.verification.axis_use import AxisUse
from tapelayer.verification.limits import Limits

# Most rows of a table; the page counts the rest.
SHOWN_ROWS = 200
STYLE = files("tapelayer.reporting").joinpath("page.css").read_text(encoding="utf-8")

Cells = list[Element | str]


def document(title: str, verdict: Element, sections: Sequence[Element], style: str = "") -> str:
    """Return the text of an HTML page for screens, light and dark, and for printing.

    Args:
        title: name of the program.
        verdict: verdict in one line.
        sections: the other elements, in order.
        style: more CSS.
    """
    # A file name may hold bytes that are not text; they are shown as escapes.
    name = printable(title)
    header = element("header", element("h1", "Verification of ", element("span", name, class_="name")), verdict)
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content="default-src 'none'; style-src 'unsafe-inline'"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", f"Verification of {name}"),
        element("style", STYLE + style),
    )
    page = element("html", head, element("body", header, *sections), lang="en")
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def printable(name: str) -> str:
    r"""Return a file name with the bytes that are no text as escapes.

    Examples:
        >>> printable("panel\udcff.nc")
        'panel\\udcff.nc'
    """
    return name.encode(errors="backslashreplace").decode()


def verdict(rows: Sequence[Row[Measured]], report: dict[str, Any], limits: Limits, parts: str) -> Element:
    """Return the verdict in one line, naming quantities beyond a limit that is not judged.

    Args:
        rows: of the kind of machine.
        report: its plain values.
        limits: of the setup.
        parts: key of the number of courses or passes.
    """
    failures = report["failures"]
    if failures:
        first = _sentence(failures[0])
        words = f"FAILED: {len(failures):,} failure{'s' if len(failures) > 1 else ''}, the first: {first}"
        return element("p", words, *_free(report), class_="verdict failed")
    kept = "every limit" if all(limit.judged for limit in limits.values()) else "every limit that is judged"
    words = f"PASSED: {report['blocks']:,} blocks over {report[parts]:,} {parts} keep {kept}"
    position = next(row for row in quantities(rows) if row.key == "max_position_error_mm")
    words += f"; {position.words.en} {position.shown(report[position.key])}"
    beyond = [
        f"{row.words.en} {row.shown(report[row.key])}"
        for row in quantities(rows)
        if row.key in limits and not limits[row.key].judged and not limits[row.key].kept(report[row.key])
    ]
    if not beyond:
        return element("p", words, *_free(report), class_="verdict passed")
    return element("p", f"{words}. NOT JUDGED: {', '.join(beyond)}", *_free(report), class_="verdict unjudged")


def _free(report: dict[str, Any]) -> list[Element | str]:
    """Return what no verdict on the program covers, to stand beside it; nothing if there is none."""
    names = report["not_judged"]
    return ["; ", element("span", sentence(names), class_="free")] if names else []


def _sentence(failure: dict[str, Any]) -> str:
    words, unit = worded(failure["what"])
    place = "".join(f"{key} {failure[key]} " for key in (*_part_keys(failure), "point") if failure[key])
    if failure["value"] is None:
        return f"{place}{words} has no finite value"
    limit = "" if failure["limit"] is None else f", limit {failure['limit']:.6g} {unit}"
    return f"{place}{words} is {failure['value']:.6g} {unit}".rstrip() + limit.rstrip()


def _part_keys(failure: dict[str, Any]) -> list[str]:
    """Return the keys of a failure that number its course or pass: those before its point."""
    keys = list(failure)
    return keys[: keys.index("point")]


def facts(rows: Sequence[Row[Measured]], report: dict[str, Any], more: Sequence[tuple[str, str]]) -> Element:
    """Return the facts of a program as words and values, with further ones."""
    pairs = [(row.words.en, row.shown(report[row.key])) for row in quantities(rows, Group.FACT)]
    pairs += [*more, ("tapelayer", report["version"]), ("SHA-256 of the program", report["program_sha256"])]
    return element("dl", *(element("div", element("dt", words), element("dd", value)) for words, value in pairs))


def failures_table(failures: Sequence[dict[str, Any]]) -> list[Element]:
    """Return the table of failures with their places; nothing where there are none."""
    if not failures:
        return []
    keys = [*_part_keys(failures[0]), "point", "line"]

    def cells(failure: dict[str, Any]) -> Cells:
        words, unit = worded(failure["what"])
        places = [str(failure.get(key) or "") for key in keys]
        limit = "" if failure["limit"] is None else f"{failure['limit']:.6g} {unit}"
        return [*places, words, shown(failure["value"], unit, ".6g", "no finite value"), limit]

    return listing("Failures", failures, cells, (*keys, "what", "found", "limit"), class_="failures")


def listing(
    title: str, rows: Sequence[Any], cells: Callable[[Any], Cells], headings: Sequence[str], class_: str = ""
) -> list[Element]:
    """Return a heading and a table of the first rows, with a count of the rest; nothing where there are no rows."""
    if not rows:
        return []
    nodes = [element("h2", title), table(headings, [cells(row) for row in rows[:SHOWN_ROWS]], class_=class_)]
    more = len(rows) - SHOWN_ROWS
    if more > 0:
        nodes.append(element("p", f"and {more:,} more", class_="note"))
    return nodes


def quantities_table(rows: Sequence[Row[Measured]], report: dict[str, Any], limits: Limits) -> Element:
    """Return the table of quantities against their limits."""
    cells = [_quantity_cells(row, report[row.key], limits) for row in quantities(rows, Group.ERROR)]
    return table(("quantity", "found", "", "limit", "of limit", ""), cells, class_="numbers")


def _quantity_cells(row: Quantity[Measured], value: float | None, limits: Limits) -> Cells:
    cells: Cells = [row.words.en, row.shown(value, with_unit=False), row.unit]
    limit = limits.get(row.key)
    if limit is None:
        return [*cells, "", element("span", "not judged", class_="open") if row.optional else "", ""]
    share = "" if value is None else f"{value / limit.value:,.0%}"
    bar = range_bar(0.0, value, 0.0, limit.value, not limit.kept(value))
    bound = f"{'at least ' if limit.least else ''}{plain(limit.value)}"
    return [*cells, bound, share if limit.judged else f"{share}, not judged", bar]


def axes_table(axes: Sequence[AxisUse], report: dict[str, Any]) -> Element:
    """Return the table of travel and top speed of every axis.

    Args:
        axes: in the order of the machine.
        report: plain values, with `axes` and `failures`.
    """
    # A speed may exceed its limit by the last digit of a feed word, so verification decides what is red.
    failed = {failure["what"] for failure in report["failures"]}
    rows: list[Cells] = []
    for axis in axes:
        use = report["axes"][axis.name]
        travel, speed, _ = axis.failures
        rows.append(
            [
                axis.name,
                use["unit"],
                *(shown(use[key], "", "z,.2f") for key in ("min", "max")),
                f"{plain(use['lower'])} to {plain(use['upper'])}",
                shown(use["margin"], "", "z,.2f"),
                range_bar(use["min"], use["max"], use["lower"], use["upper"], travel in failed),
                shown(use["max_speed"], "", "z,.2f"),
                plain(use["speed_limit"]),
                range_bar(0.0, use["max_speed"], 0.0, use["speed_limit"], speed in failed),
            ]
        )
    headings = ("axis", "", "least", "greatest", "travel", "margin", "", "top speed /s", "limit /s", "")
    return table(headings, rows, class_="axes")


def range_bar(begin: float | None, end: float | None, low: float, high: float, failed: bool) -> Element:
    """Return a small bar of a range within its bounds, red if it failed."""
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
