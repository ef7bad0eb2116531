"""Pitch: the widest distance between passes that still gives an even coat."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import PitchNotFound
from tapelayer.spraying.footprint import Footprint
from tapelayer.units import MM

# Samples in half a period of a raster, and search steps per additional overlapping pass.
_HALF_PERIOD = 240
_OVERLAP_STEPS = 25

# Number of overlapping passes at which the search for a pitch starts.
_MOST_OVERLAP = 32


def raster_cv(footprint: Footprint, pitch: float) -> float:
    """Return standard deviation over mean of the thickness of endless passes a pitch (metres) apart on a plane.

    Examples:
        >>> from tapelayer.spraying.footprint import Gaussian
        >>> [round(raster_cv(Gaussian(sigma=0.01), pitch), 4) for pitch in (0.02, 0.03, 0.04)]
        [0.0102, 0.1578, 0.412]
    """
    return _raster_cv(footprint.across, footprint.reach, pitch)


def widest_pitch(footprint: Footprint, target_cv: float) -> float:
    """Return the widest pitch in metres such that it and every narrower one keep a coefficient of variation on a plane.

    The coefficient of variation is not monotonic in the pitch: a pitch beyond one that misses the target is never
    returned, even if it meets the target again, nor is one beyond twice the reach, where passes do not overlap.

    Args:
        footprint: of the gun.
        target_cv: largest standard deviation over mean, e.g. 0.05.

    Raises:
        PitchNotFound: passes would have to be closer than 1/32 of the footprint's diameter.

    Examples:
        >>> from tapelayer.spraying.footprint import ParabolicPass
        >>> round(widest_pitch(ParabolicPass(radius=0.05), target_cv=0.05), 4)
        0.0334
    """
    reach = footprint.reach
    offsets = np.linspace(0.0, reach, 4097)
    profile = footprint.across(offsets)

    def cv(overlap: float) -> float:
        return _raster_cv(lambda x: np.interp(np.abs(x), offsets, profile, right=0.0), reach, 2 * reach / overlap)

    # The coefficient of variation has one bump for each overlapping pass, so search evenly in the overlap.
    steps = np.arange(_MOST_OVERLAP * _OVERLAP_STEPS, _OVERLAP_STEPS - 1, -1) / _OVERLAP_STEPS
    kept = steps[0]
    if not cv(kept) <= target_cv:
        raise PitchNotFound(
            f"no pitch above {2 * reach / kept / MM:.3g} mm keeps a coefficient of variation of {100 * target_cv:g} % "
            "on a plane; raise target_cv_percent, or set pitch_mm to a number"
        )
    for overlap in steps[1:]:
        if not cv(overlap) <= target_cv:
            lost = overlap
            for _ in range(40):
                middle = 0.5 * (kept + lost)
                kept, lost = (middle, lost) if cv(middle) <= target_cv else (kept, middle)
            break
        kept = overlap
    return float(2 * reach / kept)


def _raster_cv(across: Callable[[Floats], Floats], reach: float, pitch: float) -> float:
    # The thickness is symmetric about each pass: half a period is enough.
    offsets = (np.arange(_HALF_PERIOD) + 0.5) / _HALF_PERIOD * pitch / 2
    passes = math.ceil(reach / pitch) + 1
    thickness = np.sum(across(offsets[:, None] - pitch * np.arange(-passes, passes + 1)), axis=1)
    return float(np.std(thickness) / np.mean(thickness))
