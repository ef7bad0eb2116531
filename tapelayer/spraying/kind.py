"""Kind: everything that the commands and the workbench need to know about the spray robot."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.jobs.kind import BuiltIn, Form, MachineKind, Option, Source
from tapelayer.jobs.stages import (
    COATING,
    PLANNING,
    READING,
    READING_BACK,
    SAVING,
    SLICING,
    VERIFYING,
    VERIFYING_PLAN,
    WRITING,
)
from tapelayer.machines import wrist
from tapelayer.machines.machine import Machine
from tapelayer.reporting.not_judged import unjudged
from tapelayer.spraying.job import SprayJob
from tapelayer.spraying.limits import limits_of
from tapelayer.spraying.quantities import ROWS
from tapelayer.spraying.scene import scene
from tapelayer.spraying.settings import SpraySetup
from urdf import SPRAYER


def _inverse(machine: Machine, places: Floats, normals: Floats) -> Floats:
    """Return axis values (2, n, 5): P stays where it is however the wrist turns."""
    angles = wrist.inverse(normals)
    return np.concatenate([np.broadcast_to(places, (len(angles), *places.shape)), angles], axis=2)


def _lengths(machine: Machine) -> dict[str, float]:
    """Return no lengths, as the gun turns about P whatever they are, after checking that the axes are there."""
    for name in wrist.AXES:
        machine.axis(name)
    return {}


KIND = MachineKind(
    name="spray",
    title="Setup of a spraying job",
    setup_name="a spraying setup",
    command="tapelayer spray MODEL.stl --setup {}",
    machine=BuiltIn(
        name="sprayer",
        title="five-axis spray robot",
        urdf=SPRAYER,
        frame="P",
        axes=wrist.AXES,
        vectors={"n": 2},
        inverse=_inverse,
        lengths=_lengths,
    ),
    source=Source("model", "models", Form.MODEL, "model/stl", frozenset({"unit"})),
    parts="passes",
    setup=SpraySetup,
    options={"direction_deg": Option("spray", "direction_deg"), "pitch_mm": Option("spray", "pitch_mm")},
    job=SprayJob.of,
    read=SprayJob.read,
    rows=ROWS,
    summary=("blocks", "passes", "duration_s", "max_position_error_mm"),
    limits=limits_of,
    not_judged=unjudged(timed=True),
    making={
        READING: 1,
        SLICING: 3,
        PLANNING: 20,
        VERIFYING_PLAN: 4,
        WRITING: 1,
        READING_BACK: 1,
        VERIFYING: 4,
        COATING: 36,
        SAVING: 30,
    },
    judging={READING: 2, READING_BACK: 2, SLICING: 3, PLANNING: 30, VERIFYING: 6, COATING: 50, SAVING: 7},
    scene=scene,
)
