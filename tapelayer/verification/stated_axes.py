"""Stated axes: where a program leaves its position or its time unknown, so that nothing can be measured on it."""

from __future__ import annotations

import numpy as np

from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.verification.breach import Breach

UNSTATED = "unstated_axes"
UNTIMED = "block_time_s"


def unknown_blocks(trajectory: Trajectory) -> list[Breach]:
    """Return the first block, if any, that leaves a position unknown, and the first whose time is no time.

    A position is unknown in a block that is not a rapid and comes before every axis has been stated, in one that states
    an axis or comes after one that did without having its value, and where a circle has no centre. A time is a finite
    number of seconds, 0 or more.
    """
    positions = trajectory.positions
    unknown = ~np.isfinite(positions)
    written = (trajectory.stated[:, None] >> np.arange(positions.shape[1])) & 1 > 0
    forgotten = unknown & np.logical_or.accumulate(written | ~unknown, axis=0)
    lost = np.any(forgotten, axis=1) | (np.any(unknown, axis=1) & (trajectory.kinds != Kind.RAPID))
    uncentred = np.zeros(len(trajectory), np.bool_)
    circular = np.flatnonzero(np.isin(trajectory.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    if len(circular) and trajectory.centres is not None:
        arcs = trajectory.arcs(circular)
        uncentred[circular] = ~np.all(np.isfinite(arcs.centres), axis=1)
    untimed = ~((trajectory.durations >= 0.0) & np.isfinite(trajectory.durations))
    breaches = []
    if np.any(lost):
        row = int(np.argmax(lost))
        breaches.append(Breach(row, UNSTATED, int(np.sum(unknown[row])), 0))
    if np.any(uncentred):
        breaches.append(Breach(int(np.argmax(uncentred)), "circle_centre_mm", np.nan, 0.0))
    if np.any(untimed):
        row = int(np.argmax(untimed))
        breaches.append(Breach(row, UNTIMED, float(trajectory.durations[row]), 0.0))
    return breaches
