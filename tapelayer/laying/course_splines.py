"""Course splines: the curves that programs are judged by, B-splines unlike the planner's piecewise polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from tapelayer.arrays import Floats
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.vectors import dot, unit

# Accuracy in metres to which the nip's arc length is solved from the tape fed.
STATION_ACCURACY = 1e-10


class CourseSpline:
    """A course's curve as a B-spline: not-a-knot over arc length, a line for 2 points, a parabola for 3.

    It is constant before its start and beyond its end, where a cubic means nothing.
    """

    def __init__(self, path: Toolpath) -> None:
        self.path = path
        self.knots = path.arc_lengths - path.arc_lengths[0]
        self.length = float(self.knots[-1])
        degree = min(3, len(self.knots) - 1)
        self._spline = make_interp_spline(self.knots, np.hstack([path.points, path.normals]), degree)
        self._slopes = BSpline(self._spline.t, self._spline.c[:, :3], degree).derivative()

    def at(self, arc_lengths: Floats) -> Floats:
        """Return points and normals of any length (n, 6) at (n,) arc lengths in metres."""
        values: Floats = self._spline(np.clip(arc_lengths, 0.0, self.length))
        return values

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Return tangents (n, 3) of nearly unit length at (n,) arc lengths in metres."""
        slopes: Floats = self._slopes(np.clip(arc_lengths, 0.0, self.length))
        return slopes

    def point(self, arc_length: float) -> int:
        """Return the number (from 1) of the file's point nearest to an arc length in metres; 0 for NaN."""
        return 0 if np.isnan(arc_length) else int(np.argmin(np.abs(self.knots - arc_length))) + 1


@dataclass(frozen=True, eq=False)
class CourseSplines:
    """Curves of several courses, each with the rows of its samples; together, in order, these are all the rows."""

    courses: Sequence[tuple[CourseSpline, slice]]

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points, unit normals and unit tangents, (n, 3) each, at (n,) arc lengths in metres."""
        values = np.concatenate([curve.at(arc_lengths[rows]) for curve, rows in self.courses])
        return values[:, :3], unit(values[:, 3:]), unit(self.slopes(arc_lengths))

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Return tangents (n, 3) of nearly unit length at (n,) arc lengths in metres."""
        return np.concatenate([curve.slopes(arc_lengths[rows]) for curve, rows in self.courses])

    def under_nip(self, u: Floats, normals: Floats, headings: Floats, radius: float) -> tuple[Floats, Floats]:
        """Return the nip's arc length (n,) for the tape fed since the course's start, and its angle (n,) on the roller.

        The tape fed is u = s - R beta(s) plus a constant, with beta measured between the head and the course's tangent
        at s; it is solved for s by secants.

        Args:
            u: (n,) metres.
            normals: (n, 3) head normals, unit.
            headings: (n, 3) headings, unit.
            radius: of the roller that the tape wraps round, metres; 0 if the wrap is not compensated.
        """

        def wrap(arc_lengths: Floats) -> Floats:
            slopes = self.slopes(arc_lengths)
            angles: Floats = np.arctan2(dot(slopes, normals), dot(slopes, headings))
            return angles

        starts = np.repeat(
            [rows.start for _, rows in self.courses], [rows.stop - rows.start for _, rows in self.courses]
        )
        fed = u - u[starts]
        wraps = wrap(fed)
        if radius == 0.0:
            return fed, wraps
        # The first sample of a course is its start, where no tape has been fed.
        start = wraps[starts]
        before, residual_before = fed, radius * (start - wraps)
        arc_lengths = fed - residual_before
        for _ in range(50):
            wraps = wrap(arc_lengths)
            residual = arc_lengths - fed - radius * (wraps - start)
            if np.all(np.abs(residual) <= STATION_ACCURACY):
                return arc_lengths, wraps
            change = residual - residual_before
            slope = np.where(change != 0.0, (arc_lengths - before) / np.where(change != 0.0, change, 1.0), 1.0)
            before, residual_before = arc_lengths, residual
            arc_lengths = arc_lengths - residual * np.clip(slope, 0.1, 10.0)
        return np.where(np.abs(residual) <= STATION_ACCURACY, arc_lengths, np.nan), wraps
