"""Trajectories that differ from a good one in one thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tapelayer.motion.trajectory import Kind, Trajectory

Rows = np.ndarray | slice | list[int] | int
COLUMNS = ("positions", "kinds", "durations", "events", "courses", "stated", "lines", "tolerances")


def untimed(trajectory: Trajectory) -> Trajectory:
    """The trajectory with the seconds that its words ask for, as before the time law: what is changed has no clock."""
    return replace(trajectory, durations=trajectory.requested, asked=None, clock=None)


def reordered(trajectory: Trajectory, order: np.ndarray) -> Trajectory:
    """The trajectory with its blocks in another order."""
    return replace(untimed(trajectory), **{name: getattr(untimed(trajectory), name)[order] for name in COLUMNS})


def moved(trajectory: Trajectory, rows: Rows, axis: str, by: float) -> Trajectory:
    """The trajectory with an axis off by a distance (m or rad) at some blocks."""
    positions = trajectory.positions.copy()
    positions[rows, trajectory.column(axis)] += by
    return replace(untimed(trajectory), positions=positions)


def without(trajectory: Trajectory, rows: Rows) -> Trajectory:
    """The trajectory without some blocks."""
    asked = untimed(trajectory)
    return replace(asked, **{name: np.delete(getattr(asked, name), rows, axis=0) for name in COLUMNS})


def changed(trajectory: Trajectory, name: str, rows: Rows, value: float) -> Trajectory:
    """The trajectory with another value in one of its columns at some blocks."""
    asked = untimed(trajectory)
    values = getattr(asked, name).copy()
    values[rows] = value
    return replace(asked, **{name: values})


def straight(
    axes: tuple[str, ...],
    ends: np.ndarray,
    seconds: np.ndarray | float = 0.0,
    tolerances: np.ndarray | float = 0.0,
    start: np.ndarray | None = None,
    kinds: np.ndarray | int = Kind.LINEAR,
) -> Trajectory:
    """Blocks that end at positions (n, k), each asked for in so many seconds and rounded off by so many metres."""
    count, k = ends.shape
    return Trajectory(
        axes=axes,
        start=np.zeros(k) if start is None else start,
        positions=ends,
        kinds=np.broadcast_to(np.asarray(kinds, np.uint8), count),
        durations=np.broadcast_to(np.asarray(seconds, np.float64), count),
        events=np.zeros(count, np.uint8),
        courses=np.zeros(count, np.int32),
        stated=np.zeros(count, np.uint16),
        lines=np.zeros(count, np.int32),
        tolerances=np.broadcast_to(np.asarray(tolerances, np.float64), count),
    )
