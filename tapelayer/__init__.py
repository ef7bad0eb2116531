"""Offline programming for a ten-axis tape-laying gantry: courses in, verified NC programs out."""

from tapelayer.course import Course, read_courses, write_courses
from tapelayer.errors import TapelayerError
from tapelayer.gantry import inverse
from tapelayer.laying import plan
from tapelayer.machine import Machine
from tapelayer.setup import Setup, read_setup
from tapelayer.trajectory import Trajectory
from tapelayer.verification import Verified, verify

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
