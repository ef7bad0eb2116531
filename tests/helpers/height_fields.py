"""Surfaces whose heights and derivatives are known in closed form, and meshes of them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import BeyondSurface
from tapelayer.geometry.height_field import HeightField
from tapelayer.geometry.smooth_surface import SmoothSurface


class Polynomial(HeightField):
    """z = sum of factors times x^i y^j, over the whole plane.

    Args:
        factors: (m, n) by the powers i, j.
    """

    def __init__(self, factors: Sequence[Sequence[float]] | Floats) -> None:
        self.factors = np.array(factors, dtype=float)

    def derivatives(self, plan: Floats) -> Floats:
        x, y = plan.T
        out = []
        for along_x, along_y in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
            factors = np.polynomial.polynomial.polyder(self.factors, along_x, axis=0)
            factors = np.polynomial.polynomial.polyder(factors, along_y, axis=1)
            out.append(np.polynomial.polynomial.polyval2d(x, y, factors) if factors.size else 0 * x)
        return np.array(out)


def plane(slope_x: float = 0.0, slope_y: float = 0.0) -> Polynomial:
    return Polynomial([[0.0, slope_y], [slope_x, 0.0]])


def saddle(length: float = 4.0) -> Polynomial:
    """z = x y / length."""
    return Polynomial([[0.0, 0.0], [0.0, 1 / length]])


@dataclass(frozen=True)
class Turned(HeightField):
    """The upper half of a surface of revolution about an axis along y, which touches z = 0 at the origin.

    z = sqrt(r(y)^2 - x^2) - r(0).
    """

    @abstractmethod
    def radii(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return r, r' and r'' (n,) at y."""

    @property
    def depth(self) -> float:
        """r(0), by which the axis lies below the origin."""
        return float(self.radii(np.zeros(1))[0][0])

    def derivatives(self, plan: Floats) -> Floats:
        x, y = plan.T
        r, slope, bend = self.radii(y)
        if not np.all(r * r > x * x):
            raise BeyondSurface(plan[np.argmin(r * r > x * x)], (-self.depth, -math.inf), (self.depth, math.inf))
        z = np.sqrt(r * r - x * x)
        f_x, f_y = -x / z, r * slope / z
        f_yy = (slope**2 + r * bend) / z - f_y**2 / z
        return np.array([z - self.depth, f_x, f_y, -1 / z - f_x**2 / z, -f_x * f_y / z, f_yy])

    def radius_at(self, plan: Floats) -> Floats:
        """Return the distance (n,) of the surface's points from the axis."""
        return self.radii(plan[:, 1])[0]


@dataclass(frozen=True)
class Cylinder(Turned):
    radius: float = 1.8

    def radii(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        return self.radius + 0 * y, 0 * y, 0 * y


@dataclass(frozen=True)
class Cone(Turned):
    radius: float = 1.2
    half_angle: float = math.radians(20)

    def radii(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        slope = math.tan(self.half_angle)
        return self.radius + slope * y, slope + 0 * y, 0 * y


@dataclass(frozen=True)
class Torus(Turned):
    """The outer side: a tube bent to a ring, both their centres below the origin."""

    ring: float = 4.0
    tube: float = 1.5

    def radii(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        rise = np.sqrt(self.tube**2 - y * y)
        return self.ring + rise, -y / rise, -1 / rise - y * y / rise**3


@dataclass(frozen=True)
class Sphere(Turned):
    radius: float = 5.0

    def radii(self, y: Floats) -> tuple[Floats, Floats, Floats]:
        r = np.sqrt(self.radius**2 - y * y)
        return r, -y / r, -1 / r - y * y / r**3


def vertices(field: HeightField, edge: float = 0.025, half: float = 0.8, seed: int = 1) -> Floats:
    """Vertices (n, 3) in metres over a square of the plane, shaken by a quarter of the edge, as a binary STL has them.

    An STL has millimetres as floats of 32 bits.
    """
    count = round(2 * half / edge) + 1
    plan = np.stack(np.meshgrid(*[np.linspace(-half, half, count)] * 2, indexing="ij"))
    shift = np.random.default_rng(seed).uniform(-edge / 4, edge / 4, plan.shape)
    shift[0, [0, -1]] = shift[1, :, [0, -1]] = 0.0
    flat = (plan + shift).reshape(2, -1).T
    return (1e3 * field.points(flat)).astype(np.float32).astype(float) / 1e3


def fitted(field: HeightField, edge: float = 0.025, half: float = 0.8, degree: int = 5) -> SmoothSurface:
    """The smooth surface of such vertices, with 0.15 m around them."""
    reach = np.full(2, half + 0.15)
    return SmoothSurface.fit(vertices(field, edge, half), -reach, reach, max(0.02, edge), degree)
