"""Passes: the planned paths of the gun over the part, and the splits inside them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.geometry.toolpath import Toolpath

# No facet: over a bridged gap, or beyond the surface's edge.
NO_FACET = -1


@dataclass(frozen=True, eq=False)
class Pass(Frozen):
    """One path over the surface with the arc on, from the start of its lead-in to the end of its run-out.

    Attributes:
        path: points and smoothed normals in `machine`, over the arc length of P from 0; its number counts from 1.
        leans: (n,) largest permitted lean off each smoothed normal, radians; inf where the gun may swing through.
        facets: (m,) facet under each interval of the path, `NO_FACET` where there is none.
        bounds: (m + 1,) arc lengths where those intervals begin and end.
        exempt: (k, 2) arc lengths of intervals so close to a crease that deviations are not judged.
        layer: number from 1.
        plane: number in the layer, from 1.
        curve: number in the plane, from 1.
    """

    path: Toolpath
    leans: Floats
    facets: Ints
    bounds: Floats
    exempt: Floats
    layer: int
    plane: int
    curve: int

    def reversed(self) -> Pass:
        """Return the same pass backwards."""
        length = self.path.arc_lengths[-1]
        path = Toolpath(
            self.path.number, self.path.points[::-1], self.path.normals[::-1], length - self.path.arc_lengths[::-1]
        )
        return replace(
            self,
            path=path,
            leans=self.leans[::-1],
            facets=self.facets[::-1],
            bounds=length - self.bounds[::-1],
            exempt=length - self.exempt[::-1, ::-1],
        )


@dataclass(frozen=True, eq=False)
class Plan:
    """The passes of a job and the areas that they cover or miss.

    Attributes:
        passes: in spraying order.
        sprayed: area of the surface that the passes cover, square metres.
        too_steep: area too steep for a gun from above, square metres.
        hidden: area below other parts of the surface, square metres.
        beyond_travel: area beyond the machine's travel, square metres.
    """

    passes: tuple[Pass, ...]
    sprayed: float
    too_steep: float
    hidden: float
    beyond_travel: float


@dataclass(frozen=True)
class Split:
    """A place inside a pass where the arc is switched off so that the gun can turn.

    Attributes:
        number: the pass's number, from 1.
        point: in `machine`, metres.
        reason: why the pass is split.
    """

    number: int
    point: tuple[float, float, float]
    reason: Reason


class Reason(StrEnum):
    """Why a pass is split.

    TRAVEL: more travel of theta and phi would avoid the split. CREASE: the normals turn faster than the axes can follow
    at half the gun's speed.
    """

    TRAVEL = "travel"
    CREASE = "crease"
