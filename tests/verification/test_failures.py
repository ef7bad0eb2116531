"""A failure says what it is and where, in words and in JSON."""

from __future__ import annotations

import math

import pytest

from tapelayer.errors import VerificationFailed
from tapelayer.verification.failures import Failure, Findings
from tapelayer.verification.verified import Verified, failure_of
from tests.helpers.by_hand import said


def findings(*failures: Failure) -> Findings:
    time = {"duration": 1.0, "asked": 1.0, "time_law": "none"}
    return Findings(blocks=1, **time, forward_disagreement=0.0, axes=(), limits={}, failures=failures)


@pytest.mark.parametrize(
    ("failure", "sentence"),
    [
        (Failure(3, 7, "tape_error_mm", 1.5, 0.05, 12), "line 12: course 3 point 7: tape_error_mm is 1.5, limit 0.05"),
        (Failure(3, 0, "cuts_made", 2, 1), "course 3: cuts_made is 2, limit 1"),
        (Failure(0, 0, "courses_laid", 1, 2), "courses_laid is 1, limit 2"),
        (Failure(0, 0, "roll_used_m", 1234567.8, 150.0, 4), "line 4: roll_used_m is 1.23457e+06, limit 150"),
        (Failure(2, 5, "deviation_deg", math.nan, 15.0, of="pass"), "pass 2 point 5: deviation_deg is nan, limit 15"),
    ],
)
def test_a_failure_in_words(failure: Failure, sentence: str) -> None:
    assert failure.sentence() == sentence


def test_a_failure_for_json() -> None:
    found = {"what": "tape_error_mm", "value": 1.5, "limit": 0.05}
    assert Failure(3, 7, "tape_error_mm", 1.5, 0.05, 12).values() == {"course": 3, "point": 7, **found, "line": 12}
    assert Failure(0, 0, "tape_error_mm", 1.5, 0.05, of="pass").values() == {"pass": 0, "point": 0, **found}
    assert list(Failure(3, 7, "x_mm", 1.5, 0.05, 12).values()) == ["course", "point", "what", "value", "limit", "line"]
    assert Failure(1, 0, "axis_x_speed_mm_per_s", math.inf, 1.0).values()["value"] is None


@pytest.mark.parametrize(
    ("count", "tail"), [(0, []), (2, []), (3, ["and 1 more failure"]), (5, ["and 3 more failures"])]
)
def test_the_worst_come_first_and_the_rest_are_counted(count: int, tail: list[str]) -> None:
    found = findings(*(Failure(k, 0, "x_mm", 1.0, 0.0) for k in range(1, count + 1)))
    shown = [f"course {k}: x_mm is 1, limit 0" for k in range(1, min(count, 2) + 1)]
    assert found.worst(2).splitlines() == shown + tail
    assert found.passed is (count == 0)


def test_what_failed_is_never_verified() -> None:
    trajectory, bad = said(1.0), findings(*[Failure(0, 0, "x_mm", 1.0, 0.0)] * 11)
    assert Verified(trajectory, findings()).evidence.passed
    assert failure_of(findings()) is None
    with pytest.raises(VerificationFailed) as caught:
        Verified(trajectory, bad)
    assert caught.value.evidence is bad
    assert str(caught.value).splitlines() == ["x_mm is 1, limit 0"] * 10 + ["and 1 more failure"]
