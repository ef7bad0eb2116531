"""Jobs: made and examined as step by step, for both machines; what fails says why and keeps its evidence."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from tapelayer.errors import ProgramOfOtherSetup
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.job import Job, LayingResult
from tapelayer.laying.settings import Setup
from tapelayer.reporting.subject import Occasion
from tapelayer.spraying.job import SprayJob, SprayResult
from tapelayer.spraying.settings import SpraySetup
from tapelayer.verification.verified import Verified
from tests.helpers.panels import flat, sheet, write_stl
from tests.helpers.paths import EXAMPLES

COURSES = EXAMPLES / "cylinder_panel_15.txt"


class Told:
    """Steps that are written down: each with its ticks asked for and had."""

    def __init__(self) -> None:
        self.steps: list[tuple[str, int | None, int]] = []

    def begin(self, step: str, ticks: int | None = None) -> None:
        self.steps.append((step, ticks, 0))

    def tick(self) -> None:
        step, ticks, had = self.steps[-1]
        self.steps[-1] = (step, ticks, had + 1)


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("spray") / "plate.stl"
    write_stl(path, sheet(np.linspace(0, 300, 7), [0, 50, 100], flat))
    return path


def limited(**limits: float) -> Setup:
    return Setup().with_values("verification", **limits)


@pytest.fixture(scope="module")
def laid() -> LayingResult:
    return Job.read(COURSES, Setup()).make("panel.nc")


def test_a_program_is_what_its_steps_make(laid: LayingResult) -> None:
    job = Job.of(COURSES.read_bytes(), f"elsewhere/{COURSES.name}", Setup())
    text = job.text(job.plan())
    assert laid.text == text
    judged = job.verify(job.read_back(text, "panel.nc").trajectory)
    assert laid.failure is None
    assert laid.evidence.failures == judged.evidence.failures == ()
    assert laid.report()["program_sha256"] == hashlib.sha256(text).hexdigest()
    assert laid.report() == job.judge(text, "panel.nc").report()


@pytest.mark.parametrize("kind", ["lay", "spray"])
def test_every_step_is_told_with_its_ticks(kind: str, plate: Path) -> None:
    told = Told()
    job = Job.read(COURSES, Setup()) if kind == "lay" else SprayJob.read(plate, SpraySetup())
    job.make("a.nc", told)
    names = [step for step, _, _ in told.steps]
    lay = ["planning", "verifying the plan", "writing", "reading back", "verifying"]
    assert names == lay if kind == "lay" else ["slicing", *lay, "measuring the coat"]
    assert all(ticks in (None, had) for _, ticks, had in told.steps)


def test_a_plan_that_fails_has_no_text() -> None:
    made = Job.read(COURSES, limited(max_position_error_mm=1e-6)).make("panel.nc")
    assert made.text == b""
    assert made.failure is not None
    assert "position_error_mm" in str(made.failure)
    report = made.report()
    assert (report["passed"], report["program_sha256"]) == (False, "")
    assert len(made.trajectory.lines) and not made.trajectory.lines.any()
    json.dumps(report, allow_nan=False)
    assert "FAILED" in made.page(Occasion("panel.nc"))


def test_a_text_that_fails_keeps_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan is rounded as its text is, so the text is spoilt here: half a millimetre more tape in one block."""
    write = Job.text

    def spoilt(job: Job, planned: Verified[Evidence]) -> bytes:
        before, word, after = write(job, planned).partition(b"M27\n")
        u = re.search(rb" U([\d.]+)", after)
        assert word and u is not None
        return before + word + after[: u.start()] + b" U%.3f" % (float(u[1]) + 0.5) + after[u.end() :]

    monkeypatch.setattr(Job, "text", spoilt)
    made = Job.read(COURSES, Setup()).make("panel.nc")
    assert made.failure is not None
    assert made.text.startswith(b"%")
    assert made.trajectory.lines.all()
    assert "tape_error_mm" in {failure.what for failure in made.evidence.failures}


@pytest.mark.parametrize("kind", ["lay", "spray"])
def test_a_program_of_another_setup_is_judged_only_by_force(kind: str, plate: Path, laid: LayingResult) -> None:
    if kind == "lay":
        made: LayingResult | SprayResult = laid
        other: Job | SprayJob = Job.read(COURSES, limited(max_tape_error_mm=0.06))
    else:
        made = SprayJob.read(plate, SpraySetup()).make("plate.nc")
        other = SprayJob.read(plate, SpraySetup().with_values("verification", max_position_error_mm=0.06))
    with pytest.raises(
        ProgramOfOtherSetup, match=r"^p\.nc: its header names the setup [0-9a-f]{12}\.\.\., this one is"
    ):
        other.judge(made.text, "p.nc")
    assert other.judge(made.text, "p.nc", force=True).failure is None


def test_a_program_of_another_file_is_remarked_on(laid: LayingResult) -> None:
    other = Job.of(COURSES.read_bytes() + b"\n", COURSES.name, Setup())
    made = other.judge(laid.text, "p.nc")
    assert made.remarks == ("p.nc: its header names another course file than cylinder_panel_15.txt",)
    assert laid.job.judge(laid.text, "p.nc").remarks == ()


def test_spraying_by_bytes_is_spraying_by_path(plate: Path) -> None:
    by_path = SprayJob.read(plate, SpraySetup()).make("plate.nc")
    by_bytes = SprayJob.of(plate.read_bytes(), "plate.stl", SpraySetup()).make("plate.nc")
    assert by_path.text == by_bytes.text
    assert by_path.report() == by_bytes.report()
    assert by_path.poses() == by_bytes.poses()
    assert by_path.page(Occasion("a")) == by_bytes.page(Occasion("a"))
