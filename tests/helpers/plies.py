"""Plies that stand in no file: jobs of courses, and courses and setups drawn by chance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from post.controllers import Controller, load
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.jobs.job import machine_of
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.provenance import Provenance
from tapelayer.units import DEG, MM
from tests.helpers.parts import real_course, real_courses
from tests.helpers.paths import EXAMPLES
from tests.helpers.setups import CLOSED, WIDE, setup_of
from tests.helpers.surfaces import bracket_courses, helix
from urdf import TAPELAYER

T = TypeVar("T")

# What each of the plies below is laid with: the examples, closed courses, and real ones where they are there.
PLIES = {
    "flat_panel_00": "",
    "boss_panel_20": "",
    "cylinder_panel_15": "",
    "wing_skin_00": "",
    "wing_skin_45": WIDE,
    "bracket": CLOSED,
    **dict.fromkeys(real_courses("GEBracket_151"), CLOSED),
}

LIMITS = """
limits_mm = {x = [-20000, 20000], y = [-20000, 20000], z = [-20000, 20000]}
limits_deg = {c = [-720, 720], a = [-180, 180]}
"""


def courses_of(name: str) -> tuple[Course, ...]:
    """Courses of one of the plies."""
    if name == "bracket":
        return bracket_courses()
    example = EXAMPLES / f"{name}.txt"
    return read_courses(example if example.is_file() else real_course(name))


def job_of(courses: tuple[Course, ...], setup: Setup, controller: Controller | None = None) -> Job:
    """Job of courses that stand in no file."""
    made_from = Provenance("ply", "0" * 64, "0" * 64, "0")
    return Job(setup, machine_of(setup, TAPELAYER), controller or load("jb3208"), made_from, courses)


def exported(job: Job) -> tuple[bytes, Evidence]:
    """NC text, and what it was judged by after it was read back."""
    text = job.text(job.plan())
    return text, job.inspector(None).judge(job.read_back(text, "ply.nc").trajectory, job.resolution)


def cut_at(courses: tuple[Course, ...], *angles: float) -> tuple[Course, ...]:
    """The courses with the cut angles of their ends, in degrees, in turn."""
    ends = np.resize(np.array(angles) * DEG, 2 * len(courses)).reshape(-1, 2).tolist()
    return tuple(replace(course, cut_angles=(start, end)) for course, (start, end) in zip(courses, ends, strict=True))


def saddle_course(number: int, heading: float, length: float = 0.8, radius: float = 0.8, x: float = 0.8) -> Course:
    """A course straight in plan over z = (x^2 - y^2) / (2 radius), through the saddle's middle at a heading."""
    way = np.array([math.sin(heading), math.cos(heading)])
    bend = (way[0] ** 2 - way[1] ** 2) / radius
    fine = np.linspace(-length / 2, length / 2, 20001)
    # The arc length of a parabola in closed form, at plan lengths t.
    if abs(bend) < 1e-9:
        arcs = fine
    else:
        arcs = (fine * np.sqrt(1 + (bend * fine) ** 2) + np.arcsinh(bend * fine) / bend) / 2
    lengths = np.linspace(arcs[0], arcs[-1], 161)
    t = np.interp(lengths, arcs, fine)
    plan = t[:, None] * way
    points = np.column_stack([plan, bend * t**2 / 2]) + [x, 1.0, 0.0]
    normals = np.column_stack([-plan[:, 0] / radius, plan[:, 1] / radius, np.ones_like(t)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return Course(number, points, normals, lengths - lengths[0], (math.pi / 2, math.pi / 2))


class Chance:
    """What a seed draws."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def of(self, *choices: T) -> T:
        return choices[int(self._random.integers(len(choices)))]

    def between(self, low: float, high: float) -> float:
        return float(self._random.uniform(low, high))

    def scaled(self, low: float, high: float) -> float:
        """Between two numbers, small and large ones alike."""
        return math.exp(self.between(math.log(low), math.log(high)))

    def ply(self) -> tuple[tuple[Course, ...], Setup]:
        """One to five courses and a setup."""
        courses: list[Course] = []
        end = self.between(15.0, 165.0)
        for number in range(1, self.of(1, 2, 3, 4, 5) + 1):
            start = self._angle(end)
            end = self.of(start, start, self._angle(start))
            courses.append(self._course(number, start * DEG, end * DEG))
        return tuple(courses), self._setup()

    def _angle(self, before: float) -> float:
        """A cut angle in degrees; often square, nearly so, that of the cut before, or its mirror image."""
        near = 90.0 + self.of(-1.0, 1.0) * self.scaled(1e-4, 3.0)
        any_angle = self.between(15.0, 165.0)
        rare = self.between(5.0, 15.0) if self.of(*range(10)) == 0 else any_angle
        return self.of(90.0, near, before, before, 180.0 - before, rare, any_angle, any_angle)

    def _course(self, number: int, start: float, end: float) -> Course:
        """Level, over a cylinder or through a hollow one, 20 mm to 5 m long, any heading."""
        length = self.scaled(0.02, 5.0)
        heading = self.of(self.between(-math.pi, math.pi), math.pi / 4 * self.of(-2, 0, 1, 2, 4))
        place = np.array([self.between(0.0, 2.0), self.between(-1.0, 1.0), 0.0])
        turning = length * abs(math.cos(heading))
        radius = max(self.scaled(0.1, 5.0), turning / self.between(0.3, 1.2))
        count = max(5, int(length / self.scaled(5 * MM, 50 * MM)), int(turning / radius / 0.05)) + 2
        arcs = np.linspace(0.0, length, count)
        middle = -turning / radius / 2 * math.copysign(1.0, math.cos(heading))
        points, normals, _ = helix(arcs, radius=radius, heading=heading, start=(0.0, middle))
        shape = self.of("level", "cylinder", "cylinder", "hollow")
        if shape == "level":
            points = arcs[:, None] * np.array([math.sin(heading), math.cos(heading), 0.0])
            normals = np.tile([0.0, 0.0, 1.0], (count, 1))
        if shape == "hollow":
            # The same way round, on the inner side below the axis.
            axis, normals = points - radius * normals, normals * [1.0, -1.0, 1.0]
            points = axis - radius * normals + [0.0, 0.0, 2 * radius]
        return Course(number, points + place, normals, arcs, (start, end))

    def _setup(self) -> Setup:
        """Widths, speeds and measures that belong together, and some that do not."""
        knives = self.of(1000.0, 1000.0, self.scaled(5.0, 1000.0))
        shoe, roller, knife, heater = [self.of(0, 20, 55, 150, 400) for _ in range(4)] if self._rarely() else [0] * 4
        clearance = f"link_clearance_mm = {self.of(0, 10, 120)}" if self._rarely() else ""
        return setup_of(f"""
[machine]
{"" if self.of(*range(12)) == 0 else LIMITS}
speeds_mm_per_s = {{v = {knives}, q = {knives}, z = {self.of(500, 50)}}}
speeds_deg_per_s = {{d = {self.of(180, 20)}, c = {self.of(60, 6)}}}
[part]
rotation_deg = {self.of(0.0, 0.0, self.between(-180.0, 180.0))}
laid_thickness_mm = {self.of(0, 0, 1.5)}
[tape]
width_mm = {self.of(75.0, 150.0, 300.0, self.between(6.0, 385.0))}
roll_length_m = {self.of(150.0, 150.0, self.between(2.0, 12.0))}
[head]
knife_to_nip_mm = {self.between(200.0, 800.0)}
knife_clearance_mm = {self.of(10, 10, 0, 3.7)}
scrap_margin_mm = {self.of(5.0, 5.0, 0.0, self.between(0.0, 50.0))}
blade_length_mm = {101 if self.of(*range(20)) == 0 else self.of(20, 99.9)}
aux_roller_lag_mm = {self.of(60.0, 60.0, 0.0, self.between(0.0, 200.0))}
run_out = "{self.of("tangent", "none")}"
wrap_compensation = {self.of("true", "true", "false")}
heater_stop_s = {self.of(2, 0, 0.3)}
delays_ms = {{shoe = {shoe}, roller = {roller}, knife = {knife}, heater = {heater}}}
[process]
lay_speed_mm_per_s = {self.of(250.0, self.scaled(10.0, 1000.0))}
thread_speed_mm_per_s = {self.of(250.0, self.scaled(10.0, 1000.0))}
approach_mm = {self.of(50, 50, 5, 100)}
kinematics = "{self.of("roller", "roller", "roller", "roller", "published")}"
{clearance}
""")

    def _rarely(self) -> bool:
        return self.of(*range(5)) == 0
