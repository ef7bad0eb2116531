"""Job: one course file, one setup, one machine, one control; from here to a program that was read back and verified."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path

import numpy as np

from post import program, reader
from post.controllers import Controller, load
from tapelayer.arrays import Floats
from tapelayer.course import Course, parse_courses
from tapelayer.errors import CourseFileRefused
from tapelayer.laying import plan
from tapelayer.machine import Machine
from tapelayer.progress import Tick, silent
from tapelayer.provenance import Provenance
from tapelayer.setup import Setup
from tapelayer.trajectory import Trajectory
from tapelayer.verification import Inspector, Verified


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
        controller = load(setup.output.controller)
        path = Path(courses)
        try:
            data = path.read_bytes()
        except OSError as error:
            raise CourseFileRefused.unreadable(str(courses), error) from None
        machine = machine_of(setup)
        provenance = Provenance(
            source=path.name,
            source_sha256=hashlib.sha256(data).hexdigest(),
            setup_sha256=setup.sha256(machine.path.read_bytes()),
            version=version("tapelayer"),
        )
        return Job(parse_courses(data, str(courses)), setup, machine, controller, provenance)

    @cached_property
    def inspector(self) -> Inspector:
        """Judge of trajectories for these courses."""
        return Inspector(self.courses, self.setup, self.machine)

    def plan(self, tick: Tick = silent) -> Verified:
        """Planned trajectory, verified before there is any text; `tick` is called twice for every course.

        Raises:
            TapelayerError: the job cannot be done on this machine, or what was planned failed verification.
        """
        alone = frozenset(joint for axis in self.controller.axes if axis.alone for joint in axis.joints)
        return self.inspector.verify(plan(self.courses, self.setup, self.machine, alone, tick), tick=tick)

    def text(self, planned: Verified) -> bytes:
        """NC text of a verified trajectory."""
        return program.write(planned, self.controller, self.provenance)

    def read_back(self, text: bytes, name: str) -> reader.Program:
        """What an NC text says.

        Raises:
            ProgramRefused: the text cannot be read.
        """
        speeds = {axis.name: axis.speed for axis in self.machine.axes}
        return reader.read(text, self.controller, self.machine.names, speeds, name)

    def judge(self, trajectory: Trajectory, tick: Tick = silent) -> Verified:
        """Verified trajectory that was read back from NC text; `tick` is called for every course.

        Raises:
            VerificationFailed: the text does not do what the courses ask.
        """
        return self.inspector.verify(trajectory, self.resolution, tick)

    @property
    def resolution(self) -> Floats:
        """Last written digit (k,) of each axis, in metres and radians."""
        return np.array([self.controller.resolution(axis.name) for axis in self.machine.axes])


def machine_of(setup: Setup) -> Machine:
    """The setup's machine: its URDF, or the built-in one, with the setup's travel and speeds.

    Raises:
        ModelRefused: the URDF cannot be used, or an axis in the setup is not the machine's.
    """
    urdf = None if setup.machine.urdf is None else Path(setup.machine.urdf)
    return Machine.load(urdf).with_limits(setup.machine.travel(), setup.machine.speeds())
