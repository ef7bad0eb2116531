"""Report on a spraying program: the evidence as numbers (JSON) and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from tapelayer.arrays import Floats
from tapelayer.geometry.mending import Mending
from tapelayer.geometry.mesh import Mesh
from tapelayer.provenance import VERSION
from tapelayer.reporting.words import plain, shown
from tapelayer.spraying.coat import Coat
from tapelayer.spraying.evidence import SprayEvidence
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.program import Slowdown
from tapelayer.units import DEG, MM, json_number

# Areas below this are rounding, square metres.
LEAST_AREA = 1e-9

# Quantities of the report in the order of the page: key, words, unit, format.
FACTS = (
    ("passes", "passes", "", ",d"),
    ("layers", "layers", "", ",d"),
    ("points", "points", "", ",d"),
    ("blocks", "blocks", "", ",d"),
    ("pitch_mm", "pitch", "mm", "z.3f"),
    ("sprayed_area_m2", "sprayed area", "m2", "z.4f"),
    ("duration_s", "duration", "s", "z,.1f"),
    ("arc_time_s", "arc on", "s", "z,.1f"),
)
COATED = (
    ("coverage_percent", "coverage", "%", "z.2f"),
    ("cv_percent", "thickness deviation", "%", "z.2f"),
    ("cv_interior_percent", "without the border", "%", "z.2f"),
)
QUANTITIES = (
    ("max_position_error_mm", "position error", "mm", "z.4f"),
    ("max_surface_distance_mm", "distance from the facets", "mm", "z.4f"),
    ("max_deviation_deg", "deviation of the gun", "deg", "z.3f"),
    ("crease_length_mm", "length beside creases", "mm", "z,.1f"),
    ("max_crease_deviation_deg", "deviation beside creases", "deg", "z.3f"),
    ("max_arc_distance_mm", "arc beside the part", "mm", "z.2f"),
    ("max_forward_disagreement_m", "forward disagreement", "m", ".1e"),
)


@dataclass(frozen=True, eq=False)
class Judged:
    """A program that was judged, with what it was planned for.

    Attributes:
        evidence: what verification measured.
        plan: the passes and areas.
        coat: what the program leaves on the part; None where there is no footprint, as in plating.
        mesh: the surface in `machine`.
        slowdowns: where axes hold the gun back.
        pitch: from pass to pass, metres.
        standoff: nozzle to surface, metres.
        program_sha256: SHA-256 of the program's bytes, hexadecimal.
    """

    evidence: SprayEvidence
    plan: Plan
    coat: Coat | None
    mesh: Mesh
    slowdowns: Sequence[Slowdown]
    pitch: float
    standoff: float
    program_sha256: str


def numbers(judged: Judged) -> dict[str, Any]:
    """The report as plain values for JSON; docs/spray.md describes every key.

    What was not measured is None.
    """
    evidence, plan, samples = judged.evidence, judged.plan, judged.evidence.samples
    measured = {
        "max_deviation_deg": _largest(samples.deviations[~samples.exempt]) / DEG,
        "crease_length_mm": evidence.crease_length / MM,
        "max_crease_deviation_deg": _largest(samples.deviations[samples.exempt]) / DEG,
        "max_position_error_mm": _largest(samples.position_errors) / MM,
        "max_surface_distance_mm": _largest(samples.surface_distances) / MM,
        "max_arc_distance_mm": evidence.greatest_arc_distance / MM,
        "max_forward_disagreement_m": evidence.forward_disagreement,
    }
    areas = (("facing", plan.facing), ("hidden", plan.hidden), ("travel", plan.travel))
    return {
        "version": VERSION,
        "passes": evidence.passes,
        "points": evidence.points,
        "layers": evidence.layers,
        "blocks": evidence.blocks,
        "pitch_mm": judged.pitch / MM,
        "standoff_mm": judged.standoff / MM,
        "splits": [
            {"pass": split.number, **_place(split.point), "reason": split.reason or None} for split in evidence.splits
        ],
        "slowdowns": [
            {"pass": slow.number, **_place(slow.point), "axis": slow.axis, "speed_mm_per_s": slow.speed / MM}
            for slow in judged.slowdowns
        ],
        "sprayed_area_m2": plan.sprayed,
        "unreachable": [{"reason": reason, "area_m2": area} for reason, area in areas if area > LEAST_AREA],
        "mesh": {"facets": len(judged.mesh.facets), "mended": _mended(judged.mesh.mending)},
        **{key: json_number(value) for key, value in measured.items()},
        **_coated(judged.coat),
        "duration_s": json_number(evidence.duration),
        "arc_time_s": json_number(evidence.arc_time),
        "program_sha256": judged.program_sha256,
        "axes": {axis.name: axis.values() for axis in evidence.axes},
        "passed": evidence.passed,
        "failures": [failure.values() for failure in evidence.failures],
    }


def summary(report: dict[str, Any]) -> Table:
    """Table for a terminal of what `numbers` gives."""
    title = Text("passed", "bold green") if report["passed"] else Text("FAILED", "bold red")
    table = Table(title=Text("Verification: ").append_text(title), title_justify="left", title_style="")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("limit", justify="right")
    for key, words, unit, form in FACTS:
        table.add_row(words, shown(report[key], unit, form))
    for area in report["unreachable"]:
        table.add_row(f"out of reach: {area['reason']}", f"{area['area_m2']:.4f} m2")
    table.add_row("splits", str(len(report["splits"])))
    mended = {words: count for words, count in report["mesh"]["mended"].items() if count}
    for words, count in mended.items():
        table.add_row(words.replace("_", " "), f"{count:,}")
    table.add_section()
    for key, words, unit, form in (*COATED, *QUANTITIES):
        table.add_row(words, shown(report[key], unit, form, "none"))
    table.add_section()
    for name, axis in report["axes"].items():
        table.add_row(
            f"axis {name}, {axis['unit']}",
            f"{shown(axis['min'], '', 'z.2f')} to {shown(axis['max'], '', 'z.2f')}",
            f"{plain(axis['lower'])} to {plain(axis['upper'])}",
        )
    if report["failures"]:
        table.add_section()
        table.add_row("failures", Text(f"{len(report['failures']):,}", "bold red"), "0")
    return table


def _largest(values: Floats) -> float:
    """Largest of the values (n,) that were measured; NaN where none was."""
    measured = values[~np.isnan(values)]
    return float(np.max(measured)) if len(measured) else math.nan


def _coated(coat: Coat | None) -> dict[str, Any]:
    """How even and how thick the coat is; relative thickness in keys that end in _rel."""
    if coat is None:
        return {"coverage_percent": None, "cv_percent": None, "cv_interior_percent": None, "thickness": None}
    even = coat.evenness
    scale, unit = (1.0, "rel") if coat.relative else (1e6, "um")
    thickness = {
        "mean": even.mean,
        "interior_mean": even.interior_mean,
        "least": float(np.min(coat.thickness)),
        "greatest": float(np.max(coat.thickness)),
    }
    return {
        "coverage_percent": json_number(even.coverage_percent),
        "cv_percent": json_number(even.cv_percent),
        "cv_interior_percent": json_number(even.cv_interior_percent),
        "thickness": {f"{name}_{unit}": json_number(value * scale) for name, value in thickness.items()},
    }


def _place(point: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}_mm": value / MM for name, value in zip("xyz", point, strict=True)}


def _mended(mending: Mending) -> dict[str, int]:
    """Counts of what was mended; what was only found is among them, so that nobody misses it."""
    return {name: count for name, count in asdict(mending).items() if name != "facets_read"}
