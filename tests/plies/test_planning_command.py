"""The command that plans: what it writes, says and returns."""

from __future__ import annotations

import json
import tomllib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from tapelayer.courses.course_file import read_courses
from tapelayer.plies.ply import Ply
from tapelayer.units import MM
from tests.helpers.brep_files import panel, write_iges, write_step
from tests.helpers.domes import PLY, STRICT, dome, planned
from tests.test_cli import names, run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a mould, a ply that keeps its limits, and one that does not."""
    (tmp_path / "dome.stl").write_bytes(dome())
    (tmp_path / "one.toml").write_text(PLY)
    (tmp_path / "strict.toml").write_text(STRICT)
    return tmp_path


def test_courses_and_reports_are_written_together(folder: Path) -> None:
    done = run("plan", "one.toml", "--report", "one.json", "--html", "one.html", cwd=folder)
    assert names(folder) == {"dome.stl", "one.toml", "strict.toml", "one.txt", "one.json", "one.html"}
    assert (folder / "one.txt").read_bytes() == planned().text
    report = json.loads((folder / "one.json").read_bytes())
    assert report["passed"] and report["subject"]["judged_at"] == "2026-01-01T00:00:00Z"
    assert report["subject"]["courses"]["name"] == "one.txt"
    assert "one.txt: 7 courses, judged" in done.stdout and "coverage" in done.stdout
    # What it wrote, it replaces; what was edited, it does not.
    run("plan", "one.toml", "--quiet", cwd=folder)
    (folder / "one.txt").write_bytes(b"# mine\n" + planned().text)
    refused = run("plan", "one.toml", cwd=folder, expect=2)
    assert "one.txt: holds what tapelayer did not write, or what was edited since" in refused.stderr


def test_a_limit_that_is_not_kept_withholds_the_courses_alone(folder: Path) -> None:
    done = run("plan", "strict.toml", "-o", "c.txt", "--report", "s.json", "--html", "s.html", cwd=folder, expect=1)
    assert names(folder) == {"dome.stl", "one.toml", "strict.toml", "s.json", "s.html"}
    assert "use narrower tape, or allow overlap with gap.least_mm" in done.stderr
    assert not json.loads((folder / "s.json").read_bytes())["passed"]
    assert "FAILED" in done.stdout and "judged" not in done.stdout.splitlines()[-1]


@pytest.mark.skipif(find_spec("OCP") is None, reason="the extra step is not installed")
def test_moulds_of_faces_give_the_same_courses(folder: Path) -> None:
    """A patch of a torus as STEP and, in inches, as IGES: courses on the torus itself."""
    major, minor = 4000.0, 2000.0
    write_step(folder / "mould.step", panel(major, minor, 600.0, 400.0))
    write_iges(folder / "mould.iges", panel(major, minor, 600.0, 400.0), "INCH")
    found = []
    for form in ("step", "iges"):
        (folder / "job.toml").write_text(f'[mould]\nfile = "mould.{form}"\n[ply]\nangle_deg = 30\ninset_mm = 20\n')
        run("plan", "job.toml", "-o", f"{form}.txt", cwd=folder)
        found.append(np.concatenate([course.points for course in read_courses(folder / f"{form}.txt")]))
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=2e-6)
    x, y, z = found[0].T / MM
    assert np.hypot(np.hypot(x, z + major + minor) - major, y) == pytest.approx(np.full(len(x), minor), abs=0.002)
    (folder / "mould.step").write_bytes((folder / "mould.step").read_bytes()[:2000])
    (folder / "job.toml").write_text('[mould]\nfile = "mould.step"\n[ply]\nangle_deg = 30\n')
    refused = run("plan", "job.toml", cwd=folder, expect=2)
    assert "mould.step: this STEP model cannot be read" in refused.stderr


def test_the_report_goes_to_stdout(folder: Path) -> None:
    done = run("plan", "one.toml", "--json", cwd=folder)
    assert json.loads(done.stdout)["courses"] == 7
    assert "coverage" in done.stderr


def test_straight_on_to_the_program(folder: Path) -> None:
    (folder / "job.toml").write_text("[tape]\nwidth_mm = 40\n[part]\nl2_mm = -800\n")
    done = run("plan", "one.toml", "--setup", "job.toml", "--export", "-o", "dome.nc", cwd=folder)
    assert {"dome.txt", "dome.nc"} <= names(folder)
    assert "dome.txt: " in done.stdout and "dome.nc: " in done.stdout and "verified" in done.stdout
    # The setup's tape goes before the ply's.
    assert b"width 40 mm" in (folder / "dome.txt").read_bytes()[:400]
    assert "c turns from " in done.stderr and "within its travel of -30 to 30" in done.stderr
    run("verify", "dome.nc", "dome.txt", "--setup", "job.toml", "--quiet", cwd=folder)


def test_the_travel_that_an_order_needs_is_told_before_anything_is_exported(folder: Path) -> None:
    (folder / "back.toml").write_text(f'{PLY}[courses]\norder = "there_and_back"\n')
    (folder / "job.toml").write_text("[tape]\nwidth_mm = 50\n")
    done = run("plan", "back.toml", "--setup", "job.toml", cwd=folder)
    assert "beyond its travel of -30 to 30: turn the part by [part], lay the courses one way" in done.stderr
    assert "back.txt" in names(folder)


def test_a_foreign_course_file_is_judged(folder: Path) -> None:
    run("plan", "one.toml", "--quiet", cwd=folder)
    before = names(folder)
    done = run("plan", "one.toml", "--judge", "one.txt", "--report", "j.json", cwd=folder)
    assert names(folder) - before == {"j.json"} and json.loads((folder / "j.json").read_bytes())["passed"]
    assert "passed" in done.stdout
    text = (folder / "one.txt").read_text()
    # The third course is left out.
    first, last = text.index("\n3\nstart"), text.index("\n4\nstart")
    (folder / "less.txt").write_text(text[:first] + text[last:])
    failed = run("plan", "one.toml", "--judge", "less.txt", cwd=folder, expect=1)
    assert failed.stderr.startswith("less.txt: ") and "gap of" in failed.stderr


def test_a_ply_file_to_begin_with(folder: Path) -> None:
    text = run("setup", "--kind", "plan", cwd=folder).stdout
    assert {"mould", "ply", "tape", "gap", "courses", "limits"} == tomllib.loads(text).keys()
    (folder / "all.toml").write_text(text)
    assert Ply.read(folder / "all.toml").mould.file == str(folder / "mould.stl")
    told = run("quantities", "--kind", "plan", cwd=folder).stdout
    assert "max_strain" in told and "limit" in told


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-o", "-"], "-o: expected the name of a file, got '-'; courses go to a file"),
        (["-o", "dome.nc"], "-o: dome.nc names a program; add --export, or name the course file"),
        (["--judge", "c.txt", "--export"], "--export: goes with planning, and --judge plans nothing"),
        (["--judge", "c.txt", "--html", "c.html"], "--html: goes with planning, and --judge plans nothing"),
        (["-o", "dome.stl"], "dome.stl: is the same file as the input"),
        (["-o", "one.toml"], "one.toml: is the same file as the input one.toml"),
        (["--judge", "c.txt"], "c.txt: cannot be read: no such file or directory"),
    ],
)
def test_options_that_do_not_fit(folder: Path, arguments: list[str], sentence: str) -> None:
    before = names(folder)
    assert sentence in run("plan", "one.toml", *arguments, cwd=folder, expect=2).stderr
    assert names(folder) == before


def test_files_that_are_something_else_are_named(folder: Path) -> None:
    assert "dome.stl: this is an STL model" in run("plan", "dome.stl", cwd=folder, expect=2).stderr
    (folder / "job.toml").write_text("[head]\nrun_out = 'none'\n")
    assert "job.toml: this is a tape-laying setup" in run("plan", "job.toml", cwd=folder, expect=2).stderr
    refused = run("export", "one.toml", cwd=folder, expect=2)
    assert "this is a ply file: tapelayer plan one.toml" in refused.stderr
