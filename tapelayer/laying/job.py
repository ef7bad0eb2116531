"""Job: one course file, one setup, one machine, one control; from here to a program that was read back and verified."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from post import program, reader
from post.controllers import Controller, load
from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import CourseFileRefused, VerificationFailed
from tapelayer.laying import page, report
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.inspection import Inspector
from tapelayer.laying.program import plan
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import UNSEEN, Steps, Tick, silent
from tapelayer.provenance import VERSION, Provenance
from tapelayer.verification.verified import Verified, failure_of


@dataclass(frozen=True, eq=False)
class Job:
    """What goes into a program.

    Attributes:
        courses: in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        controller: the control's table.
        provenance: what the program's header says of its sources.
    """

    courses: tuple[Course, ...]
    setup: Setup
    machine: Machine
    controller: Controller
    provenance: Provenance

    @staticmethod
    def read(courses: Path | str, setup: Setup) -> Job:
        """Job of a course file.

        Raises:
            CourseFileRefused: the file cannot be read.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
        """
        try:
            data = Path(courses).read_bytes()
        except OSError as error:
            raise CourseFileRefused.unreadable(str(courses), error) from None
        return Job.of(data, str(courses), setup)

    @staticmethod
    def of(data: bytes, name: str, setup: Setup) -> Job:
        """Job of the bytes of a course file, which messages call by its name; the program's header has the base name.

        Raises:
            CourseFileRefused: the bytes are no course file.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
        """
        controller = load(setup.output.controller)
        machine = machine_of(setup)
        provenance = Provenance(
            source=Path(name).name,
            source_sha256=hashlib.sha256(data).hexdigest(),
            setup_sha256=setup.sha256(machine.path.read_bytes()),
            version=VERSION,
        )
        return Job(parse_courses(data, name), setup, machine, controller, provenance)

    def make(self, name: str, steps: Steps = UNSEEN) -> Made:
        """Plan, write, read back and judge a program of that name; `Made.failure` says whether it may be used.

        Raises:
            TapelayerError: the job cannot be done on this machine.
        """
        steps.begin("planning", len(self.courses))
        planned = self._planned(steps.tick)
        steps.begin("verifying the plan", len(self.courses))
        evidence = self.inspector.examine(planned, tick=steps.tick)
        if not evidence.passed:
            return Made(self, planned, evidence, b"")
        steps.begin("writing")
        text = self.text(Verified(planned, evidence))
        # A long program's plan is not kept beside what is read back.
        del planned, evidence
        steps.begin("reading back")
        trajectory = self.read_back(text, name).trajectory
        steps.begin("verifying", len(self.courses))
        return Made(self, trajectory, self.inspector.examine(trajectory, self.resolution, steps.tick), text)

    def examine(self, text: bytes, name: str, force: bool = False, steps: Steps = UNSEEN) -> Made:
        """Judge a program by its text, also one that was edited by hand.

        Args:
            text: bytes of the program.
            name: the program as the user named it.
            force: judge it although its header names another setup.
            steps: who is told what is under way.

        Raises:
            ProgramRefused: the text cannot be read.
            ProgramOfOtherSetup: its header names another setup.
        """
        steps.begin("reading back")
        read = self.read_back(text, name)
        if not force:
            self.provenance.check_setup(read.setup_sha256, name)
        remarks = self.provenance.remarks(read.source_sha256, name, "course file")
        steps.begin("verifying", len(self.courses))
        evidence = self.inspector.examine(read.trajectory, self.resolution, steps.tick)
        return Made(self, read.trajectory, evidence, text, remarks)

    @cached_property
    def inspector(self) -> Inspector:
        """Judge of trajectories for these courses."""
        return Inspector(self.courses, self.setup, self.machine)

    def plan(self, tick: Tick = silent) -> Verified[Evidence]:
        """Planned trajectory, verified before there is any text; `tick` is called twice for every course.

        Raises:
            TapelayerError: the job cannot be done on this machine, or what was planned failed verification.
        """
        return self.inspector.verify(self._planned(tick), tick=tick)

    def text(self, planned: Verified[Evidence]) -> bytes:
        """NC text of a verified trajectory."""
        return program.write(planned, self.controller, self.provenance)

    def read_back(self, text: bytes, name: str) -> reader.Program:
        """What an NC text says.

        Raises:
            ProgramRefused: the text cannot be read.
        """
        return reader.read(text, self.controller, self.machine.names, Limits.of(self.machine.axes), name)

    def judge(self, trajectory: Trajectory, tick: Tick = silent) -> Verified[Evidence]:
        """Verified trajectory that was read back from NC text; `tick` is called for every course.

        Raises:
            VerificationFailed: the text does not do what the courses ask.
        """
        return self.inspector.verify(trajectory, self.resolution, tick)

    @property
    def resolution(self) -> Floats:
        """Last written digit (k,) of each axis, in metres and radians."""
        return np.array([self.controller.resolution(axis.name) for axis in self.machine.axes])

    def _planned(self, tick: Tick) -> Trajectory:
        exclusive = frozenset(joint for axis in self.controller.axes if axis.alone for joint in axis.joints)
        return plan(self.courses, self.setup, self.machine, exclusive, tick)


@dataclass(frozen=True, eq=False)
class Made:
    """What became of a job: a program, and what was found when it was judged.

    Attributes:
        job: what it was made from.
        trajectory: as read back from the text; as planned where the plan failed already.
        evidence: what verification measured on it.
        text: bytes of the program; none where the plan failed.
        remarks: what is to be said beside the verdict.
    """

    job: Job
    trajectory: Trajectory
    evidence: Evidence
    text: bytes
    remarks: tuple[str, ...] = ()

    @property
    def failure(self) -> VerificationFailed | None:
        """Why the program may not be used; None where it passed."""
        return failure_of(self.evidence)

    def report(self) -> dict[str, Any]:
        """The report as plain values for JSON; docs/report.md describes every key."""
        return report.numbers(self.evidence, hashlib.sha256(self.text).hexdigest() if self.text else "")

    def summary(self) -> Table:
        """The report as a table for a terminal."""
        return report.summary(self.report())

    def page(self, title: str) -> str:
        """The report as one HTML page with plots, called as the program is."""
        return page.html(self.evidence, self.trajectory, self.report(), self.job.setup, title)


def machine_of(setup: Setup) -> Machine:
    """The setup's machine: its URDF, or the built-in one, with the setup's travel and speeds.

    Raises:
        ModelRefused: the URDF cannot be used, or an axis in the setup is not the machine's.
    """
    urdf = None if setup.machine.urdf is None else Path(setup.machine.urdf)
    return Machine.load(urdf).with_limits(setup.machine.travel(), setup.machine.speeds())
