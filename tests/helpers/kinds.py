"""Both kinds of machine with jobs on small sources, made as a user makes them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from tapelayer.courses.course_file import format_courses
from tapelayer.jobs.job import MachineJob
from tapelayer.jobs.kinds import MACHINE_NAMES, MachineKindName, machine_kind_of
from tapelayer.laying.job import LayingResult
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import UNSEEN
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.job import SprayResult
from tapelayer.verification.failures import Findings
from tapelayer.verification.inspection import Judge
from tests.helpers.panels import sheet, stl_bytes
from tests.helpers.plies import cut_at
from tests.helpers.surfaces import flat_course, helix_course

KINDS = MACHINE_NAMES
# The moment that conftest names for every program that the tests start.
MOMENT = "2026-01-01T00:00:00Z"


@cache
def source(kind: MachineKindName) -> bytes:
    """Bytes of a small course file or model."""
    if kind == "lay":
        return format_courses(
            cut_at((flat_course(7), helix_course(8, heading=0.4, start=(0.5, -0.1))), 90, 60, 60, 120)
        )
    return stl_bytes(sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y))


def job_of_kind(kind: MachineKindName, controller: str = "") -> MachineJob[Any, Any]:
    """A job on the small source; the setup's own controller where none is named."""
    text = f'[output]\ncontroller = "{controller}"\n' if controller else ""
    setup = parse_setup(text.encode(), "setup.toml", machine_kind_of(kind).setup)
    return machine_kind_of(kind).job(source(kind), "source.txt", setup)


@cache
def made(kind: MachineKindName, controller: str = "") -> LayingResult | SprayResult:
    """The job's program, read back and judged."""
    result = job_of_kind(kind, controller).make("program.nc")
    assert isinstance(result, LayingResult | SprayResult)
    return result


def sprayed_wave() -> SprayResult:
    """The sprayer's program over a wavy sheet."""
    result = made("spray")
    assert isinstance(result, SprayResult)
    return result


@cache
def planned_of(kind: MachineKindName, controller: str = "") -> Trajectory:
    """What was to be written."""
    return job_of_kind(kind, controller).plan().trajectory


def judged(kind: MachineKindName, trajectory: Trajectory) -> Findings:
    """What verification measures on another trajectory of the small job."""
    job, judge = _judge(kind)
    return judge.judge(trajectory, job.resolution)


@cache
def _judge(kind: MachineKindName) -> tuple[MachineJob[Any, Any], Judge[Any]]:
    job = job_of_kind(kind)
    return job, job.inspector(job.basis(UNSEEN))
