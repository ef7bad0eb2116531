"""The report says what was measured, and never that something holds which was not."""

from __future__ import annotations

import io
import itertools
import json
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tapelayer.laying.evidence import Samples, TapeLedger
from tapelayer.laying.inspection import verify
from tapelayer.laying.job import Job
from tapelayer.laying.limits import limits_of
from tapelayer.laying.program import plan
from tapelayer.laying.quantities import ROWS
from tapelayer.laying.settings import Setup
from tapelayer.machines.gantry import lengths
from tapelayer.machines.machine import Machine
from tapelayer.reporting.not_judged import unjudged
from tapelayer.reporting.summary import summary
from tapelayer.units import MM
from tapelayer.verification.failures import Failure
from tests.helpers.judged import SHA256, axes, evidence, ledger, numbers_of, samples, worn
from tests.helpers.pages import page
from tests.helpers.paths import EXAMPLES, ROOT
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import helix_course

KEYS = {
    "courses": 2,
    "points": 44,
    "blocks": 5,
    "cuts": 4,
    "knife_conflicts": 0,
    "laying_stops": 3,
    "laid_length_m": 1.5,
    "duration_s": 4.0,
    "asked_s": 3.5,
    "tape_used_mm": 2000.0,
    "waste_mm": 500.0,
    "waste_percent": 25.0,
    "max_position_error_mm": 0.05,
    "max_chord_error_mm": 0.03,
    "max_roller_tilt_deg": 30.0,
    "max_edge_lift_mm": 18.75,
    "max_heading_error_deg": 2.0,
    "max_pitch_deg": 4.0,
    "max_wrap_mm": 2.0,
    "max_roller_offset_mm": 0.6,
    "max_tape_error_mm": 0.07,
    "max_cut_error_mm": 0.02,
    "max_blade_error_deg": 0.02,
    "taken_back_mm": 3.0,
    "least_link_clearance_mm": 48.0,
    "max_forward_disagreement_m": 2e-16,
    "planned_laying_speed_mm_per_s": 250.0,
    "median_laying_speed_mm_per_s": 500.0,
    "max_laying_speed_mm_per_s": 1000.0,
    "speed_share": 1.0,
    "planned_speed_share": 1.0,
    "time_law": "look_ahead",
    "slowest_planned": {"course": 3, "arc_length_mm": 0.0, "speed_mm_per_s": 250.0},
    "slowest_laying": {"course": 3, "arc_length_mm": 0.0, "speed_mm_per_s": 250.0},
    "stops": [
        {"course": 3, "arc_length_mm": 250.0, "rest_s": 0.0, "line": 12},
        {"course": 17, "arc_length_mm": 500.0, "rest_s": 0.5, "line": 31},
        {"course": 17, "arc_length_mm": 750.0, "rest_s": 0.0, "line": 34},
    ],
    "time_shares": {"laying": 75.0, "threading": 18.75, "linking": 6.25},
    "program_sha256": SHA256,
    "tape": [],
    "axes": {},
    "passed": True,
    "not_judged": ["collision", "stops while laying", "share at set speed"],
    "failures": [],
}


def test_keys_and_values() -> None:
    numbers = numbers_of(evidence())
    assert list(numbers) == list(KEYS)
    for key, value in KEYS.items():
        if isinstance(value, float):
            assert numbers[key] == pytest.approx(value, rel=1e-12), key
        elif key not in ("axes", "tape"):
            assert numbers[key] == value, key
    assert list(numbers["axes"]) == ["x", "c"]
    ramps = ("max_acceleration", "acceleration_limit", "max_jerk", "jerk_limit")
    x, c = numbers["axes"]["x"], numbers["axes"]["c"]
    assert list(x) == ["unit", "min", "max", "lower", "upper", "margin", "max_speed", "speed_limit", *ramps]
    assert list(x.values()) == ["mm", *(pytest.approx(v) for v in (300, 400, 0, 2500, 300, 250, 1000)), *[None] * 4]
    speeds = math.degrees(0.5), math.degrees(1.0)
    assert list(c.values()) == ["deg", *(pytest.approx(v) for v in (-10, 29, -30, 30, 1, *speeds)), *[None] * 4]


def test_values_are_plain_and_come_back_from_json() -> None:
    failure = Failure(3, 2, "axis_x_speed_mm_per_s", np.float64("inf"), np.float64(1000), 12)
    numbers = numbers_of(evidence(failures=(failure,), tape_taken_back=np.float64(-0.0)))
    text = json.dumps(numbers, allow_nan=False)
    assert json.loads(text) == numbers
    assert "-0.0" not in text
    assert all(type(value) in (int, float, str, bool, dict, list) for value in numbers.values())


def test_failures_with_their_places() -> None:
    read = Failure(3, 12, "position_error_mm", 0.06, 0.05, 88)
    planned = Failure(0, 0, "courses_laid", 1, 2)
    numbers = numbers_of(evidence(failures=(read, planned)))
    assert not numbers["passed"]
    assert numbers["failures"] == [
        {"course": 3, "point": 12, "what": "position_error_mm", "value": 0.06, "limit": 0.05, "line": 88},
        {"course": 0, "point": 0, "what": "courses_laid", "value": 1.0, "limit": 2.0},
    ]


def test_nothing_measured_is_neither_nought_nor_passed() -> None:
    nothing = Samples.joined([])
    numbers = numbers_of(evidence(samples=nothing))
    of_others = ("max_forward_disagreement_m", "max_cut_error_mm", "max_blade_error_deg")
    speeds = {f"{which}_laying_speed_mm_per_s" for which in ("planned", "median", "max")}
    speeds |= {"speed_share", "planned_speed_share", "slowest_planned", "slowest_laying"}
    lost = {key for key in KEYS if key.startswith("max_") and key not in of_others} - speeds
    assert {key for key, value in numbers.items() if value is None} == lost | speeds
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
    numbers = numbers_of(found)
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
    numbers = numbers_of(found)
    what = "axis_c_speed_deg_per_s" if name == "top_speed" else "axis_c_deg"
    assert [failure["what"] for failure in numbers["failures"]] == [what]
    assert json.dumps(numbers, allow_nan=False)
    assert "no finite value" in page(found)


def test_what_verification_refused_is_not_refused_twice() -> None:
    values = samples().tape_errors.copy()
    values[0] = np.nan
    refused = Failure(3, 1, "tape_error_mm", math.nan, 0.05)
    found = evidence(samples=replace(samples(), tape_errors=values), failures=(refused,))
    numbers = numbers_of(found)
    assert numbers["failures"] == [
        {"course": 3, "point": 1, "what": "tape_error_mm", "value": None, "limit": 0.05},
    ]


def test_a_single_course_has_no_link_and_passes() -> None:
    numbers = numbers_of(evidence(least_link_clearance=math.inf))
    assert numbers["least_link_clearance_mm"] is None
    assert numbers["passed"]
    unknown = numbers_of(evidence(least_link_clearance=math.nan))
    assert unknown["least_link_clearance_mm"] is None
    assert [failure["what"] for failure in unknown["failures"]] == ["link_clearance_mm"]


def test_wrap_is_the_spread_within_one_course() -> None:
    """Two courses apart from each other by much have no wrap where each is even in itself."""
    wraps = np.array([0.5, 0.5, 0.5, -0.5, -0.5, -0.5])
    numbers = numbers_of(evidence(samples=replace(samples(), wraps=wraps)))
    assert numbers["max_wrap_mm"] == 0.0


def test_wrap_is_told_although_the_program_leaves_it_out() -> None:
    """On an arch of radius r the head stays upright: the nip turns by length / r round the roller in any case."""
    machine = Machine.load()
    told = []
    for compensated in ("true", "false"):
        setup = setup_of(f"[head]\nwrap_compensation = {compensated}")
        courses = (helix_course(heading=0.0, radius=1.5, length=0.6),)
        evidence = verify(plan(courses, setup, machine), courses, setup, machine).evidence
        told.append(numbers_of(evidence)["max_wrap_mm"])
    assert told == pytest.approx([lengths(machine).radius / MM * 0.6 / 1.5] * 2, rel=1e-4)


def test_every_key_is_documented() -> None:
    numbers = numbers_of(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0, 1),)))
    course = numbers["tape"][0]
    inner = [numbers["axes"]["x"], numbers["failures"][0], numbers["time_shares"], course, course["cuts"][0]]
    text = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    for key in [*numbers, *(key for table in inner for key in table)]:
        assert f"`{key}`" in text, key


def test_the_tape_by_course() -> None:
    first, second = numbers_of(evidence())["tape"]
    cuts = first.pop("cuts")
    assert first == {
        "course": 3,
        "laid_mm": 500.0,
        "station_mm": 100.0,
        "waste_mm": 100.0,
        "waste_roll_mm": 0.0,
        "waste_formula_mm": 62.5,
        "waste_knives_mm": 37.5,
        "laying_stops": 1,
    }
    assert cuts[0] == {
        "end": "start",
        "station_mm": 100.0,
        "angle_deg": pytest.approx(45.0, rel=1e-14),
        "knife": 1,
        "block": 1,
        "line": 8,
        "shared": False,
        "error_mm": pytest.approx(0.001, rel=1e-14),
        "blade_error_deg": pytest.approx(0.001, rel=1e-14),
    }
    assert [(cut["end"], cut["knife"], cut["block"]) for cut in cuts + second["cuts"]] == [
        ("start", 1, 1),
        ("end", 2, 6),
        ("start", 2, 10),
        ("end", 1, 20),
    ]
    assert (second["waste_mm"], second["waste_roll_mm"]) == (400.0, 250.0)


def test_a_shared_cut_stands_at_both_courses_and_counts_once() -> None:
    numbers = numbers_of(evidence(tape=ledger(4, 9, 2)))
    assert numbers["cuts"] == 4
    assert numbers["waste_mm"] == 0.0
    shared = [[cut["shared"] for cut in course["cuts"]] for course in numbers["tape"]]
    assert shared == [[False, True], [True, True], [True, False]]
    for before, after in itertools.pairwise(numbers["tape"]):
        assert before["cuts"][1] | {"end": "start"} == after["cuts"][0]


def test_a_cut_of_a_planned_program_has_no_line() -> None:
    tape = worn()
    tape = replace(tape, cuts=tuple(replace(made, line=0) for made in tape.cuts))
    cuts = [cut for course in numbers_of(evidence(tape=tape))["tape"] for cut in course["cuts"]]
    assert len(cuts) == 4 and not any("line" in cut for cut in cuts)


def test_an_end_that_was_not_cut_has_no_cut() -> None:
    tape = replace(worn(), cuts=worn().cuts[:1] + worn().cuts[2:])
    numbers = numbers_of(evidence(tape=tape))
    assert numbers["cuts"] == 3
    assert [[cut["end"] for cut in course["cuts"]] for course in numbers["tape"]] == [["start"], ["start", "end"]]


TAPE_LOST = {
    "error": ({"max_cut_error_mm"}, {"cut_error_mm", "tape"}),
    "blade_error": ({"max_blade_error_deg"}, {"blade_error_deg", "tape"}),
    "used": ({"tape_used_mm", "waste_mm", "waste_percent"}, {"tape_used_mm", "waste_mm", "waste_percent"}),
    "station": (set(), {"tape"}),
    "threading": (set(), {"time_shares"}),
}


@pytest.mark.parametrize("name", TAPE_LOST)
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_tape_that_was_not_measured_is_not_passed(name: str, bad: float) -> None:
    tape = worn()
    if name in ("error", "blade_error"):
        tape = replace(tape, cuts=(*tape.cuts[:3], replace(tape.cuts[3], **{name: bad})))
    elif name == "station":
        tape = replace(tape, rows=(tape.rows[0], replace(tape.rows[1], station=bad)))
    else:
        tape = replace(tape, **{name: bad})
    numbers = numbers_of(evidence(tape=tape))
    keys, failures = TAPE_LOST[name]
    assert {key for key, value in numbers.items() if value is None} == keys
    assert {failure["what"] for failure in numbers["failures"]} == failures
    assert not numbers["passed"]
    assert json.dumps(numbers, allow_nan=False)
    assert "FAILED" in page(evidence(tape=tape))


def test_no_tape_at_all_is_not_passed() -> None:
    numbers = numbers_of(evidence(tape=TapeLedger((), (), (), 0.0, 0.0, 0.0, 0.0)))
    lost = {"cut_error_mm", "blade_error_deg", "waste_percent", "time_shares"}
    assert {failure["what"] for failure in numbers["failures"]} == lost
    assert set(numbers["time_shares"].values()) == {None}


@pytest.mark.parametrize(
    ("what", "counts"),
    [
        ("knife_1_switched_again", True),
        ("knife_2_left_on", True),
        ("rapid_with_knife_1_on", True),
        ("rapid_with_shoe_on", False),
        ("shoe_left_on", False),
        ("cuts_made", True),
        ("cut_width_mm", True),
        ("cut_error_mm", False),
        ("knife_2_off_every_cut_mm", True),
        ("axis_v_mm", True),
        ("axis_q_mm", True),
        ("axis_q_speed_mm_per_s", False),
        ("axis_y_mm", False),
    ],
)
def test_failures_of_the_knives_are_counted(what: str, counts: bool) -> None:
    failures = (Failure(3, 1, what, 1.0, 0.0), Failure(3, 1, "position_error_mm", 1.0, 0.0))
    assert numbers_of(evidence(failures=failures))["knife_conflicts"] == int(counts)


def test_the_ledger_of_a_program_agrees_with_its_courses_and_its_text() -> None:
    """Laid and waste make up the tape used, cuts stand at the courses' ends, and their lines hold the knives' words."""
    limits = "[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}\n[tape]\nroll_length_m = 4"
    job = Job.read(EXAMPLES / "wing_skin_45.txt", setup_of(limits))
    text = job.text(job.plan())
    numbers = numbers_of(job.verify(job.read_back(text, "panel.nc").trajectory).evidence)
    lines = text.decode("ascii").splitlines()
    assert numbers["passed"] and len(numbers["tape"]) == numbers["courses"] == 21
    end = 0.0
    seen = set()
    for course, row in zip(job.courses, numbers["tape"], strict=True):
        assert row["laid_mm"] == pytest.approx(course.length / MM, abs=1e-9)
        assert row["waste_mm"] == pytest.approx(row["station_mm"] - end, abs=1e-9)
        parts = row["waste_roll_mm"] + row["waste_formula_mm"] + row["waste_knives_mm"]
        assert row["waste_mm"] == pytest.approx(parts, abs=2e-3)
        end = row["station_mm"] + row["laid_mm"]
        start_cut, end_cut = row["cuts"]
        assert start_cut["station_mm"] == pytest.approx(row["station_mm"], abs=2e-3)
        assert end_cut["station_mm"] == pytest.approx(end, abs=2e-3)
        for cut in (start_cut, end_cut):
            assert cut["angle_deg"] == pytest.approx(45.0, abs=1e-9)
            assert lines[cut["line"] - 1].split()[-1] == {1: "M22", 2: "M32"}[cut["knife"]]
            seen.add(cut["line"])
    assert numbers["tape_used_mm"] == pytest.approx(end, abs=1e-9)
    assert numbers["waste_mm"] == pytest.approx(sum(row["waste_mm"] for row in numbers["tape"]), abs=1e-6)
    assert numbers["waste_mm"] + 1e3 * numbers["laid_length_m"] == pytest.approx(numbers["tape_used_mm"], abs=1e-6)
    # Courses share a cut but where a new roll begins.
    rolls = sum(row["waste_roll_mm"] > 0.0 for row in numbers["tape"])
    assert rolls == 4
    assert numbers["cuts"] == len(seen) == 22 + rolls == text.count(b"M22") + text.count(b"M32")
    assert sum(numbers["time_shares"].values()) == pytest.approx(100.0)


def told(numbers: dict[str, Any]) -> str:
    text = io.StringIO()
    Console(file=text, width=80).print(summary(ROWS, numbers, limits_of(Setup()), unjudged(timed=False)))
    return text.getvalue()


def test_summary_fits_a_terminal_and_says_all() -> None:
    text = told(numbers_of(evidence()))
    assert "Verification: passed" in text and "FAILED" not in text
    for words in ("0.0500 mm", "30.0000 deg", "300.00 to 400.00", "0 to 2,500", "250.0 of 1,000", "48.00 mm"):
        assert words in text
    for row in (("cut error", "0.0200 mm"), ("blade error", "0.0200 deg"), ("cuts", "4"), ("tape used", "2,000.0 mm")):
        assert re.search(rf"{row[0]} +│ +{re.escape(row[1])} ", text), row
    assert re.search(r"waste +│ +500\.0 mm ", text) and re.search(r"waste share +│ +25\.00 % ", text)
    assert "…" not in text
    failed = told(numbers_of(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0),))))
    assert "Verification: FAILED" in failed and "passed" not in failed
    assert "no link" in told(numbers_of(evidence(least_link_clearance=math.inf)))
