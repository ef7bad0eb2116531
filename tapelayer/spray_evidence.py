"""Evidence on a spraying program: every number that verification measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, Mask, frozen
from tapelayer.evidence import AxisUse


@dataclass(frozen=True)
class SprayFailure:
    """One thing that a program must keep and does not.

    Attributes:
        number: of the pass, 0 where none applies.
        point: nearest point of the pass (from 1), 0 where none applies.
        what: the quantity, as in the report's keys.
        value: what was found, in the quantity's unit.
        limit: what is allowed, in the same unit.
        line: line of the program (from 1), 0 where it was not read from text.
    """

    number: int
    point: int
    what: str
    value: float
    limit: float
    line: int = 0

    def sentence(self) -> str:
        """The failure in words."""
        places = (("line", self.line), ("pass", self.number), ("point", self.point))
        place = " ".join(f"{name} {number}" for name, number in places if number)
        return f"{place}: {self.what} is {self.value:.6g}, limit {self.limit:.6g}".lstrip(": ")


@dataclass(frozen=True, eq=False)
class SpraySamples:
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

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for field in fields(self):
            object.__setattr__(self, field.name, frozen(getattr(self, field.name)))

    @staticmethod
    def joined(parts: Sequence[SpraySamples]) -> SpraySamples:
        """The samples of several stretches, one after the other; of none, no samples."""
        columns: dict[str, NDArray[Any]] = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts]) if parts else np.zeros(0)
            for field in fields(SpraySamples)
        }
        for name in ("points", "axes"):
            columns[name] = columns[name].reshape(-1, 3)
        columns["exempt"] = columns["exempt"].astype(np.bool_)
        return SpraySamples(**columns)


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


@dataclass(frozen=True, eq=False)
class SprayEvidence:
    """Every number that was measured, in metres, radians and seconds.

    Attributes:
        passes: passes that the part asks for.
        points: points of these.
        layers: layers of these.
        blocks: blocks in the program.
        sprayed_length: of the path with the arc on.
        arc_time: with the arc on.
        duration: of the program.
        splits: breaks inside passes.
        crease_length: of the stretches where no deviation counts.
        greatest_arc_distance: of a place with the arc on from the part, seen from above.
        forward_disagreement: largest difference between Pinocchio itself and the batch evaluator, metres.
        axes: travel and speed of every axis.
        samples: with the arc on, at blocks and between.
        failures: what does not hold; empty where the program passed.
    """

    passes: int
    points: int
    layers: int
    blocks: int
    sprayed_length: float
    arc_time: float
    duration: float
    splits: tuple[SplitFound, ...]
    crease_length: float
    greatest_arc_distance: float
    forward_disagreement: float
    axes: tuple[AxisUse, ...]
    samples: SpraySamples
    failures: tuple[SprayFailure, ...]

    @property
    def passed(self) -> bool:
        """Whether everything holds."""
        return not self.failures

    def worst(self, shown: int) -> str:
        """The first failures in words, a line each, then a count."""
        lines = [failure.sentence() for failure in self.failures[:shown]]
        more = len(self.failures) - shown
        if more > 0:
            lines.append(f"and {more} more failure{'s' if more > 1 else ''}")
        return "\n".join(lines)
