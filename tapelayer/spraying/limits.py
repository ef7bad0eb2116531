"""Limits: the largest values that a spraying setup allows."""

from __future__ import annotations

from tapelayer.spraying.settings import SpraySetup
from tapelayer.verification.limits import Limit, Limits


def limits_of(setup: SpraySetup) -> Limits:
    """Return the limit of each limited quantity.

    Examples:
        >>> limits_of(SpraySetup())["max_deviation_deg"]
        Limit(value=15.0, judged=True, least=False)
    """
    verification, position = setup.verification, setup.verification.max_position_error_mm
    optional = {
        "max_crease_deviation_deg": (verification.max_crease_deviation_deg, False),
        "coverage_percent": (verification.min_coverage_percent, True),
        "cv_percent": (verification.max_thickness_deviation_percent, False),
        "speed_share": (verification.min_speed_share, True),
        "spraying_stops": (verification.max_stops_while_spraying, False),
    }
    return {
        "max_deviation_deg": Limit(setup.spray.max_deviation_deg),
        "max_position_error_mm": Limit(position),
        "max_surface_distance_mm": Limit(setup.spray.chord_tolerance_mm + position),
        **{key: Limit(value, least=least) for key, (value, least) in optional.items() if value is not None},
    }
