"""Driven course: a course as the gantry drives it, and its block ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import TapeRunsBack
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.laying.linearisation import CourseMotion, Poses, block_ends, course_motion, nearest_point, usual_block
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.units import DEG, MM

# Most steps towards the place where some tape is fed, and the last one's length in metres.
PLACE_STEPS, PLACED = 60, 1e-11


@dataclass(frozen=True, eq=False)
class DrivenCourse:
    """A course as the gantry drives it.

    Attributes:
        motion: the gantry along the course.
        ends: poses at its two ends.
        out: (3,) unit tangent at the end, `machine` axes.
    """

    motion: CourseMotion
    ends: Poses
    out: Floats

    @property
    def path(self) -> Toolpath:
        """Return the course in `machine` axes."""
        return self.motion.toolpath

    @property
    def length(self) -> float:
        """Return the length of the course in metres."""
        return float(self.ends.arc_lengths[-1])

    def usual_block(self, setup: Setup) -> float:
        """Return the median length of the blocks that keep the tolerances, metres."""
        process = setup.process
        return usual_block(self.motion, process.tolerance_mm * MM, process.tolerance_deg * DEG)

    def shortened(self, poses: Poses) -> Floats:
        """Return the metres (n,) by which the tape path to the nip is shorter than on a level surface."""
        shorter: Floats = self.motion.wrap_radius * poses.wrap
        return shorter

    def places(self, fed: Floats) -> Floats:
        """Return the arc lengths (n,) at which (n,) metres of tape, counted from the course's station, are fed."""
        # Between the file's points the wrap hardly bends, and each step leaves a share of what is off.
        points = self.motion.at_points
        reached = np.maximum.accumulate(points.arc_lengths - self.shortened(points))
        places = np.interp(fed, reached, points.arc_lengths)
        for _ in range(PLACE_STEPS):
            poses = self.motion.poses(places)
            nearer = np.clip(fed + self.shortened(poses), 0.0, self.length)
            off, places = np.max(np.abs(nearer - places), initial=0.0), nearer
            if off <= PLACED:
                break
        return places

    def laid(self, setup: Setup, required: Floats) -> Poses:
        """Return the poses at the block ends of the course, some of them at required arc lengths in metres.

        Raises:
            PoseUndefined: the tolerances cannot be kept by any block.
            TapeRunsBack: the tape would have to run back under the shoe.
        """
        process = setup.process
        laid = block_ends(self.motion, process.tolerance_mm * MM, process.tolerance_deg * DEG, required)
        back = np.flatnonzero(~(np.diff(laid.arc_lengths - self.shortened(laid)) >= 0.0))
        if len(back):
            point = nearest_point(self.path, float(laid.arc_lengths[back[0]]))
            raise TapeRunsBack(
                f"course {self.path.number} point {point}: the tape would run back under the shoe, because the surface "
                "is hollow and tighter than the roller; set [head] wrap_compensation = false"
            )
        return laid


def driven_course(path: Toolpath, setup: Setup, lengths: gantry.Lengths, radius: float) -> DrivenCourse:
    """Return a course as the gantry drives it.

    Args:
        path: the course in `machine` axes.
        setup: the job's values.
        lengths: of the head, metres.
        radius: of the roller that the tape wraps round, metres; 0 if the wrap is not compensated.

    Raises:
        PoseUndefined: a point has no roller pose.
    """
    motion = course_motion(path, lengths, setup.process.kinematics, radius)
    ends = motion.poses(motion.curve.knots[[0, -1]])
    return DrivenCourse(motion, ends, motion.curve.at(ends.arc_lengths[-1:])[2][0])
