"""Laid: a course as a program lays it."""

from __future__ import annotations

from dataclasses import dataclass

from tapelayer.arrays import Floats


@dataclass(frozen=True, eq=False)
class Laid:
    """A course as the program lays it.

    Attributes:
        number: in its file.
        points: in its file.
        cut_angles: (start, end) radians from travel towards the left.
        length: metres.
        station: of its start on the tape, metres, by the tape fed.
        begin: seconds at which its laying begins.
        end: seconds at which it ends.
        out: (3,) unit tangent at its end, `machine` axes.
    """

    number: int
    points: int
    cut_angles: tuple[float, float]
    length: float
    station: float
    begin: float
    end: float
    out: Floats
