"""Pieces: the courses that a strip is cut into, so that they cover the ply where the strip meets it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from tapelayer.arrays import Floats
from tapelayer.plies.cut_lines import CutLine, cut_pair, end_cut, start_cut
from tapelayer.plies.strip import Strip
from tapelayer.units import MM

# Points of the boundary this far apart, in metres, are held against the cut lines.
BOUNDARY_STEP = 3.0 * MM
# Parts of a strip smaller than this, in square metres, are rounding.
LEAST_AREA = 1e-6
# Cuts at both ends leave at least this much of either edge, metres.
LEAST_EDGE = 1.0 * MM


@dataclass(frozen=True)
class CutRules:
    """What cuts and courses must keep.

    Attributes:
        least_angle: smallest angle of a cut with the tape's edge, radians.
        least_length: of a course, metres.
        least_hole: shortest interruption of a strip that is not laid through, metres.
    """

    least_angle: float
    least_length: float
    least_hole: float

    @property
    def steepest(self) -> float:
        """Greatest slope of a cut line.

        Examples:
            >>> round(CutRules(math.radians(45.0), 0.1, 0.1).steepest, 9)
            1.0
        """
        return 1.0 / math.tan(self.least_angle)


@dataclass(frozen=True)
class Piece:
    """A course of a strip, between two cuts.

    Attributes:
        strip: index of the strip, from right to left.
        start: the cut at its start along the strip.
        end: the cut at its end along the strip.
        lengthened: metres that were added at either end, to make it long enough.
        laid_through: holes that it covers.
        backwards: whether it is laid against the strip's direction.
    """

    strip: int
    start: CutLine
    end: CutLine
    lengthened: float = 0.0
    laid_through: int = 0
    backwards: bool = False

    @property
    def length(self) -> float:
        """Length of its centre line, metres.

        Examples:
            >>> Piece(0, CutLine(0.25, 0.0), CutLine(1.0, 0.5)).length
            0.75
        """
        return self.end.offset - self.start.offset

    @property
    def cut_angles(self) -> tuple[float, float]:
        """Angles of the first and the last cut as it is laid, radians from the travel towards the left.

        A half turn of the travel keeps a line's angle to it.
        """
        angles = self.start.angle, self.end.angle
        return angles[::-1] if self.backwards else angles


def pieces_of(strip: Strip, index: int, target: shapely.Polygon, rules: CutRules) -> tuple[Piece, ...]:
    """Return the pieces of a strip that cover a target in plan, in the strip's order.

    Args:
        strip: the strip.
        index: its number from the right.
        target: what is to be covered, in plan.
        rules: of cuts and lengths.
    """
    parts = [_coordinates(strip, part) for part in _parts(strip.polygon().intersection(target))]
    parts.sort(key=lambda part: float(np.min(part[0])))
    return tuple(_piece(strip, index, group, rules) for group in _groups(strip, parts, rules))


def _parts(met: shapely.Geometry) -> Iterator[shapely.Polygon]:
    """Yield the polygons of a geometry that are no rounding."""
    for part in getattr(met, "geoms", [met]):
        if part.geom_type == "Polygon" and part.area > LEAST_AREA:
            yield part


def _coordinates(strip: Strip, part: shapely.Polygon) -> tuple[Floats, Floats]:
    """Return the strip coordinates (n,) and (n,) of the boundary of a part."""
    ring = shapely.get_coordinates(shapely.segmentize(part.exterior, BOUNDARY_STEP))
    return strip.coordinates(ring[:-1])


def _groups(strip: Strip, parts: Sequence[tuple[Floats, Floats]], rules: CutRules) -> list[list[tuple[Floats, Floats]]]:
    """Return parts gathered into courses: those with less than a hole between them are one."""
    groups: list[list[tuple[Floats, Floats]]] = []
    half = strip.width / 2.0
    for part in parts:
        if groups:
            before = end_cut(*_joined(groups[-1]), rules.steepest)
            after = start_cut(*part, rules.steepest)
            if min(after.at(across) - before.at(across) for across in (-half, half)) < rules.least_hole:
                groups[-1].append(part)
                continue
        groups.append([part])
    return groups


def _joined(parts: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    return np.concatenate([arcs for arcs, _ in parts]), np.concatenate([across for _, across in parts])


def _piece(strip: Strip, index: int, parts: Sequence[tuple[Floats, Floats]], rules: CutRules) -> Piece:
    start, end, added = cut_pair(*_joined(parts), rules.steepest, strip.width, rules.least_length, LEAST_EDGE)
    return Piece(index, start, end, lengthened=added, laid_through=len(parts) - 1)
