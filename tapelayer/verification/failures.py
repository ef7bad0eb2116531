"""Findings: what verification finds on the programs of both machines: failures, and how the axes are used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from tapelayer.units import json_number
from tapelayer.verification.axis_use import AxisUse
from tapelayer.verification.limits import Limits


@dataclass(frozen=True)
class Failure:
    """One thing that a program must keep and does not.

    Attributes:
        number: of the course or pass, 0 where none applies.
        point: nearest point of it (from 1), 0 where none applies.
        what: the quantity, as in the report's keys.
        value: what was found, in the quantity's unit.
        limit: what is allowed, in the same unit.
        line: line of the program (from 1), 0 where it was not read from text.
        of: what the number counts.
    """

    number: int
    point: int
    what: str
    value: float
    limit: float
    line: int = 0
    of: str = "course"

    def sentence(self) -> str:
        """The failure in words."""
        place = " ".join(f"{name} {at}" for name, at in ((self.of, self.number), ("point", self.point)) if at)
        where = [f"line {self.line}"] if self.line else []
        found = f"{self.what} is {self.value:.6g}, limit {self.limit:.6g}"
        return ": ".join([*where, *([place] if place else []), found])

    def values(self) -> dict[str, Any]:
        """The failure for JSON."""
        place = {self.of: self.number, "point": self.point}
        found = {"what": self.what, "value": json_number(self.value), "limit": json_number(self.limit)}
        return place | found | ({"line": self.line} if self.line else {})


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings:
    """What is measured on the programs of both machines.

    Attributes:
        blocks: blocks in the program.
        duration: of the program, seconds.
        forward_disagreement: largest difference between Pinocchio itself and the batch evaluator, metres.
        axes: travel and speed of every axis.
        limits: of the setup, by quantity.
        program_sha256: SHA-256 of the text that was judged, hexadecimal; empty where it was a plan.
        failures: what does not hold, worst first within a course; empty where the program passed.
    """

    blocks: int
    duration: float
    forward_disagreement: float
    axes: tuple[AxisUse, ...]
    limits: Limits
    failures: tuple[Failure, ...]
    program_sha256: str = ""

    # What the program is made of, as failures and reports call it.
    PART: ClassVar[str] = "course"

    @property
    def places(self) -> tuple[str, str]:
        """Keys that place a failure: number of the part, and point in it."""
        return self.PART, "point"

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
