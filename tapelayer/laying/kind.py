"""Kind: everything that the commands and the workbench need to know about the tape layer."""

from __future__ import annotations

from tapelayer.jobs.kind import BuiltIn, Form, MachineKind, Option, Source
from tapelayer.jobs.stages import PLANNING, READING, READING_BACK, SAVING, VERIFYING, VERIFYING_PLAN, WRITING
from tapelayer.laying.job import Job
from tapelayer.laying.limits import limits_of
from tapelayer.laying.quantities import ROWS
from tapelayer.laying.scene import scene
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine
from tapelayer.reporting.not_judged import unjudged
from urdf import TAPELAYER


def _lengths(machine: Machine) -> dict[str, float]:
    """Return the lengths of the head and the radius of the roller."""
    head = gantry.lengths(machine)
    return {"l4": head.l4, "l5": head.l5, "l6": head.l6, "roller radius": head.radius}


KIND = MachineKind(
    name="lay",
    title="Setup of a tape-laying job",
    setup_name="a tape-laying setup",
    command="tapelayer export COURSES.txt --setup {}",
    machine=BuiltIn(
        name="tapelayer",
        title="ten-axis tape-laying gantry",
        urdf=TAPELAYER,
        frame="contact",
        axes=gantry.POSE,
        vectors={"n": 2, "t": 0},
        inverse=gantry.inverse,
        lengths=_lengths,
    ),
    source=Source("course file", "tape courses", Form.COURSES, "text/plain", frozenset({"mould"})),
    parts="courses",
    setup=Setup,
    options={"kinematics": Option("process", "kinematics")},
    job=Job.of,
    read=Job.read,
    rows=ROWS,
    summary=("blocks", "courses", "duration_s", "max_position_error_mm"),
    limits=limits_of,
    not_judged=unjudged(timed=True),
    making={READING: 4, PLANNING: 25, VERIFYING_PLAN: 13, WRITING: 2, READING_BACK: 2, VERIFYING: 12, SAVING: 42},
    judging={READING: 20, READING_BACK: 20, VERIFYING: 50, SAVING: 10},
    scene=scene,
)
