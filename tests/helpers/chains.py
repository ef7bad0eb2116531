"""A small machine's chains of blocks, and controls that pass them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits, timed
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.trajectories import straight

AXES = ("x", "y", "z", "c", "u", "v")
PATHS = ((0, 1, 2), (4, 5), (3,))
LIMITS = Limits(
    speed=np.array([1.0, 1.0, 0.5, 120 * DEG, 1.0, 1.0]),
    acceleration=np.array([1.5, 1.5, 1.0, 1000 * DEG, 3.0, 5.0]),
    jerk=np.full(6, np.inf),
)
LINUXCNC = Rule("linuxcnc", PATHS, rotary=frozenset({3}), drain=6e-3)
LOOK_AHEAD = Rule("look_ahead", PATHS, rotary=frozenset({3}), tolerance=0.02 * MM)
STOP = Rule("stop", PATHS, rotary=frozenset({3}))
RULES = (STOP, LINUXCNC, LOOK_AHEAD)


def run(steps: list[dict[str, float]], speed: float = 0.25, tolerance: float = 0.0) -> Trajectory:
    """Feed blocks of steps in metres and radians, each asked for at a speed along X Y Z, else along U V."""
    moved = np.array([[step.get(axis, 0.0) for axis in AXES] for step in steps])
    return at_feed(moved, np.full(len(moved), speed), np.full(len(moved), tolerance))


def at_feed(steps: np.ndarray, speeds: np.ndarray, tolerances: np.ndarray) -> Trajectory:
    """Feed blocks of steps (n, k) at path speeds (n,), rounded off by tolerances (n,)."""
    lengths = np.zeros(len(steps))
    for group in PATHS:
        lengths = np.where(lengths > 0.0, lengths, np.linalg.norm(steps[:, list(group)], axis=1))
    return straight(AXES, np.cumsum(steps, axis=0), lengths / speeds, tolerances)


def by(rule: Rule, trajectory: Trajectory, limits: Limits = LIMITS) -> Trajectory:
    """The trajectory with the times of a control."""
    return timed(trajectory, limits, rule)


@st.composite
def chains(draw: st.DrawFn, stops: bool = True) -> Trajectory:
    """Two to a dozen feeds, rapids and dwells, short and long, in all axes or a few."""
    count = draw(st.integers(2, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sizes = 10.0 ** rng.uniform(-4.0, -0.5, (count, 1))
    way = np.cumsum(rng.normal(0.0, draw(st.sampled_from([0.0, 0.01, 0.3, 2.0])), (count, 6)), axis=0) + [
        1,
        0.5,
        0.2,
        0.3,
        1,
        0.4,
    ]
    chosen = np.array(draw(st.lists(st.booleans(), min_size=6, max_size=6)), dtype=float)
    if not np.any(chosen):
        chosen[0] = 1.0
    steps = sizes * way * chosen
    trajectory = at_feed(steps, rng.uniform(0.01, 0.8, count), np.where(rng.random(count) < 0.8, 0.04 * MM, 0.0))
    kinds = np.full(count, Kind.LINEAR, np.uint8)
    seconds, positions = trajectory.durations.copy(), trajectory.positions.copy()
    if stops:
        kinds[rng.random(count) < 0.2] = Kind.RAPID
        for row in 1 + np.flatnonzero(rng.random(count - 1) < 0.15):
            kinds[row], seconds[row] = Kind.DWELL, 0.3
            positions[row:] -= steps[row]
    return straight(AXES, positions, seconds, trajectory.tolerances, kinds=kinds)
