"""Stated axes: a program must state every axis before its first feed motion."""

from __future__ import annotations

import numpy as np

from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.verification.breach import Breach

UNSTATED = "unstated_axes"


def unstated_axes(trajectory: Trajectory) -> list[Breach]:
    """Return the first block, if any, that is not a rapid and comes before every axis has been stated."""
    unknown = np.isnan(trajectory.positions)
    lost = np.any(unknown, axis=1) & (trajectory.kinds != Kind.RAPID)
    if not np.any(lost):
        return []
    row = int(np.argmax(lost))
    return [Breach(row, UNSTATED, int(np.sum(unknown[row])), 0)]
