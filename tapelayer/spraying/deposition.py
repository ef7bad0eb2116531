"""Deposition: samples of a surface, what the gun deposits on them, and how even the result is.

A footprint is the flux on a plane square to the gun at the standoff, per square metre and second, for one unit of
material per second. The same rays hit any other surface: with the nozzle at N, the gun's axis g (out of the
surface), and v = s - N to a sample s with the normal n,

    depth a = -v . g,   flux = F(H |v - (v . g) g| / a) (H / a)^2 (-v . n) / a

which equals the footprint F on that plane, falls off with the square of the distance and with the cosine of the angle
of incidence, and loses nothing: a surface that catches all rays gets all of the material. Shadows are ignored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.geometry.envelope import upper_envelope
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.slicing import plane_direction, plane_heights, slice, strip_widths
from tapelayer.spraying.footprint import Footprint
from tapelayer.vectors import dot, ramp

# Samples farther from P than this many footprint radii get nothing; on a slope one radius is not enough.
_SEARCH = 2.0

# Number of spots processed at a time.
_CHUNK = 256

# Section curves whose ends are closer than this, in metres, are one curve.
_SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class Surface(Frozen):
    """Samples of a surface.

    Attributes:
        points: (m, 3) metres.
        normals: (m, 3) unit normals out of the surface.
        areas: (m,) square metres that each sample stands for.
    """

    points: Floats
    normals: Floats
    areas: Floats

    def only(self, chosen: Mask) -> Surface:
        """Return the samples chosen by a mask (m,)."""
        return Surface(self.points[chosen], self.normals[chosen], self.areas[chosen])


@dataclass(frozen=True, eq=False)
class Spots(Frozen):
    """Points at which the gun dwells for a moment with the arc on.

    Attributes:
        points: (n, 3) P in metres, in the frame of the surface.
        axes: (n, 3) unit gun axis from P to the nozzle.
        seconds: (n,) dwell time.
    """

    points: Floats
    axes: Floats
    seconds: Floats


@dataclass(frozen=True)
class Evenness:
    """Statistics of how even a coating is.

    Attributes:
        mean: area-weighted mean thickness, metres (or relative).
        cv_percent: standard deviation over mean, by area; NaN if nothing arrived.
        interior_mean: mean without the border band; NaN if there is nothing but the band.
        cv_interior_percent: standard deviation over mean without the border band; NaN if that is empty or got nothing.
        coverage_percent: share of the whole area, also beyond reach, with more than half the interior mean; NaN in
            the same cases.
    """

    mean: float
    cv_percent: float
    interior_mean: float
    cv_interior_percent: float
    coverage_percent: float


def surface_from_above(mesh: Mesh, spacing: float, min_normal_z: float) -> tuple[Surface, Floats]:
    """Return samples of the surface that vertical rays from above hit first, and points (k, 3) of its border in metres.

    Samples lie on sections one spacing apart, and along a section no farther apart than that. The border is where
    sections along x and along y end: the surface's edge, a hole, a step, the rim of an area that is too steep.

    Args:
        mesh: the surface.
        spacing: distance between samples in metres.
        min_normal_z: least |nz| of a facet to be sprayed, above 0.
    """
    borders = []
    for travel in (math.pi / 2, 0.0):
        direction = plane_direction(travel)
        heights = plane_heights(mesh, direction, spacing)
        curves = upper_envelope(mesh, slice(mesh, direction, heights), min_normal_z)
        borders.append(_curve_ends(curves.points, curves.offsets, curves.planes))
    rows, lengths = curves.segments, curves.lengths
    parts = np.maximum(np.ceil(lengths / spacing), 1.0).astype(np.int64)
    owner, share = _parts(parts)
    begins, ends = curves.points[rows], curves.points[rows + 1]
    facets = curves.facets[rows]
    normals = mesh.upward_normals[facets]
    areas = strip_widths(normals, direction, spacing) * lengths / parts
    points = begins[owner] + share[:, None] * (ends - begins)[owner]
    return Surface(points, normals[owner], areas[owner]), np.vstack(borders)


def inside_of(surface: Surface, border: Floats, band: float) -> Mask:
    """Return a mask (m,) of the samples farther than `band` metres from all (k, 3) border points."""
    if not len(border):
        return np.ones(len(surface.points), dtype=np.bool_)
    distances, _ = cKDTree(border).query(surface.points)
    farther: Mask = distances > band
    return farther


def spots_along(points: Floats, axes: Floats, times: Floats, pieces: Ints, spacing: float) -> Spots:
    """Return the spots of a gun that moves evenly from sample to sample of a piece; between pieces the arc is off.

    With a spacing of a tenth of the footprint's radius, sums over spots are as good as integrals.

    Args:
        points: (n, 3) P in metres.
        axes: (n, 3) unit gun axis at each.
        times: (n,) seconds.
        pieces: (n,) index of each sample's piece; the samples of a piece are consecutive.
        spacing: largest distance between spots in metres.
    """
    rows = np.flatnonzero(pieces[1:] == pieces[:-1])
    steps = points[rows + 1] - points[rows]
    parts = np.maximum(np.ceil(np.linalg.norm(steps, axis=1) / spacing), 1.0).astype(np.int64)
    owner, share = _parts(parts)
    turned = axes[rows][owner] + share[:, None] * (axes[rows + 1] - axes[rows])[owner]
    return Spots(
        points=points[rows][owner] + share[:, None] * steps[owner],
        axes=turned / np.linalg.norm(turned, axis=1)[:, None],
        seconds=((times[rows + 1] - times[rows]) / parts)[owner],
    )


def exposure(footprint: Footprint, standoff: float, spots: Spots, surface: Surface) -> Floats:
    """Return flux times time (m,) on each sample, s/m^2; times the material in m^3/s it is the thickness in metres.

    For several layers, pass the spots of all of them.

    Args:
        footprint: the flux on a plane square to the gun.
        standoff: nozzle to P in metres, above 0.
        spots: where the gun dwells, and for how long.
        surface: the samples.

    Raises:
        ValueError: there is no standoff.
    """
    if not standoff > 0:
        raise ValueError(f"a footprint needs a standoff above 0, got {standoff} m")
    total = np.zeros(len(surface.points))
    tree = cKDTree(surface.points)
    for start in range(0, len(spots.points), _CHUNK):
        rows = np.s_[start : start + _CHUNK]
        near = cKDTree(spots.points[rows]).sparse_distance_matrix(
            tree, _SEARCH * footprint.reach, output_type="ndarray"
        )
        spot, sample = near["i"], near["j"]
        axes = spots.axes[rows][spot]
        rays = surface.points[sample] - (spots.points[rows] + standoff * spots.axes[rows])[spot]
        depths = -dot(rays, axes)
        facing = -dot(rays, surface.normals[sample])
        hit = (depths > 0) & (facing > 0)
        spot, sample, depths, facing = spot[hit], sample[hit], depths[hit], facing[hit]
        offsets = np.linalg.norm(rays[hit] + depths[:, None] * axes[hit], axis=1)
        closer = standoff / depths
        flux = footprint.flux(closer * offsets) * closer**2 * facing / depths
        total += np.bincount(sample, weights=spots.seconds[rows][spot] * flux, minlength=len(total))
    return total


def evenness(thickness: Floats, surface: Surface, inside: Mask, whole: float) -> Evenness:
    """Return how even a coating is, by area.

    Args:
        thickness: (m,) metres, or relative.
        surface: the samples, one or more.
        inside: (m,) whether a sample lies outside the border band.
        whole: area to be covered, square metres: that of the samples, and what the gun cannot reach.
    """
    mean, spread = _mean_and_deviation(thickness, surface.areas)
    interior_mean, interior_spread = _mean_and_deviation(thickness[inside], surface.areas[inside])
    covered = float(np.sum(surface.areas[thickness > 0.5 * interior_mean]))
    return Evenness(
        mean=mean,
        cv_percent=100.0 * spread / mean if mean > 0 else math.nan,
        interior_mean=interior_mean,
        cv_interior_percent=100.0 * interior_spread / interior_mean if interior_mean > 0 else math.nan,
        coverage_percent=100.0 * covered / whole if interior_mean > 0 else math.nan,
    )


def _parts(parts: Ints) -> tuple[Ints, Floats]:
    """Return each part's segment, and its middle as a fraction of that, for segments cut into (n,) equal parts."""
    owner, number = ramp(parts)
    return owner, (number + 0.5) / parts[owner]


def _curve_ends(points: Floats, offsets: Ints, planes: Ints) -> Floats:
    """Return the first and last points (k, 3) of curves, without those where the next curve of the plane continues."""
    first, last = points[offsets[:-1]], points[offsets[1:] - 1]
    continued = (planes[1:] == planes[:-1]) & (np.linalg.norm(first[1:] - last[:-1], axis=1) <= _SAME_PLACE)
    begins, ends = np.ones(len(planes), dtype=np.bool_), np.ones(len(planes), dtype=np.bool_)
    begins[1:], ends[:-1] = ~continued, ~continued
    return np.vstack([first[begins], last[ends]])


def _mean_and_deviation(values: Floats, weights: Floats) -> tuple[float, float]:
    if not len(values):
        return math.nan, math.nan
    mean = float(np.average(values, weights=weights))
    return mean, math.sqrt(float(np.average((values - mean) ** 2, weights=weights)))
