"""No axis is anywhere before the program has said where."""

from __future__ import annotations

import math

import pytest

from tapelayer.motion.trajectory import Event, Kind
from tapelayer.verification.breach import Breach
from tapelayer.verification.stated_axes import unknown_blocks
from tests.helpers.by_hand import driven
from tests.helpers.trajectories import changed

NAN = math.nan
KNOWN = [1.0, 2.0, 3.0]


@pytest.mark.parametrize("kind", [Kind.LINEAR, Kind.CLOCKWISE, Kind.DWELL, Kind.SWITCH])
def test_only_rapids_come_before_every_axis_is_stated(kind: Kind) -> None:
    way = [[NAN, NAN, 3.0], [1.0, NAN, 3.0], KNOWN]
    assert unknown_blocks(driven(way, "xyz", kinds=(Kind.RAPID, Kind.RAPID, kind))) == []
    assert unknown_blocks(driven(way, "xyz", kinds=(Kind.RAPID, kind, kind))) == [Breach(1, "unstated_axes", 1, 0)]
    assert unknown_blocks(driven(way, "xyz", kinds=(kind, kind, kind))) == [Breach(0, "unstated_axes", 2, 0)]


def test_a_value_lost_on_the_way_is_unstated_there() -> None:
    trajectory = driven([KNOWN, KNOWN, [1.0, NAN, 3.0]], "xyz", events=(Event.NONE, Event.NONE, Event.STOP))
    assert unknown_blocks(trajectory) == [Breach(2, "unstated_axes", 1, 0)]


def test_a_value_lost_among_rapids_is_unstated_there() -> None:
    rapids = (Kind.RAPID,) * 3
    lost = driven([[NAN, NAN, 3.0], [1.0, 2.0, NAN], KNOWN], "xyz", kinds=rapids)
    assert unknown_blocks(lost) == [Breach(1, "unstated_axes", 1, 0)]
    written = driven([[NAN, NAN, NAN], KNOWN, KNOWN], "xyz", kinds=rapids)
    assert unknown_blocks(written) == []
    assert unknown_blocks(changed(written, "stated", 0, 0b100)) == [Breach(0, "unstated_axes", 3, 0)]


@pytest.mark.parametrize("seconds", [NAN, math.inf, -1.0])
def test_a_block_takes_a_finite_time(seconds: float) -> None:
    trajectory = changed(driven([KNOWN, KNOWN, KNOWN], "xyz"), "durations", 1, seconds)
    (breach,) = unknown_blocks(trajectory)
    assert (breach.block, breach.what) == (1, "block_time_s")
