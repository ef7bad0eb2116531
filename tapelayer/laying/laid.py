"""Laid: courses as a program lays them, and the case that their cuts and links make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tapelayer.arrays import Floats, Frozen
from tapelayer.laying.evidence import Samples
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Laid(Frozen):
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


@dataclass(frozen=True, eq=False)
class Case:
    """What the cuts of a program, and its links from course to course, are judged by.

    Attributes:
        trajectory: planned, or read back from a program; every axis stated before the first feed.
        courses: as the program lays them, in order.
        samples: along these courses.
        highest: z of the highest course point, `machine` axes, metres.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        digits: (k,) last written digit of each axis, metres and radians; 0 where there is none.
    """

    trajectory: Trajectory
    courses: Sequence[Laid]
    samples: Samples
    highest: float
    setup: Setup
    machine: Machine
    digits: Floats

    @cached_property
    def fed(self) -> Floats:
        """Return the tape fed (n + 1,) at the program's start and every block's end, metres; NaN where unknown."""
        u = self.trajectory.column("u")
        return np.append(self.trajectory.start[u], self.trajectory.positions[:, u])
