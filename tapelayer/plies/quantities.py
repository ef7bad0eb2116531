"""Quantities: the rows of a ply's report, in the order of its JSON."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.plies.evidence import PlyEvidence
from tapelayer.reporting.quantity import Group, Listing, Quantity, Row, count
from tapelayer.reporting.words import Words
from tapelayer.units import DEG, MM, json_number

# Square metres in a square centimetre.
CM2 = 1e-4
NO_NEIGHBOURS = Words("no neighbours", "无相邻道次")


def _largest(values: Floats) -> float:
    """Return the largest magnitude of those that are known; NaN where none is."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.max(known)) if len(known) else math.nan


def _max_gap(evidence: PlyEvidence) -> float | None:
    """Return the largest gap, mm, that left beside the outer courses included; None where there is none."""
    widths = np.concatenate([evidence.gaps.widths, np.atleast_1d(evidence.plan.family.left_out)]) / MM
    return float(np.max(widths)) if len(evidence.gaps.widths) or np.any(widths > 0.0) else None


def _max_overlap(evidence: PlyEvidence) -> float | None:
    """Return the largest overlap, mm, negative where every gap is open; None where there are no neighbours."""
    widths = evidence.gaps.widths / MM
    return float(-np.min(widths)) if len(widths) else None


def _least_cut_angle(evidence: PlyEvidence) -> float:
    angles = [min(angle, math.pi - angle) for course in evidence.plan.courses for angle in course.cut_angles]
    return min(angles, default=math.nan) / DEG


def _course_list(evidence: PlyEvidence) -> list[dict[str, Any]]:
    """Return what there is to know of each course, in the order of laying."""
    samples, starts = evidence.samples, range(len(evidence.plan.pieces) + 1)
    borders = np.searchsorted(samples.courses, starts).tolist()
    strains, lifts, deviations = samples.laid_strains, samples.laid_lifts, samples.laid_deviations
    told = []
    for piece, course, begin, end in zip(
        evidence.plan.pieces, evidence.plan.courses, borders[:-1], borders[1:], strict=True
    ):
        rows = slice(begin, end)
        told.append(
            {
                "course": course.number,
                "strip": piece.strip + 1,
                "length_mm": json_number(piece.length / MM),
                "points": len(course.points),
                "cut_angles_deg": [json_number(angle / DEG) for angle in course.cut_angles],
                "lengthened_mm": json_number(2.0 * piece.lengthened / MM),
                "laid_through": piece.laid_through,
                "backwards": piece.backwards,
                "max_strain_percent": json_number(100.0 * _largest(strains[rows])),
                "max_lift_mm": json_number(_largest(lifts[rows]) / MM),
                "max_angle_deviation_deg": json_number(_largest(deviations[rows]) / DEG),
            }
        )
    return told


def _gap_list(evidence: PlyEvidence) -> list[dict[str, Any]]:
    """Return the gaps of each pair of neighbours."""
    gaps = evidence.gaps
    if not len(gaps.widths):
        return []
    pairs, groups = np.unique(np.column_stack([gaps.rights, gaps.lefts]), axis=0, return_inverse=True)
    groups = groups.ravel()
    least, largest = np.full(len(pairs), np.inf), np.full(len(pairs), -np.inf)
    np.minimum.at(least, groups, gaps.widths)
    np.maximum.at(largest, groups, gaps.widths)
    return [
        {"right": int(right) + 1, "left": int(left) + 1, "least_mm": json_number(low), "largest_mm": json_number(high)}
        for (right, left), low, high in zip(pairs.tolist(), (least / MM).tolist(), (largest / MM).tolist(), strict=True)
    ]


ROWS: tuple[Row[PlyEvidence], ...] = (
    count(
        "courses",
        Words("courses", "道次数"),
        Words("courses of the ply", "铺层的道次数"),
        lambda e: len(e.plan.courses),
        headline=True,
    ),
    Quantity(
        "laid_length_m",
        Words("laid length", "铺放长度"),
        Words("length of all courses", "所有道次的长度"),
        "m",
        3,
        lambda e: e.laid_length,
        Group.FACT,
        required=True,
        headline=True,
    ),
    Quantity(
        "ply_area_m2",
        Words("ply area", "铺层面积"),
        Words("area on the surface inside the boundary", "边界内曲面的面积"),
        "m2",
        4,
        lambda e: e.ledger.ply,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "coverage_percent",
        Words("coverage", "覆盖率"),
        Words("share of the ply's area under tape", "带料覆盖面积占铺层面积的百分比"),
        "%",
        2,
        lambda e: 100.0 * e.ledger.coverage,
        Group.FACT,
        required=True,
        headline=True,
    ),
    Quantity(
        "gap_area_cm2",
        Words("gap area", "间隙面积"),
        Words("area of the ply under no tape", "铺层中未被带料覆盖的面积"),
        "cm2",
        2,
        lambda e: e.ledger.gap / CM2,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "overlap_area_cm2",
        Words("overlap area", "重叠面积"),
        Words("area under two tapes", "两层带料重叠的面积"),
        "cm2",
        2,
        lambda e: e.ledger.overlap / CM2,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "overhang_percent",
        Words("overhang", "超出边界"),
        Words(
            "tape outside the boundary, in percent of the ply's area: what straight cuts cost, and the margin",
            "边界外带料面积占铺层面积的百分比：直线切割与余边的代价",
        ),
        "%",
        2,
        lambda e: 100.0 * e.ledger.overhang_share,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "least_breadth_mm",
        Words("least breadth", "最小覆盖宽度"),
        Words(
            "breadth of the ply that the narrower of the two outer courses covers",
            "最外两道中较窄者所覆盖的铺层宽度",
        ),
        "mm",
        1,
        lambda e: float(np.min(e.plan.family.breadths)) / MM,
        Group.FACT,
        required=True,
    ),
    count(
        "lengthened",
        Words("courses lengthened", "加长道次数"),
        Words(
            "courses made longer than the ply needs, to the minimum length or so that their cuts do not cross",
            "为达到最小长度或避免切割线相交而加长的道次数",
        ),
        lambda e: len(e.lengthened),
    ),
    count(
        "laid_through",
        Words("interruptions laid through", "直接铺过的间断数"),
        Words(
            "holes and notches shorter than the minimum hole, over which a course goes on",
            "短于最小孔长而直接铺过的孔和缺口数",
        ),
        lambda e: sum(piece.laid_through for piece in e.plan.pieces),
    ),
    Quantity(
        "max_gap_mm",
        Words("gap", "间隙"),
        Words(
            "largest distance from a course's edge to that of the next, across the course",
            "一道边缘到相邻道边缘的最大距离，沿垂直于道次的方向",
        ),
        "mm",
        3,
        _max_gap,
        absent=NO_NEIGHBOURS,
        required=True,
        headline=True,
    ),
    Quantity(
        "max_overlap_mm",
        Words("overlap", "重叠"),
        Words(
            "largest overlap of neighbouring courses; negative where every gap is open",
            "相邻道次的最大重叠；所有间隙均张开时为负",
        ),
        "mm",
        3,
        _max_overlap,
        absent=NO_NEIGHBOURS,
        required=True,
    ),
    Quantity(
        "max_strain_percent",
        Words("strain", "应变"),
        Words(
            "length of the tape along its edge, or as far out as it is laid in the ply, over that of its centre line, "
            "less 1: the double curvature under the tape",
            "带边（或铺层内带料最外处）长度与中心线长度之比减 1：带料下方的双曲率所致",
        ),
        "%",
        4,
        lambda e: 100.0 * _largest(e.samples.laid_strains),
        required=True,
        headline=True,
    ),
    Quantity(
        "max_lift_mm",
        Words("lift", "压辊离面"),
        Words(
            "sag of the surface under a straight roller as wide as the tape: width² / 8 by the curvature across it",
            "曲面在与带同宽的直压辊下的弓高：带宽² / 8 乘以横向曲率",
        ),
        "mm",
        3,
        lambda e: _largest(e.samples.laid_lifts) / MM,
        required=True,
    ),
    Quantity(
        "max_angle_deviation_deg",
        Words("angle deviation", "角度偏差"),
        Words(
            "courses off the ply's angle to the rosette, which natural paths cannot keep everywhere",
            "道次偏离铺层角度（相对基准方向）；自然路径无法处处保持该角度",
        ),
        "deg",
        3,
        lambda e: _largest(e.samples.laid_deviations) / DEG,
        required=True,
    ),
    Quantity(
        "least_cut_angle_deg",
        Words("cut angle", "切割角"),
        Words("smallest angle between a cut and the tape's edge", "切割线与带边的最小夹角"),
        "deg",
        2,
        _least_cut_angle,
        required=True,
    ),
    Quantity(
        "shortest_course_mm",
        Words("shortest course", "最短道次"),
        Words("length of the shortest course", "最短道次的长度"),
        "mm",
        1,
        lambda e: min((piece.length for piece in e.plan.pieces), default=math.nan) / MM,
        required=True,
    ),
    Quantity(
        "off_mould_mm",
        Words("off the mould", "超出模具"),
        Words(
            "how far the centre line of a course runs beyond the mould's edge, where the head presses into the air",
            "道次中心线超出模具边缘的距离，该处铺带头压空",
        ),
        "mm",
        2,
        lambda e: e.judgement.off_mould_mm,
        required=True,
    ),
    Quantity(
        "surface_residual_mm",
        Words("surface residual", "曲面残差"),
        Words(
            "the smooth surface off the corners of the mould's facets, inside the ply",
            "铺层内光滑曲面偏离模具三角面顶点的距离",
        ),
        "mm",
        4,
        lambda e: e.plan.mould.residual / MM,
        required=True,
    ),
    Quantity(
        "surface_ambiguity_mm",
        Words("surface ambiguity", "曲面不确定度"),
        Words(
            "how far another smooth surface through the same facets moves a course: what the mould's facets leave open",
            "经过同一三角面的另一光滑曲面使道次移动的距离：模具三角面未能确定的部分",
        ),
        "mm",
        3,
        lambda e: e.plan.ambiguity / MM,
        required=True,
    ),
    Quantity(
        "off_facets_mm",
        Words("off the facets", "偏离三角面"),
        Words(
            "courses off the mould's flat facets: how coarse they are, as the surface that they stand for is curved",
            "道次偏离模具平面三角面的距离：反映三角面的粗糙程度，因其代表的曲面是弯曲的",
        ),
        "mm",
        3,
        lambda e: e.judgement.off_facets_mm,
        required=True,
    ),
    Quantity(
        "path_error_mm",
        Words("path error", "路径误差"),
        Words(
            "how far half the steps move a course: what is left of the integration's error",
            "步长减半时道次移动的距离：积分的剩余误差",
        ),
        "mm",
        5,
        lambda e: e.plan.path_error / MM,
        required=True,
    ),
    Quantity(
        "spacing_error_mm",
        Words("spacing error", "点距误差"),
        Words(
            "the spline that a program lays through a course's points, off the course between them",
            "程序通过道次各点的样条在点间偏离道次的距离",
        ),
        "mm",
        5,
        lambda e: e.plan.spacing_error / MM,
        required=True,
    ),
    Listing("course_list", _course_list),
    Listing("gap_list", _gap_list),
    Listing("judgement", lambda e: e.judgement.values()),
)
