"""Height fields: surfaces that are a height over a plane, with their derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.vectors import unit


class HeightField(ABC):
    """A surface z = f(x, y) over a plane; upward is the side that z points to."""

    @abstractmethod
    def derivatives(self, plan: Floats) -> Floats:
        """Return f, f_x, f_y, f_xx, f_xy and f_yy (6, n) in metres and 1/m at (n, 2) points of the plane in metres.

        Raises:
            BeyondSurface: a point lies outside the domain.
        """

    def points(self, plan: Floats) -> Floats:
        """Return the points (n, 3) of the surface in metres over (n, 2) points of the plane in metres.

        Raises:
            BeyondSurface: a point lies outside the domain.
        """
        return np.column_stack([plan, self.derivatives(plan)[0]])

    def normals(self, plan: Floats) -> Floats:
        """Return the unit upward normals (n, 3) over (n, 2) points of the plane in metres.

        Raises:
            BeyondSurface: a point lies outside the domain.
        """
        _, slope_x, slope_y, *_ = self.derivatives(plan)
        return unit(np.column_stack([-slope_x, -slope_y, np.ones_like(slope_x)]))

    def curvatures(self, plan: Floats) -> Floats:
        """Return the Gauss curvatures (n,) in 1/m2 over (n, 2) points of the plane in metres.

        Raises:
            BeyondSurface: a point lies outside the domain.
        """
        return gauss_curvatures(self.derivatives(plan))


def gauss_curvatures(derivatives: Floats) -> Floats:
    """Return the Gauss curvatures (n,) in 1/m2 of derivatives (6, n), in the order of `HeightField.derivatives`.

    Examples:
        >>> on_top_of_a_sphere_of_2_m = np.array([[0.0], [0.0], [0.0], [-0.5], [0.0], [-0.5]])
        >>> gauss_curvatures(on_top_of_a_sphere_of_2_m).tolist()
        [0.25]
    """
    _, slope_x, slope_y, bend_x, twist, bend_y = derivatives
    curvatures: Floats = (bend_x * bend_y - twist**2) / (1.0 + slope_x**2 + slope_y**2) ** 2
    return curvatures
