"""Coat: what a program leaves on the part, from the places and times that were measured with the arc on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Frozen, Mask
from tapelayer.spraying.deposition import (
    Evenness,
    Spots,
    Surface,
    evenness,
    exposure,
    inside_of,
    spots_along,
    surface_from_above,
)
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.footprint import footprint_of
from tapelayer.spraying.reach import Reach
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM

# Samples of the surface in a spot's diameter, and spots in the footprint's reach.
_SURFACE_SAMPLES = 8
_SPOTS = 10


@dataclass(frozen=True, eq=False)
class Coat(Frozen):
    """What is on the surface after a program.

    Attributes:
        surface: samples of what can be reached, in `machine`.
        spacing: distance of samples at most, metres.
        thickness: (m,) metres, or relative to their mean.
        relative: whether the thickness is relative, because the setup has no rate.
        evenness: of the thickness.
    """

    surface: Surface
    spacing: float
    thickness: Floats
    relative: bool
    evenness: Evenness


def coat_of(samples: SpraySamples, reach: Reach, setup: SpraySetup) -> Coat:
    """The coat that a program leaves by arc spraying; layers add up.

    Args:
        samples: places and times with the arc on.
        reach: the surface and what of it can be reached.
        setup: the job's values.

    Raises:
        FootprintRefused: the profile's file cannot be used.
    """
    footprint, spot = footprint_of(setup), setup.spray.spot_mm * MM
    spacing = spot / _SURFACE_SAMPLES
    seen, border = surface_from_above(reach.mesh, spacing, setup.spray.min_normal_z)
    held = reach.holds(seen.points, seen.normals)
    surface = seen.only(held)
    inside = inside_of(surface, np.vstack([border, seen.points[~held]]), spot / 2)
    amount = exposure(footprint, setup.standoff, _spots(samples, footprint.reach / _SPOTS), surface)
    rate = setup.footprint.rate_mm3_per_s
    if rate is not None:
        thickness = amount * rate * MM**3
    else:
        mean = float(np.average(amount, weights=surface.areas))
        thickness = amount / mean if mean > 0.0 else amount
    return Coat(surface, spacing, thickness, rate is None, evenness(thickness, surface, inside))


def growth(coat: Coat, samples: SpraySamples, setup: SpraySetup, chosen: Mask, moments: int) -> tuple[Floats, Floats]:
    """Times (k,) in seconds, and the thickness (j, k) then, as `Coat.thickness`, of some samples of the surface.

    The moments lie evenly in the time with the arc on: nothing is there at the first, the whole coat at the last.

    Args:
        coat: what the program leaves.
        samples: places and times with the arc on, as for `coat_of`.
        setup: the job's values.
        chosen: (m,) the j samples of the coat's surface to be looked at.
        moments: k, 2 or more.
    """
    footprint, surface = footprint_of(setup), coat.surface.only(chosen)
    spots = _spots(samples, footprint.reach / _SPOTS)
    spent = np.cumsum(spots.seconds)
    borders = np.searchsorted(spent, spent[-1] * np.arange(1, moments - 1) / (moments - 1))
    amounts = np.zeros((len(surface.points), moments))
    for moment, rows in enumerate(np.split(np.arange(len(spent)), borders), 1):
        stretch = Spots(spots.points[rows], spots.axes[rows], spots.seconds[rows])
        amounts[:, moment] = amounts[:, moment - 1] + exposure(footprint, setup.standoff, stretch, surface)
    final = coat.thickness[chosen]
    total = float(np.sum(amounts[:, -1]))
    thickness = amounts * (float(np.sum(final)) / total if total > 0.0 else 0.0)
    # Sums in another order differ in their last digits.
    thickness[:, -1] = final

    steps = np.where(np.diff(samples.pieces) == 0, np.diff(samples.times), 0.0)
    arc_times = np.concatenate([[0.0], np.cumsum(steps)])
    reached = np.concatenate([[0.0], np.append(0.0, spent)[borders], spent[-1:]])
    return np.interp(reached, arc_times, samples.times), thickness


def _spots(samples: SpraySamples, spacing: float) -> Spots:
    """Spots of the samples, of which those are left out that are nearer to each other than the spacing asks."""
    cell = np.floor(samples.arc_lengths / spacing)
    kept = np.ones(len(cell), dtype=np.bool_)
    kept[1:-1] = (
        (cell[1:-1] != cell[:-2])
        | (samples.pieces[1:-1] != samples.pieces[:-2])
        | (samples.pieces[1:-1] != samples.pieces[2:])
    )
    return spots_along(samples.points[kept], samples.axes[kept], samples.times[kept], samples.pieces[kept], spacing)
