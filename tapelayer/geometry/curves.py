"""Curves: smooth curves through the samples of a toolpath."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from tapelayer.arrays import Floats, frozen
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.vectors import unit


class Curve:
    """The curve of a toolpath: a not-a-knot cubic spline over arc length (2 points a line, 3 a parabola).

    Normals are the same spline by component, renormalised; tangents are its derivative, not projected.

    Args:
        toolpath: the samples; arc length 0 of the curve is the first sample.
    """

    def __init__(self, toolpath: Toolpath) -> None:
        self.knots = frozen(toolpath.arc_lengths - toolpath.arc_lengths[0])
        self.length = float(self.knots[-1])
        # Two points make a line and three a parabola by SciPy's own rule for not-a-knot ends.
        self._spline = CubicSpline(self.knots, np.hstack([toolpath.points, toolpath.normals]), bc_type="not-a-knot")
        self._slope = self._spline.derivative()
        self._toolpath = toolpath

    def at_knots(self) -> tuple[Floats, Floats, Floats]:
        """Return points (n, 3) in metres, unit normals (n, 3) and unit tangents (n, 3) at the toolpath's samples.

        Examples:
            >>> points, normals = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
            >>> _, _, tangents = Curve(Toolpath(1, points, normals, np.array([0.0, 0.5]))).at_knots()
            >>> np.round(tangents, 6).tolist()
            [[0.6, 0.8, 0.0], [0.6, 0.8, 0.0]]
        """
        # Each piece of the spline holds its initial slope as a coefficient.
        tangents = np.vstack([self._spline.c[2, :, :3], self._slope(self.knots[-1:])[:, :3]])
        return self._toolpath.points, self._toolpath.normals, unit(tangents)

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points (n, 3) in metres, unit normals (n, 3) and unit tangents (n, 3) at (n,) arc lengths in metres.

        Examples:
            >>> points, normals = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
            >>> places, _, tangents = Curve(Toolpath(1, points, normals, np.array([0.0, 0.5]))).at(np.array([0.25]))
            >>> np.round(places, 6).tolist(), np.round(tangents, 6).tolist()
            ([[0.15, 0.2, 0.0]], [[0.6, 0.8, 0.0]])
        """
        values = self._spline(arc_lengths)
        tangents = self._slope(arc_lengths)[:, :3]
        return values[:, :3], unit(values[:, 3:]), unit(tangents)
