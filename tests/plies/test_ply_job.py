"""A ply becomes a course file that reads back as planned, a report of every figure, and a page with maps."""

from __future__ import annotations

import hashlib
import io
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from rich.console import Console

from tapelayer import CoursePlan, Ply, plan_courses
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import MeshRefused, PlyRefused
from tapelayer.geometry.models import parse_mesh
from tapelayer.plies.failures import judged
from tapelayer.plies.job import PlyJob
from tapelayer.plies.laid_ply import Fault
from tapelayer.plies.limits import limits_of
from tapelayer.plies.ply import parse_ply
from tapelayer.plies.quantities import ROWS
from tapelayer.provenance import unedited
from tapelayer.reporting.quantity import quantities
from tapelayer.reporting.subject import Occasion
from tests.helpers.domes import PLY, STRICT, dome, job_on_dome, planned

KEYS = """courses laid_length_m ply_area_m2 coverage_percent gap_area_cm2 overlap_area_cm2 overhang_percent max_gap_mm
max_overlap_mm max_strain_percent max_lift_mm max_angle_deviation_deg least_cut_angle_deg least_breadth_mm
shortest_course_mm lengthened laid_through off_mould_mm surface_residual_mm surface_ambiguity_mm off_facets_mm
path_error_mm spacing_error_mm""".split()
OCCASION = Occasion("courses.txt", "job.toml", "2026-01-01T00:00:00Z")
# A ply with a hole that its courses are laid through.
HOLED = PLY.replace(
    "inset_mm = 90",
    "boundary = [[90, 90, -4], [310, 90, -4], [310, 410, -4], [90, 410, -4]]\n"
    "holes = [[[160, 240, 0], [240, 240, 0], [240, 262, 0], [160, 262, 0]]]",
)


def test_the_course_file_reads_back_as_planned_and_says_what_it_is() -> None:
    made = planned()
    assert made.failure is None
    courses = parse_courses(made.text, "courses.txt")
    assert [course.number for course in courses] == list(range(1, len(courses) + 1))
    for read, written in zip(courses, made.courses, strict=True):
        assert np.array_equal(read.points, written.points) and read.cut_angles == written.cut_angles
    assert unedited(made.text) and not unedited(made.text.replace(b"start", b"Start", 1))
    head = made.text[: made.text.index(b"\n1\n")].decode()
    assert all(line.startswith("# ") for line in head.split("\n"))
    assert "ply: one.toml, angle 20 deg, width 50 mm" in head
    assert f"mould: dome.stl in mm\n# mould sha256: {hashlib.sha256(dome()).hexdigest()}" in head
    assert made.job.sha256 in head


def test_the_same_ply_gives_the_same_bytes() -> None:
    again = job_on_dome().make("courses.txt")
    assert again.text == planned().text
    assert again.report_file(OCCASION) == planned().report_file(OCCASION)


def test_the_report_has_every_figure() -> None:
    report = planned().report(OCCASION)
    assert [row.key for row in quantities(ROWS)] == sorted(KEYS, key=[row.key for row in quantities(ROWS)].index)
    assert set(KEYS) == {row.key for row in quantities(ROWS)} and all(report[key] is not None for key in KEYS)
    assert limits_of(planned().job.ply).keys() <= set(KEYS)
    assert report["passed"] and report["failures"] == []
    assert report["subject"]["courses"] == {
        "name": "courses.txt",
        "sha256": hashlib.sha256(planned().text).hexdigest(),
    }
    assert report["subject"]["setup"]["name"] == "one.toml"
    assert report["subject"]["sources"][0]["name"] == "dome.stl"


def test_figures_of_a_dome() -> None:
    report = planned().report()
    assert report["ply_area_m2"] == pytest.approx(0.22 * 0.32, rel=2e-3)
    assert report["coverage_percent"] + 100 * report["gap_area_cm2"] * 1e-4 / report["ply_area_m2"] == pytest.approx(
        100
    )
    # Strain is K w^2 / 8, lift w^2 / 8 R.
    assert report["max_strain_percent"] == pytest.approx(100 * 0.05**2 / 8 / 25, rel=0.02)
    assert report["max_lift_mm"] == pytest.approx(50**2 / 8 / 5000, rel=0.01)
    assert -report["max_overlap_mm"] > 0 and report["max_gap_mm"] < 1.0
    assert report["laid_length_m"] == pytest.approx(sum(course["length_mm"] for course in report["course_list"]) / 1e3)
    assert report["max_gap_mm"] == pytest.approx(max(gap["largest_mm"] for gap in report["gap_list"]))
    tape = planned().evidence.ledger.tape
    assert tape == pytest.approx(0.05 * report["laid_length_m"], rel=1e-3)
    assert report["judgement"]["coverage_percent"] == pytest.approx(report["coverage_percent"], abs=0.1)


def test_what_is_not_kept_is_said_with_courses_place_and_remedy() -> None:
    made = planned(STRICT)
    assert made.failure is not None and made.failure.exit_code == 1
    report = made.report()
    assert not report["passed"]
    told = {failure["what"] for failure in report["failures"]}
    assert {"gap_mm", "strain_percent"} <= told
    gap = next(failure for failure in report["failures"] if failure["what"] == "gap_mm")
    assert re.fullmatch(
        r"courses \d+ and \d+: gap of 0\.\d\d mm at \(\d+\.\d, \d+\.\d, -?\d+\.\d\), expected at most 0\.01: "
        r"use narrower tape, or allow overlap with gap\.least_mm = -0\.\d\d",
        gap["sentence"],
    )
    assert len(gap["courses"]) == 2 and gap["value"] > gap["limit"] == 0.01
    x, y, _ = gap["place_mm"]
    assert 50 < x < 350 and 50 < y < 450
    # The judge finds the same gaps; each is told once.
    sentences = [failure["sentence"] for failure in report["failures"]]
    names = [re.match(r"courses (\d+ and \d+): gap", sentence) for sentence in sentences]
    pairs = [name[1] for name in names if name]
    assert pairs and len(pairs) == len(set(pairs))


def test_faults_of_the_judge_are_failures_unless_they_are_told_already() -> None:
    faults = [Fault("courses 1 and 2: gap of 3.1 mm at here", (1, 2)), Fault("the ply has no spot", ())]
    first, second = judged(faults)
    assert (first.number, first.courses, second.number) == (1, (1, 2), 0)
    own = (replace(first, text="courses 1 and 2: gap of 3 mm at there"),)
    assert [failure.text for failure in judged(faults, own)] == ["the ply has no spot"]


@pytest.mark.parametrize("text", [PLY, STRICT, HOLED])
def test_the_page_has_a_map_of_everything(text: str) -> None:
    page = planned(text).page(OCCASION)
    labels = re.findall(r'aria-label="([^"]*)"', page)
    for label in ("courses", "gap between neighbours, mm", "strain, %", "lift, mm", "off the angle, deg"):
        assert label in labels
    assert "surface residual, mm" in labels and "overhang, gaps and overlaps" in labels
    assert page.startswith("<!DOCTYPE html>") and "nan" not in page.lower().replace("finance", "")
    verdict = re.search(r'<p class="verdict (\w+)">([^<]*)', page)
    assert verdict and verdict[1] == ("failed" if planned(text).failure else "passed")
    for failure in planned(text).evidence.failures:
        assert failure.sentence() in unescape(page)


def test_a_chinese_page_says_failures_in_chinese() -> None:
    page = unescape(planned(STRICT).page(OCCASION, "zh"))
    assert "处间隙为" in page and "expected at most" not in page


def test_the_worst_of_a_map_is_that_of_the_report() -> None:
    made = planned()
    report, page = made.report(), made.page()
    assert f"strain: at most {report['max_strain_percent']:.4g} %" in page
    assert f"lift: at most {report['max_lift_mm']:.4g} mm" in page
    assert f"off the angle: at most {report['max_angle_deviation_deg']:.4g} deg" in page


def test_the_summary_speaks_both_languages() -> None:
    for language, words in (("en", "coverage"), ("zh", "覆盖率")):
        shown = io.StringIO()
        Console(file=shown, width=200).print(planned().summary(language))  # type: ignore[arg-type]
        assert words in shown.getvalue()


def test_ribbons_are_the_tapes_that_are_laid() -> None:
    drawing = planned().drawing()
    assert len(drawing.ribbons) == len(drawing.courses) > 3
    for course, ribbon in zip(drawing.courses, drawing.ribbons, strict=True):
        assert ribbon.number == course.number and np.all(np.diff(ribbon.arcs) >= 0)
        square = (ribbon.arcs > 0.1) & (ribbon.arcs < course.length - 0.1)
        widths = np.linalg.norm(ribbon.left - ribbon.right, axis=1)
        assert np.allclose(widths[square], 0.05, atol=1e-5) and np.max(widths) < 0.0501
        # Travel, then left of it, then the normal: right-handed.
        middle = len(course.points) // 2
        travel = course.points[middle + 1] - course.points[middle]
        at = int(np.argmin(np.abs(ribbon.arcs - course.length / 2)))
        assert np.cross(travel, ribbon.left[at] - ribbon.right[at]) @ course.normals[middle] > 0
    (ring,) = drawing.rings
    assert np.all(ring[:, 0] > 0.089) and np.all(ring[:, 0] < 0.311)
    assert {(line.right, line.left) for line in drawing.gaps} == {(n, n + 1) for n in range(1, len(drawing.courses))}


def test_ribbons_of_courses_laid_back_are_turned() -> None:
    made = planned(f'{PLY}[courses]\norder = "there_and_back"\n')
    back = made.drawing().ribbons[1]
    course = made.courses[1]
    at = int(np.argmin(np.abs(back.arcs - course.length / 2)))
    middle = (back.left[at] + back.right[at]) / 2
    assert np.min(np.linalg.norm(course.points - middle, axis=1)) < 0.006
    assert np.linalg.norm(middle - course.points[0]) == pytest.approx(course.length / 2, abs=0.01)


def test_notes_name_what_was_done_beyond_the_ply() -> None:
    notes = planned(HOLED).notes()
    assert any("laid through interruptions shorter than 100 mm" in note for note in notes)
    assert any("直接铺过" in note for note in planned(HOLED).notes("zh"))
    assert planned(HOLED).report()["laid_through"] >= 1


def test_the_stagger_that_is_told_leaves_no_sliver() -> None:
    sliver = f"{PLY}[courses]\nstagger_mm = %s\n"
    for stagger in (0.0, 10.0, 20.0, 30.0, 40.0):
        made = planned(sliver % stagger)
        if (better := made.evidence.better_stagger) is not None:
            assert any("would leave no sliver" in note for note in made.notes())
            again = planned(sliver % round(better * 1e3, 1))
            assert again.report()["least_breadth_mm"] > 12.0
            return
    pytest.fail("none of the staggers leaves a sliver")


def test_courses_by_the_function_are_those_of_the_job() -> None:
    ply = parse_ply(PLY.encode(), "one.toml")
    plan = plan_courses(ply, parse_mesh(dome(), "dome.stl"))
    assert isinstance(plan, CoursePlan) and isinstance(ply, Ply)
    assert len(plan.courses) == len(planned().courses)
    assert np.array_equal(plan.courses[0].points, planned().courses[0].points)


def test_files_that_are_missing_are_named(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "one.toml"
    file.write_text(PLY)
    with pytest.raises(MeshRefused, match=r"dome\.stl: cannot be read: no such file"):
        PlyJob.read(file)
    (tmp_path / "dome.stl").write_bytes(dome())
    file.write_text(PLY.replace("inset_mm = 90", 'boundary = "outline.txt"'))
    with pytest.raises(PlyRefused, match=r"outline\.txt: cannot be read: no such file"):
        PlyJob.read(file)
    (tmp_path / "outline.txt").write_text("90 90 -4\n310 90 -4\n310 410 -4\n90 410 -4\n")
    job = PlyJob.read(file)
    assert [source.name for source in job.sources] == ["dome.stl", "outline.txt"]
    assert b"# boundary: outline.txt" in job.text(planned().courses)
