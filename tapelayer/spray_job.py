"""Spray job: one model, one setup, one robot, one control; from here to a program that was read back and verified."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from post import program, reader
from post.controllers import Controller, load
from tapelayer.arrays import Floats
from tapelayer.coat import coat_of
from tapelayer.machine import Machine
from tapelayer.mesh import Mesh, Unit, read_mesh
from tapelayer.passes import Plan, plan_passes
from tapelayer.progress import Tick, silent
from tapelayer.provenance import Provenance
from tapelayer.reach import Reach, placed, placement
from tapelayer.setup import MM
from tapelayer.spray_evidence import SprayEvidence
from tapelayer.spray_report import Judged
from tapelayer.spray_setup import SpraySetup
from tapelayer.spray_verification import Sprayed, SprayInspector
from tapelayer.spraying import AXES, Spraying, spray
from tapelayer.thickness import footprint_of, widest_pitch
from urdf import SPRAYER

if TYPE_CHECKING:
    from tapelayer.verification import Verified


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
        controller = load(setup.output.controller)
        machine = sprayer_of(setup)
        profile = b""
        if setup.footprint.profile is not None:
            footprint_of(setup)
            profile = Path(setup.footprint.profile).read_bytes()
        mesh = read_mesh(Path(model), unit, setup.spray.spot_mm * MM)
        provenance = Provenance(
            source=mesh.name,
            source_sha256=mesh.sha256,
            setup_sha256=setup.sha256(machine.path.read_bytes(), profile),
            version=version("tapelayer"),
            notes=(f"model in {unit}", *setup.process.notes()),
        )
        return SprayJob(mesh, setup, machine, controller, provenance)

    @cached_property
    def placement(self) -> tuple[Floats, Floats]:
        """Rotation (3, 3) and origin (3,) in metres of the part's frame in `machine`."""
        return placement(self.model, self.setup, self.machine)

    @cached_property
    def mesh(self) -> Mesh:
        """The surface in `machine`."""
        return placed(self.model, *self.placement)

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
            program_sha256=hashlib.sha256(text).hexdigest(),
        )

    def text(self, planned: Sprayed) -> bytes:
        """NC text of a verified trajectory."""
        # The writer asks of what is verified for its trajectory alone.
        controller = _with_current(self.controller, self.setup.process.current_a)
        return program.write(cast("Verified", planned), controller, self.provenance)

    def read_back(self, text: bytes, name: str) -> reader.Program:
        """What an NC text says.

        Raises:
            ProgramRefused: the text cannot be read.
        """
        speeds = {name: self.machine.axis(name).speed for name in AXES}
        return reader.read(text, self.controller, AXES, speeds, name)

    @property
    def resolution(self) -> Floats:
        """Last written digit (5,) of each axis of a program, in metres and radians."""
        return np.array([self.controller.resolution(name) for name in AXES])


def _with_current(controller: Controller, current: float | None) -> Controller:
    """The controller with the current as S beside the word for the arc, where it reads an S that moves nothing."""
    word = controller.events.get("arc_on", "")
    if current is None or "S" not in controller.codes.no_effect or not word or " " in word:
        return controller
    return controller.model_copy(update={"events": {**controller.events, "arc_on": f"{word} S{current:g}"}})


def sprayer_of(setup: SpraySetup) -> Machine:
    """The setup's robot: its URDF, or the built-in one, with the setup's travel and speeds.

    Raises:
        ModelRefused: the URDF cannot be used, or an axis in the setup is not the robot's.
    """
    urdf = SPRAYER if setup.machine.urdf is None else Path(setup.machine.urdf)
    return Machine.load(urdf).with_limits(setup.machine.travel(), setup.machine.speeds())
