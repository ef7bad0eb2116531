"""Reach: where a part lies in the machine, and the part of its surface that the gun can spray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.geometry.envelope import upper_envelope
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.slicing import slice, strip_widths
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import Wrist, reachable
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM

# Points closer together than this, in metres, are one point.
SAME_POINT = 1e-12
# Distance in metres by which rounding may move a point beyond the travel.
ROUNDING = 1e-9


def placement(mesh: Mesh, setup: SpraySetup, machine: Machine) -> tuple[Floats, Floats]:
    """Return the rotation (3, 3) and origin (3,) in metres from the part's frame to `machine`: rotation p + origin."""
    turn = setup.part.rotation_deg * DEG
    rotation = Rotation.from_euler("z", turn).as_matrix()
    vertices = mesh.vertices @ rotation.T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    origin = []
    for column, value in enumerate((setup.part.x_mm, setup.part.y_mm, setup.part.z_mm)):
        axis = machine.axis("xyz"[column])
        if value != "auto":
            origin.append(float(value) * MM)
        elif axis.name == "z":
            origin.append(max(axis.lower, 0.0) - low[column])
        else:
            origin.append((axis.lower + axis.upper - low[column] - high[column]) / 2)
    return rotation, np.array(origin)


def wrist_of(setup: SpraySetup, machine: Machine) -> Wrist:
    """Return the wrist with the travel, speeds and lean that the gun's direction is limited by."""
    return Wrist(machine.axis("theta"), machine.axis("phi"), setup.speed, setup.planned_deviation)


@dataclass(frozen=True, eq=False)
class Segments(Frozen):
    """Pieces of sections that can be sprayed, in order of planes and then of travel.

    Attributes:
        begins: (n, 3) metres.
        ends: (n, 3) metres.
        facets: (n,) facet of each.
        planes: (n,) plane of each.
        goes_on: (n, 2) whether the section continues beyond the piece's start and end, with no piece there.
    """

    begins: Floats
    ends: Floats
    facets: Ints
    planes: Ints
    goes_on: Mask

    @property
    def lengths(self) -> Floats:
        """Return the length (n,) of each piece in metres."""
        lengths: Floats = np.linalg.norm(self.ends - self.begins, axis=1)
        return lengths


class Reach:
    """A surface and the part of it that can be sprayed: seen from above, within the travel, at an angle the wrist has.

    Args:
        mesh: the surface in `machine`.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
    """

    def __init__(self, mesh: Mesh, setup: SpraySetup, machine: Machine) -> None:
        self.mesh, self.min_normal_z = mesh, setup.spray.min_normal_z
        self.normals = mesh.upward_normals
        axes = [machine.axis(name) for name in "xyz"]
        self.box = np.array([[axis.lower for axis in axes], [axis.upper for axis in axes]])
        self.wrist = wrist_of(setup, machine)
        # Facets whose normals the wrist can reach; a planner may give up more of them.
        self.facets = reachable(self.wrist, self.normals, np.full(len(self.normals), setup.planned_deviation))

    def segments(self, direction: Floats, heights: Floats) -> tuple[Segments, float]:
        """Return the pieces of plane sections that can be sprayed, and the share of the area beyond the travel.

        Args:
            direction: (3,) unit normal of the planes, level.
            heights: (p,) distance of each plane from the origin, metres.
        """
        sections = upper_envelope(self.mesh, slice(self.mesh, direction, heights), self.min_normal_z)
        rows = sections.segments
        begins, ends, facets = sections.points[rows], sections.points[rows + 1], sections.facets[rows]
        first, last = _clipped(begins, ends - begins, self.box + [[-ROUNDING], [ROUNDING]])
        inside = ((last - first) * sections.lengths > SAME_POINT) & self.facets[facets]
        areas = sections.lengths * strip_widths(self.normals[facets], direction, 1.0)
        lost = float(np.sum(np.where(inside, 1.0 - (last - first), 1.0) * areas))
        total = float(np.sum(areas))
        steps = ends - begins
        segments = Segments(
            begins=np.where((first > 0.0)[:, None], begins + first[:, None] * steps, begins)[inside],
            ends=np.where((last < 1.0)[:, None], begins + last[:, None] * steps, ends)[inside],
            facets=facets[inside],
            planes=np.repeat(sections.planes, np.diff(sections.offsets) - 1)[inside],
            goes_on=np.zeros((int(np.sum(inside)), 2), dtype=np.bool_),
        )
        return segments, lost / total if total else 0.0

    def holds(self, points: Floats, normals: Floats) -> Mask:
        """Return a mask (n,) of points (n, 3) in metres inside the travel whose normals (n, 3) the wrist can reach."""
        inside = np.all((points >= self.box[0] - ROUNDING) & (points <= self.box[1] + ROUNDING), axis=1)
        held: Mask = inside & reachable(self.wrist, normals, np.full(len(normals), self.wrist.max_deviation))
        return held


def _clipped(begins: Floats, steps: Floats, box: Floats) -> tuple[Floats, Floats]:
    """Return the fractions (n,) at which segments enter and leave a box (2, 3); equal if a segment misses it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = (box[:, None, :] - begins) / steps
    # Along an axis in which it does not move, a segment is inside from start to end or not at all.
    still, within = steps == 0.0, (begins >= box[0]) & (begins <= box[1])
    enters = np.where(still, np.where(within, 0.0, 1.0), np.minimum(shares[0], shares[1]))
    leaves = np.where(still, np.where(within, 1.0, 0.0), np.maximum(shares[0], shares[1]))
    first, last = np.clip(np.max(enters, axis=1), 0.0, 1.0), np.clip(np.min(leaves, axis=1), 0.0, 1.0)
    return first, np.maximum(first, last)
