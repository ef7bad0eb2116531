"""Passes and programs of the sprayer, over sheets in mm."""

from __future__ import annotations

import math

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.spraying.pass_planning import plan_passes
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.program import Spraying, spray
from tapelayer.spraying.reach import placement
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM
from tests.helpers.machines import limited
from tests.helpers.panels import mesh_of, sheet
from tests.helpers.setups import spray_setup_of


def roof(degrees: float) -> Floats:
    """Two planes that fold along x = 150 by an angle, the ridge up."""
    slope = math.tan(math.radians(degrees / 2))
    return sheet([0, 75, 150, 225, 300], [0, 60], lambda x, y: slope * (150 - abs(x - 150)) + 0 * y)


def placed(mesh: Mesh, setup: SpraySetup) -> Mesh:
    """The mesh where the setup puts it in the machine."""
    return mesh.moved(*placement(mesh, setup, limited(setup)))


def planned(triangles: Floats, text: str = "") -> tuple[Plan, Mesh, SpraySetup]:
    """Passes over triangles, the mesh in the machine, and the setup of a TOML text."""
    setup = spray_setup_of(text)
    mesh = placed(mesh_of(triangles), setup)
    assert setup.spray.pitch_mm != "auto"
    return plan_passes(mesh, setup, limited(setup), setup.spray.pitch_mm * MM), mesh, setup


def sprayed(triangles: Floats, text: str = "") -> tuple[Spraying, Plan]:
    """Program over triangles and the passes that it sprays."""
    plan, mesh, setup = planned(triangles, text)
    return spray(plan.passes, setup, limited(setup), float(mesh.vertices[:, 2].max())), plan
