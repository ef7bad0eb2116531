"""Fitting: the smooth surface through a mould's facets where a ply lies, and how far it is off them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tapelayer.arrays import Floats, Frozen
from tapelayer.errors import InputFault, PlyRefused
from tapelayer.geometry.smooth_surface import SmoothSurface
from tapelayer.plies.ply import Ply
from tapelayer.plies.reach import Reach
from tapelayer.plies.region import Region
from tapelayer.units import MM

# Knots of the surface are this far apart, metres, or as far that there are no more cells than this. Corners of facets
# may be much farther apart, the surface is smooth between them; knots as far apart as corners make waves.
SPACING = 20.0 * MM
MOST_CELLS = 40_000
# Weight of the middles of facets' edges against corners, which count 1: they decide what corners leave open, as those
# of a flat plate or of two rows along the ends of an extruded panel do, and nothing else.
MIDDLE_WEIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class FittedMould(Frozen):
    """A smooth surface through the corners of a mould's facets.

    Attributes:
        field: the surface, in the ply's plane.
        twin: a surface of another degree through the same corners: where both differ, the mould does not say.
        corners: (n, 3) metres, of the facets that it goes through.
        residuals: (n,) metres from the corners to the surface, along its normals.
        inside: (n,) corners that lie in the ply.
    """

    field: SmoothSurface
    twin: SmoothSurface
    corners: Floats
    residuals: Floats
    inside: Floats

    @property
    def residual(self) -> float:
        """Largest distance of a corner in the ply from the surface, metres; 0 where there is none."""
        return float(np.max(np.abs(self.residuals[self.inside]), initial=0.0))


def fitted(region: Region, ply: Ply, reach: Reach, name: str) -> FittedMould:
    """Return the smooth surface of a mould wherever strips of a ply are traced.

    Args:
        region: the ply on its mould.
        ply: with the limit of the residual.
        reach: where strips are traced.
        name: of the ply's file, for messages.

    Raises:
        PlyRefused: the surface is farther off the mould in the ply than its limit.
    """
    lower, upper = reach.lower - ply.width, reach.upper + ply.width
    triangles = region.plane.into(region.mould.vertices)[region.mould.facets[region.facets]]
    plan = triangles[:, :, :2]
    touched = np.all((plan.max(axis=1) >= lower) & (plan.min(axis=1) <= upper), axis=1)
    triangles, plan = triangles[touched], plan[touched]
    lower = np.minimum(lower, plan.min(axis=(0, 1)))
    upper = np.maximum(upper, plan.max(axis=(0, 1)))
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    spacing = max(SPACING, float(np.sqrt(np.prod(upper - lower) / MOST_CELLS)))
    middles = np.unique(((triangles + np.roll(triangles, 1, axis=1)) / 2.0).reshape(-1, 3), axis=0)
    points, weights = np.vstack([corners, middles]), np.repeat([1.0, MIDDLE_WEIGHT], [len(corners), len(middles)])
    field, twin = (SmoothSurface.fit(points, lower, upper, spacing, degree, weights) for degree in (5, 3))
    upright = field.normals(corners[:, :2])[:, 2]
    inside = shapely.contains_xy(region.outline, corners[:, 0], corners[:, 1])
    made = FittedMould(field, twin, corners, field.residuals[: len(corners)] * upright, inside)
    limit = ply.limits.max_surface_residual_mm * MM
    if not made.residual <= limit:
        worst = int(np.argmax(np.where(inside, np.abs(made.residuals), -1.0)))
        x, y, z = region.plane.out_of(corners[worst][None])[0] / MM
        sentence = (
            f"the smooth surface is {made.residual / MM:.2f} mm off the mould near ({x:.0f}, {y:.0f}, {z:.0f}), "
            f"expected at most {limit / MM:g}: the mould has an edge there; keep the ply off it, "
            "or raise [limits] max_surface_residual_mm"
        )
        raise PlyRefused(name, [InputFault(0, sentence)])
    return made
