"""Scene: a plan's courses, tape, gaps and boundary over its mould, for a page to draw."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.kind import Scene, SceneTable
from tapelayer.plies.drawing import Drawing
from tapelayer.units import DEG, MM

PERCENT = 1e-2

_POINT = ("x_mm", "y_mm", "z_mm")
_TAPE = (
    *("course", *(f"left_{name}" for name in _POINT), *(f"right_{name}" for name in _POINT), "arc_length_mm"),
    *("strain_percent", "lift_mm", "angle_deg", "residual_mm"),
)


class Drawn(Protocol):
    """The result of a plan."""

    def drawing(self) -> Drawing:
        """Return what of it is drawn."""


def scene(result: Drawn, mould: Mesh | None) -> Scene:
    """Return the scene of a result.

    Args:
        result: of a plan.
        mould: left aside, as a plan has its own.
    """
    drawing = result.drawing()
    tables = {
        "lines": _lines(drawing),
        "tape": _tape(drawing),
        "gaps": _gaps(drawing),
        "boundary": _boundary(drawing),
    }
    return Scene([course.number for course in drawing.courses], tables, {"part": drawing.mould})


def _lines(drawing: Drawing) -> SceneTable:
    """Return the points of the courses with their normals, in the order of laying."""
    columns = ("course", *_POINT, "nx", "ny", "nz", "arc_length_mm")
    return _table(
        columns,
        [
            _rows(course.number, course.points / MM, course.normals, course.arc_lengths / MM)
            for course in drawing.courses
        ],
    )


def _tape(drawing: Drawing) -> SceneTable:
    """Return pairs of edge points of each course with what was measured there."""
    return _table(
        _TAPE,
        [
            _rows(
                *(ribbon.number, ribbon.left / MM, ribbon.right / MM, ribbon.arcs / MM, ribbon.strains / PERCENT),
                *(ribbon.lifts / MM, ribbon.angles / DEG, ribbon.residuals / MM),
            )
            for ribbon in drawing.ribbons
        ],
    )


def _gaps(drawing: Drawing) -> SceneTable:
    """Return the gaps along the edges between neighbouring courses."""
    columns = ("right", "left", *_POINT, "gap_mm")
    return _table(columns, [_rows(gap.right, gap.left, gap.points / MM, gap.gaps / MM) for gap in drawing.gaps])


def _boundary(drawing: Drawing) -> SceneTable:
    """Return the rings of the ply's boundary."""
    return _table(("ring", *_POINT), [_rows(number, ring / MM) for number, ring in enumerate(drawing.rings)])


def _rows(*columns: int | Floats) -> Floats:
    """Return columns beside each other; the number of rows is that of the last, by which numbers are repeated."""
    count = len(columns[-1]) if isinstance(columns[-1], np.ndarray) else 1
    return np.column_stack([np.full(count, column) if isinstance(column, int) else column for column in columns])


def _table(columns: tuple[str, ...], parts: list[Floats]) -> SceneTable:
    return SceneTable(columns, np.vstack([np.zeros((0, len(columns))), *parts]))
