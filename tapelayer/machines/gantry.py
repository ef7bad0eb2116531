"""Gantry: closed-form inverse kinematics of the tape layer, exact and as the paper prints it.

Source: Ye Jin et al., Automated Tape-Laying Technology for Composites, 2008; docs/kinematics.md lists the corrections.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Protocol

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import ModelRefused
from tapelayer.machines.columns import cosine_and_sine
from tapelayer.machines.machine import CHUNK, Machine

# The order of every pose here: d1, d2, d3, theta4, theta5.
POSE = ("x", "y", "z", "c", "a")
# Links that touch by nature, besides those that a joint connects: the knives work against the cutter's anvil.
TOUCHING = (("cutter", "knife_1"), ("cutter", "knife_2"))

Kinematics = Literal["roller", "published"]

# Sine of the angle below which two directions count as parallel, or a roller axis as vertical.
_PARALLEL = 1e-9

_FAMILY_TOLERANCE = 1e-9
_FAMILY_SAMPLES = 64


@dataclass(frozen=True)
class Lengths:
    """Lengths of the head in metres, as in the paper's Table 1, and the radius of the compaction roller."""

    l4: float
    l5: float
    l6: float
    radius: float


class ClosedForm(Protocol):
    """A closed form of the inverse for one course."""

    def joints(self, points: Floats, normals: Floats, tangents: Floats) -> Floats:
        """Return joint values (n, 5) in the order of `POSE`, metres and radians; NaN rows where there is no pose.

        Args:
            points: (n, 3) contact points in `machine` axes, metres.
            normals: (n, 3) unit normals out of the surface.
            tangents: (n, 3) directions of travel, any length.
        """
        ...


@dataclass(frozen=True)
class Roller:
    """The exact form: the roller's axis is t x n, its centre one radius above the contact point.

    Attributes:
        lengths: of the head.
    """

    lengths: Lengths

    def joints(self, points: Floats, normals: Floats, tangents: Floats) -> Floats:
        """Return the forward branch of `inverse`; see `ClosedForm.joints`.

        Examples:
            >>> head = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
            >>> point, up, ahead = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 1.0, 0.0]])
            >>> np.round(Roller(head).joints(point, up, ahead), 6).tolist()
            [[0.042426, -0.042426, -0.8, 0.785398, 0.0]]
        """
        forward: Floats = _solve(self.lengths, points, normals, tangents, branches=1)[0]
        return forward


@dataclass(frozen=True)
class Published:
    """The paper's form with its misprints corrected: one heading per course, an unsigned roll, no roller.

    Attributes:
        lengths: of the head.
        theta4: heading of the course's chord, radians; NaN where the chord has no level direction.
    """

    lengths: Lengths
    theta4: float

    def joints(self, points: Floats, normals: Floats, tangents: Floats) -> Floats:
        """Return joint values as `ClosedForm.joints`, ignoring the tangents. Source: the paper's 1.4.

        Examples:
            >>> head = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
            >>> point, up, ahead = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 1.0, 0.0]])
            >>> np.round(Published(head, theta4=0.0).joints(point, up, ahead), 6).tolist()
            [[0.0, -0.06, -0.8, 0.0, 0.0]]
        """
        _check_rows(points, normals, tangents)
        theta5 = np.arccos(np.clip(normals[:, 2], -1.0, 1.0))
        theta4 = np.full(len(points), self.theta4)
        turns = (np.sin(theta4), np.cos(theta4), np.sin(theta5), np.cos(theta5))
        slides = _slides_to(self.lengths, self.lengths.l6, (points[:, 0], points[:, 1], points[:, 2]), turns)
        joints = np.column_stack([*slides, theta4, theta5])
        joints[~np.isfinite(joints).all(axis=1)] = np.nan
        return joints


def closed_form(lengths: Lengths, kinematics: Kinematics, first: Floats, last: Floats) -> ClosedForm:
    """Return the closed form for one course.

    Args:
        lengths: of the head.
        kinematics: "roller" for the exact form, "published" for the paper's.
        first: (3,) first point of the course in `machine` axes, metres.
        last: (3,) last point of the course.

    Examples:
        >>> head = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
        >>> chord = closed_form(head, "published", first=np.zeros(3), last=np.array([1.0, 1.0, 0.0]))
        >>> round(float(np.degrees(chord.theta4)), 6)
        45.0
    """
    if kinematics == "roller":
        return Roller(lengths)
    along, across = float(last[0] - first[0]), float(last[1] - first[1])
    # E5: atan2 of the chord, which an arctangent of the quotient cannot replace; a closed course has no chord.
    level = np.hypot(along, across) > 0.0
    return Published(lengths, float(np.arctan2(along, across)) if level else float("nan"))


def inverse(machine: Machine, points: Floats, normals: Floats, tangents: Floats) -> Floats:
    """Return joint values (2, n, 5) in the order of `POSE`, metres and radians, that put the roller on the surface.

    Branch 0 travels forwards along the tangent, c in (-pi, pi]; branch 1 is (c + pi, -a), the same roller line
    travelling backwards. NaN where the tangent is parallel to the normal, or the roller axis would be vertical.

    Args:
        machine: a tape layer.
        points: (n, 3) contact points in `machine` axes, metres.
        normals: (n, 3) unit normals out of the surface.
        tangents: (n, 3) directions of travel, any length, not necessarily square to the normals.

    Raises:
        ModelRefused: the machine's chain is not the tape layer's.

    Examples:
        >>> point, up, ahead = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 1.0, 0.0]])
        >>> joints = inverse(Machine.load(), point, up, ahead)
        >>> joints.shape, np.round(np.degrees(joints[:, 0, 3]), 6).tolist()
        ((2, 1, 5), [45.0, 225.0])
    """
    return _solve(lengths(machine), points, normals, tangents, branches=2)


def normals(joints: Floats) -> Floats:
    """Return head normals m (n, 3) in `machine` axes for (n, 5) joint values in the order of `POSE`.

    Examples:
        >>> rolled = np.array([[0.0, 0.0, 0.0, 0.0, np.pi / 6]])
        >>> np.round(normals(rolled), 6).tolist()
        [[-0.5, 0.0, 0.866025]]
    """
    sin4, cos4, sin5, cos5 = _sines(joints)
    return np.column_stack([-cos4 * sin5, sin4 * sin5, cos5])


def wrap(joints: Floats, tangents: Floats) -> Floats:
    """Return the angle (n,) in radians by which the nip moves round the roller: atan2(t.m, t.h), positive climbing.

    Args:
        joints: (n, 5) joint values in the order of `POSE`.
        tangents: (n, 3) directions of travel in `machine` axes, any length.

    Examples:
        >>> level, climbing = [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]
        >>> np.degrees(wrap(np.zeros((2, 5)), np.array([level, climbing]))).tolist()
        [0.0, 45.0]
    """
    sin4, cos4, sin5, cos5 = _sines(joints)
    along, across, up = tangents[:, 0], tangents[:, 1], tangents[:, 2]
    climb = sin5 * (sin4 * across - cos4 * along) + cos5 * up
    return np.asarray(np.arctan2(climb, sin4 * along + cos4 * across))


def roller_axes(joints: Floats) -> Floats:
    """Return roller axes r (n, 3) in `machine` axes for (n, 5) joint values in the order of `POSE`.

    Examples:
        >>> turned = np.array([[0.0, 0.0, 0.0, np.pi / 2, 0.0]])
        >>> np.round(roller_axes(turned), 6).tolist()
        [[0.0, -1.0, 0.0]]
    """
    sin4, cos4, sin5, cos5 = _sines(joints)
    return np.column_stack([cos4 * cos5, -sin4 * cos5, sin5])


def tool_points(head: Lengths, reach: float, joints: Floats) -> Floats:
    """Return points (n, 3) in `machine` axes, metres, at `reach` metres from the a axis along the tool, by eq. (3).

    Args:
        head: lengths of the head.
        reach: l6 for the nose of the roller, l6 less its radius for its centre, metres.
        joints: (n, 5) joint values in the order of `POSE`.

    Examples:
        >>> head = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
        >>> np.round(tool_points(head, head.l6, np.zeros((1, 5))), 6).tolist()
        [[0.0, -0.06, -0.8]]
    """
    sin4, cos4, sin5, cos5 = _sines(joints)
    return np.column_stack(
        [
            joints[:, 0] - head.l5 * sin4 + reach * cos4 * sin5,
            -joints[:, 1] - head.l5 * cos4 - reach * sin4 * sin5,
            -joints[:, 2] - head.l4 - reach * cos5,
        ]
    )


def tool_effects(head: Lengths, reach: float, joints: Floats, changes: Floats) -> tuple[Floats, Floats]:
    """Return the changes of tool point (n, 3) and roller axis (n, 3) for small changes (n, 5) of the joints.

    Args:
        head: lengths of the head.
        reach: as in `tool_points`, metres.
        joints: (n, 5) joint values in the order of `POSE`.
        changes: (n, 5) of the joint values; the result is linear in them.

    Examples:
        >>> head = Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
        >>> point, _ = tool_effects(head, head.l6, np.zeros((1, 5)), np.array([[0.0, 0.0, 0.001, 0.0, 0.0]]))
        >>> point.tolist()
        [[0.0, 0.0, -0.001]]
    """
    sin4, cos4, sin5, cos5 = _sines(joints)
    turn4, turn5 = changes[:, 3], changes[:, 4]
    point = changes[:, :3] * np.array([1.0, -1.0, -1.0])
    point[:, 0] += (-head.l5 * cos4 - reach * sin4 * sin5) * turn4 + reach * cos4 * cos5 * turn5
    point[:, 1] += (head.l5 * sin4 - reach * cos4 * sin5) * turn4 - reach * sin4 * cos5 * turn5
    point[:, 2] += reach * sin5 * turn5
    axis = np.column_stack(
        [-sin4 * cos5 * turn4 - cos4 * sin5 * turn5, -cos4 * cos5 * turn4 + sin4 * sin5 * turn5, cos5 * turn5]
    )
    return point, axis


def slides(direction: Floats) -> Floats:
    """Return the changes (3,) of x, y, z that move the head by a vector (3,) in `machine` axes: y and z are reversed.

    Examples:
        >>> slides(np.array([0.1, 0.2, 0.3])).tolist()
        [0.1, -0.2, -0.3]
    """
    changes: Floats = direction * np.array([1.0, -1.0, -1.0])
    return changes


@lru_cache(maxsize=16)
def lengths(machine: Machine) -> Lengths:
    """Return the lengths of the head from the model, after checking that its chain is the tape layer's.

    Raises:
        ModelRefused: an axis is missing or of the wrong type, a frame is missing, or forward kinematics is not eq. (3).

    Examples:
        >>> lengths(Machine.load())
        Lengths(l4=0.35, l5=0.06, l6=0.45, radius=0.04)
    """
    for name in POSE:
        revolute = name in "ca"
        expected = f"the tape layer needs {'revolute' if revolute else 'prismatic'} axis {name!r}"
        if name not in machine.names:
            raise ModelRefused(f"{machine.path}: {expected}; the axes are {', '.join(machine.names)}")
        if machine.axis(name).revolute != revolute:
            raise ModelRefused(f"{machine.path}: {expected}; this one is {'prismatic' if revolute else 'revolute'}")
    # With the head straight down and turned over, the mean and half the difference give l4 and l6.
    q = np.zeros((2, len(machine.axes)))
    q[1, machine.column("a")] = np.pi
    down, over = machine.forward_pinocchio(q, "contact")[:, :3, 3]
    centre = machine.forward_pinocchio(q[:1], "roller")[0, :3, 3]
    # Sums leave 1e-17 m: a picometre is finer than any URDF and gives back the file's own decimals.
    l4, l5, l6, radius = (
        round(float(length), 12)
        for length in (-(over[2] + down[2]) / 2, -down[1], (over[2] - down[2]) / 2, centre[2] - down[2])
    )
    head = Lengths(l4, l5, l6, radius)
    _check_family(machine, head)
    return head


def _check_family(machine: Machine, head: Lengths) -> None:
    """Compare eq. (3) with Pinocchio on a fixed sample, on which any other chain differs somewhere."""
    if not 0.0 <= head.radius < head.l6:
        raise ModelRefused(
            f"{machine.path}: the roller's radius is {head.radius * 1e3:.3f} mm (frames roller and contact), "
            f"expected 0 to less than l6 = {head.l6 * 1e3:.3f} mm"
        )
    chance = np.random.default_rng(2008)
    q = chance.uniform(-1.0, 1.0, (_FAMILY_SAMPLES, len(machine.axes)))
    for name in ("c", "a"):
        q[:, machine.column(name)] *= np.pi
    pose = q[:, [machine.column(name) for name in POSE]]
    for frame, reach in (("contact", head.l6), ("roller", head.l6 - head.radius)):
        actual = machine.forward_pinocchio(q, frame)
        expected = _forward(head, reach, pose)
        off = np.abs(actual - expected)
        if not np.all(off <= _FAMILY_TOLERANCE):
            row = int(np.argmax(np.max(off, axis=(1, 2))))
            at = ", ".join(f"{axis} = {value:.3f}" for axis, value in zip(POSE, pose[row], strict=True))
            distance = np.linalg.norm(actual[row, :3, 3] - expected[row, :3, 3]) * 1e3
            turn = np.degrees(np.linalg.norm(actual[row, :3, :3] - expected[row, :3, :3]) / np.sqrt(2.0))
            raise ModelRefused(
                f"{machine.path}: not the chain of the tape layer: at {at} (m, rad) frame {frame} is {distance:.6f} mm "
                f"and {turn:.6f} deg from eq. (3) with l4 = {head.l4 * 1e3:.3f}, l5 = {head.l5 * 1e3:.3f}, "
                f"l6 = {head.l6 * 1e3:.3f} mm; see docs/kinematics.md for the chain, and write rpy with all its digits"
            )


def _forward(head: Lengths, reach: float, pose: Floats) -> Floats:
    """Return poses (n, 4, 4) of the frame `reach` metres from the a axis by eq. (3): heading, left, head normal."""
    heading = np.column_stack([np.sin(pose[:, 3]), np.cos(pose[:, 3]), np.zeros(len(pose))])
    poses = np.tile(np.eye(4), (len(pose), 1, 1))
    poses[:, :3, :3] = np.stack([heading, -roller_axes(pose), normals(pose)], axis=2)
    poses[:, :3, 3] = tool_points(head, reach, pose)
    return poses


def _solve(head: Lengths, points: Floats, normals: Floats, tangents: Floats, branches: int) -> Floats:
    _check_rows(points, normals, tangents)
    joints: Floats = np.empty((branches, len(points), 5))
    for start in range(0, len(points), CHUNK):
        rows = slice(start, start + CHUNK)
        _solve_chunk(head, points[rows], normals[rows], tangents[rows], joints[:, rows])
    return joints


def _solve_chunk(head: Lengths, points: Floats, normals: Floats, tangents: Floats, joints: Floats) -> None:
    """Write joint values into (b, n, 5) by the exact form of docs/kinematics.md."""
    px, py, pz = np.ascontiguousarray(points.T)
    nx, ny, nz = np.ascontiguousarray(normals.T)
    tx, ty, tz = np.ascontiguousarray(tangents.T)
    # r = t x n is the roller axis (cos4 cos5, -sin4 cos5, sin5) up to its length: it gives sines and cosines.
    rx, ry, rz = ty * nz - tz * ny, tz * nx - tx * nz, tx * ny - ty * nx
    level_squared = rx * rx + ry * ry
    level, length = np.sqrt(level_squared), np.sqrt(level_squared + rz * rz)
    travel = np.sqrt(tx * tx + ty * ty + tz * tz)
    lost = ~((length > _PARALLEL * travel) & (level > _PARALLEL * length))
    # NaN in the lengths makes every value of the row NaN, and no division warns.
    level[lost] = length[lost] = rx[lost] = np.nan
    sin4, cos4, sin5, cos5 = -ry / level, rx / level, rz / length, level / length
    theta4, theta5 = np.arctan2(-ry, rx), np.arctan2(rz, level)

    radius, reach = head.radius, head.l6 - head.radius
    centre = (px + radius * nx, py + radius * ny, pz + radius * nz)
    d1, d2, d3 = _slides_to(head, reach, centre, (sin4, cos4, sin5, cos5))
    for column, values in enumerate((d1, d2, d3, theta4, theta5)):
        joints[0, :, column] = values
    if len(joints) == 2:
        # (c + pi, -a): the same head normal, l5 on the other side of it.
        joints[1, :, 0] = d1 - 2.0 * head.l5 * sin4
        joints[1, :, 1] = d2 + 2.0 * head.l5 * cos4
        joints[1, :, 2] = d3
        joints[1, :, 3] = theta4 + np.pi
        joints[1, :, 4] = -theta5


def _slides_to(
    head: Lengths, reach: float, end: tuple[Floats, Floats, Floats], turns: tuple[Floats, Floats, Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Solve eq. (3) for the d1, d2, d3 that put the point `reach` metres from the a axis at `end` in `machine` axes."""
    sin4, cos4, sin5, cos5 = turns
    arm = reach * sin5
    d1 = end[0] + head.l5 * sin4 - arm * cos4
    d2 = -end[1] - head.l5 * cos4 - arm * sin4
    d3 = -end[2] - head.l4 - reach * cos5
    return d1, d2, d3


def _sines(joints: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    (cos4, cos5), (sin4, sin5) = cosine_and_sine(joints[:, 3:5].T)
    return sin4, cos4, sin5, cos5


def _check_rows(points: Floats, normals: Floats, tangents: Floats) -> None:
    for name, rows in (("points", points), ("normals", normals), ("tangents", tangents)):
        if rows.shape != (len(points), 3):
            raise ValueError(f"{name} have shape {rows.shape}, expected ({len(points)}, 3)")
