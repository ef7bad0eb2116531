"""Spray job: one model, one setup, one robot, one control; from here to a program that was read back and verified."""

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
from tapelayer.errors import MeshRefused, VerificationFailed
from tapelayer.geometry.mesh import Mesh, Unit
from tapelayer.geometry.stl import parse_mesh
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event, Trajectory
from tapelayer.progress import UNSEEN, Steps, Tick, silent
from tapelayer.provenance import VERSION, Provenance
from tapelayer.spraying import page, report
from tapelayer.spraying.coat import coat_of
from tapelayer.spraying.evidence import SprayEvidence
from tapelayer.spraying.footprint import footprint_of
from tapelayer.spraying.inspection import SprayInspector
from tapelayer.spraying.pass_planning import plan_passes
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.pitch import widest_pitch
from tapelayer.spraying.pose_file import trajectory_text
from tapelayer.spraying.program import Spraying, spray
from tapelayer.spraying.reach import Reach, mesh_in_machine, placement
from tapelayer.spraying.report import Judged
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM
from tapelayer.verification.verified import Verified, failure_of
from urdf import SPRAYER


@dataclass(frozen=True, eq=False)
class SprayJob:
    """What goes into a program.

    Attributes:
        model: the surface in the part's frame.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        controller: the control's table.
        provenance: what the program's header says of its sources.
    """

    model: Mesh
    setup: SpraySetup
    machine: Machine
    controller: Controller
    provenance: Provenance

    @staticmethod
    def read(model: Path | str, setup: SpraySetup, unit: Unit = "mm") -> SprayJob:
        """Job of a mesh file.

        Raises:
            MeshRefused: the file cannot be used.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
            FootprintRefused: the setup's profile cannot be used.
        """
        try:
            data = Path(model).read_bytes()
        except OSError as error:
            raise MeshRefused.unreadable(str(model), error) from None
        return SprayJob.of(data, str(model), setup, unit)

    @staticmethod
    def of(data: bytes, name: str, setup: SpraySetup, unit: Unit = "mm") -> SprayJob:
        """Job of the bytes of a mesh file, which messages call by its name; the program's header has the base name.

        Raises:
            MeshRefused: the bytes cannot be used.
            ControllerRefused: the setup's controller table cannot be used.
            ModelRefused: the setup's URDF cannot be used.
            FootprintRefused: the setup's profile cannot be used.
        """
        controller = load(setup.output.controller)
        machine = sprayer_of(setup)
        profile = b""
        if setup.footprint.profile is not None:
            footprint_of(setup)
            profile = Path(setup.footprint.profile).read_bytes()
        mesh = parse_mesh(data, name, unit, setup.spray.spot_mm * MM)
        provenance = Provenance(
            source=mesh.name,
            source_sha256=mesh.sha256,
            setup_sha256=setup.sha256(machine.path.read_bytes(), profile),
            version=VERSION,
            notes=(f"model in {unit}", *setup.process.notes()),
        )
        return SprayJob(mesh, setup, machine, controller, provenance)

    def make(self, name: str, steps: Steps = UNSEEN) -> SprayMade:
        """Plan, write, read back and judge a program of that name; `SprayMade.failure` says whether it may be used.

        Raises:
            TapelayerError: the job cannot be done on this robot.
        """
        steps.begin("slicing")
        passes = self.plan.passes
        steps.begin("planning", len(passes))
        planned = self.spraying(steps.tick)
        inspector = self.inspector(planned)
        steps.begin("verifying the plan", len(passes))
        trajectory, text = planned.trajectory, b""
        evidence = inspector.examine(trajectory, tick=steps.tick)
        if evidence.passed:
            steps.begin("writing")
            text = self.text(Verified(trajectory, evidence))
            steps.begin("reading back")
            trajectory = self.read_back(text, name).trajectory
            steps.begin("verifying", len(passes))
            evidence = inspector.examine(trajectory, self.resolution, steps.tick)
        steps.begin("measuring the coat")
        return SprayMade(self, planned, trajectory, self.judged(planned, evidence, text), text)

    def examine(self, text: bytes, name: str, force: bool = False, steps: Steps = UNSEEN) -> SprayMade:
        """Judge a program by its text against the passes that its model and setup ask for.

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
        remarks = self.provenance.remarks(read.source_sha256, name, "model")
        steps.begin("slicing")
        passes = self.plan.passes
        steps.begin("planning", len(passes))
        planned = self.spraying(steps.tick)
        steps.begin("verifying", len(passes))
        evidence = self.inspector(planned).examine(read.trajectory, self.resolution, steps.tick)
        steps.begin("measuring the coat")
        return SprayMade(self, planned, read.trajectory, self.judged(planned, evidence, text), text, remarks)

    @cached_property
    def placement(self) -> tuple[Floats, Floats]:
        """Rotation (3, 3) and origin (3,) in metres of the part's frame in `machine`."""
        return placement(self.model, self.setup, self.machine)

    @cached_property
    def mesh(self) -> Mesh:
        """The surface in `machine`."""
        return mesh_in_machine(self.model, *self.placement)

    @cached_property
    def pitch(self) -> float:
        """From pass to pass in metres.

        Raises:
            PitchNotFound: no pitch is even enough.
        """
        spray = self.setup.spray
        if spray.pitch_mm != "auto":
            return spray.pitch_mm * MM
        return widest_pitch(footprint_of(self.setup), spray.target_cv_percent / 100.0)

    @cached_property
    def plan(self) -> Plan:
        """The passes.

        Raises:
            NothingToSpray: nothing of the surface can be reached.
        """
        return plan_passes(self.mesh, self.setup, self.machine, self.pitch)

    def spraying(self, tick: Tick = silent) -> Spraying:
        """The planned program; `tick` is called for every pass."""
        highest = float(np.max(self.mesh.vertices[:, 2]))
        return spray(self.plan.passes, self.setup, self.machine, highest, tick)

    def inspector(self, planned: Spraying) -> SprayInspector:
        """Judge of trajectories for these passes."""
        return SprayInspector(self.plan.passes, planned.splits, self.mesh, self.setup, self.machine)

    def judged(self, planned: Spraying, evidence: SprayEvidence, text: bytes) -> Judged:
        """A judged program with the coat that it leaves, for the reports."""
        coated = self.setup.process.kind == "arc" and len(evidence.samples.times) > 0
        reach = Reach(self.mesh, self.setup, self.machine)
        return Judged(
            evidence=evidence,
            plan=self.plan,
            coat=coat_of(evidence.samples, reach, self.setup) if coated else None,
            mesh=self.mesh,
            slowdowns=planned.slowdowns,
            pitch=self.pitch,
            standoff=self.setup.standoff,
            program_sha256=hashlib.sha256(text).hexdigest() if text else "",
        )

    def text(self, planned: Verified[SprayEvidence]) -> bytes:
        """NC text of a verified trajectory."""
        current = self.setup.process.current_a
        levels = {} if current is None else {Event.ARC_ON: current}
        return program.write(planned, self.controller, self.provenance, levels)

    def read_back(self, text: bytes, name: str) -> reader.Program:
        """What an NC text says.

        Raises:
            ProgramRefused: the text cannot be read.
        """
        limits = Limits.of(self.machine.axis(name) for name in AXES)
        return reader.read(text, self.controller, AXES, limits, name)

    @property
    def resolution(self) -> Floats:
        """Last written digit (5,) of each axis of a program, in metres and radians."""
        return np.array([self.controller.resolution(name) for name in AXES])


@dataclass(frozen=True, eq=False)
class SprayMade:
    """What became of a job: a program, and what was found when it was judged.

    Attributes:
        job: what it was made from.
        planned: the passes as they are sprayed.
        trajectory: as read back from the text; as planned where the plan failed already.
        judged: what verification measured on it, and the coat.
        text: bytes of the program; none where the plan failed.
        remarks: what is to be said beside the verdict.
    """

    job: SprayJob
    planned: Spraying
    trajectory: Trajectory
    judged: Judged
    text: bytes
    remarks: tuple[str, ...] = ()

    @property
    def evidence(self) -> SprayEvidence:
        """What verification measured."""
        return self.judged.evidence

    @property
    def failure(self) -> VerificationFailed | None:
        """Why the program may not be used; None where it passed."""
        return failure_of(self.evidence)

    def report(self) -> dict[str, Any]:
        """The report as plain values for JSON; docs/spray.md describes every key."""
        return report.numbers(self.judged)

    def summary(self) -> Table:
        """The report as a table for a terminal."""
        return report.summary(self.report())

    def page(self, title: str) -> str:
        """The report as one HTML page with plots, called as the program is."""
        return page.html(self.judged, self.trajectory, self.job.setup, title)

    def poses(self) -> bytes:
        """The gun's poses in the part's frame, as a text file."""
        return trajectory_text(self.job.plan.passes, self.planned.pieces, self.job.placement, self.job.provenance)


def sprayer_of(setup: SpraySetup) -> Machine:
    """The setup's robot: its URDF, or the built-in one, with the setup's travel and speeds.

    Raises:
        ModelRefused: the URDF cannot be used, or an axis in the setup is not the robot's.
    """
    urdf = SPRAYER if setup.machine.urdf is None else Path(setup.machine.urdf)
    return Machine.load(urdf).with_limits(setup.machine.travel(), setup.machine.speeds())
