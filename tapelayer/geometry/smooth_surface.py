"""Smooth surfaces: a mould's vertices as one spline, a height over the plane of a ply."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import sparse
from scipy.linalg import solveh_banded
from threadpoolctl import threadpool_limits

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.errors import BeyondSurface
from tapelayer.geometry.height_field import HeightField

# Weight of the squared third derivatives' integral against the sum of squared residuals, metres to the fourth.
SMOOTHING = 1e-12
# Points that are evaluated at a time: what they need stays in the processor's cache.
BATCH = 2048

_Pair = tuple[sparse.csr_array, sparse.csr_array]


@dataclass(frozen=True, eq=False)
class SmoothSurface(HeightField, Frozen):
    """A tensor B-spline on uniform knots over a rectangle of the plane.

    Attributes:
        lower: least x and y (2,), metres.
        spacings: of the knots along x and y (2,), metres.
        coefficients: (m, n) metres, along x and y.
        residuals: (k,) height of the surface over each point that it was fitted to, metres.
        degree: of the polynomials between knots, along x and y each.
    """

    lower: Floats
    spacings: Floats
    coefficients: Floats
    residuals: Floats
    degree: int = 5

    @classmethod
    def fit(
        cls,
        points: Floats,
        lower: Floats,
        upper: Floats,
        spacing: float,
        degree: int = 5,
        weights: Floats | float = 1.0,
    ) -> Self:
        """Return the surface that is smoothest near points, least squares and least third derivatives together.

        The third derivatives leave every quadratic alone, and carry the surface on where there are no points.

        Args:
            points: (n, 3) metres; at least six, not all on one conic of the plane.
            lower: least x and y (2,) of the domain, metres.
            upper: greatest x and y (2,) of the domain, metres.
            spacing: greatest distance of knots, metres.
            degree: of the spline, at least 3.
            weights: (n,) of the points' squared residuals.

        Raises:
            BeyondSurface: a point lies outside the domain.
            numpy.linalg.LinAlgError: the points do not determine a surface.
        """
        cells = np.maximum(np.ceil((upper - lower) / spacing - 1e-9).astype(np.int64), 1)
        spacings = (upper - lower) / cells
        empty = cls(lower, spacings, np.zeros(cells + degree), np.zeros(0), degree)
        # The equations are narrowest with the shorter axis last.
        order = [0, 1] if cells[0] >= cells[1] else [1, 0]
        firsts, shares = empty._located(points[:, :2])
        every = np.broadcast_to(weights, len(points))
        equations = _Equations(firsts[order].T, shares[order].T, every, cells[order], spacings[order], degree)
        coefficients = equations.solved(points[:, 2])
        residuals = equations.design @ coefficients.ravel() - points[:, 2]
        return cls(lower, spacings, coefficients.transpose(order), residuals, degree)

    @property
    def upper(self) -> Floats:
        """Greatest x and y (2,) of the domain, metres."""
        upper: Floats = self.lower + self.spacings * (np.array(self.coefficients.shape) - self.degree)
        return upper

    def derivatives(self, plan: Floats) -> Floats:
        """Return f, f_x, f_y, f_xx, f_xy and f_yy (6, n) in metres and 1/m at (n, 2) points of the plane in metres.

        Raises:
            BeyondSurface: a point lies outside the domain.
        """
        derivatives = np.empty((6, len(plan)))
        for begin in range(0, len(plan), BATCH):
            rows = slice(begin, begin + BATCH)
            self._write_derivatives(plan[rows], derivatives[:, rows])
        derivatives *= self._units
        return derivatives

    def _write_derivatives(self, plan: Floats, table: Floats) -> None:
        """Write f, f_x, f_y, f_xx / 2, f_xy and f_yy / 2 (6, n) at points (n, 2), in units of the spacings."""
        (columns, rows), (x, y) = self._located(plan)
        powers, count = self._powers, self.degree + 1
        cells = columns * (self.coefficients.shape[1] - self.degree) + rows
        # All powers of all points side by side: arithmetic runs along the points.
        near = np.ascontiguousarray(powers.take(cells, axis=0).T).reshape(count, count, -1)
        level, rising, bent = _horner(near, x, 3)
        table[0], table[2], table[5] = _horner(level, y, 3)
        table[1], table[4] = _horner(rising, y, 2)
        (table[3],) = _horner(bent, y, 1)

    @cached_property
    def _powers(self) -> Floats:
        """The spline as a polynomial on each cell (cells, (degree + 1)^2): factors of x^i y^j, both from 0 to 1."""
        count = self.degree + 1
        pieces = _pieces(self.degree)[0]
        near = sliding_window_view(self.coefficients, (count, count))
        powers: Floats = pieces @ near @ pieces.T
        return powers.reshape(-1, count * count)

    def _located(self, plan: Floats) -> tuple[Ints, Floats]:
        """Return the first knots (2, n) that act at points (n, 2), and the share (2, n) of a spacing beyond them."""
        cells, corner, spacings = self._grid
        places = (np.ascontiguousarray(plan.T) - corner) / spacings
        # Rounding may put a point of the edge beyond it.
        inside = (places >= -1e-9) & (places <= cells + 1e-9)
        if not inside.all():
            first = plan[np.argmin(np.all(inside, axis=0))]
            raise BeyondSurface(first.tolist(), self.lower.tolist(), self.upper.tolist())
        firsts = np.minimum(places.astype(np.int64), cells - 1)
        return firsts, places - firsts

    @cached_property
    def _grid(self) -> tuple[Ints, Floats, Floats]:
        """Cells, least place and spacing along x and y, each (2, 1)."""
        return np.array(self.coefficients.shape)[:, None] - self.degree, self.lower[:, None], self.spacings[:, None]

    @cached_property
    def _units(self) -> Floats:
        """What `_write_derivatives` writes is in these units (6, 1)."""
        (h, k) = self.spacings
        return np.array([1.0, 1.0 / h, 1.0 / k, 2.0 / (h * h), 1.0 / (h * k), 2.0 / (k * k)])[:, None]


@dataclass(frozen=True, eq=False)
class _Equations(Frozen):
    """The normal equations of a fit, in units of the knots' spacings.

    Attributes:
        firsts: cells (n, 2) of the points.
        shares: places (n, 2) of the points in their cells, 0 to 1.
        weights: (n,) of the points.
        cells: along each axis (2,).
        spacings: of the knots along each axis (2,), metres.
        degree: of the spline.
    """

    firsts: Ints
    shares: Floats
    weights: Floats
    cells: Ints
    spacings: Floats
    degree: int

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Coefficients along each axis."""
        return int(self.cells[0]) + self.degree, int(self.cells[1]) + self.degree

    @cached_property
    def design(self) -> sparse.csr_array:
        """Values (points, coefficients) of the basis at the points."""
        count, (long, short) = self.degree + 1, self.shape
        columns = [self.firsts[:, axis, None] + np.arange(count) for axis in (0, 1)]
        values = [_values(self.shares[:, axis], self.degree, 1)[0] for axis in (0, 1)]
        return sparse.csr_array(
            (
                (values[0][:, :, None] * values[1][:, None, :]).ravel(),
                (columns[0][:, :, None] * short + columns[1][:, None, :]).ravel(),
                np.arange(len(self.firsts) + 1) * count**2,
            ),
            (len(self.firsts), long * short),
        )

    @cached_property
    def energies(self) -> list[_Pair]:
        """Matrices along each axis whose Kronecker products add up to the smoothing, the order along x falling."""
        grams = [[_gram(int(cells), self.degree, order) for order in range(4)] for cells in self.cells]
        return [
            (weight * grams[0][3 - order], grams[1][order]) for order, weight in enumerate(self._weights().tolist())
        ]

    def _weights(self) -> Floats:
        """Return the weights (4,) of the integrals over the squares of f_xxx, f_xxy, f_xyy and f_yyy."""
        h, k = self.spacings
        order = np.arange(4)
        weights: Floats = SMOOTHING * np.array([1.0, 3.0, 3.0, 1.0]) * h ** (2.0 * order - 5) * k ** (1.0 - 2 * order)
        return weights

    def solved(self, heights: Floats) -> Floats:
        """Return the coefficients (m, n) for heights (points,) in metres, by Cholesky's factor of their band."""
        wide, degree = self.shape[1], self.degree
        # In Fortran's order, SciPy factors it in place.
        band = np.zeros((degree * wide + degree + 1, self.shape[0] * wide), order="F")
        for slow, fast in self.energies:
            for down in range(degree + 1):
                first = np.append(slow.diagonal(-down), np.zeros(down))
                for across in range(-degree if down else 0, degree + 1):
                    ends = np.zeros(abs(across))
                    second = (
                        np.append(fast.diagonal(-across), ends)
                        if across >= 0
                        else np.append(ends, fast.diagonal(-across))
                    )
                    band[down * wide + across].reshape(self.shape)[:] += first[:, None] * second
        weighted = self.design.T * self.weights
        squares = sparse.tril(weighted @ self.design, format="coo")
        rows, columns = squares.coords
        band[rows - columns, columns] += squares.data
        # Its steps are so small that more threads wait for each other longer than they work.
        with threadpool_limits(1, user_api="blas"):
            solution: Floats = solveh_banded(
                band, weighted @ heights, lower=True, overwrite_ab=True, check_finite=False
            )
        return solution.reshape(self.shape)


def _gram(cells: int, degree: int, order: int) -> sparse.csr_array:
    """Return the integrals (n, n) of products of derivatives of the basis over some cells, exact by Gauss' rule."""
    nodes, weights = np.polynomial.legendre.leggauss(degree + 1)
    values = _values((nodes + 1) / 2, degree, order + 1)[order]
    block = values.T @ (weights[:, None] / 2 * values)
    row, column = np.indices(block.shape)
    starts = np.arange(cells)[:, None, None]
    entries = np.broadcast_to(block, (cells, *block.shape)).ravel()
    return sparse.coo_array((entries, ((starts + row).ravel(), (starts + column).ravel()))).tocsr()


def _horner(factors: Floats, shares: Floats, orders: int) -> list[Floats]:
    """Return a polynomial with factors (degree + 1, ..., n), its derivative and half its second one, at (n,) shares.

    Only as many of the three as orders say; by Horner's scheme, which is repeated on its own sums.

    Examples:
        >>> _horner(np.array([[1.0], [0.0], [3.0], [1.0]]), np.array([2.0]), 3)
        [array([21.]), array([24.]), array([9.])]
    """
    first = factors[-1] * shares
    sums = [first + factors[-2]]
    for _ in range(1, orders):
        sums.append(first + sums[-1])
    for power in range(len(factors) - 3, -1, -1):
        for order in range(min(orders, power + 1)):
            sums[order] *= shares
            sums[order] += sums[order - 1] if order else factors[power]
    return sums


def _values(shares: Floats, degree: int, orders: int) -> Floats:
    """Return derivatives of order 0, 1 ... (orders, n, degree + 1) of the basis at (n,) shares of a cell."""
    powers = shares[:, None] ** np.arange(degree + 1)
    values: Floats = powers @ _pieces(degree)[:orders]
    return values


@cache
def _pieces(degree: int) -> Floats:
    """Return the pieces of the basis on a cell from 0 to 1, and their derivatives of order 1 to 3.

    Returns:
        (4, degree + 1, degree + 1): factors of the powers 0, 1 ..., a column each function of the basis.

    Examples:
        >>> _pieces(1)[0].tolist()
        [[1.0, 0.0], [-1.0, 1.0]]
    """
    pieces = np.ones((1, 1))
    for k in range(1, degree + 1):
        higher = np.zeros((k + 1, k + 1))
        b = np.arange(k)
        # Cox and de Boor's recursion: piece b of degree k from pieces b - 1 and b of degree k - 1.
        higher[:-1, 1:] += pieces * (k - 1 - b)
        higher[1:, 1:] += pieces
        higher[:-1, :-1] += pieces * (1 + b)
        higher[1:, :-1] -= pieces
        pieces = higher / k
    table = np.zeros((4, degree + 1, degree + 1))
    table[0] = pieces
    for order in range(1, 4):
        table[order, :-1] = table[order - 1, 1:] * np.arange(1, degree + 1)[:, None]
    return table
