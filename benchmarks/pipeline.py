"""The pipeline against the obvious way: points a second of each stage and of the whole job, as ratios of one run.

The obvious way handles one point after the other: line.split and float, the closed form with `math`, pink as a separate
inverse, Pinocchio for every forward check, f-strings. It writes one block per point, where `tapelayer` writes as few as
the tolerances allow; both check every block at the same number of places. Courses are geodesics on a cylinder with
2000 points on 1.4 m and six decimals in the file; the setup is the default except for the part's height.

Each time is the best CPU time of several rounds, so that other programs on the machine do not count. The time of the
obvious way is proportional to the points, so 100,000 of them are enough for it, and 200 for pink. The peak memory is
that of `tapelayer export` on the largest file. Needs the extra `bench`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pinocchio
from rich.console import Console
from rich.table import Table

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.laying.job import Job
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine
from tapelayer.motion import stroke, time_law
from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.setups.sections import parse_setup
from tapelayer.units import MM
from tapelayer.verification.sampling import LEAST_SAMPLES
from tapelayer.verification.verified import Verified

ROUNDS = 5
# Shortest turn of a run, in seconds.
LEAST_TURN = 0.05
SIZES = (10_000, 100_000, 1_000_000)
LOOP_POINTS, PINK_POINTS = 100_000, 200
PINK_ACCURACY = 1e-6

COURSE_POINTS, COURSE_LENGTH = 2000, 1.4
RADIUS, HEADING, SIDE_BY_SIDE = 1.8, 0.26, 8
SETUP = "[part]\nl3_mm = 1300\n"
# So tight that there is about one block per point.
FINE = "[process]\ntolerance_mm = 0.000026\n"

ASKED = {"reading": 2.5, "inverse": 1000.0, "forward check": 12.0, "NC text": 10.0, "whole job": 8.0}
MEMORY_LIMIT_GB = 2.0
TIME_LAW_LIMIT = 0.05

# Letter, column in the machine's axes, and factor to mm or degrees.
WORDS = (
    ("X", 0, 1e3),
    ("Y", 1, 1e3),
    ("Z", 2, 1e3),
    ("A", 4, 180.0 / math.pi),
    ("C", 3, 180.0 / math.pi),
    ("U", 5, 1e3),
    ("V", 6, 1e3),
    ("Q", 8, 1e3),
    ("D", 7, 180.0 / math.pi),
    ("E", 9, 180.0 / math.pi),
)

Rows = list[list[float]]
# G word, seconds and the ten axes' values in the machine's order, metres and radians.
Block = tuple[str, float, tuple[float, ...]]


@dataclass(frozen=True)
class Row:
    """Speeds of `tapelayer` and of the obvious way in one stage.

    Attributes:
        points: number of points in the course file.
        stage: name of the stage.
        obvious: what the obvious way uses.
        per_s: points (NC text: blocks) per second of CPU time.
        obvious_per_s: the same for the obvious way.
        asked: required ratio of the two, 0 for none.
        time_law: share of the stage's time in which it is worked out when a control is where; NaN if not measured.
    """

    points: int
    stage: str
    obvious: str
    per_s: float
    obvious_per_s: float
    asked: float
    time_law: float = math.nan

    @property
    def ratio(self) -> float:
        """How many times faster."""
        return self.per_s / self.obvious_per_s


def write_courses(path: Path, points: int) -> None:
    """Write a course file of at least this many points: plies of courses side by side on a cylinder."""
    arc_lengths = np.linspace(0.0, COURSE_LENGTH, COURSE_POINTS)
    angle = -0.4 + arc_lengths * math.cos(HEADING) / RADIUS
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    line = "%.6f %.6f %.6f %.9f %.9f %.9f %.6f"
    bodies = []
    for side in range(SIDE_BY_SIDE):
        x = 0.2 + 0.075 * side + arc_lengths * math.sin(HEADING)
        mm = 1e3 * np.column_stack([x, 1.0 + RADIUS * normals[:, 1], RADIUS * (normals[:, 2] - 1.0), arc_lengths])
        rows = np.column_stack([mm[:, :3], normals, mm[:, 3]])
        bodies.append("\n".join(line % tuple(row) for row in rows.tolist()))
    with path.open("w") as file:
        for course in range(math.ceil(points / COURSE_POINTS)):
            file.write(f"{course + 1}\nstart\n90\n{bodies[course % SIDE_BY_SIDE]}\nend\n")


def whole_job(path: Path, setup: Setup) -> tuple[Job, Verified]:
    """Do a job as `tapelayer export` does, and return it with the verified trajectory of its text."""
    job = Job.read(path, setup)
    text = job.text(job.plan())
    return job, job.verify(job.read_back(text, "program").trajectory)


def clocked_job(path: Path, setup: Setup) -> tuple[float, float]:
    """Do a job, and return its CPU time and the part of it that the time law takes, seconds."""
    exact, spent = time_law.clock_of, 0.0

    def clock_of(trajectory: Trajectory, limits: Limits, rule: Rule) -> Clock:
        nonlocal spent
        begin = time.process_time()
        clock = exact(trajectory, limits, rule)
        spent += time.process_time() - begin
        return clock

    with patch.object(stroke, "clock_of", clock_of), patch.object(time_law, "clock_of", clock_of):
        begin = time.process_time()
        whole_job(path, setup)
        return time.process_time() - begin, spent


def read_by_line(path: Path) -> list[Rows]:
    """Return the seven numbers of every point of every course, in the file's units."""
    courses: list[Rows] = []
    with path.open() as file:
        for line in file:
            words = line.split()
            if len(words) == 7:
                courses[-1].append([float(word) for word in words])
            elif words == ["start"]:
                courses.append([])
    return courses


def solve_by_pink(machine: Machine, points: Floats, normals: Floats, tangents: Floats) -> Floats:
    """Return joint values (n, 5) in the order of `gantry.POSE`, each solved from the last; arguments as `inverse`."""
    import pink  # type: ignore[import-untyped] # of the extra, for this comparison alone

    others = [machine.model.getJointId(name) for name in machine.names if name not in gantry.POSE]
    model = pinocchio.buildReducedModel(machine.model, others, pinocchio.neutral(machine.model))
    places = [model.idx_qs[model.getJointId(name)] for name in gantry.POSE]
    configuration = pink.Configuration(model, model.createData(), pinocchio.neutral(model))
    # Rotation about the roller's axis, the frame's y, is free.
    task = pink.FrameTask("roller", position_cost=1.0, orientation_cost=[1.0, 0.0, 1.0])
    free = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0])
    radius = gantry.lengths(machine).radius
    joints = np.empty((len(points), 5))
    for row, (point, normal, tangent) in enumerate(zip(points, normals, tangents, strict=True)):
        left = np.cross(normal, tangent)
        left /= np.linalg.norm(left)
        turn = np.column_stack([np.cross(left, normal), left, normal])
        task.set_target(pinocchio.SE3(turn, point + radius * normal))
        while not np.linalg.norm(free * task.compute_error(configuration)) <= PINK_ACCURACY:
            velocity = pink.solve_ik(configuration, [task], 1.0, solver="daqp", limits=[])
            configuration.integrate_inplace(velocity, 1.0)
        joints[row] = configuration.q[places]
    return joints


def forward_by_loop(machine: Machine, configurations: Floats) -> Floats:
    """Return poses (n, 4, 4) of the roller at Pinocchio's configurations (n, nq)."""
    model, data = machine.model, machine.model.createData()
    live = data.oMf[model.getFrameId("roller")]
    poses = np.empty((len(configurations), 4, 4))
    for row, configuration in enumerate(configurations):
        pinocchio.framesForwardKinematics(model, data, configuration)
        poses[row] = live.homogeneous
    return poses


def plan_by_point(courses: Sequence[Rows], setup: Setup, machine: Machine) -> list[list[Block]]:
    """Return the blocks of every course, one per point, each checked by Pinocchio; the knives stay at rest."""
    model, data = machine.model, machine.model.createData()
    live = data.oMf[model.getFrameId("roller")]
    axes = [machine.axis(name) for name in (*gantry.POSE, "u")]
    columns = [model.idx_qs[model.getJointId(axis.name)] for axis in axes]
    configuration = pinocchio.neutral(model)
    lengths = gantry.lengths(machine)
    radius, l4, l5, reach = lengths.radius, lengths.l4, lengths.l5, lengths.l6 - lengths.radius
    l1, l2, l3 = setup.part.l1_mm * MM, setup.part.l2_mm * MM, setup.part.l3_mm * MM
    limit, speed = setup.verification.max_position_error_mm * MM, setup.process.lay_speed_mm_per_s * MM
    planned, fed = [], setup.head.knife_to_nip_mm * MM
    for rows in courses:
        blocks: list[Block] = []
        last: tuple[float, ...] = ()
        at = 0.0
        for index, (x, y, z, nx, ny, nz, arc) in enumerate(rows):
            size = math.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / size, ny / size, nz / size
            behind, ahead = rows[max(index - 1, 0)], rows[min(index + 1, len(rows) - 1)]
            tx, ty, tz = ahead[0] - behind[0], ahead[1] - behind[1], ahead[2] - behind[2]
            rx, ry, rz = ty * nz - tz * ny, tz * nx - tx * nz, tx * ny - ty * nx
            c, a = math.atan2(-ry, rx), math.atan2(rz, math.hypot(rx, ry))
            if last:
                c += 2 * math.pi * round((last[3] - c) / (2 * math.pi))
            sin4, cos4, sin5, cos5 = math.sin(c), math.cos(c), math.sin(a), math.cos(a)
            centre = (x * MM + l1 + radius * nx, y * MM + l2 + radius * ny, z * MM - l3 + radius * nz)
            wrap = math.atan2(sin5 * (sin4 * ty - cos4 * tx) + cos5 * tz, sin4 * tx + cos4 * ty)
            joints = (
                centre[0] + l5 * sin4 - reach * cos4 * sin5,
                -centre[1] - l5 * cos4 - reach * sin4 * sin5,
                -centre[2] - l4 - reach * cos5,
                c,
                a,
                fed + arc * MM - radius * wrap,
            )
            for axis, value in zip(axes, joints, strict=True):
                if not axis.lower <= value <= axis.upper:
                    raise ValueError(f"axis {axis.name} is at {value}")
            for column, value in zip(columns, joints, strict=True):
                configuration[column] = value
            pinocchio.framesForwardKinematics(model, data, configuration)
            if not math.dist(live.translation, centre) <= limit:
                raise ValueError(f"the roller is {math.dist(live.translation, centre)} m off")
            spent = 0.0
            if last:
                steps = [abs(value - before) for value, before in zip(joints, last, strict=True)]
                spent = max(
                    (arc * MM - at) / speed, *(step / axis.speed for step, axis in zip(steps, axes, strict=True))
                )
            blocks.append(("G01" if last else "G00", spent, (*joints, 0.0, 0.0, 0.0, 0.0)))
            last, at = joints, arc * MM
        planned.append(blocks)
        fed += at
    return planned


def write_by_block(courses: Sequence[Sequence[Block]]) -> str:
    """Return NC text: the words that change in each block, and a feed computed from the rounded end points."""
    lines: list[str] = []
    number, last, last_code, last_feed = 0, [math.nan] * len(WORDS), "", ""
    for blocks in courses:
        for code, spent, joints in blocks:
            values = [round(joints[column] * scale, 3) for _, column, scale in WORDS]
            words = [
                f" {letter}{value:.3f}"
                for (letter, _, _), value, old in zip(WORDS, values, last, strict=True)
                if value != old
            ]
            feed = ""
            if code == "G01":
                distance = math.dist(values[:3], last[:3])
                if not distance:
                    distance = max(abs(value - old) for value, old in zip(values, last, strict=True))
                speed = distance * 60.0 / spent
                feed = f" F{speed:.{max(5 - math.floor(math.log10(speed)), 0)}f}"
            number += 10
            lines.append(
                f"N{number}{f' {code}' if code != last_code else ''}{''.join(words)}{feed if feed != last_feed else ''}"
            )
            if code == "G00":
                number += 10
                lines.append(f"N{number} M20")
            last, last_code, last_feed = values, code, feed
        number += 10
        lines.append(f"N{number} M25")
    return "\n".join(lines)


def read_back_by_line(text: str) -> list[Rows]:
    """Return joint values x, y, z, c, a, u in metres and radians at the block ends of every course of an NC text."""
    courses: list[Rows] = []
    values: dict[str, float] = {}
    for line in text.split("\n"):
        words = line.split()
        for word in words:
            values[word[0]] = float(word[1:])
        if words[1] == "G00":
            courses.append([])
        if words[1][0] != "M":
            slides = [values[letter] * MM for letter in "XYZ"]
            courses[-1].append([*slides, math.radians(values["C"]), math.radians(values["A"]), values["U"] * MM])
    return courses


def check_by_point(read: Sequence[Rows], courses: Sequence[Rows], setup: Setup, machine: Machine, places: int) -> float:
    """Return the roller's largest distance from the course in metres, by Pinocchio at so many places of every block."""
    model, data = machine.model, machine.model.createData()
    live = data.oMf[model.getFrameId("roller")]
    columns = [model.idx_qs[model.getJointId(name)] for name in (*gantry.POSE, "u")]
    configuration = pinocchio.neutral(model)
    radius = gantry.lengths(machine).radius
    l1, l2, l3 = setup.part.l1_mm * MM, setup.part.l2_mm * MM, setup.part.l3_mm * MM
    limit, tilted = setup.verification.max_position_error_mm * MM, math.radians(setup.verification.max_roller_tilt_deg)
    worst = 0.0
    for blocks, rows in zip(read, courses, strict=True):
        for begin, end, before, after in zip(blocks, blocks[1:], rows, rows[1:], strict=False):
            for number in range(1, places + 1):
                share = number / places
                for column, low, high in zip(columns, begin, end, strict=True):
                    configuration[column] = low + share * (high - low)
                pinocchio.framesForwardKinematics(model, data, configuration)
                x, y, z, nx, ny, nz, _ = [low + share * (high - low) for low, high in zip(before, after, strict=True)]
                centre = (x * MM + l1 + radius * nx, y * MM + l2 + radius * ny, z * MM - l3 + radius * nz)
                off = math.dist(live.translation, centre)
                left = live.rotation[:, 1]
                tilt = math.asin(left[0] * nx + left[1] * ny + left[2] * nz)
                if not (off <= limit and abs(tilt) <= tilted):
                    raise ValueError(f"the roller is {off} m off and tilted by {tilt}")
                worst = max(worst, off)
    return worst


def job_by_point(path: Path, setup: Setup, machine: Machine, places: int) -> float:
    """Do the whole job the obvious way, and return the roller's largest distance from the course in metres."""
    courses = read_by_line(path)
    text = write_by_block(plan_by_point(courses, setup, machine))
    return check_by_point(read_back_by_line(text), courses, setup, machine, places)


def blocks_of(trajectory: Trajectory, limit: int) -> list[Block]:
    """Return the straight blocks that words ask for, at most `limit`, after a block that states where they begin."""
    rows = np.flatnonzero(trajectory.kinds == Kind.LINEAR)[:limit]
    times, joints = trajectory.requested[rows].tolist(), trajectory.positions[rows].tolist()
    begin = ("G00", 0.0, tuple(trajectory.begins(rows[:1])[0].tolist()))
    return [begin, *(("G01", spent, tuple(values)) for spent, values in zip(times, joints, strict=True))]


def surface(courses: Sequence[Course], setup: Setup) -> tuple[Floats, Floats, Floats]:
    """Return points, normals and tangents (n, 3) of all courses in `machine` axes."""
    paths = courses_in_machine(courses, setup)
    tangents = np.concatenate([np.gradient(path.points, path.arc_lengths, axis=0) for path in paths])
    return np.concatenate([path.points for path in paths]), np.concatenate([path.normals for path in paths]), tangents


def seconds(rounds: int, *runs: Callable[[], object]) -> list[float]:
    """Return the best CPU time of each run; the runs take turns, and a short one is repeated within its turn."""
    best = [math.inf] * len(runs)
    for _ in range(rounds):
        for number, run in enumerate(runs):
            spent = 0.0
            while not spent > LEAST_TURN:
                begin = time.process_time()
                run()
                took = time.process_time() - begin
                best[number], spent = min(best[number], took), spent + took
    return best


def compared(points: int, folder: Path, rounds: int) -> Iterator[Row]:
    """Yield the rows of the comparison for a course file of so many points."""
    path, part = folder / f"{points}.txt", folder / f"{min(points, LOOP_POINTS)}.txt"
    write_courses(path, points)
    write_courses(part, min(points, LOOP_POINTS))
    setup, fine = (parse_setup(text.encode(), "setup", Setup) for text in (SETUP, SETUP + FINE))
    courses = read_courses(path)
    count, loop_count = (sum(len(course.points) for course in read) for read in (courses, read_courses(part)))

    def row(stage: str, obvious: str, counts: tuple[int, int], times: Sequence[float]) -> Row:
        return Row(points, stage, obvious, counts[0] / times[0], counts[1] / times[1], ASKED.get(stage, 0.0))

    times = seconds(rounds, lambda: read_courses(path), lambda: read_by_line(part))
    yield row("reading", "line.split and float", (count, loop_count), times)

    machine = Job.read(part, setup).machine
    samples = surface(courses, setup)
    few = [values[:PINK_POINTS] for values in samples]
    times = seconds(rounds, lambda: gantry.inverse(machine, *samples), lambda: solve_by_pink(machine, *few))
    yield row("inverse", "pink", (count, len(few[0])), times)

    axes = np.zeros((count, len(machine.axes)))
    axes[:, [machine.column(name) for name in gantry.POSE]] = gantry.inverse(machine, *samples)[0]
    configurations = machine.configurations(axes[:LOOP_POINTS])
    times = seconds(rounds, lambda: machine.forward(axes, "roller"), lambda: forward_by_loop(machine, configurations))
    yield row("forward check", "framesForwardKinematics", (count, len(configurations)), times)

    job, verified = whole_job(path, fine)
    blocks = blocks_of(verified.trajectory, LOOP_POINTS)
    times = seconds(rounds, partial(job.text, verified), lambda: write_by_block([blocks]))
    yield row("NC text", "f-strings", (len(verified.trajectory), len(blocks)), times)
    del job, verified

    by_point = partial(job_by_point, part, setup, machine, LEAST_SAMPLES)
    times = seconds(rounds, partial(whole_job, path, setup), by_point)
    yield row("whole job", "point by point", (count, loop_count), times)
    # This stage is the slowest and has no required ratio, so one round is enough.
    took, clocked = clocked_job(path, fine)
    finest = row("whole job, a block a point", "point by point", (count, loop_count), [took, times[1]])
    yield replace(finest, time_law=clocked / took)


def peak_memory_gb(points: int, folder: Path) -> float:
    """Return the peak memory of `tapelayer export` on so many points, or of this process if that is larger."""
    path, setup = folder / f"{points}.txt", folder / "setup.toml"
    write_courses(path, points)
    setup.write_text(SETUP)
    command = [sys.executable, "-c", "from tapelayer.cli import main; main()", "export", str(path)]
    command += ["--setup", str(setup), "-o", str(folder / "program.nc")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return usage.ru_maxrss / 1e9 if sys.platform == "darwin" else usage.ru_maxrss / 1e6


def table(rows: Sequence[Row]) -> Table:
    """Return the rows as a table for a terminal."""
    made = Table(title="points (NC text: blocks) a second of CPU time")
    for heading in ("points", "stage", "tapelayer", "the obvious way", "by", "ratio", "asked"):
        made.add_column(heading, justify="left" if heading in ("stage", "by") else "right", no_wrap=True)
    for row in rows:
        required = f"{row.asked:g}" if row.asked else ""
        speeds = (f"{row.per_s:,.0f}", f"{row.obvious_per_s:,.0f}")
        made.add_row(f"{row.points:,}", row.stage, *speeds, row.obvious, f"{row.ratio:,.1f}", required)
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison; return 1 if the largest file misses a required ratio or the memory limit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=SIZES, help="points of the course files")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="rounds of which the best counts")
    parser.add_argument("--json", action="store_true", help="print JSON in place of a table")
    options = parser.parse_args(arguments)
    largest = max(options.points)
    with tempfile.TemporaryDirectory() as folder:
        memory = peak_memory_gb(largest, Path(folder))
        rows = [row for points in options.points for row in compared(points, Path(folder), options.rounds)]
    if options.json:
        numbers = {
            "rows": [asdict(row) | {"ratio": row.ratio} for row in rows],
            "peak_memory_gb": memory,
            "memory_limit_gb": MEMORY_LIMIT_GB,
        }
        print(json.dumps(numbers, indent=2))
    else:
        console = Console(width=120)
        console.print(table(rows))
        console.print(
            f"peak memory of tapelayer export at {largest:,} points: {memory:.2f} GB, "
            f"asked for: {MEMORY_LIMIT_GB:g} GB",
            f"time law's share of the whole job, a block a point: {100 * rows[-1].time_law:.1f} %, "
            f"asked for: {100 * TIME_LAW_LIMIT:g} %",
            sep="\n",
            highlight=False,
        )
    reached = all(row.ratio >= row.asked for row in rows if row.points == largest)
    return 0 if reached and memory < MEMORY_LIMIT_GB else 1


if __name__ == "__main__":
    sys.exit(main())
