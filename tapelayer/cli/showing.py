"""Showing: the commands that make no program, and print what there is."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from post import controllers
from tapelayer.cli.application import app, output
from tapelayer.cli.options import Courses, Kind, SetupFile
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.jobs.job import machine_of
from tapelayer.jobs.kinds import NAMES, kind_of
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.reporting.summary import explained
from tapelayer.setups.sections import default_text, read_setup
from tapelayer.units import DEG, MM
from urdf import TAPELAYER


@app.command(epilog="Example: [bold]tapelayer inspect panel.txt[/bold]")
def inspect(courses: Courses) -> None:
    """Show what a course file holds."""
    table = Table(title=Path(courses).name)
    for heading in ("course", "points", "length mm", "cuts deg", "slope deg", "off surface deg"):
        table.add_column(heading, justify="right", no_wrap=True)
    parsed = read_courses(courses)
    for course in parsed:
        table.add_row(*_inspected(course))
    output.print(table)
    output.print(
        f"{len(parsed)} courses, {sum(len(course.points) for course in parsed)} points, "
        f"{sum(course.length for course in parsed):.3f} m of tape laid, in {_box(parsed)} mm",
        highlight=False,
        soft_wrap=True,
    )


@app.command(epilog="Example: [bold]tapelayer setup > job.toml[/bold]")
def setup(
    kind: Kind = NAMES[0],
) -> None:
    """Print the default setup as a commented TOML file."""
    chosen = kind_of(kind)
    sys.stdout.write(default_text(chosen.setup, chosen.title))


@app.command(epilog="Example: [bold]tapelayer quantities --kind spray[/bold]")
def quantities(
    kind: Kind = NAMES[0],
) -> None:
    """Explain every number of a report: its unit, its limit in the setup and its meaning."""
    chosen = kind_of(kind)
    output.print(explained(chosen.rows, chosen.limits(chosen.setup.model_validate({}))))


@app.command(epilog="Example: [bold]tapelayer machine --setup job.toml[/bold]")
def machine(setup: SetupFile = None) -> None:
    """Show the machine: axes, travel, speeds and the lengths of its closed form."""
    model = machine_of(read_setup(setup, Setup) if setup else Setup(), TAPELAYER)
    table = Table(title=str(model.model.name))
    for heading in ("axis", "from", "to", "unit", "speed /s"):
        table.add_column(heading, justify="right")
    for axis in model.axes:
        scale, unit = (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")
        table.add_row(axis.name, f"{axis.lower * scale:g}", f"{axis.upper * scale:g}", unit, f"{axis.speed * scale:g}")
    output.print(table)
    lengths = gantry.lengths(model)
    output.print(
        f"l4 = {lengths.l4 / MM:g}, l5 = {lengths.l5 / MM:g}, l6 = {lengths.l6 / MM:g}, "
        f"roller radius = {lengths.radius / MM:g} mm",
        highlight=False,
        soft_wrap=True,
    )


@app.command(name="controllers", epilog="Example: [bold]tapelayer controllers[/bold]")
def list_controllers() -> None:
    """List the controller tables there are."""
    table = Table("name", "control")
    for name in controllers.names():
        table.add_row(name, controllers.load(name).title)
    output.print(table)


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
