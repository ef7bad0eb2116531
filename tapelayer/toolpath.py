"""Toolpath: where the tool's contact goes, as samples over arc length; it knows no time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

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

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Points (n, 3) in metres, unit normals (n, 3) and unit tangents (n, 3) at (n,) arc lengths in metres."""
        values = self._spline(arc_lengths)
        tangents = self._slope(arc_lengths)[:, :3]
        return values[:, :3], _unit(values[:, 3:]), _unit(tangents)


def _unit(vectors: Floats) -> Floats:
    lengths: Floats = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return vectors / lengths
