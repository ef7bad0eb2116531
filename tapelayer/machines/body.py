"""Body: the rigid shapes of a machine, which of them may meet, and how far a motion moves them at most.

The bound adds up what each joint contributes: a point moves no faster than the sum, over the joints above it, of the
joint's speed times the point's distance from the joint's axis. Slides below which nothing turns move together, so
their steps add up as one vector.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import Any

import coal
import numpy as np
import pinocchio

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.errors import ModelRefused
from tapelayer.machines.machine import Machine
from tapelayer.machines.urdf_file import Collision, Joint, read_collisions
from tapelayer.vectors import norms

# Corners of the prism round a cylinder, which contains it.
_SIDES = 24
_CUBE = np.array(list(product((-1.0, 1.0), repeat=3)))
# Two turns about axes no farther from parallel than this, in radians, count as about one direction.
_PARALLEL = 1e-9
ROOT = 0


@dataclass(frozen=True, eq=False)
class Shape(Frozen):
    """A rigid shape of a machine.

    Attributes:
        name: its own name in the URDF, or that of its link with its number in the link from 0, as Pinocchio has it.
        link: the link that it belongs to.
        joint: Pinocchio's number of the joint that moves it; 0 where none does.
        place: (4, 4) its placement in that joint's frame, metres.
        corners: (m, 3) points in that frame, whose convex hull contains it, metres.
        half: (3,) half the edges of the box round it in its own frame, metres.
        solid: coal's geometry of it.
    """

    name: str
    link: str
    joint: int
    place: Floats
    corners: Floats
    half: Floats
    solid: Any

    @property
    def radius(self) -> float:
        """Greatest distance of its points from the joint's origin at most, metres."""
        return float(np.max(norms(self.corners)))

    @cached_property
    def ball(self) -> float:
        """Radius of the ball round it about its own origin, metres.

        Examples:
            >>> shape = Body.of(Machine.load()).shape("tyre")
            >>> shape.ball == float(np.linalg.norm(shape.half))
            True
        """
        return float(np.linalg.norm(self.half))

    @cached_property
    def back(self) -> Floats:
        """Placement (4, 4) of the joint's frame in its own, metres.

        Examples:
            >>> shape = Body.of(Machine.load()).shape("tyre")
            >>> bool(np.allclose(shape.back @ shape.place, np.eye(4), atol=1e-15))
            True
        """
        back = np.eye(4)
        back[:3, :3] = self.place[:3, :3].T
        back[:3, 3] = -back[:3, :3] @ self.place[:3, 3]
        return back


@dataclass(frozen=True, eq=False)
class Rates(Frozen):
    """How far some shapes move at most, seen from a joint above them.

    Attributes:
        together: (k,) the slides below which nothing turns, by column of the machine's axes.
        stretch: metres of motion per metre of the vector of their steps; 1 where they are square to each other.
        rates: (k,) metres of motion per metre or radian of every other axis; 0 for one that does not move the shapes.
    """

    together: Mask
    stretch: float
    rates: Floats

    def bounds(self, steps: Floats, arcs: tuple[Ints, Ints] | None = None) -> Floats:
        """Return how far (n,) any point of the shapes moves at most, in metres.

        Args:
            steps: (n, k) how far each axis goes, metres and radians; on an arc, the arc's length for both axes of its
                plane.
            arcs: the rows (m,) of arcs, and the columns (m, 2) of their planes; None where all is straight.

        Examples:
            >>> rates = Body.of(Machine.load()).rates(Machine.load().model.getJointId("z"))
            >>> steps = np.zeros((1, 10))
            >>> steps[0, :3] = 0.003, 0.004, 0.012
            >>> np.round(rates.bounds(steps), 6).tolist()
            [0.013]
        """
        squares = np.square(steps) @ self.together.astype(np.float64)
        if arcs is not None:
            rows, planes = arcs
            # The arc's length is that of the motion in both axes.
            both = rows[np.all(self.together[planes], axis=1)]
            squares[both] -= np.square(steps[both, planes[np.all(self.together[planes], axis=1), 0]])
        bounds: Floats = self.stretch * np.sqrt(np.maximum(squares, 0.0)) + steps @ self.rates
        return bounds


@dataclass(frozen=True, eq=False)
class Body:
    """The rigid shapes of a machine.

    Attributes:
        machine: with the setup's limits already in it.
        shapes: in the order of the URDF's links.
        neighbours: pairs of links that touch by nature, so that they are never judged against each other.
    """

    machine: Machine
    shapes: tuple[Shape, ...]
    neighbours: frozenset[frozenset[str]]

    @staticmethod
    def of(machine: Machine, touching: Iterable[tuple[str, str]] = ()) -> Body:
        """Return the body of a machine.

        Args:
            machine: with the setup's limits already in it.
            touching: pairs of links that touch by nature, besides those that a joint connects.

        Raises:
            ModelRefused: a link is drawn and has no <collision>, one is no solid of a known size, or there is none.

        Examples:
            >>> body = Body.of(Machine.load())
            >>> len(body.shapes), body.shape("tyre").link, frozenset(("fork", "head")) in body.neighbours
            (66, 'roller', True)
        """
        links = _links(machine.model)
        shapes: list[Shape] = []
        counts: dict[str, int] = {}
        for collision in read_collisions(machine.path):
            number = counts[collision.link] = counts.get(collision.link, -1) + 1
            shapes.append(_shape(collision, number, *links[collision.link]))
        if not shapes:
            raise ModelRefused(f"{machine.path}: no link has a <collision>; give boxes, cylinders or spheres to each")
        neighbours = {frozenset(pair) for pair in (*_connected(machine.model), *touching)}
        return Body(machine, tuple(shapes), frozenset(neighbours))

    def shape(self, name: str) -> Shape:
        """Return the shape of a name.

        Raises:
            ModelRefused: there is none.
        """
        for shape in self.shapes:
            if shape.name == name:
                return shape
        raise ModelRefused(f"{self.machine.path}: no <collision> named {name!r}; name the one that is meant")

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Pinocchio's numbers of the joints that move shapes, the root among them, parents first."""
        return tuple(sorted({shape.joint for shape in self.shapes}))

    @cached_property
    def carriers(self) -> Mapping[int, str]:
        """The link by joint that is fixed in the joint's frame, at its origin."""
        carriers: dict[int, str] = {}
        for name, (joint, place) in _links(self.machine.model).items():
            if np.array_equal(place, np.eye(4)):
                carriers.setdefault(joint, name)
        return carriers

    def carried(self, joint: int) -> tuple[Shape, ...]:
        """Return the shapes that a joint moves."""
        return tuple(shape for shape in self.shapes if shape.joint == joint)

    @cached_property
    def meetings(self) -> tuple[tuple[int, int], ...]:
        """Pairs of joints, the upper one first, that move shapes which may meet."""
        return tuple(pair for pair in combinations(self.joints, 2) if self.may_meet(*pair))

    def may_meet(self, upper: int, lower: int) -> tuple[tuple[Shape, Shape], ...]:
        """Return the pairs of shapes, one moved by each of two joints, that are judged against each other."""
        return tuple(
            (one, other)
            for one in self.carried(upper)
            for other in self.carried(lower)
            if frozenset((one.link, other.link)) not in self.neighbours
        )

    def chain(self, joint: int, above: int = ROOT) -> tuple[int, ...]:
        """Return the joints from one down to another, without the upper one.

        Raises:
            ValueError: the upper one is not above the lower one.
        """
        chain: list[int] = []
        while joint != above:
            if joint == ROOT:
                raise ValueError(f"joint {above} is not above joint {chain[0]}")
            chain.append(joint)
            joint = int(self.machine.model.parents[joint])
        return tuple(reversed(chain))

    def meeting(self, upper: int, lower: int) -> int:
        """Return the lowest joint above both of two joints, or one of them where that is above the other."""
        above = (ROOT, *self.chain(upper))
        return next(joint for joint in reversed((ROOT, *self.chain(lower))) if joint in above)

    def rates(self, joint: int, above: int = ROOT, reach: Floats | None = None) -> Rates:
        """Return how far the shapes that a joint moves go at most, seen from a joint above it.

        Args:
            joint: Pinocchio's number of it.
            above: Pinocchio's number of the joint in whose frame the motion is seen.
            reach: (k,) farthest from 0 that each axis of the machine goes, metres and radians; None for its travel.
        """
        axes = self.machine.axes
        if reach is None:
            reach = np.array([max(abs(axis.lower), abs(axis.upper)) for axis in axes])
        links = [self._moved(number, reach) for number in self.chain(joint, above)]
        radius = max((shape.radius for shape in self.carried(joint)), default=0.0)
        # Distance from each joint's origin to the next one, and from the last to the farthest point.
        spans = [*(link.span for link in links[1:]), radius]
        turns = [number for number, link in enumerate(links) if link.revolute]
        free = links[: turns[0]] if turns else links
        ways = np.zeros((3, len(axes)))
        rates = np.zeros(len(axes))
        for number, link in enumerate(links):
            if link.revolute:
                continue
            if number < len(free):
                ways[:, link.column] += link.scaling * link.direction
            else:
                rates[link.column] += abs(link.scaling)
        for column in {links[number].column for number in turns}:
            rates[column] += _turning(links, spans, turns, column)
        together = np.any(ways != 0.0, axis=0)
        stretch = float(np.linalg.norm(ways, 2)) if np.any(together) else 0.0
        # Rounding leaves square slides with a stretch of 1 + 1e-16, which the gap taken off every bound covers.
        return Rates(together, stretch, rates)

    def _moved(self, joint: int, reach: Floats) -> _Link:
        """Return a joint as the bounds need it, with its direction at the machine's zero."""
        model = self.machine.model
        stated = self._stated[model.names[joint]]
        column = self.machine.column(stated.mimics or stated.name)
        state = model.joints[joint].createData()
        model.joints[joint].calc(state, self._zero)
        subspace = np.asarray(state.S, dtype=np.float64).reshape(6)
        revolute = bool(np.any(subspace[3:]))
        placement = model.jointPlacements[joint]
        span = float(np.linalg.norm(placement.translation))
        if not revolute:
            span += abs(stated.multiplier) * float(reach[column]) + abs(stated.offset)
        direction = self._turned[joint] @ (subspace[3:] if revolute else subspace[:3])
        return _Link(column, stated.multiplier, revolute, direction, span)

    @cached_property
    def _stated(self) -> Mapping[str, Joint]:
        return {joint.name: joint for joint in self.machine.moving}

    @cached_property
    def _zero(self) -> Floats:
        zero: Floats = pinocchio.neutral(self.machine.model)
        return zero

    @cached_property
    def _turned(self) -> tuple[Floats, ...]:
        """Rotation of each joint's frame in the root where all joints stand at zero."""
        model = self.machine.model
        turned = [np.eye(3)]
        for joint in range(1, model.njoints):
            turned.append(turned[int(model.parents[joint])] @ model.jointPlacements[joint].rotation)
        return tuple(turned)


@dataclass(frozen=True, eq=False)
class _Link:
    """A joint in a chain.

    Attributes:
        column: of the axis that drives it.
        scaling: its metres or radians per metre or radian of that axis.
        revolute: whether it turns.
        direction: (3,) of its axis in the root, where all joints stand at zero.
        span: greatest distance of its origin from the origin of the joint above, metres.
    """

    column: int
    scaling: float
    revolute: bool
    direction: Floats
    span: float


def _turning(links: list[_Link], spans: list[float], turns: list[int], column: int) -> float:
    """Return the metres that a point at the end of a chain moves at most per radian of one axis.

    Joints that one axis turns about parallel directions add up as they turn: two that turn against each other only
    shift what is beyond them.

    Args:
        links: the chain, base first.
        spans: distance from each joint's origin to the next one, and from the last to the farthest point, metres.
        turns: the numbers of its turning joints.
        column: of the axis.
    """
    own = [number for number in turns if links[number].column == column]
    between = [number for number in turns if own[0] <= number <= own[-1]]
    along = np.array([links[number].direction for number in between]) @ links[own[0]].direction
    if not np.all(np.abs(along) >= np.cos(_PARALLEL)):
        return sum(abs(links[number].scaling) * sum(spans[number:]) for number in own)
    signed = {number: links[number].scaling * float(np.sign(a)) for number, a in zip(between, along, strict=True)}
    turned, rate = 0.0, 0.0
    for number, following in zip(own, [*own[1:], len(links)], strict=True):
        turned += signed[number]
        rate += abs(turned) * sum(spans[number:following])
    return rate


def _shape(collision: Collision, number: int, joint: int, link: Floats) -> Shape:
    """Return a shape of the file in the frame of the joint that moves it."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = pinocchio.rpy.rpyToMatrix(*collision.rpy), collision.xyz
    place = link @ place
    local: Floats
    if collision.kind == "box":
        solid, half = coal.Box(*collision.sizes), np.array(collision.sizes) / 2
        local = _CUBE * half
    elif collision.kind == "cylinder":
        radius, length = collision.sizes
        solid, half = coal.Cylinder(radius, length), np.array([radius, radius, length / 2])
        angles = np.arange(_SIDES) * (2.0 * np.pi / _SIDES)
        # The middle of each side of the prism touches the cylinder.
        rim = radius / np.cos(np.pi / _SIDES) * np.column_stack([np.cos(angles), np.sin(angles)])
        local = np.concatenate([np.column_stack([rim, np.full(_SIDES, end)]) for end in (-length / 2, length / 2)])
    else:
        (radius,) = collision.sizes
        solid, half = coal.Sphere(radius), np.full(3, radius)
        local = _CUBE * half
    corners = local @ place[:3, :3].T + place[:3, 3]
    name = collision.name or f"{collision.link}_{number}"
    return Shape(name, collision.link, joint, place, corners, half, solid)


def _links(model: pinocchio.Model) -> dict[str, tuple[int, Floats]]:
    """Return the joint that moves each link, and the link's placement (4, 4) in that joint's frame."""
    return {
        frame.name: (int(frame.parentJoint), frame.placement.homogeneous.copy())
        for frame in model.frames
        if frame.type == pinocchio.FrameType.BODY
    }


def _connected(model: pinocchio.Model) -> Iterable[tuple[str, str]]:
    """Yield the pairs of links that a joint connects."""
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY:
            above = model.frames[model.frames[frame.parentFrame].parentFrame]
            if above.type == pinocchio.FrameType.BODY:
                yield above.name, frame.name
