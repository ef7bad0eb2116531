"""Page: the report to print and sign, as one HTML file with plots that needs no network."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from typing import Any
from xml.etree.ElementTree import Element, tostring

from tapelayer.reporting.drawing import element, px, svg, table
from tapelayer.reporting.failure_names import failure_name
from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.quantity import Group, Measured, Quantity, Row, quantities
from tapelayer.reporting.subject import product_of
from tapelayer.reporting.words import NOT_FINITE, NOT_JUDGED, Say, Words, plain, shown
from tapelayer.verification.axis_use import AxisUse
from tapelayer.verification.limits import Limits

# Most rows of a table; the page counts the rest.
SHOWN_ROWS = 200
STYLE = files("tapelayer.reporting").joinpath("page.css").read_text(encoding="utf-8")

Cells = list[Element | str]

PLACES = {
    "course": Words("course", "道次"),
    "pass": Words("pass", "喷涂道次"),
    "point": Words("point", "点"),
    "line": Words("line", "行"),
}


def document(report: dict[str, Any], verdict: Element, sections: Sequence[Element], say: Say, style: str = "") -> str:
    """Return the text of an HTML page for screens, light and dark, and for printing.

    Args:
        report: plain values; its subject gives the page's title.
        verdict: verdict in one line.
        sections: the other elements, in order.
        say: the language.
        style: more CSS.
    """
    subject = report["subject"]
    name = product_of(subject)["name"] or subject["sources"][0]["name"] or ""
    title = say("Verification of ", "校验报告：")
    header = element("header", element("h1", title, element("span", name, class_="name")), verdict)
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content="default-src 'none'; style-src 'unsafe-inline'"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", f"{title}{name}"),
        element("style", STYLE + style),
    )
    main = element("main", *_scrolled(sections))
    body = element("body", header, _contents(sections, say), main)
    page = element("html", head, body, lang=say("en", "zh-CN"))
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def _contents(sections: Sequence[Element], say: Say) -> Element:
    """Give the headings of the sections their places, and return the table of contents that leads to them."""
    headings = [node for node in sections if node.tag == "h2"]
    links = []
    for number, heading in enumerate(headings, 1):
        heading.set("id", f"section-{number}")
        links.append(element("li", element("a", "".join(heading.itertext()), href=f"#section-{number}")))
    return element("nav", element("ol", *links), aria_label=say("Contents", "目录"))


def _scrolled(sections: Sequence[Element]) -> Iterator[Element]:
    """Yield the sections, each table in a box that scrolls where it is wider than the page."""
    heading = ""
    for node in sections:
        if node.tag in ("h2", "h3"):
            heading = "".join(node.itertext())
        if node.tag == "table":
            yield element("div", node, class_="scroll", tabindex=0, role="group", aria_label=heading)
        else:
            yield node


def verdict(
    rows: Sequence[Row[Measured]],
    report: dict[str, Any],
    limits: Limits,
    parts: tuple[str, Words],
    not_judged: tuple[Words, ...],
    say: Say,
) -> Element:
    """Return the verdict in one line, naming quantities beyond a limit that is not judged.

    Args:
        rows: of the kind of machine.
        report: its plain values.
        limits: of the setup.
        parts: key of the number of courses or passes, and their name.
        not_judged: what the verdict does not cover.
        say: the language.
    """
    failures = report["failures"]
    free: Cells = [say("; ", "；"), element("span", sentence(not_judged, say), class_="free")] if not_judged else []
    if failures:
        words = say(
            "FAILED: {count:,} failure{s}, the first: {first}",
            "不合格：{count:,} 项，第一项：{first}",
            count=len(failures),
            s="s" if len(failures) > 1 else "",
            first=_sentence(failures[0], rows, say),
        )
        return element("p", words, *free, class_="verdict failed")
    every = all(limit.judged for limit in limits.values())
    position = next(row for row in quantities(rows) if row.key == "max_position_error_mm")
    words = say(
        "PASSED: {blocks:,} blocks over {count:,} {parts} keep {kept}; {name} {value}",
        "合格：{count:,} 个{parts}、{blocks:,} 个程序段符合{kept}；{name} {value}",
        blocks=report["blocks"],
        count=report[parts[0]],
        parts=say.words(parts[1]),
        kept=say("every limit", "全部限值") if every else say("every limit that is judged", "全部已判定的限值"),
        name=say.words(position.words),
        value=position.shown(report[position.key], say=say),
    )
    beyond = [
        f"{say.words(row.words)} {row.shown(report[row.key], say=say)}"
        for row in quantities(rows)
        if row.key in limits and not limits[row.key].judged and not limits[row.key].kept(report[row.key])
    ]
    if not beyond:
        return element("p", words, *free, class_="verdict passed")
    listed = say(", ", "、").join(beyond)
    words += say(". NOT JUDGED: {listed}", "。未作判定：{listed}", listed=listed)
    return element("p", words, *free, class_="verdict unjudged")


def _sentence(failure: dict[str, Any], rows: Sequence[Row[Measured]], say: Say) -> str:
    words, unit = failure_name(failure["what"], rows, say)
    place = "".join(
        f"{say.words(PLACES[key])} {failure[key]} " for key in (*_part_keys(failure), "point") if failure[key]
    )
    if failure["value"] is None:
        return place + say("{words} has no finite value", "{words} 无有限值", words=words)
    found = f"{place}{words} {say('is ', '')}{failure['value']:.6g} {unit}".rstrip()
    limit = failure["limit"]
    bound = "" if limit is None else say(", limit {limit}", "，限值 {limit}", limit=f"{limit:.6g} {unit}".rstrip())
    return found + bound


def _part_keys(failure: dict[str, Any]) -> list[str]:
    """Return the keys of a failure that number its course or pass: those before its point."""
    keys = list(failure)
    return keys[: keys.index("point")]


def facts(rows: Sequence[Row[Measured]], report: dict[str, Any], more: Sequence[tuple[str, str]], say: Say) -> Element:
    """Return the facts of a program as words and values, with further ones."""
    pairs = [(say.words(row.words), row.shown(report[row.key], say=say)) for row in quantities(rows, Group.FACT)]
    return element(
        "dl", *(element("div", element("dt", words), element("dd", value)) for words, value in [*pairs, *more])
    )


def failures_table(rows: Sequence[Row[Measured]], failures: Sequence[dict[str, Any]], say: Say) -> list[Element]:
    """Return the table of failures with their places; nothing where there are none."""
    if not failures:
        return []
    keys = [*_part_keys(failures[0]), "point", "line"]

    def cells(failure: dict[str, Any]) -> Cells:
        words, unit = failure_name(failure["what"], rows, say)
        places = [str(failure.get(key) or "") for key in keys]
        limit = "" if failure["limit"] is None else f"{failure['limit']:.6g} {unit}"
        return [*places, words, shown(failure["value"], unit, ".6g", say.words(NOT_FINITE)), limit]

    headings = (
        *(say.words(PLACES[key]) for key in keys),
        say("what", "项目"),
        say("found", "实测"),
        say("limit", "限值"),
    )
    return listing(say("Failures", "不合格项"), failures, cells, headings, say, class_="failures")


def listing(
    title: str,
    rows: Sequence[Any],
    cells: Callable[[Any], Cells],
    headings: Sequence[str],
    say: Say,
    class_: str = "",
) -> list[Element]:
    """Return a heading and a table of the first rows, with a count of the rest; nothing where there are no rows."""
    if not rows:
        return []
    nodes = [element("h2", title), table(headings, [cells(row) for row in rows[:SHOWN_ROWS]], class_=class_)]
    more = len(rows) - SHOWN_ROWS
    if more > 0:
        nodes.append(element("p", say("and {more:,} more", "另有 {more:,} 项", more=more), class_="note"))
    return nodes


def quantities_table(rows: Sequence[Row[Measured]], report: dict[str, Any], limits: Limits, say: Say) -> Element:
    """Return the table of quantities against their limits."""
    cells = [_quantity_cells(row, report[row.key], limits, say) for row in quantities(rows, Group.ERROR)]
    headings = (
        say("quantity", "量"),
        say("found", "实测"),
        say("unit", "单位"),
        say("limit", "限值"),
        say("of limit", "占限值"),
        say("share drawn", "占比图"),
    )
    return table(headings, cells, class_="numbers")


def _quantity_cells(row: Quantity[Measured], value: float | None, limits: Limits, say: Say) -> Cells:
    cells: Cells = [say.words(row.words), row.shown(value, with_unit=False, say=say), row.unit]
    limit = limits.get(row.key)
    if limit is None:
        return [*cells, "", element("span", say.words(NOT_JUDGED), class_="open") if row.optional else "", ""]
    # Of a limit of zero or less nothing is a share.
    drawn = limit.value > 0.0
    share = f"{value / limit.value:,.0%}" if value is not None and drawn else ""
    bar = range_bar(0.0, value, 0.0, limit.value, not limit.kept(value)) if drawn else ""
    bound = f"{say('at least ', '不小于 ') if limit.least else ''}{plain(limit.value)}"
    return [*cells, bound, share if limit.judged else f"{share}{say(', ', '，')}{say.words(NOT_JUDGED)}", bar]


def meanings(rows: Sequence[Row[Measured]], say: Say) -> list[Element]:
    """Return the table of what the quantities mean."""
    cells: list[Cells] = [[say.words(row.words), say.words(row.about).replace("`", "")] for row in quantities(rows)]
    heading = element("h2", say("What the quantities mean", "各量的含义"))
    return [heading, table((say("quantity", "量"), say("meaning", "含义")), cells, class_="subject")]


def axes_table(axes: Sequence[AxisUse], report: dict[str, Any], say: Say) -> Element:
    """Return the table of travel, top speed, acceleration and jerk of every axis.

    Args:
        axes: in the order of the machine.
        report: plain values, with `axes` and `failures`.
        say: the language.
    """
    # A speed may exceed its limit by the last digit of a feed word, so verification decides what is red.
    failed = {failure["what"] for failure in report["failures"]}
    absent, none = say("not measured", "未测得"), say("none stated", "未给出")
    rows: list[Cells] = []
    for axis in axes:
        use = report["axes"][axis.name]
        travel, speed, *_ = axis.failures
        rows.append(
            [
                axis.name,
                use["unit"],
                *(shown(use[key], "", "z,.2f", absent) for key in ("min", "max")),
                say("{low} to {high}", "{low} 至 {high}", low=plain(use["lower"]), high=plain(use["upper"])),
                shown(use["margin"], "", "z,.2f", absent),
                range_bar(use["min"], use["max"], use["lower"], use["upper"], travel in failed),
                shown(use["max_speed"], "", "z,.2f", absent),
                plain(use["speed_limit"]),
                range_bar(0.0, use["max_speed"], 0.0, use["speed_limit"], speed in failed),
                shown(use["max_acceleration"], "", "z,.0f", absent),
                none if use["acceleration_limit"] is None else plain(use["acceleration_limit"]),
                shown(use["max_jerk"], "", "z,.0f", absent),
                none if use["jerk_limit"] is None else plain(use["jerk_limit"]),
            ]
        )
    headings = (
        say("axis", "轴"),
        say("unit", "单位"),
        say("least", "最小"),
        say("greatest", "最大"),
        say("travel", "行程"),
        say("margin", "余量"),
        say("travel drawn", "行程图"),
        say("top speed /s", "最高速度 /s"),
        say("limit /s", "限值 /s"),
        say("speed drawn", "速度图"),
        say("top acceleration /s²", "最高加速度 /s²"),
        say("limit /s²", "限值 /s²"),
        say("top jerk /s³", "最高加加速度 /s³"),
        say("limit /s³", "限值 /s³"),
    )
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


def signatures(say: Say) -> Element:
    """Return the lines on which a printed report is signed."""
    fields = (say("Prepared by", "编制"), say("Checked by", "校核"), say("Released by", "批准"), say("Date", "日期"))
    return element("footer", *(element("div", words) for words in fields))
