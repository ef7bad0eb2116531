"""Planning: the command that plans the courses of a ply, and judges courses that others planned."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from tapelayer.atomic_files import check_names, write_files
from tapelayer.cli.application import command, notices, output
from tapelayer.cli.making import Making, print_json, setup_of
from tapelayer.cli.misfits import expecting
from tapelayer.cli.options import (
    AsJson,
    Force,
    LanguageName,
    OptionRefused,
    Quiet,
    Verbose,
    language_named,
)
from tapelayer.cli.outputs import Outputs, bytes_of, occasion_of, outputs_of
from tapelayer.cli.progress_bar import ProgressBar
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import TargetNotWritable, VerificationFailed
from tapelayer.jobs.contents import Content, source_of
from tapelayer.jobs.job import machine_of
from tapelayer.jobs.kind import Form
from tapelayer.jobs.stages import JUDGING
from tapelayer.language import Language
from tapelayer.laying.heading_range import heading_range
from tapelayer.laying.settings import Setup
from tapelayer.plies.job import PlyJob, PlyResult
from tapelayer.plies.judge import judge_courses
from tapelayer.plies.judgement import Judgement
from tapelayer.plies.ply import Ply
from tapelayer.plies.region import region_of
from tapelayer.provenance import unedited
from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.words import Say
from tapelayer.sentences import said
from tapelayer.units import DEG
from tapelayer.verification.verified import SHOWN_FAILURES
from urdf import TAPELAYER

PROGRAM, COURSES = ".nc", ".txt"


@command(
    epilog="Examples: [bold]tapelayer plan ply.toml -o courses.txt --html ply.html[/bold]  "
    "Straight on to the program: [bold]tapelayer plan ply.toml --setup job.toml --export -o panel.nc[/bold]  "
    "Courses that others planned: [bold]tapelayer plan ply.toml --judge courses.txt[/bold]  "
    "A ply file to begin with: [bold]tapelayer setup --kind plan > ply.toml[/bold]  "
    "Exit 0: every limit is kept, 1: one is not (the reports are written, the courses are not), 2: bad input.",
)
def plan(
    ply: Annotated[str, typer.Argument(metavar="PLY.toml", help="Ply file: mould, boundary, angle, tape and limits.")],
    setup: Annotated[
        str | None,
        typer.Option(
            "--setup",
            metavar="S.toml",
            help="Setup of the tape layer: its tape and cut angle go before the ply's, and its travel of c is told.",
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            "-o",
            metavar="COURSES.txt",
            help=r"Course file; with --export also OUT.nc, the program. \[default: the ply file's name and .txt]",
        ),
    ] = None,
    report_file: Annotated[
        str | None, typer.Option("--report", metavar="OUT.json", help="Write the ply's report as JSON.")
    ] = None,
    html_file: Annotated[
        str | None, typer.Option("--html", metavar="OUT.html", help="Write the ply's report with maps.")
    ] = None,
    export: Annotated[
        bool, typer.Option("--export", help="Make the program of the courses, too, as export does.")
    ] = False,
    judged: Annotated[
        str | None,
        typer.Option("--judge", metavar="COURSES.txt", help="Judge these courses against the ply, and plan none."),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    language: LanguageName = None,
) -> None:
    """Plan the courses of a ply on natural paths, judge them, and write them if they keep every limit."""
    spoken = language_named(language)
    if judged is not None:
        _refuse_with_judge({"-o": target, "--html": html_file, "--export": export})
        _judge(ply, judged, setup, report_file, (as_json, force, quiet, verbose), spoken)
        return
    if target == "-":
        raise OptionRefused.because("-o", "expected the name of a file, got '-'; courses go to a file")
    courses, program = _names(ply, target, export)
    (programs,) = outputs_of([courses], program, None, None)
    written = [name for name in (courses, report_file, html_file, program if export else None) if name]
    values, tape_layer = _values(ply, setup)
    _check([ply, setup, *_files(values)], written, force)
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {ply}")
        job = _job(values, ply)
        result = job.make(courses, steps)
        occasion = occasion_of(courses, setup)
        steps.begin("saving")
        contents = {} if result.failure else {Path(courses): result.text}
        if report_file is not None:
            contents[Path(report_file)] = result.report_file(occasion)
        if html_file is not None:
            contents[Path(html_file)] = result.page_file(occasion, spoken)
        write_files(contents)
    if as_json:
        print_json(result.report_file(occasion))
    if not quiet:
        _conclude(result, tape_layer, courses, as_json, spoken)
    if result.failure:
        raise result.failure
    if export:
        _export(courses, programs, setup, (False, force, quiet, verbose), spoken)


def _refuse_with_judge(options: dict[str, object]) -> None:
    for option, value in options.items():
        if value:
            raise OptionRefused.because(option, "goes with planning, and --judge plans nothing; leave one of them out")


def _names(ply: str, target: str | None, export: bool) -> tuple[str, str]:
    """Return the names of the course file and of the program."""
    named = Path(target) if target is not None else Path(Path(ply).stem + COURSES)
    if target is not None and (target.endswith(("/", "\\")) or named.is_dir()):
        named = named / (Path(ply).stem + COURSES)
    if named.suffix.lower() == PROGRAM:
        if not export:
            raise OptionRefused.because("-o", f"{target} names a program; add --export, or name the course file")
        return str(named.with_suffix(COURSES)), str(named)
    return str(named), str(named.with_suffix(PROGRAM))


def _check(inputs: Sequence[str | None], outputs: Sequence[str], force: bool) -> None:
    """Refuse outputs that would replace an input, each other, or others' work.

    Raises:
        TargetNotWritable: as said.
    """
    check_names([name for name in inputs if name], outputs)
    for name in () if force else outputs:
        if Path(name).is_file() and (old := bytes_of(name)) and not unedited(old):
            raise TargetNotWritable(
                f"{name}: holds what tapelayer did not write, or what was edited since; name another, or replace it "
                "with --force"
            )


def _values(ply: str, setup: str | None) -> tuple[Ply, Setup | None]:
    """Return what a ply file says, with the tape and the cut angle of a setup, and that setup."""
    with expecting(ply, Content(Form.SETUP, "plan")):
        values = Ply.read(ply)
    if setup is None:
        return values, None
    tape_layer = setup_of("lay", setup, None, {"kinematics": None})
    assert isinstance(tape_layer, Setup)
    values = values.with_values("tape", width_mm=tape_layer.tape.width_mm)
    return values.with_values("courses", minimum_cut_angle_deg=tape_layer.head.minimum_cut_angle_deg), tape_layer


def _files(values: Ply) -> list[str]:
    """Return the files that a ply names."""
    return [values.mould.file, *([str(values.boundary_file)] if values.boundary_file else [])]


def _job(values: Ply, ply: str) -> PlyJob:
    """Return the job of a ply, with its mould."""
    with expecting(values.mould.file, source_of(Form.MODEL)):
        return PlyJob.of_ply(values, ply)


def _conclude(result: PlyResult, setup: Setup | None, courses: str, as_json: bool, language: Language) -> None:
    """Print the summary and the notes of a plan, and a last line if it passed."""
    console = notices if as_json else output
    console.print(result.summary(language))
    for note in (*result.notes(language), *([_travel(result.courses, setup, language)] if setup else [])):
        sys.stderr.write(f"{note}\n")
    if not result.failure:
        words = Say(language)(
            "{name}: {n} courses, judged", "{name}：{n} 道，判定合格", name=courses, n=len(result.courses)
        )
        console.print(words, highlight=False, soft_wrap=True, markup=False)


def _travel(courses: Sequence[Course], setup: Setup, language: Language) -> str:
    """Return what travel of c the courses need, against that of the setup's machine."""
    machine = machine_of(setup, TAPELAYER)
    axis = machine.axis("c")
    least, greatest = (angle / DEG for angle in heading_range(courses, setup, machine))
    lower, upper = axis.lower / DEG, axis.upper / DEG
    values = {"least": least, "greatest": greatest, "lower": lower, "upper": upper}
    say = Say(language)
    if lower <= least and greatest <= upper:
        return say(
            "c turns from {least:.1f} to {greatest:.1f} deg over the courses, within its travel "
            "of {lower:g} to {upper:g}",
            "各道次上 c 轴从 {least:.1f} 转至 {greatest:.1f} deg，在其行程 {lower:g} 至 {upper:g} 之内",
            **values,
        )
    return say(
        "c turns from {least:.1f} to {greatest:.1f} deg over the courses, beyond its travel of {lower:g} to {upper:g}: "
        "turn the part by [part], lay the courses one way, or give c that travel by [machine] limits_deg",
        "各道次上 c 轴从 {least:.1f} 转至 {greatest:.1f} deg，超出其行程 {lower:g} 至 {upper:g}：请用 [part] 旋转工件、"
        "单向铺放，或用 [machine] limits_deg 给予 c 该行程",
        **values,
    )


def _export(
    courses: str, outputs: Outputs, setup: str | None, flags: tuple[bool, bool, bool, bool], language: Language
) -> None:
    """Make the program of a course file."""
    as_json, force, quiet, verbose = flags
    made = Making("lay", "mm", setup, language, quiet, verbose, as_json, force)
    made.run([courses], [outputs], None, {"kinematics": None})


def _judge(
    ply: str,
    courses: str,
    setup: str | None,
    report: str | None,
    flags: tuple[bool, bool, bool, bool],
    language: Language,
) -> None:
    """Judge a course file against a ply.

    Raises:
        VerificationFailed: it does not keep the ply's limits.
    """
    as_json, force, quiet, verbose = flags
    values, _ = _values(ply, setup)
    _check([ply, courses, setup, *_files(values)], [report] if report else [], force)
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {ply}")
        job = _job(values, ply)
        with expecting(courses, source_of(Form.COURSES)):
            read = parse_courses(bytes_of(courses), courses)
        region = region_of(job.ply, job.mould, ply)
        steps.begin(JUDGING.name)
        judgement = judge_courses(read, job.ply, region)
    text = f"{json.dumps(judgement.values(), indent=2, allow_nan=False)}\n".encode()
    if report:
        write_files({Path(report): text})
    if as_json:
        print_json(text)
    if not quiet:
        (notices if as_json else output).print(_judged_table(judgement, Say(language)))
    if not judgement.passed:
        sentences = [fault.sentence for fault in judgement.faults[:SHOWN_FAILURES]]
        more = len(judgement.faults) - SHOWN_FAILURES
        if more > 0:
            sentences.append(f"and {more} more failure{'s' if more > 1 else ''}")
        raise VerificationFailed("\n".join(f"{courses}: {told}" for told in sentences), judgement)


def _judged_table(judgement: Judgement, say: Say) -> Table:
    """Return the measurements of a judgement as a table for a terminal."""
    title = say("passed", "合格") if judgement.passed else say("FAILED", "不合格")
    table = Table(title=f"{say('Judgement: ', '判定：')}{title}", title_justify="left", title_style="")
    table.caption, table.caption_justify = sentence(judgement.not_judged, say), "left"
    table.add_column(say("quantity", "量"))
    table.add_column(say("value", "实测"), justify="right")
    for key, value in judgement.measured.items():
        table.add_row(said(key), f"{value:,d}" if isinstance(value, int) else f"{value:,.4g}")
    return table
