"""Each control's rule of time, said a second time: line by line, as its manual says it, sharing nothing with post."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import hypot
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from post.controllers import Controller, load
from post.controllers.parsing import parse
from post.program import write
from post.reader import read
from tapelayer.laying.program import plan
from tapelayer.machines.machine import Machine
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.provenance import Provenance
from tests.helpers.machines import limited
from tests.helpers.paths import ROOT
from tests.helpers.plies import PLIES, courses_of
from tests.helpers.setups import setup_of

MADE_FROM = Provenance("a", "b", "c", "d")

LAY = ("jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d")
JOINT_OF = {
    "jb3208": {letter: letter.lower() for letter in "XYZACUVQDE"},
    "generic5": {"X": "x", "Y": "y", "Z": "z", "A": "phi", "C": "theta"},
    "linuxcnc": {**{letter: letter.lower() for letter in "XYZACUV"}, "B": "d", "W": "q", "Q": "e"},
    "linuxcnc_remap": {letter: letter.lower() for letter in "XYZACUVQDE"},
    "sinumerik840d": {
        **{letter: letter.lower() for letter in "XYZAC"}, "U": "u", "V": "v", "Q1": "q", "B1": "d", "B2": "e",
    },
}  # fmt: skip


def norm(deltas: Mapping[str, float], letters: str) -> float:
    return float(np.sqrt(sum(deltas.get(letter, 0.0) ** 2 for letter in letters)))


def block_seconds(control: str, mode: str, feed: float, deltas: dict[str, float], arc: float | None) -> float:
    """Seconds of a G1, G2 or G3 by the control's rule; `arc` is the length of a circle's arc in place of its chord."""
    if mode == "G93":
        return 60.0 / feed
    xyz = norm(deltas, "XYZ") if arc is None else arc
    if control == "sinumerik840d":
        # FGROUP of all axes: one degree counts as one millimetre.
        assert arc is None
        return 60.0 * norm(deltas, tuple(deltas)) / feed  # type: ignore[arg-type]
    if control.startswith("linuxcnc"):
        # F is along XYZ if any of them moves, else along UVW, else the rotary axes' degrees.
        return 60.0 * (xyz or norm(deltas, "UVW") or norm(deltas, "ABC")) / feed
    return 60.0 * (xyz or max(abs(delta) for delta in deltas.values())) / feed


def arc_length(plane: str, clockwise: bool, deltas: dict[str, float], words: dict[str, float]) -> float:
    """Length along a circle with its third axis."""
    first, second = {"G17": "XY", "G18": "ZX", "G19": "YZ"}[plane]
    centre = {"X": words.get("I", 0.0), "Y": words.get("J", 0.0), "Z": words.get("K", 0.0)}
    from_centre = -centre[first], -centre[second]
    to_centre = deltas.get(first, 0.0) - centre[first], deltas.get(second, 0.0) - centre[second]
    sweep = np.arctan2(to_centre[1], to_centre[0]) - np.arctan2(from_centre[1], from_centre[0])
    sweep = (-sweep if clockwise else sweep) % (2 * np.pi)
    (third,) = set("XYZ") - {first, second}
    return hypot(float(sweep) * hypot(*from_centre), deltas.get(third, 0.0))


def seconds_of(text: str, control: str, speeds: Mapping[str, float]) -> float:
    """Seconds of a whole program; `speeds` in mm/s and deg/s by joint."""
    joint_of = JOINT_OF[control]
    position: dict[str, float] = {}
    motion, mode, plane, feed, total = "", "G94", "G17", float("nan"), 0.0
    for line in text.splitlines():
        line = (
            re.sub(r"\(.*?\)|;.*|FGROUP.*", "", line)
            if control != "sinumerik840d"
            else re.sub(r";.*|FGROUP.*", "", line)
        )
        pairs = re.findall(r"([A-Z]\d*(?==)|[A-Z])=?(-?\d+\.?\d*)", line.replace("%", ""))
        codes = [f"G{int(number)}" for letter, number in pairs if letter == "G"]
        words = {letter: float(number) for letter, number in pairs if letter not in "GMN"}
        if "G64" in codes:
            continue
        mode = next((code for code in codes if code in ("G93", "G94")), mode)
        plane = next((code for code in codes if code in ("G17", "G18", "G19")), plane)
        if "G4" in codes:
            total += words["F" if control == "sinumerik840d" else "P"]
            continue
        motion = next((code for code in codes if code in ("G0", "G1", "G2", "G3")), motion)
        feed = words.get("F", float("nan") if mode == "G93" else feed)
        deltas = {a: value - position[a] for a, value in words.items() if a in joint_of and a in position}
        position |= {address: value for address, value in words.items() if address in joint_of}
        if not any(deltas.values()):
            continue
        # What an M word takes turns in the dwell that follows.
        interpolated = {a: d for a, d in deltas.items() if not (control == "linuxcnc" and a == "Q")}
        if control == "linuxcnc_remap":
            interpolated = {a: d for a, d in deltas.items() if a not in "DEQ"}
        if motion == "G0":
            total += max(abs(delta) / speeds[joint_of[address]] for address, delta in interpolated.items())
        elif any(interpolated.values()):
            arc = None if motion == "G1" else arc_length(plane, motion == "G2", deltas, words)
            total += block_seconds(control, mode, feed, interpolated, arc)
    return total


def planned(ply: str) -> tuple[Trajectory, Machine]:
    setup = setup_of(PLIES[ply])
    return plan(courses_of(ply), setup, limited(setup)), limited(setup)


@pytest.mark.parametrize("ply", PLIES)
def test_block_times_of_the_text_add_up_to_the_planned_duration(ply: str) -> None:
    trajectory, machine = planned(ply)
    units = {axis.name: axis.speed * (180 / np.pi if axis.revolute else 1e3) for axis in machine.axes}
    for control in LAY:
        text = write(SimpleNamespace(trajectory=trajectory), load(control), MADE_FROM)  # type: ignore[arg-type]
        asked = seconds_of(text.decode("ascii"), control, units)
        assert asked == pytest.approx(trajectory.duration, rel=1e-3)
        limits = Limits.of(machine.axes)
        back = read(text, load(control), machine.names, limits, "p.nc").trajectory
        assert float(np.sum(back.requested)) == pytest.approx(asked, rel=1e-9)
        # With accelerations the control needs longer; without, a rounded end may be a hair beyond the speed of an axis.
        assert back.duration > asked * 1.1
        at_once = read(text, load(control), machine.names, Limits.speeds(limits.speed), "p.nc").trajectory
        assert at_once.duration == pytest.approx(asked, rel=5e-4)


def changed(control: str, *changes: tuple[str, str]) -> Controller:
    text = (ROOT / "post" / "controllers" / f"{control}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return parse(text.encode(), f"{control}.toml")


def durations(controller: Controller, axes: str, text: str) -> list[float]:
    """Seconds of the blocks after the first, which states the axes."""
    joints = tuple(next(word.joints[0] for word in controller.axes if word.address[0] == axis) for axis in axes)
    limits = Limits.speeds(np.ones(len(joints)))
    return read(text.encode(), controller, joints, limits, "p.nc").trajectory.durations[1:].tolist()


# X, A, and the seconds of the manual's example; 8.49 s is the root of 10 mm and 10 deg squared.
SIEMENS_ROWS = [(10.0, 0.0, 6.0), (10.0, 10.0, 6.0 * np.sqrt(2.0)), (0.0, 10.0, 6.0), (0.001, 10.0, 6.0)]


def fgroup_x_a() -> Controller:
    return changed(
        "sinumerik840d", ('path = [["X", "Y", "Z", "A", "C", "U=", "V=", "Q1=", "B1=", "B2="]]', 'path = [["X", "A"]]')
    )


@pytest.mark.parametrize(("x", "a", "seconds"), SIEMENS_ROWS)
def test_siemens_fgroup_of_x_and_a_as_its_manual_counts(x: float, a: float, seconds: float) -> None:
    found = durations(fgroup_x_a(), "XA", f"G0 X0 A0\nG1 X{x:.3f} A{a:.3f} F100\nM30")
    assert found == [pytest.approx(seconds, rel=1e-6)]


@pytest.mark.parametrize(("x", "a", "seconds"), SIEMENS_ROWS)
def test_siemens_feed_is_written_as_its_manual_counts(x: float, a: float, seconds: float) -> None:
    positions = np.array([[0.0, 0.0], [x / 1e3, np.deg2rad(a)]])
    trajectory = Trajectory(
        ("x", "a"),
        np.full(2, np.nan),
        positions,
        np.array([Kind.RAPID, Kind.LINEAR], dtype=np.uint8),
        np.array([0.0, seconds]),
        np.zeros(2, dtype=np.uint8),
        np.zeros(2, dtype=np.int32),
        np.array([3, 0], dtype=np.uint16),
        np.zeros(2, dtype=np.int32),
    )
    text = write(SimpleNamespace(trajectory=trajectory), fgroup_x_a(), MADE_FROM)  # type: ignore[arg-type]
    assert re.findall(rb"F([\d.]+)", text) == [b"100.000"]


@pytest.mark.parametrize(
    ("words", "seconds"),
    [
        ("X3 Y4 U99 A50", 5.0),
        ("Z-6 W8", 6.0),
        ("U3 W4 B77", 5.0),
        ("U3 V4 C100", 5.0),
        ("A3 B4", 5.0),
        ("C-12", 12.0),
    ],
)
def test_linuxcnc_feed_per_minute_is_along_xyz_else_uvw_else_rotary(words: str, seconds: float) -> None:
    state = "G0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\n"
    assert durations(load("linuxcnc"), "XYZABCUVW", f"{state}G94 G1 {words} F60\nM2") == [pytest.approx(seconds)]


@pytest.mark.parametrize("control", ["linuxcnc", "linuxcnc_remap", "sinumerik840d", "generic5", "jb3208"])
def test_inverse_time_is_one_over_minutes(control: str) -> None:
    end = "M30"
    assert durations(load(control), "XY", f"G0 X0 Y0\nG93 G1 X3 F2\nY9 F0.5\n{end}") == [30.0, 120.0]


@pytest.mark.parametrize("control", ["linuxcnc", "linuxcnc_remap"])
def test_every_linuxcnc_feed_motion_carries_its_feed_and_no_rapid_does(control: str) -> None:
    trajectory, _ = planned("boss_panel_20")
    text = write(SimpleNamespace(trajectory=trajectory), load(control), MADE_FROM).decode("ascii")  # type: ignore[arg-type]
    motion = ""
    seen: Any = {"G0": 0, "G1": 0}
    for line in text.splitlines():
        motion = next((word for word in re.findall(r"\bG[01]\b", line)), motion)
        if re.search(r" [XYZABCUVW]-?\d", line) and line[0] == "N":
            assert (" F" in line) == (motion == "G1"), line
            seen[motion] += 1
    assert seen["G0"] > 10 and seen["G1"] > 100
