"""Toolpath: the path of the tool's contact point as samples over arc length, without time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats, Frozen


@dataclass(frozen=True, eq=False)
class Toolpath(Frozen):
    """One course or pass.

    Attributes:
        number: its number in the file.
        points: (n, 3) contact points in metres, in the frame of the toolpath.
        normals: (n, 3) unit normals out of the surface.
        arc_lengths: (n,) metres, increasing.
    """

    number: int
    points: Floats
    normals: Floats
    arc_lengths: Floats

    @property
    def length(self) -> float:
        """Arc length from the first sample to the last, in metres.

        Examples:
            >>> Toolpath(1, np.zeros((2, 3)), np.zeros((2, 3)), np.array([0.1, 0.6])).length
            0.5
        """
        return float(self.arc_lengths[-1] - self.arc_lengths[0])


def to_machine(
    toolpath: Toolpath, rotation: tuple[float, float, float], origin: tuple[float, float, float], thickness: float
) -> Toolpath:
    """Return the toolpath in `machine` axes, lifted by the plies already laid.

    Args:
        toolpath: in the part's frame.
        rotation: turns of the part about the fixed axes x, y, z in that order, radians.
        origin: of the part's frame in `machine`, metres: (l1, l2, -l3) of the paper's 1.4.
        thickness: every point moves to p + thickness n, where the arc length is measured again, metres.

    Examples:
        >>> points, normals = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
        >>> path = Toolpath(1, points, normals, np.array([0.0, 1.0]))
        >>> np.round(to_machine(path, (0.0, 0.0, np.pi / 2), (0.3, 0.0, -1.4), thickness=0.1).points, 6).tolist()
        [[0.3, 0.0, -1.3], [0.3, 1.0, -1.3]]
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
    """Return arc lengths (n,) at parameters (n,) of the not-a-knot spline through points (n, 3), by 5-point Gauss."""
    slope = CubicSpline(parameters, points, bc_type="not-a-knot").derivative()
    nodes, weights = np.polynomial.legendre.leggauss(5)
    half = np.diff(parameters) / 2
    samples = parameters[:-1, None] + half[:, None] * (1 + nodes)
    speeds = np.linalg.norm(slope(samples), axis=2)
    return np.concatenate([[0.0], np.cumsum(half * (speeds @ weights))])
