"""Tape ledger: the use of the tape, course by course and cut by cut, as plain values for JSON."""

from __future__ import annotations

import math
from typing import Any

from tapelayer.laying.evidence import CutMade, TapeLedger
from tapelayer.units import DEG, MM, json_number


def _percent(part: float, whole: float) -> float:
    """Return a part in percent of the whole; NaN of an empty whole."""
    return 100 * part / whole if whole else math.nan


def time_shares(tape: TapeLedger) -> dict[str, float | None]:
    """Return the percentages of the program's time for laying, threading and linking."""
    spans = {"laying": tape.laying, "threading": tape.threading, "linking": tape.linking}
    whole = sum(spans.values())
    return {name: json_number(_percent(span, whole)) for name, span in spans.items()}


def listed_courses(tape: TapeLedger) -> list[dict[str, Any]]:
    """Return the tape's ledger by course, in mm and degrees."""
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
