"""Job: a model becomes a program of the spray robot, read back and judged."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from post.controllers import load
from tapelayer.arrays import Floats
from tapelayer.errors import MeshRefused
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.models import parse_mesh
from tapelayer.jobs.job import JobResult, MachineJob, is_timed, machine_of
from tapelayer.jobs.part_size import check_size
from tapelayer.jobs.result import UNTOLD
from tapelayer.jobs.stages import COATING, PLANNING, SLICING
from tapelayer.language import Language
from tapelayer.machines.wrist import AXES
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.progress import Steps
from tapelayer.provenance import VERSION, NamedFile, Provenance, sealed
from tapelayer.reporting.not_judged import english, unjudged
from tapelayer.reporting.quantity import numbers
from tapelayer.reporting.subject import Occasion
from tapelayer.reporting.summary import summary
from tapelayer.reporting.words import Say
from tapelayer.spraying import page
from tapelayer.spraying.coat import coat_of
from tapelayer.spraying.evidence import SprayEvidence
from tapelayer.spraying.footprint import footprint_of
from tapelayer.spraying.inspection import SprayInspector
from tapelayer.spraying.pass_planning import plan_passes
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.pitch import widest_pitch
from tapelayer.spraying.pose_file import trajectory_text
from tapelayer.spraying.program import Spraying, spray
from tapelayer.spraying.quantities import LEAST_AREA, ROWS, Judged, limited
from tapelayer.spraying.reach import Reach, placement
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM, Unit
from urdf import SPRAYER


@dataclass(frozen=True, eq=False)
class SprayJob(MachineJob[Spraying, SprayEvidence]):
    """Everything that a program of the spray robot is made from.

    Attributes:
        model: the surface in the part's frame.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        controller: the control's table.
        provenance: the sources named in the program's header.
    """

    setup: SpraySetup
    model: Mesh

    SOURCE = "model"
    PART = "pass"

    @staticmethod
    def read(path: Path | str, setup: SpraySetup, unit: Unit = "mm") -> SprayJob:
        """Return the job of a mesh file.

        Raises:
            MeshRefused: the file cannot be used.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
            FootprintRefused: the setup's profile cannot be used.
        """
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise MeshRefused.unreadable(str(path), error) from None
        return SprayJob.of(data, str(path), setup, unit)

    @staticmethod
    def of(data: bytes, name: str, setup: SpraySetup, unit: Unit = "mm") -> SprayJob:
        """Return the job of the bytes of a mesh file.

        Args:
            data: the file's bytes.
            name: the file's name in messages; the program's header has the base name.
            setup: the job's values.
            unit: unit of the file's numbers.

        Raises:
            MeshRefused: the bytes cannot be used, or the part is of a size that is none for the machine.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
            FootprintRefused: the setup's profile cannot be used.
        """
        controller = load(setup.output.controller)
        machine = machine_of(setup, SPRAYER)
        machine.check_travel(AXES)
        controller.check_units({axis.name: axis.revolute for axis in machine.axes})
        profile = b""
        more: tuple[NamedFile, ...] = ()
        if setup.footprint.profile is not None:
            footprint_of(setup)
            path = Path(setup.footprint.profile)
            profile = path.read_bytes()
            more = (NamedFile(path.name, hashlib.sha256(profile).hexdigest()),)
        mesh = parse_mesh(data, name, unit)
        check_size(mesh.vertices, unit, machine, ("the spot", setup.spray.spot_mm * MM), name, MeshRefused)
        provenance = Provenance(
            source=mesh.name,
            source_sha256=mesh.sha256,
            setup_sha256=setup.sha256(machine.path.read_bytes(), profile),
            version=VERSION,
            notes=(f"model in {unit}", *setup.process.notes()),
            not_judged=english(unjudged(is_timed(machine, controller))),
            more_sources=more,
        )
        return SprayJob(setup, machine, controller, provenance, mesh)

    @property
    def axes(self) -> tuple[str, ...]:
        """Return the axes that a program moves; the standoff is set by hand."""
        return AXES

    @property
    def parts(self) -> int:
        """Return the number of passes."""
        return len(self.pass_plan.passes)

    @cached_property
    def placement(self) -> tuple[Floats, Floats]:
        """Return the rotation (3, 3) and origin (3,) in metres of the part's frame in `machine`."""
        return placement(self.model, self.setup, self.machine)

    @cached_property
    def mesh(self) -> Mesh:
        """Return the surface in `machine`."""
        return self.model.moved(*self.placement)

    @cached_property
    def pitch(self) -> float:
        """Return the distance from pass to pass in metres.

        Raises:
            PitchNotFound: no pitch is even enough.
        """
        spray = self.setup.spray
        if spray.pitch_mm != "auto":
            return spray.pitch_mm * MM
        return widest_pitch(footprint_of(self.setup), spray.target_cv_percent / 100.0)

    @cached_property
    def pass_plan(self) -> Plan:
        """Return the passes.

        Raises:
            NothingToSpray: no part of the surface can be reached.
        """
        return plan_passes(self.mesh, self.setup, self.machine, self.pitch)

    def numbers(self, trajectory: Trajectory) -> Sequence[int]:
        """Return the numbers of the passes, which count from 1."""
        return range(1, int(trajectory.courses.max(initial=-1)) + 2)

    def planned(self, steps: Steps) -> tuple[Spraying, Trajectory]:
        """Return the passes as they are sprayed, and their trajectory.

        Raises:
            TapelayerError: the job cannot be done on this robot.
        """
        spraying = self.basis(steps)
        return spraying, spraying.trajectory

    def basis(self, steps: Steps) -> Spraying:
        """Return the passes as they are sprayed; a program is judged against where these are split.

        Raises:
            TapelayerError: the job cannot be done on this robot.
        """
        steps.begin(SLICING.name)
        passes = self.pass_plan.passes
        steps.begin(PLANNING.name, len(passes))
        highest = float(np.max(self.mesh.vertices[:, 2]))
        return spray(passes, self.setup, self.machine, highest, steps.tick, self.rule)

    def inspector(self, plan: Spraying) -> SprayInspector:
        """Return the judge of trajectories for these passes."""
        return SprayInspector(self.pass_plan.passes, plan.splits, self.mesh, self.setup, self.machine, self.rule)

    def levels(self) -> dict[Event, float]:
        """Return the level that goes with the word for the arc: the current, if the setup gives one."""
        current = self.setup.process.current_a
        return {} if current is None else {Event.ARC_ON: current}

    def result(
        self,
        plan: Spraying,
        trajectory: Trajectory,
        evidence: SprayEvidence,
        text: bytes,
        remarks: tuple[str, ...],
        steps: Steps,
    ) -> SprayResult:
        """Return the result of the job, with the coat that the program leaves."""
        steps.begin(COATING.name)
        coated = self.setup.process.kind == "arc" and len(evidence.samples.times) > 0
        reach = Reach(self.mesh, self.setup, self.machine)
        judged = Judged(
            evidence=evidence,
            plan=self.pass_plan,
            coat=coat_of(evidence.samples, reach, self.setup) if coated else None,
            mesh=self.mesh,
            slowdowns=plan.slowdowns,
            pitch=self.pitch,
            standoff=self.setup.standoff,
            speed=self.setup.speed,
        )
        evidence = limited(judged)
        judged = replace(judged, evidence=evidence)
        return SprayResult(trajectory, evidence, text, remarks, self, plan, judged)


@dataclass(frozen=True, eq=False)
class SprayResult(JobResult[SprayEvidence]):
    """The result of a job of the spray robot.

    Attributes:
        job: the job that was done.
        planned: the passes as they are sprayed.
        judged: the evidence of verification, and the coat.
    """

    job: SprayJob
    planned: Spraying
    judged: Judged

    def numbers(self) -> dict[str, Any]:
        """Return the verdict and all that was measured; docs/spray.md describes every key."""
        return numbers(ROWS, self.judged, self.evidence, self.job.not_judged)

    def summary(self, language: Language = "en") -> Table:
        """Return the report as a table for a terminal."""
        report, say = self.numbers(), Say(language)
        return summary(ROWS, report, self.evidence.limits, self.job.not_judged, page.surface_facts(report, say), say)

    def page(self, occasion: Occasion = UNTOLD, language: Language = "en") -> str:
        """Return the report as one HTML page with plots; its title is the program's name."""
        report, not_judged = self.report(occasion), self.job.not_judged
        return page.html(self.judged, self.trajectory, report, self.job.setup, not_judged, Say(language))

    def notes(self, language: Language = "en") -> tuple[str, ...]:
        """Return a note on the surface that no pass goes over because the machine does not reach it."""
        lost = self.judged.plan.beyond_travel
        if lost <= LEAST_AREA:
            return ()
        note = Say(language)(
            "{name}: {lost:.4g} m2 of the surface lie beyond the machine's reach: no pass goes there",
            "{name}：有 {lost:.4g} m2 的表面超出机床可达范围：没有喷涂道经过",
            name=self.job.model.name,
            lost=lost,
        )
        return (note,)

    def files(self) -> dict[str, bytes]:
        """Return the gun's poses, with the hash of their own text in the second line."""
        poses = self.poses()
        return {"trajectory.txt": sealed(poses, poses.index(b"\n") + 1, "# text sha256: ")}

    def poses(self) -> bytes:
        """Return the gun's poses in the part's frame, as a text file."""
        return trajectory_text(self.job.pass_plan.passes, self.planned.pieces, self.job.placement, self.job.provenance)
