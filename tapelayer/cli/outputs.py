"""Outputs: the files that a command writes, refused before any work is done where they would replace others' work."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tapelayer.atomic_files import check_names, write_files
from tapelayer.cli.options import OptionRefused
from tapelayer.errors import ProgramRefused, TargetNotWritable
from tapelayer.jobs.job import JobResult
from tapelayer.language import Language
from tapelayer.provenance import moment, unedited
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import JobSetup


@dataclass(frozen=True)
class Outputs:
    """The files that are written of one source.

    Attributes:
        program: the program's file; its name in messages where it goes to stdout.
        to_stdout: whether the program goes to stdout.
        report: the JSON report's file.
        html: the page's file.
        trajectory: the file of the gun's poses.
        folders: folders that are made for them, each with the option that names it.
    """

    program: str
    to_stdout: bool
    report: str | None
    html: str | None
    trajectory: str | None
    folders: Mapping[Path, str]

    @property
    def names(self) -> list[str]:
        """Return the names of the files."""
        program = None if self.to_stdout else self.program
        return [name for name in (program, self.trajectory, self.report, self.html) if name is not None]

    def save(self, result: JobResult[Any], occasion: Occasion, language: Language) -> None:
        """Write the program, its trajectory file and its reports together.

        Raises:
            TargetNotWritable: one of them cannot be written; none is.
        """
        for folder, option in self.folders.items():
            make_folder(folder, option)
        contents = {} if self.to_stdout else {Path(self.program): result.text}
        if self.trajectory is not None:
            contents[Path(self.trajectory)] = result.files()["trajectory.txt"]
        contents |= self.reports(result, occasion, language)
        write_files(contents)

    def reports(self, result: JobResult[Any], occasion: Occasion, language: Language) -> dict[Path, bytes]:
        """Return the contents of the reports that are wanted, by file."""
        contents = {}
        if self.report is not None:
            contents[Path(self.report)] = result.report_file(occasion)
        if self.html is not None:
            contents[Path(self.html)] = result.page_file(occasion, language)
        return contents


def occasion_of(program: str, setup: str | None) -> Occasion:
    """Return the occasion of a judgement now, or at the moment that SOURCE_DATE_EPOCH names.

    Args:
        program: the program's file; empty where it has none.
        setup: the setup's file, None where there is none.
    """
    judged_at = moment(time.time(), os.environ.get("SOURCE_DATE_EPOCH"))
    return Occasion(Path(program).name, Path(setup or "").name, judged_at)


def outputs_of(
    sources: Sequence[str], target: str | None, report: str | None, html: str | None, trajectory: str | None = None
) -> list[Outputs]:
    """Return the outputs of each source: an option names the file of one source, and the folder of several.

    Raises:
        OptionRefused: an option names a file for several sources, or two sources' outputs would have one name.
    """
    several = len(sources) > 1
    if several:
        _check_stems(sources)
    options = {"-o": target, "--report": report, "--html": html, "--trajectory": trajectory}
    for option, name in options.items():
        if name == "-" and option != "-o":
            raise TargetNotWritable(
                "-: is no name of a report; only the program goes to stdout, by -o -, or the JSON report, by --json"
            )
        if several and name is not None and (name == "-" or Path(name).exists() and not Path(name).is_dir()):
            raise OptionRefused.because(f"{option} {name}", "is no folder; several programs go to a folder, name one")
    return [_outputs(source, options, several) for source in sources]


def _outputs(source: str, options: Mapping[str, str | None], several: bool) -> Outputs:
    folders: dict[Path, str] = {}

    def named(option: str, ending: str) -> str | None:
        name = options[option]
        if name is None:
            return None
        if several or name.endswith(os.sep) or Path(name).is_dir():
            folders[Path(name)] = option
            return str(Path(name) / (Path(source).stem + ending))
        return name

    return Outputs(
        program=named("-o", ".nc") or Path(source).stem + ".nc",
        to_stdout=options["-o"] == "-",
        report=named("--report", ".json"),
        html=named("--html", ".html"),
        trajectory=named("--trajectory", ".txt"),
        folders=folders,
    )


def _check_stems(sources: Sequence[str]) -> None:
    """Refuse sources whose programs would have one name."""
    first: dict[str, str] = {}
    for source in sources:
        stem = Path(source).stem
        if other := first.get(stem.casefold()):
            raise OptionRefused.because(
                source, f"its program would have the name of that of {other}, {stem}.nc; give them one by one"
            )
        first[stem.casefold()] = source


def check_outputs(setup: JobSetup, inputs: Sequence[str | None], outputs: Sequence[str], force: bool) -> None:
    """Refuse outputs that would replace an input, each other, or, unless forced, work that is not tapelayer's.

    Args:
        setup: of the job; the files that it names are inputs.
        inputs: files that are read, None where there is none.
        outputs: files that are to be written.
        force: whether others' work may be replaced.

    Raises:
        TargetNotWritable: as said, before any work is done.
    """
    values = setup.model_dump()
    named = [values[section][key] for section, key in (*setup.FILES, ("output", "controller"))]
    check_names([name for name in (*inputs, *named) if name], outputs)
    for name in () if force else outputs:
        if Path(name).is_file() and (old := bytes_of(name)) and not unedited(old):
            raise TargetNotWritable(
                f"{name}: holds what tapelayer did not write, or what was edited since; name another, or replace it "
                "with --force"
            )


def make_folder(folder: Path, option: str) -> None:
    """Make a folder, unless there is one.

    Raises:
        TargetNotWritable: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise TargetNotWritable(f"{folder}: cannot be made a folder: {reason}; name another by {option}") from None


def bytes_of(name: str) -> bytes:
    """Return the content of a program, or of an earlier output.

    Raises:
        ProgramRefused: it cannot be read.
    """
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise ProgramRefused.unreadable(name, error) from None
