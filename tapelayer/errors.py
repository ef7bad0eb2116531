"""Errors: one family, whose names state the fact, attributes hold the evidence, and texts say what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

SHOWN_FAULTS = 20


def printable(text: str) -> str:
    r"""Return a text for a message, with what a terminal would act on, or not show, as escapes.

    Examples:
        >>> printable("part\x1b[2J"), printable("one\ntwo"), printable("panel\udcff.nc")
        ('part\\x1b[2J', 'one\\ntwo', 'panel\\xff.nc')
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else escaped(sign) for sign in text)


def escaped(sign: str) -> str:
    r"""Return a character as an escape in ASCII; one that stands for a byte of a name that is no text as that byte.

    Examples:
        >>> escaped("\x1b"), escaped("\udcff"), escaped("\u94fa")
        ('\\x1b', '\\xff', '\\u94fa')
    """
    return rf"\x{ord(sign) - 0xDC00:02x}" if "\udc80" <= sign <= "\udcff" else ascii(sign)[1:-1]


class Travel(Protocol):
    """An axis with its travel in metres or radians, as the messages name it."""

    @property
    def name(self) -> str:
        """Joint name."""

    @property
    def revolute(self) -> bool:
        """Whether the values are angles."""

    @property
    def lower(self) -> float:
        """Lower end of the travel."""

    @property
    def upper(self) -> float:
        """Upper end of the travel."""


class TapelayerError(Exception):
    """A request cannot be carried out; the text is written for the user."""

    exit_code = 2


@dataclass(frozen=True)
class InputFault:
    """One fault of a file.

    Attributes:
        line: line of the fault (1-based, 0 where no line applies).
        sentence: what is wrong, without its place.
        column: 1-based, 0 where none applies.
        place: section, key and anything below it, in a file of values by section and key.
    """

    line: int
    sentence: str
    column: int = 0
    place: tuple[str, ...] = ()


class InputRefused(TapelayerError):
    """A file is refused, with all its faults at once (the first 20 are written out, then a count).

    Args:
        name: the file as the user named it.
        faults: every fault, in file order.
    """

    def __init__(self, name: str, faults: Sequence[InputFault]) -> None:
        self.name = name
        self.faults = tuple(faults)
        super().__init__(self._text())

    @classmethod
    def unreadable(cls, name: str, error: OSError) -> Self:
        """Return the refusal of a file that the system cannot read.

        Examples:
            >>> print(InputRefused.unreadable("panel.txt", FileNotFoundError(2, "No such file or directory")))
            panel.txt: cannot be read: no such file or directory
        """
        return cls(name, [InputFault(0, f"cannot be read: {(error.strerror or str(error)).lower()}")])

    def _text(self) -> str:
        lines = []
        name = printable(self.name)
        for fault in self.faults[:SHOWN_FAULTS]:
            place = name
            if fault.line:
                place += f":{fault.line}"
            if fault.column:
                place += f":{fault.column}"
            lines.append(f"{place}: {printable(fault.sentence)}")
        more = len(self.faults) - SHOWN_FAULTS
        if more > 0:
            lines.append(f"{name}: and {more} more fault{'s' if more > 1 else ''}")
        return "\n".join(lines)


class CourseFileRefused(InputRefused):
    """A course file cannot be read."""


class SetupRefused(InputRefused):
    """A setup file cannot be used."""


class PlyRefused(InputRefused):
    """A ply file, its boundary or its mould cannot be planned."""


class ProgramOfOtherSetup(SetupRefused):
    """A program was made with a different setup from the one it is judged by."""


class ControllerRefused(InputRefused):
    """A controller table cannot be used."""


class ProgramRefused(InputRefused):
    """An NC program cannot be read."""


class MeshRefused(InputRefused):
    """A mesh file cannot be used."""


class FootprintRefused(InputRefused):
    """A file with a measured footprint cannot be used."""


class BeyondSurface(TapelayerError):
    """A path on a smooth surface leaves what the surface was fitted on.

    Args:
        place: x and y of a point beyond it, metres, in the plane of the ply.
        lower: least x and y of the surface, metres.
        upper: greatest x and y of the surface, metres.
    """

    def __init__(self, place: Sequence[float], lower: Sequence[float], upper: Sequence[float]) -> None:
        self.place, self.lower, self.upper = tuple(place), tuple(lower), tuple(upper)
        (x, y), (left, bottom), (right, top) = ([1e3 * value for value in pair] for pair in (place, lower, upper))
        super().__init__(
            f"a path leads to x {x:.1f} mm, y {y:.1f} mm in the plane of the ply, off the surface from x {left:.1f} to "
            f"{right:.1f} mm and y {bottom:.1f} to {top:.1f} mm; move the seed inwards, or split the ply"
        )


class PathNotFound(TapelayerError):
    """No path can be traced on a smooth surface, however short its steps.

    Args:
        place: x and y of its start, metres, in the plane of the ply.
    """

    def __init__(self, place: Sequence[float]) -> None:
        self.place = tuple(place)
        x, y = (1e3 * value for value in place)
        super().__init__(
            f"the surface is too rough for a path from x {x:.1f} mm, y {y:.1f} mm in the plane of the ply; check the "
            "mould there, or split the ply"
        )


class PitchNotFound(TapelayerError):
    """No pitch keeps the coating as even as requested."""


class ModelRefused(TapelayerError):
    """A URDF cannot serve as the machine: a joint or frame is missing, of the wrong type, or out of place."""


class ConfigurationRefused(TapelayerError):
    """Axis values cannot be evaluated: the columns are not the machine's axes, or a value is not finite."""


class AxisBeyondTravel(TapelayerError):
    """A job needs axes to go beyond their travel; the worst place of each axis is named.

    Args:
        places: (course number, point from 1, axis, value in metres or radians) of each axis's worst place.
        advice: what to do.
    """

    def __init__(self, places: Sequence[tuple[int, int, Travel, float]], advice: str) -> None:
        self.places = tuple(places)
        super().__init__("\n".join(self._sentence(*place) for place in places) + f"\n{advice}")

    @staticmethod
    def _sentence(course: int, point: int, axis: Travel, value: float) -> str:
        scale, unit = (180.0 / math.pi, "deg") if axis.revolute else (1e3, "mm")
        bound = axis.lower if value < axis.lower else axis.upper
        return (
            f"course {course} point {point}: axis {axis.name} would be at {value * scale:.3f} {unit}, beyond its bound "
            f"{bound * scale:g} {unit} (travel {axis.lower * scale:g} to {axis.upper * scale:g})"
        )


class TapeRunsBack(TapelayerError):
    """The tape would have to run back while the shoe presses it down."""


class PartTooHigh(TapelayerError):
    """The head at the top of its travel does not clear the part, so it cannot move between courses."""


class PoseUndefined(TapelayerError):
    """A course point has no roller pose: tangent parallel to normal, or the roller axis would be vertical."""


class TapeWiderThanTravel(TapelayerError):
    """The tape with the knives' clearance is wider than the travel of a slide."""


class BladesMeet(TapelayerError):
    """The blades are longer than the knives' pitch, so the knives cannot pass each other."""


class CoursesRefused(TapelayerError):
    """Courses that cannot be cut from the tape, each with a sentence (the first 20 are written out, then a count).

    Args:
        courses: the refused courses' numbers in their file.
        sentences: what is wrong with each of them, naming the course.
    """

    def __init__(self, courses: Sequence[int], sentences: Sequence[str]) -> None:
        self.courses = tuple(courses)
        lines = list(sentences[:SHOWN_FAULTS])
        more = len(sentences) - SHOWN_FAULTS
        if more > 0:
            lines.append(f"and {more} more course{'s' if more > 1 else ''}")
        super().__init__("\n".join(lines))


class CutAngleTooSmall(CoursesRefused):
    """A cut makes a smaller angle with the tape than the head can cut."""


class CutsCross(CoursesRefused):
    """A course's own two cut lines cross inside the tape."""


class CourseLongerThanRoll(CoursesRefused):
    """A course needs more tape than a new roll holds."""


class NothingToSpray(TapelayerError):
    """The gun can reach no part of a surface."""


class PartBeyondReach(TapelayerError):
    """Most of a surface lies where the gun does not reach it."""


class NotWritable(TapelayerError):
    """A trajectory cannot be expressed in a control's words."""


class VerificationFailed(TapelayerError):
    """A finished program or trajectory failed verification; `evidence` holds every number and failure."""

    exit_code = 1

    def __init__(self, text: str, evidence: object) -> None:
        self.evidence = evidence
        super().__init__(text)


class TargetNotWritable(TapelayerError):
    """An output file cannot be written; any earlier file is left as it was."""


class ServeRefused(TapelayerError):
    """The workbench cannot be served with the given options."""


class WorkDirectoryRefused(TapelayerError):
    """The workbench's work directory cannot be used, or another server uses it."""


class NoNaturalPaths(TapelayerError):
    """Natural paths do not fill the ply: the surface leads one round and round, or brings neighbours together.

    Args:
        what: what happens.
        plan: where, x and y in the ply's plane, metres.
    """

    def __init__(self, what: str, plan: Sequence[float]) -> None:
        super().__init__(
            f"{what} near ({plan[0] * 1e3:.0f}, {plan[1] * 1e3:.0f}) mm in the ply's plane: "
            "the mould is too strongly curved for natural paths; split the ply"
        )
