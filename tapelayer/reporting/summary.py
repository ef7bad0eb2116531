"""Summary: the report as a table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.quantity import Group, Measured, Quantity, Row, open_words, quantities
from tapelayer.reporting.words import ENGLISH, NOT_JUDGED, Say, Words, plain, shown
from tapelayer.verification.limits import Limit, Limits


def summary(
    rows: Sequence[Row[Measured]],
    report: dict[str, Any],
    limits: Limits,
    not_judged: tuple[Words, ...],
    listed: Sequence[tuple[str, str]] = (),
    say: Say = ENGLISH,
) -> Table:
    """Return the table of a report.

    Args:
        rows: of the kind of machine.
        report: its plain values.
        limits: of the setup.
        not_judged: what no verdict covers.
        listed: more facts, words and value.
        say: the language.
    """
    passed, absent = report["passed"], say("not measured", "未测得")
    title = Text(say("passed", "合格"), "bold green") if passed else Text(say("FAILED", "不合格"), "bold red")
    words = Text(say("Verification: ", "校验："))
    table = Table(title=words.append_text(title), title_justify="left", title_style="")
    if uncovered := open_words(rows, limits, not_judged):
        table.caption, table.caption_justify = Text(sentence(uncovered, say), "yellow"), "left"
    table.add_column(say("quantity", "量"))
    axes = report.get("axes", {})
    speeds = (say("top speed /s", "最高速度 /s"),) if axes else ()
    for heading in (say("value", "实测"), say("limit", "限值"), *speeds):
        table.add_column(heading, justify="right")
    for row in quantities(rows, Group.FACT):
        table.add_row(*_cells(row, report, limits.get(row.key), say))
    for name, value in listed:
        table.add_row(name, value)
    table.add_section()
    for row in quantities(rows, Group.ERROR):
        table.add_row(*_cells(row, report, limits.get(row.key), say))
    table.add_section()
    to = say(" to ", " 至 ")
    for name, axis in axes.items():
        table.add_row(
            Text(say("axis {name}, {unit}", "{name} 轴，{unit}", name=name, unit=axis["unit"])),
            to.join(shown(axis[key], "", "z.2f", absent) for key in ("min", "max")),
            to.join(plain(axis[key]) for key in ("lower", "upper")),
            f"{shown(axis['max_speed'], '', 'z.1f', absent)}{say(' of ', ' / ')}{plain(axis['speed_limit'])}",
        )
    if report["failures"]:
        table.add_section()
        table.add_row(say("failures", "不合格项"), Text(f"{len(report['failures']):,}", "bold red"), "0")
    return table


def _cells(row: Quantity[Measured], report: dict[str, Any], limit: Limit | None, say: Say) -> tuple[str, str, str]:
    """Return the words, value and limit of a quantity."""
    name, value = say.words(row.words), row.shown(report[row.key], say=say)
    if limit is None:
        return name, value, say.words(NOT_JUDGED) if row.optional else ""
    bound = f"{say('at least ', '不小于 ') if limit.least else ''}{plain(limit.value)} {row.unit}".rstrip()
    return name, value, bound if limit.judged else f"{bound}{say(', ', '，')}{say.words(NOT_JUDGED)}"


def explained(rows: Sequence[Row[Measured]], limits: Limits, say: Say = ENGLISH) -> Table:
    """Return the table of what a kind reports: key, words, unit, limit and meaning.

    Args:
        rows: of the kind of machine.
        limits: of its default setup.
        say: the language.
    """
    headings = (
        say("key", "键"),
        say("quantity", "量"),
        say("unit", "单位"),
        say("limit", "限值"),
        say("meaning", "含义"),
    )
    table = Table(*headings, show_lines=True)
    for row in quantities(rows):
        limit = limits.get(row.key)
        bound = (say("where set", "设定时") if row.optional else "") if limit is None else plain(limit.value)
        table.add_row(*(Text(cell) for cell in (row.key, say.words(row.words), row.unit, bound, say.words(row.about))))
    return table
