"""Outputs: the files that a command writes, refused before any work is done where they would replace others' work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tapelayer.atomic_files import check_names, write_files
from tapelayer.errors import ProgramRefused, TargetNotWritable
from tapelayer.jobs.job import JobResult, MachineJob
from tapelayer.provenance import unedited


def check_outputs(
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
        if Path(name).is_file() and (old := bytes_of(name)) and not unedited(old):
            raise TargetNotWritable(
                f"{name}: holds what tapelayer did not write, or what was edited since; name another, or replace it "
                "with --force"
            )


def save(
    result: JobResult[Any], contents: dict[Path, bytes], title: str, report_file: str | None, html_file: str | None
) -> None:
    """Write these files and the requested reports together."""
    if report_file:
        contents[Path(report_file)] = result.report_file()
    if html_file:
        contents[Path(html_file)] = result.page_file(title)
    write_files(contents)


def bytes_of(name: str) -> bytes:
    """Return the content of a program, or of an earlier output.

    Raises:
        ProgramRefused: it cannot be read.
    """
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise ProgramRefused.unreadable(name, error) from None
