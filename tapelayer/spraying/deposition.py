"""Thickness: what the gun leaves on a surface, how even it is, and how far apart passes may be.

A footprint is what arrives on a plane square to the gun at the standoff, per square metre and second, of one unit of
material a second. On any other surface the same rays arrive: with the nozzle at N, the gun's axis g (out of the
surface), and v = s - N to a sample s with the normal n,

    depth a = -v . g,   flux = F(H |v - (v . g) g| / a) (H / a)^2 (-v . n) / a

which is the footprint F itself on that plane, falls off with the square of the distance and with the cosine of the
incidence, and loses nothing: whatever surface catches all rays gets all of the material. Shadows are not looked at.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Ints, Mask, frozen
from tapelayer.errors import Fault, FootprintRefused, PitchNotFound
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.slicing import plane_direction, plane_heights, slice, strip_widths, upper_envelope
from tapelayer.setups.sections import MM
from tapelayer.spraying.settings import SpraySetup

# Beyond so many standard deviations a Gaussian footprint is cut off: 4e-6 of its material.
_GAUSSIAN_REACH = 5.0

# Samples farther from P than so many reaches of the footprint get nothing; on a slope one is not enough.
_SEARCH = 2.0

# Spots whose samples are looked up at a time.
_CHUNK = 256

# Samples in half a period of a raster, and steps to one more overlapping pass in the search for a pitch.
_HALF_PERIOD = 240
_OVERLAP_STEPS = 25

# Overlapping passes with which the search for a pitch begins.
_MOST_OVERLAP = 32

# Curves of the surface that end nearer to each other than this go on, metres.
_SAME_PLACE = 1e-6


class Footprint(ABC):
    """What a gun at rest leaves on a plane square to it at the standoff."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Radius in metres beyond which nothing arrives."""

    @abstractmethod
    def flux(self, radii: Floats) -> Floats:
        """Material per area (...) at radii (...) from the axis: 1/m^2, its integral over the plane is 1."""

    @abstractmethod
    def across(self, offsets: Floats) -> Floats:
        """Integral (...) of the flux along a straight line at offsets (...) in metres from the axis: 1/m."""


@dataclass(frozen=True)
class Gaussian(Footprint):
    """Normal distribution about the axis.

    Attributes:
        sigma: standard deviation in metres.
    """

    sigma: float

    @property
    def reach(self) -> float:
        """As `Footprint.reach`."""
        return _GAUSSIAN_REACH * self.sigma

    def flux(self, radii: Floats) -> Floats:
        """As `Footprint.flux`."""
        inside = np.exp(-0.5 * (radii / self.sigma) ** 2) / (2 * np.pi * self.sigma**2)
        return np.where(np.abs(radii) <= self.reach, inside, 0.0)

    def across(self, offsets: Floats) -> Floats:
        """As `Footprint.across`; the tails beyond the reach are counted."""
        profile: Floats = np.exp(-0.5 * (offsets / self.sigma) ** 2) / (math.sqrt(2 * np.pi) * self.sigma)
        return profile


@dataclass(frozen=True)
class ParabolicFlux(Footprint):
    """Flux that falls as a parabola from the axis; across a pass (1 - (x / R)^2)^1.5.

    Attributes:
        radius: R in metres.
    """

    radius: float

    @property
    def reach(self) -> float:
        """As `Footprint.reach`."""
        return self.radius

    def flux(self, radii: Floats) -> Floats:
        """As `Footprint.flux`."""
        return 2.0 / (np.pi * self.radius**2) * np.maximum(1.0 - (radii / self.radius) ** 2, 0.0)

    def across(self, offsets: Floats) -> Floats:
        """As `Footprint.across`."""
        return 8.0 / (3.0 * np.pi * self.radius) * np.maximum(1.0 - (offsets / self.radius) ** 2, 0.0) ** 1.5


@dataclass(frozen=True)
class ParabolicPass(Footprint):
    """Flux that leaves a parabola across a pass: its inverse Abel transform, a half ellipsoid.

    Attributes:
        radius: R in metres.
    """

    radius: float

    @property
    def reach(self) -> float:
        """As `Footprint.reach`."""
        return self.radius

    def flux(self, radii: Floats) -> Floats:
        """As `Footprint.flux`."""
        return 1.5 / (np.pi * self.radius**2) * np.sqrt(np.maximum(1.0 - (radii / self.radius) ** 2, 0.0))

    def across(self, offsets: Floats) -> Floats:
        """As `Footprint.across`."""
        return 0.75 / self.radius * np.maximum(1.0 - (offsets / self.radius) ** 2, 0.0)


@dataclass(frozen=True, eq=False)
class Profile(Footprint):
    """Measured flux, straight between its points.

    Attributes:
        radii: (k,) metres, increasing from 0.
        fluxes: (k,) of any unit, none below 0; nothing arrives beyond the last.
    """

    radii: Floats
    fluxes: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays, and scale the fluxes to the unit integral."""
        inner, outer = self.radii[:-1], self.radii[1:]
        slopes = np.diff(self.fluxes) / np.diff(self.radii)
        heights = self.fluxes[:-1] - slopes * inner
        total = 2 * np.pi * np.sum(heights * (outer**2 - inner**2) / 2 + slopes * (outer**3 - inner**3) / 3)
        object.__setattr__(self, "radii", frozen(self.radii))
        object.__setattr__(self, "fluxes", frozen(self.fluxes / total))

    @property
    def reach(self) -> float:
        """As `Footprint.reach`."""
        return float(self.radii[-1])

    def flux(self, radii: Floats) -> Floats:
        """As `Footprint.flux`."""
        return np.interp(np.abs(radii), self.radii, self.fluxes, right=0.0)

    def across(self, offsets: Floats) -> Floats:
        """As `Footprint.across`."""
        slopes = np.diff(self.fluxes) / np.diff(self.radii)
        heights = self.fluxes[:-1] - slopes * self.radii[:-1]
        offset = np.abs(offsets)[..., None]
        # Of (height + slope r) r / sqrt(r^2 - x^2) over r, from the larger of x and the inner radius.
        ends = np.maximum(self.radii, offset)
        chords = np.sqrt(ends**2 - offset**2)
        # At x = 0 and r = 0 the logarithm stands beside x^2.
        logs = offset**2 * np.log(np.where(ends > 0, ends + chords, 1.0))
        level, rising = np.diff(chords, axis=-1), 0.5 * np.diff(ends * chords + logs, axis=-1)
        profile: Floats = 2.0 * np.sum(heights * level + slopes * rising, axis=-1)
        return profile


@dataclass(frozen=True, eq=False)
class Surface:
    """Samples of a surface.

    Attributes:
        points: (m, 3) metres.
        normals: (m, 3) unit normals out of the surface.
        areas: (m,) square metres that each sample stands for.
    """

    points: Floats
    normals: Floats
    areas: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("points", "normals", "areas"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def only(self, chosen: Mask) -> Surface:
        """The samples that are chosen by (m,)."""
        return Surface(self.points[chosen], self.normals[chosen], self.areas[chosen])


@dataclass(frozen=True, eq=False)
class Spots:
    """Places where the gun stays for a moment with the arc on.

    Attributes:
        points: (n, 3) P in metres, in the frame of the surface.
        axes: (n, 3) unit gun axis from P to the nozzle.
        seconds: (n,) how long.
    """

    points: Floats
    axes: Floats
    seconds: Floats

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("points", "axes", "seconds"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True)
class Evenness:
    """How even a coating is.

    Attributes:
        mean: area-weighted mean thickness, metres (or relative).
        cv_percent: standard deviation over mean, by area; NaN where nothing arrived.
        interior_mean: mean without the border band; NaN where nothing else is there.
        cv_interior_percent: standard deviation over mean without the border band; NaN where nothing is or arrived.
        coverage_percent: share of the area with more than half the interior mean; NaN likewise.
    """

    mean: float
    cv_percent: float
    interior_mean: float
    cv_interior_percent: float
    coverage_percent: float


def footprint_of(setup: SpraySetup) -> Footprint:
    """Footprint of an arc spraying job; sizes that are not given come from the spot's diameter.

    Raises:
        FootprintRefused: the profile's file cannot be used.
    """
    given, spot = setup.footprint, setup.spray.spot_mm * MM
    radius = spot / 2 if given.radius_mm is None else given.radius_mm * MM
    if given.profile is not None:
        return read_profile(Path(given.profile))
    if given.model == "parabolic_flux":
        return ParabolicFlux(radius)
    if given.model == "parabolic_pass":
        return ParabolicPass(radius)
    return Gaussian(spot / 4 if given.sigma_mm is None else given.sigma_mm * MM)


def read_profile(path: Path) -> Profile:
    """Footprint of a text file: a radius in mm and a flux of any unit a line, `#` begins a comment.

    Raises:
        FootprintRefused: no pairs of numbers, radii that do not increase from 0, or fluxes below 0; all faults at once.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise FootprintRefused(str(path), [Fault(0, f"cannot be read: {reason}")]) from None
    except UnicodeDecodeError as error:
        sentence = f"byte {error.start} is not UTF-8; save the file as text, a radius in mm and a flux a line"
        raise FootprintRefused(str(path), [Fault(0, sentence)]) from None
    faults: list[Fault] = []
    pairs: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        pair = _pair(words)
        if pair is None:
            shown = line.strip()
            shown = shown if len(shown) <= 40 else shown[:37] + "..."
            faults.append(Fault(number, f"expected a radius in mm and a flux, two finite numbers, got {shown!r}"))
            continue
        if pair[1] < 0:
            faults.append(Fault(number, f"expected a flux of 0 or more, got {pair[1]:g}"))
        if not pairs and pair[0] != 0:
            faults.append(Fault(number, f"expected radius 0 first, got {pair[0]:g} mm; begin on the gun's axis"))
        if pairs and not pair[0] > pairs[-1][0]:
            faults.append(Fault(number, f"expected a radius above {pairs[-1][0]:g} mm, got {pair[0]:g} mm"))
        pairs.append(pair)
    if not faults and len(pairs) < 2:
        faults.append(Fault(0, f"expected two pairs of radius and flux or more, got {len(pairs)}"))
    if not faults and not any(flux > 0 for _, flux in pairs):
        faults.append(Fault(0, "expected a flux above 0 somewhere, got none"))
    if faults:
        raise FootprintRefused(str(path), faults)
    radii, fluxes = np.array(pairs).T
    return Profile(radii * MM, fluxes)


def surface_from_above(mesh: Mesh, spacing: float, min_normal_z: float) -> tuple[Surface, Floats]:
    """Samples of what a vertical ray from above meets first, and points (k, 3) of its border in metres.

    Samples lie on sections a spacing apart, no farther from each other along them. The border is where sections along x
    and along y end: the surface's edge, a hole, a step, the rim of what is too steep.

    Args:
        mesh: the surface.
        spacing: distance of samples in metres.
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
    """Whether samples (m,) are farther than `band` metres from every one of the (k, 3) border points."""
    if not len(border):
        return np.ones(len(surface.points), dtype=np.bool_)
    distances, _ = cKDTree(border).query(surface.points)
    farther: Mask = distances > band
    return farther


def spots_along(points: Floats, axes: Floats, times: Floats, pieces: Ints, spacing: float) -> Spots:
    """Spots of a gun that goes evenly from sample to sample of a piece; between pieces the arc is off.

    A spacing of a tenth of the footprint's reach leaves sums over spots as good as integrals.

    Args:
        points: (n, 3) P in metres.
        axes: (n, 3) unit gun axis at each.
        times: (n,) seconds.
        pieces: (n,) index of the piece that a sample belongs to; a piece's samples follow each other.
        spacing: greatest distance of spots in metres.
    """
    rows = np.flatnonzero(pieces[1:] == pieces[:-1])
    ways = points[rows + 1] - points[rows]
    parts = np.maximum(np.ceil(np.linalg.norm(ways, axis=1) / spacing), 1.0).astype(np.int64)
    owner, share = _parts(parts)
    turned = axes[rows][owner] + share[:, None] * (axes[rows + 1] - axes[rows])[owner]
    return Spots(
        points=points[rows][owner] + share[:, None] * ways[owner],
        axes=turned / np.linalg.norm(turned, axis=1)[:, None],
        seconds=((times[rows + 1] - times[rows]) / parts)[owner],
    )


def exposure(footprint: Footprint, standoff: float, spots: Spots, surface: Surface) -> Floats:
    """Flux times time (m,) on each sample, s/m^2; times the material in m^3/s it is the thickness in metres.

    Several layers are the spots of all of them.

    Args:
        footprint: what arrives on a plane square to the gun.
        standoff: nozzle to P in metres, above 0.
        spots: where the gun is for how long.
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
        ways = surface.points[sample] - (spots.points[rows] + standoff * spots.axes[rows])[spot]
        depths = -np.einsum("ij,ij->i", ways, axes)
        facing = -np.einsum("ij,ij->i", ways, surface.normals[sample])
        met = (depths > 0) & (facing > 0)
        spot, sample, depths, facing = spot[met], sample[met], depths[met], facing[met]
        offsets = np.linalg.norm(ways[met] + depths[:, None] * axes[met], axis=1)
        closer = standoff / depths
        flux = footprint.flux(closer * offsets) * closer**2 * facing / depths
        total += np.bincount(sample, weights=spots.seconds[rows][spot] * flux, minlength=len(total))
    return total


def evenness(thickness: Floats, surface: Surface, inside: Mask) -> Evenness:
    """How even a coating is, by area.

    Args:
        thickness: (m,) metres, or relative.
        surface: the samples, one or more.
        inside: (m,) whether a sample is off the border band.
    """
    mean, spread = _mean_and_deviation(thickness, surface.areas)
    interior_mean, interior_spread = _mean_and_deviation(thickness[inside], surface.areas[inside])
    covered = float(np.sum(surface.areas[thickness > 0.5 * interior_mean]))
    return Evenness(
        mean=mean,
        cv_percent=100.0 * spread / mean if mean > 0 else math.nan,
        interior_mean=interior_mean,
        cv_interior_percent=100.0 * interior_spread / interior_mean if interior_mean > 0 else math.nan,
        coverage_percent=100.0 * covered / float(np.sum(surface.areas)) if interior_mean > 0 else math.nan,
    )


def raster_cv(footprint: Footprint, pitch: float) -> float:
    """Standard deviation over mean of the thickness under endless straight passes a pitch (metres) apart on a plane."""
    return _raster_cv(footprint.across, footprint.reach, pitch)


def widest_pitch(footprint: Footprint, target_cv: float) -> float:
    """Widest pitch in metres such that this and every narrower one keep a coefficient of variation on a plane.

    The coefficient of variation does not simply grow with the pitch: a wider pitch behind one that does not keep the
    target is not taken. Beyond twice the reach, where passes do not overlap, none is taken either.

    Args:
        footprint: what the gun leaves.
        target_cv: standard deviation over mean, e.g. 0.05.

    Raises:
        PitchNotFound: passes would have to be closer than 1/32 of the footprint's diameter.
    """
    reach = footprint.reach
    offsets = np.linspace(0.0, reach, 4097)
    profile = footprint.across(offsets)

    def cv(overlap: float) -> float:
        return _raster_cv(lambda x: np.interp(np.abs(x), offsets, profile, right=0.0), reach, 2 * reach / overlap)

    # Bumps of the coefficient of variation come once for each pass that overlaps.
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
    # Thickness is even about each pass: half a period tells all.
    offsets = (np.arange(_HALF_PERIOD) + 0.5) / _HALF_PERIOD * pitch / 2
    passes = math.ceil(reach / pitch) + 1
    thickness = np.sum(across(offsets[:, None] - pitch * np.arange(-passes, passes + 1)), axis=1)
    return float(np.std(thickness) / np.mean(thickness))


def _parts(parts: Ints) -> tuple[Ints, Floats]:
    """Of ways in (n,) equal parts: the way of each part, and the share of the way at which the part's middle lies."""
    owner = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(owner)) - (np.cumsum(parts) - parts)[owner]
    return owner, (number + 0.5) / parts[owner]


def _curve_ends(points: Floats, offsets: Ints, planes: Ints) -> Floats:
    """First and last points (k, 3) of curves, but for those at which the plane's next curve goes on."""
    first, last = points[offsets[:-1]], points[offsets[1:] - 1]
    on = (planes[1:] == planes[:-1]) & (np.linalg.norm(first[1:] - last[:-1], axis=1) <= _SAME_PLACE)
    begins, ends = np.ones(len(planes), dtype=np.bool_), np.ones(len(planes), dtype=np.bool_)
    begins[1:], ends[:-1] = ~on, ~on
    return np.vstack([first[begins], last[ends]])


def _mean_and_deviation(values: Floats, weights: Floats) -> tuple[float, float]:
    if not len(values):
        return math.nan, math.nan
    mean = float(np.average(values, weights=weights))
    return mean, math.sqrt(float(np.average((values - mean) ** 2, weights=weights)))


def _pair(words: list[str]) -> tuple[float, float] | None:
    if len(words) != 2 or "_" in "".join(words):
        return None
    try:
        radius, flux = float(words[0]), float(words[1])
    except ValueError:
        return None
    return (radius, flux) if math.isfinite(radius) and math.isfinite(flux) else None
