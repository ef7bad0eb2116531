"""Failures: the limits that the courses of a ply do not keep, as sentences with courses, places and remedies."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.plies.evidence import CENTRE, PlyEvidence, measured
from tapelayer.plies.judgement import Judgement
from tapelayer.plies.laid_ply import Fault
from tapelayer.plies.limits import GAP_ACCURACY, limits_of
from tapelayer.plies.plan import CoursePlan
from tapelayer.units import DEG, MM, json_number
from tapelayer.verification.failures import Failure

# A failure that the judge found on the mould's facets.
JUDGED = "judgement"
# A sentence from the numbers of courses, what was measured and where.
Text = Callable[[tuple[int, ...], float, str], str]
# The beginning of a sentence, up to what was measured: of which courses it says what.
_ABOUT = re.compile(r"courses? [\d, and]*\d:? \D*")


@dataclass(frozen=True)
class PlyFailure(Failure):
    """One limit that a ply does not keep.

    Attributes:
        text: the failure in words.
        courses: numbers of the courses.
        place: in the mould's frame, metres; None where there is none.
    """

    text: str = ""
    courses: tuple[int, ...] = ()
    place: tuple[float, float, float] | None = None

    def sentence(self) -> str:
        """Return the failure in words."""
        return self.text

    def values(self) -> dict[str, Any]:
        """Return the failure for JSON."""
        place = None if self.place is None else [json_number(value / MM) for value in self.place]
        return {**super().values(), "courses": list(self.courses), "place_mm": place, "sentence": self.text}


def evidence_of(plan: CoursePlan, judgement: Judgement) -> PlyEvidence:
    """Return what was measured on planned courses, with every limit that they do not keep.

    Args:
        plan: the courses.
        judgement: of the same.
    """
    ledger, samples, gaps = measured(plan)
    evidence = PlyEvidence(
        limits=limits_of(plan.ply),
        failures=(),
        plan=plan,
        ledger=ledger,
        samples=samples,
        gaps=gaps,
        judgement=judgement,
    )
    own = (*_gap_failures(evidence), *_course_failures(evidence), *_plan_failures(evidence))
    return replace(evidence, failures=(*own, *judged(judgement.faults, own)))


def judged(faults: Sequence[Fault], own: Sequence[PlyFailure] = ()) -> Iterator[PlyFailure]:
    """Yield the judge's faults as failures, without those that tell the same of the same courses as others do.

    Args:
        faults: of the judge.
        own: failures that are told already.
    """
    told = {_about(failure.text) for failure in own}
    for fault in faults:
        if _about(fault.sentence) not in told:
            first = fault.courses[0] if fault.courses else 0
            yield PlyFailure(
                first, 0, JUDGED, math.nan, math.nan, text=fault.sentence, courses=fault.courses, place=fault.place
            )


def _about(sentence: str) -> str:
    """Return of which courses a sentence says what.

    Examples:
        >>> _about("courses 7 and 8: gap of 4.32 mm at (0.0, 1.0, 2.0), expected at most 2")
        'courses 7 and 8: gap of '
        >>> _about("course 12 runs 72.6 mm beyond the mould")
        'course 12 runs '
    """
    found = _ABOUT.match(sentence)
    return found[0] if found else sentence


def place_words(place: Sequence[float]) -> str:
    """Return a place in metres in words: mm in the mould's frame.

    Examples:
        >>> place_words([0.1, -0.00001, 1.0])
        '(100.0, 0.0, 1000.0)'
    """
    return "(" + ", ".join(f"{value / MM:z.1f}" for value in place) + ")"


def _gap_failures(evidence: PlyEvidence) -> Iterator[PlyFailure]:
    """Yield a failure for every pair of neighbours with a gap or an overlap beyond its limit."""
    gaps, ply = evidence.gaps, evidence.plan.ply
    pairs, groups = np.unique(np.column_stack([gaps.rights, gaps.lefts]), axis=0, return_inverse=True)
    groups = groups.ravel()

    def failure(what: str, pair: int, row: int, value: float, limit: float, text: Text) -> PlyFailure:
        one, other = sorted(int(index) + 1 for index in pairs[pair])
        place = evidence.at(gaps.plan[row])
        sentence = text((one, other), value / MM, place_words(place))
        return PlyFailure(one, 0, what, value / MM, limit / MM, text=sentence, courses=(one, other), place=place)

    for pair, row in _worst(gaps.widths, groups, ply.max_gap + GAP_ACCURACY):
        yield failure(
            *("gap_mm", pair, row, float(gaps.widths[row]), ply.max_gap),
            lambda both, width, at: (
                f"courses {both[0]} and {both[1]}: gap of {width:.2f} mm at {at}, expected at most "
                f"{ply.max_gap / MM:g}: use narrower tape, or allow overlap with gap.least_mm = {-width / 2:.2f}"
            ),
        )
    for pair, row in _worst(-gaps.widths, groups, ply.max_overlap + GAP_ACCURACY):
        yield failure(
            *("overlap_mm", pair, row, -float(gaps.widths[row]), ply.max_overlap),
            lambda both, width, at: (
                f"courses {both[0]} and {both[1]}: overlap of {width:.2f} mm at {at}, expected at most "
                f"{ply.max_overlap / MM:g}: use narrower tape, or allow it with gap.least_mm"
            ),
        )


def _course_failures(evidence: PlyEvidence) -> Iterator[PlyFailure]:
    """Yield a failure for every course whose strain, lift or angle is beyond its limit."""
    samples, limits = evidence.samples, evidence.plan.ply.limits
    lines = samples.largest_strains
    rows = np.arange(len(lines))

    def failures(what: str, values: Floats, plan: Floats, limit: float, text: Text) -> Iterator[PlyFailure]:
        for course, row in _worst(values, samples.courses, limit):
            place = evidence.at(plan[row])
            number, value = course + 1, float(values[row])
            sentence = text((number,), value, place_words(place))
            yield PlyFailure(number, 0, what, value, limit, text=sentence, courses=(number,), place=place)

    yield from failures(
        "strain_percent",
        100.0 * np.abs(samples.laid_strains[rows, lines]),
        samples.plan[rows, lines],
        limits.max_strain_percent,
        lambda one, value, at: (
            f"course {one[0]}: strain of {value:.2f} % at {at}, expected at most {limits.max_strain_percent:g}: "
            "use narrower tape"
        ),
    )
    centres = samples.plan[:, CENTRE]
    yield from failures(
        "lift_mm",
        samples.laid_lifts / MM,
        centres,
        limits.max_lift_mm,
        lambda one, value, at: (
            f"course {one[0]}: the roller lifts {value:.2f} mm at {at}, expected at most {limits.max_lift_mm:g}: "
            "use narrower tape"
        ),
    )
    yield from failures(
        "angle_deviation_deg",
        np.abs(samples.laid_deviations) / DEG,
        centres,
        limits.max_angle_deviation_deg,
        lambda one, value, at: (
            f"course {one[0]}: {value:.2f} deg off the ply's angle at {at}, expected at most "
            f"{limits.max_angle_deviation_deg:g}: move the seed, or split the ply"
        ),
    )


def _plan_failures(evidence: PlyEvidence) -> Iterator[PlyFailure]:
    """Yield failures of the plan as a whole."""
    plan, limits = evidence.plan, evidence.limits

    def failure(key: str, metres: float, text: Callable[[float, float], str]) -> Iterator[PlyFailure]:
        value, limit = metres / MM, limits[key].value
        if not value <= limit:
            yield PlyFailure(0, 0, key, value, limit, text=text(value, limit))

    yield from failure(
        "surface_ambiguity_mm",
        plan.ambiguity,
        lambda value, limit: (
            f"another smooth surface through the same facets moves a course by {value:.2f} mm, expected at most "
            f"{limit:g}: export the mould with smaller facets, or keep the ply off its strong bends"
        ),
    )
    yield from failure(
        "path_error_mm",
        plan.path_error,
        lambda value, limit: (
            f"half the steps still move a course by {value:.3f} mm, expected at most {limit:g}: the mould bends too "
            "strongly; keep the ply off its bends"
        ),
    )
    yield from failure(
        "spacing_error_mm",
        plan.spacing_error,
        lambda value, limit: (
            f"the spline through a course's points is {value:.3f} mm off it, expected at most {limit:g}: the mould "
            "bends too strongly; keep the ply off its bends"
        ),
    )


def _worst(values: Floats, groups: Ints, limit: float) -> Iterator[tuple[int, int]]:
    """Yield each group with a value beyond a limit, and the row of its largest one; NaN breaks none.

    Args:
        values: (n,) any unit.
        groups: (n,) indices.
        limit: largest allowed value.

    Examples:
        >>> list(_worst(np.array([1.0, 3.0, np.nan, 2.0]), np.array([0, 0, 1, 2]), 1.5))
        [(0, 1), (2, 3)]
    """
    broken = np.flatnonzero(values > limit)
    broken = broken[np.lexsort([-values[broken], groups[broken]])]
    firsts = np.flatnonzero(np.append(True, np.diff(groups[broken]) != 0)[: len(broken)])
    yield from zip(groups[broken][firsts].tolist(), broken[firsts].tolist(), strict=True)
