"""Problems: codes are stable, every error of the library has one, and bodies carry the evidence."""

from __future__ import annotations

import inspect
import json
import math
from dataclasses import replace

import pytest

from tapelayer import errors
from tapelayer.errors import CourseFileRefused, InputFault, SetupRefused, TapelayerError, VerificationFailed
from tapelayer.laying.evidence import Evidence, Samples, TapeLedger
from tapelayer.spraying.evidence import SprayEvidence, SpraySamples
from tapelayer.verification.failures import Failure
from tapelayer.workbench.problems import CODES, SHOWN_PLACES, Problem, code_of, of_error, problem_of, responses

# Clients translate and branch by these: a code may be added here, never changed.
STABLE = {
    "axis-beyond-travel": 422,
    "beyond-surface": 422,
    "blades-meet": 422,
    "cancelled": 409,
    "configuration-refused": 422,
    "controller-refused": 422,
    "course-file-refused": 422,
    "course-longer-than-roll": 422,
    "no-natural-paths": 422,
    "path-not-found": 422,
    "courses-refused": 422,
    "courses-withheld": 409,
    "cut-angle-too-small": 422,
    "cuts-cross": 422,
    "footprint-refused": 422,
    "foreign-origin": 403,
    "host-not-allowed": 421,
    "input-refused": 422,
    "internal": 500,
    "invalid-request": 422,
    "job-failed": 409,
    "job-not-finished": 409,
    "mesh-refused": 422,
    "method-not-allowed": 405,
    "model-refused": 422,
    "name-not-allowed": 422,
    "not-found": 404,
    "not-made": 404,
    "not-owner": 403,
    "not-writable": 422,
    "nothing-to-spray": 422,
    "out-of-memory": 500,
    "out-of-time": 500,
    "part-beyond-reach": 422,
    "part-too-high": 422,
    "pitch-not-found": 422,
    "pose-undefined": 422,
    "ply-refused": 422,
    "program-of-other-setup": 409,
    "program-refused": 422,
    "program-withheld": 409,
    "queue-full": 429,
    "serve-refused": 500,
    "server-stopped": 503,
    "setup-refused": 422,
    "tape-runs-back": 422,
    "tape-wider-than-travel": 422,
    "target-not-writable": 500,
    "token-required": 401,
    "too-many-attempts": 429,
    "unsupported-media-type": 415,
    "upload-too-large": 413,
    "verification-failed": 422,
    "work-directory-refused": 500,
    "worker-killed": 500,
    "wrong-token": 401,
    "xml-refused": 422,
}

LAY = Evidence(
    courses=0,
    points=0,
    blocks=0,
    laid_length=0.0,
    duration=0.0,
    asked=0.0,
    time_law="stop",
    tape_taken_back=0.0,
    least_link_clearance=0.0,
    forward_disagreement=0.0,
    axes=(),
    limits={},
    samples=Samples.joined([]),
    lay_speed=0.0,
    tape_width=0.0,
    roller_radius=0.0,
    tape=TapeLedger((), (), (), 0.0, 0.0, 0.0, 0.0),
    failures=(Failure(3, 0, "cuts_made", 1.0, 2.0), Failure(1, 7, "position_error_mm", math.nan, 0.1, 42)),
)
SPRAY = SprayEvidence(
    passes=0,
    points=0,
    layers=0,
    blocks=0,
    sprayed_length=0.0,
    arc_time=0.0,
    stops=0,
    duration=0.0,
    asked=0.0,
    time_law="stop",
    splits=(),
    crease_length=0.0,
    greatest_arc_distance=0.0,
    forward_disagreement=0.0,
    axes=(),
    limits={},
    samples=SpraySamples.joined([]),
    failures=(Failure(2, 5, "deviation_deg", 20.0, 15.0, 9, "pass"),),
)


def test_codes_are_stable() -> None:
    assert {code: kind.status for code, kind in CODES.items()} == STABLE


@pytest.mark.parametrize(
    "error",
    [
        error
        for _, error in inspect.getmembers(errors, inspect.isclass)
        if issubclass(error, TapelayerError) and error is not TapelayerError
    ],
)
def test_every_error_of_the_library_has_a_code(error: type[TapelayerError]) -> None:
    assert code_of(error) in CODES


@pytest.mark.parametrize("code", CODES)
def test_titles_and_meanings_are_for_people(code: str) -> None:
    kind = CODES[code]
    assert kind.title[0].isupper() and not kind.title.endswith(".")
    assert kind.meaning[0].isupper() and kind.meaning.endswith(".")
    assert [other for other, one in CODES.items() if one.title == kind.title] == [code]


def test_a_problem_says_what_is_wrong_this_time() -> None:
    problem = Problem("queue-full", "200 jobs wait", {"Retry-After": "30"}, waiting=200)
    assert problem.status == 429
    assert problem.headers == {"Retry-After": "30"}
    assert problem.body() == {
        "type": "/problems/queue-full",
        "title": "The queue is full",
        "status": 429,
        "detail": "200 jobs wait",
        "translations": {},
        "code": "queue-full",
        "waiting": 200,
    }


def test_a_refused_file_brings_its_faults() -> None:
    error = CourseFileRefused("a.txt", [InputFault(3, "wrong", 5), InputFault(0, "empty")])
    body = of_error(error)
    assert body["code"] == "course-file-refused"
    assert body["detail"] == "a.txt:3:5: wrong\na.txt: empty"
    assert body["faults"] == [
        {"line": 3, "column": 5, "sentence": "wrong", "translations": {}},
        {"line": 0, "column": 0, "sentence": "empty", "translations": {}},
    ]
    assert body["fault_count"] == 2


def test_a_program_judged_bad_brings_its_failures_as_the_report_has_them() -> None:
    body = of_error(VerificationFailed("bad", LAY))
    assert body["code"] == "verification-failed"
    assert body["failures"] == [
        {"course": 3, "point": 0, "what": "cuts_made", "value": 1.0, "limit": 2.0},
        {"course": 1, "point": 7, "what": "position_error_mm", "value": None, "limit": 0.1, "line": 42},
    ]
    json.dumps(body, allow_nan=False)
    assert of_error(VerificationFailed("bad", SPRAY))["failures"] == [
        {"pass": 2, "point": 5, "what": "deviation_deg", "value": 20.0, "limit": 15.0, "line": 9}
    ]


def test_a_problem_stays_small() -> None:
    """A file with very many faults, or a program with very many failures, is counted whole and shown in part."""
    many = 3 * SHOWN_PLACES
    refused = problem_of(CourseFileRefused("a.txt", [InputFault(line, "wrong") for line in range(many)])).evidence
    assert (len(refused["faults"]), refused["fault_count"]) == (SHOWN_PLACES, many)
    failed = of_error(VerificationFailed("bad", replace(LAY, failures=LAY.failures[:1] * many)))
    assert (len(failed["failures"]), failed["failure_count"]) == (SHOWN_PLACES, many)


def test_routes_describe_their_problems_by_status() -> None:
    described = responses("token-required", "wrong-token", "queue-full")
    assert list(described) == [401, 429]
    assert described[401]["description"].split("\n\n") == [
        f"`{code}`: {CODES[code].meaning}" for code in ("token-required", "wrong-token")
    ]
    assert list(described[429]["content"]) == ["application/problem+json"]


def test_a_problem_brings_its_sentences_in_every_language() -> None:
    fault = InputFault(4, "[tape] width_mm: input should be greater than 0, got -3", place=("tape", "width_mm"))
    body = problem_of(SetupRefused("job.toml", [fault])).body()
    assert body["detail"] == f"job.toml:4: {fault.sentence}"
    assert body["translations"] == {"zh": "job.toml:4: [tape] width_mm: 应大于 0，实为 -3"}
    assert body["faults"] == [
        {
            "line": 4,
            "column": 0,
            "sentence": fault.sentence,
            "translations": {"zh": "[tape] width_mm: 应大于 0，实为 -3"},
            "section": "tape",
            "key": "width_mm",
        }
    ]
    assert Problem("cancelled", "the job was cancelled").body()["translations"] == {"zh": "任务已取消"}
