"""Trajectories made by hand, block by block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.motion.trajectory import Event, Kind, Trajectory


def said(*words: Event | float | tuple[Kind, float]) -> Trajectory:
    """Words, and between them motions along x of so many seconds, linear where no kind is given."""
    blocks = []
    for word in words:
        if isinstance(word, Event):
            blocks.append((Kind.SWITCH, 0.0, word))
        else:
            kind, seconds = word if isinstance(word, tuple) else (Kind.LINEAR, word)
            blocks.append((kind, seconds, Event.NONE))
    kinds, durations, events = zip(*blocks, strict=True)
    return driven(np.cumsum(durations)[:, None], "x", kinds=kinds, durations=durations, events=events)


def driven(
    positions: object,
    axes: Sequence[str],
    *,
    kinds: Sequence[Kind] = (),
    durations: Sequence[float] = (),
    events: Sequence[Event] = (),
    start: float = 0.0,
) -> Trajectory:
    """Axes through positions (n, k), in metres and radians; a second each and linear where nothing else is given."""
    rows = np.array(positions, dtype=np.float64)
    count = len(rows)
    return Trajectory(
        axes=tuple(axes),
        start=np.full(len(axes), start),
        positions=rows,
        kinds=np.array(kinds or [Kind.LINEAR] * count, np.uint8),
        durations=np.array(durations or [1.0] * count),
        events=np.array(events or [Event.NONE] * count, np.uint8),
        courses=np.zeros(count, np.int32),
        stated=np.zeros(count, np.uint16),
        lines=np.arange(1, count + 1, dtype=np.int32),
    )
