"""Summary: the report as a table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.quantity import Group, Measured, Quantity, Row, quantities
from tapelayer.reporting.words import plain, shown
from tapelayer.verification.limits import Limit, Limits


def summary(
    rows: Sequence[Row[Measured]], report: dict[str, Any], limits: Limits, listed: Sequence[tuple[str, str]] = ()
) -> Table:
    """Return the table of a report.

    Args:
        rows: of the kind of machine.
        report: its plain values.
        limits: of the setup.
        listed: more facts, words and value.
    """
    title = Text("passed", "bold green") if report["passed"] else Text("FAILED", "bold red")
    table = Table(title=Text("Verification: ").append_text(title), title_justify="left", title_style="")
    if report["not_judged"]:
        table.caption, table.caption_justify = Text(sentence(report["not_judged"]), "yellow"), "left"
    table.add_column("quantity")
    for heading in ("value", "limit", "top speed /s"):
        table.add_column(heading, justify="right")
    for row in quantities(rows, Group.FACT):
        table.add_row(*_cells(row, report, limits.get(row.key)))
    for words, value in listed:
        table.add_row(words, value)
    table.add_section()
    for row in quantities(rows, Group.ERROR):
        table.add_row(*_cells(row, report, limits.get(row.key)))
    table.add_section()
    for name, axis in report["axes"].items():
        table.add_row(
            Text(f"axis {name}, {axis['unit']}"),
            f"{shown(axis['min'], '', 'z.2f')} to {shown(axis['max'], '', 'z.2f')}",
            f"{plain(axis['lower'])} to {plain(axis['upper'])}",
            f"{shown(axis['max_speed'], '', 'z.1f')} of {plain(axis['speed_limit'])}",
        )
    if report["failures"]:
        table.add_section()
        table.add_row("failures", Text(f"{len(report['failures']):,}", "bold red"), "0")
    return table


def _cells(row: Quantity[Measured], report: dict[str, Any], limit: Limit | None) -> tuple[str, str, str]:
    """Return the words, value and limit of a quantity."""
    value = row.shown(report[row.key])
    if limit is None:
        return row.words.en, value, "not judged" if row.optional else ""
    bound = f"{'at least ' if limit.least else ''}{plain(limit.value)} {row.unit}".rstrip()
    return row.words.en, value, f"{bound}{'' if limit.judged else ', not judged'}"


def explained(rows: Sequence[Row[Measured]], limits: Limits) -> Table:
    """Return the table of what a kind reports: key, words, unit, limit and meaning.

    Args:
        rows: of the kind of machine.
        limits: of its default setup.
    """
    table = Table("key", "quantity", "unit", "limit", "meaning", show_lines=True)
    for row in quantities(rows):
        limit = limits.get(row.key)
        bound = ("where set" if row.optional else "") if limit is None else plain(limit.value)
        table.add_row(*(Text(cell) for cell in (row.key, row.words.en, row.unit, bound, row.about.en)))
    return table
