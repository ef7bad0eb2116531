"""Comparing: one source's programs for every control, by the time that each takes."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer
from rich.table import Table

from post import controllers
from tapelayer.cli.application import command, output
from tapelayer.cli.making import print_json, read_job, setup_of
from tapelayer.cli.misfits import content_at
from tapelayer.cli.options import AsJson, LanguageName, Quiet, SetupFile, UnitName, Verbose, language_named, unit_of
from tapelayer.cli.progress_bar import ProgressBar
from tapelayer.errors import ControllerRefused, NotWritable
from tapelayer.jobs.contents import kind_of_source
from tapelayer.jobs.kind import MachineKind
from tapelayer.jobs.kinds import machine_kind_of
from tapelayer.reporting.quantity import quantities
from tapelayer.reporting.words import Say
from tapelayer.sentences import said

# What is compared, of the figures that a kind of machine reports.
COMPARED = (
    "duration_s",
    "asked_s",
    "planned_laying_speed_mm_per_s",
    "planned_spraying_speed_mm_per_s",
    "speed_share",
    "laying_stops",
    "spraying_stops",
)


@command(epilog="Example: [bold]tapelayer compare panel.txt --setup job.toml[/bold]")
def compare(
    source: Annotated[
        str, typer.Argument(metavar="COURSES.txt|MODEL.stl", help="Course file, or the model that is sprayed.")
    ],
    setup: SetupFile = None,
    unit: UnitName = "mm",
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    language: LanguageName = None,
) -> None:
    """Compare the controls: how long the program takes on each, how steadily, and with how many stops."""
    name = kind_of_source(content_at(source))
    kind, units, spoken = machine_kind_of(name), unit_of(unit), language_named(language)
    values = setup_of(name, setup, None, dict.fromkeys(kind.options))
    told: dict[str, dict[str, Any]] = {}
    with ProgressBar(quiet, verbose) as steps:
        for control in controllers.names():
            job = read_job(kind, source, values.with_values("output", controller=control), units)
            try:
                result = job.make(source, steps)
            except (ControllerRefused, NotWritable) as error:
                told[control] = {"refused": str(error)}
                continue
            numbers = result.numbers()
            told[control] = {"passed": numbers["passed"], "time_law": numbers["time_law"]}
            told[control] |= {row.key: numbers[row.key] for row in quantities(kind.rows) if row.key in COMPARED}
    if all("refused" in each for each in told.values()):
        raise NotWritable("\n".join(f"{source}: {each['refused']}" for each in told.values()))
    if as_json:
        print_json(f"{json.dumps(told, indent=2, allow_nan=False)}\n".encode())
        return
    output.print(_table(kind, told, Say(spoken)))
    for refusal in (figures["refused"] for figures in told.values() if "refused" in figures):
        output.print(said(refusal.splitlines()[0]), highlight=False, soft_wrap=True)


def _table(kind: MachineKind, told: dict[str, dict[str, Any]], say: Say) -> Table:
    """Return a row for each control that a program can be written for, with its figures."""
    rows = [row for row in quantities(kind.rows) if row.key in COMPARED]
    table = Table()
    table.add_column(say("control", "数控系统"), no_wrap=True)
    for row in rows:
        table.add_column(say.words(row.words), justify="right")
    table.add_column(say("verdict", "判定"))
    for control, figures in told.items():
        if "refused" in figures:
            continue
        verdict = say("passed", "合格") if figures["passed"] else say("FAILED", "不合格")
        table.add_row(control, *[row.shown(figures[row.key]) for row in rows], verdict)
    return table
