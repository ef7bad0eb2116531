"""Both kinds of job on small sources, made as a user makes them."""

from __future__ import annotations

from functools import cache

import numpy as np

from tapelayer.courses.course_file import format_courses
from tapelayer.jobs.kinds import MODELS, JobKind
from tapelayer.laying.job import Job, Made
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Trajectory
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.inspection import SprayInspector
from tapelayer.spraying.job import SprayJob, SprayMade
from tapelayer.spraying.settings import SpraySetup
from tapelayer.verification.failures import Findings
from tests.helpers.panels import sheet, stl_bytes
from tests.helpers.plies import cut_at
from tests.helpers.surfaces import flat_course, helix_course

KINDS: tuple[JobKind, ...] = tuple(MODELS)


@cache
def source(kind: JobKind) -> bytes:
    """Bytes of a small course file or model."""
    if kind == "lay":
        return format_courses(
            cut_at((flat_course(7), helix_course(8, heading=0.4, start=(0.5, -0.1))), 90, 60, 60, 120)
        )
    return stl_bytes(sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y))


def job_of_kind(kind: JobKind, controller: str = "") -> Job | SprayJob:
    """A job on the small source; the setup's own controller where none is named."""
    text = f'[output]\ncontroller = "{controller}"\n' if controller else ""
    setup = parse_setup(text.encode(), "setup.toml", MODELS[kind])
    if isinstance(setup, SpraySetup):
        return SprayJob.of(source(kind), "source.stl", setup)
    assert isinstance(setup, Setup)
    return Job.of(source(kind), "source.txt", setup)


@cache
def made(kind: JobKind, controller: str = "") -> Made | SprayMade:
    """The job's program, read back and judged."""
    return job_of_kind(kind, controller).make("program.nc")


def sprayed_wave() -> SprayMade:
    """The sprayer's program over a wavy sheet."""
    found = made("spray")
    assert isinstance(found, SprayMade)
    return found


@cache
def planned_of(kind: JobKind, controller: str = "") -> Trajectory:
    """What was to be written."""
    job = job_of_kind(kind, controller)
    return job.plan().trajectory if isinstance(job, Job) else job.spraying().trajectory


def judged(kind: JobKind, trajectory: Trajectory) -> Findings:
    """What verification measures on another trajectory of the small job."""
    job = made(kind).job
    inspector = job.inspector if isinstance(job, Job) else _inspector()
    return inspector.examine(trajectory, job.resolution)


@cache
def _inspector() -> SprayInspector:
    job = sprayed_wave().job
    return job.inspector(job.spraying())
