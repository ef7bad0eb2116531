"""No axis is anywhere before the program has said where."""

from __future__ import annotations

import math

import pytest

from tapelayer.motion.trajectory import Event, Kind
from tapelayer.verification.breach import Breach
from tapelayer.verification.stated_axes import unstated_axes
from tests.helpers.by_hand import driven

NAN = math.nan
KNOWN = [1.0, 2.0, 3.0]


@pytest.mark.parametrize("kind", [Kind.LINEAR, Kind.CLOCKWISE, Kind.DWELL, Kind.SWITCH])
def test_only_rapids_come_before_every_axis_is_stated(kind: Kind) -> None:
    way = [[NAN, NAN, 3.0], [1.0, NAN, 3.0], KNOWN]
    assert unstated_axes(driven(way, "xyz", kinds=(Kind.RAPID, Kind.RAPID, kind))) == []
    assert unstated_axes(driven(way, "xyz", kinds=(Kind.RAPID, kind, kind))) == [Breach(1, "unstated_axes", 1, 0)]
    assert unstated_axes(driven(way, "xyz", kinds=(kind, kind, kind))) == [Breach(0, "unstated_axes", 2, 0)]


def test_a_value_lost_on_the_way_is_unstated_there() -> None:
    trajectory = driven([KNOWN, KNOWN, [1.0, NAN, 3.0]], "xyz", events=(Event.NONE, Event.NONE, Event.STOP))
    assert unstated_axes(trajectory) == [Breach(2, "unstated_axes", 1, 0)]
