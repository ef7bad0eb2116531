"""Switching: whether switching words come in pairs, and what a program does while a switch is on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.verification.breach import Breach

# A switch that is on for at most this share of a block's time counts as off in it.
HELD = 1e-3


@dataclass(frozen=True)
class Switch:
    """Something that a program switches on and off.

    Attributes:
        name: as in the report's keys.
        on: the word that switches it on.
        off: the word that switches it off.
        delay: milliseconds from a word to its effect; None where only the words count.
    """

    name: str
    on: Event
    off: Event
    delay: float | None = None

    def words(self, trajectory: Trajectory) -> Ints:
        """Return the blocks (w,) that hold its words."""
        return np.flatnonzero((trajectory.events == self.on) | (trajectory.events == self.off))


def unpaired(trajectory: Trajectory, switch: Switch) -> list[Breach]:
    """Return the first word that repeats the one before it, or else the last word if it leaves the switch on."""
    rows = switch.words(trajectory)
    on = trajectory.events[rows] == switch.on
    wrong = np.flatnonzero(on != (np.arange(len(rows)) % 2 == 0))
    if len(wrong):
        return [Breach(int(rows[wrong[0]]), f"{switch.name}_switched_again", 1, 0)]
    return [Breach(int(rows[-1]), f"{switch.name}_left_on", 1, 0)] if len(rows) % 2 else []


def interrupted(trajectory: Trajectory, switch: Switch, whats: Iterable[str]) -> list[Breach]:
    """Return the first rapid, pause or stop during which a switch is on, for each kind that `whats` names."""
    on = still_on(trajectory, switch)
    where = {
        "rapid": trajectory.kinds == Kind.RAPID,
        "pause": trajectory.kinds == Kind.DWELL,
        "stop": trajectory.events == Event.STOP,
    }
    hits = [(what, np.flatnonzero(on & where[what])) for what in whats]
    return [Breach(int(rows[0]), f"{what}_with_{switch.name}_on", 1, 0) for what, rows in hits if len(rows)]


def still_on(trajectory: Trajectory, switch: Switch) -> Mask:
    """Return where (n,) a switch is on, from its word on until the effect of its word off."""
    changes = (trajectory.events == switch.on).astype(np.int64) - (trajectory.events == switch.off)
    on: Mask = np.cumsum(changes) > 0
    return on if switch.delay is None else on | (held(trajectory, switch) > HELD)


def held(trajectory: Trajectory, switch: Switch) -> Floats:
    """Return the share (n,) of each block's time during which a switch is on, delay included."""
    times = trajectory.times[switch.words(trajectory)]
    # A switch left on stays on to the end.
    times = np.append(times, trajectory.duration)[: len(times) + len(times) % 2] + (switch.delay or 0.0) * 1e-3
    if not len(times):
        return np.zeros(len(trajectory))
    spent = np.cumsum(np.diff(times) * (np.arange(len(times) - 1) % 2 == 0))
    until = np.interp(trajectory.times, times, np.append(0.0, spent))
    shares: Floats = np.diff(until, prepend=0.0) / np.where(trajectory.durations > 0.0, trajectory.durations, 1.0)
    return shares
