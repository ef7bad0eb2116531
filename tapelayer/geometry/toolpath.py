"""Toolpath: where the tool's contact goes, as samples over arc length; it knows no time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, frozen


@dataclass(frozen=True, eq=False)
class Toolpath:
    """One course or pass.

    Attributes:
        number: the number it carries in its file.
        points: (n, 3) contact points in metres, in the frame the toolpath is given in.
        normals: (n, 3) unit normals out of the surface.
        arc_lengths: (n,) metres, increasing.
    """

    number: int
    points: Floats
    normals: Floats
    arc_lengths: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("points", "normals", "arc_lengths"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def length(self) -> float:
        """Arc length from the first sample to the last, in metres."""
        return float(self.arc_lengths[-1] - self.arc_lengths[0])


def placed(
    toolpath: Toolpath, rotation: tuple[float, float, float], origin: tuple[float, float, float], thickness: float
) -> Toolpath:
    """Toolpath in `machine` axes, lifted by the plies already laid.

    Args:
        toolpath: in the part's frame.
        rotation: turns of the part about the fixed axes x, y, z in that order, radians.
        origin: of the part's frame in `machine`, metres: (l1, l2, -l3) of the paper's 1.4.
        thickness: every point moves to p + thickness n, and the arc length is measured again there, metres.
    """
    points, arc_lengths = toolpath.points, toolpath.arc_lengths - toolpath.arc_lengths[0]
    if thickness:
        points = points + thickness * toolpath.normals
        arc_lengths = _arc_lengths(arc_lengths, points)
    normals = toolpath.normals
    if np.any(rotation):
        turn = Rotation.from_euler("xyz", rotation).as_matrix().T
        points, normals = points @ turn, normals @ turn
    return Toolpath(toolpath.number, points + np.array(origin), normals, arc_lengths)


def _arc_lengths(parameters: Floats, points: Floats) -> Floats:
    """Arc length (n,) at the parameters (n,) of the not-a-knot spline through the points (n, 3), by 5-point Gauss."""
    slope = CubicSpline(parameters, points, bc_type="not-a-knot").derivative()
    nodes, weights = np.polynomial.legendre.leggauss(5)
    half = np.diff(parameters) / 2
    samples = parameters[:-1, None] + half[:, None] * (1 + nodes)
    speeds = np.linalg.norm(slope(samples), axis=2)
    return np.concatenate([[0.0], np.cumsum(half * (speeds @ weights))])


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
        """Points (n, 3) in metres, unit normals (n, 3) and unit tangents (n, 3) at the toolpath's samples."""
        # A piece of the spline has its slope at its begin as a coefficient.
        tangents = np.vstack([self._spline.c[2, :, :3], self._slope(self.knots[-1:])[:, :3]])
        return self._toolpath.points, self._toolpath.normals, _unit(tangents)

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Points (n, 3) in metres, unit normals (n, 3) and unit tangents (n, 3) at (n,) arc lengths in metres."""
        values = self._spline(arc_lengths)
        tangents = self._slope(arc_lengths)[:, :3]
        return values[:, :3], _unit(values[:, 3:]), _unit(tangents)


def _unit(vectors: Floats) -> Floats:
    lengths: Floats = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return vectors / lengths
