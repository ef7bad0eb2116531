"""Whole plies, from courses and a setup to NC text that was read back and judged."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import pytest

from post.controllers import load
from tapelayer.course import Course, read_courses
from tapelayer.evidence import Evidence
from tapelayer.job import Job, machine_of
from tapelayer.provenance import Provenance
from tapelayer.setup import DEG, MM, Setup
from tests.surfaces import setup_of

WIDE = "[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}\n"
CLOSED = """
[part]
l1_mm = 1200
l2_mm = -1000
[machine]
limits_deg = {c = [-330, 330], a = [-40, 40]}
[head]
run_out = "none"
wrap_compensation = false
"""
FILES = {
    "flat_panel_00": "",
    "boss_panel_20": "",
    "cylinder_panel_15": "",
    "wing_skin_00": "",
    "wing_skin_45": WIDE,
    "real/GEBracket_151": CLOSED,
}
WIDTHS = (75, 150, 300)
ANGLES = (20, 30, 60, 89.9, 90, 120, 150, 160)
NIPS = (200, 350, 500, 800)
# Every width with every angle for every file, the distance from knife to nip in turn.
MATRIX = [
    (name, width, angle, NIPS[(number + turn) % len(NIPS)])
    for number, name in enumerate(FILES)
    for turn, (width, angle) in enumerate(itertools.product(WIDTHS, ANGLES))
    if name != "real/GEBracket_151" or turn % 4 == 1
]


def job_of(courses: tuple[Course, ...], setup: Setup) -> Job:
    """Job of courses that stand in no file."""
    return Job(courses, setup, machine_of(setup), load("jb3208"), Provenance("ply", "0" * 64, "0" * 64, "0"))


def exported(job: Job) -> tuple[bytes, Evidence]:
    """NC text, and what it was judged by after it was read back."""
    text = job.text(job.plan())
    return text, job.inspector.examine(job.read_back(text, "ply.nc").trajectory, job.resolution)


@pytest.mark.parametrize(("name", "width", "angle", "nip"), MATRIX)
def test_every_shared_file_is_cut_at_any_angle(shared: Path, name: str, width: float, angle: float, nip: float) -> None:
    setup = setup_of(FILES[name]).with_values("tape", width_mm=width).with_values("head", knife_to_nip_mm=nip)
    ends = (angle * DEG, angle * DEG)
    file = read_courses(shared / "courses" / f"{name}.txt")
    courses = tuple(dataclasses.replace(course, cut_angles=ends) for course in file)
    _, evidence = exported(job_of(courses, setup))
    assert evidence.passed, evidence.worst(5)
    cuts = evidence.tape.cuts
    # Shared cuts: at least one for every course's end and one for the first leading edge.
    assert len(courses) < len(cuts) <= 2 * len(courses)
    assert max(cut.error for cut in cuts) <= 0.02 * MM
    assert max(cut.blade_error for cut in cuts) <= 0.05 * DEG
