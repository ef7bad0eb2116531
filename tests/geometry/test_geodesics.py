"""Geodesics, laterals and Jacobi fields on surfaces whose geodesics are known."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tapelayer.arrays import Floats
from tapelayer.errors import BeyondSurface, PathNotFound
from tapelayer.geometry.geodesics import (
    aimed,
    jacobi,
    jacobi_with_slopes,
    lateral,
    tangents,
    trace,
    trace_within,
    turned,
)
from tapelayer.geometry.height_field import HeightField
from tapelayer.geometry.smooth_surface import SmoothSurface
from tapelayer.vectors import norms
from tests.helpers.height_fields import Cone, Cylinder, Polynomial, Sphere, Torus, fitted, plane, saddle

ARCS = np.arange(241) * 0.005
SEED, HEADING = np.array([[-0.4, -0.55]]), np.array([[math.sin(math.radians(33)), math.cos(math.radians(33))]])
FIELDS: dict[str, HeightField] = {
    "plane": plane(0.3, -0.2),
    "cylinder": Cylinder(),
    "cone": Cone(),
    "sphere": Sphere(),
    "torus": Torus(),
    "saddle": saddle(),
}
NAMES = sorted(FIELDS)


def start(field: HeightField, seed: Floats = SEED, heading: Floats = HEADING) -> Floats:
    return aimed(field, seed, heading)[0]


def path(field: HeightField, states: Floats) -> Floats:
    return field.points(states[:, :2])


def exact(name: str, arcs: Floats) -> Floats:
    """Points (n, 3) of the geodesic from SEED along HEADING: a line, helix, unrolled line or great circle."""
    field = FIELDS[name]
    state = start(field)[None]
    point, tangent = path(field, state)[0], tangents(field, state)[0]
    s = arcs[:, None]
    if isinstance(field, Sphere):
        centre, turns = np.array([0.0, 0.0, -field.radius]), s / field.radius
        return centre + np.cos(turns) * (point - centre) + field.radius * np.sin(turns) * tangent
    if isinstance(field, Cylinder):
        angle = math.asin(point[0] / field.radius)
        around = math.cos(angle) * tangent[0] - math.sin(angle) * tangent[2]
        angles = angle + arcs * around / field.radius
        x, z = field.radius * np.sin(angles), field.radius * (np.cos(angles) - 1)
        return np.column_stack([x, point[1] + arcs * tangent[1], z])
    if isinstance(field, Cone):
        sine, cosine = math.sin(field.half_angle), math.cos(field.half_angle)
        apex = np.array([0.0, -field.radius * cosine / sine, -field.radius])
        rod = point - apex
        reach, angle = np.linalg.norm(rod), math.atan2(rod[0], rod[2])
        around = np.array([math.cos(angle), 0.0, -math.sin(angle)])
        unrolled = np.column_stack([reach + arcs * (tangent @ rod) / reach, arcs * (tangent @ around)])
        radii, angles = norms(unrolled), angle + np.arctan2(unrolled[:, 1], unrolled[:, 0]) / sine
        return apex + radii[:, None] * np.column_stack(
            [sine * np.sin(angles), 0 * radii + cosine, sine * np.cos(angles)]
        )
    assert name == "plane"
    return point + s * tangent


def stepped(name: str, arcs: Floats) -> Floats:
    """Points (n, 3) of the same geodesic by Dormand and Prince's rule of order 8, for the equation written out anew."""
    field = FIELDS[name]

    def rates(_: float, w: Floats) -> Floats:
        _, p, q, r, s, t = field.derivatives(w[None, :2])[:, 0]
        bend = (r * w[2] ** 2 + 2 * s * w[2] * w[3] + t * w[3] ** 2) / (1 + p * p + q * q)
        return np.array([w[2], w[3], -p * bend, -q * bend])

    done = solve_ivp(rates, (0, arcs[-1]), start(field), "DOP853", arcs, rtol=1e-12, atol=1e-13)
    return path(field, done.y.T)


REFERENCES = {**{name: exact for name in ("plane", "cylinder", "cone", "sphere")}, "torus": stepped, "saddle": stepped}


@cache
def mould(name: str) -> SmoothSurface:
    return fitted(FIELDS[name])


@pytest.mark.parametrize("name", NAMES)
def test_a_geodesic_is_the_known_one(name: str) -> None:
    off = path(FIELDS[name], trace(FIELDS[name], start(FIELDS[name]), ARCS)) - REFERENCES[name](name, ARCS)
    assert np.max(norms(off)) <= 1e-11


@pytest.mark.parametrize("name", ["cylinder", "cone", "sphere"])
def test_the_references_agree(name: str) -> None:
    assert np.max(norms(exact(name, ARCS) - stepped(name, ARCS))) <= 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_a_geodesic_on_a_fitted_mesh_is_the_known_one(name: str) -> None:
    """Edges of 25 mm, coordinates of 32 bits: 5 um over 1.2 m."""
    surface = mould(name)
    states = trace(surface, start(surface), ARCS)
    assert np.max(norms(path(surface, states) - REFERENCES[name](name, ARCS))) <= 5e-6
    tilt = norms(surface.normals(states[:, :2]) - FIELDS[name].normals(states[:, :2]))
    assert math.degrees(np.max(tilt)) <= 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_there_and_back(name: str) -> None:
    field = FIELDS[name]
    there = trace(field, start(field), ARCS)
    back = trace(field, there[-1] * [1, 1, -1, -1], ARCS)[::-1] * [1, 1, -1, -1]
    assert np.max(np.abs(there - back)) <= 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_both_ways_at_once(name: str) -> None:
    """A curve is the same from any of its points."""
    field = FIELDS[name]
    whole = trace(field, start(field), ARCS)
    again = trace(field, whole[100], ARCS - ARCS[100])
    assert np.max(np.abs(whole - again)) <= 1e-11
    uneven = np.sort(np.append(ARCS[::3], [0.1234, 1.1999]))
    assert np.max(np.abs(trace(field, start(field), uneven)[uneven.searchsorted(ARCS[::3])] - whole[::3])) <= 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_speed_is_one(name: str) -> None:
    surface = mould(name)
    states = trace(surface, start(surface), ARCS)
    assert np.max(np.abs(norms(tangents(surface, states)) - 1)) <= 1e-9


@pytest.mark.parametrize("name", ["cone", "torus", "cylinder", "sphere"])
def test_clairaut(name: str) -> None:
    """The distance from the axis, times the sine of the angle with the meridian, stays."""
    field = FIELDS[name]
    states = trace(field, start(field), ARCS)
    points, ahead = path(field, states), tangents(field, states)
    moment = np.cross(points + [0.0, 0.0, field.depth], ahead)[:, 1]
    assert np.ptp(moment) <= 1e-12
    assert abs(moment[0]) > 0.1


@given(st.floats(-3, 3), st.floats(-math.pi, math.pi))
def test_a_turn_keeps_speed_and_turns_by_the_angle(angle: float, heading: float) -> None:
    field = FIELDS["cone"]
    state = aimed(field, SEED, np.array([[math.cos(heading), math.sin(heading)]]))
    before, after = tangents(field, state)[0], tangents(field, turned(field, state, angle))[0]
    normal = field.normals(SEED)[0]
    assert np.linalg.norm(after) == pytest.approx(1, abs=1e-12)
    assert before @ after == pytest.approx(math.cos(angle), abs=1e-12)
    assert np.cross(before, after) @ normal == pytest.approx(math.sin(angle), abs=1e-12)


def test_left_is_left() -> None:
    """Along x, left is y."""
    states = aimed(plane(), np.zeros((1, 2)), np.array([[1.0, 0.0]]))
    assert np.allclose(lateral(plane(), states, 0.1)[-1], [[0, 0.1, 0, 1, 1, 0]], atol=1e-15)
    assert np.allclose(lateral(plane(), states, -0.1)[-1], [[0, -0.1, 0, -1, 1, 0]], atol=1e-15)


@pytest.mark.parametrize("side", [1, -1])
def test_edges_of_a_tape_on_a_sphere(side: int) -> None:
    """G is cos(v / R), and an edge is the parallel circle."""
    field = Sphere(0.5)
    states = trace(field, start(field, np.array([[0.1, 0.05]])), ARCS[:60] / 2)
    grid = lateral(field, states, side * 0.0375)
    v = np.linspace(0, 0.0375, 5)[:, None]
    assert np.max(np.abs(grid[..., 4] - np.cos(v / 0.5))) <= 1e-9
    assert np.max(np.abs(grid[..., 5] + np.sin(v / 0.5) / 0.5)) <= 1e-8
    centre, ahead = path(field, states) + [0, 0, 0.5], tangents(field, states)
    pole = np.cross(centre, ahead) / 0.5
    for i in range(5):
        height = np.sum((path(field, grid[i]) + [0, 0, 0.5]) * pole, axis=1)
        assert np.max(np.abs(height - side * 0.5 * math.sin(v[i, 0] / 0.5))) <= 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_stretch_of_an_edge_is_the_spread_of_the_laterals(name: str) -> None:
    """G of the equation against the distance of neighbouring laterals' ends."""
    field = FIELDS[name]
    grid = lateral(field, trace(field, start(field), ARCS[:41]), 0.15, 8)
    ends = np.stack([path(field, row) for row in grid])
    spread = norms(ends[-1, 2:] - ends[-1, :-2]) / 0.01
    assert np.max(np.abs(spread - grid[-1, 1:-1, 4])) <= 1e-5


@pytest.mark.parametrize("curvature", [4.0, -4.0, 0.0, 1e-6])
def test_jacobi_fields_of_even_curvature(curvature: float) -> None:
    arcs, at = ARCS, 80
    s = arcs - arcs[at]
    root = np.sqrt(complex(curvature))
    known = [np.cos(root * s).real, (np.sin(root * s) / root).real if curvature else s]
    assert np.max(np.abs(jacobi(np.full(241, curvature), arcs, at) - known)) <= 1e-11


@given(st.lists(st.floats(-30, 30), min_size=2, max_size=60), st.data())
def test_jacobi_fields_keep_their_area(curvatures: list[float], data: st.DataObject) -> None:
    """C D' - C' D = 1."""
    at = data.draw(st.integers(0, len(curvatures) - 1))
    matrices = jacobi_with_slopes(np.array(curvatures), np.arange(len(curvatures)) * 0.01, at)
    size = np.max(np.abs(matrices), axis=(1, 2)) ** 2
    assert np.all(np.abs(np.linalg.det(matrices) - 1) <= 1e-13 * size)
    assert np.array_equal(matrices[at], np.eye(2))


@pytest.mark.parametrize("name", NAMES)
def test_jacobi_fields_are_the_spread_of_neighbours(name: str) -> None:
    """A neighbour turned by a small angle, and one that starts beside it, leave as D and C say."""
    field = FIELDS[name]
    state, small = start(field), 1e-4
    states = trace(field, state, ARCS)
    beside, aslant = jacobi(field.curvatures(states[:, :2]), ARCS, 0)
    left = turned(field, states, math.pi / 2)
    ways = []
    for sign in (1, -1):
        ways.append(trace(field, turned(field, state[None], sign * small)[0], ARCS))
    offset = np.sum((path(field, ways[0]) - path(field, ways[1])) * tangents(field, left), axis=1) / (2 * small)
    assert np.max(np.abs(offset - aslant)) <= 1e-7
    ways = []
    for sign in (1, -1):
        across = trace(field, turned(field, state[None], sign * math.pi / 2)[0], np.linspace(0, small, 7))[-1:]
        ways.append(trace(field, turned(field, across, -sign * math.pi / 2)[0], ARCS))
    offset = np.sum((path(field, ways[0]) - path(field, ways[1])) * tangents(field, left), axis=1) / (2 * small)
    assert np.max(np.abs(offset - beside)) <= 1e-7


def angle_between(field: HeightField, one: Floats, other: Floats) -> float:
    first, second = tangents(field, np.stack([one, other]))
    return math.acos(np.clip(first @ second, -1, 1))


@pytest.mark.parametrize("name", NAMES)
def test_gauss_bonnet(name: str) -> None:
    """The angles of a quadrilateral of two courses and two laterals exceed a turn by the curvature inside it."""
    field, reach, last = FIELDS[name], 0.3, 160
    base = trace(field, start(field), ARCS[: last + 1])
    grid = lateral(field, base, reach, 24)
    ends = grid[-1, [0, last], :4]

    # The opposite course: the geodesic between the far ends of the laterals, found by Newton's rule on its heading.
    def opposite(heading: float, length: float) -> Floats:
        return trace(field, turned(field, ends[:1], heading)[0], np.linspace(0.0, length, last + 1))

    unknown = np.array([-math.pi / 2, ARCS[last]])
    for _ in range(8):
        at = opposite(*unknown)[-1, :2]
        slopes = np.column_stack([(opposite(*(unknown + 1e-6 * axis))[-1, :2] - at) / 1e-6 for axis in np.eye(2)])
        unknown = unknown + np.linalg.solve(slopes, ends[1, :2] - at)
    far = opposite(*unknown)
    assert np.max(np.abs(far[-1, :2] - ends[1, :2])) <= 1e-11
    inner = math.pi  # two right angles at the first course
    inner += angle_between(field, far[0], ends[0] * [1, 1, -1, -1])
    inner += angle_between(field, far[-1] * [1, 1, -1, -1], ends[1] * [1, 1, -1, -1])
    # The curvature inside, by Gauss' rule over the plan quadrilateral of the four sides (a Coons patch).
    nodes, weights = np.polynomial.legendre.leggauss(12)
    nodes, weights = (nodes + 1) / 2, weights / 2

    def interpolated(curve: Floats) -> Floats:
        k = np.arange(len(curve))
        fitting = np.polynomial.chebyshev.chebfit(2 * k / k[-1] - 1, curve, 12)
        return fitting

    sides = [interpolated(side) for side in (base[:, :2], far[:, :2], grid[:, 0, :2], grid[:, last, :2])]
    u, v = (side.ravel() for side in np.meshgrid(nodes, nodes, indexing="ij"))
    corners = [side[[0, -1]] for side in (base[:, :2], far[:, :2])]

    def patch(u: Floats, v: Floats) -> Floats:
        along = [np.polynomial.chebyshev.chebval(2 * u - 1, side).T for side in sides[:2]]
        across = [np.polynomial.chebyshev.chebval(2 * v - 1, side).T for side in sides[2:]]
        u, v = u[:, None], v[:, None]
        blend = (1 - v) * ((1 - u) * corners[0][0] + u * corners[0][1]) + v * (
            (1 - u) * corners[1][0] + u * corners[1][1]
        )
        return (1 - v) * along[0] + v * along[1] + (1 - u) * across[0] + u * across[1] - blend

    e = 1e-5
    du, dv = (patch(u + e, v) - patch(u - e, v)) / (2 * e), (patch(u, v + e) - patch(u, v - e)) / (2 * e)
    plan = patch(u, v)
    _, p, q, *_ = field.derivatives(plan)
    area = np.abs(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]) * np.sqrt(1 + p * p + q * q)
    inside = np.sum(np.outer(weights, weights).ravel() * area * field.curvatures(plan))
    assert inner - 2 * math.pi == pytest.approx(inside, abs=1e-7)
    if name in ("sphere", "torus", "saddle"):
        assert abs(inside) > 1e-3


def test_a_strongly_curved_path_is_traced_in_pieces() -> None:
    """Waves of 40 mm height on 0.4 m over 8 m: one piece of rounds does not settle."""

    class Waves(HeightField):
        def derivatives(self, plan: Floats) -> Floats:
            x, y = 15 * plan.T
            s, c = np.sin, np.cos
            h, k = 0.04, 15
            table = [s(x) * s(y), k * c(x) * s(y), k * s(x) * c(y), -k * k * s(x) * s(y), k * k * c(x) * c(y)]
            return h * np.array([*table, -k * k * s(x) * s(y)])

    field = Waves()
    arcs = np.arange(-800, 801) * 0.005
    state = start(field)
    states = trace(field, state, arcs)
    assert np.array_equal(states[800], state)
    assert np.max(np.abs(norms(tangents(field, states)) - 1)) <= 1e-3
    finer, moved = trace_within(field, state, arcs[600:1001], 1e-5)
    assert moved <= 1e-5 and finer.shape == (401, 4)


@pytest.mark.parametrize("name", NAMES)
def test_even_steps_are_integrated_as_uneven_ones_are(name: str) -> None:
    field, arcs = FIELDS[name], 0.01 * np.arange(-40.0, 61.0)
    uneven = arcs.copy()
    uneven[20] += 1e-6 * 0.01
    one, other = (trace(field, start(field), of) for of in (arcs, uneven))
    kept = np.arange(len(arcs)) != 20
    assert np.max(np.abs(one - other)[kept]) < 1e-12


@pytest.mark.parametrize("arcs", [[0.0], [0.0, 0.4], [-0.2, 0.0], [-0.3, -0.1, 0.0, 0.4]])
def test_few_samples(arcs: list[float]) -> None:
    field = FIELDS["sphere"]
    states = trace(field, start(field), np.array(arcs))
    assert np.max(norms(path(field, states) - exact("sphere", np.array(arcs)))) <= 1e-7


@pytest.mark.parametrize("arcs", [[], [0.1, 0.2], [-0.2, -0.1], [0.0, 0.0, 0.1], [0.1, 0.0]])
def test_arcs_that_are_none(arcs: list[float]) -> None:
    with pytest.raises(ValueError, match="must rise, and hold 0"):
        trace(plane(), np.array([0.0, 0.0, 1.0, 0.0]), np.array(arcs))


def test_a_path_off_the_surface_is_refused() -> None:
    surface = mould("sphere")
    with pytest.raises(BeyondSurface, match="a path leads to x .* off the surface from x -950.0 to 950.0 mm"):
        trace(surface, start(surface), np.arange(600) * 0.005)


def test_a_round_may_leave_the_surface_where_the_path_does_not() -> None:
    """The first guess is straight; the path up the side of a trough turns back."""
    trough = Polynomial([[0.0], [0.0], [1.0]])
    arcs = np.arange(601) * 0.005
    state = start(trough, np.zeros((1, 2)), np.array([[0.3, 1.0]]))
    known = trace(trough, state, arcs)
    fence = float(np.max(known[:, 0])) + 0.01

    class Fenced(Polynomial):
        def derivatives(self, plan: Floats) -> Floats:
            if np.any(plan[:, 0] > fence):
                raise BeyondSurface((fence, 0.0), (-9.0, -9.0), (fence, 9.0))
            return super().derivatives(plan)

    assert arcs[-1] * state[2] > fence + 0.1
    assert np.max(np.abs(trace(Fenced(trough.factors), state, arcs) - known)) <= 1e-9


def test_a_surface_too_rough_for_a_path_is_refused() -> None:
    class Rough(Polynomial):
        def derivatives(self, plan: Floats) -> Floats:
            noise = 1e9 * np.sin(1e12 * plan.sum(axis=1))
            return super().derivatives(plan) + np.array([0, 0, 0, 1, 1, 1])[:, None] * noise

    rough = Rough([[0.0, 0.1], [0.2, 0.0]])
    with pytest.raises(PathNotFound, match="too rough for a path from x 0.0 mm, y 0.0 mm"):
        trace(rough, np.array([0.0, 0.0, 1.0, 0.0]), ARCS)
    with pytest.raises(PathNotFound):
        trace_within(saddle(), start(saddle()), ARCS, 0.0)
