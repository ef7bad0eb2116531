"""Units: the metres and radians of one millimetre and one degree."""

from __future__ import annotations

import math

MM = 1e-3
DEG = math.pi / 180.0


def json_number(value: float) -> float | None:
    """The value for JSON, which has no NaN and no infinity.

    Examples:
        >>> json_number(-0.0), json_number(25.4 * MM), json_number(math.nan)
        (0.0, 0.0254, None)
    """
    # Adding 0 takes the sign off a zero.
    return float(value) + 0.0 if math.isfinite(value) else None
