"""Laid: courses as a program lays them, and the case in which their cuts and links are judged."""

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
        number: its number in the file.
        points: its number of points in the file.
        cut_angles: (start, end) radians from travel towards the left.
        length: metres.
        station: station of its start, metres, from the tape fed.
        begin: time at which its laying begins, seconds.
        end: time at which its laying ends, seconds.
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
    """Everything that the cuts of a program and its links from course to course are judged by.

    Attributes:
        trajectory: planned, or read back from a program; every axis stated before the first feed.
        courses: the courses as the program lays them, in order.
        samples: the samples along these courses.
        highest: z of the highest course point, `machine` axes, metres.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        digits: (k,) last written digit of each axis, metres and radians; 0 where nothing was written.
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
