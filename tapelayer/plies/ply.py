"""Ply: what a ply file says of one layer on its mould.

Fields are in the units of their names (mm, deg, percent); what computes takes the properties in SI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from tapelayer.errors import PlyRefused
from tapelayer.setups.sections import NotNegative, Number, Positive, Section, Settings, parse_setup, read_setup
from tapelayer.units import DEG, METRES, MM, Unit

# The boundary that is the mould's own.
EDGE = "edge"
LEAST_POINTS = 3


def corners_of(points: Sequence[Sequence[float]]) -> list[int]:
    """Return the indices of the points of a closed line, but for those that repeat the one before them.

    The last point repeats the first one where it is the same.

    Examples:
        >>> corners_of([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0]])
        [0, 1, 3]
    """
    kept = [number for number, point in enumerate(points) if not number or point != points[number - 1]]
    return kept[:-1] if len(kept) > 1 and points[kept[-1]] == points[0] else kept


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))


def _point(value: object) -> object:
    if not _is_point(value):
        raise ValueError(f"expected [x, y, z], three finite numbers, got {_shown(value)}")
    return value


def _loop(value: object) -> object:
    """Return a list of points, or say of all of them at once what is wrong."""
    if not isinstance(value, list):
        raise ValueError(f"expected a list of points [x, y, z], got {_shown(value)}")
    wrong = [number for number, point in enumerate(value, 1) if not _is_point(point)]
    if wrong:
        point = f"point {wrong[0]}" if len(wrong) == 1 else f"{len(wrong)} points, first point {wrong[0]}"
        raise ValueError(f"{point}: expected [x, y, z], three finite numbers, got {_shown(value[wrong[0] - 1])}")
    count = len(corners_of(value))
    if count < LEAST_POINTS:
        raise ValueError(f"it has {count} point{'' if count == 1 else 's'}, expected at least {LEAST_POINTS}")
    return value


def _boundary(value: object) -> object:
    if isinstance(value, str) and value:
        return value
    if not isinstance(value, list):
        raise ValueError(f"expected 'edge', points [x, y, z] or the name of a file, got {_shown(value)}")
    return _loop(value)


def _holes(value: object) -> object:
    if not isinstance(value, list):
        raise ValueError(f"expected a list of holes, each a list of points [x, y, z], got {_shown(value)}")
    for number, hole in enumerate(value, 1):
        try:
            _loop(hole)
        except ValueError as error:
            raise ValueError(f"hole {number}: {error}") from None
    return value


def _direction(value: list[float]) -> list[float]:
    if not math.hypot(*value) > 0:
        raise ValueError(f"expected a direction [x, y, z] that is not zero, got {value}")
    return value


def _shown(value: object) -> str:
    shown = repr(value)
    return shown if len(shown) <= 40 else f"{shown[:37]}..."


Point = Annotated[list[float], BeforeValidator(_point)]
Loop = list[list[float]]


class MouldSettings(Section, title="Mould"):
    """The surface that the ply lies on."""

    file: Annotated[
        str,
        Field(description="the mould's surface, an STL, STEP or IGES file; from the folder of this file", min_length=1),
    ]
    unit: Annotated[
        Unit, Field(description="unit of its numbers: mm | cm | m | in; boundary points are in it, too")
    ] = "mm"


class PlySettings(Section, title="Ply"):
    """One layer: its direction and where it ends."""

    angle_deg: Annotated[
        Number, Field(description="angle of the tape to the rosette, to its left seen from outside the mould")
    ]
    rosette: Annotated[
        Point,
        AfterValidator(_direction),
        Field(description="direction [x, y, z] from which the angle is measured, turned into the surface"),
    ] = [0.0, 1.0, 0.0]
    seed: Annotated[
        Point | None,
        Field(description="point [x, y, z] where the first course has the angle; without it the boundary's middle"),
    ] = None
    boundary: Annotated[
        str | Loop,
        BeforeValidator(_boundary),
        Field(description="edge: the mould's own; or points [[x, y, z], ...]; or a file of points or DXF polylines"),
    ] = EDGE
    holes: Annotated[
        list[Loop], BeforeValidator(_holes), Field(description="points [[x, y, z], ...] around each hole of the ply")
    ] = []
    inset_mm: Annotated[NotNegative, Field(description="the boundary is moved inwards by this, in plan")] = 0.0
    margin_mm: Annotated[NotNegative, Field(description="tape wanted beyond the boundary (net-plus)")] = 0.0


class PlyTapeSettings(Section, title="Tape"):
    """The material."""

    width_mm: Annotated[Positive, Field(description="width of the tape")] = 75.0
    thickness_mm: Annotated[Positive, Field(description="thickness of the laid ply")] = 0.15


class GapSettings(Section, title="Gap"):
    """Gaps between neighbouring courses."""

    least_mm: Annotated[Number, Field(description="least gap; below 0 it allows as much overlap")] = 0.0
    nominal_mm: Annotated[Number, Field(description="gap aimed at where the surface allows it")] = 0.5
    largest_mm: Annotated[Number, Field(description="largest gap")] = 2.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        least, nominal, largest = self.least_mm, self.nominal_mm, self.largest_mm
        if least > largest:
            raise ValueError(f"least_mm is {least:g}, above largest_mm {largest:g}; lower it")
        if not least <= nominal <= largest:
            raise ValueError(f"nominal_mm is {nominal:g}, expected least_mm {least:g} to largest_mm {largest:g}")
        return self


class CourseSettings(Section, title="Courses"):
    """How strips become courses."""

    minimum_length_mm: Annotated[NotNegative, Field(description="shorter courses are lengthened at both ends")] = 100.0
    minimum_hole_mm: Annotated[NotNegative, Field(description="shorter interruptions of a course are laid through")] = (
        100.0
    )
    minimum_cut_angle_deg: Annotated[
        Positive, Field(description="smallest angle between a cut and the tape's edge", lt=90)
    ] = 15.0
    stagger_mm: Annotated[Number, Field(description="shift of all courses to the left of their direction")] = 0.0
    order: Annotated[
        Literal["one_way", "there_and_back"],
        Field(description="one_way: all courses in the ply's direction; there_and_back: every other one against it"),
    ] = "one_way"
    start_corner: Annotated[
        Literal["right", "left"], Field(description="side of the first course, seen along the ply's direction")
    ] = "right"
    reverse: Annotated[bool, Field(description="lay the courses against the ply's direction", strict=True)] = False
    point_spacing_mm: Annotated[Positive, Field(description="largest distance of a course's points")] = 10.0


class LimitSettings(Section, title="Limits"):
    """What a plan must keep."""

    max_strain_percent: Annotated[Positive, Field(description="strain of the tape's edges")] = 0.2
    max_lift_mm: Annotated[Positive, Field(description="sag of the surface under a straight roller")] = 2.0
    max_gap_mm: Annotated[Number | None, Field(description="gap between courses; without it [gap] largest_mm")] = None
    max_overlap_mm: Annotated[
        Number | None, Field(description="overlap of courses; without it [gap] least_mm with the other sign")
    ] = None
    max_angle_deviation_deg: Annotated[Positive, Field(description="courses off the ply's angle")] = 5.0
    max_surface_residual_mm: Annotated[
        Positive, Field(description="the smooth surface off the mould's corners of facets")
    ] = 0.1
    max_surface_ambiguity_mm: Annotated[
        Positive, Field(description="courses moved by another smooth surface through the same mould")
    ] = 0.2
    max_off_mould_mm: Annotated[
        NotNegative | None, Field(description="courses beyond the mould's edge; without it half the tape's width")
    ] = None


class Ply(Settings):
    """Everything that a ply needs beside its mould's facets."""

    CALLED = "the ply file"
    REFUSED = PlyRefused
    FILES = (("mould", "file"), ("ply", "boundary"))
    NO_FILES = frozenset({EDGE})

    mould: Annotated[MouldSettings, Field(description="the surface that the ply lies on")]
    ply: Annotated[PlySettings, Field(description="the layer: its direction and where it ends")]
    tape: Annotated[PlyTapeSettings, Field(description="the material")] = PlyTapeSettings()
    gap: Annotated[GapSettings, Field(description="gaps between neighbouring courses")] = GapSettings()
    courses: Annotated[CourseSettings, Field(description="how strips become courses")] = CourseSettings()
    limits: Annotated[LimitSettings, Field(description="what a plan must keep")] = LimitSettings()

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Return the ply in a file, with the files that it names relative to its folder.

        Raises:
            PlyRefused: as `read_ply`.
        """
        return read_setup(path, cls)

    @property
    def boundary_file(self) -> Path | None:
        """Return the file that the boundary is in; None where it is the mould's edge or a list of points."""
        boundary = self.ply.boundary
        return Path(boundary) if isinstance(boundary, str) and boundary != EDGE else None

    @property
    def metres(self) -> float:
        """Return metres in the unit of the mould and of the points."""
        return METRES[self.mould.unit]

    @property
    def angle(self) -> float:
        """Return the angle to the rosette in radians."""
        return self.ply.angle_deg * DEG

    @property
    def width(self) -> float:
        """Return the tape's width in metres."""
        return self.tape.width_mm * MM

    @property
    def max_gap(self) -> float:
        """Return the largest allowed gap in metres."""
        return (self.gap.largest_mm if self.limits.max_gap_mm is None else self.limits.max_gap_mm) * MM

    @property
    def max_overlap(self) -> float:
        """Return the largest allowed overlap in metres; below 0 where every gap has to be open."""
        return (-self.gap.least_mm if self.limits.max_overlap_mm is None else self.limits.max_overlap_mm) * MM

    @property
    def max_off_mould(self) -> float:
        """Return how far a course may run beyond the mould's edge, in metres."""
        beyond = self.limits.max_off_mould_mm
        return (self.tape.width_mm / 2 if beyond is None else beyond) * MM

    def sha256(self, mould: bytes, boundary: bytes | None = None) -> str:
        """Return the SHA-256 of the effective values in hexadecimal; files count by content, not by path.

        Args:
            mould: the bytes of the mould's file.
            boundary: those of the boundary's; None where it is in none.
        """
        files = {("mould", "file"): mould}
        if boundary is not None:
            files["ply", "boundary"] = boundary
        return self.digest(files)


def read_ply(path: Path | str) -> Ply:
    """Return the ply in a file, with the files that it names relative to its folder.

    Raises:
        PlyRefused: the file is missing, not TOML, or has unknown keys or values out of range; all faults at once.
    """
    return read_setup(path, Ply)


def parse_ply(data: bytes, name: str) -> Ply:
    r"""Return the ply in the bytes of a file, with the files that it names relative to its folder.

    Args:
        data: the file's bytes.
        name: the file as the user named it.

    Raises:
        PlyRefused: as `read_ply`.

    Examples:
        >>> ply = parse_ply(b'[mould]\nfile = "hood.stl"\n[ply]\nangle_deg = 45\n', "plies/one.toml")
        >>> ply.mould.file, ply.ply.boundary, ply.tape.width_mm
        ('plies/hood.stl', 'edge', 75.0)
        >>> parse_ply(b'[mould]\nfile = "hood.stl"\n[ply]\nangle = 45\n', "one.toml")
        Traceback (most recent call last):
            ...
        tapelayer.errors.PlyRefused: one.toml:3: [ply] angle_deg is missing
        one.toml:4: unknown key angle in [ply]; did you mean angle_deg?
    """
    return parse_setup(data, name, Ply)
