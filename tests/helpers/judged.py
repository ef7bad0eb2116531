"""What verification might have found, in round values that a report must give back."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from tapelayer.laying.evidence import CutMade, Evidence, LayingStop, LedgerRow, Samples, TapeLedger
from tapelayer.laying.limits import limits_of
from tapelayer.laying.quantities import ROWS
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.reporting.not_judged import unjudged
from tapelayer.reporting.quantity import numbers
from tapelayer.verification.axis_use import AxisUse

SHA256 = "0123456789abcdef" * 4


def samples() -> Samples:
    """Two courses of three samples; the largest of every quantity is a round value and often a negative one."""
    course = np.array([0, 0, 0, 1, 1, 1])
    arcs = np.array([0.0, 0.25, 0.5, 0.0, 0.5, 1.0])
    degrees = np.radians
    return Samples(
        courses=course,
        arc_lengths=arcs,
        times=np.array([0.0, 1.0, 2.0, 2.5, 3.0, 4.0]),
        asked=np.array([0.0, 1.0, 2.0, 2.5, 3.0, 4.0]),
        speeds=np.array([0.25, 0.25, 0.25, 1.0, 0.75, 0.5]),
        nips=np.column_stack([0.3 + 0.1 * course, arcs - 1.5, 0 * arcs]),
        normal_errors=np.array([0.0, 1e-5, -3e-5, 0.0, -3e-5, 0.0]),
        lateral_errors=np.array([0.0, 0.0, 4e-5, 0.0, 0.0, 2e-5]),
        tape_errors=np.array([0.0, -7e-5, 0.0, 0.0, 0.0, 1e-5]),
        tilts=degrees(np.array([0.0, 1.0, 0.0, 0.0, -30.0, 0.0])),
        heading_errors=degrees(np.array([0.0, 0.0, -2.0, 0.0, 1.0, 0.0])),
        pitches=degrees(np.array([0.0, 0.0, -4.0, 0.0, 1.0, 0.0])),
        wraps=np.array([0.10, 0.12, 0.15, -0.03, 0.0, 0.01]),
        offsets=np.array([0.0, 0.0, 0.0006, 0.0, 0.0, 0.0]),
        block_ends=np.array([True, False, True, True, False, True]),
    )


def axes() -> tuple[AxisUse, ...]:
    return (
        AxisUse("x", False, 0.3, 0.4, 0.0, 2.5, 0.25, 1.0),
        AxisUse("c", True, math.radians(-10), math.radians(29), math.radians(-30), math.radians(30), 0.5, 1.0),
    )


def cut(station: float, degrees: float, knife: int, ending: int = 0, starting: int = 0) -> CutMade:
    """A cut off its line by 1 micrometre a block, its blade by a thousandth of a degree, both within their limits."""
    block = round(10 * station)
    off = block % 50
    return CutMade(
        station=station,
        angle=math.radians(degrees),
        ending=ending,
        starting=starting,
        knife=knife,
        block=block,
        line=block + 7,
        error=1e-6 * off,
        blade_error=math.radians(1e-3 * off),
    )


STOPS = (LayingStop(3, 0.25, 0.0, 12), LayingStop(17, 0.5, 0.5, 31), LayingStop(17, 0.75, 0.0, 34))


def worn() -> TapeLedger:
    """Two courses, a new roll before the second: of two metres a quarter is waste."""
    rows = (
        LedgerRow(3, 0.5, 0.1, 0.0, 0.0625, 0.0375, 1, (1, 6)),
        LedgerRow(17, 1.0, 1.0, 0.25, 0.125, 0.025, 2, (10, 20)),
    )
    cuts = (
        cut(0.1, 45.0, 1, starting=3),
        cut(0.6, 90.0, 2, ending=3),
        cut(1.0, 135.0, 2, starting=17),
        cut(2.0, 30.0, 1, ending=17),
    )
    return TapeLedger(rows, cuts, STOPS, 2.0, 3.0, 0.75, 0.25)


def ledger(*numbers: int) -> TapeLedger:
    """Courses of these numbers end to end, that share their cuts."""
    ends = [0, *numbers], [*numbers, 0]
    rows = (
        LedgerRow(number, 0.75, 0.75 * i, 0.0, 0.0, 0.0, 0, (round(7.5 * i), round(7.5 * (i + 1))))
        for i, number in enumerate(numbers)
    )
    cuts = (cut(0.75 * i, 45.0, 1 + i % 2, *pair) for i, pair in enumerate(zip(*ends, strict=True)))
    return TapeLedger(tuple(rows), tuple(cuts), (), 0.75 * len(numbers), 3.0, 0.75, 0.25)


def evidence(**changes: object) -> Evidence:
    found = Evidence(
        courses=2,
        points=44,
        blocks=5,
        laid_length=1.5,
        duration=4.0,
        asked=3.5,
        time_law="look_ahead",
        tape_taken_back=0.003,
        least_link_clearance=0.048,
        forward_disagreement=2e-16,
        axes=axes(),
        limits=limits_of(Setup()),
        samples=samples(),
        lay_speed=0.25,
        tape_width=0.075,
        roller_radius=0.04,
        tape=worn(),
        failures=(),
    )
    return replace(found, **changes)  # type: ignore[arg-type]


def numbers_of(evidence: Evidence) -> dict[str, Any]:
    """The report on a program with this hash."""
    named = replace(evidence, program_sha256=SHA256)
    return numbers(ROWS, named, named, unjudged(timed=True))


def trajectory(n: int = 5) -> Trajectory:
    """Every fifth block a rapid, one second each but for switching at once."""
    kinds = np.full(n, Kind.LINEAR, np.uint8)
    kinds[::5] = Kind.RAPID
    positions = np.column_stack([np.linspace(0.3, 0.4, n), np.linspace(-0.1, 0.5, n)])
    return Trajectory(
        axes=("x", "c"),
        start=np.full(2, np.nan),
        positions=positions,
        kinds=kinds,
        durations=np.full(n, 4.0 / n),
        events=np.zeros(n, np.uint8),
        courses=np.zeros(n, np.int32),
        stated=np.zeros(n, np.uint16),
        lines=np.zeros(n, np.int32),
    )
