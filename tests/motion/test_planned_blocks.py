"""Planned blocks know their times, and become a trajectory whole."""

from __future__ import annotations

import numpy as np

from tapelayer.motion.planned_blocks import PlannedBlocks, dwell_block, feed_blocks, rapid_blocks, switch_block
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event, Kind

LIMITS = Limits.speeds(np.array([0.5, 2.0]))
NOWHERE = np.full(2, np.nan)
NODES = np.array([[1.0, 0.0], [1.0, 1.0]])


def test_motions_take_what_the_time_law_says() -> None:
    assert rapid_blocks(NOWHERE, NODES, LIMITS).durations.tolist() == [0.0, 0.5]
    assert rapid_blocks(np.zeros(2), NODES, LIMITS).durations.tolist() == [2.0, 0.5]
    assert feed_blocks(np.zeros(2), NODES, LIMITS, np.array([0.0, 3.0])).durations.tolist() == [2.0, 3.0]


def test_joined_blocks_become_a_trajectory() -> None:
    planned = PlannedBlocks.joined(
        [
            rapid_blocks(NOWHERE, NODES, LIMITS).stating(1, 3),
            switch_block(NODES[1], Event.ARC_ON),
            dwell_block(NODES[1], 0.25),
            feed_blocks(NODES[1], NODES[:1], LIMITS, np.zeros(1)),
        ]
    )
    trajectory = planned.trajectory(("x", "y"), np.array([0, 0, 0, 1, 1]))
    assert trajectory.axes == ("x", "y") and np.all(np.isnan(trajectory.start))
    assert trajectory.positions.tolist() == [NODES[0].tolist(), *[NODES[1].tolist()] * 3, NODES[0].tolist()]
    assert trajectory.kinds.tolist() == [Kind.RAPID, Kind.RAPID, Kind.SWITCH, Kind.DWELL, Kind.LINEAR]
    assert trajectory.durations.tolist() == [0.0, 0.5, 0.0, 0.25, 0.5]
    assert trajectory.events.tolist() == [0, 0, Event.ARC_ON, 0, 0]
    assert trajectory.courses.tolist() == [0, 0, 0, 1, 1]
    assert trajectory.stated.tolist() == [0, 3, 0, 0, 0]
    assert trajectory.lines.tolist() == [0] * 5
