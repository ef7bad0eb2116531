"""Evidence on a spraying program: every number that verification measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask, SampleTable
from tapelayer.verification.failures import Findings


@dataclass(frozen=True, eq=False)
class SpraySamples(SampleTable):
    """What was measured with the arc on; rows are samples in order.

    Attributes:
        passes: (n,) index of the pass.
        pieces: (n,) index of the stretch without a break that the sample belongs to.
        arc_lengths: (n,) metres along the pass; negative on the way to it from the pass before.
        times: (n,) seconds from the program's start.
        points: (n, 3) P, `machine` axes, metres.
        axes: (n, 3) the gun's axis, unit, out of the surface.
        position_errors: (n,) P off the smoothed path, metres.
        surface_distances: (n,) P off the facet that it passes, metres; NaN where there is none.
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
    points: Floats
    axes: Floats
    position_errors: Floats
    surface_distances: Floats
    deviations: Floats
    exempt: Mask


@dataclass(frozen=True)
class SplitFound:
    """A place where the arc goes off inside a pass.

    Attributes:
        number: of the pass, from 1.
        point: where spraying goes on, `machine` axes, metres.
        reason: travel or crease; empty where the plan has no split there.
    """

    number: int
    point: tuple[float, float, float]
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class SprayEvidence(Findings):
    """Every number that was measured on a spraying program, in metres, radians and seconds.

    Attributes:
        passes: passes that the part asks for.
        points: points of these.
        layers: layers of these.
        sprayed_length: of the path with the arc on.
        arc_time: with the arc on.
        splits: breaks inside passes.
        crease_length: of the stretches where no deviation counts.
        greatest_arc_distance: of a place with the arc on from the part, seen from above.
        samples: with the arc on, at blocks and between.
    """

    passes: int
    points: int
    layers: int
    sprayed_length: float
    arc_time: float
    splits: tuple[SplitFound, ...]
    crease_length: float
    greatest_arc_distance: float
    samples: SpraySamples

    PART = "pass"
