"""Units: millimetres, degrees and the units that a file may be in, in metres and radians."""

from __future__ import annotations

import math
from typing import Literal

MM = 1e-3
DEG = math.pi / 180.0

Unit = Literal["mm", "cm", "m", "in"]
METRES: dict[Unit, float] = {"mm": MM, "cm": 1e-2, "m": 1.0, "in": 25.4 * MM}


def json_number(value: float) -> float | None:
    """Return the value for JSON; None for NaN and infinity, which JSON lacks.

    Examples:
        >>> json_number(-0.0), json_number(25.4 * MM), json_number(math.nan)
        (0.0, 0.0254, None)
    """
    # Adding 0 turns -0.0 into 0.0.
    return float(value) + 0.0 if math.isfinite(value) else None
