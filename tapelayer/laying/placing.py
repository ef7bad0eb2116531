"""Placing: the courses in `machine` axes, where the setup puts the part."""

from __future__ import annotations

from collections.abc import Sequence

from tapelayer.courses.course import Course
from tapelayer.geometry.toolpath import Toolpath, to_machine
from tapelayer.laying.settings import Setup
from tapelayer.units import MM


def courses_in_machine(courses: Sequence[Course], setup: Setup) -> list[Toolpath]:
    """Return courses in `machine` axes, where the setup puts the part and on the plies already laid."""
    origin = (setup.part.l1_mm * MM, setup.part.l2_mm * MM, -setup.part.l3_mm * MM)
    return [to_machine(c, setup.part.rotation_rad(), origin, setup.part.laid_thickness_mm * MM) for c in courses]
