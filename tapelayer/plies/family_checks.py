"""Family checks: courses against their neighbours, in number and in place, and the first of them against the seed."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.plies.course_checks import deviations_of
from tapelayer.plies.gap_profiles import GapProfiles
from tapelayer.plies.laid_ply import Fault, LaidPly
from tapelayer.units import DEG, MM

# Accuracy of a gap by the file, metres.
GAP_ERROR = 0.02 * MM
# Of the reference course at the seed, metres and radians.
SEED_ERROR = 0.05 * MM
SEED_ANGLE_ERROR = 0.05 * DEG


def gap_faults(laid: LaidPly, profiles: GapProfiles) -> list[Fault]:
    """Return a fault for each pair of neighbours with a gap or an overlap beyond its limit, at its worst place."""
    terms, faults = laid.terms, []
    for right, left in profiles.pairs.tolist():
        rows = np.flatnonzero((profiles.rights == right) & (profiles.lefts == left))
        gaps = profiles.gaps[rows]
        numbers = sorted((laid.courses[right].number, laid.courses[left].number))
        if not (largest := float(np.max(gaps))) <= terms.max_gap + GAP_ERROR:
            point = profiles.points[rows[np.argmax(gaps)]]
            sentence = (
                f"courses {numbers[0]} and {numbers[1]}: gap of {largest / MM:.2f} mm at {laid.at(point)}, "
                f"expected at most {terms.max_gap / MM:g}: use narrower tape, or allow overlap with "
                f"gap.least_mm = {-largest / MM / 2:.2f}"
            )
            faults.append(Fault(sentence, tuple(numbers), laid.place(point)))
        if not (least := float(np.min(gaps))) >= -terms.max_overlap - GAP_ERROR:
            point = profiles.points[rows[np.argmin(gaps)]]
            sentence = (
                f"courses {numbers[0]} and {numbers[1]}: overlap of {-least / MM:.2f} mm at "
                f"{laid.at(point)}, expected at most {terms.max_overlap / MM:g}: move them apart, or allow it "
                "with gap.least_mm"
            )
            faults.append(Fault(sentence, tuple(numbers), laid.place(point)))
    return faults


def order_faults(laid: LaidPly, profiles: GapProfiles) -> list[Fault]:
    """Return faults of numbers that do not rise from the start corner across the ply, and of courses turned round."""
    terms, faults = laid.terms, []
    numbers = [course.number for course in laid.courses]
    for one, other in zip(numbers[:-1], numbers[1:], strict=True):
        if other <= one:
            faults.append(
                Fault(f"course {other} stands after course {one} in the file, expected numbers that rise", (one, other))
            )
    rising = terms.start_corner == "right"
    for right, left in profiles.pairs.tolist():
        if (numbers[left] > numbers[right]) != rising:
            first = profiles.points[np.argmax((profiles.rights == right) & (profiles.lefts == left))]
            sentence = (
                f"course {numbers[left]} lies on the left of course {numbers[right]} at {laid.at(first)}, "
                f"expected numbers that rise to the {'left' if rising else 'right'}"
            )
            faults.append(Fault(sentence, (numbers[right], numbers[left]), laid.place(first)))
    if terms.order == "one_way":
        wanted = -1.0 if terms.reverse else 1.0
        for course, way in zip(laid.courses, laid.ways.tolist(), strict=True):
            if way != wanted:
                sentence = (
                    f"course {course.number} runs {'against' if wanted > 0 else 'in'} the ply's direction, expected "
                    "all courses one way"
                )
                faults.append(Fault(sentence, (course.number,), laid.place(course.points[0])))
    return faults


def at_seed(laid: LaidPly) -> tuple[float, float, list[Fault]]:
    """Return the reference course's offset from the seed in metres, its angle's error there in radians, and faults.

    The reference course is the one that runs nearest to the seed moved to the left by the stagger.
    """
    terms, surface = laid.terms, laid.surface
    spots = surface.spots(terms.seed[None])
    point, normal = surface.points(spots), surface.normals(spots)
    best, offset, error = -1, math.nan, math.nan
    for row, (line, way) in enumerate(zip(laid.lines, laid.ways.tolist(), strict=True)):
        arcs, lefts, samples = line.coordinates(point, normal)
        off = -way * float(lefts[0]) - terms.stagger
        if not line.outside(arcs, lefts)[1][0] <= terms.margin + terms.width or abs(off) >= abs(offset):
            continue
        best, offset = row, off
        # Straight courses keep their angle to a direction that is carried along the surface, not to the rosette.
        carried = normal + line.normals[samples]
        heading = laid.headings(normal)
        moved = heading - 2 * float(carried[0] @ heading[0]) / float(carried[0] @ carried[0]) * carried
        moved -= 2 * float(line.normals[samples[0]] @ moved[0]) * line.normals[samples]
        there = laid.headings(line.normals[samples])
        turn = float(line.normals[samples[0]] @ np.cross(there[0], moved[0]))
        deviation = float(deviations_of(laid, line)[samples[0]])
        error = max(min(0.0, turn) - deviation, deviation - max(0.0, turn), 0.0)
    place = laid.place(point[0])
    if best < 0:
        return offset, error, [Fault(f"no course runs past the seed {laid.at(point[0])}", (), place)]
    offset, number, faults = abs(offset), laid.courses[best].number, []
    if not offset <= SEED_ERROR:
        sentence = (
            f"course {number} runs {offset / MM:.2f} mm beside the seed {laid.at(point[0])} with its stagger, expected "
            f"at most {SEED_ERROR / MM:g}"
        )
        faults.append(Fault(sentence, (number,), place))
    if not error <= SEED_ANGLE_ERROR:
        sentence = (
            f"course {number}: {error / DEG:.2f} deg off the ply's angle at the seed {laid.at(point[0])}, expected "
            f"at most {SEED_ANGLE_ERROR / DEG:g}"
        )
        faults.append(Fault(sentence, (number,), place))
    return offset, error, faults
