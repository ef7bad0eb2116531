"""Making: the commands that make programs and judge them."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from tapelayer.cli.application import app, notices, output
from tapelayer.cli.options import (
    ControllerName,
    Courses,
    Direction,
    Force,
    HtmlFile,
    KinematicsName,
    Pitch,
    Quiet,
    ReportFile,
    SetupFile,
    UnitName,
    Verbose,
)
from tapelayer.cli.outputs import bytes_of, check_outputs, save
from tapelayer.cli.progress_bar import ProgressBar
from tapelayer.errors import InputFault, SetupRefused, TargetNotWritable
from tapelayer.geometry.mesh import Unit
from tapelayer.jobs.job import JobResult, MachineJob
from tapelayer.jobs.kind import JobKind
from tapelayer.jobs.kinds import kind_of, kinds, name_of_source
from tapelayer.setups.sections import read_setup


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
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {courses}")
        job = _job(kind_of("lay"), courses, setup, controller, {"kinematics": kinematics})
        check_outputs(job, [courses, setup], [None if to_stdout else str(program), report_file, html_file], force)
        result = job.make(str(program), steps)
        if result.failure:
            raise result.failure
        steps.begin("saving")
        title = Path(courses).name if to_stdout else program.name
        save(result, {} if to_stdout else {program: result.text}, title, report_file, html_file)
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
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {source}")
        text = bytes_of(program)
        job = _job(kind, source, setup, controller, options, unit)
        check_outputs(job, [program, source, setup], [report_file, html_file], force)
        result = job.judge(text, program, force, steps)
        save(result, {}, Path(program).name, report_file, html_file)
    for remark in result.remarks:
        sys.stderr.write(f"{remark}\n")
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
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {model}")
        options = {"direction_deg": direction_deg, "pitch_mm": pitch_mm}
        job = _job(kind_of("spray"), model, setup, controller, options, unit)
        outputs = [None if to_stdout else str(program), trajectory_file, report_file, html_file]
        check_outputs(job, [model, setup], outputs, force)
        result = job.make(str(program), steps)
        if result.failure:
            raise result.failure
        steps.begin("saving")
        contents = {} if to_stdout else {program: result.text}
        if trajectory_file:
            contents[Path(trajectory_file)] = result.files()["trajectory.txt"]
        save(result, contents, Path(model).name if to_stdout else program.name, report_file, html_file)
    _hand_over(result, program, to_stdout, quiet)


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
    output.print(f"open {stem}.html to look at it", highlight=False, soft_wrap=True)


def _target(target: str | None, source: str) -> tuple[Path, bool]:
    """Return the program's file, and whether it goes to stdout instead."""
    return Path(target) if target else Path(Path(source).stem + ".nc"), target == "-"


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
        sys.stderr.write(f"{note}\n")
    if result.evidence.passed:
        console.print(f"{name}: {result.evidence.blocks} blocks, verified", highlight=False, soft_wrap=True)


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


def _refuse_others(kind: JobKind, options: Mapping[str, object]) -> None:
    """Refuse options that apply to another kind's sources only."""
    for other in kinds():
        for name in other.options:
            if name not in kind.options and options[name] is not None:
                flag = f"--{name.replace('_', '-')}"
                raise SetupRefused(flag, [InputFault(0, f"belongs to {other.source.plural}; leave it out here")])
