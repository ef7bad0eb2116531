"""Units: one millimetre in metres and one degree in radians."""

from __future__ import annotations

import math

MM = 1e-3
DEG = math.pi / 180.0


def json_number(value: float) -> float | None:
    """Return the value for JSON; None for NaN and infinity, which JSON lacks.

    Examples:
        >>> json_number(-0.0), json_number(25.4 * MM), json_number(math.nan)
        (0.0, 0.0254, None)
    """
    # Adding 0 turns -0.0 into 0.0.
    return float(value) + 0.0 if math.isfinite(value) else None
