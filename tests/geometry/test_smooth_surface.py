"""Smooth surfaces through points: what they give back exactly, and how near they are to what they were fitted to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from threadpoolctl import threadpool_limits

from tapelayer.arrays import Floats
from tapelayer.errors import BeyondSurface
from tapelayer.geometry.smooth_surface import SmoothSurface
from tests.helpers.height_fields import Polynomial, Sphere, fitted, saddle, vertices

LOWER, UPPER = np.array([-0.5, -0.3]), np.array([0.6, 0.4])
factor = st.floats(-2, 2)


def scattered(count: int = 400, seed: int = 0, lower: Floats = LOWER, upper: Floats = UPPER) -> Floats:
    return np.random.default_rng(seed).uniform(lower, upper, (count, 2))


def waves(plan: Floats) -> Floats:
    """Points over the plane with waves of 20 mm."""
    x, y = plan.T
    return np.column_stack([plan, 0.02 * np.sin(9 * x) * np.cos(7 * y) + 0.1 * x * y])


@settings(max_examples=20, deadline=None)
@given(factor, factor, factor, factor, factor, factor, st.sampled_from([3, 5]))
def test_quadratics_are_given_back(a: float, b: float, c: float, d: float, e: float, f: float, degree: int) -> None:
    """They have no third derivatives, so nothing smooths them, far from the points neither."""
    quadratic = Polynomial([[a, b, c], [d, e, 0.0], [f, 0.0, 0.0]])
    plan = scattered(80, 3, LOWER / 2, UPPER / 2)
    surface = SmoothSurface.fit(quadratic.points(plan), LOWER, UPPER, 0.05, degree)
    everywhere = scattered(300, 4)
    assert np.max(np.abs(surface.derivatives(everywhere) - quadratic.derivatives(everywhere))) <= 1e-6
    assert np.max(np.abs(surface.residuals)) <= 1e-11


def basis(surface: SmoothSurface, axis: int, places: Floats, order: int) -> Floats:
    """Derivatives (n, m) of SciPy's basis with the knots of the surface along an axis."""
    degree, count = surface.degree, surface.coefficients.shape[axis]
    knots = surface.lower[axis] + surface.spacings[axis] * np.arange(-degree, count + 1)
    values: Floats = BSpline(knots, np.eye(count), degree)(places, order)
    return values


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_derivatives_are_those_of_scipy(degree: int) -> None:
    """SciPy's spline with the same knots and coefficients."""
    coefficients = np.random.default_rng(2).normal(size=(10 + degree, 7 + degree))
    surface = SmoothSurface(LOWER, np.array([0.11, 0.1]), coefficients, np.zeros(0), degree)
    plan = np.vstack([scattered(), LOWER, UPPER])
    for row, (along_x, along_y) in enumerate([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]):
        bases = basis(surface, 0, plan[:, 0], along_x), basis(surface, 1, plan[:, 1], along_y)
        known = np.einsum("ni,ij,nj->n", bases[0], coefficients, bases[1])
        assert np.allclose(surface.derivatives(plan)[row], known, rtol=1e-10, atol=1e-9)


def test_derivatives_are_differences() -> None:
    surface = SmoothSurface.fit(waves(scattered()), LOWER, UPPER, 0.04)
    plan, step = scattered(200, 5, LOWER + 0.01, UPPER - 0.01), 1e-4
    for axis, (first, second, both) in enumerate([(1, 3, 4), (2, 5, 4)]):
        shift = step * np.eye(2)[axis]
        ahead, back = surface.derivatives(plan + shift), surface.derivatives(plan - shift)
        slopes = (ahead - back) / (2 * step)
        here = surface.derivatives(plan)
        assert np.max(np.abs(slopes[0] - here[first])) <= 1e-6
        assert np.max(np.abs(slopes[1 + axis] - here[second])) <= 1e-4
        assert np.max(np.abs(slopes[2 - axis] - here[both])) <= 1e-4


@pytest.mark.parametrize(("degree", "count"), [(3, 300), (5, 300), (5, 40)])
def test_the_fit_is_least(degree: int, count: int) -> None:
    """It solves the least squares of the residuals, and of the third derivatives at Gauss' points of all cells."""
    points = waves(scattered(count))
    surface = SmoothSurface.fit(points, LOWER, UPPER, 0.1, degree)
    nodes, weights = np.polynomial.legendre.leggauss(degree + 1)
    places, roots = [], []
    for axis, cells in enumerate(np.array(surface.coefficients.shape) - degree):
        starts = surface.lower[axis] + surface.spacings[axis] * np.arange(cells)[:, None]
        places.append((starts + surface.spacings[axis] * (nodes + 1) / 2).ravel())
        roots.append(np.sqrt(np.tile(weights, cells) * surface.spacings[axis] / 2)[:, None])
    bases = [basis(surface, axis, points[:, axis], 0) for axis in (0, 1)]
    rows = [np.einsum("ni,nj->nij", *bases).reshape(count, -1)]
    for order, times in enumerate((1, 3, 3, 1)):
        bends = [roots[axis] * basis(surface, axis, places[axis], (order, 3 - order)[axis]) for axis in (0, 1)]
        rows.append(1e-6 * np.sqrt(times) * np.kron(*bends))
    heights = np.concatenate([points[:, 2], np.zeros(sum(map(len, rows[1:])))])
    known = np.linalg.lstsq(np.concatenate(rows), heights, rcond=1e-15)[0]
    assert np.max(np.abs(surface.coefficients.ravel() - known)) <= 1e-5
    assert np.max(np.abs(surface.residuals - (rows[0] @ known - points[:, 2]))) <= 1e-9


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_axes_may_be_swapped(seed: int) -> None:
    points = waves(scattered(200, seed))
    one = SmoothSurface.fit(points, LOWER, UPPER, 0.06)
    other = SmoothSurface.fit(points[:, [1, 0, 2]], LOWER[::-1], UPPER[::-1], 0.06)
    plan = scattered(100, seed + 1)
    assert one.coefficients.shape == other.coefficients.shape[::-1]
    assert np.allclose(
        one.derivatives(plan), other.derivatives(plan[:, ::-1])[[0, 2, 1, 5, 4, 3]], rtol=1e-8, atol=1e-6
    )
    assert np.allclose(one.residuals, other.residuals, atol=1e-9)


def test_residuals_are_heights_over_the_points() -> None:
    points = waves(scattered()) + [0.0, 0.0, 0.3]
    surface = SmoothSurface.fit(points, LOWER, UPPER, 0.1)
    assert np.max(np.abs(surface.residuals)) > 1e-7
    assert np.allclose(surface.residuals, surface.points(points[:, :2])[:, 2] - points[:, 2], atol=1e-14)


def test_a_fine_mesh_is_given_back() -> None:
    """Edges of 25 mm: 0.1 um, and normals and curvature of a sphere."""
    sphere, surface = Sphere(), fitted(Sphere())
    plan = scattered(500, 8, np.full(2, -0.75), np.full(2, 0.75))
    assert np.max(np.abs(surface.points(plan) - sphere.points(plan))) <= 1e-7
    assert np.max(np.abs(surface.normals(plan) - sphere.normals(plan))) <= 1e-5
    assert np.allclose(surface.curvatures(plan), 0.04, atol=2e-3)
    assert np.allclose(sphere.curvatures(plan), 0.04, atol=1e-12)


def test_points_may_be_far_apart() -> None:
    """Facets of 550 mm on knots of 20 mm: the smoothing fills in."""
    torus = Sphere(8.0)
    side = np.arange(-3, 4) * 0.55
    plan = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    reach = np.full(2, 1.8)
    surface = SmoothSurface.fit(torus.points(plan), -reach, reach, 0.05)
    between = scattered(400, 9, -reach + 0.2, reach - 0.2)
    assert np.max(np.abs(surface.residuals)) <= 1e-9
    assert np.max(np.abs(surface.points(between) - torus.points(between))) <= 1e-3


def test_the_domain_ends() -> None:
    surface = SmoothSurface.fit(waves(scattered()), LOWER, UPPER, 0.1)
    assert np.allclose(surface.upper, UPPER, atol=1e-15)
    surface.derivatives(np.array([LOWER, UPPER]))
    for place in ([-0.501, 0.0], [0.0, 0.4001], [np.nan, 0.0], [0.0, np.inf]):
        with pytest.raises(BeyondSurface) as refused:
            surface.derivatives(np.array([[0.0, 0.0], place]))
        assert np.array_equal(refused.value.place, place, equal_nan=True)
    with pytest.raises(
        BeyondSurface, match=r"x -501.0 mm, y 0.0 mm .* from x -500.0 to 600.0 mm and y -300.0 to 400.0 mm"
    ):
        surface.normals(np.array([[-0.501, 0.0]]))
    with pytest.raises(BeyondSurface):
        SmoothSurface.fit(waves(scattered()), LOWER, UPPER - 0.1, 0.1)


def test_a_surface_stays_as_it_is() -> None:
    surface = SmoothSurface.fit(vertices(saddle(), 0.1), np.full(2, -0.9), np.full(2, 0.9), 0.1)
    with pytest.raises(ValueError, match="read-only"):
        surface.coefficients[0, 0] = 1.0


def test_points_on_a_line_make_no_surface() -> None:
    places = np.linspace(-0.2, 0.3, 50)
    with pytest.raises(np.linalg.LinAlgError):
        SmoothSurface.fit(np.column_stack([places, 0.5 * places, places**2]), LOWER, UPPER, 0.05)


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_threads_of_the_linear_algebra_change_no_bit(threads: int) -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.4, 57)))
    points = np.column_stack([x, y, 0.1 * np.sin(3.0 * x) * np.cos(2.0 * y)])
    made = []
    for limit in (1, threads):
        with threadpool_limits(limit, user_api="blas"):
            made.append(SmoothSurface.fit(points, np.zeros(2), np.array([1.0, 1.4]), 0.02))
    assert made[0].coefficients.tobytes() == made[1].coefficients.tobytes()
