"""Reach: the convex part of the plan in which strips are traced, so that each has its own stretch and no more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tapelayer.arrays import Floats, Frozen, Mask

# A direction this much outwards, per metre, runs along a side.
ALONG = 1e-12


@dataclass(frozen=True, eq=False)
class Reach(Frozen):
    """A convex polygon in plan, as half planes.

    Attributes:
        normals: (k, 2) unit normals outwards.
        offsets: (k,) metres: a point p is inside where normals @ p <= offsets.
        lower: (2,) least x and y of its corners, metres.
        upper: (2,) greatest ones.
    """

    normals: Floats
    offsets: Floats
    lower: Floats
    upper: Floats

    @staticmethod
    def around(outline: shapely.Polygon, distance: float) -> Reach:
        """Return the convex hull of an outline in plan, grown by a distance in metres.

        Examples:
            >>> reach = Reach.around(shapely.box(0.0, 0.0, 1.0, 2.0), 0.1)
            >>> reach.lower.round(9).tolist(), reach.upper.round(9).tolist()
            ([-0.1, -0.1], [1.1, 2.1])
        """
        hull = shapely.convex_hull(outline).buffer(distance, join_style="mitre", mitre_limit=2.0)
        corners = shapely.get_coordinates(shapely.normalize(hull).exterior)
        # Normalised rings run clockwise.
        sides = np.diff(corners, axis=0)
        sides = sides[np.any(sides != 0.0, axis=1)]
        begins = corners[:-1][np.any(np.diff(corners, axis=0) != 0.0, axis=1)]
        normals = np.column_stack([-sides[:, 1], sides[:, 0]]) / np.hypot(*sides.T)[:, None]
        offsets = np.einsum("ij,ij->i", normals, begins)
        return Reach(normals, offsets, corners.min(axis=0), corners.max(axis=0))

    def holds(self, plan: Floats) -> Mask:
        """Return which of (n, 2) plan points are inside.

        Examples:
            >>> Reach.around(shapely.box(0.0, 0.0, 1.0, 1.0), 0.1).holds(np.array([[0.5, 0.5], [0.5, 1.2]])).tolist()
            [True, False]
        """
        inside: Mask = np.all(plan @ self.normals.T <= self.offsets, axis=1)
        return inside

    def ahead(self, plan: Floats, velocity: Floats) -> float:
        """Return how many times a velocity (2,) leads from a point (2,) inside to the border.

        Examples:
            >>> Reach.around(shapely.box(0.0, 0.0, 1.0, 1.0), 0.1).ahead(np.array([0.5, 0.5]), np.array([0.0, 0.1]))
            6.0
        """
        rates = self.normals @ velocity
        outwards = rates > ALONG * np.hypot(*velocity)
        distances = (self.offsets - self.normals @ plan)[outwards] / rates[outwards]
        return max(round(float(np.min(distances)), 12), 0.0)
