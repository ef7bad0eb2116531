"""Strip: a tape on a geodesic before it is cut, with coordinates along and across it (Fermi coordinates)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Frozen
from tapelayer.errors import BeyondSurface, NoNaturalPaths
from tapelayer.geometry.geodesics import lateral, trace
from tapelayer.geometry.height_field import HeightField
from tapelayer.plies.reach import Reach

Side = Literal[1, -1]
LEFT: Side = 1
RIGHT: Side = -1

# Steps of the lateral geodesics from the centre line to either edge.
LATERAL_STEPS = 4
# Least and most samples traced at once.
LEAST_STEPS, MOST_STEPS = 2, 1024
# A strip this many times as long as the reach is wide does not leave it.
LONGEST = 8.0
# Rounds of Newton's method from plan points to strip coordinates, and what they may miss, in metres.
INVERSE_ROUNDS = 12
INVERSE_ACCURACY = 1e-10


@dataclass(frozen=True, eq=False)
class Strip(Frozen):
    """A strip of tape, with samples along its centre line.

    Strip coordinates are the arc length s along the centre line and the geodesic distance v to its left.

    Attributes:
        field: the surface.
        arcs: (n,) metres along the centre line, evenly spaced and rising, 0 at the sample where it was aimed.
        states: (n, 4) plan position and plan velocity of the centre line.
        width: of the tape, metres.
    """

    field: HeightField
    arcs: Floats
    states: Floats
    width: float

    @cached_property
    def left(self) -> Floats:
        """Lateral geodesics (k, n, 6) from the centre line to the left edge: plan, velocity outwards, G, G'."""
        return lateral(self.field, self.states, self.width / 2.0, LATERAL_STEPS)

    @cached_property
    def right(self) -> Floats:
        """Lateral geodesics (k, n, 6) from the centre line to the right edge: plan, velocity outwards, G, G'."""
        return lateral(self.field, self.states, -self.width / 2.0, LATERAL_STEPS)

    def edge(self, side: Side) -> Floats:
        """Return the ends (n, 6) of the lateral geodesics on a side."""
        edge: Floats = (self.left if side == LEFT else self.right)[-1]
        return edge

    @property
    def strains(self) -> Floats:
        """Strain (2, n) of the left and the right edge: length of the edge over that of the centre line, less 1."""
        strains: Floats = np.array([self.left[-1, :, 4], self.right[-1, :, 4]]) - 1.0
        return strains

    def at(self, arcs: Floats) -> Floats:
        """Return the plan points (m, 2) of the centre line at arc lengths (m,)."""
        plan: Floats = self._centre(arcs)
        return plan

    def plan(self, arcs: Floats, across: Floats) -> Floats:
        """Return the plan points (m, 2) at strip coordinates (m,) and (m,)."""
        return self._powers(self._lines(arcs), across).T

    def coordinates(self, plan: Floats) -> tuple[Floats, Floats]:
        """Return the strip coordinates (m,) and (m,) of plan points (m, 2) on the strip or near its edges.

        Beyond the ends of the samples the nearest end's arc length is returned.
        """
        nearest = self._tree.query(plan)[1]
        arcs, across = self.arcs[nearest], np.zeros(len(plan))
        missed = (plan - self.states[nearest, :2]).T
        along, aside = self.states[nearest, 2:].T, self.left[0, nearest, 2:4].T
        for _ in range(INVERSE_ROUNDS):
            area = along[0] * aside[1] - along[1] * aside[0]
            further = (missed[0] * aside[1] - missed[1] * aside[0]) / area
            aside_by = (along[0] * missed[1] - along[1] * missed[0]) / area
            arcs = np.clip(arcs + further, self.arcs[0], self.arcs[-1])
            across = np.clip(across + aside_by, -self.width, self.width)
            lines = self._lines(arcs)
            missed = plan.T - self._powers(lines, across)
            if np.max(np.abs(missed), initial=0.0) < INVERSE_ACCURACY:
                break
            along, aside = self._powers(self._lines(arcs, 1), across), self._powers(lines, across, 1)
        return arcs, across

    def polygon(
        self, start: tuple[float, float] | None = None, end: tuple[float, float] | None = None
    ) -> shapely.Polygon:
        """Return the outline in plan of the strip, or of what lies between two lines (c, m): s = c + m v."""
        half = self.width / 2.0
        if start is None or end is None:
            return shapely.Polygon(np.vstack([self.left[-1, :, :2], self.right[-1, ::-1, :2]]))
        step = self.arcs[1] - self.arcs[0]
        across = np.linspace(-half, half, 2 * LATERAL_STEPS + 1)
        sides = []
        for v in (half, -half):
            begin, finish = start[0] + start[1] * v, end[0] + end[1] * v
            count = max(int(np.ceil(abs(finish - begin) / step)) + 1, 2)
            sides.append(np.column_stack([np.linspace(begin, finish, count), np.full(count, v)]))
        last = np.column_stack([end[0] + end[1] * across, across])[::-1]
        first = np.column_stack([start[0] + start[1] * across, across])
        ring = np.vstack([sides[0], last, sides[1][::-1], first])
        return shapely.Polygon(self.plan(np.clip(ring[:, 0], self.arcs[0], self.arcs[-1]), ring[:, 1]))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.states[:, :2])

    @cached_property
    def _centre(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.arcs, self.states[:, :2], self.states[:, 2:])

    @cached_property
    def _spline(self) -> CubicSpline:
        """Spline over arc length of the coefficients (k, 2) of the lateral lines' polynomials in v / (w / 2)."""
        grid = np.concatenate([self.right[:0:-1, :, :2], self.left[:, :, :2]])
        nodes = np.linspace(-1.0, 1.0, len(grid))
        coefficients = np.einsum("ij,jnc->nic", np.linalg.inv(np.vander(nodes, increasing=True)), grid)
        return CubicSpline(self.arcs, coefficients)

    def _lines(self, arcs: Floats, order: int = 0) -> Floats:
        """Return the coefficients (k, 2, m) of the lateral lines at arc lengths (m,), or their derivatives."""
        lines = self._spline(arcs, order)
        # Arithmetic runs along the points.
        return np.ascontiguousarray(np.moveaxis(lines, 0, 2))

    def _powers(self, lines: Floats, across: Floats, order: int = 0) -> Floats:
        """Return the plan points (2, m) of lateral lines (k, 2, m) at (m,), or their derivatives by it."""
        half = self.width / 2.0
        share, factors = across / half, lines
        if order:
            factors = lines[1:] * np.arange(1.0, len(lines))[:, None, None] / half
        plan: Floats = factors[-1].copy()
        for factor in factors[-2::-1]:
            plan *= share
            plan += factor
        return plan


def strip_through(field: HeightField, state: Floats, reach: Reach, width: float, step: float) -> Strip:
    """Return the strip on the geodesic with a state (4,), traced both ways until its centre line leaves the reach.

    Args:
        field: the surface.
        state: plan position and plan velocity, where the arc length is 0.
        reach: where it is traced.
        width: of the tape, metres.
        step: between samples, metres.

    Raises:
        NoNaturalPaths: it does not leave the reach.
    """
    turned = np.concatenate([state[:2], -state[2:]])
    back, ahead = _traced(field, turned, reach, step), _traced(field, state, reach, step)
    back[:, 2:] *= -1.0
    states = np.vstack([back[::-1], state, ahead])
    arcs = step * np.arange(-len(back), len(states) - len(back), dtype=np.float64)
    return Strip(field, arcs, states, width)


def _traced(field: HeightField, state: Floats, reach: Reach, step: float) -> Floats:
    """Return the states (n, 4) after a state (4,), to the first one outside the reach; at least one."""
    parts, longest = [state[None]], LONGEST * float(np.hypot(*(reach.upper - reach.lower))) / step
    count = 0
    while True:
        last = parts[-1][-1]
        inside = bool(reach.holds(last[None, :2])[0])
        if not inside and count:
            return np.vstack(parts)[1:]
        if count > longest:
            raise NoNaturalPaths("a course does not leave the ply", last[:2].tolist())
        steps = int(np.ceil(reach.ahead(last[:2], last[2:]) / step)) if inside else 0
        states = _further(field, last, step, min(max(steps, LEAST_STEPS), MOST_STEPS))
        outside = np.flatnonzero(~reach.holds(states[1:, :2]))
        parts.append(states[1 : outside[0] + 2] if len(outside) else states[1:])
        count += len(parts[-1])


def _further(field: HeightField, state: Floats, step: float, count: int) -> Floats:
    """Return the states (m + 1, 4) from a state (4,) on: as many steps as told, or fewer where the surface ends."""
    while True:
        try:
            return trace(field, state, step * np.arange(count + 1.0))
        except BeyondSurface:
            # A curve may leave the reach earlier than its tangent, and lead far out of it.
            if count <= LEAST_STEPS:
                raise
            count = max(count // 2, LEAST_STEPS)
