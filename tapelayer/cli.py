"""The command line: it knows every room, and no room knows it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from post import controllers
from tapelayer.atomic_files import write_files
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.dispatch import run
from tapelayer.errors import InputFault, ProgramRefused, SetupRefused
from tapelayer.geometry.mesh import Unit
from tapelayer.laying.job import Job, Made, machine_of
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.setups.sections import default_text, read_setup
from tapelayer.spraying.job import SprayJob, SprayMade
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM
from tapelayer.workbench import command

app = typer.Typer(
    name="tapelayer",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Offline programming for a ten-axis tape layer: tape courses in, verified NC programs out.",
    epilog="Start with: [bold]tapelayer demo[/bold], or [bold]tapelayer export COURSES.txt -o PROGRAM.nc[/bold]",
)

Courses = Annotated[str, typer.Argument(metavar="COURSES.txt", help="Course file (the paper's Table 3), mm.")]
SetupFile = Annotated[str | None, typer.Option("--setup", metavar="S.toml", help="Setup; without it the defaults.")]
ControllerName = Annotated[
    str | None, typer.Option("--controller", metavar="NAME", help="Controller table, or the path of one.")
]
KinematicsName = Annotated[
    str | None, typer.Option("--kinematics", metavar="roller|published", help="Closed form in use.")
]
ReportFile = Annotated[str | None, typer.Option("--report", metavar="OUT.json", help="Write the report as JSON.")]
HtmlFile = Annotated[str | None, typer.Option("--html", metavar="OUT.html", help="Write the report with plots.")]
UnitName = Annotated[Unit, typer.Option("--unit", help="Unit of the model's numbers; STL does not state one.")]
Direction = Annotated[
    float | None, typer.Option("--direction-deg", metavar="DEG", help="Travel of the passes, from +x towards +y.")
]
Pitch = Annotated[str | None, typer.Option("--pitch-mm", metavar="MM|auto", help="From pass to pass.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="Say how long each step takes.")]

output = Console()
notices = Console(stderr=True)


@app.command(
    epilog="Example: [bold]tapelayer export panel.txt --setup job.toml -o panel.nc --html panel.html[/bold]",
)
def export(
    courses: Courses,
    setup: SetupFile = None,
    controller: ControllerName = None,
    kinematics: KinematicsName = None,
    target: Annotated[
        str | None, typer.Option("-o", metavar="OUT.nc", help="Program; - for stdout, default COURSES.nc here.")
    ] = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Plan, write, read back and verify an NC program; nothing that fails is written."""
    program, to_stdout = _target(target, courses)
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {courses}")
        made = _job(courses, setup, controller, kinematics).make(str(program), steps)
        if made.failure:
            raise made.failure
        steps.begin("saving")
        title = Path(courses).name if to_stdout else program.name
        _save(made, {} if to_stdout else {program: made.text}, title, report_file, html_file)
    _hand_over(made, program, to_stdout, quiet)


@app.command(
    epilog="Example: [bold]tapelayer verify panel.nc panel.txt --setup job.toml[/bold]  "
    "Exit 0: passed, 1: failed, 2: bad input.",
)
def verify(
    program: Annotated[str, typer.Argument(metavar="PROGRAM.nc", help="NC program, also one edited by hand.")],
    source: Annotated[
        str, typer.Argument(metavar="COURSES.txt|MODEL.stl", help="Course file, or the model that is sprayed.")
    ],
    setup: SetupFile = None,
    controller: ControllerName = None,
    kinematics: KinematicsName = None,
    unit: UnitName = "mm",
    direction_deg: Direction = None,
    pitch_mm: Pitch = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    force: Annotated[
        bool, typer.Option("--force", help="Judge a program although its header names another setup.")
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Judge an NC program by its text against its courses, or against the model that it sprays."""
    is_model = Path(source).suffix.lower() == ".stl"
    if is_model:
        _refuse("--kinematics", kinematics, "tape courses")
    else:
        _refuse("--direction-deg", direction_deg, "models")
        _refuse("--pitch-mm", pitch_mm, "models")
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {source}")
        text = _bytes(program)
        if is_model:
            job: Job | SprayJob = _spray_job(source, setup, unit, controller, direction_deg, pitch_mm)
        else:
            job = _job(source, setup, controller, kinematics)
        made = job.examine(text, program, force, steps)
        _save(made, {}, Path(program).name, report_file, html_file)
    for remark in made.remarks:
        sys.stderr.write(f"{remark}\n")
    if not quiet:
        _conclude(made, program, output)
    if made.failure:
        raise made.failure


@app.command(
    epilog="Example: [bold]tapelayer spray hood.stl --direction-deg 90 -o hood.nc --html hood.html[/bold]",
)
def spray(
    model: Annotated[str, typer.Argument(metavar="MODEL.stl", help="The part's surface as STL.")],
    setup: SetupFile = None,
    unit: UnitName = "mm",
    direction_deg: Direction = None,
    pitch_mm: Pitch = None,
    controller: ControllerName = None,
    target: Annotated[
        str | None, typer.Option("-o", metavar="OUT.nc", help="Program; - for stdout, default MODEL.nc here.")
    ] = None,
    trajectory_file: Annotated[
        str | None, typer.Option("--trajectory", metavar="OUT.txt", help="Write the gun's poses in the part's frame.")
    ] = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Plan, write, read back and verify a spraying program; nothing that fails is written."""
    program, to_stdout = _target(target, model)
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {model}")
        made = _spray_job(model, setup, unit, controller, direction_deg, pitch_mm).make(str(program), steps)
        if made.failure:
            raise made.failure
        steps.begin("saving")
        contents = {} if to_stdout else {program: made.text}
        if trajectory_file:
            contents[Path(trajectory_file)] = made.poses()
        _save(made, contents, Path(model).name if to_stdout else program.name, report_file, html_file)
    _hand_over(made, program, to_stdout, quiet)


@app.command(epilog="Example: [bold]tapelayer inspect panel.txt[/bold]")
def inspect(courses: Courses) -> None:
    """Show what a course file holds."""
    table = Table(title=Path(courses).name)
    for heading in ("course", "points", "length mm", "cuts deg", "slope deg", "off surface deg"):
        table.add_column(heading, justify="right", no_wrap=True)
    found = read_courses(courses)
    for course in found:
        table.add_row(*_inspected(course))
    output.print(table)
    output.print(
        f"{len(found)} courses, {sum(len(course.points) for course in found)} points, "
        f"{sum(course.length for course in found):.3f} m of tape laid, in {_box(found)} mm",
        highlight=False,
        soft_wrap=True,
    )


@app.command(epilog="Example: [bold]tapelayer setup > job.toml[/bold]")
def setup(
    kind: Annotated[Literal["lay", "spray"], typer.Option("--kind", help="The job: tape laying or spraying.")] = "lay",
) -> None:
    """Print the default setup as a commented TOML file."""
    if kind == "spray":
        sys.stdout.write(default_text(SpraySetup, "Setup of a spraying job"))
    else:
        sys.stdout.write(default_text(Setup, "Setup of a tape-laying job"))


@app.command(epilog="Example: [bold]tapelayer machine --setup job.toml[/bold]")
def machine(setup: SetupFile = None) -> None:
    """Show the machine: axes, travel, speeds and the lengths of its closed form."""
    model = machine_of(_setup(setup))
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


@app.command(epilog="Example: [bold]tapelayer demo --into demo[/bold]")
def demo(
    into: Annotated[str, typer.Option("--into", metavar="FOLDER", help="Where the results go.")] = "demo",
) -> None:
    """Run the main job on an example: a cylinder panel at 15 degrees."""
    folder = Path(into)
    folder.mkdir(parents=True, exist_ok=True)
    example = files("tapelayer.examples").joinpath("cylinder_panel_15.txt")
    stem = folder / "cylinder_panel_15"
    export(str(example), None, None, None, f"{stem}.nc", f"{stem}.json", f"{stem}.html")
    output.print(f"open {stem}.html to look at it", highlight=False, soft_wrap=True)


app.command(epilog=command.EPILOG)(command.serve)


class _ProgressBar:
    """What is under way, on stderr: a progress bar on a terminal, a line a step where asked for.

    Args:
        quiet: say nothing.
        verbose: say how long each step took.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        hidden = quiet or not notices.is_terminal
        self._bar = Progress(*columns, console=notices, transient=True, disable=hidden)
        self._task = self._bar.add_task("", total=None)
        self._verbose = verbose and not quiet
        self._step, self._begun = "", 0.0

    def __enter__(self) -> Self:
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(self, *raised: object) -> None:
        """Take the bar away."""
        self._end()
        self._bar.stop()

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Go on to a step, of so many ticks where they are known."""
        self._end()
        self._step, self._begun = step, time.perf_counter()
        self._bar.reset(self._task, description=step, total=ticks)

    def tick(self) -> None:
        """One more is done."""
        self._bar.advance(self._task)

    def _end(self) -> None:
        if self._verbose and self._step:
            sys.stderr.write(f"{self._step}: {time.perf_counter() - self._begun:.2f} s\n")


def _target(target: str | None, source: str) -> tuple[Path, bool]:
    """The program's file, and whether it goes to stdout instead."""
    return Path(target) if target else Path(Path(source).stem + ".nc"), target == "-"


def _save(
    made: Made | SprayMade, contents: dict[Path, bytes], title: str, report_file: str | None, html_file: str | None
) -> None:
    """Write these files and the reports together."""
    if report_file:
        contents[Path(report_file)] = (json.dumps(made.report(), indent=2, allow_nan=False) + "\n").encode()
    if html_file:
        contents[Path(html_file)] = made.page(title).encode()
    write_files(contents)


def _hand_over(made: Made | SprayMade, program: Path, to_stdout: bool, quiet: bool) -> None:
    """The program to stdout where it was asked for there, and what was found to the other stream."""
    if to_stdout:
        sys.stdout.buffer.write(made.text)
        sys.stdout.buffer.flush()
    if not quiet:
        _conclude(made, "the program" if to_stdout else str(program), notices if to_stdout else output)


def _conclude(made: Made | SprayMade, name: str, console: Console) -> None:
    """Table of what was found, and one line that says whether it passed."""
    console.print(made.summary())
    if isinstance(made, Made) and made.job.setup.process.kinematics == "published":
        numbers = made.report()
        sys.stderr.write(
            "published kinematics: the roller leaves the surface by up to "
            f"{numbers['max_roller_tilt_deg']:.2f} deg (edge lift {numbers['max_edge_lift_mm']:.2f} mm), heading up to "
            f"{numbers['max_heading_error_deg']:.2f} deg off, centre up to {numbers['max_roller_offset_mm']:.2f} mm; "
            "judged only where [verification] itself sets these limits\n"
        )
    if made.evidence.passed:
        console.print(f"{name}: {made.evidence.blocks} blocks, verified", highlight=False, soft_wrap=True)


def _setup(name: str | None) -> Setup:
    return read_setup(name, Setup) if name else Setup()


def _job(courses: str, setup_file: str | None, controller: str | None, kinematics: str | None) -> Job:
    chosen = _setup(setup_file)
    if controller:
        chosen = chosen.with_values("output", controller=controller)
    if kinematics:
        chosen = chosen.with_values("process", kinematics=kinematics)
    return Job.read(courses, chosen)


def _bytes(name: str) -> bytes:
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise ProgramRefused.unreadable(name, error) from None


def _refuse(option: str, value: object, owner: str) -> None:
    """Refuse an option that says something of the other machine's sources."""
    if value is not None:
        raise SetupRefused(option, [InputFault(0, f"belongs to {owner}; leave it out here")])


def _spray_job(
    model: str,
    setup_file: str | None,
    unit: Unit,
    controller: str | None,
    direction_deg: float | None,
    pitch_mm: str | None,
) -> SprayJob:
    chosen = read_setup(setup_file, SpraySetup) if setup_file else SpraySetup()
    if controller:
        chosen = chosen.with_values("output", controller=controller)
    if direction_deg is not None:
        chosen = chosen.with_values("spray", direction_deg=direction_deg)
    if pitch_mm is not None:
        try:
            pitch: float | str = float(pitch_mm)
        except ValueError:
            pitch = pitch_mm
        chosen = chosen.with_values("spray", pitch_mm=pitch)
    return SprayJob.read(model, chosen, unit)


def _inspected(course: Course) -> list[str]:
    """Cells of a course's row."""
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
    """Smallest and largest x, y and z of the courses in mm."""
    points = np.concatenate([course.points for course in courses]) / MM
    spans = zip("xyz", np.min(points, axis=0), np.max(points, axis=0), strict=True)
    return ", ".join(f"{name} {low:.1f} to {high:.1f}" for name, low, high in spans)


def main() -> None:
    """Run the command line."""
    run(app, sys.argv[1:], "tapelayer")
