"""Passes: the ways over the part that the gun has to spray, and where they may be split."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.geometry.toolpath import Toolpath

# No facet: a gap that is bridged, or beyond the surface's edge.
NO_FACET = -1


@dataclass(frozen=True, eq=False)
class Pass(Frozen):
    """One way over the surface with the arc on, from the start of its lead-in to the end of its run-out.

    Attributes:
        path: points and smoothed normals in `machine`, over the arc length of P from 0; its number counts from 1.
        leans: (n,) greatest lean off each smoothed normal, radians; inf where the gun may swing through.
        facets: (m,) facet under each stretch of the path, `NO_FACET` where there is none.
        bounds: (m + 1,) arc lengths where those stretches begin and end.
        exempt: (k, 2) arc lengths of stretches so near to a crease that no deviation counts.
        layer: from 1.
        plane: of the layer, from 1.
        curve: of the plane, from 1.
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
        """The same way backwards."""
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
    """The passes of a job.

    Attributes:
        passes: in the order in which they are sprayed.
        sprayed: area of the surface that passes go over, square metres.
        too_steep: area too steep for a gun from above.
        hidden: area below other parts of the surface.
        beyond_travel: area beyond the machine's travel.
    """

    passes: tuple[Pass, ...]
    sprayed: float
    too_steep: float
    hidden: float
    beyond_travel: float


@dataclass(frozen=True)
class Split:
    """A place where the arc goes off inside a pass, so that the gun can turn.

    Attributes:
        number: of the pass, from 1.
        point: in `machine`, metres.
        reason: why.
    """

    number: int
    point: tuple[float, float, float]
    reason: Reason


class Reason(StrEnum):
    """Why a pass splits.

    With more travel of theta and phi there would be no split for TRAVEL. CREASE: the normals turn faster than the axes
    can follow at half the gun's speed.
    """

    TRAVEL = "travel"
    CREASE = "crease"
