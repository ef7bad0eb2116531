"""The obvious ways of the pipeline's benchmark do what the pipeline does, and its rows are sane."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks import control, pipeline, planning
from tapelayer.courses.course_file import read_courses
from tapelayer.geometry.curves import Curve
from tapelayer.laying.job import Job
from tapelayer.laying.placing import courses_in_machine
from tapelayer.machines import gantry
from tapelayer.plies.job import PlyJob
from tapelayer.units import MM
from tests.helpers.linuxcnc import has_linuxcnc
from tests.helpers.setups import setup_of

POINTS = 4000
SETUP = setup_of(pipeline.SETUP)
FINE = setup_of(pipeline.SETUP + pipeline.FINE)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("benchmark") / "courses.txt"
    pipeline.write_courses(path, POINTS)
    return path


@pytest.fixture(scope="module")
def job(path: Path) -> Job:
    return Job.read(path, SETUP)


def test_the_courses_are_geodesics_on_the_cylinder(path: Path) -> None:
    courses = read_courses(path)
    assert [course.number for course in courses] == [1, 2]
    for course in courses:
        assert len(course.points) == pipeline.COURSE_POINTS
        assert course.length == pytest.approx(pipeline.COURSE_LENGTH, abs=1e-9)
        away = course.points - [0.0, 1.0, -pipeline.RADIUS]
        away[:, 0] = 0.0
        assert np.max(np.abs(away - pipeline.RADIUS * course.normals)) < 5e-9
        tangents = Curve(course).at_knots()[2]
        assert np.max(np.abs(tangents[:, 0] - math.sin(pipeline.HEADING))) < 1e-5


def test_both_ways_read_the_same_numbers(path: Path) -> None:
    for rows, course in zip(pipeline.read_by_line(path), read_courses(path), strict=True):
        numbers = np.array(rows)
        assert np.array_equal(numbers[:, :3] / 1e3, course.points)
        assert np.array_equal(numbers[:, 6] / 1e3, course.arc_lengths)
        assert np.max(np.abs(numbers[:, 3:6] - course.normals)) < 2e-9


def test_both_ways_solve_the_same_inverse(job: Job) -> None:
    pytest.importorskip("pink", reason="pink is of the extra `bench`")
    samples = [values[::200] for values in pipeline.surface(job.courses, SETUP)]
    solved = pipeline.solve_by_pink(job.machine, *samples)
    assert np.max(np.abs(solved - gantry.inverse(job.machine, *samples)[0])) < 2 * pipeline.PINK_ACCURACY


def test_both_ways_give_the_same_poses(job: Job) -> None:
    q = np.random.default_rng(7).uniform(-1.0, 1.0, (100, len(job.machine.axes)))
    poses = pipeline.forward_by_loop(job.machine, job.machine.configurations(q))
    assert np.max(np.abs(poses - job.machine.forward(q, "roller"))) < 1e-12


def test_both_ways_write_the_same_blocks(path: Path) -> None:
    """Words and feeds of the longest stretch without switching or another mode, character by character."""
    job, verified = pipeline.whole_job(path, FINE)
    program = job.text(verified).decode()
    blocks = pipeline.blocks_of(verified.trajectory, len(verified.trajectory))
    # Blocks balanced about their course are about as many as its points at this tolerance.
    assert len(blocks) > 0.9 * POINTS
    ours, obvious = (
        "\n".join(line.split(" ", 1)[-1] for line in text.split("\n"))
        for text in (program, pipeline.write_by_block([blocks]))
    )
    longest = max(re.split(r"\n(?=M|G6[14])", ours), key=len).split("\n", 1)[1]
    assert longest.count("\n") > pipeline.COURSE_POINTS / 2
    assert longest in obvious


def test_both_ways_plan_the_same_poses(job: Job, path: Path) -> None:
    planned = pipeline.plan_by_point(pipeline.read_by_line(path), SETUP, job.machine)
    for blocks, course in zip(planned, courses_in_machine(job.courses, SETUP), strict=True):
        assert [code for code, _, _ in blocks] == ["G00", *["G01"] * (len(course.points) - 1)]
        joints = np.array([values[:5] for _, _, values in blocks])
        exact = gantry.inverse(job.machine, *Curve(course).at_knots())[0]
        # At a course's ends the obvious way takes a chord for the tangent.
        assert np.max(np.abs(joints - exact)[1:-1]) < 1e-6
        assert sum(spent for _, spent, _ in blocks) == pytest.approx(course.length / 0.25, rel=1e-6)


def test_both_ways_end_with_a_text_that_is_on_the_courses(job: Job, path: Path) -> None:
    _, verified = pipeline.whole_job(path, SETUP)
    assert np.max(verified.evidence.samples.position_errors) < 0.03 * MM
    assert 0.0 < pipeline.job_by_point(path, SETUP, job.machine, 4) < 0.03 * MM
    rows = pipeline.read_by_line(path)
    blocks = pipeline.read_back_by_line(pipeline.write_by_block(pipeline.plan_by_point(rows, SETUP, job.machine)))
    blocks[1][1000][2] += 0.06 * MM
    with pytest.raises(ValueError, match="off and tilted"):
        pipeline.check_by_point(blocks, rows, SETUP, job.machine, 1)


def test_rows_and_memory_are_sane(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pink", reason="pink is of the extra `bench`")
    monkeypatch.setattr(pipeline, "LEAST_TURN", 0.0)
    monkeypatch.setattr(pipeline, "PINK_POINTS", 20)
    pipeline.main(["--points", str(POINTS), "--rounds", "1", "--json"])
    numbers = json.loads(capsys.readouterr().out)
    rows = numbers["rows"]
    assert [row["stage"] for row in rows] == [*pipeline.ASKED, "whole job, a block a point"]
    assert [row["asked"] for row in rows] == [*pipeline.ASKED.values(), 0.0]
    for row in rows:
        assert row["points"] == POINTS
        assert 0.0 < row["per_s"] < math.inf
        assert row["ratio"] == row["per_s"] / row["obvious_per_s"]
    assert 0.05 < numbers["peak_memory_gb"] < numbers["memory_limit_gb"]


@pytest.mark.linuxcnc
@pytest.mark.xdist_group("control")
@pytest.mark.skipif(not has_linuxcnc(), reason="the Debian package linuxcnc-uspace is not installed")
def test_a_short_course_on_a_real_control_is_a_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A level course of 0.2 m with accelerations of its own, as a line of the table and as JSON."""
    lines = [f"{300 + 0 * y} {y} 0 0 0 1 {y}" for y in range(0, 201, 20)]
    path = tmp_path / "short.txt"
    path.write_text("\n".join(["1", "start", "90", *lines, "end", ""]), encoding="utf-8")
    rows: list[control.Row] = []
    once = control.row_of
    monkeypatch.setattr(control, "row_of", lambda *given: rows.append(once(*given)) or rows[-1])
    assert control.main([str(path), "--linear", "1500", "--rotary", "300"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 3 and shown[2].startswith("| short.txt | ") and shown[2].count("|") == shown[0].count("|")
    (row,) = rows
    assert row.reported_s > 3.0 and abs(row.off) < 0.02
    assert 0.0 < row.real_share <= 1.0 and abs(row.real_share - row.reported_share) < 0.1
    assert row.real_stops == row.reported_stops
    monkeypatch.setattr(control, "row_of", lambda *given: row)
    assert control.main([str(path), "--json", "--limit", "0"]) == int(row.off != 0.0)
    assert json.loads(capsys.readouterr().out)[0]["real_s"] == row.real_s


def test_every_stage_of_a_plan_has_its_row(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("potpourri3d", reason="potpourri3d is of the extra `bench`")
    planning.main([str(planning.EXAMPLE), "--rounds", "1", "--json"])
    (one,) = json.loads(capsys.readouterr().out)
    rows = {row["stage"]: row for row in one["rows"]}
    assert set(rows) == {*planning.STAGES, planning.WHOLE, planning.BUILT, planning.PATHS}
    assert all(row["seconds"] > 0.0 for row in rows.values())
    assert {stage for stage, row in rows.items() if row["other"] > 0.0} == {planning.BUILT, planning.PATHS}
    apart = [stage for stage in planning.STAGES if not stage.startswith("of that")]
    assert sum(rows[stage]["seconds"] for stage in apart) < rows[planning.WHOLE]["seconds"]
    # Facets of 25 mm: a path on them is near the smooth one, and not nearly as near as that is to the exact one.
    assert one["path_error_mm"] < 0.01 < one["off_mm"] < 1.0


def test_the_large_mould_takes_a_hundred_courses_of_ten_metres(tmp_path: Path) -> None:
    job = PlyJob.read(planning.write_large_ply(tmp_path))
    width, length = (np.ptp(job.mould.vertices, axis=0)[:2] - 2 * planning.INSET_MM * MM).tolist()
    assert width / job.ply.width > 100.0 and length >= 10.0 - 1e-9
