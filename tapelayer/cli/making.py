"""Making: the commands that make programs and judge them."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

import typer
from rich.console import Console

from tapelayer.atomic_files import write_files
from tapelayer.cli.application import command, notices, output
from tapelayer.cli.misfits import check_form, check_order, content_at, expecting
from tapelayer.cli.options import (
    AsJson,
    Direction,
    EitherController,
    Force,
    HtmlFile,
    KinematicsName,
    LanguageName,
    LayController,
    OptionRefused,
    Pitch,
    Quiet,
    ReportFile,
    SetupFile,
    SprayController,
    Target,
    UnitName,
    Verbose,
    language_named,
    typed_as,
    unit_of,
)
from tapelayer.cli.outputs import Outputs, bytes_of, check_outputs, occasion_of, outputs_of
from tapelayer.cli.progress_bar import ProgressBar
from tapelayer.errors import (
    ControllerRefused,
    FootprintRefused,
    InputRefused,
    ModelRefused,
    NothingToSpray,
    PartBeyondReach,
    SetupRefused,
    TapelayerError,
    TargetNotWritable,
    VerificationFailed,
)
from tapelayer.jobs.contents import Content, kind_of_source, source_of
from tapelayer.jobs.job import JobResult, MachineJob
from tapelayer.jobs.kind import Form, MachineKind
from tapelayer.jobs.kinds import MachineKindName, machine_kind_of, machine_kinds
from tapelayer.language import Language
from tapelayer.reporting.subject import Occasion
from tapelayer.reporting.words import Say
from tapelayer.sentences import said
from tapelayer.setups.sections import JobSetup, read_setup
from tapelayer.units import Unit

# Faults of what all sources of a command share.
SHARED = (ControllerRefused, FootprintRefused, ModelRefused, SetupRefused)
# Errors whose texts name their file, or need none.
NAMED = (InputRefused, ModelRefused, NothingToSpray, PartBeyondReach, TargetNotWritable, VerificationFailed)


class SourceRefused(TapelayerError):
    """A source cannot be made a program of, or its program failed; each line names the source."""


@command(
    epilog="Example: [bold]tapelayer export panel.txt --setup job.toml -o panel.nc --html panel.html[/bold]  "
    "Of several files: [bold]tapelayer export *.txt -o programs[/bold]",
)
def export(
    courses: Annotated[list[str], typer.Argument(metavar="COURSES.txt", help="Course files (the paper's Table 3).")],
    setup: SetupFile = None,
    controller: LayController = None,
    kinematics: KinematicsName = None,
    unit: UnitName = "mm",
    target: Target = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    as_json: AsJson = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    language: LanguageName = None,
) -> None:
    """Plan, write, read back and verify NC programs; nothing that fails is written."""
    outputs = outputs_of(courses, target, report_file, html_file)
    made = Making("lay", unit_of(unit), setup, language_named(language), quiet, verbose, as_json, force)
    made.run(courses, outputs, controller, {"kinematics": kinematics})


@command(
    epilog="Example: [bold]tapelayer verify panel.nc panel.txt --setup job.toml[/bold]  "
    "Exit 0: passed, 1: failed, 2: bad input.",
)
def verify(
    program: Annotated[str, typer.Argument(metavar="PROGRAM.nc", help="NC program, also one edited by hand.")],
    source: Annotated[
        str, typer.Argument(metavar="COURSES.txt|MODEL.stl", help="Course file, or the model that is sprayed.")
    ],
    setup: SetupFile = None,
    controller: EitherController = None,
    kinematics: KinematicsName = None,
    unit: UnitName = "mm",
    direction_deg: Direction = None,
    pitch_mm: Pitch = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    as_json: AsJson = False,
    force: Annotated[
        bool,
        typer.Option("--force", help="Judge a program made with another setup, and replace files as export does."),
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    language: LanguageName = None,
) -> None:
    """Judge an NC program by its text against its courses, or against the model that it sprays."""
    options = {"kinematics": kinematics, "direction_deg": direction_deg, "pitch_mm": pitch_mm}
    check_order(program, source)
    name = kind_of_source(content_at(source))
    _refuse_others(machine_kind_of(name), options)
    units, spoken = unit_of(unit), language_named(language)
    (outputs,) = outputs_of([program], None, report_file, html_file)
    with ProgressBar(quiet, verbose) as steps:
        steps.begin(f"reading {source}")
        text = bytes_of(program)
        values = setup_of(name, setup, controller, options)
        job = read_job(machine_kind_of(name), source, values, units)
        written = [file for file in (outputs.report, outputs.html) if file is not None]
        check_outputs(values, [program, source, setup], written, force)
        with expecting(program, Content(Form.PROGRAM)), _naming(source):
            result = job.judge(text, program, force, steps)
        occasion = occasion_of(program, setup)
        write_files(outputs.reports(result, occasion, spoken))
    for remark in result.remarks:
        sys.stderr.write(f"{said(remark)}\n")
    if as_json:
        print_json(result.report_file(occasion))
    if not quiet:
        conclude(result, program, notices if as_json else output, spoken)
    if result.failure:
        raise result.failure


@command(
    epilog="Example: [bold]tapelayer spray hood.stl --direction-deg 90 -o hood.nc --html hood.html[/bold]",
)
def spray(
    model: Annotated[list[str], typer.Argument(metavar="MODEL.stl", help="The parts' surfaces: STL, STEP or IGES.")],
    setup: SetupFile = None,
    unit: UnitName = "mm",
    direction_deg: Direction = None,
    pitch_mm: Pitch = None,
    controller: SprayController = None,
    target: Target = None,
    trajectory_file: Annotated[
        str | None,
        typer.Option(
            "--trajectory", metavar="OUT.txt", help="Write the gun's poses in the part's frame; of several, a folder."
        ),
    ] = None,
    report_file: ReportFile = None,
    html_file: HtmlFile = None,
    as_json: AsJson = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    language: LanguageName = None,
) -> None:
    """Plan, write, read back and verify spraying programs; nothing that fails is written."""
    outputs = outputs_of(model, target, report_file, html_file, trajectory_file)
    made = Making("spray", unit_of(unit), setup, language_named(language), quiet, verbose, as_json, force)
    made.run(model, outputs, controller, {"direction_deg": direction_deg, "pitch_mm": pitch_mm})


@dataclass(frozen=True)
class Making:
    """How programs are made of sources of one kind, and what is said of them.

    Attributes:
        name: name of the kind.
        unit: unit of the sources' numbers.
        setup_file: the setup's file, None for the defaults.
        language: of reports and tables.
        quiet: say nothing but errors.
        verbose: say how long each step takes.
        as_json: print reports on stdout.
        force: replace others' work.
    """

    name: MachineKindName
    unit: Unit
    setup_file: str | None
    language: Language
    quiet: bool
    verbose: bool
    as_json: bool
    force: bool

    @property
    def kind(self) -> MachineKind:
        """Return the kind."""
        return machine_kind_of(self.name)

    def run(
        self,
        sources: Sequence[str],
        outputs: Sequence[Outputs],
        controller: str | None,
        options: Mapping[str, str | None],
    ) -> None:
        """Make the program of each source; a faulty source of several stops only itself.

        Raises:
            TapelayerError: nothing can be made, or the only program cannot.
            typer.Exit: one of several programs is not made; the code is the worst.
        """
        if self.as_json and outputs[0].to_stdout:
            raise OptionRefused.because("--json", "the program goes to stdout already, by -o -; leave one of them out")
        setup = setup_of(self.name, self.setup_file, controller, options)
        try:
            names = [name for each in outputs for name in each.names]
            check_outputs(setup, [*sources, self.setup_file], names, self.force)
        except TargetNotWritable:
            # A program's own name is also the default name of what would be made of it.
            for source in sources:
                check_form(source, source_of(self.kind.source.form))
            raise
        if len(sources) == 1:
            self._make_one(sources[0], outputs[0], setup)
        else:
            self._make_each(sources, outputs, setup)

    def _make_one(self, source: str, outputs: Outputs, setup: JobSetup) -> None:
        with ProgressBar(self.quiet, self.verbose) as steps:
            result, occasion = self._made(source, outputs, setup, steps)
        if self.as_json:
            print_json(result.report_file(occasion))
        if result.failure:
            raise result.failure
        if outputs.to_stdout:
            sys.stdout.buffer.write(result.text)
            sys.stdout.buffer.flush()
        if not self.quiet:
            name = Say(self.language)("the program", "程序") if outputs.to_stdout else outputs.program
            console = notices if outputs.to_stdout or self.as_json else output
            conclude(result, name, console, self.language)

    def _make_each(self, sources: Sequence[str], outputs: Sequence[Outputs], setup: JobSetup) -> None:
        worst, told = 0, {}
        for source, each in zip(sources, outputs, strict=True):
            try:
                with ProgressBar(self.quiet, self.verbose) as steps:
                    result, occasion = self._made(source, each, setup, steps)
                told[source] = result.report(occasion)
                if result.failure:
                    raise _named(source, result.failure)
            except SHARED:
                raise
            except TapelayerError as error:
                sys.stderr.write(f"{said(str(error))}\n")
                worst = max(worst, error.exit_code)
            else:
                self._report_line(result, each)
        if self.as_json:
            print_json(f"{json.dumps(told, indent=2, allow_nan=False)}\n".encode())
        if worst:
            raise typer.Exit(worst)

    def _report_line(self, result: JobResult[Any], outputs: Outputs) -> None:
        """Say in a line that a program passed, and what there is to note about it."""
        if not self.quiet:
            for note in result.notes(self.language):
                sys.stderr.write(f"{outputs.program}: {note}\n")
            _print_passed(result, outputs.program, notices if self.as_json else output, self.language)

    def _made(
        self, source: str, outputs: Outputs, setup: JobSetup, steps: ProgressBar
    ) -> tuple[JobResult[Any], Occasion]:
        """Return the result of a source, saved if it passed, and the occasion of its judgement."""
        steps.begin(f"reading {source}")
        job = read_job(self.kind, source, setup, self.unit)
        with _naming(source):
            result = job.make(outputs.program, steps)
        occasion = occasion_of("" if outputs.to_stdout else outputs.program, self.setup_file)
        if not result.failure:
            steps.begin("saving")
            outputs.save(result, occasion, self.language)
        return result, occasion


def read_job(kind: MachineKind, source: str, setup: JobSetup, unit: Unit) -> MachineJob[Any, Any]:
    """Return the job of a source."""
    with expecting(source, source_of(kind.source.form)), expecting(setup.output.controller, Content(Form.CONTROLLER)):
        return kind.read(source, setup, unit)


@contextmanager
def _naming(source: str) -> Iterator[None]:
    """Name the source in each line of a refusal that does not name its file itself."""
    try:
        yield
    except NAMED:
        raise
    except TapelayerError as error:
        raise _named(source, error) from None


def _named(source: str, error: TapelayerError) -> SourceRefused:
    named = SourceRefused("\n".join(f"{source}: {line}" for line in str(error).splitlines()))
    named.exit_code = error.exit_code
    return named


def conclude(result: JobResult[Any], name: str, console: Console, language: Language) -> None:
    """Print the summary and the notes of a result, and a last line if it passed."""
    console.print(result.summary(language))
    for note in result.notes(language):
        sys.stderr.write(f"{said(note)}\n")
    if result.evidence.passed:
        _print_passed(result, name, console, language)


def _print_passed(result: JobResult[Any], name: str, console: Console, language: Language) -> None:
    words = Say(language)(
        "{name}: {n} blocks, verified", "{name}：{n} 个程序段，校验合格", name=name, n=result.evidence.blocks
    )
    console.print(words, highlight=False, soft_wrap=True, markup=False)


def print_json(text: bytes) -> None:
    """Print the bytes of a JSON text on stdout."""
    sys.stdout.buffer.write(text)
    sys.stdout.buffer.flush()


def setup_of(
    name: MachineKindName, setup_file: str | None, controller: str | None, options: Mapping[str, str | None]
) -> JobSetup:
    """Return the setup of a file, or the default one, with the options in place of its values."""
    kind = machine_kind_of(name)
    with expecting(setup_file, Content(Form.SETUP, name)):
        setup = read_setup(setup_file, kind.setup) if setup_file else kind.setup.model_validate({})
    if controller is not None:
        with typed_as("--controller"):
            setup = setup.with_values("output", controller=controller)
    for option, place in kind.options.items():
        value = options[option]
        if value is not None:
            with typed_as(_flag(option)):
                setup = setup.with_values(place.section, **{place.key: _number_or_word(value)})
    return setup


def _number_or_word(text: str) -> float | str:
    """Return the value of an option, as a number if it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def _refuse_others(kind: MachineKind, options: Mapping[str, object]) -> None:
    """Refuse options that apply to another kind's sources only."""
    for other in machine_kinds():
        for name in other.options:
            if name not in kind.options and options[name] is not None:
                raise OptionRefused.because(_flag(name), f"belongs to {other.source.plural}; leave it out here")


def _flag(option: str) -> str:
    return f"--{option.replace('_', '-')}"
