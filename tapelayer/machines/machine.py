"""Machine: a URDF's axes with travel and speed, and forward kinematics of many poses at once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pinocchio

from tapelayer.arrays import Floats
from tapelayer.errors import ConfigurationRefused, ModelRefused
from tapelayer.machines.columns import (
    STILL,
    Columns,
    Entry,
    add,
    compose,
    constant,
    cosine_and_sine,
    fill,
    product,
    rows_of,
    snapped,
)
from tapelayer.machines.urdf_file import Joint, read_urdf
from urdf import TAPELAYER

# Rows evaluated at a time, so that the columns of a chunk stay in the cache.
CHUNK = 1 << 14


@dataclass(frozen=True)
class Axis:
    """One driven joint.

    Attributes:
        name: joint name.
        revolute: True for radians, False for metres.
        lower: lower end of travel, metres or radians; -inf for a continuous joint.
        upper: upper end of travel, metres or radians; inf for a continuous joint.
        speed: greatest speed, m/s or rad/s.
        acceleration: greatest acceleration, m/s2 or rad/s2; inf where none is stated.
        jerk: greatest jerk, m/s3 or rad/s3; inf where none is stated.
    """

    name: str
    revolute: bool
    lower: float
    upper: float
    speed: float
    acceleration: float = np.inf
    jerk: float = np.inf


class _Joint(NamedTuple):
    """A joint in its parent, as constants: R = still + cos(q) cosine + sin(q) sine, p = origin + q slide."""

    parent: int
    column: int
    revolute: bool
    scaling: float
    offset: float
    still: Columns
    cosine: Sequence[float]
    sine: Sequence[float]
    slide: Sequence[float]


class _Frame(NamedTuple):
    joint: int
    placement: Columns


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine read from a URDF.

    Attributes:
        path: the file.
        sha256: SHA-256 of its bytes, hexadecimal.
        axes: driven joints in the file's order: the columns of every q.
        model: Pinocchio's model of the file's chain, in which mimic joints are joints like others.
        moving: moving joints of the file, with what those that follow others follow.
    """

    path: Path
    sha256: str
    axes: tuple[Axis, ...]
    model: pinocchio.Model
    moving: tuple[Joint, ...]
    _joints: tuple[_Joint, ...]
    _frames: Mapping[str, _Frame]

    @staticmethod
    def load(urdf: Path | None = None) -> Machine:
        """Read a URDF (default: the built-in tape layer).

        Raises:
            ModelRefused: no readable URDF, faults in it, or an axis without travel or speed.

        Examples:
            >>> Machine.load().path.name
            'tapelayer.urdf'
        """
        path = TAPELAYER if urdf is None else Path(urdf)
        moving, chain = read_urdf(path)
        try:
            model = pinocchio.buildModelFromXML(chain)
        except (ValueError, RuntimeError) as error:
            raise ModelRefused(f"{path}: Pinocchio cannot build it: {' '.join(str(error).split())}") from error
        axes = tuple(_axis(path, joint) for joint in moving if not joint.mimics)
        columns = {axis.name: column for column, axis in enumerate(axes)}
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        return Machine(path, sha256, axes, model, moving, _joints(model, moving, columns), _frames(model))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the axes in column order."""
        return tuple(axis.name for axis in self.axes)

    def axis(self, name: str) -> Axis:
        """Return the axis of a name.

        Raises:
            ModelRefused: there is none.

        Examples:
            >>> Machine.load().axis("z")
            Axis(name='z', revolute=False, lower=0.0, upper=0.8, speed=0.5, acceleration=2.0, jerk=inf)
        """
        return self.axes[self.column(name)]

    def column(self, name: str) -> int:
        """Return the column of an axis in q.

        Raises:
            ModelRefused: there is no such axis.

        Examples:
            >>> Machine.load().column("c")
            3
        """
        if name not in self.names:
            raise ModelRefused(f"{self.path}: no axis {name!r}; the axes are {', '.join(self.names)}")
        return self.names.index(name)

    def with_limits(
        self,
        travel: Mapping[str, tuple[float, float]],
        speeds: Mapping[str, float],
        accelerations: Mapping[str, float] = MappingProxyType({}),
        jerks: Mapping[str, float] = MappingProxyType({}),
    ) -> Machine:
        """Return this machine with other limits by axis name, in metres, radians and seconds.

        Args:
            travel: (lower, upper) ends.
            speeds: greatest speeds.
            accelerations: greatest accelerations.
            jerks: greatest jerks.

        Raises:
            ModelRefused: the machine has no such axis, lower is not below upper, another limit is not positive, or an
                axis has a jerk but no acceleration.

        Examples:
            >>> machine = Machine.load().with_limits({"x": (0.0, 2.5)}, {"c": 0.5})
            >>> machine.axis("x").upper, machine.axis("c").speed
            (2.5, 0.5)
        """
        axes = list(self.axes)
        for name, (lower, upper) in travel.items():
            column = self.column(name)
            axes[column] = replace(axes[column], lower=float(lower), upper=float(upper))
        for attribute, limits in (("speed", speeds), ("acceleration", accelerations), ("jerk", jerks)):
            for name, limit in limits.items():
                column = self.column(name)
                axes[column] = Axis(**{**vars(axes[column]), attribute: float(limit)})
        for axis in axes:
            _check_axis(self.path, axis)
        return replace(self, axes=tuple(axes))

    def check_travel(self, names: Iterable[str]) -> None:
        """Refuse axes that turn without end: what they carry has hoses, cables and tape.

        Raises:
            ModelRefused: one or more of these axes have no ends of travel.
        """
        endless = [axis.name for axis in map(self.axis, names) if not np.isfinite(axis.upper - axis.lower)]
        if endless:
            named = f"axis {endless[0]} turns" if len(endless) == 1 else f"axes {' and '.join(endless)} turn"
            example = ", ".join(f"{name} = [-180, 180]" for name in endless)
            raise ModelRefused(
                f"{self.path}: {named} without end, and hoses, cables and tape do not: "
                f"give travel with limits_deg, e.g. {{{example}}}"
            )

    def forward(self, q: Floats, frame: str) -> Floats:
        """Return poses (n, 4, 4) of a frame in the root link's axes, translations in metres.

        Args:
            q: (n, k) axis values in metres and radians, columns as `axes`.
            frame: name of a link, or of a fixed joint.

        Raises:
            ModelRefused: there is no such frame.
            ConfigurationRefused: q has another shape, or a value that is not finite.

        Examples:
            >>> machine = Machine.load()
            >>> poses = machine.forward(np.zeros((2, 10)), "contact")
            >>> poses.shape, np.round(poses[0, :3, 3], 6).tolist()
            ((2, 4, 4), [0.0, -0.06, -0.8])
        """
        return self.forward_all(q, (frame,))[frame]

    def forward_all(self, q: Floats, frames: Sequence[str]) -> dict[str, Floats]:
        """Return poses (n, 4, 4) of several frames by name, walking the chain once; arguments and errors as `forward`.

        Examples:
            >>> machine = Machine.load()
            >>> poses = machine.forward_all(np.zeros((1, 10)), ("roller", "contact"))
            >>> {name: round(float(pose[0, 2, 3]), 6) for name, pose in poses.items()}
            {'roller': -0.76, 'contact': -0.8}
        """
        values = self._checked(q)
        ends = {name: self._frame(name) for name in frames}
        poses = {name: np.zeros((len(values), 4, 4)) for name in ends}
        for start in range(0, len(values), CHUNK):
            rows = slice(start, start + CHUNK)
            for name, columns in self._walk(values[rows], ends).items():
                fill(poses[name][rows], columns)
        return poses

    def columns(self, q: Floats, frame: str) -> Columns:
        """Return poses of a frame as separate entries, for callers that need few; q is best no longer than `CHUNK`.

        Arguments and errors as `forward`.
        """
        return self._walk(self._checked(q), {frame: self._frame(frame)})[frame]

    def forward_pinocchio(self, q: Floats, frame: str) -> Floats:
        """Return poses (n, 4, 4) as `forward`, each by Pinocchio itself: slow, and the reference for `forward`."""
        configurations = self.configurations(q)
        self._frame(frame)
        index = _frame_index(self.model, frame)
        data = self.model.createData()
        # oMf[index] is a live view: take it once and copy it after each call.
        live = data.oMf[index]
        poses = np.empty((len(configurations), 4, 4))
        for row, configuration in enumerate(configurations):
            pinocchio.forwardKinematics(self.model, data, configuration)
            pinocchio.updateFramePlacement(self.model, data, index)
            poses[row] = live.homogeneous
        return poses

    def configurations(self, q: Floats) -> Floats:
        """Return Pinocchio's configurations (n, nq) of (n, k) axis values, with those of the joints that follow them.

        A continuous joint becomes cosine and sine.

        Raises:
            ConfigurationRefused: q has another shape, or a value that is not finite.
        """
        values = self._checked(q)
        configurations = np.empty((len(values), self.model.nq))
        for moving in self.moving:
            joint = self.model.getJointId(moving.name)
            first = self.model.idx_qs[joint]
            turned = moving.multiplier * values[:, self.column(moving.mimics or moving.name)] + moving.offset
            if self.model.nqs[joint] == 2:
                configurations[:, first] = np.cos(turned)
                configurations[:, first + 1] = np.sin(turned)
            else:
                configurations[:, first] = turned
        return configurations

    def _checked(self, q: Floats) -> Floats:
        values = np.asarray(q, dtype=np.float64)
        if values.ndim != 2 or values.shape[1] != len(self.axes):
            raise ConfigurationRefused(
                f"axis values of shape {values.shape}, expected (n, {len(self.axes)}): columns {', '.join(self.names)}"
            )
        with np.errstate(invalid="ignore", over="ignore"):
            total = np.sum(values)
        # The sum is finite if every value is, short of overflow; only otherwise are the values checked one by one.
        if not np.isfinite(total):
            rows, columns = np.nonzero(~np.isfinite(values))
            if len(rows):
                name, value = self.names[columns[0]], values[rows[0], columns[0]]
                raise ConfigurationRefused(f"row {rows[0]}: axis {name} is {value}, expected a finite number")
        return values

    def _frame(self, name: str) -> _Frame:
        if name not in self._frames:
            nearest = get_close_matches(name, self._frames, n=1, cutoff=0.0)
            raise ModelRefused(f"{self.path}: no frame {name!r}; the nearest name is {nearest[0]!r}")
        return self._frames[name]

    def _walk(self, values: Floats, ends: Mapping[str, _Frame]) -> dict[str, Columns]:
        poses: dict[int, Columns] = {0: STILL}
        for joint in sorted(self._ancestors(end.joint for end in ends.values())):
            constants = self._joints[joint]
            column = np.ascontiguousarray(values[:, constants.column])
            poses[joint] = compose(poses[constants.parent], _moved(constants, column))
        return {name: compose(poses[end.joint], end.placement) for name, end in ends.items()}

    def _ancestors(self, joints: Iterable[int]) -> set[int]:
        ancestors: set[int] = set()
        for joint in joints:
            while joint and joint not in ancestors:
                ancestors.add(joint)
                joint = self._joints[joint].parent
        return ancestors


def _axis(path: Path, joint: Joint) -> Axis:
    axis = Axis(
        name=joint.name,
        revolute=joint.kind != "prismatic",
        lower=joint.lower,
        upper=joint.upper,
        speed=joint.speed,
        acceleration=joint.acceleration,
        jerk=joint.jerk,
    )
    _check_axis(path, axis)
    return axis


def _check_axis(path: Path, axis: Axis) -> None:
    unit = "rad" if axis.revolute else "m"
    if not axis.lower < axis.upper:
        raise ModelRefused(
            f"{path}: axis {axis.name} has travel {axis.lower:g} to {axis.upper:g} {unit}, expected lower < upper"
        )
    if not axis.speed > 0:
        raise ModelRefused(f"{path}: axis {axis.name} has speed {axis.speed:g} {unit}/s, expected more than 0")
    for name, value, power in (("acceleration", axis.acceleration, 2), ("jerk", axis.jerk, 3)):
        if not value > 0:
            raise ModelRefused(f"{path}: axis {axis.name} has {name} {value:g} {unit}/s{power}, expected more than 0")
    if np.isfinite(axis.jerk) and not np.isfinite(axis.acceleration):
        raise ModelRefused(f"{path}: axis {axis.name} has a jerk but no acceleration; state both, or neither")


def _joints(model: pinocchio.Model, moving: Iterable[Joint], columns: Mapping[str, int]) -> tuple[_Joint, ...]:
    neutral = pinocchio.neutral(model)
    by_name = {joint.name: joint for joint in moving}
    # Joint 0 is the root: it never moves and is never evaluated.
    joints = [_Joint(0, 0, False, 1.0, 0.0, STILL, (), (), ())]
    for index in range(1, model.njoints):
        joint, stated = model.joints[index], by_name[model.names[index]]
        state = joint.createData()
        joint.calc(state, neutral)
        subspace = np.asarray(state.S, dtype=np.float64).reshape(6)
        placement = model.jointPlacements[index]
        rotation, origin = placement.rotation, placement.translation
        linear, axis = subspace[:3], subspace[3:]
        revolute = bool(np.any(axis))
        # Rodrigues: R(q) = a a' + cos q (1 - a a') + sin q [a]x
        projector = np.outer(axis, axis)
        joints.append(
            _Joint(
                parent=int(model.parents[index]),
                column=columns[stated.mimics or stated.name],
                revolute=revolute,
                scaling=stated.multiplier,
                offset=stated.offset,
                still=constant(rotation @ projector if revolute else rotation, origin),
                cosine=snapped(rotation @ (np.eye(3) - projector)),
                sine=snapped(rotation @ pinocchio.skew(axis)),
                slide=snapped(rotation @ linear),
            )
        )
    return tuple(joints)


def _frames(model: pinocchio.Model) -> dict[str, _Frame]:
    frames = {}
    for frame in model.frames:
        # Where a link and a joint share a name, the link is meant.
        if frame.name not in frames or frame.type == pinocchio.FrameType.BODY:
            placement = frame.placement
            frames[frame.name] = _Frame(int(frame.parentJoint), constant(placement.rotation, placement.translation))
    return frames


def _frame_index(model: pinocchio.Model, name: str) -> int:
    link = pinocchio.FrameType.BODY
    return int(model.getFrameId(name, link) if model.existFrame(name, link) else model.getFrameId(name))


def _moved(joint: _Joint, column: Floats) -> Columns:
    """Return the joint's placement in its parent for (n,) values of its axis."""
    value: Entry = add(product(joint.scaling, column), joint.offset)
    rotation, origin = joint.still
    if not joint.revolute:
        return Columns(rotation, tuple(add(p, product(s, value)) for p, s in zip(origin, joint.slide, strict=True)))
    cosine, sine = cosine_and_sine(np.asarray(value))
    entries = [
        add(add(still, product(c, cosine)), product(s, sine))
        for still, c, s in zip(chain.from_iterable(rotation), joint.cosine, joint.sine, strict=True)
    ]
    return Columns(rows_of(entries), origin)
