"""Wrists of the sprayer with other travel."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.machines.wrist import Wrist
from tests.helpers.machines import sprayer

PRINTED = (0.0, 360.0)


WIDE = (-180.0, 540.0)


SPECIAL = np.radians(np.arange(0, 360, 15))


def wrist_of(
    theta: tuple[float, float] = PRINTED,
    phi: tuple[float, float] = (0.0, 90.0),
    speed: float = 0.3,
    deviation: float = 15.0,
) -> Wrist:
    """The sprayer's wrist with travel and deviation in degrees and the gun's speed in m/s."""
    machine = sprayer().with_limits(
        {name: (math.radians(low), math.radians(high)) for name, (low, high) in {"theta": theta, "phi": phi}.items()},
        {},
    )
    return Wrist(machine.axis("theta"), machine.axis("phi"), speed, math.radians(deviation))


def leans_of(wrist: Wrist, normals: Floats) -> Floats:
    return np.full(len(normals), wrist.max_deviation)
