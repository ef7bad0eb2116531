"""Job: a course file becomes a program of the tape layer, read back and judged."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from post.controllers import Controller, load
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import CourseFileRefused
from tapelayer.jobs.job import JobResult, MachineJob, is_timed, machine_of
from tapelayer.jobs.part_size import check_size
from tapelayer.jobs.result import UNTOLD
from tapelayer.jobs.stages import PLANNING
from tapelayer.language import Language
from tapelayer.laying import page
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.inspection import Inspector
from tapelayer.laying.program import plan
from tapelayer.laying.quantities import ROWS
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import Steps
from tapelayer.provenance import VERSION, Provenance
from tapelayer.reporting.not_judged import english, unjudged
from tapelayer.reporting.quantity import beyond_limits, numbers
from tapelayer.reporting.subject import Occasion
from tapelayer.reporting.summary import summary
from tapelayer.reporting.words import Say
from tapelayer.units import MM, Unit
from urdf import TAPELAYER


@dataclass(frozen=True, eq=False)
class Job(MachineJob[None, Evidence]):
    """Everything that a program of the tape layer is made from.

    Attributes:
        courses: in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        controller: the control's table.
        provenance: the sources named in the program's header.
    """

    setup: Setup
    courses: tuple[Course, ...]

    SOURCE = "course file"
    PART = "course"

    @staticmethod
    def read(path: Path | str, setup: Setup, unit: Unit = "mm") -> Job:
        """Return the job of a course file.

        Raises:
            CourseFileRefused: the file cannot be read.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
        """
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise CourseFileRefused.unreadable(str(path), error) from None
        return Job.of(data, str(path), setup, unit)

    @staticmethod
    def of(data: bytes, name: str, setup: Setup, unit: Unit = "mm") -> Job:
        """Return the job of the bytes of a course file.

        Args:
            data: the file's bytes.
            name: the file's name in messages; the program's header has the base name.
            setup: the job's values.
            unit: unit of the file's lengths.

        Raises:
            CourseFileRefused: the bytes are not a course file, or its part is of a size that is none for the machine.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
        """
        controller = load(setup.output.controller)
        machine = machine_of(setup, TAPELAYER)
        machine.check_travel(machine.names)
        controller.check_units({axis.name: axis.revolute for axis in machine.axes})
        courses = parse_courses(data, name, unit)
        points = np.concatenate([course.points for course in courses])
        check_size(points, unit, machine, ("the tape", setup.tape.width_mm * MM), name, CourseFileRefused)
        provenance = Provenance(
            source=Path(name).name,
            source_sha256=hashlib.sha256(data).hexdigest(),
            setup_sha256=setup.sha256(machine.path.read_bytes()),
            version=VERSION,
            notes=() if unit == "mm" else (f"courses in {unit}",),
            not_judged=english(unjudged(is_timed(machine, controller))),
        )
        return Job(setup, machine, controller, provenance, courses)

    @property
    def axes(self) -> tuple[str, ...]:
        """Return the names of all axes of the machine."""
        return self.machine.names

    @property
    def writer(self) -> Controller:
        """Return the control's table, without arcs where words lead their effects.

        The words are placed by the time of straight blocks, and an arc in their place takes another.
        """
        if not any(self.setup.head.delays_ms.model_dump().values()):
            return self.controller
        straight = self.controller.arcs.model_copy(update={"planes": ()})
        return self.controller.model_copy(update={"arcs": straight})

    @property
    def parts(self) -> int:
        """Return the number of courses."""
        return len(self.courses)

    def numbers(self, trajectory: Trajectory) -> Sequence[int]:
        """Return the numbers of the courses in their file."""
        return [course.number for course in self.courses]

    def planned(self, steps: Steps) -> tuple[None, Trajectory]:
        """Return the planned trajectory, with no basis: it is judged against the courses themselves.

        Raises:
            TapelayerError: the job cannot be done on this machine.
        """
        steps.begin(PLANNING.name, self.parts)
        exclusive = frozenset(joint for axis in self.controller.axes if axis.alone for joint in axis.joints)
        return None, plan(self.courses, self.setup, self.machine, exclusive, steps.tick, self.rule)

    def basis(self, steps: Steps) -> None:
        """Return nothing: a program is judged against the courses themselves."""

    @cached_property
    def _inspector(self) -> Inspector:
        return Inspector(self.courses, self.setup, self.machine, self.rule)

    def inspector(self, plan: None) -> Inspector:
        """Return the judge of trajectories for these courses."""
        return self._inspector

    def result(
        self,
        plan: None,
        trajectory: Trajectory,
        evidence: Evidence,
        text: bytes,
        remarks: tuple[str, ...],
        steps: Steps,
    ) -> LayingResult:
        """Return the result of the job, held against the limits that a setup may leave out."""
        late = beyond_limits(ROWS, evidence, evidence)
        evidence = replace(evidence, failures=(*evidence.failures, *late))
        return LayingResult(trajectory, evidence, text, remarks, self)


@dataclass(frozen=True, eq=False)
class LayingResult(JobResult[Evidence]):
    """The result of a job of the tape layer.

    Attributes:
        job: the job that was done.
    """

    job: Job

    def numbers(self) -> dict[str, Any]:
        """Return the verdict and all that was measured; docs/report.md describes every key."""
        return numbers(ROWS, self.evidence, self.evidence, self.job.not_judged)

    def summary(self, language: Language = "en") -> Table:
        """Return the report as a table for a terminal."""
        return summary(ROWS, self.numbers(), self.evidence.limits, self.job.not_judged, say=Say(language))

    def page(self, occasion: Occasion = UNTOLD, language: Language = "en") -> str:
        """Return the report as one HTML page with plots; its title is the program's name."""
        report, not_judged = self.report(occasion), self.job.not_judged
        return page.html(self.evidence, self.trajectory, report, self.job.setup, not_judged, Say(language))

    def notes(self, language: Language = "en") -> tuple[str, ...]:
        """Return a note on the errors of the published form, if it was used."""
        if self.job.setup.process.kinematics != "published":
            return ()
        report = self.numbers()
        note = Say(language)(
            "published kinematics: the roller leaves the surface by up to {tilt:.2f} deg (edge lift {lift:.2f} mm), "
            "heading up to {heading:.2f} deg off, centre up to {offset:.2f} mm; judged only where [verification] "
            "itself sets these limits",
            "published 运动学：压辊偏离曲面至多 {tilt:.2f} deg（带边翘起 {lift:.2f} mm），"
            "航向偏差至多 {heading:.2f} deg，辊心偏移至多 {offset:.2f} mm；"
            "仅当 [verification] 自行设定这些限值时才作判定",
            tilt=report["max_roller_tilt_deg"],
            lift=report["max_edge_lift_mm"],
            heading=report["max_heading_error_deg"],
            offset=report["max_roller_offset_mm"],
        )
        return (note,)
