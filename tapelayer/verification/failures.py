"""Failures: the results of verification that all kinds of job share, as failures and axis use."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from tapelayer.units import json_number
from tapelayer.verification.axis_use import AxisUse
from tapelayer.verification.limits import Limits


@dataclass(frozen=True)
class Failure:
    """One limit or rule that a program breaks.

    Attributes:
        number: of the course or pass, 0 where none applies.
        point: nearest point of it (from 1), 0 where none applies.
        what: the quantity, as in the report's keys.
        value: measured value, in the quantity's unit.
        limit: largest allowed value, in the same unit.
        line: line of the program (from 1), 0 if it was not read from text.
        of: the kind of part that the number counts.
    """

    number: int
    point: int
    what: str
    value: float
    limit: float
    line: int = 0
    of: str = "course"

    def sentence(self) -> str:
        """Return the failure in words."""
        place = " ".join(f"{name} {at}" for name, at in ((self.of, self.number), ("point", self.point)) if at)
        where = [f"line {self.line}"] if self.line else []
        finding = f"{self.what} is {self.value:.6g}, limit {self.limit:.6g}"
        return ": ".join([*where, *([place] if place else []), finding])

    def values(self) -> dict[str, Any]:
        """Return the failure for JSON."""
        place = {self.of: self.number, "point": self.point}
        finding = {"what": self.what, "value": json_number(self.value), "limit": json_number(self.limit)}
        return place | finding | ({"line": self.line} if self.line else {})


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """The verdict on what a job made.

    Attributes:
        limits: of the setup, by quantity.
        failures: broken limits, worst first within a course; empty where it passed.
    """

    limits: Limits
    failures: tuple[Failure, ...]

    # The parts of what is judged, as failures and reports call them.
    PART: ClassVar[str] = "course"

    @property
    def places(self) -> tuple[str, str]:
        """Keys that locate a failure: number of the part, and point in it."""
        return self.PART, "point"

    @property
    def passed(self) -> bool:
        """Whether every limit is kept."""
        return not self.failures

    def worst(self, shown: int) -> str:
        """Return the first failures in words, one per line, then a count of the rest.

        Examples:
            >>> failures = tuple(Failure(number, 0, "gap_mm", 3.0, 2.0) for number in (1, 2, 3))
            >>> print(Outcome(limits={}, failures=failures).worst(1))
            course 1: gap_mm is 3, limit 2
            and 2 more failures
        """
        lines = [failure.sentence() for failure in self.failures[:shown]]
        more = len(self.failures) - shown
        if more > 0:
            lines.append(f"and {more} more failure{'s' if more > 1 else ''}")
        return "\n".join(lines)

    def unmeasured(self) -> Iterator[str]:
        """Yield the names of what was to be measured besides the quantities, and was not."""
        yield from ()

    def values(self) -> dict[str, Any]:
        """Return what was measured besides the quantities, as plain values for JSON."""
        return {}


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings(Outcome):
    """Measurements on the programs of both machines.

    Attributes:
        blocks: blocks in the program.
        duration: of the program on its control, seconds.
        asked: seconds that its words ask for.
        time_law: the rule by which the time on the control is predicted.
        forward_disagreement: largest difference between Pinocchio itself and the batch evaluator, metres.
        axes: travel and speed of every axis.
        program_sha256: SHA-256 of the judged text, hexadecimal; empty for a plan.
    """

    blocks: int
    duration: float
    asked: float
    time_law: str
    forward_disagreement: float
    axes: tuple[AxisUse, ...]
    program_sha256: str = ""

    def unmeasured(self) -> Iterator[str]:
        """Yield the names of the axes' travels and speeds that were not measured."""
        for axis in self.axes:
            travel, speed, *_ = axis.failures
            if not (math.isfinite(axis.least) and math.isfinite(axis.greatest)):
                yield travel
            if not math.isfinite(axis.top_speed):
                yield speed

    def values(self) -> dict[str, Any]:
        """Return the use of each axis."""
        return {"axes": {axis.name: axis.values() for axis in self.axes}}
