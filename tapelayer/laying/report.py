"""Report: the evidence as numbers (JSON) and as a table."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from tapelayer.arrays import Floats, Ints
from tapelayer.laying.evidence import CutMade, Evidence, TapeLedger
from tapelayer.laying.quantities import FACTS, QUANTITIES, absent
from tapelayer.provenance import VERSION
from tapelayer.reporting.words import plain, shown
from tapelayer.units import DEG, MM, json_number
from tapelayer.verification.axis_use import AxisUse

# Failures in which a knife is where it must not be, or is not where it must be.
KNIFE_FAILURE = re.compile(
    r"knife_[12]_(switched_again|left_on|off_every_cut_mm)|(rapid|stop)_with_knife_[12]_on"
    r"|cuts_made|cut_width_mm|axis_[vq]_mm"
)


def numbers(evidence: Evidence, program_sha256: str) -> dict[str, Any]:
    """The report as plain values for JSON, millimetres and degrees; docs/report.md describes every key.

    What was not measured (no samples, or a value that is no finite number) is None, and the report is not passed.

    Args:
        evidence: what verification measured.
        program_sha256: SHA-256 of the program's bytes, hexadecimal.
    """
    samples, tape = evidence.samples, evidence.tape
    positions = samples.position_errors
    tilt = _largest(samples.tilts)
    measured = {
        "laid_length_m": evidence.laid_length,
        "duration_s": evidence.duration,
        "tape_used_mm": tape.used / MM,
        "waste_mm": tape.waste / MM,
        "waste_percent": _percent(tape.waste, tape.used),
        "max_position_error_mm": _largest(positions) / MM,
        "max_chord_error_mm": _largest(positions[~samples.block_ends]) / MM,
        "max_roller_tilt_deg": tilt / DEG,
        "max_edge_lift_mm": evidence.tape_width / 2 * math.sin(tilt) / MM,
        "max_heading_error_deg": _largest(samples.heading_errors) / DEG,
        "max_pitch_deg": _largest(samples.pitches) / DEG,
        "max_wrap_mm": evidence.roller_radius * _largest_spread(samples.wraps, samples.courses) / MM,
        "max_roller_offset_mm": _largest(samples.offsets) / MM,
        "max_tape_error_mm": _largest(samples.tape_errors) / MM,
        "max_cut_error_mm": _largest(np.array([cut.error for cut in tape.cuts])) / MM,
        "max_blade_error_deg": _largest(np.array([cut.blade_error for cut in tape.cuts])) / DEG,
        "taken_back_mm": evidence.tape_taken_back / MM,
        "least_link_clearance_mm": evidence.least_link_clearance / MM,
        "max_forward_disagreement_m": evidence.forward_disagreement,
    }
    failures = [failure.values() for failure in evidence.failures]
    told = {failure.what for failure in evidence.failures}
    # A failure's name has no "max" or "least": a value that verification refused already is not refused twice.
    lost = [
        key.removeprefix("max_").removeprefix("least_")
        for key, value in measured.items()
        if not math.isfinite(value) and not _no_link(key, value)
    ]
    lost += [what for axis in evidence.axes for what in _unmeasured(axis)]
    shares, courses = _time_shares(tape), _tape(tape)
    lost += ["time_shares"] if None in shares.values() else []
    lost += ["tape"] if any(None in entry.values() for row in courses for entry in (row, *row["cuts"])) else []
    failures += [
        {"course": 0, "point": 0, "what": what, "value": None, "limit": None} for what in lost if what not in told
    ]
    return {
        "version": VERSION,
        "courses": evidence.courses,
        "points": evidence.points,
        "blocks": evidence.blocks,
        "cuts": len(tape.cuts),
        "knife_conflicts": sum(KNIFE_FAILURE.fullmatch(str(failure["what"])) is not None for failure in failures),
        "laying_stops": sum(row.laying_stops for row in tape.rows),
        **{key: json_number(value) for key, value in measured.items()},
        "time_shares": shares,
        "program_sha256": program_sha256,
        "tape": courses,
        "axes": {axis.name: axis.values() for axis in evidence.axes},
        "passed": not failures,
        "failures": failures,
    }


def summary(report: dict[str, Any]) -> Table:
    """Table for a terminal of what `numbers` gives."""
    title = Text("passed", "bold green") if report["passed"] else Text("FAILED", "bold red")
    table = Table(title=Text("Verification: ").append_text(title), title_justify="left", title_style="")
    table.add_column("quantity")
    for heading in ("value", "limit", "top speed /s"):
        table.add_column(heading, justify="right")
    for key, words, unit, form in FACTS:
        table.add_row(words, shown(report[key], unit, form))
    table.add_section()
    for key, words, unit, form in QUANTITIES:
        table.add_row(words, shown(report[key], unit, form, absent(key)))
    table.add_section()
    for name, axis in report["axes"].items():
        table.add_row(
            Text(f"axis {name}, {axis['unit']}"),
            f"{shown(axis['min'], '', 'z.2f')} to {shown(axis['max'], '', 'z.2f')}",
            f"{plain(axis['lower'])} to {plain(axis['upper'])}",
            f"{shown(axis['max_speed'], '', 'z.1f')} of {plain(axis['speed_limit'])}",
        )
    if report["failures"]:
        table.add_section()
        table.add_row("failures", Text(f"{len(report['failures']):,}", "bold red"), "0")
    return table


def _largest(values: Floats) -> float:
    """Largest magnitude; NaN where there is no value or one of them is not finite."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest if len(values) and math.isfinite(largest) else math.nan


def _largest_spread(values: Floats, courses: Ints) -> float:
    """Largest difference of two values (n,) within one course; NaN where there is none or one is NaN."""
    if not len(values):
        return math.nan
    starts = np.unique(courses, return_index=True)[1]
    return float(np.max(np.maximum.reduceat(values, starts) - np.minimum.reduceat(values, starts)))


def _no_link(key: str, value: float) -> bool:
    """Whether the head never goes from course to course, so that there is no clearance to measure."""
    return key == "least_link_clearance_mm" and value == math.inf


def _percent(part: float, whole: float) -> float:
    """A part in percent of the whole; NaN of nothing."""
    return 100 * part / whole if whole else math.nan


def _time_shares(tape: TapeLedger) -> dict[str, float | None]:
    """Percent of the program's time by what the head does."""
    spans = {"laying": tape.laying, "threading": tape.threading, "linking": tape.linking}
    whole = sum(spans.values())
    return {name: json_number(_percent(span, whole)) for name, span in spans.items()}


def _tape(tape: TapeLedger) -> list[dict[str, Any]]:
    """The tape's ledger by course."""
    starts = {cut.starting: cut for cut in tape.cuts}
    ends = {cut.ending: cut for cut in tape.cuts}
    courses = []
    before = 0.0
    for row in tape.rows:
        made = [("start", starts.get(row.course)), ("end", ends.get(row.course))]
        courses.append(
            {
                "course": row.course,
                "laid_mm": json_number(row.length / MM),
                "station_mm": json_number(row.station / MM),
                "waste_mm": json_number((row.station - before) / MM),
                "waste_roll_mm": json_number(row.waste_roll / MM),
                "waste_formula_mm": json_number(row.waste_formula / MM),
                "waste_knives_mm": json_number(row.waste_knives / MM),
                "laying_stops": row.laying_stops,
                "cuts": [_cut(end, cut) for end, cut in made if cut],
            }
        )
        before = row.station + row.length
    return courses


def _cut(end: str, cut: CutMade) -> dict[str, Any]:
    return {
        "end": end,
        "station_mm": json_number(cut.station / MM),
        "angle_deg": json_number(cut.angle / DEG),
        "knife": cut.knife,
        "block": cut.block,
        **({"line": cut.line} if cut.line else {}),
        "shared": bool(cut.ending and cut.starting),
        "error_mm": json_number(cut.error / MM),
        "blade_error_deg": json_number(cut.blade_error / DEG),
    }


def _unmeasured(axis: AxisUse) -> list[str]:
    travel, speed = axis.failures
    found = [] if math.isfinite(axis.least) and math.isfinite(axis.greatest) else [travel]
    return found + ([] if math.isfinite(axis.top_speed) else [speed])
