"""Offline programming for a ten-axis tape-laying gantry: courses in, verified NC programs out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tapelayer.course import Course, read_courses, write_courses
    from tapelayer.errors import TapelayerError
    from tapelayer.gantry import inverse
    from tapelayer.laying import plan
    from tapelayer.machine import Machine
    from tapelayer.setup import Setup, read_setup
    from tapelayer.trajectory import Trajectory
    from tapelayer.verification import verify
    from tapelayer.verified import Verified

__all__ = [
    "Course",
    "Machine",
    "Setup",
    "TapelayerError",
    "Trajectory",
    "Verified",
    "inverse",
    "plan",
    "read_courses",
    "read_setup",
    "verify",
    "write_courses",
]

_ROOMS = {
    "Course": "course",
    "Machine": "machine",
    "Setup": "setup",
    "TapelayerError": "errors",
    "Trajectory": "trajectory",
    "Verified": "verified",
    "inverse": "gantry",
    "plan": "laying",
    "read_courses": "course",
    "read_setup": "setup",
    "verify": "verification",
    "write_courses": "course",
}


def __getattr__(name: str) -> Any:
    """Import an export when it is first asked for (PEP 562): Pinocchio and SciPy take a second to import."""
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)


def __dir__() -> list[str]:
    """The exports, imported or not."""
    return __all__
