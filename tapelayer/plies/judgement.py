"""Judgement: what a course file is, measured against its mould and ply."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from tapelayer.plies.laid_ply import Fault
from tapelayer.reporting.words import Words
from tapelayer.units import MM, json_number

# What no judgement of a course file covers.
NOT_JUDGED = (
    Words("waste of tape beyond the cuts", "切割线以外的料带浪费"),
    Words("order of courses that face no other", "无相邻道次者的铺放顺序"),
    Words("direction of courses laid there and back", "往返铺放时各道次的方向"),
    Words("what lies beyond the mould's edge", "模具边缘以外的部分"),
    Words("double curvature and lift over facets too coarse to tell them", "三角面过粗处的双曲率应变和压辊悬空"),
    Words("reach of the machine", "机床的行程"),
)


@dataclass(frozen=True)
class Judgement:
    """What a course file is, measured against its mould and ply; NaN where nothing could be measured.

    Attributes:
        courses: their number.
        laid_length_m: sum of their lengths.
        ply_area_m2: of the facets inside the boundary.
        coverage_percent: of the ply that lies under tape.
        overlap_percent: of the ply that lies under more than one tape.
        overhang_percent: of the ply's area, that much tape lies outside the boundary.
        max_gap_mm: between facing edges; 0 where none face each other.
        max_overlap_mm: the same, negative where every gap is open.
        max_uncovered_mm: largest distance of a point of the ply from tape.
        short_of_boundary_mm: largest lack of tape at a cut.
        laid_through_mm: longest interruption of the ply that a course is laid through.
        off_facets_mm: points off the facets.
        surface_residual_mm: points off the surface that the facets stand for.
        normal_error_deg: normals off that surface's.
        off_mould_mm: centre lines beyond the mould's edge.
        max_wander_mm: from straight, on a metre.
        facet_wander_mm: the same laid flat over the facets; coarse, so not judged.
        max_strain_percent: of the tape's edges, by double curvature and steering.
        max_lift_mm: of a straight roller.
        curvature_known_percent: of the course with the least over facets fine enough to tell strain and lift.
        max_angle_deviation_deg: from the ply's angle.
        least_cut_angle_deg: with the tape's edge.
        shortest_course_mm: length of the shortest course.
        seed_offset_mm: of the reference course from the seed, less the stagger.
        seed_angle_error_deg: of the reference course at the seed.
        faults: all that breaks a limit of the ply.
        not_judged: what is left open.
    """

    courses: int
    laid_length_m: float
    ply_area_m2: float
    coverage_percent: float
    overlap_percent: float
    overhang_percent: float
    max_gap_mm: float
    max_overlap_mm: float
    max_uncovered_mm: float
    short_of_boundary_mm: float
    laid_through_mm: float
    off_facets_mm: float
    surface_residual_mm: float
    normal_error_deg: float
    off_mould_mm: float
    max_wander_mm: float
    facet_wander_mm: float
    max_strain_percent: float
    max_lift_mm: float
    curvature_known_percent: float
    max_angle_deviation_deg: float
    least_cut_angle_deg: float
    shortest_course_mm: float
    seed_offset_mm: float
    seed_angle_error_deg: float
    faults: tuple[Fault, ...]
    not_judged: tuple[Words, ...] = NOT_JUDGED

    @property
    def passed(self) -> bool:
        """Return whether every limit is kept and everything was measured."""
        return not self.faults and not any(math.isnan(value) for value in self.measured.values())

    @property
    def measured(self) -> dict[str, float]:
        """Return the measured values by their keys."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("faults", "not_judged")}

    def values(self) -> dict[str, Any]:
        """Return the judgement as plain values for JSON; None for what was not measured."""
        return {
            **{key: json_number(value) if key != "courses" else value for key, value in self.measured.items()},
            "passed": self.passed,
            "not_judged": [words.en for words in self.not_judged],
            "faults": [
                {
                    "what": fault.sentence,
                    "courses": list(fault.courses),
                    "place_mm": None if fault.place is None else [json_number(value / MM) for value in fault.place],
                }
                for fault in self.faults
            ],
        }
