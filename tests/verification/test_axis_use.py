"""Travel and speed of the axes, and who leaves them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.machines.machine import Axis
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits, timed
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.verification.axis_use import FEED_DIGITS, AxisUse, axes_used
from tapelayer.verification.breach import Breach
from tests.helpers.by_hand import driven

X, C = Axis("x", False, -1.0, 2.0, 0.5), Axis("c", True, -math.pi, math.pi, 1.0)
NONE = np.zeros(2)


def used(trajectory: Trajectory, digit: float = 0.0, rounding: float = 0.0) -> tuple[tuple[AxisUse, ...], list[Breach]]:
    return axes_used(trajectory, (X, C), np.full(2, digit), np.full(2, rounding))


def test_travel_and_speed_are_those_of_the_way() -> None:
    (x, c), breaches = used(driven([[0.3, 0.1], [0.1, -0.5], [0.4, -0.5]], "xc"))
    assert breaches == []
    assert (x.least, x.greatest, x.top_speed, x.margin) == (0.1, 0.4, pytest.approx(0.3), pytest.approx(1.1))
    assert (c.least, c.greatest, c.top_speed, c.margin) == (-0.5, 0.1, pytest.approx(0.6), pytest.approx(math.pi - 0.5))
    assert (x.unit, c.unit) == ("mm", "deg")
    assert x.values()["max"] == pytest.approx(400.0)
    assert c.values() == {
        "unit": "deg",
        "min": pytest.approx(math.degrees(-0.5)),
        "max": pytest.approx(math.degrees(0.1)),
        "lower": pytest.approx(-180.0),
        "upper": pytest.approx(180.0),
        "margin": pytest.approx(180.0 - math.degrees(0.5)),
        "max_speed": pytest.approx(math.degrees(0.6)),
        "speed_limit": pytest.approx(math.degrees(1.0)),
        "max_acceleration": None,
        "acceleration_limit": None,
        "max_jerk": None,
        "jerk_limit": None,
    }


def test_accelerations_are_those_of_the_ramps_on_the_control() -> None:
    """Over 0.5 m in x and 0.25 rad in c, x leads with its 2 m/s2 and c follows with half of that."""
    axes = Axis("x", False, -1.0, 2.0, 0.5, 2.0), Axis("c", True, -math.pi, math.pi, 1.0, 4.0)
    rule = Rule("stop", paths=((0,),), rotary=frozenset({1}))
    way = driven([[0.5, 0.25], [0.5, 1.25]], "xc", durations=(2.0, 4.0))
    (x, c), breaches = axes_used(timed(way, Limits.of(axes), rule), axes, NONE, NONE)
    assert breaches == []
    assert (x.values()["max_acceleration"], x.values()["acceleration_limit"]) == pytest.approx((2e3, 2e3))
    assert (c.top_acceleration, c.acceleration_limit) == pytest.approx((4.0, 4.0))
    weaker = (axes[0], Axis("c", True, -math.pi, math.pi, 1.0, 3.5))
    (breach,) = axes_used(timed(way, Limits.of(axes), rule), weaker, NONE, NONE)[1]
    limit = pytest.approx(math.degrees(3.5))
    assert breach == Breach(1, "axis_c_acceleration_deg_per_s2", pytest.approx(math.degrees(4.0)), limit)


def test_jerks_are_those_of_ramps_and_corners_on_a_control_that_limits_them() -> None:
    """X leads with its 40 m/s3 and C follows with half of that; into the second block, C alone turns."""
    axes = Axis("x", False, -1.0, 2.0, 0.5, 2.0, 40.0), Axis("c", True, -math.pi, math.pi, 1.0, 4.0, 80.0)
    way = driven([[0.5, 0.25], [1.0, 0.5], [1.5, 0.5]], "xc", durations=(2.0, 2.0, 2.0))
    blended = replace(way, tolerances=np.array([1e-4, 1e-4, 0.0]))
    rule = Rule("look_ahead", paths=((0,),), rotary=frozenset({1}))
    for planned, turn in ((replace(way, tolerances=np.zeros(3)), 0.0), (blended, 80.0)):
        (x, c), breaches = axes_used(timed(planned, Limits.of(axes), rule), axes, NONE, NONE)
        assert breaches == []
        assert (x.values()["max_jerk"], x.values()["jerk_limit"]) == pytest.approx((40e3, 40e3))
        assert (c.top_jerk, c.jerk_limit) == pytest.approx((max(turn, 20.0), 80.0))
    weaker = (axes[0], Axis("c", True, -math.pi, math.pi, 1.0, 4.0, 75.0))
    (breach,) = axes_used(timed(blended, Limits.of(axes), rule), weaker, NONE, NONE)[1]
    name, limit = "axis_c_jerk_deg_per_s3", pytest.approx(math.degrees(75.0))
    assert breach == Breach(1, name, pytest.approx(math.degrees(80.0)), limit)
    unlimited = Axis("x", False, -1.0, 2.0, 0.5, 2.0), Axis("c", True, -math.pi, math.pi, 1.0, 4.0)
    for corner, stated in (("linuxcnc", axes), ("look_ahead", unlimited)):
        (x, _), _ = axes_used(timed(way, Limits.of(stated), replace(rule, corner=corner)), stated, NONE, NONE)
        assert x.values()["max_jerk"] is None


def test_an_end_of_travel_belongs_to_it() -> None:
    assert used(driven([[-1.0, 0.0], [2.0, 0.0]], "xc", durations=(9.0, 9.0)))[1] == []


@pytest.mark.parametrize(("x", "limit"), [(-1.25, -1000.0), (2.5, 2000.0)])
def test_the_block_farthest_beyond_is_named(x: float, limit: float) -> None:
    way = [[0.0, 0.0], [np.clip(x, -1.1, 2.1), 0.0], [x, 0.0], [math.nan, 0.0]]
    breaches = used(driven(way, "xc", durations=(9.0,) * 4))[1]
    assert breaches == [Breach(2, "axis_x_mm", pytest.approx(x * 1e3), pytest.approx(limit))]


@pytest.mark.parametrize(("beyond", "failing"), [(0.4e-6, False), (0.6e-6, True)])
def test_a_written_place_is_known_to_half_its_digit(beyond: float, failing: bool) -> None:
    breaches = used(driven([[2.0 + beyond, 0.0]], "xc", durations=(9.0,)), digit=1e-6)[1]
    assert bool(breaches) is failing


@pytest.mark.parametrize("share", [-FEED_DIGITS / 2, FEED_DIGITS / 2, 2 * FEED_DIGITS])
def test_a_speed_is_known_to_the_digits_of_a_feed(share: float) -> None:
    breaches = used(driven([[0.5, 0.0], [0.0, 0.0], [0.5 * (1 + share), 0.0]], "xc"))[1]
    quick = [Breach(2, "axis_x_speed_mm_per_s", pytest.approx(500 * (1 + share)), 500.0)]
    assert breaches == (quick if share > FEED_DIGITS else [])


def test_an_axis_may_have_gone_less_than_it_says() -> None:
    trajectory = driven([[0.0, 0.0], [1e-3, 2.0]], "xc", durations=(1.0, 1e-3))
    assert [breach.what for breach in used(trajectory)[1]] == ["axis_x_speed_mm_per_s", "axis_c_speed_deg_per_s"]
    (x, _), breaches = used(trajectory, rounding=0.6e-3)
    assert (x.top_speed, [breach.what for breach in breaches]) == (pytest.approx(0.4), ["axis_c_speed_deg_per_s"])


@pytest.mark.parametrize("kind", [Kind.RAPID, Kind.DWELL, Kind.SWITCH])
def test_only_feeds_have_a_speed(kind: Kind) -> None:
    (x, _), breaches = used(driven([[0.0, 0.0], [2.0, 0.0]], "xc", kinds=(Kind.LINEAR, kind)))
    assert (x.top_speed, breaches) == (0.0, [])


def test_a_block_without_time_has_a_speed_beyond_every_limit() -> None:
    breaches = used(driven([[0.0, 0.0], [1.0, 0.0]], "xc", durations=(1.0, 0.0)))[1]
    assert breaches == [Breach(1, "axis_x_speed_mm_per_s", math.inf, 500.0)]


def test_an_axis_that_is_never_stated_has_no_travel() -> None:
    (_, c), breaches = used(driven([[0.0, math.nan]], "xc", kinds=(Kind.RAPID,), start=math.nan))
    assert (c.least, c.greatest, breaches) == (math.inf, -math.inf, [])
    assert (c.values()["min"], c.values()["max"]) == (None, None)
