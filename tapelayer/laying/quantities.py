"""Quantities: the rows of a laying report, in the order of its JSON."""

from __future__ import annotations

import math
import re

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.tape_ledger import listed_courses, time_shares
from tapelayer.reporting.quantity import Group, Listing, Quantity, Row, Style, count
from tapelayer.reporting.words import NONE, Words
from tapelayer.units import DEG, MM, json_number

# A step at this share of the set speed counts as laid at set speed.
AT_SPEED = 0.95
# Of a block shorter than this, in metres, rounded digits do not tell the speed.
LEAST_LENGTH = 1e-3
# Failures of a knife that is where it must not be, or is not where it must be.
KNIFE_FAILURE = re.compile(
    r"knife_[12]_(switched_again|left_on|off_every_cut_mm)|(rapid|stop)_with_knife_[12]_on"
    r"|cuts_made|cut_width_mm|axis_[vq]_mm"
)


def _largest(values: Floats) -> float:
    """Return the largest magnitude; NaN if there is no value or one is not finite."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest if len(values) and math.isfinite(largest) else math.nan


def _largest_spread(values: Floats, courses: Ints) -> float:
    """Return the largest difference of values (n,) within one course; NaN if there is no value or one is NaN."""
    if not len(values):
        return math.nan
    starts = np.unique(courses, return_index=True)[1]
    return float(np.max(np.maximum.reduceat(values, starts) - np.minimum.reduceat(values, starts)))


def _edge_lift(evidence: Evidence) -> float:
    """Return how far the largest tilt lifts an edge of the tape, mm."""
    # Taking the tilt from the report's degrees would change the last digit.
    return evidence.tape_width / 2 * math.sin(_largest(evidence.samples.tilts)) / MM


def _wrap(evidence: Evidence) -> float:
    return evidence.roller_radius * _largest_spread(evidence.samples.wraps, evidence.samples.courses) / MM


def _chord_error(evidence: Evidence) -> float:
    return _largest(evidence.samples.position_errors[~evidence.samples.block_ends]) / MM


def _waste_percent(evidence: Evidence) -> float:
    """Return the waste in percent of the tape used; NaN if none was used."""
    return 100 * evidence.tape.waste / evidence.tape.used if evidence.tape.used else math.nan


def _link_clearance(evidence: Evidence) -> float | None:
    """Return the least clearance between courses, mm; None if the head never links."""
    clearance = evidence.least_link_clearance
    return None if clearance == math.inf else clearance / MM


def _lay_speeds(evidence: Evidence) -> tuple[Ints, Floats, Floats]:
    """Return steps (m,) from sample to sample of one course, with their lengths in metres and speeds in m/s."""
    samples = evidence.samples
    steps = np.flatnonzero((np.diff(samples.courses) == 0) & (np.diff(samples.arc_lengths) > 0.0))
    lengths, times = np.diff(samples.arc_lengths)[steps], np.diff(samples.times)[steps]
    with np.errstate(divide="ignore", invalid="ignore"):
        return steps, lengths, lengths / times


def _asked_speeds(evidence: Evidence) -> tuple[Ints, Floats, Floats]:
    """Return blocks (m,) of the courses, by their first samples, lengths in metres and the speeds asked for in m/s."""
    samples = evidence.samples
    ends = np.flatnonzero(samples.block_ends)
    lengths, times = np.diff(samples.arc_lengths[ends]), np.diff(samples.asked[ends])
    blocks = np.flatnonzero((np.diff(samples.courses[ends]) == 0) & (lengths > LEAST_LENGTH) & (times > 0.0))
    return ends[blocks], lengths[blocks], lengths[blocks] / times[blocks]


def _least(speeds: Floats) -> float:
    return float(np.min(speeds)) if len(speeds) else math.nan


def _share(evidence: Evidence, speed: float) -> float:
    """Return the share of the laid length at a speed in m/s on the control, or near it; NaN if nothing was laid."""
    _, lengths, speeds = _lay_speeds(evidence)
    whole = float(np.sum(lengths))
    return float(np.sum(lengths[speeds >= AT_SPEED * speed])) / whole if whole > 0.0 else math.nan


def speed_share(evidence: Evidence) -> float:
    """Return the share of the laid length at set speed; NaN if nothing was laid."""
    return _share(evidence, evidence.lay_speed)


def _median_speed(evidence: Evidence) -> float:
    """Return the speed in m/s that half of the laid length exceeds; NaN if nothing was laid."""
    _, lengths, speeds = _lay_speeds(evidence)
    if not len(lengths):
        return math.nan
    order = np.argsort(speeds)
    laid = np.cumsum(lengths[order])
    return float(speeds[order][np.searchsorted(laid, laid[-1] / 2.0)])


def _slowest(evidence: Evidence, rows: Ints, lengths: Floats, speeds: Floats) -> dict[str, float | int | None] | None:
    """Return the place of the least speed, rests aside; None if nothing was laid.

    Args:
        evidence: with the samples.
        rows: (m,) samples at which stretches begin.
        lengths: (m,) metres of these stretches.
        speeds: (m,) m/s over them.
    """
    if not len(rows):
        return None
    row = int(rows[np.argmin(speeds)])
    return {
        "course": evidence.tape.rows[int(evidence.samples.courses[row])].course if evidence.tape.rows else 0,
        "arc_length_mm": json_number(float(evidence.samples.arc_lengths[row]) / MM),
        "speed_mm_per_s": json_number(float(np.min(speeds)) / MM),
    }


def _stops(evidence: Evidence) -> list[dict[str, float | int | None]]:
    """Return the places where the tape stops while it is laid."""
    return [
        {
            "course": stop.course,
            "arc_length_mm": json_number(stop.arc_length / MM),
            "rest_s": json_number(stop.seconds),
            **({"line": stop.line} if stop.line else {}),
        }
        for stop in evidence.tape.stops
    ]


def _knife_conflicts(evidence: Evidence) -> int:
    return sum(KNIFE_FAILURE.fullmatch(failure.what) is not None for failure in evidence.failures)


ROWS: tuple[Row[Evidence], ...] = (
    count(
        "courses",
        Words("courses", "道次数"),
        Words("courses in the course file", "道次文件中的道次数"),
        lambda e: e.courses,
    ),
    count(
        "points", Words("points", "点数"), Words("points in the course file", "道次文件中的点数"), lambda e: e.points
    ),
    count(
        "blocks",
        Words("blocks", "程序段"),
        Words("blocks in the program: motions, dwells and switching words", "程序中的程序段：运动、暂停和开关指令"),
        lambda e: e.blocks,
        headline=True,
    ),
    count(
        "cuts",
        Words("cuts", "切割次数"),
        Words("cuts made; one that two courses share counts once", "完成的切割；两道共用的一次只计一次"),
        lambda e: len(e.tape.cuts),
    ),
    count(
        "knife_conflicts",
        Words("knife conflicts", "切刀冲突"),
        Words(
            "failures in which a knife is where it must not be, or is not where it must be: put down or up twice, left "
            "down, down over a rapid, off every cut, a cut missing, made again or not over the full width, `v` or `q` "
            "beyond its travel",
            "切刀位置不当的失败：重复下落或抬起、未抬起、快移中未抬起、不在任何切割线上、"
            "缺切、重切、未切满带宽，或 `v`、`q` 超出行程",
        ),
        _knife_conflicts,
    ),
    Quantity(
        "laying_stops",
        Words("stops while laying", "铺放中停顿"),
        Words(
            "places where the tape stops while it is laid: where it rests, and where the control comes to a full stop",
            "铺放过程中带料停住的位置数：带料静止处及数控系统完全停止处",
        ),
        "",
        0,
        lambda e: len(e.tape.stops),
        Group.FACT,
        Style.COUNT,
        optional=True,
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
    ),
    Quantity(
        "duration_s",
        Words("duration", "时长"),
        Words(
            "time of the program on its control, by `time_law`; without accelerations every axis reaches its speed at "
            "once",
            "程序在其数控系统上的用时，按 `time_law` 计算；未给加速度时各轴视为立即达到速度",
        ),
        "s",
        1,
        lambda e: e.duration,
        Group.FACT,
        required=True,
        headline=True,
    ),
    Quantity(
        "asked_s",
        Words("time asked for", "指令用时"),
        Words(
            "time that the program's words ask for, without ramps and stops",
            "程序指令要求的用时，不含加减速与停顿",
        ),
        "s",
        1,
        lambda e: e.asked,
        Group.FACT,
    ),
    Quantity(
        "tape_used_mm",
        Words("tape used", "用带量"),
        Words(
            "from the tape's first leading edge to the last course's end, rolls that were changed included",
            "从第一个带头到最后一道末端的用带量，含换卷",
        ),
        "mm",
        1,
        lambda e: e.tape.used / MM,
        Group.FACT,
        required=True,
        headline=True,
    ),
    Quantity(
        "waste_mm",
        Words("waste", "废料"),
        Words("tape used and not laid", "用去而未铺放的带料"),
        "mm",
        1,
        lambda e: e.tape.waste / MM,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "waste_percent",
        Words("waste share", "废料率"),
        Words("the same of the tape used", "废料占用带量的百分比"),
        "%",
        2,
        _waste_percent,
        Group.FACT,
        required=True,
    ),
    Quantity(
        "max_position_error_mm",
        Words("position error", "位置误差"),
        Words(
            "contact off the course in the plane across the travel: root of normal² + lateral², at block ends and "
            "between",
            "接触点在垂直于行进方向的平面内偏离道次的距离（法向与侧向的合成），在段末及段中检查",
        ),
        "mm",
        4,
        lambda e: _largest(e.samples.position_errors) / MM,
        required=True,
        headline=True,
        samples="position_errors",
        curves=((Words("normal", "法向"), "normal_errors"), (Words("lateral", "侧向"), "lateral_errors")),
    ),
    Quantity(
        "max_chord_error_mm",
        Words("chord error", "弦高误差"),
        Words(
            "the same between block ends only: the blocks are straight in joint space, the course is not",
            "仅段中的位置误差：程序段在关节空间是直线，道次不是",
        ),
        "mm",
        4,
        _chord_error,
        required=True,
    ),
    Quantity(
        "max_roller_tilt_deg",
        Words("roller tilt", "压辊倾斜"),
        Words("roller axis out of the surface's tangent plane", "压辊轴线偏离曲面切平面的角度"),
        "deg",
        4,
        lambda e: _largest(e.samples.tilts) / DEG,
        required=True,
        headline=True,
        samples="tilts",
        curves=((Words("tilt", "倾斜"), "tilts"),),
    ),
    Quantity(
        "max_edge_lift_mm",
        Words("edge lift", "带边翘起"),
        Words(
            "width / 2 · sin(`max_roller_tilt_deg`): how far that tilt lifts an edge of the tape",
            "带宽 / 2 · sin(`max_roller_tilt_deg`)：该倾斜使带边翘起的高度",
        ),
        "mm",
        4,
        _edge_lift,
        required=True,
    ),
    Quantity(
        "max_heading_error_deg",
        Words("heading error", "航向误差"),
        Words("roller axis off square to the travel, in the tangent plane", "压辊轴线在切平面内与行进方向的垂直度误差"),
        "deg",
        4,
        lambda e: _largest(e.samples.heading_errors) / DEG,
        required=True,
        samples="heading_errors",
        curves=((Words("heading", "航向"), "heading_errors"),),
    ),
    Quantity(
        "max_pitch_deg",
        Words("pitch on the roller", "压辊俯仰"),
        Words(
            "angle between head normal and surface normal about the roller axis, which the round roller takes up",
            "铺带头法向与曲面法向绕压辊轴的夹角，由圆辊自身吸收",
        ),
        "deg",
        3,
        lambda e: _largest(e.samples.pitches) / DEG,
        required=True,
    ),
    Quantity(
        "max_wrap_mm",
        Words("wrap in a course", "道次内包绕量"),
        Words(
            "roller radius times the spread, within one course, of the nip's angle round the roller: the tape that the "
            "wrap takes or gives. With `wrap_compensation = false` the program leaves it out, and this says how much",
            "压辊半径乘以一道内压点包角的变化范围：包绕多用或少用的带料。"
            "`wrap_compensation = false` 时程序不作补偿，此值即为其大小",
        ),
        "mm",
        3,
        _wrap,
        required=True,
    ),
    Quantity(
        "max_roller_offset_mm",
        Words("roller offset", "压辊偏移"),
        Words(
            "roller's centre off its exact place, one radius above the course along the normal",
            "压辊中心偏离其精确位置（沿法向高出道次一个半径）的距离",
        ),
        "mm",
        4,
        lambda e: _largest(e.samples.offsets) / MM,
        required=True,
    ),
    Quantity(
        "max_tape_error_mm",
        Words("tape error", "送带误差"),
        Words("nip ahead of or behind the tape fed", "压点相对送带量的超前或滞后"),
        "mm",
        4,
        lambda e: _largest(e.samples.tape_errors) / MM,
        required=True,
        samples="tape_errors",
        curves=((Words("tape", "送带"), "tape_errors"),),
    ),
    Quantity(
        "max_cut_error_mm",
        Words("cut error", "切割误差"),
        Words(
            "lowered knife off the line that it cuts, on the tape, square to the line",
            "落下的切刀在带上垂直于切割线的偏离",
        ),
        "mm",
        4,
        lambda e: _largest(np.array([cut.error for cut in e.tape.cuts])) / MM,
        required=True,
    ),
    Quantity(
        "max_blade_error_deg",
        Words("blade error", "刀刃角误差"),
        Words("blade of a lowered knife off the direction of its line", "落下的刀刃与其切割线方向的夹角"),
        "deg",
        4,
        lambda e: _largest(np.array([cut.blade_error for cut in e.tape.cuts])) / DEG,
        required=True,
    ),
    Quantity(
        "taken_back_mm",
        Words("tape taken back", "回收带长"),
        Words(
            "longest run of the tape backwards, head in the air between courses",
            "道次之间铺带头离开工件时带料回收的最大长度",
        ),
        "mm",
        3,
        lambda e: e.tape_taken_back / MM,
        required=True,
    ),
    Quantity(
        "least_link_clearance_mm",
        Words("link clearance", "过渡间隙"),
        Words(
            "roller above the highest course point while the head goes from course to course; `null` where it never "
            "does",
            "铺带头在道次之间移动时压辊高出最高道次点的距离；无过渡时为 `null`",
        ),
        "mm",
        2,
        _link_clearance,
        absent=Words("no link", "无过渡"),
        required=True,
    ),
    Quantity(
        "max_forward_disagreement_m",
        Words("forward disagreement", "正解偏差"),
        Words(
            "Pinocchio itself against the batch evaluator that measured all the rest",
            "Pinocchio 本身与批量求值器（测量其余各项）的差",
        ),
        "m",
        1,
        lambda e: e.forward_disagreement,
        style=Style.POWER,
        required=True,
    ),
    Quantity(
        "planned_laying_speed_mm_per_s",
        Words("planned laying speed", "计划铺放速度"),
        Words(
            "least speed that the program's words ask of the nip along the courses, ramps aside; `slowest_planned` has "
            "its place",
            "程序指令在各道次上要求压点达到的最低速度，不含加减速；位置见 `slowest_planned`",
        ),
        "mm/s",
        1,
        lambda e: _least(_asked_speeds(e)[2]) / MM,
        absent=NONE,
    ),
    Quantity(
        "median_laying_speed_mm_per_s",
        Words("median laying speed", "铺放速度中位数"),
        Words("half of the laid length is laid faster than this on the control", "一半铺放长度的实际速度高于此值"),
        "mm/s",
        1,
        lambda e: _median_speed(e) / MM,
        absent=NONE,
    ),
    Quantity(
        "max_laying_speed_mm_per_s",
        Words("top laying speed", "最高铺放速度"),
        Words(
            "greatest speed of the nip on the control, which where blocks overlap can exceed the speed that is set",
            "数控系统上压点的最高速度；程序段重叠处可能超过设定速度",
        ),
        "mm/s",
        1,
        lambda e: _largest(e.samples.speeds) / MM,
        absent=NONE,
    ),
    Quantity(
        "speed_share",
        Words("share at set speed", "达速比例"),
        Words(
            "share of the laid length at 95 % of the laying speed or more, on the control",
            "数控系统上速度不低于铺放速度 95 % 的铺放长度所占比例",
        ),
        "",
        3,
        speed_share,
        Group.ERROR,
        optional=True,
    ),
    Quantity(
        "planned_speed_share",
        Words("share at planned speed", "达计划速度比例"),
        Words(
            "the same of 95 % of `planned_laying_speed_mm_per_s`",
            "同上，以 `planned_laying_speed_mm_per_s` 的 95 % 计",
        ),
        "",
        3,
        lambda e: _share(e, _least(_asked_speeds(e)[2])),
        Group.ERROR,
        absent=NONE,
    ),
    Listing("time_law", lambda e: e.time_law),
    Listing("slowest_planned", lambda e: _slowest(e, *_asked_speeds(e))),
    Listing("slowest_laying", lambda e: _slowest(e, *_lay_speeds(e))),
    Listing("stops", _stops),
    Listing("time_shares", lambda e: time_shares(e.tape), required=True),
    Listing("program_sha256", lambda e: e.program_sha256),
    Listing("tape", lambda e: listed_courses(e.tape), required=True),
)
