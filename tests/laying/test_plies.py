"""Whole plies, from courses and a setup to NC text that was read back and judged."""

from __future__ import annotations

import itertools
import re
from collections import Counter

import numpy as np
import pytest

from post import program
from post.controllers import load
from tapelayer.errors import (
    AxisBeyondTravel,
    BladesMeet,
    CourseLongerThanRoll,
    CutAngleTooSmall,
    CutsCross,
    NotWritable,
    PartTooHigh,
    PoseUndefined,
    TapeRunsBack,
    TapeWiderThanTravel,
)
from tapelayer.units import DEG, MM
from tests.helpers.plies import PLIES, Chance, courses_of, cut_at, exported, job_of, saddle_course
from tests.helpers.replay import faults_of_the_tape, replayed
from tests.helpers.setups import CLOSED, setup_of
from tests.helpers.surfaces import flat_course, helix_course

WIDTHS = (75, 150, 300)
ANGLES = (20, 60, 89.9, 90, 120, 160)
NIPS = (200, 350, 500, 800)
# Every width with every angle for every ply, the distance from knife to nip in turn.
MATRIX = [
    (name, width, angle, NIPS[(number + turn) % len(NIPS)])
    for number, name in enumerate(PLIES)
    for turn, (width, angle) in enumerate(itertools.product(WIDTHS, ANGLES))
    if PLIES[name] != CLOSED or turn % 4 == 1
]


@pytest.mark.parametrize(("name", "width", "angle", "nip"), MATRIX)
def test_every_ply_is_cut_at_any_angle(name: str, width: float, angle: float, nip: float) -> None:
    setup = setup_of(PLIES[name]).with_values("tape", width_mm=width)
    setup = setup.with_values("head", **(setup.head.model_dump(exclude_unset=True) | {"knife_to_nip_mm": nip}))
    job = job_of(cut_at(courses_of(name), angle), setup)
    text, evidence = exported(job)
    assert evidence.passed, evidence.worst(5)
    cuts = evidence.tape.cuts
    # Shared cuts: at least one for every course's end and one for the first leading edge.
    assert len(job.courses) < len(cuts) <= 2 * len(job.courses)
    assert max(cut.error for cut in cuts) <= 0.02 * MM
    assert max(cut.blade_error for cut in cuts) <= 0.05 * DEG
    assert faults_of_the_tape(text, job.courses, setup, job.machine) == []


BESIDE = tuple(helix_course(k, length=0.3, start=(0.4 + 0.1 * k, 0.0)) for k in (1, 2, 3))


def test_a_sweep_from_course_to_course_takes_the_head_along_by_feed() -> None:
    """No rapid stands between the courses, and the first block of the second states every axis."""
    text, evidence = exported(job_of(cut_at(BESIDE, 20), setup_of("[head]\nknife_to_nip_mm = 400")))
    assert evidence.passed
    first, second = text.decode().split("(course 2 of 3)")[0], text.decode().split("(course 2 of 3)")[1]
    assert first.count("M22") + first.count("M32") > first.count("M23") + first.count("M33")
    second = second.split("(course 3 of 3)")[0]
    assert "G00" not in second
    assert re.search(r"G01 X\S+ Y\S+ Z\S+ A\S+ C\S+ U\S+ V\S+ Q\S+ D\S+ E\S+ F", second)


@pytest.mark.parametrize(("angle", "sweep_to_end"), [(90, False), (20, True)])
def test_tape_is_taken_back_in_the_air_with_both_knives_up(angle: float, sweep_to_end: bool) -> None:
    """The nip stands farther forward where a course begins than where one ends falling; sweeps are finished first."""
    job = job_of(cut_at(BESIDE, angle), setup_of("[head]\nknife_to_nip_mm = 400"))
    text, evidence = exported(job)
    assert evidence.passed
    assert faults_of_the_tape(text, job.courses, job.setup, job.machine) == []
    tape = replayed(text)
    back = [lift - touch["U"] for lift, touch in zip(tape.lifts, tape.touches[1:], strict=False)]
    assert min(back) > 7 * MM
    assert (evidence.tape_taken_back > max(back) + 100 * MM) == sweep_to_end
    if not sweep_to_end:
        assert evidence.tape_taken_back == pytest.approx(max(back), abs=1e-9)


@pytest.mark.parametrize("angle", [20, 90, 130])
def test_tape_over_a_saddle_is_fed_with_the_wrap(angle: float) -> None:
    """Climbing and falling, level and hollow: the nip moves round the roller, and every cut is where it belongs."""
    courses = tuple(saddle_course(k + 1, heading) for k, heading in enumerate((0.0, 0.5, 0.8, 1.2)))
    job = job_of(cut_at(courses, angle), setup_of("[machine]\nlimits_deg = {c = [-180, 180], a = [-60, 60]}"))
    text, evidence = exported(job)
    assert evidence.passed, evidence.worst(5)
    wraps = [evidence.samples.wraps[evidence.samples.courses == course] for course in range(4)]
    assert max(np.ptp(wrap) for wrap in wraps) * 40 > 10.0
    assert evidence.tape_taken_back > 10 * MM
    assert faults_of_the_tape(text, job.courses, job.setup, job.machine) == []


def test_a_ply_beyond_the_longest_word_is_refused_by_name() -> None:
    courses = tuple(flat_course(k, length=1.0, n=3, x=0.05 * k) for k in range(1, 12))
    short = load("jb3208").model_copy(update={"max_word": 9999.999})
    with pytest.raises(NotWritable, match=r"axis u would be at \d+\.\d+ mm, beyond the largest word.*9999\.999"):
        exported(job_of(courses, setup_of(), short))
    assert exported(job_of(courses, setup_of()))[1].passed


REFUSALS = {
    AxisBeyondTravel: r"axis [a-z] would be at .* beyond its bound",
    BladesMeet: r"blades of .* blade_length_mm must not be more",
    CourseLongerThanRoll: r"course \d+: .* a roll holds",
    CutAngleTooSmall: r"course \d+: its .* deg, less than minimum_cut_angle_deg",
    CutsCross: r"course \d+: its cuts at .* must be longer than",
    PartTooHigh: r"axis z at the end of its travel.*l3_mm",
    PoseUndefined: r"course \d+ point \d+: ",
    TapeRunsBack: r"course \d+ point \d+: the tape would run back",
    TapeWiderThanTravel: r"the widest tape is",
}


def outcome(seed: int) -> str:
    """What becomes of a seed's ply: a verified program whose tape is right, or a refusal that says what and why."""
    courses, setup = Chance(seed).ply()
    job = job_of(courses, setup)
    try:
        text, evidence = exported(job)
    except tuple(REFUSALS) as refused:
        assert re.search(REFUSALS[type(refused)], str(refused)), f"seed {seed}: {refused}"
        return type(refused).__name__
    assert evidence.passed, f"seed {seed}: {evidence.worst(5)}"
    if not (setup.head.delays_ms.shoe or setup.head.delays_ms.knife):
        assert faults_of_the_tape(text, courses, setup, job.machine) == [], f"seed {seed}"
    return "verified"


@pytest.mark.parametrize("control", ["linuxcnc", "linuxcnc_remap", "sinumerik840d"])
@pytest.mark.parametrize("seed", [38, 129, 150])
def test_the_head_waits_for_slow_actuators_by_dwells_of_any_control(seed: int, control: str) -> None:
    """Half a millisecond of a dwell would be an eighth of a millimetre of tape."""
    courses, setup = Chance(seed).ply()
    assert setup.head.delays_ms.shoe >= 150
    _, evidence = exported(job_of(courses, setup, load(control)))
    assert evidence.passed, evidence.worst(5)


def test_words_that_lead_their_effects_stand_between_straight_blocks() -> None:
    """An arc takes another time than the blocks by which a word was placed."""
    courses, setup = Chance(802).ply()
    assert setup.head.delays_ms.knife >= 150
    job = job_of(courses, setup)
    assert b" G02 " in program.write(job.plan(), job.controller, job.provenance)
    text, evidence = exported(job)
    assert evidence.passed, evidence.worst(5)
    assert b" G02 " not in text and b" G03 " not in text


@pytest.mark.parametrize(
    "seeds",
    [range(250), *(pytest.param(range(low, low + 250), marks=pytest.mark.slow) for low in range(250, 2000, 250))],
    ids=lambda seeds: f"{seeds.start}-{seeds.stop}",
)
def test_every_ply_is_verified_or_refused_by_name(seeds: range) -> None:
    outcomes = Counter(outcome(seed) for seed in seeds)
    assert outcomes["verified"] > len(seeds) / 2
    assert len(outcomes) > 4
