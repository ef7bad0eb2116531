"""Geodesics: the straightest paths on a height field, those that leave them at right angles, and how neighbours part.

A state is a row x, y, x', y': a point of the field's plane in metres and its velocity per metre of arc length on the
surface. Geodesics are x'' = -f_x k, y'' = -f_y k with k = (f_xx x'^2 + 2 f_xy x' y' + f_yy y'^2) / (1 + f_x^2 + f_y^2).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.errors import BeyondSurface, PathNotFound
from tapelayer.geometry.height_field import HeightField, gauss_curvatures
from tapelayer.vectors import unit

# Samples that a step of the integration looks at: the rule is exact for polynomials of one degree less.
NODES = 6
# A curve is found when a round moves no sample by more than this, metres.
SETTLED = 1e-11
MOST_ROUNDS = 40
# A round that moves a sample by more than this leads nowhere, metres.
LOST = 1e3
# A curve that is not found is traced in pieces, but in none shorter than this, metres.
SHORTEST = 1e-3
# Steps that differ by no more than this share of them are even: it is what rounding leaves of arc lengths.
EVEN = 1e-10


def aimed(field: HeightField, plan: Floats, directions: Floats) -> Floats:
    """Return the states (n, 4) at points (n, 2) of the plane in metres, aimed along directions (n, 2) of the plane.

    Raises:
        BeyondSurface: a point lies outside the field's domain.
    """
    _, slope_x, slope_y, *_ = field.derivatives(plan)
    rise = slope_x * directions[:, 0] + slope_y * directions[:, 1]
    speeds = np.sqrt(directions[:, 0] ** 2 + directions[:, 1] ** 2 + rise**2)
    return np.column_stack([plan, directions / speeds[:, None]])


def tangents(field: HeightField, states: Floats) -> Floats:
    """Return the unit tangents (n, 3) of states (n, 4) in space.

    Raises:
        BeyondSurface: a state lies outside the field's domain.
    """
    _, slope_x, slope_y, *_ = field.derivatives(states[:, :2])
    return np.column_stack([states[:, 2:], slope_x * states[:, 2] + slope_y * states[:, 3]])


def turned(field: HeightField, states: Floats, angle: float | Floats) -> Floats:
    """Return states (n, 4) turned about the normal by an angle, or by (n,), in radians, positive to the left.

    Raises:
        BeyondSurface: a state lies outside the field's domain.
    """
    _, slope_x, slope_y, *_ = field.derivatives(states[:, :2])
    ahead = unit(np.column_stack([states[:, 2:], slope_x * states[:, 2] + slope_y * states[:, 3]]))
    left = np.cross(unit(np.column_stack([-slope_x, -slope_y, np.ones_like(slope_x)])), ahead)
    angles = np.broadcast_to(angle, len(states))[:, None]
    return np.column_stack([states[:, :2], (np.cos(angles) * ahead + np.sin(angles) * left)[:, :2]])


def trace(field: HeightField, state: Floats, arcs: Floats) -> Floats:
    """Return the states (n, 4) of the geodesic through a state (4,) at arc lengths (n,) from it, metres.

    All samples are moved at once until they agree (Picard's rounds). The error depends on the steps between the arcs,
    see `trace_within`.

    Args:
        field: the surface.
        state: where arc length is 0.
        arcs: rising; one of them is 0.

    Raises:
        BeyondSurface: the geodesic leaves the field's domain.
        PathNotFound: the rounds do not settle, even on the shortest pieces.
        ValueError: the arcs do not rise, or none is 0.
    """
    at = int(np.searchsorted(arcs, 0.0))
    if at == len(arcs) or arcs[at] != 0.0 or np.any(np.diff(arcs) <= 0):
        raise ValueError("arc lengths must rise, and hold 0")
    return _traced(field, state, arcs, at)


def trace_within(field: HeightField, state: Floats, arcs: Floats, tolerance: float = 1e-5) -> tuple[Floats, float]:
    """Return the states (n, 4) as `trace` does, with steps halved until that moves none by more than the tolerance.

    Args:
        field: the surface.
        state: where arc length is 0.
        arcs: rising; one of them is 0.
        tolerance: metres in space.

    Returns:
        The states with the finest steps, and by how much the last halving moved them, metres.

    Raises:
        BeyondSurface: the geodesic leaves the field's domain.
        PathNotFound: 8 halvings do not suffice.
        ValueError: the arcs do not rise, or none is 0.
    """
    coarse, every = trace(field, state, arcs), 1
    for _ in range(8):
        arcs, every = halved(arcs), 2 * every
        states = trace(field, state, arcs)[::every]
        moved = float(np.max(np.linalg.norm(field.points(states[:, :2]) - field.points(coarse[:, :2]), axis=1)))
        if moved <= tolerance:
            return states, moved
        coarse = states
    raise PathNotFound(state[:2].tolist())


def halved(arcs: Floats) -> Floats:
    """Return rising arc lengths (2 n - 1,) with one more in the middle of each step.

    Examples:
        >>> halved(np.array([-1.0, 0.0, 0.5])).tolist()
        [-1.0, -0.5, 0.0, 0.25, 0.5]
    """
    finer = np.empty(2 * len(arcs) - 1)
    finer[::2], finer[1::2] = arcs, (arcs[:-1] + arcs[1:]) / 2
    return finer


def lateral(field: HeightField, states: Floats, reach: float, steps: int = 4) -> Floats:
    """Return the geodesics that leave states (n, 4) at right angles, at equal steps of their arc length |v|.

    Args:
        field: the surface.
        states: of a geodesic, whose tape has its edges at the ends of these.
        reach: length of them in metres, positive to the left, negative to the right.
        steps: equal steps to the end, by Runge and Kutta's rule of order 4.

    Returns:
        (steps + 1, n, 6): x, y, x', y' outward, G and G' by |v|. G is the length along v over the length along the
        tape's centre: G'' = -K G, with 1 and 0 at the centre.

    Raises:
        BeyondSurface: one leaves the field's domain.
    """
    out = np.empty((steps + 1, len(states), 6))
    out[0, :, :4] = turned(field, states, math.copysign(math.pi / 2, reach))
    out[0, :, 4:] = 1.0, 0.0
    step = abs(reach) / steps
    for i in range(steps):
        w = out[i]
        first = _rates(field, w)
        second = _rates(field, w + step / 2 * first)
        third = _rates(field, w + step / 2 * second)
        fourth = _rates(field, w + step * third)
        out[i + 1] = w + step / 6 * (first + 2 * (second + third) + fourth)
    return out


def jacobi(curvatures: Floats, arcs: Floats, at: int) -> Floats:
    """Return the Jacobi fields C and D (2, n) along a geodesic: how far neighbours are, per metre and per radian.

    Both solve j'' = -K j. At sample `at`, C is 1 and level (a neighbour that starts beside), D is 0 and rises by 1 per
    metre (a neighbour that starts at an angle).

    Args:
        curvatures: (n,) Gauss curvatures K on the geodesic, 1/m2.
        arcs: (n,) rising arc lengths, metres.
        at: sample that they start from.

    Examples:
        >>> beside, aslant = jacobi(np.ones(5), np.linspace(0.0, 0.4, 5), 2)
        >>> np.round(beside, 6).tolist(), np.round(aslant, 6).tolist()
        ([0.980067, 0.995004, 1.0, 0.995004, 0.980067], [-0.198669, -0.099833, 0.0, 0.099833, 0.198669])
    """
    fields: Floats = jacobi_with_slopes(curvatures, arcs, at)[:, 0].T
    return fields


def jacobi_with_slopes(curvatures: Floats, arcs: Floats, at: int) -> Floats:
    """Return matrices (n, 2, 2) with the rows (C, D) and (C', D'), of the arguments and the start of `jacobi`.

    Each step's matrix is the exponential of Magnus' series of order 4, whose determinant is 1 as that of the fields.
    """
    step = np.diff(arcs)
    columns, once, twice = _weights(arcs)
    near = curvatures[columns]
    total = np.einsum("ij,ij->i", once, near)
    skew = step * total / 2 - np.einsum("ij,ij->i", twice, near)
    # Minus the square of the exponent's eigenvalues: turning if positive, stretching if negative.
    square = step * total - skew**2
    root = np.sqrt(np.abs(square))
    level = np.where(square >= 0, np.cos(root), np.cosh(root))
    safe = np.where(root > 1e-4, root, 1.0)
    share = np.where(root > 1e-4, np.where(square >= 0, np.sin(safe), np.sinh(safe)) / safe, 1.0 - square / 6)
    over = np.empty((len(step), 2, 2))
    over[:, 0, 0], over[:, 0, 1] = level + share * skew, share * step
    over[:, 1, 0], over[:, 1, 1] = -share * total, level - share * skew
    back = over[:, ::-1, ::-1].transpose(0, 2, 1) * [[1.0, -1.0], [-1.0, 1.0]]
    return np.concatenate([_products(back[:at][::-1])[::-1], np.eye(2)[None], _products(over[at:])])


def _products(matrices: Floats) -> Floats:
    """Return the products (n, 2, 2) of each of (n, 2, 2) matrices with all before it, the last on the left."""
    products, reach = matrices.copy(), 1
    while reach < len(products):
        products[reach:] = products[reach:] @ products[:-reach]
        reach *= 2
    return products


def _rates(field: HeightField, laterals: Floats) -> Floats:
    """Return the rates (n, 6) of x, y, x', y', G and G' by arc length."""
    derivatives = field.derivatives(laterals[:, :2])
    rates = np.empty_like(laterals)
    rates[:, :2] = laterals[:, 2:4]
    rates[:, 2:4] = _accelerations(derivatives, laterals[:, 2:4])
    rates[:, 4] = laterals[:, 5]
    rates[:, 5] = -gauss_curvatures(derivatives) * laterals[:, 4]
    return rates


def _accelerations(derivatives: Floats, velocities: Floats) -> Floats:
    """Return x'', y'' (n, 2) of geodesics with velocities (n, 2), where the surface has derivatives (6, n)."""
    _, slope_x, slope_y, bend_x, twist, bend_y = derivatives
    u, v = velocities.T
    pull = (bend_x * u * u + 2 * twist * u * v + bend_y * v * v) / (1 + slope_x**2 + slope_y**2)
    return np.column_stack([-slope_x * pull, -slope_y * pull])


def _traced(field: HeightField, state: Floats, arcs: Floats, at: int) -> Floats:
    """Return the states (n, 4) at arcs (n,) whose sample `at` is the state (4,); in pieces where they do not settle."""
    if len(arcs) == 1:
        return state[None]
    if len(arcs) < NODES:
        return _traced(field, state, halved(arcs), 2 * at)[::2]
    short = arcs[-1] - arcs[0] <= SHORTEST
    try:
        states = _settled(field, state, arcs, at)
    except BeyondSurface:
        # A round may lead out of the domain though the curve stays in it.
        if short:
            raise
        states = None
    if states is not None:
        return states
    if short:
        raise PathNotFound(state[:2].tolist())
    first, last = at - at // 2, at + (len(arcs) - 1 - at) // 2
    middle = _traced(field, state, arcs[first : last + 1], at - first)
    before = _traced(field, middle[0], arcs[: first + 1] - arcs[first], first)
    after = _traced(field, middle[-1], arcs[last:] - arcs[last], 0)
    return np.concatenate([before[:-1], middle, after[1:]])


def _settled(field: HeightField, state: Floats, arcs: Floats, at: int) -> Floats | None:
    """Return the same as `_traced` in one piece, or None where the rounds do not settle."""
    columns, once, twice = _weights(arcs)
    step = np.diff(arcs)[:, None]
    plan, velocities = state[:2] + np.outer(arcs - arcs[at], state[2:]), np.tile(state[2:], (len(arcs), 1))
    for _ in range(MOST_ROUNDS):
        near = _accelerations(field.derivatives(plan), velocities)[columns]
        velocities = _summed(np.einsum("ij,ijk->ik", once, near), state[2:], at)
        moved = _summed(step * velocities[:-1] + np.einsum("ij,ijk->ik", twice, near), state[:2], at)
        change = np.max(np.abs(moved - plan))
        plan = moved
        if change <= SETTLED:
            return np.column_stack([plan, velocities])
        if not change <= LOST:
            break
    return None


def _summed(increments: Floats, value: Floats, at: int) -> Floats:
    """Return the running sums (n + 1, k) of increments (n, k) that have the value (k,) at one sample."""
    sums = np.zeros((len(increments) + 1, increments.shape[1]))
    np.cumsum(increments, axis=0, out=sums[1:])
    # In this order, the value itself comes back exactly.
    sums -= sums[at].copy()
    sums += value
    return sums


def _weights(arcs: Floats) -> tuple[Ints, Floats, Floats]:
    """Return a rule of integration over each of the n steps between arcs (n + 1,), for values at the arcs.

    Returns:
        The samples (n, m) that each step looks at, and the weights (n, m) of its integral, metres, and of what a motion
        gains in the step that starts at rest and has the values as its acceleration, metres squared.
    """
    count = min(NODES, len(arcs))
    steps = np.arange(len(arcs) - 1)
    firsts = np.clip(steps - (count - 2) // 2, 0, len(arcs) - count)
    columns, lengths = firsts[:, None] + np.arange(count), np.diff(arcs)
    mean = (arcs[-1] - arcs[0]) / len(steps)
    if np.all(np.abs(lengths - mean) <= EVEN * mean):
        single, double = _even_rule(count)
        return columns, (mean * single)[steps - firsts], (mean**2 * double)[steps - firsts]
    single, double = _rule(arcs[columns], steps - firsts)
    return columns, single, double


@cache
def _even_rule(count: int) -> tuple[Floats, Floats]:
    """Return the weights (count - 1, count) of `_rule` for each step between so many nodes, 1 apart."""
    return _rule(np.tile(np.arange(float(count)), (count - 1, 1)), np.arange(count - 1))


def _rule(nodes: Floats, steps: Ints) -> tuple[Floats, Floats]:
    """Return the weights (n, m) of both integrals of `_weights` for nodes (n, m) and the number of each step (n,)."""
    rows, powers = np.arange(len(nodes)), np.arange(nodes.shape[1])
    begins = nodes[rows, steps]
    spans = nodes[:, -1:] - nodes[:, :1]
    # Exact for the powers of arc length from the step's start, in units of the span.
    ends = (nodes[rows, steps + 1] - begins)[:, None] / spans
    single = ends ** (powers + 1) / (powers + 1)
    double = ends ** (powers + 2) / ((powers + 1) * (powers + 2))
    table = ((nodes - begins[:, None]) / spans)[:, None, :] ** powers[:, None]
    weights = np.linalg.solve(table, np.stack([single, double], axis=2))
    return weights[:, :, 0] * spans, weights[:, :, 1] * spans**2
