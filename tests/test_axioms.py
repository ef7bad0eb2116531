"""What holds for every machine, every kind of job and every controller."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from post.controllers import load, names
from tapelayer.arrays import Floats
from tapelayer.errors import ControllerRefused, TapelayerError
from tapelayer.jobs.kinds import KindName
from tapelayer.machines import gantry, wrist
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.reporting.subject import Occasion
from tests.helpers.kinds import KINDS, job_of_kind, judged, made, planned_of
from tests.helpers.machines import sprayer, tape_layer
from tests.helpers.paths import ROOT
from tests.helpers.trajectories import changed, moved

each_kind = pytest.mark.parametrize("kind", KINDS)


def gantry_inverse(machine: Machine, poses: Floats) -> Floats:
    return gantry.inverse(machine, poses[:, :3, 3], poses[:, :3, 2], poses[:, :3, 0])


def wrist_inverse(machine: Machine, poses: Floats) -> Floats:
    angles = wrist.inverse(poses[:, :3, 2])
    return np.concatenate([np.broadcast_to(poses[:, :3, 3], (*angles.shape[:2], 3)), angles], axis=2)


@dataclass(frozen=True)
class Member:
    """A machine with its inverse.

    Attributes:
        machine: loads it.
        inverse: joint values (b, n, 5) of all branches for poses (n, 4, 4).
        axes: the joints that the inverse gives: three slides and two angles.
        frame: what is brought to the pose.
        turning: the angle about the vertical.
        tilting: the other one.
        pole: tilt at which the turning angle is free.
    """

    machine: Callable[[], Machine]
    inverse: Callable[[Machine, Floats], Floats]
    axes: tuple[str, ...]
    frame: str
    turning: str
    tilting: str
    pole: float

    def joints(self, slides: Floats, turns: Floats, tilts: Floats) -> Floats:
        """Joint values (n, k), tilted short of where the frame points sideways."""
        machine = self.machine()
        q = np.zeros((len(turns), len(machine.axes)))
        q[:, [machine.column(axis) for axis in self.axes[:3]]] = slides
        q[:, machine.column(self.turning)] = turns
        q[:, machine.column(self.tilting)] = np.clip(tilts, -STEEPEST, STEEPEST)
        return q


STEEPEST = math.radians(89.9)
SPECIAL = np.radians([0, 45, -45, 90, -90, 30, -30, 135, -135, 180, 1e-7])
MEMBERS = {
    "tape layer": Member(tape_layer, gantry_inverse, gantry.POSE, "contact", "c", "a", math.pi / 2),
    "sprayer": Member(sprayer, wrist_inverse, wrist.AXES, "gun", "theta", "phi", 0.0),
}
each_machine = pytest.mark.parametrize("member", MEMBERS.values(), ids=MEMBERS)


def assert_inverted(member: Member, q: Floats) -> None:
    """Every branch of the inverse goes to the pose of the joint values, and one of them is these values."""
    machine = member.machine()
    columns = [machine.column(axis) for axis in member.axes]
    poses = machine.forward_pinocchio(q, member.frame)
    branches = member.inverse(machine, poses)
    assert branches.shape == (2, len(q), 5) and not np.any(np.isnan(branches))
    for branch in branches:
        again = q.copy()
        again[:, columns] = branch
        for forward in (machine.forward, machine.forward_pinocchio):
            reached = forward(again, member.frame)
            np.testing.assert_allclose(reached[:, :3, 2:], poses[:, :3, 2:], rtol=0, atol=1e-9)
    apart = np.abs(np.remainder(branches - q[:, columns] + np.pi, 2 * np.pi) - np.pi)
    free = np.abs(np.abs(q[:, machine.column(member.tilting)]) - member.pole) < 1e-6
    assert np.all((np.min(np.max(apart, axis=2), axis=0) < 1e-6) | free)


@each_machine
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_forward_of_the_inverse_is_the_identity_at_special_angles(member: Member, share: float) -> None:
    turns, tilts = np.array(list(product(SPECIAL, SPECIAL))).T
    axes = [member.machine().axis(axis) for axis in "xyz"]
    slides = [axis.lower + share * (axis.upper - axis.lower) for axis in axes]
    assert_inverted(member, member.joints(np.tile(slides, (len(turns), 1)), turns, tilts))


@each_machine
def test_forward_of_the_inverse_is_the_identity_at_the_limits(member: Member) -> None:
    axes = [member.machine().axis(name) for name in (*member.axes[:3], member.turning, member.tilting)]
    corners = np.array(list(product(*((axis.lower, axis.upper) for axis in axes))))
    assert_inverted(member, member.joints(corners[:, :3], corners[:, 3], corners[:, 4]))


@each_machine
@given(
    st.tuples(*[st.floats(0.0, 2.5)] * 3),
    st.floats(-math.pi, math.pi) | st.sampled_from(SPECIAL.tolist()),
    st.floats(-STEEPEST, STEEPEST),
)
def test_forward_of_the_inverse_is_the_identity_anywhere(
    member: Member, slides: tuple[float, ...], turn: float, tilt: float
) -> None:
    assert_inverted(member, member.joints(np.array([slides]), np.array([turn]), np.array([tilt])))


@each_kind
def test_the_same_input_gives_the_same_bytes(kind: KindName) -> None:
    first, second = (job_of_kind(kind).make("program.nc") for _ in range(2))
    assert first.failure is None and len(first.text) > 1000
    assert first.text == second.text
    assert json.dumps(first.report()) == json.dumps(second.report())
    assert first.page(Occasion("program.nc")) == second.page(Occasion("program.nc"))


def documented(document: str, heading: str) -> set[str]:
    """Keys in the first two tables below a heading of a document: the numbers, and what stands beside them."""
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    tables = text[text.index(heading) :].split("| key | unit | meaning |\n|---|---|---|\n")[1:3]
    rows = [row for table in tables for row in table.partition("\n\n")[0].splitlines() if row.startswith("| `")]
    return {key for row in rows for key in re.findall(r"`(\w+)`", row.split("|")[1])}


@pytest.mark.parametrize(
    ("kind", "document", "heading"), [("lay", "report.md", ""), ("spray", "spray.md", "## The report")]
)
def test_the_keys_of_a_report_are_the_documented_ones(kind: KindName, document: str, heading: str) -> None:
    report = made(kind).report()
    # The command line adds the hash of the text that it writes.
    assert documented(document, heading) - {"text_sha256"} == set(report)
    for axis in report["axes"].values():
        speeds = {"max_speed", "speed_limit", "max_acceleration", "acceleration_limit", "max_jerk", "jerk_limit"}
        assert set(axis) == {"unit", "min", "max", "lower", "upper", "margin"} | speeds


def passes(kind: KindName, trajectory: Trajectory) -> bool:
    """Whether verification lets a trajectory through."""
    try:
        return judged(kind, trajectory).passed
    except TapelayerError:
        return False


@each_kind
@given(data=st.data())
@settings(max_examples=60)
def test_a_nan_in_any_row_of_any_field_never_passes(kind: KindName, data: st.DataObject) -> None:
    """A position may be unknown only where nothing has stated its axis yet."""
    good = made(kind).trajectory
    assert passes(kind, good)
    row = data.draw(st.integers(0, 3) | st.integers(0, len(good) - 1) | st.integers(len(good) - 4, len(good) - 1))
    known = np.flatnonzero(np.isfinite(good.positions[row])).tolist()
    for axis in known:
        assert not passes(kind, moved(good, row, good.axes[axis], math.nan))
    assert not passes(kind, changed(good, "durations", row, math.nan))


def fits(kind: KindName, controller: str) -> bool:
    try:
        load(controller).addressed(planned_of(kind).axes)
    except ControllerRefused:
        return False
    return True


each_controller = pytest.mark.parametrize("controller", names())


def test_every_controller_fits_a_kind_and_every_kind_has_several() -> None:
    fitting = {controller: [kind for kind in KINDS if fits(kind, controller)] for controller in names()}
    assert all(fitting.values())
    assert all(sum(kind in kinds for kinds in fitting.values()) >= 2 for kind in KINDS)


@each_kind
@each_controller
def test_a_controller_without_an_axis_is_refused_by_its_name(kind: KindName, controller: str) -> None:
    if fits(kind, controller):
        assert made(kind, controller).failure is None
    else:
        with pytest.raises(ControllerRefused, match=rf"controller {controller}: has no address for axis \w+"):
            job_of_kind(kind, controller).make("program.nc")


@each_kind
@each_controller
def test_a_program_is_ascii_in_fixed_point_without_negative_zeros(kind: KindName, controller: str) -> None:
    if not fits(kind, controller):
        return
    text = made(kind, controller).text.decode("ascii")
    assert all(" " <= letter <= "~" or letter == "\n" for letter in text.replace("\r\n", "\n"))
    blocks = re.sub(r"\(.*?\)|;.*", "", text)
    assert not re.search(r"-0*\.?0+(?![\d.])", blocks)
    assert not re.search(r"\d[eE][-+]?\d", re.sub(r"(?<= )E(?=[-\d])", "", blocks))
    assert not re.search(r"nan|inf", blocks, re.IGNORECASE)


def read_rows(read: Trajectory, planned: Trajectory, resolution: Floats) -> list[int]:
    """Planned row of each row that was read, in order; rows of neither are left out where arcs take several."""
    rows, at = [], 0
    for positions, event in zip(read.positions, read.events, strict=True):
        same = (np.abs(planned.positions[at:] - positions) <= 0.5001 * resolution) | (
            np.isnan(positions) & np.isnan(planned.positions[at:])
        )
        found = np.flatnonzero(np.all(same, axis=1) & (planned.events[at:] == event))
        rows.append(at + int(found[0]) if len(found) else -1)
        at = rows[-1] + 1 if len(found) else at
    return rows


@each_kind
@each_controller
def test_a_program_reads_back_as_what_was_planned(kind: KindName, controller: str) -> None:
    if not fits(kind, controller):
        return
    planned, read = planned_of(kind, controller), made(kind, controller).trajectory
    job = made(kind, controller).job
    assert read.axes == planned.axes
    rows = np.array(read_rows(read, planned, job.resolution))
    # Only what a control takes in a block of its own, before every axis is stated, is no planned row.
    stated = ~np.any(np.isnan(read.positions), axis=1)
    assert np.all(rows[stated] >= 0)
    assert np.all(np.diff(rows[rows >= 0]) > 0)
    left_out = np.setdiff1d(np.arange(len(planned)), rows)
    steps = np.abs(planned.positions[left_out] - planned.begins(left_out))
    assert np.any(np.isin(read.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE))) or np.all(steps <= job.resolution)
    switches = planned.events != 0
    assert read.events[read.events != 0].tolist() == planned.events[switches].tolist()
    assert read.duration == pytest.approx(planned.duration, rel=1e-3)
    assert set(np.unique(read.courses[stated])) == set(np.unique(planned.courses))
