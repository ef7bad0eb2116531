"""Forward check: Pinocchio itself against the batch evaluator, on which every other measurement relies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.machines.machine import Machine

# Pinocchio evaluates at most this many poses, evenly selected.
PINOCCHIO_BLOCKS = 20_000
# Largest allowed difference between the two, in metres.
PINOCCHIO_AGREEMENT = 1e-9


def forward_disagreement(machine: Machine, joints: Floats, frames: Sequence[str]) -> float:
    """Return the largest difference between Pinocchio and the batch evaluator in an entry of a pose, in metres.

    Args:
        machine: the machine.
        joints: (n, k) values of all its axes at block ends, metres and radians.
        frames: whose poses are compared.
    """
    if not len(joints):
        return 0.0
    chosen = joints[np.linspace(0, len(joints) - 1, min(len(joints), PINOCCHIO_BLOCKS)).astype(np.int64)]
    return max(
        float(np.max(np.abs(machine.forward_pinocchio(chosen, frame) - machine.forward(chosen, frame))))
        for frame in frames
    )
