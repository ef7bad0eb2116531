"""Driven course: the gantry's poses at the block ends of a course."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import TapeRunsBack
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.laying.linearisation import Poses, block_ends, course_motion, nearest_point
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.units import DEG, MM


@dataclass(frozen=True, eq=False)
class DrivenCourse:
    """A course as the gantry drives it: the poses at its block ends and the direction in which it leaves.

    Attributes:
        path: the course in `machine` axes.
        laid: poses at the block ends.
        shortened: (n,) metres by which the tape path to the nip is shorter than on a level surface.
        out: (3,) unit tangent at the end, `machine` axes.
    """

    path: Toolpath
    laid: Poses
    shortened: Floats
    out: Floats

    @property
    def length(self) -> float:
        """Return the length of the course in metres."""
        return float(self.laid.arc_lengths[-1])


def driven_course(path: Toolpath, setup: Setup, lengths: gantry.Lengths, radius: float) -> DrivenCourse:
    """Return a course as the gantry drives it.

    Args:
        path: the course in `machine` axes.
        setup: the job's values.
        lengths: of the head, metres.
        radius: of the roller that the tape wraps round, metres; 0 if the wrap is not compensated.

    Raises:
        PoseUndefined: a point has no roller pose.
        TapeRunsBack: the tape would have to run back under the shoe.
    """
    process = setup.process
    motion = course_motion(path, lengths, process.kinematics, radius)
    laid = block_ends(motion, process.tolerance_mm * MM, process.tolerance_deg * DEG)
    shortened = radius * laid.wrap
    back = np.flatnonzero(~(np.diff(laid.arc_lengths - shortened) >= 0.0))
    if len(back):
        point = nearest_point(path, float(laid.arc_lengths[back[0]]))
        raise TapeRunsBack(
            f"course {path.number} point {point}: the tape would run back under the shoe, because the surface is "
            "hollow and tighter than the roller; set [head] wrap_compensation = false"
        )
    return DrivenCourse(path, laid, shortened, motion.curve.at(laid.arc_lengths[-1:])[2][0])
