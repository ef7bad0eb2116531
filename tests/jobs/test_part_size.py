"""Part size: a part of a size that is none for the machine is asked about, with the units that would fit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.courses.course_file import format_courses
from tapelayer.errors import CourseFileRefused, InputRefused, MeshRefused
from tapelayer.jobs.part_size import MOST_TRAVELS, check_size
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.spraying.job import SprayJob
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import METRES, Unit
from tests.helpers.plies import courses_of
from tests.helpers.stl_files import TETRAHEDRON, binary

MACHINE = Machine.load()
TRAVEL = max(axis.upper - axis.lower for axis in MACHINE.axes if axis.name in "xyz")
TAPE = ("the tape", 0.075)


def asked(sides: tuple[float, float, float], unit: Unit) -> str:
    """The sentence about a part with these sides in metres, without its file's name."""
    with pytest.raises(InputRefused) as caught:
        check_size(np.array([[0.0, 0.0, 0.0], sides]) + 5.0, unit, MACHINE, TAPE, "f", InputRefused)
    return str(caught.value).removeprefix("f: ")


@pytest.mark.parametrize(
    ("sides", "unit", "sentence"),
    [
        (
            (0.480e-3, 0.320e-3, 0.0),
            "mm",
            "the part measures 0.48 x 0.32 x 0 mm, less than the tape of 75 mm: is its unit mm? It would be as cm "
            "4.8 x 3.2 x 0 mm, as m 480 x 320 x 0 mm, as in 12.2 x 8.13 x 0 mm; give --unit m",
        ),
        (
            (480.0, 320.0, 1.5),
            "m",
            f"the part measures 480 x 320 x 1.5 m, far more than the machine's travel of {TRAVEL:g} m: is its unit m? "
            "It would be as mm 480 x 320 x 1.5 mm, as cm 4800 x 3200 x 15 mm, as in 12.2 x 8.13 x 0.0381 m; "
            "give --unit mm",
        ),
        (
            (1e-9, 0.0, 0.0),
            "mm",
            "the part measures 1e-06 x 0 x 0 mm, less than the tape of 75 mm: is its unit mm? It would be as cm "
            "1e-05 x 0 x 0 mm, as m 0.001 x 0 x 0 mm, as in 2.54e-05 x 0 x 0 mm; none fits: is it damaged, or the "
            "wrong file?",
        ),
    ],
)
def test_the_question_names_every_unit_and_those_that_fit(
    sides: tuple[float, float, float], unit: Unit, sentence: str
) -> None:
    assert asked(sides, unit) == sentence


@given(st.floats(TAPE[1], TRAVEL), st.sampled_from([*METRES]), st.sampled_from([*METRES]))
def test_the_unit_of_the_file_is_advised_whatever_it_was_read_as(side: float, true: Unit, read_as: Unit) -> None:
    """A part that fits the machine passes in its unit; in another it passes as a part of that size, or is asked."""
    check_size(np.array([[0.0, 0.0, 0.0], [side, 0.0, 0.0]]), true, MACHINE, TAPE, "f", InputRefused)
    wrong = side / METRES[true] * METRES[read_as]
    if TAPE[1] <= wrong <= MOST_TRAVELS * TRAVEL:
        return
    advised = re.findall(r"--unit (\w+)", asked((wrong, 0.0, 0.0), read_as))
    assert read_as not in advised
    assert true in advised or not TAPE[1] * (1 + 1e-9) < side < TRAVEL * (1 - 1e-9)


@pytest.mark.parametrize("unit", METRES)
def test_a_ply_in_any_unit_is_one_ply(unit: Unit) -> None:
    data = format_courses(courses_of("bracket"))
    lines = []
    for line in data.decode().splitlines():
        words = line.split()
        if len(words) == 7:
            scale = 1e-3 / METRES[unit]
            words = [repr(float(word) * (1.0 if 3 <= at <= 5 else scale)) for at, word in enumerate(words)]
        lines.append(" ".join(words))
    job = Job.of("\n".join(lines).encode(), "ply.txt", Setup(), unit)
    for course, other in zip(job.courses, Job.of(data, "ply.txt", Setup()).courses, strict=True):
        np.testing.assert_allclose(course.points, other.points, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(course.arc_lengths, other.arc_lengths, rtol=1e-12, atol=1e-15)
        np.testing.assert_array_equal(course.normals, other.normals)
    assert job.provenance.notes == (() if unit == "mm" else (f"courses in {unit}",))


def test_jobs_ask() -> None:
    data = format_courses(courses_of("bracket"))
    with pytest.raises(CourseFileRefused, match=r"ply\.txt: the part measures .* m, far more than .*; give --unit mm"):
        Job.of(data, "ply.txt", Setup(), "m")
    for scale, unit in ((1e-3, "mm"), (1.0, "m")):
        with pytest.raises(MeshRefused, match=r"^part\.stl: the part measures .*: is its unit m?m\? It would be as"):
            SprayJob.of(binary(TETRAHEDRON * scale), "part.stl", SpraySetup(), unit)  # type: ignore[arg-type]
