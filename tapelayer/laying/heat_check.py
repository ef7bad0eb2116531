"""Heat check: how much longer the lit heater stands over the tape than laying at the set speed takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.laying.sampling import Laying
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits, at_reach
from tapelayer.motion.trajectory import Trajectory
from tapelayer.verification.switching import HELD, Switch, held

# On tight curves the tape is slower than the set speed of what moves fastest: longer by this share is no creeping.
SLOWER = 0.25
# Seconds that a stretch may take on top, for the rounding of its times and for knives that stop the tape for a moment.
MOMENTS = 0.05


def heated_too_long(
    trajectory: Trajectory,
    layings: Sequence[Laying],
    heater: Switch,
    lay_speed: float,
    axes: Limits,
    rule: Rule,
    allowed: float,
) -> Floats:
    """Return the seconds (n,) by which the stretch of tape that ends with each block is heated longer than it must be.

    A stretch is any run of blocks of one course with the heater on. It must take its length over the laying speed, that
    of the tape or of the slides' way, or the time that the axes need for it, if that is longer; on a control that looks
    ahead that at the speed that a block reaches. Of all stretches that end with a block the worst counts; 0 where no
    tape is heated.

    Args:
        trajectory: with every position and time known while tape is laid.
        layings: of the courses.
        heater: its words and delay.
        lay_speed: set speed, m/s.
        axes: limits of these.
        rule: of the control.
        allowed: seconds; what a control reaches is worked out only where a stretch would otherwise take longer.
    """
    rows = np.arange(len(trajectory))
    laid = np.zeros(len(trajectory), np.bool_)
    for laying in layings:
        # The block in which the shoe goes down ends a stretch, so that courses do not join.
        laid[laying.first + 1 : laying.last] = True
    lit = np.where(laid, np.clip(held(trajectory, heater), 0.0, 1.0), 0.0)
    steps = np.nan_to_num(np.abs(trajectory.positions - trajectory.begins(rows)))
    slides = steps[:, [trajectory.column(name) for name in "xyz"]]
    lengths = np.maximum(steps[:, trajectory.column("u")], np.sqrt(np.sum(slides * slides, axis=1)))
    needed = np.maximum(lengths / lay_speed, np.max(steps / axes.speed, axis=1))
    longer = _longer(lit, trajectory.requested, np.where(laid, needed, 0.0))
    if np.max(longer, initial=0.0) <= allowed:
        return longer
    reached = at_reach(trajectory, np.where(laid, needed, np.inf), axes, rule)
    return _longer(lit, trajectory.requested, np.where(laid, reached, 0.0))


def _longer(lit: Floats, asked: Floats, needed: Floats) -> Floats:
    """Return the seconds (n,) by which the worst stretch that ends with each block takes longer than it must.

    Args:
        lit: (n,) share of each block with the heater on.
        asked: (n,) seconds that the words ask for: how the control passes from block to block is judged by its stops.
        needed: (n,) seconds.
    """
    excess = lit * (asked - (1.0 + SLOWER) * needed)
    # Where the heater is off, so large a loss that no stretch reaches across it.
    heated = np.cumsum(np.where(lit > HELD, excess, -1.0 - np.sum(asked)))
    before = np.minimum.accumulate(np.append(0.0, heated[:-1]))
    longer: Floats = np.maximum(heated - before, 0.0)
    return longer
