"""The machines, each loaded once and only when a test asks."""

from __future__ import annotations

from functools import cache

import yourdfpy

from tapelayer.laying.settings import Setup
from tapelayer.machines.gantry import Lengths
from tapelayer.machines.machine import Machine
from tapelayer.spraying.settings import SpraySetup
from urdf import SPRAYER, TAPELAYER

TEN_AXES = ("x", "y", "z", "c", "a", "u", "v", "d", "q", "e")
LENGTHS = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)


@cache
def tape_layer() -> Machine:
    return Machine.load(TAPELAYER)


@cache
def sprayer() -> Machine:
    return Machine.load(SPRAYER)


@cache
def by_yourdfpy(path: str) -> yourdfpy.URDF:
    """A machine as yourdfpy reads it; it keeps the last configuration."""
    return yourdfpy.URDF.load(path, load_meshes=False)


def limited(setup: Setup | SpraySetup) -> Machine:
    """The machine of a setup's kind with the limits of the setup."""
    machine, stated = sprayer() if isinstance(setup, SpraySetup) else tape_layer(), setup.machine
    return machine.with_limits(stated.travel(), stated.speeds(), stated.accelerations(), stated.jerks())
