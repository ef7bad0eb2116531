"""Limits: what a ply file allows, by quantity."""

from __future__ import annotations

from tapelayer.plies.ply import Ply
from tapelayer.units import MM
from tapelayer.verification.limits import Limit, Limits

# A course, and the spline that a program lays through its points, are right within this, metres.
ACCURACY = 0.01 * MM
# Gaps and overlaps are computed within this, metres.
GAP_ACCURACY = 0.001 * MM


def limits_of(ply: Ply) -> Limits:
    """Return the limit of each limited quantity of a ply, in the quantity's unit.

    Examples:
        >>> ply = Ply.model_validate({"mould": {"file": "hood.stl"}, "ply": {"angle_deg": 45}})
        >>> limits_of(ply)["max_gap_mm"].value, limits_of(ply)["off_mould_mm"].value
        (2.0, 37.5)
    """
    limits = ply.limits
    return {
        "max_gap_mm": Limit(ply.max_gap / MM),
        "max_overlap_mm": Limit(ply.max_overlap / MM),
        "max_strain_percent": Limit(limits.max_strain_percent),
        "max_lift_mm": Limit(limits.max_lift_mm),
        "max_angle_deviation_deg": Limit(limits.max_angle_deviation_deg),
        "least_cut_angle_deg": Limit(ply.courses.minimum_cut_angle_deg, least=True),
        "shortest_course_mm": Limit(ply.courses.minimum_length_mm, least=True),
        "off_mould_mm": Limit(ply.max_off_mould / MM),
        "surface_residual_mm": Limit(limits.max_surface_residual_mm),
        "surface_ambiguity_mm": Limit(limits.max_surface_ambiguity_mm),
        "path_error_mm": Limit(ACCURACY / MM),
        "spacing_error_mm": Limit(ACCURACY / MM),
    }
