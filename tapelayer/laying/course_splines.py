"""Course splines: the curves that a program is judged by, B-splines where the planner has piecewise polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from tapelayer.arrays import Floats
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.vectors import dot, unit

# The nip's arc length is found from the tape fed to this accuracy, in metres.
STATION_ACCURACY = 1e-10


class CourseSpline:
    """A course's curve as a B-spline: not-a-knot over arc length, 2 points a line, 3 a parabola.

    Before its start it is its start and beyond its end its end: a cubic has nothing to say out there.
    """

    def __init__(self, path: Toolpath) -> None:
        self.path = path
        self.knots = path.arc_lengths - path.arc_lengths[0]
        self.length = float(self.knots[-1])
        degree = min(3, len(self.knots) - 1)
        self._spline = make_interp_spline(self.knots, np.hstack([path.points, path.normals]), degree)
        self._slopes = BSpline(self._spline.t, self._spline.c[:, :3], degree).derivative()

    def at(self, arc_lengths: Floats) -> Floats:
        """Return points and normals (n, 6), the latter of any length, at (n,) arc lengths in metres."""
        values: Floats = self._spline(np.clip(arc_lengths, 0.0, self.length))
        return values

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Return tangents (n, 3) of about unit length at (n,) arc lengths in metres."""
        slopes: Floats = self._slopes(np.clip(arc_lengths, 0.0, self.length))
        return slopes

    def point(self, arc_length: float) -> int:
        """Return the number (from 1) of the file's point nearest to an arc length in metres; 0 for NaN."""
        return 0 if np.isnan(arc_length) else int(np.argmin(np.abs(self.knots - arc_length))) + 1


@dataclass(frozen=True, eq=False)
class CourseSplines:
    """Curves of several courses, each with the rows of the samples along it; one after the other they are all rows."""

    courses: Sequence[tuple[CourseSpline, slice]]

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points, unit normals and unit tangents, (n, 3) each, at (n,) arc lengths in metres."""
        values = np.concatenate([curve.at(arc_lengths[rows]) for curve, rows in self.courses])
        return values[:, :3], unit(values[:, 3:]), unit(self.slopes(arc_lengths))

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Return tangents (n, 3) of about unit length at (n,) arc lengths in metres."""
        return np.concatenate([curve.slopes(arc_lengths[rows]) for curve, rows in self.courses])

    def under_nip(self, u: Floats, normals: Floats, headings: Floats, radius: float) -> tuple[Floats, Floats]:
        """Return the nip's arc length (n,) by the tape fed since the course's start, and its angle (n,) on the roller.

        The tape fed is u = s - R beta(s) beside a constant, and beta is measured between the head and the course's
        tangent at s: solved for s by secants.

        Args:
            u: (n,) metres.
            normals: (n, 3) head normals, unit.
            headings: (n, 3) headings, unit.
            radius: of the roller that the tape is wrapped round, metres; 0 where the wrap is not compensated.
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
        # At its first sample a course is at its start, where no tape is fed.
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
