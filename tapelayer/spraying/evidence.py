"""Evidence on a spraying program: every number that verification measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask, SampleTable
from tapelayer.verification.failures import Findings


@dataclass(frozen=True, eq=False)
class SpraySamples(SampleTable):
    """Measurements with the arc on; rows are samples in order.

    Attributes:
        passes: (n,) index of the pass.
        pieces: (n,) index of the unbroken arc run that the sample belongs to.
        arc_lengths: (n,) metres along the pass; negative on the link from the previous pass.
        times: (n,) seconds from the program's start.
        asked: (n,) the same as the words ask for it, without ramps.
        speeds: (n,) m/s of P on the control.
        points: (n, 3) P, `machine` axes, metres.
        axes: (n, 3) the gun's axis, unit, out of the surface.
        position_errors: (n,) P off the smoothed path, metres.
        surface_distances: (n,) P off the facet under it, metres; NaN where there is none.
        deviations: (n,) gun off the facet's normal, radians; NaN where there is no facet.
        exempt: (n,) whether the sample is near a crease.
    """

    EMPTY: ClassVar = {
        "passes": np.zeros(0, np.int64),
        "pieces": np.zeros(0, np.int64),
        "points": np.zeros((0, 3)),
        "axes": np.zeros((0, 3)),
        "exempt": np.zeros(0, np.bool_),
    }

    passes: Ints
    pieces: Ints
    arc_lengths: Floats
    times: Floats
    asked: Floats
    speeds: Floats
    points: Floats
    axes: Floats
    position_errors: Floats
    surface_distances: Floats
    deviations: Floats
    exempt: Mask


@dataclass(frozen=True)
class MeasuredSplit:
    """A place where a program switches the arc off inside a pass.

    Attributes:
        number: of the pass, from 1.
        point: where spraying resumes, `machine` axes, metres.
        reason: travel or crease; empty if the plan has no split there.
    """

    number: int
    point: tuple[float, float, float]
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class SprayEvidence(Findings):
    """Every number measured on a spraying program, in metres, radians and seconds.

    Attributes:
        passes: number of passes that the part needs.
        points: number of their points.
        layers: number of their layers.
        sprayed_length: length of the path with the arc on.
        arc_time: time with the arc on.
        stops: places where the gun stops with the arc on.
        splits: breaks inside passes.
        crease_length: length of path near creases, where deviations are not judged.
        greatest_arc_distance: largest distance of the lit arc from the part, seen from above.
        samples: taken with the arc on, at block ends and within blocks.
    """

    passes: int
    points: int
    layers: int
    sprayed_length: float
    arc_time: float
    stops: int
    splits: tuple[MeasuredSplit, ...]
    crease_length: float
    greatest_arc_distance: float
    samples: SpraySamples

    PART = "pass"
