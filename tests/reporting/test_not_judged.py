"""What no verdict covers is named wherever a verdict is given, whatever the verdict is."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from tapelayer.jobs.job import JobResult
from tapelayer.jobs.kinds import MachineKindName, kind_of, machine_kind_of
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import parse_setup
from tapelayer.workbench.catalogue import list_quantities
from tests.helpers.kinds import KINDS, job_of_kind, made, source
from tests.helpers.pages import Elements
from urdf import SPRAYER, TAPELAYER

NAMES = "collision"
WITHOUT_ACCELERATIONS = "collision, acceleration, the control's own time"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damaged", [False, True], ids=["passed", "failed"])
def test_reports_name_what_is_not_judged(kind: MachineKindName, damaged: bool) -> None:
    found: JobResult[Any] = made(kind)
    if damaged:
        lines = found.text.splitlines(keepends=True)
        found = job_of_kind(kind).judge(
            b"".join([*lines[: len(lines) * 2 // 3], *lines[-2:]]), "program.nc", force=True
        )
    report = found.report()
    assert report["passed"] is not damaged
    assert report["not_judged"][:1] == NAMES.split(", ")
    assert not {"acceleration", "the control's own time"} & set(report["not_judged"])
    ((_, shown),) = Elements(found.page(Occasion("program.nc"))).of("span", "free")
    assert shown.startswith(f"not judged: {NAMES}")
    shown_there = io.StringIO()
    Console(file=shown_there, width=200).print(found.summary())
    assert f"not judged: {NAMES}" in shown_there.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_the_program_s_header_names_what_is_not_judged(kind: MachineKindName) -> None:
    assert job_of_kind(kind).provenance.not_judged == tuple(words.en for words in machine_kind_of(kind).not_judged)
    assert f"not judged: {NAMES}".encode() in b"".join(made(kind).text.splitlines()[:14])


@pytest.mark.parametrize(("kind", "urdf"), [("lay", TAPELAYER), ("spray", SPRAYER)])
def test_a_machine_without_accelerations_has_more_that_is_not_judged(
    kind: MachineKindName, urdf: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own.urdf"
    text, count = re.subn(r' acceleration="[^"]*"', "", urdf.read_text(encoding="utf-8"))
    assert count == len(job_of_kind(kind).axes)
    own.write_text(text, encoding="utf-8")
    setup = parse_setup(f'[machine]\nurdf = "{own}"\n'.encode(), "setup.toml", machine_kind_of(kind).setup)
    found = machine_kind_of(kind).job(source(kind), "source.txt", setup).make("program.nc")
    assert found.report()["not_judged"][:3] == WITHOUT_ACCELERATIONS.split(", ")
    assert f"not judged: {WITHOUT_ACCELERATIONS}".encode() in b"".join(found.text.splitlines()[:14])


def test_a_program_of_which_everything_is_judged_says_nothing() -> None:
    job = job_of_kind("lay")
    bare = replace(job, provenance=replace(job.provenance, not_judged=()))
    assert b"not judged" not in bare.make("program.nc").text


def test_the_catalogue_names_what_is_not_judged_in_both_languages() -> None:
    for told in list_quantities().kinds:
        assert [words.en for words in told.not_judged] == [words.en for words in kind_of(told.kind).not_judged]
        assert told.machine is None or [words.en for words in told.not_judged] == NAMES.split(", ")
        assert all(words.zh for words in told.not_judged)
