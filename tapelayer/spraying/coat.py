"""Coat: the thickness that a program leaves on the part, computed from the samples measured with the arc on."""

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

# Surface samples per spot diameter, and spots per radius of the footprint.
_SURFACE_SAMPLES = 8
_SPOTS = 10


@dataclass(frozen=True, eq=False)
class Coat(Frozen):
    """The coating on the surface after a program.

    Attributes:
        surface: samples of the surface that can be reached, in `machine`.
        spacing: largest distance between samples, metres.
        thickness: (m,) metres, or relative to the mean.
        relative: whether the thickness is relative, because the setup gives no rate.
        evenness: how even the thickness is.
    """

    surface: Surface
    spacing: float
    thickness: Floats
    relative: bool
    evenness: Evenness


def coat_of(samples: SpraySamples, reach: Reach, setup: SpraySetup) -> Coat:
    """Return the coat that an arc spraying program leaves; layers add up.

    Args:
        samples: measured with the arc on.
        reach: the surface and the part of it that can be reached.
        setup: the job's values.

    Raises:
        FootprintRefused: the profile's file cannot be used.
    """
    footprint, spot = footprint_of(setup), setup.spray.spot_mm * MM
    spacing = spot / _SURFACE_SAMPLES
    seen, border = surface_from_above(reach.mesh, spacing, setup.spray.min_normal_z)
    reached = reach.holds(seen.points, seen.normals)
    surface = seen.only(reached)
    inside = inside_of(surface, np.vstack([border, seen.points[~reached]]), spot / 2)
    amount = exposure(footprint, setup.standoff, _spots(samples, footprint.reach / _SPOTS), surface)
    rate = setup.footprint.rate_mm3_per_s
    if rate is not None:
        thickness = amount * rate * MM**3
    else:
        mean = float(np.average(amount, weights=surface.areas))
        thickness = amount / mean if mean > 0.0 else amount
    return Coat(
        surface, spacing, thickness, rate is None, evenness(thickness, surface, inside, float(np.sum(seen.areas)))
    )


def growth(coat: Coat, samples: SpraySamples, setup: SpraySetup, chosen: Mask, moments: int) -> tuple[Floats, Floats]:
    """Return times (k,) in seconds and the thickness (j, k), as `Coat.thickness`, then, of some surface samples.

    The moments divide the time with the arc on evenly: no coat at the first, the whole coat at the last.

    Args:
        coat: what the program leaves.
        samples: measured with the arc on, as for `coat_of`.
        setup: the job's values.
        chosen: (m,) True for the j samples of the coat's surface to follow.
        moments: k, 2 or more.
    """
    footprint, surface = footprint_of(setup), coat.surface.only(chosen)
    spots = _spots(samples, footprint.reach / _SPOTS)
    spent = np.cumsum(spots.seconds)
    borders = np.searchsorted(spent, spent[-1] * np.arange(1, moments - 1) / (moments - 1))
    amounts = np.zeros((len(surface.points), moments))
    for moment, rows in enumerate(np.split(np.arange(len(spent)), borders), 1):
        interval = Spots(spots.points[rows], spots.axes[rows], spots.seconds[rows])
        amounts[:, moment] = amounts[:, moment - 1] + exposure(footprint, setup.standoff, interval, surface)
    final = coat.thickness[chosen]
    total = float(np.sum(amounts[:, -1]))
    thickness = amounts * (float(np.sum(final)) / total if total > 0.0 else 0.0)
    # Summing in another order changes the last digits.
    thickness[:, -1] = final

    steps = np.where(np.diff(samples.pieces) == 0, np.diff(samples.times), 0.0)
    arc_times = np.concatenate([[0.0], np.cumsum(steps)])
    reached = np.concatenate([[0.0], np.append(0.0, spent)[borders], spent[-1:]])
    return np.interp(reached, arc_times, samples.times), thickness


def _spots(samples: SpraySamples, spacing: float) -> Spots:
    """Return the spots along the samples, with samples left out where they lie closer together than the spacing."""
    cell = np.floor(samples.arc_lengths / spacing)
    kept = np.ones(len(cell), dtype=np.bool_)
    kept[1:-1] = (
        (cell[1:-1] != cell[:-2])
        | (samples.pieces[1:-1] != samples.pieces[:-2])
        | (samples.pieces[1:-1] != samples.pieces[2:])
    )
    return spots_along(samples.points[kept], samples.axes[kept], samples.times[kept], samples.pieces[kept], spacing)
