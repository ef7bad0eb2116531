"""What verification might have found, in round values that a report must give back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tapelayer.evidence import AxisUse, Evidence, LedgerRow, Samples, TapeLedger
from tapelayer.trajectory import Kind, Trajectory

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


def ledger(*numbers: int) -> TapeLedger:
    """Tape of the courses with these numbers."""
    rows = (LedgerRow(number, 0.75, 0.75 * i, 0.0, 0.0, 0.0, 0, ()) for i, number in enumerate(numbers))
    return TapeLedger(tuple(rows), (), 1.5, 3.0, 0.5, 0.5)


def evidence(**changes: object) -> Evidence:
    found = Evidence(
        courses=2,
        points=44,
        blocks=5,
        laid_length=1.5,
        duration=4.0,
        tape_taken_back=0.003,
        least_link_clearance=0.048,
        forward_disagreement=2e-16,
        axes=axes(),
        samples=samples(),
        tape_width=0.075,
        roller_radius=0.04,
        tape=ledger(3, 17),
        failures=(),
    )
    return replace(found, **changes)  # type: ignore[arg-type]


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
