"""Course checks: each course by itself: on the mould, straight, at its angle, its bends, cuts and length."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.plies.course_line import CourseLine
from tapelayer.plies.laid_ply import Fault, LaidPly
from tapelayer.plies.straightness import steering, wander
from tapelayer.units import DEG, MM
from tapelayer.vectors import dot, norms, unit

# Normals may differ from the mould's by this, and by this share of what the facets turn there.
NORMAL_ERROR = 0.25 * DEG
_NORMAL_SHARE = 0.2
# Facets that no quadric explains leave normals open by so many times what they lack.
_DOUBTS = 3.0
# Strain and lift are measured where the facets leave normals open by no more than this.
_CLEAR = 0.15 * DEG
# Points may be off the surface by this share of the facets' own error, an estimate, beside the ply's limit.
_SAG_SHARE = 1.25
# A natural path may wander from straight by this on each metre.
WANDER = 0.25 * MM
# Strain and lift are estimates from the curvature of the facets.
_ESTIMATE = 1.1
_STRAIN_ERROR = 1e-4
# What a file's decimals take from lengths and angles.
_ROUNDING = 1e-5


@dataclass(frozen=True)
class CourseMeasures:
    """What was measured on one course, or the worst of all; metres and radians.

    Attributes:
        off_facets: points off the mould's facets.
        residual: points off the surface that the facets stand for.
        normal_error: normals off that surface's.
        off_mould: centre line beyond the mould's edge.
        wander: from straight, on a metre.
        facet_wander: the same, laid flat over the facets instead of by the file's normals; not judged.
        strain: of the tape's edges, 1.
        lift: of a straight roller.
        clear: share of the course over facets fine enough to tell double curvature and lift.
        deviation: from the ply's angle.
        cut_angle: least of a cut with the tape's edge.
        length: of the course.
    """

    off_facets: float
    residual: float
    normal_error: float
    off_mould: float
    wander: float
    facet_wander: float
    strain: float
    lift: float
    clear: float
    deviation: float
    cut_angle: float
    length: float


# The measures of which the least is the worst.
LEAST = frozenset({"clear", "cut_angle", "length"})


def check_course(laid: LaidPly, row: int) -> tuple[CourseMeasures, list[Fault]]:
    """Return what was measured on the course in a row of the file, and its faults."""
    check = _CourseCheck(laid, row)
    on_mould = check.on_mould()
    wandering = check.straight()
    bent = check.bent()
    measures = CourseMeasures(*on_mould, *wandering, *bent, check.angle(), *check.cuts())
    return measures, check.faults


class _CourseCheck:
    """The check of one course."""

    def __init__(self, laid: LaidPly, row: int) -> None:
        self.laid, self.terms, self.surface = laid, laid.terms, laid.surface
        self.course, self.line, self.spots = laid.courses[row], laid.lines[row], laid.spots[row]
        self.number = self.course.number
        self.faults: list[Fault] = []

    def fail(self, sentence: str, point: Floats) -> None:
        """Add a fault at a point (3,) of the plane's frame."""
        self.faults.append(Fault(sentence, (self.number,), self.laid.place(point)))

    def on_mould(self) -> tuple[float, float, float, float]:
        """Judge points and normals against the facets."""
        points, spots, surface = self.course.points, self.spots, self.surface
        normals = surface.facet_normals[spots.facets]
        away = points - surface.on_facets(spots)
        heights = dot(away, normals)
        sags = surface.sags(spots)
        over = spots.inside
        off = np.where(over, np.abs(heights), 0.0)
        residuals = np.where(over, np.abs(heights - sags), 0.0)
        allowed = self.terms.max_surface_residual + _SAG_SHARE * surface.chord_errors(spots)
        if (worst := _worst(residuals, allowed)) is not None:
            self.fail(
                f"course {self.number}: {residuals[worst] / MM:.3f} mm off the mould at "
                f"{self.laid.at(points[worst])}, expected "
                f"at most {allowed[worst] / MM:.3f}: plan it on this mould",
                points[worst],
            )
        errors = _angles(self.course.normals, surface.normals(spots))
        allowed = NORMAL_ERROR + _NORMAL_SHARE * surface.spreads(spots) + _DOUBTS * surface.doubts(spots)
        # Beyond the mould there is no normal to compare with, but none is turned over.
        allowed = np.where(over, allowed, math.pi / 2)
        if (worst := _worst(errors, allowed)) is not None:
            self.fail(
                f"course {self.number}: the normal is {errors[worst] / DEG:.2f} deg off the mould's at "
                f"{self.laid.at(points[worst])}, expected at most {allowed[worst] / DEG:.2f}",
                points[worst],
            )
        beyond = np.where(over, 0.0, norms(away - heights[:, None] * normals))
        limit = self.terms.max_off_mould
        if (worst := _worst(beyond, np.full(len(beyond), limit + _ROUNDING))) is not None:
            self.fail(
                f"course {self.number} runs {beyond[worst] / MM:.1f} mm beyond the mould at "
                f"{self.laid.at(points[worst])}, "
                f"expected at most {limit / MM:g}: extend the mould or inset the ply",
                points[worst],
            )
        return _most(off), _most(residuals), _most(np.where(over, errors, 0.0)), _most(beyond)

    def straight(self) -> tuple[float, float]:
        """Judge the wander of the course from straight."""
        course, surface = self.course, self.surface
        found = wander(course.points, course.normals, course.arc_lengths - course.arc_lengths[0])
        if not found.distance <= WANDER:
            point = course.points[found.sample]
            self.fail(
                f"course {self.number} wanders {found.distance / MM:.2f} mm sideways from a natural path at "
                f"{self.laid.at(point)}, expected at most {WANDER / MM:g} on a metre",
                point,
            )
        over = self.spots.rows(self.spots.inside)
        if len(over.facets) < 3:
            return found.distance, 0.0
        facets = surface.facet_normals[over.facets]
        # The plane of a joint is the mean of its chords' planes; on one facet that is the facet's own.
        means = facets.copy()
        means[1:-1] = unit(facets[:-2] + 2 * facets[1:-1] + facets[2:])
        arcs = course.arc_lengths[self.spots.inside]
        flat = wander(surface.on_facets(over), means, arcs - arcs[0])
        return found.distance, flat.distance

    def bent(self) -> tuple[float, float, float]:
        """Judge strain and lift."""
        line, terms = self.line, self.terms
        inner = np.flatnonzero(line.inner)
        points, lefts = line.points[inner], line.lefts[inner]
        spots = self.surface.spots(points[:, :2])
        shapes = self.surface.shapes(spots)
        clear = spots.inside & (self.surface.doubts(spots) <= _CLEAR)
        traces = np.einsum("nii->n", shapes)
        gauss = (traces**2 - np.einsum("nij,nji->n", shapes, shapes)) / 2
        doubly = np.where(clear, np.abs(gauss) * terms.width**2 / 8, 0.0)
        strains = doubly + np.abs(steering(line)) * terms.width / 2
        limit = terms.max_strain
        if (worst := _worst(strains, np.full(len(strains), limit * _ESTIMATE + _STRAIN_ERROR))) is not None:
            self.fail(
                f"course {self.number}: strain of {strains[worst] * 100:.2f} % at "
                f"{self.laid.at(points[worst])}, expected at "
                f"most {limit * 100:g}: use narrower tape",
                points[worst],
            )
        across = np.abs(np.einsum("ni,nij,nj->n", lefts, shapes, lefts))
        lifts = np.where(clear, across * terms.width**2 / 8, 0.0)
        if (worst := _worst(lifts, np.full(len(lifts), terms.max_lift * _ESTIMATE))) is not None:
            self.fail(
                f"course {self.number}: the roller lifts {lifts[worst] / MM:.2f} mm at "
                f"{self.laid.at(points[worst])}, expected "
                f"at most {terms.max_lift / MM:g}: use narrower tape",
                points[worst],
            )
        return _most(strains), _most(lifts), float(np.mean(clear))

    def angle(self) -> float:
        """Judge the angle to the rosette, and the direction of travel."""
        line, terms = self.line, self.terms
        inner = np.flatnonzero(line.inner)
        deviations = np.abs(deviations_of(self.laid, line)[inner])
        points = line.points[inner]
        limit = terms.max_angle_deviation
        if (worst := _worst(deviations, np.full(len(inner), limit + _ROUNDING))) is not None:
            self.fail(
                f"course {self.number}: {deviations[worst] / DEG:.2f} deg off the ply's angle at "
                f"{self.laid.at(points[worst])}, expected at most {limit / DEG:g}",
                points[worst],
            )
        return _most(deviations)

    def cuts(self) -> tuple[float, float]:
        """Judge cut angles and the length."""
        line, terms, points = self.line, self.terms, self.course.points
        angles = [min(angle, math.pi - angle) for angle in self.course.cut_angles]
        for angle, point, last in zip(angles, points[[0, -1]], (False, True), strict=True):
            if not angle >= terms.minimum_cut_angle - _ROUNDING:
                self.fail(
                    f"course {self.number}: its {'end' if last else 'start'} cut makes {angle / DEG:.2f} deg with the "
                    f"tape's edge, expected at least {terms.minimum_cut_angle / DEG:g}",
                    point,
                )
        if not line.length >= terms.minimum_length - _ROUNDING:
            self.fail(
                f"course {self.number} is {line.length / MM:.1f} mm long, expected at least "
                f"{terms.minimum_length / MM:g}: "
                "lengthen it at both ends",
                points[0],
            )
        start, end = line.slants
        if not line.length > abs(end - start) * line.half_width:
            self.fail(
                f"course {self.number}: its cuts cross inside the tape, as it is {line.length / MM:.1f} mm long",
                points[0],
            )
        return min(angles), line.length


def deviations_of(laid: LaidPly, line: CourseLine) -> Floats:
    """Return the angles (n,) of a line's samples from the ply's direction or its opposite, radians to the left."""
    headings = laid.headings(line.normals)
    across, along = dot(np.cross(headings, line.tangents), line.normals), dot(headings, line.tangents)
    deviations: Floats = np.arctan2(np.where(along < 0.0, -across, across), np.abs(along))
    return deviations


def _worst(values: Floats, limits: Floats) -> int | None:
    """Return the index of the value most beyond its limit; None where each keeps it. NaN keeps none."""
    broken: Mask = ~(values <= limits)
    if not broken.any():
        return None
    return int(np.argmax(np.where(broken, np.nan_to_num(values - limits, nan=np.inf), -np.inf)))


def _most(values: Floats) -> float:
    """Return the largest value; NaN where one is."""
    return float(np.max(values))


def _angles(one: Floats, other: Floats) -> Floats:
    """Return the angles (n,) between unit vectors (n, 3), radians."""
    angles: Floats = 2.0 * np.arctan2(norms(one - other), norms(one + other))
    return angles
