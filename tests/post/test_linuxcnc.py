"""LinuxCNC as judge: its interpreter reads our programs, and headless it runs one."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from post.controllers import load
from post.program import write
from post.reader import read
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import AxisBeyondTravel, ProgramRefused
from tapelayer.laying.program import plan
from tapelayer.machines.machine import Machine
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.provenance import Provenance
from tests.helpers.driven import LAYING, driven
from tests.helpers.linuxcnc import PYTHON, ROTARY, has_linuxcnc, run
from tests.helpers.machines import limited
from tests.helpers.plies import PLIES, courses_of
from tests.helpers.setups import setup_of

HERE = Path(__file__).parent
# Joints of the interpreter's nine axes X Y Z A B C U V W, with the table linuxcnc and with the remapped letters.
NINE = {
    "linuxcnc": LAYING,
    "linuxcnc_remap": ("x", "y", "z", "a", "", "c", "u", "v", ""),
}
SWITCHES = [*range(20, 29), 32, 33]


pytestmark = [
    pytest.mark.linuxcnc,
    pytest.mark.skipif(not has_linuxcnc(), reason="the Debian package linuxcnc-uspace is not installed"),
]


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that any user may write to: parts of LinuxCNC run as nobody."""
    path = Path(tempfile.mkdtemp(prefix="tapelayer-linuxcnc-"))
    path.chmod(0o777)
    for name in ("parameters.var", "tools.tbl"):
        (path / name).touch()
    yield path
    shutil.rmtree(path)


def interpreted(folder: Path, text: bytes, ini: str = "") -> list[tuple[str, int, list[float]]]:
    """Moves of a program by LinuxCNC's interpreter, in mm and deg; an error raises."""
    (folder / "program.ngc").write_bytes(text)
    (folder / "parameters.var").write_text("", encoding="ascii")
    environment = {**os.environ, "HOME": str(folder)}
    if ini:
        (folder / "interpreter.ini").write_text(ini, encoding="ascii")
        environment["INI_FILE_NAME"] = str(folder / "interpreter.ini")
    files = [folder / "program.ngc", folder / "parameters.var"]
    done = subprocess.run(
        [PYTHON, HERE / "linuxcnc" / "interpret.py", *files],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return [(kind, line, place) for kind, line, place in json.loads(done.stdout)]


def canonical(folder: Path, text: bytes, ini: str) -> list[str]:
    """Canonical calls of the stand-alone interpreter, which knows X Y Z A B C only."""
    (folder / "program.ngc").write_bytes(text)
    (folder / "interpreter.ini").write_text(ini, encoding="ascii")
    done = subprocess.run(
        ["rs274", "-g", "-t", "tools.tbl", "-v", "parameters.var", "-i", "interpreter.ini", "program.ngc"],
        cwd=folder, env={**os.environ, "HOME": str(folder)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    calls = (re.match(r"\s*\d+ N\S+\s+([A-Z_0-9]+\(.*\))$", line) for line in done.stdout.splitlines())
    return [call[1] for call in calls if call]


def remap_ini(folder: Path) -> str:
    """Remapped M words of the paper's table; M29 puts D, E and Q on analogue outputs."""
    lines = ["[RS274NGC]", f"PARAMETER_FILE = {folder}/parameters.var", f"SUBROUTINE_PATH = {folder}"]
    for number in SWITCHES:
        (folder / f"m{number}.ngc").write_text(f"o<m{number}> sub\nM64 P{number - 20}\no<m{number}> endsub\nM2\n")
        lines.append(f"REMAP = M{number} modalgroup=10 ngc=m{number}")
    taken = [
        f"o{100 + output} if [EXISTS[#<{letter}>]]\nM68 E{output} Q#<{letter}>\no{100 + output} endif\n"
        for output, letter in enumerate("deq")
    ]
    (folder / "m29.ngc").write_text(f"o<m29> sub\n{''.join(taken)}o<m29> endsub\nM2\n")
    return "\n".join([*lines, "REMAP = M29 modalgroup=10 argspec=deq ngc=m29", ""])


def planned(courses: tuple[Course, ...], control: str, text: str = "") -> tuple[Trajectory, Machine]:
    """What a controller is given to write, and the machine with the setup's limits."""
    alone = frozenset(joint for axis in load(control).axes if axis.alone for joint in axis.joints)
    setup = setup_of(text)
    return plan(courses, setup, limited(setup), alone), limited(setup)


def text_of(trajectory: Trajectory, control: str, source: str = "a") -> bytes:
    made_from = Provenance(source, "b", "c", "d")
    return write(SimpleNamespace(trajectory=trajectory), load(control), made_from)  # type: ignore[arg-type]


def nine_of(trajectory: Trajectory, control: str) -> np.ndarray:
    """Positions (n, 9) of the interpreter's axes in mm and deg, 0 where it has no such joint."""
    values = np.zeros((len(trajectory), 9))
    for index, joint in enumerate(NINE[control]):
        if joint:
            scale = 180 / np.pi if index in ROTARY else 1e3
            values[:, index] = trajectory.positions[:, trajectory.column(joint)] * scale
    return values


@pytest.mark.parametrize("control", ["linuxcnc", "linuxcnc_remap"])
@pytest.mark.parametrize("ply", PLIES)
def test_the_interpreter_reads_every_block_as_we_do(folder: Path, ply: str, control: str) -> None:
    trajectory, machine = planned(courses_of(ply), control, PLIES[ply])
    text = text_of(trajectory, control, "msg, (debug, x).txt")
    ours = read(text, load(control), machine.names, Limits.of(machine.axes), "p.nc").trajectory
    theirs = interpreted(folder, text, remap_ini(folder) if control == "linuxcnc_remap" else "")
    lines = text.decode("ascii").splitlines()
    moves = np.isin(ours.kinds, (Kind.RAPID, Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE))
    outputs = np.array([re.match(r"N\d+ M(68|29) ", lines[line - 1]) is not None for line in ours.lines.tolist()])
    rows = np.flatnonzero(moves & ~outputs)
    found = [(kind, place) for kind, _, place in theirs if kind not in ("dwell", "message")]
    names = {int(kind): kind.name.lower() for kind in Kind}
    assert [kind for kind, _ in found] == [names[kind] for kind in ours.kinds[rows].tolist()]
    expected = nine_of(ours, control)[rows]
    # Until a rapid has stated it, an axis is at 0 there.
    expected[np.isnan(expected)] = 0.0
    assert np.abs(np.array([place for _, place in found]) - expected).max() < 1e-4
    dwells = sum(place[0] for kind, _, place in theirs if kind == "dwell")
    waits = (ours.kinds == Kind.DWELL) | (outputs & (ours.kinds == Kind.LINEAR))
    assert dwells == pytest.approx(ours.durations[waits].sum(), abs=1e-9)
    assert not any(kind == "message" for kind, _, _ in theirs)


def circle_courses(*cuts: str) -> tuple[Course, ...]:
    """Short courses at 90 deg over a cylinder, one for each angle line."""
    radius, angles = 400.0, np.deg2rad(np.linspace(-8.0, 8.0, 129))
    lines = []
    for number, cut in enumerate(cuts, 1):
        lines += [str(number), "start", cut]
        for angle in angles.tolist():
            place = f"{100 + 76 * number} {600 + radius * np.sin(angle):.4f} {radius * (np.cos(angle) - 1):.4f}"
            lines.append(f"{place} 0 {np.sin(angle):.8f} {np.cos(angle):.8f} {radius * (angle - angles[0]):.4f}")
        lines.append("end")
    return parse_courses("\n".join([*lines, ""]).encode(), "courses.txt")


def test_the_interpreter_reads_arcs_as_we_do(folder: Path) -> None:
    trajectory, _ = planned(circle_courses("90"), "linuxcnc")
    text = text_of(trajectory, "linuxcnc")
    arcs = [(kind, place) for kind, _, place in interpreted(folder, text) if "clockwise" in kind]
    assert len(arcs) == np.sum(read_arcs(text)) > 0
    ends = nine_of(trajectory, "linuxcnc")[2:]
    for kind, place in arcs:
        assert kind == "clockwise"
        assert np.abs(ends - place).max(axis=1).min() < 1e-3


def read_arcs(text: bytes) -> np.ndarray:
    machine = Machine.load()
    kinds = read(text, load("linuxcnc"), machine.names, Limits.of(machine.axes), "p.nc").trajectory.kinds
    return np.isin(kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE))


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("G1 X5", "F"),
        ("G2 X10 Y0 I5.04 J0 F10", "radius|centre"),
        ("G1 X5 X6 F10", "X"),
        ("G0 X5 K1", "K"),
        ("G1 X1..5 F10", "number|X"),
    ],
)
def test_what_the_interpreter_refuses_we_refuse(folder: Path, block: str, words: str) -> None:
    joints = tuple(joint for joint in ("x", "y", "z", "a", "d", "c", "u", "v", "q"))
    state = "G93 G90 G0 X0 Y0 Z0 A0 B0 C0 U0 V0 W0\n"
    with pytest.raises(RuntimeError, match=f"(?i){words}"):
        interpreted(folder, f"G21\n{state}{block}\nM2\n".encode())
    with pytest.raises(ProgramRefused, match=f"(?i){words}"):
        read(
            f"G21\n{state}{block}\nM2\n".encode(), load("linuxcnc"), joints, Limits.speeds(np.ones(len(joints))), "p.nc"
        )


def test_the_papers_letters_need_their_remap(folder: Path) -> None:
    trajectory, _ = planned(courses_of("boss_panel_20"), "jb3208")
    with pytest.raises(RuntimeError, match="D word with no"):
        interpreted(folder, text_of(trajectory, "jb3208"))


def test_outputs_and_switches_reach_the_machine_in_order(folder: Path) -> None:
    joints = ("x", "d", "e")
    rows: list[tuple[Kind, dict[str, float] | str]] = [
        (Kind.RAPID, {"x": 0, "d": 1, "e": 2}), (Kind.SWITCH, "SHOE_DOWN"), (Kind.LINEAR, {"x": 5}),
        (Kind.SWITCH, "SHOE_UP"), (Kind.LINEAR, {"e": 7}), (Kind.SWITCH, "KNIFE_2_DOWN"),
    ]  # fmt: skip
    trajectory = small(joints, rows)
    calls = canonical(folder, text_of(trajectory, "linuxcnc"), "")
    wanted = ("SET_AUX", "CLEAR_AUX", "SET_MOTION_OUTPUT", "CLEAR_MOTION_OUTPUT", "STRAIGHT", "DWELL")
    shown = [re.sub(r"\((\S+?), .*", r"(\1)", call) for call in calls if call.startswith(wanted)]
    assert shown == [
        "SET_AUX_OUTPUT_VALUE(0,2.000000)",
        "STRAIGHT_TRAVERSE(0.0000)",
        "SET_MOTION_OUTPUT_BIT(0)",
        "STRAIGHT_FEED(5.0000)",
        "CLEAR_AUX_OUTPUT_BIT(0)",
        "SET_AUX_OUTPUT_VALUE(0,7.000000)",
        "DWELL(1.0000)",
        "SET_AUX_OUTPUT_BIT(3)",
    ]
    calls = canonical(folder, text_of(trajectory, "linuxcnc_remap"), remap_ini(folder))
    shown = [re.sub(r"\((\S+?), .*", r"(\1)", call) for call in calls if call.startswith(wanted)]
    assert shown == [
        "SET_AUX_OUTPUT_VALUE(0,1.000000)",
        "SET_AUX_OUTPUT_VALUE(1,2.000000)",
        "STRAIGHT_TRAVERSE(0.0000)",
        "SET_AUX_OUTPUT_BIT(0)",
        "STRAIGHT_FEED(5.0000)",
        "SET_AUX_OUTPUT_BIT(5)",
        "SET_AUX_OUTPUT_VALUE(1,7.000000)",
        "DWELL(1.0000)",
        "SET_AUX_OUTPUT_BIT(12)",
    ]


def small(joints: tuple[str, ...], rows: list[tuple[Kind, Any]]) -> Trajectory:
    """Blocks of a second each; the first states every axis."""
    place = dict.fromkeys(joints, 0.0)
    positions = []
    for _, what in rows:
        place |= what if isinstance(what, dict) else {}
        positions.append([place[joint] * (1e-3 if joint in "xyzuvq" else np.pi / 180) for joint in joints])
    return Trajectory(
        joints,
        np.full(len(joints), np.nan),
        np.array(positions),
        np.array([kind for kind, _ in rows], dtype=np.uint8),
        np.array([float(kind == Kind.LINEAR) for kind, _ in rows]),
        np.array([Event[what] if isinstance(what, str) else 0 for _, what in rows], dtype=np.uint8),
        np.zeros(len(rows), dtype=np.int32),
        np.array([2 ** len(joints) - 1, *[0] * (len(rows) - 1)], dtype=np.uint16),
        np.zeros(len(rows), dtype=np.int32),
    )


def test_a_program_runs_on_simulated_axes_along_the_planned_path(folder: Path) -> None:
    trajectory, machine = planned(circle_courses("70 50", "60 80"), "linuxcnc")
    text = text_of(trajectory, "linuxcnc")
    done = driven(folder, text, machine, machine.names)
    sampled = done.run.joints[::10]
    # The machine starts at 0, and every axis without a position yet stays there.
    path = replace(trajectory, start=np.zeros(10), positions=np.nan_to_num(trajectory.positions))
    moving = np.flatnonzero(np.isin(path.kinds, (Kind.RAPID, Kind.LINEAR)))
    lengths = np.abs(path.positions[moving] - path.begins(moving)).max(axis=1)
    counts = np.maximum((lengths / 5e-5).astype(int), 1) + 1
    blocks = np.repeat(moving, counts)
    fractions = np.concatenate([np.linspace(0.0, 1.0, count) for count in counts.tolist()])
    columns = [path.column(joint) for joint in LAYING]
    wanted = path.within(blocks, fractions)[:, columns] * np.where(np.isin(np.arange(9), ROTARY), 180 / np.pi, 1e3)
    off, _ = cKDTree(wanted).query(sampled, p=np.inf)
    assert len(sampled) > 500 and max(off) < 0.1
    assert np.abs(done.run.joints[-1] - wanted[-1]).max() < 1e-3
    assert done.real_s == pytest.approx(done.reported_s, rel=0.02)
    e = np.rad2deg(trajectory.positions[:, trajectory.column("e")]).round(3)
    turned = done.run.outputs.round(3).tolist()
    assert list(dict.fromkeys(turned))[1:] == list(dict.fromkeys(e[~np.isnan(e)].tolist()))
    switched = np.array([outputs for _, _, outputs, _ in done.run.log["samples"]])  # type: ignore[attr-defined]
    changes = np.abs(np.diff(switched, axis=0)).sum(axis=0)
    for number in range(5):
        assert changes[number] == len(re.findall(rb"M6[2-5] P%d\b" % number, text)) > 0
    assert not switched[-1][:5].any()


def test_beyond_the_limits_is_refused_there_as_here(folder: Path) -> None:
    trajectory, machine = planned(circle_courses("90"), "linuxcnc")
    narrow = machine.with_limits({"y": (0.0, 1.0)}, {})
    found = run(folder, text_of(trajectory, "linuxcnc"), narrow, LAYING)
    assert any("would exceed" in message and "Y" in message for message in found.messages)
    assert np.max(found.joints[:, 1]) <= 1000.0 + 1e-6
    with pytest.raises(AxisBeyondTravel, match="axis y would be at"):
        plan(circle_courses("90"), setup_of(), narrow)
