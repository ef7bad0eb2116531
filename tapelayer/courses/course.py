"""Course: one course of tape, in the part's frame."""

from __future__ import annotations

from dataclasses import dataclass

from tapelayer.geometry.toolpath import Toolpath


@dataclass(frozen=True, eq=False)
class Course(Toolpath):
    """One course of tape, in the part's frame.

    Attributes:
        cut_angles: of the cut at the start and at the end, radians from the direction of travel towards the left.
    """

    cut_angles: tuple[float, float]
