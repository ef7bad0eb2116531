"""The report says what was measured, and never that something holds which was not."""

from __future__ import annotations

import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from tapelayer import report
from tapelayer.evidence import Failure, Samples
from tapelayer.gantry import lengths
from tapelayer.laying import plan
from tapelayer.machine import Machine
from tapelayer.setup import MM
from tapelayer.verification import verify
from tests.judged import SHA256, axes, evidence, samples
from tests.pages import page
from tests.surfaces import helix_course, setup_of

KEYS = {
    "version": "",
    "courses": 2,
    "points": 44,
    "blocks": 5,
    "laid_length_m": 1.5,
    "duration_s": 4.0,
    "max_position_error_mm": 0.05,
    "max_chord_error_mm": 0.03,
    "max_roller_tilt_deg": 30.0,
    "max_edge_lift_mm": 18.75,
    "max_heading_error_deg": 2.0,
    "max_pitch_deg": 4.0,
    "max_wrap_mm": 2.0,
    "max_roller_offset_mm": 0.6,
    "max_tape_error_mm": 0.07,
    "taken_back_mm": 3.0,
    "least_link_clearance_mm": 48.0,
    "max_forward_disagreement_m": 2e-16,
    "program_sha256": SHA256,
    "axes": {},
    "passed": True,
    "failures": [],
}


def test_keys_and_values() -> None:
    numbers = report.numbers(evidence(), SHA256)
    assert list(numbers) == list(KEYS)
    for key, value in KEYS.items():
        if isinstance(value, float):
            assert numbers[key] == pytest.approx(value, rel=1e-12), key
        elif key not in ("version", "axes"):
            assert numbers[key] == value, key
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", numbers["version"])
    assert list(numbers["axes"]) == ["x", "c"]
    x, c = numbers["axes"]["x"], numbers["axes"]["c"]
    assert list(x) == ["unit", "min", "max", "lower", "upper", "margin", "max_speed", "speed_limit"]
    assert list(x.values()) == ["mm", *(pytest.approx(v) for v in (300, 400, 0, 2500, 300, 250, 1000))]
    speeds = math.degrees(0.5), math.degrees(1.0)
    assert list(c.values()) == ["deg", *(pytest.approx(v) for v in (-10, 29, -30, 30, 1, *speeds))]


def test_values_are_plain_and_come_back_from_json() -> None:
    failure = Failure(3, 2, "axis_x_speed_mm_per_s", np.float64("inf"), np.float64(1000), 12)
    numbers = report.numbers(evidence(failures=(failure,), tape_taken_back=np.float64(-0.0)), SHA256)
    text = json.dumps(numbers, allow_nan=False)
    assert json.loads(text) == numbers
    assert "-0.0" not in text
    assert all(type(value) in (int, float, str, bool, dict, list) for value in numbers.values())


def test_failures_with_their_places() -> None:
    read = Failure(3, 12, "position_error_mm", 0.06, 0.05, 88)
    planned = Failure(0, 0, "courses_laid", 1, 2)
    numbers = report.numbers(evidence(failures=(read, planned)), SHA256)
    assert not numbers["passed"]
    assert numbers["failures"] == [
        {"course": 3, "point": 12, "what": "position_error_mm", "value": 0.06, "limit": 0.05, "line": 88},
        {"course": 0, "point": 0, "what": "courses_laid", "value": 1.0, "limit": 2.0},
    ]


def test_nothing_measured_is_neither_nought_nor_passed() -> None:
    nothing = replace(samples(), **{name: getattr(samples(), name)[:0] for name in Samples.__dataclass_fields__})
    numbers = report.numbers(evidence(samples=nothing), SHA256)
    lost = {key for key in KEYS if key.startswith("max_") and key != "max_forward_disagreement_m"}
    assert {key for key, value in numbers.items() if value is None} == lost
    assert not numbers["passed"]
    assert {failure["what"] for failure in numbers["failures"]} == {key.removeprefix("max_") for key in lost}
    assert all(failure["value"] is None for failure in numbers["failures"])


MEASURED = {
    "normal_errors": {"max_position_error_mm", "max_chord_error_mm"},
    "lateral_errors": {"max_position_error_mm", "max_chord_error_mm"},
    "tape_errors": {"max_tape_error_mm"},
    "tilts": {"max_roller_tilt_deg", "max_edge_lift_mm"},
    "heading_errors": {"max_heading_error_deg"},
    "pitches": {"max_pitch_deg"},
    "wraps": {"max_wrap_mm"},
    "offsets": {"max_roller_offset_mm"},
}


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("row", [1, 4])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_value_that_is_not_finite_is_not_passed(name: str, row: int, bad: float) -> None:
    values = getattr(samples(), name).copy()
    values[row] = bad
    found = evidence(samples=replace(samples(), **{name: values}))
    numbers = report.numbers(found, SHA256)
    assert {key for key, value in numbers.items() if value is None} == MEASURED[name]
    assert {failure["what"] for failure in numbers["failures"]} == {key[4:] for key in MEASURED[name]}
    assert not numbers["passed"]
    text = page(found)
    assert "FAILED" in text
    assert not re.search(r"\b(nan|inf)\b", re.sub(r"<style>.*</style>", "", text, flags=re.S), re.I)


@pytest.mark.parametrize("name", ["least", "greatest", "top_speed"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_an_axis_without_values_is_not_passed(name: str, bad: float) -> None:
    x, c = axes()
    found = evidence(axes=(x, replace(c, **{name: bad})))
    numbers = report.numbers(found, SHA256)
    what = "axis_c_speed_deg_per_s" if name == "top_speed" else "axis_c_deg"
    assert [failure["what"] for failure in numbers["failures"]] == [what]
    assert json.dumps(numbers, allow_nan=False)
    assert "no finite value" in page(found)


def test_what_verification_refused_is_not_refused_twice() -> None:
    values = samples().tape_errors.copy()
    values[0] = np.nan
    refused = Failure(3, 1, "tape_error_mm", math.nan, 0.05)
    found = evidence(samples=replace(samples(), tape_errors=values), failures=(refused,))
    numbers = report.numbers(found, SHA256)
    assert numbers["failures"] == [
        {"course": 3, "point": 1, "what": "tape_error_mm", "value": None, "limit": 0.05},
    ]


def test_a_single_course_has_no_link_and_passes() -> None:
    numbers = report.numbers(evidence(least_link_clearance=math.inf), SHA256)
    assert numbers["least_link_clearance_mm"] is None
    assert numbers["passed"]
    unknown = report.numbers(evidence(least_link_clearance=math.nan), SHA256)
    assert unknown["least_link_clearance_mm"] is None
    assert [failure["what"] for failure in unknown["failures"]] == ["link_clearance_mm"]


def test_wrap_is_the_spread_within_one_course() -> None:
    """Two courses apart from each other by much have no wrap where each is even in itself."""
    wraps = np.array([0.5, 0.5, 0.5, -0.5, -0.5, -0.5])
    numbers = report.numbers(evidence(samples=replace(samples(), wraps=wraps)), SHA256)
    assert numbers["max_wrap_mm"] == 0.0


def test_wrap_is_told_although_the_program_leaves_it_out() -> None:
    """On an arch of radius r the head stays upright: the nip turns by length / r round the roller in any case."""
    machine = Machine.load()
    told = []
    for compensated in ("true", "false"):
        setup = setup_of(f"[head]\nwrap_compensation = {compensated}")
        courses = (helix_course(heading=0.0, radius=1.5, length=0.6),)
        evidence = verify(plan(courses, setup, machine), courses, setup, machine).evidence
        told.append(report.numbers(evidence, SHA256)["max_wrap_mm"])
    assert told == pytest.approx([lengths(machine).radius / MM * 0.6 / 1.5] * 2, rel=1e-4)


def test_every_key_is_documented() -> None:
    numbers = report.numbers(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0, 1),)), SHA256)
    text = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
    for key in [*numbers, *numbers["axes"]["x"], *numbers["failures"][0]]:
        assert f"`{key}`" in text, key


def told(numbers: dict[str, object]) -> str:
    text = io.StringIO()
    Console(file=text, width=80).print(report.summary(numbers))
    return text.getvalue()


def test_summary_fits_a_terminal_and_says_all() -> None:
    text = told(report.numbers(evidence(), SHA256))
    assert "Verification: passed" in text and "FAILED" not in text
    for words in ("0.0500 mm", "30.0000 deg", "300.00 to 400.00", "0 to 2,500", "250.0 of 1,000", "48.00 mm"):
        assert words in text
    assert "…" not in text
    failed = told(report.numbers(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0),)), SHA256))
    assert "Verification: FAILED" in failed and "passed" not in failed
    assert "no link" in told(report.numbers(evidence(least_link_clearance=math.inf), SHA256))
