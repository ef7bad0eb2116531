"""Limits: the largest values that a laying setup allows."""

from __future__ import annotations

from tapelayer.laying.settings import Setup
from tapelayer.verification.limits import Limit, Limits

LIMITED = (
    "max_position_error_mm",
    "max_tape_error_mm",
    "max_roller_tilt_deg",
    "max_heading_error_deg",
    "max_cut_error_mm",
    "max_blade_error_deg",
)
# The published form does not hold the roller's pose exactly: it is judged only if the setup itself sets the limit.
POSE = frozenset({"max_roller_tilt_deg", "max_heading_error_deg"})


def limits_of(setup: Setup) -> Limits:
    """Return the limit of each limited quantity, and whether it is judged.

    Examples:
        >>> published = Setup().with_values("process", kinematics="published")
        >>> limits_of(published)["max_roller_tilt_deg"]
        Limit(value=0.05, judged=False, least=False)
    """
    limits = setup.verification
    free = POSE - limits.model_fields_set if setup.process.kinematics == "published" else frozenset()
    resolved = {key: Limit(getattr(limits, key), key not in free) for key in LIMITED}
    if limits.max_stops_while_laying is not None:
        resolved["laying_stops"] = Limit(limits.max_stops_while_laying)
    if limits.min_speed_share is not None:
        resolved["speed_share"] = Limit(limits.min_speed_share, least=True)
    return resolved
