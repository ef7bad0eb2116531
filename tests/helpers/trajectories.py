"""Trajectories that differ from a good one in one thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tapelayer.motion.trajectory import Trajectory

Rows = np.ndarray | slice | list[int] | int
COLUMNS = ("positions", "kinds", "durations", "events", "courses", "stated", "lines")


def moved(trajectory: Trajectory, rows: Rows, axis: str, by: float) -> Trajectory:
    """The trajectory with an axis off by a distance (m or rad) at some blocks."""
    positions = trajectory.positions.copy()
    positions[rows, trajectory.column(axis)] += by
    return replace(trajectory, positions=positions)


def without(trajectory: Trajectory, rows: Rows) -> Trajectory:
    """The trajectory without some blocks."""
    return replace(trajectory, **{name: np.delete(getattr(trajectory, name), rows, axis=0) for name in COLUMNS})


def changed(trajectory: Trajectory, name: str, rows: Rows, value: float) -> Trajectory:
    """The trajectory with another value in one of its columns at some blocks."""
    values = getattr(trajectory, name).copy()
    values[rows] = value
    return replace(trajectory, **{name: values})
