"""A second reading of NC text, block by block and by the definitions alone: what becomes of the tape."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tapelayer.courses.course import Course
from tapelayer.geometry.curves import Curve
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.units import DEG, MM

AXES = "XYZCAUVDQE"
DEGREES = "CADE"
KNIFE_PITCH = 0.1
# End of the travel of both slides, to the last written digit.
SLIDE = 0.2 + 1e-6
WORD = re.compile(r"([A-Z])([-+.\d]+)")
# Word on, word off, slide, blade and station behind knife 1.
KNIVES = {"M22": ("M23", "V", "D", 0.0), "M32": ("M33", "Q", "E", KNIFE_PITCH)}


@dataclass
class Sweep:
    """A knife's way on the tape between its words: stations and places across, metres, and the blade, radians."""

    line: int
    places: list[tuple[float, float, float]] = field(default_factory=list)


@dataclass
class Tape:
    """What a program does to the tape: u as each course's shoe goes down and up, sweeps, u at every stop."""

    touches: list[dict[str, float]] = field(default_factory=list)
    lifts: list[float] = field(default_factory=list)
    sweeps: list[Sweep] = field(default_factory=list)
    stops: list[tuple[int, float]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def replayed(text: bytes) -> Tape:
    """What an NC text of controller jb3208 does to the tape; actuators act at once."""
    tape = Tape()
    at: dict[str, float] = {}
    down: dict[str, Sweep] = {}
    laying = False
    for number, line in enumerate(text.decode("ascii").splitlines(), 1):
        if line.startswith(("(", "%")):
            continue
        before = at.get("U", math.nan)
        for letter, value in WORD.findall(line):
            if letter in AXES:
                at[letter] = float(value) * (DEG if letter in DEGREES else MM)
        if at.get("U", math.nan) < before and (laying or down):
            tape.faults.append(f"line {number}: the tape runs back")
        words = line.split()
        for on, (off, slide, blade, behind) in KNIVES.items():
            if on in words:
                down[on] = Sweep(number)
                tape.sweeps.append(down[on])
            if on in down:
                down[on].places.append((at["U"] + behind, at[slide], at[blade]))
            if off in words:
                del down[on]
        if "M20" in words:
            laying = True
            tape.touches.append(dict(at))
        if "M25" in words:
            laying = False
            tape.lifts.append(at["U"])
        if "M00" in words:
            tape.stops.append((number, at["U"]))
            if laying or down:
                tape.faults.append(f"line {number}: the roll is changed while the shoe or a knife is down")
        if "G00" in words and (laying or down):
            tape.faults.append(f"line {number}: a rapid while the shoe or a knife is down")
    if down or laying:
        tape.faults.append("a knife or the shoe is left down")
    return tape


def faults_of_the_tape(text: bytes, courses: Sequence[Course], setup: Setup, machine: Machine) -> list[str]:
    """What is wrong with the tape of a program, by the definitions of tape coordinates; nothing where it is right."""
    tape = replayed(text)
    faults = list(tape.faults)
    half, clearance = setup.tape.width_mm / 2 * MM, setup.head.knife_clearance_mm * MM
    paths = courses_in_machine(courses, setup)
    if len(tape.touches) != len(courses) or len(tape.lifts) != len(courses):
        return [*faults, f"{len(tape.touches)} courses laid"]
    stations, ends = [], []
    for touch, lift, path in zip(tape.touches, tape.lifts, paths, strict=True):
        joints = np.array([[touch[axis] for axis in AXES]])
        heading, normal = machine.forward(joints, "contact")[0, :3, [0, 2]]
        _, _, tangents = Curve(path).at(np.array([0.0, path.length]))
        wrap = 0.04 * math.atan2(tangents[0] @ normal, tangents[0] @ heading) if setup.head.wrap_compensation else 0.0
        stations.append(touch["U"] - setup.head.knife_to_nip_mm * MM + wrap)
        ends.append(stations[-1] + path.length)
        if not setup.head.wrap_compensation and not abs(lift - touch["U"] - path.length) < 5e-6:
            faults.append(f"course {path.number}: {lift - touch['U']} m fed for {path.length} m")

    # Every line that has to be cut, with the first and last station of its roll.
    edges = np.array([0.0, *(u for _, u in tape.stops)])
    lines: list[tuple[float, float, float]] = []
    previous = (-math.inf, math.nan, -math.inf)
    for course, station, end in zip(courses, stations, ends, strict=True):
        edge = float(edges[np.searchsorted(edges, station + 1e-5) - 1])
        cots = [1 / math.tan(angle) for angle in course.cut_angles]
        if edge > previous[0]:
            needed = edge + half * abs(cots[0]) + setup.head.scrap_margin_mm * MM
            lines.append((station, cots[0], edge))
        elif abs(cots[0] - previous[1]) * 2 * (half + clearance) <= 1e-5 and abs(station - previous[2]) < 2e-6:
            needed = -math.inf
        else:
            apart = abs(cots[0] - previous[1])
            needed = previous[2]
            if apart * 2 * (half + clearance) > 1e-5:
                needed += half * apart + setup.head.scrap_margin_mm * MM
            lines.append((station, cots[0], edge))
        if not station >= needed - 2e-6:
            faults.append(f"course {course.number} at station {station} begins before {needed}")
        lines.append((end, cots[1], edge))
        previous = (edge, cots[1], end)

    made: list[list[Sweep]] = [[] for _ in lines]
    for sweep in tape.sweeps:
        off = [_off(sweep, station, cot) for station, cot, _ in lines]
        if not (min(off) <= 0.02 * MM and _spans(sweep, half + clearance)):
            faults.append(f"line {sweep.line}: a cut that nobody asks for")
            continue
        made[off.index(min(off))].append(sweep)
    for (station, cot, edge), sweeps in zip(lines, made, strict=True):
        if len(sweeps) != 1:
            faults.append(f"the cut at {station} is made {len(sweeps)} times")
            continue
        angle = math.atan2(1.0, cot)
        if not all(abs(blade + math.pi / 2 - angle) < 0.05 * DEG for _, _, blade in sweeps[0].places):
            faults.append(f"line {sweeps[0].line}: the blade is not along the cut")
        rolls = [u for number, u in tape.stops if number < sweeps[0].line]
        if (rolls[-1] if rolls else 0.0) != edge:
            faults.append(f"line {sweeps[0].line}: cut on another roll")
    return faults


def _off(sweep: Sweep, station: float, cot: float) -> float:
    """Largest distance of a sweep from a line."""
    return max(abs(sigma - station - w * cot) for sigma, w, _ in sweep.places) / math.hypot(1.0, cot)


def _spans(sweep: Sweep, reach: float) -> bool:
    """Whether a sweep goes from one side of the tape straight to the other, clearances included.

    Where the tape goes on, both ways are longer by the same run-up, within the slide's travel.
    """
    across = [w for _, w, _ in sweep.places]
    ends = sorted([across[0], across[-1]])
    even = ends == [min(across), max(across)] and abs(ends[0] + ends[1]) < 0.04 * MM
    passing = abs(sweep.places[-1][0] - sweep.places[0][0]) > 0.0
    return even and reach - 0.02 * MM < ends[1] < (SLIDE if passing else reach + 0.02 * MM)
