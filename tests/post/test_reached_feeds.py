"""Programs for controls that look ahead: feed words that blocks reach, and axes within their jerks."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.motion.time_law import AS_SET, SPARE, Limits
from tapelayer.motion.trajectory import Kind
from tapelayer.setups.sections import parse_setup
from tests.helpers.kinds import job_of_kind, made, planned_of, source

JERKS = {
    "lay": "jerks_mm_per_s3 = {x = 30000, y = 30000, z = 20000, u = 60000, v = 100000}\njerks_deg_per_s3 = {c = 20000}",
    "spray": "jerks_mm_per_s3 = {x = 30000, y = 30000, z = 20000}\njerks_deg_per_s3 = {theta = 20000}",
}
# Written digits of the feed and of the positions, as a share of a block's speed.
DIGITS = 1e-3


@pytest.mark.parametrize(("kind", "controller"), [("lay", "sinumerik840d"), ("lay", "jb3208"), ("spray", "generic5")])
def test_feed_words_ask_for_what_blocks_reach(kind: KindName, controller: str) -> None:
    """By the text as the control reads it: at most a hundredth more, and never less."""
    job, result = job_of_kind(kind, controller), made(kind, controller)
    assert result.report()["passed"]
    read = job.read_back(result.text, "program.nc").trajectory
    planned = planned_of(kind, controller)
    assert read.duration == pytest.approx(planned.duration, abs=1e-3)
    assert read.clock is not None
    lengths = np.diff(read.clock.reached)
    feeds = np.flatnonzero((read.kinds == Kind.LINEAR) & (lengths > 1e-4))
    asked, reached = lengths[feeds] / read.requested[feeds], read.clock.peaks[feeds]
    # Blocks on a ramp ask for its top.
    ends = np.stack([read.clock.speeds_at(read.clock.ends[feeds + end]) for end in (0, 1)])
    ramps = np.max(ends, axis=0) >= reached * (1 - 2 * AS_SET)
    assert np.all((asked <= reached * (1 + AS_SET + DIGITS)) | ramps)
    lowered = asked > reached * (1 + SPARE - DIGITS)
    assert np.any(lowered) and not np.all(lowered)


@pytest.mark.parametrize(("kind", "controller"), [("lay", "sinumerik840d"), ("lay", "jb3208"), ("spray", "generic5")])
def test_a_program_within_jerks_is_slower_and_passes(kind: KindName, controller: str) -> None:
    text = f'[output]\ncontroller = "{controller}"\n[machine]\n{JERKS[kind]}\n'
    setup = parse_setup(text.encode(), "setup.toml", kind_of(kind).setup)
    job = kind_of(kind).job(source(kind), "source.txt", setup)
    result = job.make("program.nc")
    assert result.report()["passed"]
    axes, without = result.report()["axes"], made(kind, controller).report()
    jerks = Limits.of([job.machine.axis(name) for name in job.axes]).jerk
    assert np.any(np.isfinite(jerks))
    for axis in axes.values():
        if axis["jerk_limit"] is not None and axis["max_jerk"] is not None:
            assert axis["max_jerk"] <= axis["jerk_limit"] * (1 + 1e-5)
    assert max(axis["max_jerk"] or 0.0 for axis in axes.values()) > 0.0
    assert result.report()["duration_s"] > without["duration_s"]
    assert all(axis["max_jerk"] is None for axis in without["axes"].values())
