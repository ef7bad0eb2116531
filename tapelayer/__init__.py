"""Offline programming for a ten-axis tape layer and a spray robot: courses or models in, verified NC programs out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tapelayer.courses.course import Course
    from tapelayer.courses.course_file import read_courses, write_courses
    from tapelayer.errors import TapelayerError, VerificationFailed
    from tapelayer.geometry.models import read_mesh
    from tapelayer.jobs.job import JobResult
    from tapelayer.laying.inspection import verify
    from tapelayer.laying.job import Job
    from tapelayer.laying.program import plan
    from tapelayer.laying.settings import Setup
    from tapelayer.machines.gantry import inverse
    from tapelayer.machines.machine import Machine
    from tapelayer.motion.trajectory import Trajectory
    from tapelayer.plies.plan import CoursePlan, plan_courses
    from tapelayer.plies.ply import Ply
    from tapelayer.reporting.subject import Occasion
    from tapelayer.setups.sections import read_setup
    from tapelayer.spraying.job import SprayJob
    from tapelayer.spraying.settings import SpraySetup
    from tapelayer.verification.verified import Verified

__all__ = [
    "Course",
    "CoursePlan",
    "Job",
    "JobResult",
    "Machine",
    "Occasion",
    "Ply",
    "Setup",
    "SprayJob",
    "SpraySetup",
    "TapelayerError",
    "Trajectory",
    "VerificationFailed",
    "Verified",
    "inverse",
    "plan",
    "plan_courses",
    "read_courses",
    "read_mesh",
    "read_setup",
    "verify",
    "write_courses",
]

_MODULES = {
    "Course": "courses.course",
    "CoursePlan": "plies.plan",
    "Job": "laying.job",
    "JobResult": "jobs.job",
    "Machine": "machines.machine",
    "Occasion": "reporting.subject",
    "Ply": "plies.ply",
    "Setup": "laying.settings",
    "SprayJob": "spraying.job",
    "SpraySetup": "spraying.settings",
    "TapelayerError": "errors",
    "Trajectory": "motion.trajectory",
    "VerificationFailed": "errors",
    "Verified": "verification.verified",
    "inverse": "machines.gantry",
    "plan": "laying.program",
    "plan_courses": "plies.plan",
    "read_courses": "courses.course_file",
    "read_mesh": "geometry.models",
    "read_setup": "setups.sections",
    "verify": "laying.inspection",
    "write_courses": "courses.course_file",
}


def __getattr__(name: str) -> Any:
    """Import an export at its first use (PEP 562), because Pinocchio and SciPy take a second to import."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """Return the exports, imported or not."""
    return __all__
