"""The command line: it may import every package, and no package imports it."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from post import controllers
from tapelayer.atomic_files import check_names, write_files
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.dispatch import run
from tapelayer.errors import InputFault, ProgramRefused, SetupRefused, TargetNotWritable
from tapelayer.geometry.mesh import Unit
from tapelayer.jobs.job import JobResult, MachineJob, machine_of
from tapelayer.jobs.kind import JobKind
from tapelayer.jobs.kinds import NAMES, KindName, kind_of, kinds, name_of_source
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.provenance import unedited
from tapelayer.reporting.summary import explained
from tapelayer.sentences import said
from tapelayer.setups.sections import default_text, read_setup
from tapelayer.units import DEG, MM
from tapelayer.workbench import command
from urdf import TAPELAYER

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
Force = Annotated[
    bool, typer.Option("--force", metavar="", help="Replace files that were edited, or that tapelayer did not write.")
]
Quiet = Annotated[bool, typer.Option("--quiet", metavar="", help="Say nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", metavar="", help="Say how long each step takes.")]

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
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Plan, write, read back and verify an NC program; nothing that fails is written."""
    program, to_stdout = _target(target, courses)
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {courses}")
        job = _job(kind_of("lay"), courses, setup, controller, {"kinematics": kinematics})
        _check_outputs(job, [courses, setup], [None if to_stdout else str(program), report_file, html_file], force)
        result = job.make(str(program), steps)
        if result.failure:
            raise result.failure
        steps.begin("saving")
        title = Path(courses).name if to_stdout else program.name
        _save(result, {} if to_stdout else {program: result.text}, title, report_file, html_file)
    _hand_over(result, program, to_stdout, quiet)


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
        bool,
        typer.Option(
            "--force", metavar="", help="Judge a program made with another setup, and replace files as export does."
        ),
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Judge an NC program by its text against its courses, or against the model that it sprays."""
    options = {"kinematics": kinematics, "direction_deg": direction_deg, "pitch_mm": pitch_mm}
    kind = kind_of(name_of_source(source))
    _refuse_others(kind, options)
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {source}")
        text = _bytes(program)
        job = _job(kind, source, setup, controller, options, unit)
        _check_outputs(job, [program, source, setup], [report_file, html_file], force)
        result = job.judge(text, program, force, steps)
        _save(result, {}, Path(program).name, report_file, html_file)
    for remark in result.remarks:
        sys.stderr.write(f"{said(remark)}\n")
    if not quiet:
        _conclude(result, program, output)
    if result.failure:
        raise result.failure


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
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Plan, write, read back and verify a spraying program; nothing that fails is written."""
    program, to_stdout = _target(target, model)
    with _ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {model}")
        options = {"direction_deg": direction_deg, "pitch_mm": pitch_mm}
        job = _job(kind_of("spray"), model, setup, controller, options, unit)
        outputs = [None if to_stdout else str(program), trajectory_file, report_file, html_file]
        _check_outputs(job, [model, setup], outputs, force)
        result = job.make(str(program), steps)
        if result.failure:
            raise result.failure
        steps.begin("saving")
        contents = {} if to_stdout else {program: result.text}
        if trajectory_file:
            contents[Path(trajectory_file)] = result.files()["trajectory.txt"]
        _save(result, contents, Path(model).name if to_stdout else program.name, report_file, html_file)
    _hand_over(result, program, to_stdout, quiet)


@app.command(epilog="Example: [bold]tapelayer inspect panel.txt[/bold]")
def inspect(courses: Courses) -> None:
    """Show what a course file holds."""
    table = Table(title=Path(courses).name)
    for heading in ("course", "points", "length mm", "cuts deg", "slope deg", "off surface deg"):
        table.add_column(said(heading), justify="right", no_wrap=True)
    parsed = read_courses(courses)
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


@app.command(epilog="Example: [bold]tapelayer setup > job.toml[/bold]")
def setup(
    kind: Annotated[KindName, typer.Option("--kind", help="The job: tape laying or spraying.")] = NAMES[0],
) -> None:
    """Print the default setup as a commented TOML file."""
    chosen = kind_of(kind)
    sys.stdout.write(default_text(chosen.setup, chosen.title))


@app.command(epilog="Example: [bold]tapelayer quantities --kind spray[/bold]")
def quantities(
    kind: Annotated[KindName, typer.Option("--kind", help="The job: tape laying or spraying.")] = NAMES[0],
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
        table.add_column(said(heading), justify="right")
    for axis in model.axes:
        scale, unit = (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")
        table.add_row(axis.name, f"{axis.lower * scale:g}", f"{axis.upper * scale:g}", unit, f"{axis.speed * scale:g}")
    output.print(table)
    lengths = gantry.lengths(model)
    output.print(
        said(
            f"l4 = {lengths.l4 / MM:g}, l5 = {lengths.l5 / MM:g}, l6 = {lengths.l6 / MM:g}, "
            f"roller radius = {lengths.radius / MM:g} mm"
        ),
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
    force: Force = False,
) -> None:
    """Run the main job on an example: a cylinder panel at 15 degrees."""
    folder = Path(into)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise TargetNotWritable(f"{into}: cannot be made a folder: {reason}; name another by --into") from None
    example = files("tapelayer.examples").joinpath("cylinder_panel_15.txt")
    stem = folder / "cylinder_panel_15"
    export(str(example), None, None, None, f"{stem}.nc", f"{stem}.json", f"{stem}.html", force)
    output.print(said(f"open {stem}.html to look at it"), highlight=False, soft_wrap=True)


app.command(epilog=command.EPILOG)(command.serve)


class _ProgressBar:
    """Progress on stderr: a bar if it is a terminal, and a line for each step if verbose.

    Args:
        quiet: print nothing.
        verbose: print how long each step took.
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
        """Remove the bar."""
        self._end()
        self._bar.stop()

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Begin a step, with its number of ticks if that is known."""
        self._end()
        self._step, self._begun = step, time.perf_counter()
        self._bar.reset(self._task, description=step, total=ticks)

    def tick(self) -> None:
        """Count one more tick as done."""
        self._bar.advance(self._task)

    def _end(self) -> None:
        if self._verbose and self._step:
            sys.stderr.write(f"{self._step}: {time.perf_counter() - self._begun:.2f} s\n")


def _target(target: str | None, source: str) -> tuple[Path, bool]:
    """Return the program's file, and whether it goes to stdout instead."""
    return Path(target) if target else Path(Path(source).stem + ".nc"), target == "-"


def _check_outputs(
    job: MachineJob[Any, Any], inputs: Sequence[str | None], outputs: Sequence[str | None], force: bool
) -> None:
    """Refuse outputs that would replace an input, each other, or, unless forced, work that is not tapelayer's.

    Raises:
        TargetNotWritable: as said, before any work is done.
    """
    values = job.setup.model_dump()
    named = [values[section][key] for section, key in (*job.setup.FILES, ("output", "controller"))]
    targets = [name for name in outputs if name]
    if "-" in targets:
        raise TargetNotWritable("-: is no name of a report; only the program goes to stdout, by -o -")
    check_names([name for name in (*inputs, *named) if name], targets)
    for name in () if force else targets:
        if Path(name).is_file() and (old := _bytes(name)) and not unedited(old):
            raise TargetNotWritable(
                f"{name}: holds what tapelayer did not write, or what was edited since; name another, or replace it "
                "with --force"
            )


def _save(
    result: JobResult[Any], contents: dict[Path, bytes], title: str, report_file: str | None, html_file: str | None
) -> None:
    """Write these files and the requested reports together."""
    if report_file:
        contents[Path(report_file)] = result.report_file()
    if html_file:
        contents[Path(html_file)] = result.page_file(title)
    write_files(contents)


def _hand_over(result: JobResult[Any], program: Path, to_stdout: bool, quiet: bool) -> None:
    """Write the program to stdout if requested there, and the summary to the other stream."""
    if to_stdout:
        sys.stdout.buffer.write(result.text)
        sys.stdout.buffer.flush()
    if not quiet:
        _conclude(result, "the program" if to_stdout else str(program), notices if to_stdout else output)


def _conclude(result: JobResult[Any], name: str, console: Console) -> None:
    """Print the summary and the notes of a result, and a last line if it passed."""
    console.print(result.summary())
    for note in result.notes():
        sys.stderr.write(f"{said(note)}\n")
    if result.evidence.passed:
        last = said(f"{name}: {result.evidence.blocks} blocks, verified")
        console.print(last, highlight=False, soft_wrap=True)


def _job(
    kind: JobKind,
    source: str,
    setup_file: str | None,
    controller: str | None,
    options: Mapping[str, object],
    unit: Unit = "mm",
) -> MachineJob[Any, Any]:
    """Read the job of a source, with the options overriding the setup."""
    setup = read_setup(setup_file, kind.setup) if setup_file else kind.setup.model_validate({})
    if controller:
        setup = setup.with_values("output", controller=controller)
    for name, option in kind.options.items():
        if options[name] is not None:
            setup = setup.with_values(option.section, **{option.key: _number_or_word(options[name])})
    return kind.read(source, setup, unit)


def _number_or_word(value: object) -> object:
    """Return the value of an option, as a number if it is one."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _bytes(name: str) -> bytes:
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise ProgramRefused.unreadable(name, error) from None


def _refuse_others(kind: JobKind, options: Mapping[str, object]) -> None:
    """Refuse options that apply to another kind's sources only."""
    for other in kinds():
        for name in other.options:
            if name not in kind.options and options[name] is not None:
                flag = f"--{name.replace('_', '-')}"
                raise SetupRefused(flag, [InputFault(0, f"belongs to {other.source.plural}; leave it out here")])


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


def main() -> None:
    """Run the command line."""
    run(app, sys.argv[1:], "tapelayer")
