"""Showing: the commands that make no program, and print what there is."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

from post import controllers
from tapelayer.cli.application import command, output
from tapelayer.cli.misfits import content_at, expecting
from tapelayer.cli.options import (
    Courses,
    Kind,
    LanguageName,
    SetupFile,
    UnitName,
    kind_name,
    language_named,
    machine_kind_name,
    unit_of,
)
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.jobs.contents import Content, source_of
from tapelayer.jobs.job import machine_of
from tapelayer.jobs.kind import Form
from tapelayer.jobs.kinds import MACHINE_NAMES, NAMES, MachineKindName, kind_of, machine_kind_of
from tapelayer.reporting.summary import explained
from tapelayer.reporting.words import Say
from tapelayer.sentences import said
from tapelayer.setups.sections import read_setup, whole_text
from tapelayer.units import DEG, MM


@command(epilog="Example: [bold]tapelayer inspect panel.txt[/bold]")
def inspect(courses: Courses, unit: UnitName = "mm") -> None:
    """Show what a course file holds."""
    table = Table(title=Text(Path(courses).name))
    for heading in ("course", "points", "length mm", "cuts deg", "slope deg", "off surface deg"):
        table.add_column(said(heading), justify="right", no_wrap=True)
    with expecting(courses, source_of(Form.COURSES)):
        parsed = read_courses(courses, unit_of(unit))
    for course in parsed:
        table.add_row(*_inspected(course))
    output.print(table)
    output.print(
        said(
            f"{len(parsed)} courses, {sum(len(course.points) for course in parsed)} points, "
            f"{sum(course.length for course in parsed):.3f} m of tape laid, in {_box(parsed)} mm"
        ),
        highlight=False,
        soft_wrap=True,
    )


@command(epilog="Example: [bold]tapelayer setup > job.toml[/bold]")
def setup(
    kind: Kind = NAMES[0],
) -> None:
    """Print the default setup as a commented TOML file."""
    chosen = kind_of(kind_name(kind))
    sys.stdout.write(whole_text(chosen.first_setup(), chosen.title))


@command(epilog="Example: [bold]tapelayer quantities --kind spray[/bold]")
def quantities(
    kind: Kind = NAMES[0],
    language: LanguageName = None,
) -> None:
    """Explain every number of a report: its unit, its limit in the setup and its meaning."""
    chosen = kind_of(kind_name(kind))
    limits = chosen.limits(chosen.first_setup())
    output.print(explained(chosen.rows, limits, Say(language_named(language))))


@command(epilog="Example: [bold]tapelayer machine --setup job.toml[/bold]")
def machine(
    setup: SetupFile = None,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind",
            metavar="|".join(MACHINE_NAMES),
            help=r"The job: tape laying or spraying. \[default: the setup's, or lay]",
        ),
    ] = None,
) -> None:
    """Show the machine of a kind of job: axes, travel, speeds and the lengths of its closed form."""
    name = machine_kind_name(kind) if kind is not None else _machine_kind_of(setup)
    chosen = machine_kind_of(name)
    with expecting(setup, Content(Form.SETUP, name)):
        values = read_setup(setup, chosen.setup) if setup else chosen.setup.model_validate({})
    model = machine_of(values, chosen.machine.urdf)
    table = Table(title=Text(str(model.model.name)))
    for heading in ("axis", "from", "to", "unit", "speed /s"):
        table.add_column(said(heading), justify="right")
    for axis in model.axes:
        scale, unit = (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")
        table.add_row(axis.name, f"{axis.lower * scale:g}", f"{axis.upper * scale:g}", unit, f"{axis.speed * scale:g}")
    output.print(table)
    lengths = ", ".join(f"{said(what)} = {length / MM:g}" for what, length in chosen.machine.lengths(model).items())
    if lengths:
        output.print(f"{lengths} mm", highlight=False, soft_wrap=True)


@command(name="controllers", epilog="Example: [bold]tapelayer controllers[/bold]")
def list_controllers() -> None:
    """List the controller tables there are."""
    table = Table("name", "control")
    for name in controllers.names():
        table.add_row(name, controllers.load(name).title)
    output.print(table)


def _machine_kind_of(setup: str | None) -> MachineKindName:
    """Return the kind of machine that a setup is for: the first one where it is for none, or for several."""
    kind = content_at(setup).kind if setup else None
    return next((name for name in MACHINE_NAMES if name == kind), MACHINE_NAMES[0])


def _inspected(course: Course) -> list[str]:
    """Return the cells of a course's row."""
    steps = np.diff(course.points, axis=0)
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    normals = course.normals[1:] + course.normals[:-1]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    off = np.degrees(np.max(np.abs(np.arcsin(np.clip(np.sum(steps * normals, axis=1), -1, 1)))))
    slope = np.degrees(np.max(np.arccos(np.clip(course.normals[:, 2], -1, 1))))
    start, end = (angle / DEG for angle in course.cut_angles)
    cuts = f"{start:g}" if start == end else f"{start:g} {end:g}"
    length = f"{course.length / MM:.1f}"
    return [str(course.number), str(len(course.points)), length, cuts, f"{slope:.1f}", f"{off:.2f}"]


def _box(courses: Sequence[Course]) -> str:
    """Return the smallest and largest x, y and z of the courses as text, in mm."""
    points = np.concatenate([course.points for course in courses]) / MM
    spans = zip("xyz", np.min(points, axis=0), np.max(points, axis=0), strict=True)
    return ", ".join(f"{name} {low:.1f} to {high:.1f}" for name, low, high in spans)
