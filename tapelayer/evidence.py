"""Evidence: every number that verification measured on a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, Mask, frozen


@dataclass(frozen=True)
class Failure:
    """One thing that a program must keep and does not.

    Attributes:
        course: number of the course in its file, 0 where none applies.
        point: nearest point of the course (from 1), 0 where none applies.
        what: the quantity, as in the report's keys.
        value: what was found, in the quantity's unit.
        limit: what is allowed, in the same unit.
        line: line of the program (from 1), 0 where it was not read from text.
    """

    course: int
    point: int
    what: str
    value: float
    limit: float
    line: int = 0

    def sentence(self) -> str:
        """The failure in words."""
        place = f"line {self.line}: " if self.line else ""
        place += f"course {self.course} " if self.course else ""
        place += f"point {self.point} " if self.point else ""
        return f"{place.rstrip(': ')}: {self.what} is {self.value:.6g}, limit {self.limit:.6g}".lstrip(": ")


@dataclass(frozen=True)
class AxisUse:
    """How far and how fast an axis goes, in metres and radians.

    Attributes:
        name: joint name.
        revolute: True for radians.
        least: smallest value.
        greatest: largest value.
        lower: lower end of travel.
        upper: upper end of travel.
        top_speed: highest speed in a feed block.
        speed_limit: the axis's speed limit.
    """

    name: str
    revolute: bool
    least: float
    greatest: float
    lower: float
    upper: float
    top_speed: float
    speed_limit: float

    @property
    def margin(self) -> float:
        """Least distance to an end of the travel."""
        return min(self.least - self.lower, self.upper - self.greatest)


@dataclass(frozen=True, eq=False)
class Samples:
    """What was measured along the courses; rows are samples in laying order.

    Attributes:
        courses: (n,) index of the course.
        arc_lengths: (n,) metres along the course, by the tape fed.
        times: (n,) seconds from the program's start.
        nips: (n, 3) the course's point under the nip, `machine` axes, metres.
        normal_errors: (n,) contact off the course along the normal, metres.
        lateral_errors: (n,) contact off the course along the surface, across the travel, metres.
        tape_errors: (n,) nip ahead of the tape fed, metres.
        tilts: (n,) roller axis out of the tangent plane, radians.
        heading_errors: (n,) roller axis off square to the travel, in the tangent plane, radians.
        pitches: (n,) angle between head normal and surface normal that the round roller takes up, radians.
        wraps: (n,) angle of the nip round the roller, radians.
        offsets: (n,) roller centre off its exact place, metres.
        block_ends: (n,) True where a block ends, False between.
    """

    courses: Ints
    arc_lengths: Floats
    times: Floats
    nips: Floats
    normal_errors: Floats
    lateral_errors: Floats
    tape_errors: Floats
    tilts: Floats
    heading_errors: Floats
    pitches: Floats
    wraps: Floats
    offsets: Floats
    block_ends: Mask

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for field in fields(self):
            object.__setattr__(self, field.name, frozen(getattr(self, field.name)))

    @staticmethod
    def joined(parts: Sequence[Samples]) -> Samples:
        """The samples of several courses, one after the other; of none, no samples."""
        columns: dict[str, NDArray[Any]] = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts]) if parts else np.zeros(0)
            for field in fields(Samples)
        }
        columns["nips"] = columns["nips"].reshape(-1, 3)
        return Samples(**columns)

    @property
    def position_errors(self) -> Floats:
        """Distance (n,) of the contact from the course, in the plane across the travel, metres."""
        errors: Floats = np.hypot(self.normal_errors, self.lateral_errors)
        return errors


@dataclass(frozen=True)
class CutMade:
    """A cut that the courses ask for, as the program makes it.

    Attributes:
        station: where its line meets the tape's centre line, metres.
        angle: radians from travel towards the left.
        ending: number of the course whose end it is, 0 for none.
        starting: number of the course whose start it is, 0 for none.
        knife: 1 or 2.
        block: number (from 1) of the block that puts the knife down.
        line: line of the program (from 1) with that block, 0 where it was not read.
        error: largest distance of the knife from the line, metres.
        blade_error: largest angle between blade and line, radians.
    """

    station: float
    angle: float
    ending: int
    starting: int
    knife: int
    block: int
    line: int
    error: float
    blade_error: float


@dataclass(frozen=True)
class LedgerRow:
    """A course's tape, in metres.

    Attributes:
        course: its number in the file.
        length: laid.
        station: of its start on the tape.
        waste_roll: left between knife and nip for a new roll before it.
        waste_formula: before it, that the angles and the scrap margin ask for.
        waste_knives: before it, until every sweep finds a free knife.
        laying_stops: places where the tape rests while it is laid.
        cuts: blocks (from 1) that put a knife down for its two ends.
    """

    course: int
    length: float
    station: float
    waste_roll: float
    waste_formula: float
    waste_knives: float
    laying_stops: int
    cuts: tuple[int, ...]


@dataclass(frozen=True)
class TapeLedger:
    """What becomes of the tape.

    Attributes:
        rows: by course.
        cuts: in the order of the tape.
        used: metres from the first leading edge to the last course's end.
        laying: seconds with the shoe down.
        threading: seconds of feeding with the shoe up.
        linking: seconds of everything else.
    """

    rows: tuple[LedgerRow, ...]
    cuts: tuple[CutMade, ...]
    used: float
    laying: float
    threading: float
    linking: float

    @property
    def waste(self) -> float:
        """Tape used and not laid, in metres."""
        return self.used - sum(row.length for row in self.rows)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Every number that was measured, in metres, radians and seconds.

    Attributes:
        courses: courses in the file.
        points: points in the file.
        blocks: blocks in the program.
        laid_length: of all courses.
        duration: of the program.
        tape_taken_back: longest run of the tape backwards between courses.
        least_link_clearance: of the roller above the highest course point, while the head goes from course to course.
        forward_disagreement: largest difference between Pinocchio itself and the batch evaluator.
        axes: travel and speed of every axis.
        samples: along the courses, at blocks and between.
        tape_width: metres.
        roller_radius: metres.
        tape: the tape's ledger.
        failures: what does not hold, worst first within a course; empty where the program passed.
    """

    courses: int
    points: int
    blocks: int
    laid_length: float
    duration: float
    tape_taken_back: float
    least_link_clearance: float
    forward_disagreement: float
    axes: tuple[AxisUse, ...]
    samples: Samples
    tape_width: float
    roller_radius: float
    tape: TapeLedger
    failures: tuple[Failure, ...]

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
