"""Ledger: what a ply's tapes cover, leave open, lay twice and waste, as areas on the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from tapelayer.arrays import Frozen
from tapelayer.geometry.height_field import HeightField
from tapelayer.geometry.plan_cells import cells_within
from tapelayer.units import MM

# Shapes are cut into cells of this size in plan, metres, each with the slope of the surface in its middle.
CELL = 25.0 * MM


@dataclass(frozen=True, eq=False)
class Ledger(Frozen):
    """Areas on the surface in square metres, and the shapes in plan that they belong to.

    Attributes:
        ply: inside the boundary.
        tape: of all tapes.
        gap: of the ply under no tape.
        overlap: under two tapes, counted for every pair.
        overhang: of tape outside the boundary.
        tapes: outlines of the tapes, course by course.
        gaps: of the ply under no tape.
        overlaps: of each pair of tapes that overlap.
        overhangs: of tape outside the boundary.
    """

    ply: float
    tape: float
    gap: float
    overlap: float
    overhang: float
    tapes: tuple[Polygon, ...]
    gaps: BaseGeometry
    overlaps: tuple[BaseGeometry, ...]
    overhangs: BaseGeometry

    @property
    def coverage(self) -> float:
        """Share of the ply under tape."""
        return 1.0 - self.gap / self.ply if self.ply > 0.0 else float("nan")

    @property
    def overhang_share(self) -> float:
        """Tape outside the boundary over the ply's area."""
        return self.overhang / self.ply if self.ply > 0.0 else float("nan")


def ledger_of(field: HeightField, outline: Polygon, tapes: Sequence[Polygon]) -> Ledger:
    """Return the ledger of tapes over a ply.

    Args:
        field: the surface; it reaches as far as the tapes.
        outline: of the ply in plan, metres, with its holes.
        tapes: outlines of the tapes in plan, metres.
    """
    tapes = tuple(shapely.make_valid(tape) for tape in tapes)
    together = shapely.union_all(tapes)
    one, other = shapely.STRtree(tapes).query(tapes, predicate="intersects")
    pairs = np.column_stack([one, other])[one < other]
    shapes = np.array(tapes, dtype=object)
    met = shapely.intersection(shapes[pairs[:, 0]], shapes[pairs[:, 1]])
    overlaps = tuple(met[shapely.area(met) > 0.0])
    gaps, overhangs = outline.difference(together), together.difference(outline)
    return Ledger(
        ply=surface_area(field, [outline]),
        tape=surface_area(field, tapes),
        gap=surface_area(field, [gaps]),
        overlap=surface_area(field, overlaps),
        overhang=surface_area(field, [overhangs]),
        tapes=tapes,
        gaps=gaps,
        overlaps=overlaps,
        overhangs=overhangs,
    )


def surface_area(field: HeightField, shapes: Sequence[BaseGeometry]) -> float:
    """Return the area in square metres on a surface of shapes in plan, metres; what they share counts for each.

    Examples:
        >>> from tapelayer.geometry.smooth_surface import SmoothSurface
        >>> plan = np.stack(np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)), -1).reshape(-1, 2)
        >>> sloped = SmoothSurface.fit(np.column_stack([plan, 0.75 * plan[:, 0]]), np.zeros(2), np.ones(2), 0.25)
        >>> round(surface_area(sloped, [shapely.box(0.1, 0.1, 0.5, 0.6)]), 9)
        0.25
    """
    parts = shapely.get_parts(shapely.get_parts(list(shapes)))
    parts = parts[shapely.area(parts) > 0.0]
    if not len(parts):
        return 0.0
    areas, middles = cells_within(parts, shapely.total_bounds(parts)[:2], CELL)
    _, slope_x, slope_y, *_ = field.derivatives(middles)
    return float(np.sum(areas * np.sqrt(1.0 + slope_x**2 + slope_y**2)))
