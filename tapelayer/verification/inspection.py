"""Inspection: the base of both machines' judges, and the only path to an NC program."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, Generic, TypeVar

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.machines.machine import Axis, Machine
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits as AxisLimits
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.verification.axis_use import axes_used
from tapelayer.verification.breach import Breach
from tapelayer.verification.failures import Failure, Findings
from tapelayer.verification.forward_check import PINOCCHIO_AGREEMENT, forward_disagreement
from tapelayer.verification.limits import Limits
from tapelayer.verification.verified import Verified

FindingsT = TypeVar("FindingsT", bound=Findings)
# The law of a machine or control that states no accelerations: every axis reaches its speed at once.
SPEEDS_ONLY = "speeds only"


class Judge(ABC, Generic[FindingsT]):
    """A job's requirements, prepared for judging trajectories.

    Args:
        machine: with the setup's limits already in it.
        axes: those of its axes that a program moves, in the order of its columns.
        numbers: of the courses or passes, by index.
        limits: of the setup.
        rule: how the control turns blocks into motion.
    """

    # The kind of part that the numbers count, the frames to measure, and the number of last written digits by which
    # an axis's true step in a block may be less than its words state.
    OF: ClassVar[str]
    FRAMES: ClassVar[tuple[str, ...]]
    ROUNDED: ClassVar[float]

    def __init__(
        self, machine: Machine, axes: Sequence[Axis], numbers: Sequence[int], limits: Limits, rule: Rule
    ) -> None:
        self.machine, self.axes, self.numbers, self.limits, self.rule = machine, axes, numbers, limits, rule

    def verify(
        self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent
    ) -> Verified[FindingsT]:
        """Return the verified trajectory.

        Args:
            trajectory: planned, or read back from a program.
            resolution: (k,) last written digit of each axis, metres and radians, for a program read back, whose feed
                comes from rounded end points.
            tick: called once per finished course or pass.

        Raises:
            VerificationFailed: a limit or rule is broken; its evidence holds everything.
        """
        return Verified(trajectory, self.judge(trajectory, resolution, tick))

    @abstractmethod
    def judge(self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent) -> FindingsT:
        """Return the evidence on a trajectory, failures included; arguments as `verify`."""

    @property
    def _time_law(self) -> str:
        """Name of the rule by which time is predicted."""
        ramped = any(np.isfinite(axis.acceleration) for axis in self.axes)
        return self.rule.corner if ramped and self.rule.corner != "none" else SPEEDS_ONLY

    @property
    def _axis_limits(self) -> AxisLimits:
        """Speed, acceleration and jerk of the axes that a program moves."""
        return AxisLimits.of(self.axes)

    def _digits(self, resolution: Floats | None) -> Floats:
        return np.zeros(len(self.axes)) if resolution is None else resolution

    def _findings(
        self,
        trajectory: Trajectory,
        digits: Floats,
        failures: Iterable[Failure],
        later: Iterable[Failure],
        ends: Mask | bool = True,
    ) -> Findings:
        """Return the findings common to all machines, with the machine's own failures.

        Args:
            trajectory: as `judge`.
            digits: (k,) last written digit of each axis, metres and radians.
            failures: the machine's own failures to list first.
            later: those to list after a disagreement with Pinocchio.
            ends: (n,) the blocks at whose ends poses are compared with Pinocchio.
        """
        axes, beyond = axes_used(trajectory, self.axes, digits, self.ROUNDED * digits, self.rule.outputs)
        stated = ~np.any(np.isnan(trajectory.positions), axis=1)
        joints = self._configurations(trajectory.positions[stated & ends])
        disagreement = forward_disagreement(self.machine, joints, self.FRAMES)
        own = list(failures)
        if not disagreement <= PINOCCHIO_AGREEMENT:
            own.append(self._failure(0, 0, "forward_disagreement_m", disagreement, PINOCCHIO_AGREEMENT))
        return Findings(
            blocks=len(trajectory),
            duration=trajectory.duration,
            asked=float(np.sum(trajectory.requested)),
            time_law=self._time_law,
            forward_disagreement=disagreement,
            axes=axes,
            limits=self.limits,
            failures=(*own, *later, *(self._at_block(trajectory, breach) for breach in beyond)),
        )

    def _configurations(self, joints: Floats) -> Floats:
        """Return the values (n, k) of all the machine's axes for those (n, m) that a program moves."""
        return joints

    def _failure(self, number: int, point: int, what: str, value: float, limit: float, line: int = 0) -> Failure:
        return Failure(number, point, what, float(value), float(limit), line, self.OF)

    def _at_block(self, trajectory: Trajectory, breach: Breach) -> Failure:
        """Return the failure of a block, with the number of its course or pass where it has one."""
        index, line = int(trajectory.courses[breach.block]), int(trajectory.lines[breach.block])
        number = self.numbers[index] if 0 <= index < len(self.numbers) else 0
        return self._failure(number, 0, breach.what, breach.value, breach.limit, line)

    def _at_line(self, trajectory: Trajectory, breach: Breach) -> Failure:
        """Return the failure of a block that belongs to no course or pass."""
        line = int(trajectory.lines[breach.block])
        return self._failure(0, 0, breach.what, breach.value, breach.limit, line)
