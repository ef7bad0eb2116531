"""Where a program has the arc on, row by row, and samples of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tapelayer.machines.wrist import AXES
from tapelayer.motion.trajectory import MOTIONS, Event, Kind, Trajectory
from tapelayer.spraying.arc_runs import SPRAYED_SAMPLE_STEP, RunSamples, arc_on, arc_runs_of, lengths_of
from tapelayer.verification.sampling import LEAST_SAMPLES
from tests.helpers.panels import flat, sheet
from tests.helpers.sprayed import sprayed

PLATE = sheet(np.linspace(0, 300, 7), np.linspace(0, 205, 5), flat)
EVENTS = (Event.NONE, Event.NONE, Event.NONE, Event.ARC_ON, Event.ARC_ON, Event.ARC_OFF, Event.AIR_ON)


def any_trajectory(rows: list[tuple[Event, int, Kind]], seed: int = 0) -> Trajectory:
    """Blocks of these events, passes and kinds; a switching block moves nothing."""
    count = len(rows)
    chance = np.random.default_rng(seed)
    return Trajectory(
        axes=AXES,
        start=np.zeros(5),
        positions=np.cumsum(chance.uniform(-0.02, 0.02, (count, 5)), axis=0),
        kinds=np.array([Kind.SWITCH if event else kind for event, _, kind in rows], np.uint8),
        durations=chance.uniform(0.1, 1.0, count),
        events=np.array([event for event, *_ in rows], np.uint8),
        courses=np.array([course for _, course, _ in rows], np.int32),
        stated=np.zeros(count, np.uint16),
        lines=np.zeros(count, np.int32),
    )


KINDS = (Kind.LINEAR, Kind.LINEAR, Kind.RAPID, Kind.DWELL)
blocks = st.tuples(st.sampled_from(EVENTS), st.sampled_from((0, 0, 0, 1, -1)), st.sampled_from(KINDS))


@given(st.lists(blocks, min_size=1, max_size=40))
@example([(event, 0, Kind.LINEAR) for event in (Event.ARC_ON, Event.NONE, Event.ARC_OFF, Event.ARC_ON, Event.NONE)])
def test_runs_are_those_of_a_walk_through_the_blocks(rows: list[tuple[Event, int, Kind]]) -> None:
    trajectory = any_trajectory(rows)
    lit, ignition, runs = False, 0, []
    expected = []
    for row, (event, course, _) in enumerate(rows):
        if event == Event.ARC_ON:
            lit, ignition = True, ignition + 1
        if event == Event.ARC_OFF:
            lit = False
        moving = lit and trajectory.kinds[row] in MOTIONS
        expected.append(moving)
        if not moving or course < 0:
            continue
        if runs and runs[-1][:2] == (ignition, course):
            runs[-1][2].append(row)
        else:
            runs.append((ignition, course, [row]))
    assert arc_on(trajectory).tolist() == expected
    found = arc_runs_of(trajectory)
    assert [(run.index, run.blocks.tolist()) for run in found] == [(course, list(of)) for _, course, of in runs]
    before = [None, *(ignition for ignition, *_ in runs)]
    assert [run.linked for run in found] == [a == b for a, (b, *_) in zip(before, runs, strict=False)]


def test_a_plate_is_sprayed_in_one_run_a_pass() -> None:
    spraying, plan = sprayed(PLATE)
    runs = arc_runs_of(spraying.trajectory)
    assert [run.index for run in runs] == list(range(len(plan.passes)))
    assert [run.linked for run in runs] == [False, *[True] * (len(runs) - 1)]
    for run, found in zip(runs, plan.passes, strict=True):
        assert np.sum(lengths_of(spraying.trajectory, run.blocks)) >= found.path.length - 1e-9


@given(st.integers(0, 2**32 - 1), st.integers(2, 20))
def test_samples_are_the_blocks_ends_and_evenly_between(seed: int, count: int) -> None:
    trajectory = any_trajectory([(Event.NONE, 0, Kind.LINEAR)] * (count + 1), seed)
    chosen = np.arange(1, count + 1)
    found = RunSamples.of(trajectory, chosen)
    joints, times, asked, rows = found.joints, found.times, found.asked, found.blocks
    np.testing.assert_allclose(asked, times, atol=1e-12)
    ends = trajectory.times
    assert rows[0] == chosen[0] and times[0] == pytest.approx(ends[0])
    np.testing.assert_allclose(joints[0], trajectory.positions[0], atol=1e-12)
    at = 0
    for block in chosen.tolist():
        way = np.linalg.norm(trajectory.positions[block, :3] - trajectory.positions[block - 1, :3])
        steps = max(LEAST_SAMPLES, int(np.ceil(way / SPRAYED_SAMPLE_STEP)))
        own = np.arange(at + 1, at + 1 + steps)
        assert np.all(rows[own] == block)
        shares = np.arange(1, steps + 1)[:, None] / steps
        begin, end = trajectory.positions[block - 1], trajectory.positions[block]
        np.testing.assert_allclose(joints[own], begin + shares * (end - begin), atol=1e-12)
        np.testing.assert_allclose(times[own], ends[block - 1] + shares[:, 0] * trajectory.durations[block], atol=1e-12)
        np.testing.assert_allclose(found.speeds[own], way / trajectory.durations[block], rtol=1e-9)
        at = own[-1]
    assert at == len(times) - 1


def test_no_arc_no_runs() -> None:
    assert arc_runs_of(any_trajectory([(Event.NONE, 0, Kind.LINEAR)] * 3)) == []
