"""The report on a spraying program: every figure against what was measured, and figures that are not there."""

from __future__ import annotations

import hashlib
import json
import re

import numpy as np
import pytest

from tapelayer.errors import PartBeyondReach
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.job import SprayJob, SprayResult
from tapelayer.units import DEG, MM
from tests.helpers.kinds import sprayed_wave
from tests.helpers.panels import flat, sheet, stl_bytes
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import roof


def of(triangles: np.ndarray, text: str = "") -> SprayResult:
    return SprayJob.of(stl_bytes(triangles), "part.stl", spray_setup_of(text)).make("part.nc")


def test_figures_are_those_of_the_samples() -> None:
    report, samples = sprayed_wave().report(), sprayed_wave().evidence.samples
    assert isinstance(samples, SpraySamples)
    for key, values, unit in (
        ("max_position_error_mm", samples.position_errors, MM),
        ("max_surface_distance_mm", samples.surface_distances, MM),
        ("max_deviation_deg", samples.deviations[~samples.exempt], DEG),
    ):
        assert report[key] == pytest.approx(np.nanmax(values) / unit, rel=1e-12), key
    same = np.diff(samples.pieces) == 0
    assert report["arc_time_s"] == pytest.approx(np.sum(np.diff(samples.times)[same]), rel=1e-3)
    assert report["passes"] == len({int(index) for index in samples.passes}) == 5


def test_figures_are_those_of_the_program_and_the_model() -> None:
    found, report = sprayed_wave(), sprayed_wave().report()
    assert report["program_sha256"] == hashlib.sha256(found.text).hexdigest()
    assert report["blocks"] == len(found.trajectory)
    assert report["duration_s"] == pytest.approx(found.trajectory.duration)
    mesh = found.job.mesh
    assert report["mesh"]["facets"] == len(mesh.facets)
    unreachable = sum(area["area_m2"] for area in report["unreachable"])
    assert report["sprayed_area_m2"] + unreachable == pytest.approx(float(np.sum(mesh.areas)), rel=1e-6)
    for axis in found.trajectory.axes:
        scale = MM if report["axes"][axis]["unit"] == "mm" else DEG
        # From where every axis is stated.
        positions = found.trajectory.positions[:, found.trajectory.column(axis)] / scale
        assert report["axes"][axis]["min"] == pytest.approx(np.nanmin(positions), abs=1e-3)
        assert report["axes"][axis]["max"] == pytest.approx(np.nanmax(positions), abs=1e-3)


def test_the_report_is_strict_json_whose_numbers_come_back() -> None:
    report = sprayed_wave().report()
    text = json.dumps(report, allow_nan=False)
    assert json.loads(text) == report
    assert report["passed"] is True and report["failures"] == []


def test_plating_has_no_coat_and_a_part_without_creases_no_deviation_in_them() -> None:
    plating = of(sheet(np.linspace(0, 300, 7), [0, 50, 100], flat), "[process]\nkind = 'plating'\n").report()
    assert plating["standoff_mm"] == 0
    for key in ("coverage_percent", "cv_percent", "cv_interior_percent", "thickness"):
        assert plating[key] is None
    assert sprayed_wave().report()["max_crease_deviation_deg"] is None


def test_a_crease_that_splits_a_pass_is_reported_with_its_place() -> None:
    found = of(roof(120), "[machine]\nlimits_deg = {phi = [-90, 90]}\n[spray]\npitch_mm = 80\n")
    report = found.report()
    assert len(report["splits"]) == len(found.planned.splits) >= 1
    for split, planned in zip(report["splits"], found.planned.splits, strict=True):
        assert split == {
            "pass": planned.number,
            **{
                f"{name}_mm": pytest.approx(value / MM, abs=1e-3)
                for name, value in zip("xyz", planned.point, strict=True)
            },
            "reason": "crease",
        }
    assert report["crease_length_mm"] > 0
    assert report["max_deviation_deg"] <= 15 < report["max_crease_deviation_deg"]


def test_a_program_that_fails_says_where() -> None:
    found = sprayed_wave()
    lines = found.text.decode().splitlines()
    line = next(row for row in lines[60:] if re.search(r" Z\d", row) and " G0" not in row)
    edited = re.sub(r"Z([\d.]+)", lambda word: f"Z{float(word[1]) + 2:.3f}", line)
    text = "\n".join([edited if row == line else row for row in lines] + [""]).encode()
    judged = found.job.judge(text, "program.nc")
    report = judged.report()
    assert report["passed"] is False and judged.failure is not None
    assert any(failure["what"] == "position_error_mm" for failure in report["failures"])
    for failure in report["failures"]:
        assert set(failure) == {"pass", "point", "what", "value", "limit", "line"}
    places = {failure["line"] for failure in report["failures"]}
    assert min(abs(place - (lines.index(line) + 1)) for place in places) <= 1


def test_what_lies_beyond_the_travel_counts_against_coverage_and_is_told() -> None:
    plate = sheet(np.linspace(0, 300, 7), [0, 50, 100], flat)
    whole = of(plate)
    assert whole.notes() == () and whole.report()["coverage_percent"] == pytest.approx(100.0, abs=0.5)
    text = "[machine]\nlimits_mm = {x = [0, 1300]}\n[part]\nx_mm = 1100\n"
    cut = of(plate, text)
    assert cut.notes() == ("part.stl: 0.01 m2 of the surface lie beyond the machine's reach: no pass goes there",)
    assert cut.report()["coverage_percent"] == pytest.approx(100.0 * 2 / 3, abs=6.0)
    judged = of(plate, text + "[verification]\nmin_coverage_percent = 90\n")
    assert judged.failure is not None and [one["what"] for one in judged.report()["failures"]] == ["coverage_percent"]
    with pytest.raises(PartBeyondReach, match=r"^part\.stl: 0\.02 m2 of the 0\.03 m2 seen from above lie beyond"):
        of(plate, text.replace("1100", "1200"))
