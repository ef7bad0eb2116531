"""Judge: a course file against the mould's own facets and the ply file, whoever planned it.

It knows no planner: gaps come from the points and normals of the file, what is covered from spots on the facets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from shapely import Polygon

from tapelayer.courses.course import Course
from tapelayer.geometry.plane import Plane
from tapelayer.plies.course_checks import LEAST, CourseMeasures, check_course
from tapelayer.plies.cover_checks import CoverCheck, hole_faults
from tapelayer.plies.facet_surface import FacetSurface
from tapelayer.plies.family_checks import at_seed, gap_faults, order_faults
from tapelayer.plies.gap_profiles import GapProfiles
from tapelayer.plies.judgement import Judgement
from tapelayer.plies.laid_ply import LaidPly, Terms
from tapelayer.plies.ply import Ply
from tapelayer.plies.region import Region
from tapelayer.plies.tape_cover import overhang
from tapelayer.units import DEG, MM

# Spots on the whole mould by which the cover of a ply is measured.
SAMPLES = 100_000


def terms_of(ply: Ply, region: Region) -> Terms:
    """Return what a ply file asks of its courses."""
    courses, limits = ply.courses, ply.limits
    return Terms(
        width=ply.width,
        angle=ply.angle,
        rosette=region.rosette,
        seed=region.seed,
        margin=ply.ply.margin_mm * MM,
        stagger=courses.stagger_mm * MM,
        minimum_length=courses.minimum_length_mm * MM,
        minimum_hole=courses.minimum_hole_mm * MM,
        minimum_cut_angle=courses.minimum_cut_angle_deg * DEG,
        order=courses.order,
        start_corner=courses.start_corner,
        reverse=courses.reverse,
        max_gap=ply.max_gap,
        max_overlap=ply.max_overlap,
        max_strain=limits.max_strain_percent / 100,
        max_lift=limits.max_lift_mm * MM,
        max_angle_deviation=limits.max_angle_deviation_deg * DEG,
        max_surface_residual=limits.max_surface_residual_mm * MM,
        max_off_mould=ply.max_off_mould,
    )


def judge_courses(courses: Sequence[Course], ply: Ply, region: Region) -> Judgement:
    """Return the judgement of courses on a ply's mould.

    Args:
        courses: in the order of their file, in the mould's frame.
        ply: its file.
        region: what the ply covers on the mould.
    """
    surface = FacetSurface.of(region.plane.into(region.mould.vertices), region.mould.facets[region.facets])
    return judge_on(surface, courses, terms_of(ply, region), region.plane, region.outline)


def judge_on(
    surface: FacetSurface,
    courses: Sequence[Course],
    terms: Terms,
    plane: Plane,
    outline: Polygon,
    samples: int = SAMPLES,
) -> Judgement:
    """Return the judgement of courses on a surface.

    Args:
        surface: of the mould, in the plane's frame.
        courses: in the order of their file, in the mould's frame.
        terms: of the ply.
        plane: of the ply, in the mould's frame.
        outline: of the ply in plan, metres, without its holes.
        samples: spots on the whole mould by which its cover is measured.
    """
    laid = LaidPly.of(courses, terms, plane, surface, outline)
    checks = [check_course(laid, row) for row in range(len(courses))]
    faults = [fault for _, found in checks for fault in found]
    profiles = GapProfiles.of(laid.lines, laid.ways, outline)
    faults += gap_faults(laid, profiles) + order_faults(laid, profiles)
    offset, error, found = at_seed(laid)
    faults += found
    cover = CoverCheck(laid, samples)
    faults += cover.faults(profiles)
    hangs = [overhang(line, laid.outline) for line in laid.lines]
    faults += hole_faults(laid, hangs)
    worst = {
        one.name: float(
            (np.min if one.name in LEAST else np.max)([getattr(measures, one.name) for measures, _ in checks])
        )
        for one in fields(CourseMeasures)
    }
    none = not len(profiles.gaps)
    return Judgement(
        courses=len(courses),
        laid_length_m=sum(line.length for line in laid.lines),
        ply_area_m2=cover.area,
        coverage_percent=cover.share(1),
        overlap_percent=cover.share(2),
        overhang_percent=100 * sum(hang.outside for hang in hangs) / cover.area if cover.area else math.nan,
        max_gap_mm=0.0 if none else max(float(np.max(profiles.gaps)), 0.0) / MM,
        max_overlap_mm=(cover.deepest if none else max(float(np.max(-profiles.gaps)), cover.deepest)) / MM,
        max_uncovered_mm=float(np.max(cover.uncovered()[1], initial=0.0)) / MM,
        short_of_boundary_mm=cover.lack / MM,
        laid_through_mm=max(hang.laid_through for hang in hangs) / MM,
        off_facets_mm=worst["off_facets"] / MM,
        surface_residual_mm=worst["residual"] / MM,
        normal_error_deg=worst["normal_error"] / DEG,
        off_mould_mm=worst["off_mould"] / MM,
        max_wander_mm=worst["wander"] / MM,
        facet_wander_mm=worst["facet_wander"] / MM,
        max_strain_percent=worst["strain"] * 100,
        max_lift_mm=worst["lift"] / MM,
        curvature_known_percent=worst["clear"] * 100,
        max_angle_deviation_deg=worst["deviation"] / DEG,
        least_cut_angle_deg=worst["cut_angle"] / DEG,
        shortest_course_mm=worst["length"] / MM,
        seed_offset_mm=offset / MM,
        seed_angle_error_deg=error / DEG,
        faults=tuple(faults),
    )
