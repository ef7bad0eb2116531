"""Evidence: every number that verification measured on a tape-laying program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask, SampleTable
from tapelayer.verification.failures import Findings


@dataclass(frozen=True, eq=False)
class Samples(SampleTable):
    """Measurements along the courses; rows are samples in laying order.

    Attributes:
        courses: (n,) index of the course.
        arc_lengths: (n,) metres along the course, from the tape fed.
        times: (n,) seconds from the program's start.
        asked: (n,) the same as the words ask for it, without ramps.
        speeds: (n,) m/s of the nip over the surface on the control.
        nips: (n, 3) the course's point under the nip, `machine` axes, metres.
        normal_errors: (n,) contact off the course along the normal, metres.
        lateral_errors: (n,) contact off the course along the surface, across the travel, metres.
        tape_errors: (n,) nip ahead of the tape fed, metres.
        tilts: (n,) roller axis out of the tangent plane, radians.
        heading_errors: (n,) roller axis off square to the travel, in the tangent plane, radians.
        pitches: (n,) angle between head normal and surface normal that the round roller absorbs, radians.
        wraps: (n,) angle of the nip round the roller, radians.
        offsets: (n,) roller centre off its exact position, metres.
        block_ends: (n,) True at block ends, False within blocks.
    """

    EMPTY: ClassVar = {"courses": np.zeros(0, np.int64), "nips": np.zeros((0, 3)), "block_ends": np.zeros(0, np.bool_)}

    courses: Ints
    arc_lengths: Floats
    times: Floats
    asked: Floats
    speeds: Floats
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

    @property
    def position_errors(self) -> Floats:
        """Return the distance (n,) of the contact from the course, in the plane across the travel, metres."""
        errors: Floats = np.hypot(self.normal_errors, self.lateral_errors)
        return errors


@dataclass(frozen=True)
class CutMade:
    """A cut that the courses need, as the program makes it.

    Attributes:
        station: where its line meets the tape's centre line, metres.
        angle: radians from travel towards the left.
        ending: number of the course whose end it is, 0 for none.
        starting: number of the course whose start it is, 0 for none.
        knife: 1 or 2.
        block: number (from 1) of the block that lowers the knife.
        line: line of the program (from 1) with that block, 0 if the program was not read back.
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
class LayingStop:
    """A place where the tape stops while it is laid.

    Attributes:
        course: number of the course in its file.
        arc_length: metres along the course.
        seconds: for which it rests there; 0 where it goes on at once.
        line: line of the block that ends there, 0 if it was not read from text.
    """

    course: int
    arc_length: float
    seconds: float
    line: int


@dataclass(frozen=True)
class LedgerRow:
    """The tape of one course, in metres.

    Attributes:
        course: its number in the file.
        length: laid length.
        station: station of its start.
        waste_roll: wasted before it between knife and nip, for a new roll.
        waste_formula: wasted before it for the angles and the scrap margin.
        waste_knives: wasted before it until a knife is free for every sweep.
        laying_stops: number of places where the tape stops while it is laid.
        cuts: blocks (from 1) that lower a knife for its two ends.
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
    """How the tape and the time of a program are used.

    Attributes:
        rows: one per course.
        cuts: in order along the tape.
        stops: where the tape stops while it is laid, in order.
        used: metres from the first leading edge to the last course's end.
        laying: seconds with the shoe down.
        threading: seconds of feeding with the shoe up.
        linking: seconds of everything else, links above all.
    """

    rows: tuple[LedgerRow, ...]
    cuts: tuple[CutMade, ...]
    stops: tuple[LayingStop, ...]
    used: float
    laying: float
    threading: float
    linking: float

    @property
    def waste(self) -> float:
        """Return the tape used and not laid, in metres."""
        return self.used - sum(row.length for row in self.rows)


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence(Findings):
    """Every number measured on a tape-laying program, in metres, radians and seconds.

    Attributes:
        courses: number of courses in the file.
        points: number of points in the file.
        laid_length: length of all courses.
        tape_taken_back: longest backward run of the tape between courses.
        least_link_clearance: least height of the roller above the highest course point while linking.
        samples: along the courses, at block ends and within blocks.
        lay_speed: set speed of the nip over the surface, m/s.
        tape_width: metres.
        roller_radius: metres.
        tape: the tape's ledger.
    """

    courses: int
    points: int
    laid_length: float
    tape_taken_back: float
    least_link_clearance: float
    samples: Samples
    lay_speed: float
    tape_width: float
    roller_radius: float
    tape: TapeLedger
