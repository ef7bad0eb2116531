from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from post import arcs
from post.controllers import load
from post.program import write
from post.reader import read
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.provenance import Provenance
from tests.helpers.machines import TEN_AXES

PLANES = {0: ("x", "y"), 1: ("z", "x"), 2: ("y", "z")}


def arc(
    plane: int, kind: Kind, centre: tuple[float, float], radius: float, begin: float, sweep: float, **others: Any
) -> Trajectory:
    """One circular block, by its circle in the plane; the other axes go from 0 to 1."""
    axes = ("u", "z", "y", "x")
    signed = sweep if kind == Kind.COUNTERCLOCKWISE else -sweep
    start, end = np.zeros(4), np.ones(4)
    for axis, wave, place in zip(PLANES[plane], (np.cos, np.sin), centre, strict=True):
        start[axes.index(axis)] = place + radius * wave(begin)
        end[axes.index(axis)] = place + radius * wave(begin + signed)
    centres = np.full((1, 3), np.nan)
    centres[0, ["xyz".index(axis) for axis in PLANES[plane]]] = centre
    return Trajectory(
        axes,
        start,
        end[None],
        np.array([kind], dtype=np.uint8),
        np.ones(1),
        np.zeros(1, dtype=np.uint8),
        np.zeros(1, dtype=np.int32),
        np.zeros(1, dtype=np.uint16),
        np.zeros(1, dtype=np.int32),
        centres,
        np.array([plane], dtype=np.uint8),
    )


@given(
    st.sampled_from([0, 1, 2]),
    st.sampled_from([Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE]),
    st.floats(1e-2, 5),
    st.floats(-np.pi, np.pi),
    st.floats(0.01, 2 * np.pi - 0.01),
)
def test_circular_blocks_turn_about_their_centre(
    plane: int, kind: Kind, radius: float, begin: float, sweep: float
) -> None:
    path = arc(plane, kind, (0.3, -0.7), radius, begin, sweep)
    fractions = np.linspace(0, 1, 9)
    values = path.within(np.zeros(9, dtype=np.int64), fractions)
    signed = sweep if kind == Kind.COUNTERCLOCKWISE else -sweep
    for axis, wave, place in zip(PLANES[plane], (np.cos, np.sin), (0.3, -0.7), strict=True):
        expected = place + radius * wave(begin + signed * fractions)
        assert values[:, path.column(axis)] == pytest.approx(expected, abs=1e-12)
    (third,) = {"x", "y", "z"} - set(PLANES[plane])
    assert values[:, path.column(third)].tolist() == fractions.tolist()
    assert values[:, path.column("u")].tolist() == fractions.tolist()
    assert (values[0] == path.start).all() and (values[-1] == path.positions[0]).all()


@pytest.mark.parametrize(
    ("plane", "kind", "quarter"),
    [
        (0, Kind.COUNTERCLOCKWISE, {"x": 0.0, "y": 1.0}),
        (0, Kind.CLOCKWISE, {"x": 0.0, "y": -1.0}),
        (1, Kind.COUNTERCLOCKWISE, {"z": 0.0, "x": 1.0}),
        (1, Kind.CLOCKWISE, {"z": 0.0, "x": -1.0}),
        (2, Kind.COUNTERCLOCKWISE, {"y": 0.0, "z": 1.0}),
        (2, Kind.CLOCKWISE, {"y": 0.0, "z": -1.0}),
    ],
)
def test_turning_sense_in_each_plane(plane: int, kind: Kind, quarter: dict[str, float]) -> None:
    path = arc(plane, kind, (0.0, 0.0), 1.0, 0.0, np.pi)
    middle = path.within(np.array([0]), np.array([0.5]))[0]
    assert {axis: round(float(middle[path.column(axis)]), 12) + 0.0 for axis in quarter} == quarter


def test_a_circle_that_ends_where_it_begins_is_a_full_turn() -> None:
    path = arc(0, Kind.CLOCKWISE, (0.0, 0.0), 1.0, 0.0, 0.0)
    assert path.arcs(np.array([0])).sweeps == pytest.approx([-2 * np.pi])


def test_straight_blocks_beside_circular_ones_stay_straight() -> None:
    one = arc(0, Kind.COUNTERCLOCKWISE, (0.0, 0.0), 1.0, 0.0, np.pi / 2)
    path = Trajectory(
        one.axes,
        one.start,
        np.vstack([one.positions, [[0, 0, 2, 2]]]),
        np.array([Kind.COUNTERCLOCKWISE, Kind.LINEAR], dtype=np.uint8),
        *(np.repeat(rows, 2) for rows in (one.durations, one.events, one.courses, one.stated, one.lines)),
        np.vstack([one.centres, np.full((1, 3), np.nan)]),
        np.zeros(2, dtype=np.uint8),
    )
    values = path.within(np.array([1, 0, 1]), np.array([0.5, 1.0, 0.0]))
    assert values[0].tolist() == [0.5, 0.5, 1.5, pytest.approx(1.0)]
    assert (values[1] == one.positions[0]).all() and (values[2] == one.positions[0]).all()


def test_circular_blocks_need_centres_of_the_same_length() -> None:
    one = arc(0, Kind.CLOCKWISE, (0.0, 0.0), 1.0, 0.0, 1.0)
    rows = (
        one.axes,
        one.start,
        one.positions,
        one.kinds,
        one.durations,
        one.events,
        one.courses,
        one.stated,
        one.lines,
    )
    with pytest.raises(ValueError, match="needs their centres and planes"):
        Trajectory(*rows).within(np.array([0]), np.array([0.5]))
    with pytest.raises(ValueError, match="centres has 2 rows, positions 1"):
        Trajectory(*rows, np.zeros((2, 3)), one.planes)


def blocks_on_circle(
    count: int, plane: str, sweep: float, radius: float = 300.0, noise: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (count + 1, 3) in millimetres on a circle about (10, 20, 30), one further axis, and times."""
    first, second, _ = arcs.PLANES[plane]
    angles = 0.3 + np.linspace(0.0, sweep, count + 1)
    points = np.tile([10.0, 20.0, 30.0], (count + 1, 1))
    wobble = radius + noise * (-1.0) ** np.arange(count + 1)
    points[:, first] += wobble * np.cos(angles)
    points[:, second] += wobble * np.sin(angles)
    return points, (500.0 + 1.7 * np.arange(count + 1))[:, None], np.linspace(0.0, 4.0, count + 1)


def found(
    points: np.ndarray, others: np.ndarray, times: np.ndarray, joined: np.ndarray | None = None, **options: Any
) -> arcs.Found:
    able = np.ones(len(points) - 1, dtype=bool)
    joined = able if joined is None else joined
    return arcs.find(points, others, times, able, joined, options.get("planes", ("xy", "zx", "yz")), 0.005)


@pytest.mark.parametrize("plane", ["xy", "zx", "yz"])
@pytest.mark.parametrize("sweep", [1.5, -1.5, 3.1, -0.2])
def test_a_circle_is_found_with_its_centre_and_sense(plane: str, sweep: float) -> None:
    count = int(abs(sweep) * 200)
    points, others, times = blocks_on_circle(count, plane, sweep)
    arc = found(np.round(points, 3), others, times)
    assert (arc.firsts.tolist(), arc.lasts.tolist()) == ([0], [count - 1])
    assert arc.planes.tolist() == [["xy", "zx", "yz"].index(plane)]
    assert arc.clockwise.tolist() == [sweep < 0]
    centre = np.array([10.0, 20.0, 30.0])
    assert arc.centres[0] + points[0] == pytest.approx(centre, abs=0.001 + 0.004 / sweep**2)


def test_more_than_half_a_turn_is_more_than_one_arc() -> None:
    points, others, times = blocks_on_circle(800, "xy", 1.9 * np.pi)
    arc = found(points, others, times)
    assert arc.firsts[0] == 0 and arc.lasts[-1] == 799
    assert (arc.firsts[1:] == arc.lasts[:-1] + 1).all() and len(arc.firsts) == 2


def test_a_planned_corner_or_a_line_or_noise_is_no_arc() -> None:
    line = np.column_stack([np.arange(40.0), 2.0 * np.arange(40.0), np.zeros(40)])
    others, times = np.arange(40.0)[:, None], np.arange(40.0)
    assert len(found(line, others, times).firsts) == 0
    hexagon, others, times = blocks_on_circle(6, "xy", 2.0)
    assert len(found(hexagon, others, times).firsts) == 0
    noisy, others, times = blocks_on_circle(400, "xy", 1.5, noise=0.02)
    assert len(found(noisy, others, times).firsts) == 0


def test_arcs_end_where_the_circle_the_course_the_tape_or_the_speed_changes() -> None:
    points, others, times = blocks_on_circle(400, "zx", 1.5)
    joined = np.arange(400) != 150
    arc = found(points, others, times, joined)
    assert (arc.firsts.tolist(), arc.lasts.tolist()) == ([0, 150], [149, 399])
    fed = np.where(np.arange(401) < 150, 1.0 * np.arange(401), 150.0 + 1.1 * (np.arange(401) - 150))[:, None]
    arc = found(points, fed, times)
    assert (arc.firsts.tolist(), arc.lasts.tolist()) == ([0, 150], [149, 399])
    slow = np.where(np.arange(401) < 150, 0.01 * np.arange(401), 1.5 + 0.05 * (np.arange(401) - 150))
    arc = found(points, others, slow)
    assert arc.lasts[0] in range(149, 153) and arc.lasts[-1] == 399
    other_circle = np.vstack([points[:201], points[200] + (points[201:] - points[200]) * 1.2])
    arc = found(other_circle, others, times)
    assert arc.firsts[0] == 0 and arc.lasts[0] in range(198, 203) and arc.lasts[-1] == 399


def test_only_wanted_planes_and_able_blocks_become_arcs() -> None:
    points, others, times = blocks_on_circle(100, "yz", 0.4)
    assert len(found(points, others, times, planes=("xy", "zx")).firsts) == 0
    able = np.arange(100) >= 30
    arc = arcs.find(points, others, times, able, able, ("yz",), 0.005)
    assert (arc.firsts.tolist(), arc.lasts.tolist()) == ([30], [99])


def laid(points: np.ndarray, u: np.ndarray, times: np.ndarray) -> Trajectory:
    """A rapid to the first point, then straight blocks; points and u in millimetres."""
    count = len(points)
    positions = np.zeros((count, 10))
    positions[:, :3], positions[:, 5] = points / 1e3, u / 1e3
    return Trajectory(
        TEN_AXES,
        np.full(10, np.nan),
        positions,
        np.array([Kind.RAPID, *[Kind.LINEAR] * (count - 1)], dtype=np.uint8),
        np.diff(times, prepend=times[0]),
        np.zeros(count, dtype=np.uint8),
        np.zeros(count, dtype=np.int32),
        np.array([1023, *[0] * (count - 1)], dtype=np.uint16),
        np.zeros(count, dtype=np.int32),
    )


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(["xy", "zx", "yz"]),
    st.sampled_from(["jb3208", "linuxcnc"]),
    st.floats(60.0, 5000.0),
    st.floats(0.15, 1.2),
    st.booleans(),
    st.floats(-2.0, 2.0),
)
def test_written_arcs_read_back_onto_the_circle(
    plane: str, control: str, radius: float, sweep: float, clockwise: bool, tilt: float
) -> None:
    count = 4 + int(sweep * radius / 2.0)
    points, _, times = blocks_on_circle(count, plane, -sweep if clockwise else sweep, radius)
    u = tilt * radius * np.linspace(0.0, sweep, count + 1)
    trajectory = laid(points, u, times)
    controller = load(control)
    text = write(SimpleNamespace(trajectory=trajectory), controller, Provenance("a", "b", "c", "d"))  # type: ignore[arg-type]
    path = read(text, controller, TEN_AXES, Limits.speeds(np.full(len(TEN_AXES), 10.0)), "p.nc").trajectory
    word = controller.codes.clockwise if clockwise else controller.codes.counterclockwise
    arc = np.flatnonzero(np.isin(path.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    assert 1 <= len(arc) <= 2 and f"{controller.codes.planes[plane]} {word} ".encode() in text
    assert path.duration == pytest.approx(4.0, rel=1e-5)
    assert path.positions[-1] == pytest.approx(trajectory.positions[-1], abs=1e-6)
    fractions = np.linspace(0.0, 1.0, 21)
    values = path.within(np.repeat(arc, 21), np.tile(fractions, len(arc)))
    first, second, third = arcs.PLANES[plane]
    centre = np.array([0.01, 0.02, 0.03])
    off = np.hypot(values[:, first] - centre[first], values[:, second] - centre[second]) - radius / 1e3
    # The ends are rounded, and within the tolerance the arc is the one through them.
    assert np.abs(off).max() < 6e-6
    assert values[:, third] == pytest.approx(centre[third], abs=1e-6)
    turned = np.unwrap(np.arctan2(values[:, second] - centre[second], values[:, first] - centre[first]))
    share = np.abs(turned - 0.3) * radius / 1e3 * tilt
    assert values[:, 5] == pytest.approx(share, abs=2e-5)


def test_golden_arc() -> None:
    points, _, times = blocks_on_circle(100, "zx", 1.0, 200.0)
    points[:, 1] = 0.0
    trajectory = laid(points, 2.0 * np.arange(101), times)
    text = write(SimpleNamespace(trajectory=trajectory), load("jb3208"), Provenance("a", "b", "c", "d"))  # type: ignore[arg-type]
    begin, end = np.round(points[0], 3), np.round(points[-1], 3)
    # The arc's own centre is the one through its rounded ends.
    block = f"N40 G18 G03 X{end[0]:.3f} Z{end[2]:.3f} U200.000 I{10 - begin[0]:.3f} K{29.999 - begin[2]:.3f} F3000.00"
    assert re.sub(r"F\d+\.\d+", "F3000.00", text.decode("ascii").splitlines()[-3]) == block


def test_a_course_round_a_cylinder_becomes_a_few_arcs_with_the_same_verified_error(tmp_path: Path) -> None:
    radius, angles = 900.0, np.deg2rad(np.linspace(-25.0, 25.0, 401))
    lines = ["1", "start", "90"]
    for angle in angles.tolist():
        y, z = 600.0 + radius * np.sin(angle), radius * (np.cos(angle) - 1.0)
        lines.append(
            f"180 {y:.4f} {z:.4f} 0 {np.sin(angle):.8f} {np.cos(angle):.8f} {radius * (angle - angles[0]):.4f}"
        )
    path = tmp_path / "cylinder.txt"
    path.write_text("\n".join([*lines, "end", ""]), encoding="utf-8")
    job = Job.read(path, Setup())
    planned = job.plan()
    text = job.text(planned)
    read_back = job.read_back(text, "p.nc").trajectory
    # One arc before the roller comes down, one to the cut, and one behind it.
    assert np.sum(read_back.kinds == Kind.CLOCKWISE) == 3
    assert len(read_back) < len(planned.trajectory) / 2
    back = job.verify(read_back)
    errors = [np.abs(evidence.samples.position_errors).max() for evidence in (planned.evidence, back.evidence)]
    assert errors[1] < errors[0] + job.controller.arcs.tolerance_mm * 1e-3
    asked = [float(np.sum(found.trajectory.requested)) for found in (planned, back)]
    assert asked[1] == pytest.approx(asked[0], rel=1e-5)
    # Corners between chords are passed a little slower than an arc.
    assert back.trajectory.duration == pytest.approx(planned.trajectory.duration, rel=2e-3)
