"""Quantities of the report: what they are called, how they are written, and which have a limit."""

from __future__ import annotations

from tapelayer.laying.settings import Setup

# Quantities of the report in the order of the page: key, words, unit, format.
QUANTITIES = (
    ("max_position_error_mm", "position error", "mm", "z.4f"),
    ("max_chord_error_mm", "chord error", "mm", "z.4f"),
    ("max_tape_error_mm", "tape error", "mm", "z.4f"),
    ("max_roller_tilt_deg", "roller tilt", "deg", "z.4f"),
    ("max_edge_lift_mm", "edge lift", "mm", "z.4f"),
    ("max_heading_error_deg", "heading error", "deg", "z.4f"),
    ("max_pitch_deg", "pitch on the roller", "deg", "z.3f"),
    ("max_wrap_mm", "wrap in a course", "mm", "z.3f"),
    ("max_roller_offset_mm", "roller offset", "mm", "z.4f"),
    ("max_cut_error_mm", "cut error", "mm", "z.4f"),
    ("max_blade_error_deg", "blade error", "deg", "z.4f"),
    ("taken_back_mm", "tape taken back", "mm", "z.3f"),
    ("least_link_clearance_mm", "link clearance", "mm", "z.2f"),
    ("max_forward_disagreement_m", "forward disagreement", "m", ".1e"),
)
FACTS = (
    ("courses", "courses", "", ",d"),
    ("points", "points", "", ",d"),
    ("blocks", "blocks", "", ",d"),
    ("laid_length_m", "laid length", "m", "z,.3f"),
    ("duration_s", "duration", "s", "z,.1f"),
    ("tape_used_mm", "tape used", "mm", "z,.1f"),
    ("waste_mm", "waste", "mm", "z,.1f"),
    ("waste_percent", "waste share", "%", "z.2f"),
    ("cuts", "cuts", "", ",d"),
    ("knife_conflicts", "knife conflicts", "", ",d"),
    ("laying_stops", "stops while laying", "", ",d"),
)
# What has no limit of its own is not drawn beside one.
LIMITED = (
    "max_position_error_mm",
    "max_tape_error_mm",
    "max_roller_tilt_deg",
    "max_heading_error_deg",
    "max_cut_error_mm",
    "max_blade_error_deg",
)


def absent(key: str) -> str:
    """Why a quantity may have no value."""
    return "no link" if key == "least_link_clearance_mm" else "not measured"


def limits_of(setup: Setup) -> dict[str, tuple[float, bool]]:
    """Limit of each limited quantity, and whether it is judged: the published form's pose only where the setup says."""
    limits = setup.verification
    published = setup.process.kinematics == "published"
    free = {"max_roller_tilt_deg", "max_heading_error_deg"} - limits.model_fields_set if published else set()
    return {key: (getattr(limits, key), key not in free) for key in LIMITED}
