"""Quantities: the rows of a spraying report, in the order of its JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.reporting.quantity import Group, Listing, Quantity, Row, Style, beyond_limits, count
from tapelayer.reporting.words import NONE, Words
from tapelayer.spraying.coat import Coat
from tapelayer.spraying.evidence import SprayEvidence, SpraySamples
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.program import Slowdown
from tapelayer.units import DEG, MM, json_number

# A gun with this share of its set speed is at speed.
AT_SPEED = 0.95
# Areas below this, in square metres, are rounding.
LEAST_AREA = 1e-9


@dataclass(frozen=True, eq=False)
class Judged:
    """A judged program, with the plan that it was made from.

    Attributes:
        evidence: the measurements of verification.
        plan: the passes and areas.
        coat: the coat that the program leaves on the part; None if there is no footprint, as in plating.
        mesh: the surface in `machine`.
        slowdowns: where axes slow the gun down.
        pitch: distance from pass to pass, metres.
        standoff: nozzle to surface, metres.
        speed: that the setup asks of the gun, m/s.
    """

    evidence: SprayEvidence
    plan: Plan
    coat: Coat | None
    mesh: Mesh
    slowdowns: Sequence[Slowdown]
    pitch: float
    standoff: float
    speed: float

    @property
    def samples(self) -> SpraySamples:
        """Return the measurements with the arc on."""
        return self.evidence.samples


def _largest(values: Floats) -> float:
    """Return the largest of the values (n,) that are not NaN; NaN if there is none."""
    measured = values[~np.isnan(values)]
    return float(np.max(measured)) if len(measured) else math.nan


def _steps(judged: Judged, times: Floats) -> tuple[Floats, Floats]:
    """Return the lengths (m,) in metres from sample to sample with the arc on, and the speeds (m,) by times (n,)."""
    samples = judged.samples
    lengths, spans = np.linalg.norm(np.diff(samples.points, axis=0), axis=1), np.diff(times)
    within = (np.diff(samples.pieces) == 0) & (spans > 0.0) & (lengths > 0.0)
    return lengths[within], lengths[within] / spans[within]


def _speed_share(judged: Judged) -> float:
    """Return the share of the sprayed length at set speed; NaN if nothing was sprayed."""
    lengths, speeds = _steps(judged, judged.samples.times)
    whole = float(np.sum(lengths))
    return float(np.sum(lengths[speeds >= AT_SPEED * judged.speed])) / whole if whole != 0.0 else math.nan


def _mean_speed(judged: Judged) -> float:
    """Return the mean speed of the gun with the arc on, mm/s; NaN if nothing was sprayed."""
    lengths, speeds = _steps(judged, judged.samples.times)
    return float(np.sum(lengths) / np.sum(lengths / speeds)) / MM if len(lengths) else math.nan


def _planned_speed(judged: Judged) -> float:
    """Return the least speed that words ask of the gun with the arc on, mm/s; NaN if nothing was sprayed."""
    _, speeds = _steps(judged, judged.samples.asked)
    return float(np.min(speeds)) / MM if len(speeds) else math.nan


def limited(judged: Judged) -> SprayEvidence:
    """Return the evidence with a failure for each limit that only the finished coat can be held against."""
    evidence = judged.evidence
    return replace(evidence, failures=(*evidence.failures, *beyond_limits(ROWS, judged, evidence)))


def _splits(judged: Judged) -> list[dict[str, Any]]:
    return [
        {"pass": split.number, **_place(split.point), "reason": split.reason or None}
        for split in judged.evidence.splits
    ]


def _slowdowns(judged: Judged) -> list[dict[str, Any]]:
    return [
        {"pass": slow.number, **_place(slow.point), "axis": slow.axis, "speed_mm_per_s": slow.speed / MM}
        for slow in judged.slowdowns
    ]


def _unreachable(judged: Judged) -> list[dict[str, Any]]:
    """Return the areas that are not sprayed, by reason; `facing` is the area too steep for a gun from above."""
    plan = judged.plan
    areas = (("facing", plan.too_steep), ("hidden", plan.hidden), ("travel", plan.beyond_travel))
    return [{"reason": reason, "area_m2": area} for reason, area in areas if area > LEAST_AREA]


def _mesh(judged: Judged) -> dict[str, Any]:
    """Return the number of facets, and counts of the faults that were mended or only noticed."""
    mended = {name: count for name, count in asdict(judged.mesh.mending).items() if name != "facets_read"}
    return {"facets": len(judged.mesh.facets), "mended": mended}


def _thickness(judged: Judged) -> dict[str, Any] | None:
    """Return statistics of the coat's thickness; keys that end in _rel are relative to the mean."""
    coat = judged.coat
    if coat is None:
        return None
    even = coat.evenness
    scale, unit = (1.0, "rel") if coat.relative else (1e6, "um")
    thickness = {
        "mean": even.mean,
        "interior_mean": even.interior_mean,
        "least": float(np.min(coat.thickness)),
        "greatest": float(np.max(coat.thickness)),
    }
    return {f"{name}_{unit}": json_number(value * scale) for name, value in thickness.items()}


def _place(point: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}_mm": value / MM for name, value in zip("xyz", point, strict=True)}


ROWS: tuple[Row[Judged], ...] = (
    count(
        "passes",
        Words("passes", "喷涂道次数"),
        Words("passes that the part asks for", "工件所需的喷涂道次"),
        lambda j: j.evidence.passes,
    ),
    count(
        "points",
        Words("points", "点数"),
        Words("points of the passes", "各喷涂道次的点数"),
        lambda j: j.evidence.points,
    ),
    count(
        "layers",
        Words("layers", "层数"),
        Words("how often the part is sprayed over", "工件被喷涂的遍数"),
        lambda j: j.evidence.layers,
    ),
    count(
        "blocks",
        Words("blocks", "程序段"),
        Words("blocks in the program: motions, dwells and switching words", "程序中的程序段：运动、暂停和开关指令"),
        lambda j: j.evidence.blocks,
        headline=True,
    ),
    Quantity(
        "pitch_mm",
        Words("pitch", "道距"),
        Words("from pass to pass", "道与道的间距"),
        "mm",
        3,
        lambda j: j.pitch / MM,
        Group.FACT,
    ),
    Quantity(
        "standoff_mm",
        Words("standoff", "喷距"),
        Words("nozzle to surface, 0 in plating", "喷嘴到表面的距离，电刷镀为 0"),
        "mm",
        1,
        lambda j: j.standoff / MM,
        Group.FACT,
    ),
    Listing("splits", _splits),
    Listing("slowdowns", _slowdowns),
    Quantity(
        "sprayed_area_m2",
        Words("sprayed area", "喷涂面积"),
        Words("surface that the passes go over", "喷涂道次经过的表面积"),
        "m2",
        4,
        lambda j: j.plan.sprayed,
        Group.FACT,
    ),
    Listing("unreachable", _unreachable),
    Listing("mesh", _mesh),
    Quantity(
        "max_deviation_deg",
        Words("deviation of the gun", "喷枪偏角"),
        Words("gun off the facets' normals, but near creases", "喷枪偏离三角面法向的角度，折痕旁除外"),
        "deg",
        3,
        lambda j: _largest(j.samples.deviations[~j.samples.exempt]) / DEG,
        headline=True,
        absent=NONE,
    ),
    Quantity(
        "crease_length_mm",
        Words("length beside creases", "折痕旁长度"),
        Words("length of the stretches near creases, where no deviation counts", "折痕旁不计偏角的路径长度"),
        "mm",
        1,
        lambda j: j.evidence.crease_length / MM,
        absent=NONE,
    ),
    Quantity(
        "max_crease_deviation_deg",
        Words("deviation beside creases", "折痕旁偏角"),
        Words("gun off the facets' normals in them", "折痕旁喷枪偏离三角面法向的角度"),
        "deg",
        3,
        lambda j: _largest(j.samples.deviations[j.samples.exempt]) / DEG,
        absent=NONE,
        optional=True,
    ),
    Quantity(
        "max_position_error_mm",
        Words("position error", "位置误差"),
        Words("P off the smoothed path", "P 点偏离光顺路径的距离"),
        "mm",
        4,
        lambda j: _largest(j.samples.position_errors) / MM,
        headline=True,
        absent=NONE,
    ),
    Quantity(
        "max_surface_distance_mm",
        Words("distance from the facets", "与三角面距离"),
        Words("P off the facet that it passes", "P 点偏离所经三角面的距离"),
        "mm",
        4,
        lambda j: _largest(j.samples.surface_distances) / MM,
        absent=NONE,
    ),
    Quantity(
        "max_arc_distance_mm",
        Words("arc beside the part", "电弧超出工件"),
        Words("lit arc beside the part, in plan", "俯视方向上点燃的电弧超出工件的距离"),
        "mm",
        2,
        lambda j: j.evidence.greatest_arc_distance / MM,
        absent=NONE,
    ),
    Quantity(
        "max_forward_disagreement_m",
        Words("forward disagreement", "正解偏差"),
        Words("Pinocchio itself against the batch evaluator", "Pinocchio 本身与批量求值器的差"),
        "m",
        1,
        lambda j: j.evidence.forward_disagreement,
        style=Style.POWER,
        absent=NONE,
    ),
    Quantity(
        "coverage_percent",
        Words("coverage", "覆盖率"),
        Words(
            "share of the area seen from above, also beyond reach, with more than half the interior's mean thickness",
            "俯视可见面积（含不可达部分）中厚度超过内部平均一半的比例",
        ),
        "%",
        2,
        lambda j: None if j.coat is None else j.coat.evenness.coverage_percent,
        headline=True,
        absent=NONE,
        optional=True,
    ),
    Quantity(
        "cv_percent",
        Words("thickness deviation", "厚度离散"),
        Words(
            "standard deviation of the thickness over its mean, everything reachable",
            "可达面积内厚度标准差与平均值之比",
        ),
        "%",
        2,
        lambda j: None if j.coat is None else j.coat.evenness.cv_percent,
        absent=NONE,
        optional=True,
    ),
    Quantity(
        "cv_interior_percent",
        Words("without the border", "不含边缘"),
        Words("the same without a border band of one spot radius", "同上，不含一个斑点半径宽的边缘带"),
        "%",
        2,
        lambda j: None if j.coat is None else j.coat.evenness.cv_interior_percent,
        absent=NONE,
    ),
    Listing("thickness", _thickness),
    Quantity(
        "speed_share",
        Words("share at set speed", "达到设定速度的比例"),
        Words(
            "share of the sprayed length over which the gun has 95 % of its set speed or more, on the control",
            "数控系统上喷枪速度不低于设定值 95 % 的喷涂长度所占比例",
        ),
        "",
        4,
        _speed_share,
        absent=NONE,
        optional=True,
    ),
    Quantity(
        "spraying_stops",
        Words("stops with the arc on", "电弧开启时停顿"),
        Words("places where the gun stops with the arc on", "电弧开启时喷枪停住的位置数"),
        "",
        0,
        lambda j: j.evidence.stops,
        Group.FACT,
        Style.COUNT,
        optional=True,
    ),
    Quantity(
        "planned_spraying_speed_mm_per_s",
        Words("planned gun speed", "计划喷枪速度"),
        Words(
            "least speed that the program's words ask of the gun with the arc on, ramps aside",
            "电弧开启时程序指令要求喷枪达到的最低速度，不含加减速",
        ),
        "mm/s",
        1,
        _planned_speed,
        absent=NONE,
    ),
    Quantity(
        "mean_spraying_speed_mm_per_s",
        Words("mean gun speed", "喷枪平均速度"),
        Words(
            "of the gun on its control with the arc on, ramps and stops included", "电弧开启时含加减速与停顿的平均速度"
        ),
        "mm/s",
        1,
        _mean_speed,
        absent=NONE,
    ),
    Listing("time_law", lambda j: j.evidence.time_law),
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
        lambda j: j.evidence.duration,
        Group.FACT,
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
        lambda j: j.evidence.asked,
        Group.FACT,
    ),
    Quantity(
        "arc_time_s",
        Words("arc on", "电弧开启"),
        Words("time with the arc on", "电弧开启的时间"),
        "s",
        1,
        lambda j: j.evidence.arc_time,
        Group.FACT,
    ),
    Listing("program_sha256", lambda j: j.evidence.program_sha256),
)
