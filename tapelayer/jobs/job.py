"""Job: turns a source, a setup, a machine and a control into a program that is read back and judged."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from post import program, reader
from post.controllers import Controller
from tapelayer.arrays import Floats
from tapelayer.errors import ModelRefused, VerificationFailed
from tapelayer.jobs.part_names import part_names, placed
from tapelayer.jobs.result import UNTOLD, Result
from tapelayer.jobs.stages import READING_BACK, VERIFYING, VERIFYING_PLAN, WRITING
from tapelayer.machines.machine import Machine
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.progress import UNSEEN, Steps, Tick, silent
from tapelayer.provenance import VERSION, NamedFile, Provenance
from tapelayer.reporting.not_judged import unjudged
from tapelayer.reporting.subject import Occasion, Subject
from tapelayer.reporting.words import Words
from tapelayer.setups.forms import changes
from tapelayer.setups.sections import UNIT_PAIRS, JobSetup
from tapelayer.verification.failures import Findings
from tapelayer.verification.inspection import Judge
from tapelayer.verification.verified import Verified, failure_of

Plan = TypeVar("Plan")
Evidence = TypeVar("Evidence", bound=Findings)


@dataclass(frozen=True, eq=False)
class JobResult(Result, Generic[Evidence]):
    """The result of a machine's job: a program, and the measurements made when judging it.

    Attributes:
        trajectory: as read back from the text; as planned where already the plan failed.
        evidence: verification's measurements on it.
        text: bytes of the program; empty where the plan failed.
        remarks: sentences to print beside the verdict.
        job: the job that was done.
    """

    trajectory: Trajectory
    evidence: Evidence
    text: bytes
    remarks: tuple[str, ...]
    job: MachineJob[Any, Evidence]

    @property
    def failure(self) -> VerificationFailed | None:
        """Why the program may not be used; None where it passed."""
        return failure_of(self.evidence)

    def told(self) -> dict[str, Any]:
        """Return the control that the program is for."""
        return {"controller": self.job.setup.output.controller}

    def report(self, occasion: Occasion = UNTOLD) -> dict[str, Any]:
        """Return the report as plain values for JSON: the same for the same job, program and occasion."""
        subject = self.job.subject(occasion, self.evidence.program_sha256).values()
        return {"version": VERSION, "subject": subject, **self.numbers()}


@dataclass(frozen=True, eq=False)
class MachineJob(ABC, Generic[Plan, Evidence]):
    """The inputs of a program.

    Attributes:
        setup: the job's values.
        machine: with the setup's limits already in it.
        controller: the control's table.
        provenance: the program's sources, for its header.
    """

    setup: JobSetup
    machine: Machine
    controller: Controller
    provenance: Provenance

    # Name of this kind of source, and of the parts of a program.
    SOURCE: ClassVar[str]
    PART: ClassVar[str]

    @property
    @abstractmethod
    def axes(self) -> tuple[str, ...]:
        """The axes that a program moves."""

    @property
    def rule(self) -> Rule:
        """Return how the control turns the blocks of a program into motion."""
        return self.controller.rule(self.axes)

    @property
    def timed(self) -> bool:
        """Whether the time on the control is predicted, with the axes' accelerations."""
        return is_timed(self.machine, self.controller)

    @property
    def not_judged(self) -> tuple[Words, ...]:
        """What no verdict on a program of this job covers."""
        return unjudged(self.timed)

    @property
    @abstractmethod
    def parts(self) -> int:
        """Number of courses or passes."""

    def subject(self, occasion: Occasion, program_sha256: str) -> Subject:
        """Return what a report on a program of this job is about.

        Args:
            occasion: what the caller knows.
            program_sha256: SHA-256 of the program, hexadecimal; empty for a plan.
        """
        made, machine, control = self.provenance, self.machine, self.controller
        return Subject(
            sources=made.sources,
            setup=NamedFile(occasion.setup, made.setup_sha256),
            changed=changes(self.setup),
            machine=str(machine.model.name),
            urdf=NamedFile(machine.path.name, machine.sha256),
            controller=NamedFile(control.name, control.sha256),
            program=NamedFile(occasion.program, program_sha256),
            version=made.version,
            judged_at=occasion.judged_at,
        )

    @abstractmethod
    def numbers(self, trajectory: Trajectory) -> Sequence[int]:
        """Return the numbers of the courses or passes of a trajectory, by index."""

    @abstractmethod
    def planned(self, steps: Steps) -> tuple[Plan, Trajectory]:
        """Return the plan of the job, and the trajectory that follows from it.

        Raises:
            TapelayerError: the job cannot be done on this machine.
        """

    @abstractmethod
    def basis(self, steps: Steps) -> Plan:
        """Return the plan by which to judge a program that was read from text.

        Raises:
            TapelayerError: the job cannot be done on this machine.
        """

    @abstractmethod
    def inspector(self, plan: Plan) -> Judge[Evidence]:
        """Return the judge of trajectories for this job."""

    @abstractmethod
    def result(
        self,
        plan: Plan,
        trajectory: Trajectory,
        evidence: Evidence,
        text: bytes,
        remarks: tuple[str, ...],
        steps: Steps,
    ) -> JobResult[Evidence]:
        """Return the result of the job."""

    def levels(self) -> Mapping[Event, float]:
        """Return the values to write beside switching words."""
        return {}

    def make(self, name: str, steps: Steps = UNSEEN) -> JobResult[Evidence]:
        """Plan, write, read back and judge a program; `JobResult.failure` is None if it may be used.

        Args:
            name: of the program, for messages.
            steps: receiver of progress.

        Raises:
            TapelayerError: the job cannot be done on this machine.
        """
        plan, trajectory = self.planned(steps)
        judge = self.inspector(plan)
        steps.begin(VERIFYING_PLAN.name, self.parts)
        evidence, text = judge.judge(trajectory, self.resolution, steps.tick), b""
        if evidence.passed:
            steps.begin(WRITING.name)
            text = self.text(Verified(trajectory, evidence))
            # Free a long program's plan before reading the text back.
            del trajectory, evidence
            trajectory, _ = placed(self._read(text, name, steps), judge.OF, judge.numbers)
            evidence = self._judged_text(judge, trajectory, text, steps)
        return self.result(plan, trajectory, evidence, text, (), steps)

    def judge(self, text: bytes, name: str, force: bool = False, steps: Steps = UNSEEN) -> JobResult[Evidence]:
        """Judge a program by its text, even one that was edited by hand.

        Args:
            text: bytes of the program.
            name: the program as the user named it.
            force: judge it even if its header names another setup.
            steps: receiver of progress.

        Raises:
            ProgramRefused: the text cannot be read.
            ProgramOfOtherSetup: its header names another setup.
        """
        read = self._read(text, name, steps)
        if not force:
            self.provenance.check_setup(read.setup_sha256, name)
        remarks = self.provenance.remarks(read.source_sha256, name, self.SOURCE)
        plan = self.basis(steps)
        judge = self.inspector(plan)
        trajectory, wrong = placed(read, judge.OF, judge.numbers)
        remarks += wrong
        evidence = self._judged_text(judge, trajectory, text, steps)
        return self.result(plan, trajectory, evidence, text, remarks, steps)

    def plan(self, tick: Tick = silent) -> Verified[Evidence]:
        """Return the planned trajectory, verified before any text is written; `tick` is called for every part.

        Raises:
            TapelayerError: the job cannot be done on this machine, or the plan failed verification.
        """
        plan, trajectory = self.planned(_Ticks(tick))
        return self.inspector(plan).verify(trajectory, self.resolution, tick)

    def text(self, planned: Verified[Evidence]) -> bytes:
        """Return the NC text of a verified trajectory."""
        return program.write(planned, self.writer, self.provenance, self.levels(), self._names(planned.trajectory))

    @property
    def writer(self) -> Controller:
        """Return the control's table as programs are written by it."""
        return self.controller

    def _names(self, trajectory: Trajectory) -> tuple[str, ...]:
        """Return what the comments of a program call its courses or passes."""
        return part_names(self.PART, self.numbers(trajectory))

    def withheld(self, result: JobResult[Evidence], name: str) -> tuple[tuple[str, ...], Trajectory]:
        """Return the lines of a program that failed, to be read by people, and its motion with their numbers.

        Args:
            result: of this job.
            name: of the program, for messages.

        Raises:
            TapelayerError: the control has no words for a motion that failed as it was planned.
        """
        if result.text:
            return tuple(result.text.decode().splitlines()), result.trajectory
        names = self._names(result.trajectory)
        lines = program.withheld(result.trajectory, self.controller, self.provenance, self.levels(), names)
        return lines, self.read_back("\n".join(lines).encode() + b"\n", name).trajectory

    def read_back(self, text: bytes, name: str) -> reader.Program:
        """Return the program in an NC text.

        Raises:
            ProgramRefused: the text cannot be read.
        """
        limits = Limits.of([self.machine.axis(name) for name in self.axes])
        return reader.read(text, self.controller, self.axes, limits, name)

    def verify(self, trajectory: Trajectory, tick: Tick = silent) -> Verified[Evidence]:
        """Verify a trajectory that was read back from NC text.

        Raises:
            VerificationFailed: the text does not meet the source's requirements.
        """
        return self.inspector(self.basis(UNSEEN)).verify(trajectory, self.resolution, tick)

    @property
    def resolution(self) -> Floats:
        """Last written digit (k,) of each axis of a program, in metres and radians."""
        return np.array([self.controller.resolution(axis) for axis in self.axes])

    def _read(self, text: bytes, name: str, steps: Steps) -> reader.Program:
        steps.begin(READING_BACK.name)
        return self.read_back(text, name)

    def _judged_text(self, judge: Judge[Evidence], trajectory: Trajectory, text: bytes, steps: Steps) -> Evidence:
        steps.begin(VERIFYING.name, self.parts)
        evidence = judge.judge(trajectory, self.resolution, steps.tick)
        return replace(evidence, program_sha256=hashlib.sha256(text).hexdigest())


class _Ticks:
    """Steps that pass on only the ticks."""

    def __init__(self, tick: Tick) -> None:
        self.tick = tick

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Report nothing."""


def is_timed(machine: Machine, controller: Controller) -> bool:
    """Return whether the time of a machine's programs on a control is predicted, with the axes' accelerations."""
    return controller.time.corner != "none" and any(np.isfinite(axis.acceleration) for axis in machine.axes)


def machine_of(setup: JobSetup, urdf: Path) -> Machine:
    """Return the setup's machine: its URDF, or the built-in one given, with the setup's limits.

    Raises:
        ModelRefused: the URDF cannot be used, or an axis in the setup is not the machine's or has a limit in the other
            unit.
    """
    settings = setup.machine
    path = urdf if settings.urdf is None else Path(settings.urdf)
    machine = Machine.load(path)
    for linear, rotary in UNIT_PAIRS:
        for key, other, turns in ((linear, rotary, False), (rotary, linear, True)):
            for name in getattr(settings, key):
                if machine.axis(name).revolute is not turns:
                    kind = "linear" if turns else "rotary"
                    raise ModelRefused(f"[machine] {key}: axis {name} of {path.name} is {kind}; state it in {other}")
    return machine.with_limits(settings.travel(), settings.speeds(), settings.accelerations(), settings.jerks())
