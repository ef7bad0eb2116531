"""Footprint: what a gun at rest, or one pass, leaves on a plane, by model or from a measured profile."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats, Frozen
from tapelayer.errors import FootprintRefused, InputFault
from tapelayer.spraying.settings import SpraySetup
from tapelayer.text import plain_text
from tapelayer.units import MM

# A Gaussian footprint is cut off beyond this many standard deviations, which loses 4e-6 of its material.
_GAUSSIAN_REACH = 5.0


class Footprint(ABC):
    """What a gun at rest leaves on a plane square to it at the standoff."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Return the radius in metres beyond which nothing arrives."""

    @abstractmethod
    def flux(self, radii: Floats) -> Floats:
        """Return the flux (...) in 1/m^2 at radii (...) in metres from the axis; its integral over the plane is 1."""

    @abstractmethod
    def across(self, offsets: Floats) -> Floats:
        """Return the flux (...) in 1/m integrated along straight lines at offsets (...) in metres from the axis."""


@dataclass(frozen=True)
class Gaussian(Footprint):
    """Flux that is a normal distribution about the axis.

    Attributes:
        sigma: standard deviation in metres.
    """

    sigma: float

    @property
    def reach(self) -> float:
        """Return the same as `Footprint.reach`."""
        return _GAUSSIAN_REACH * self.sigma

    def flux(self, radii: Floats) -> Floats:
        """Return the same as `Footprint.flux`.

        Examples:
            >>> np.round(Gaussian(sigma=0.1).flux(np.array([0.0, 0.1, 0.6])), 3).tolist()
            [15.915, 9.653, 0.0]
        """
        inside = np.exp(-0.5 * (radii / self.sigma) ** 2) / (2 * np.pi * self.sigma**2)
        return np.where(np.abs(radii) <= self.reach, inside, 0.0)

    def across(self, offsets: Floats) -> Floats:
        """Return the same as `Footprint.across`; tails beyond the reach are included."""
        profile: Floats = np.exp(-0.5 * (offsets / self.sigma) ** 2) / (math.sqrt(2 * np.pi) * self.sigma)
        return profile


@dataclass(frozen=True)
class ParabolicFlux(Footprint):
    """Flux that falls off as a parabola from the axis; across a pass (1 - (x / R)^2)^1.5.

    Attributes:
        radius: R in metres.
    """

    radius: float

    @property
    def reach(self) -> float:
        """Return the same as `Footprint.reach`."""
        return self.radius

    def flux(self, radii: Floats) -> Floats:
        """Return the same as `Footprint.flux`.

        Examples:
            >>> np.round(ParabolicFlux(radius=0.1).flux(np.array([0.0, 0.05, 0.2])), 3).tolist()
            [63.662, 47.746, 0.0]
        """
        return 2.0 / (np.pi * self.radius**2) * np.maximum(1.0 - (radii / self.radius) ** 2, 0.0)

    def across(self, offsets: Floats) -> Floats:
        """Return the same as `Footprint.across`."""
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
        """Return the same as `Footprint.reach`."""
        return self.radius

    def flux(self, radii: Floats) -> Floats:
        """Return the same as `Footprint.flux`."""
        return 1.5 / (np.pi * self.radius**2) * np.sqrt(np.maximum(1.0 - (radii / self.radius) ** 2, 0.0))

    def across(self, offsets: Floats) -> Floats:
        """Return the same as `Footprint.across`.

        Examples:
            >>> ParabolicPass(radius=0.1).across(np.array([0.0, 0.05, 0.2])).tolist()
            [7.5, 5.625, 0.0]
        """
        return 0.75 / self.radius * np.maximum(1.0 - (offsets / self.radius) ** 2, 0.0)


@dataclass(frozen=True, eq=False)
class Profile(Frozen, Footprint):
    """Measured flux, interpolated linearly between its points.

    Attributes:
        radii: (k,) metres, increasing from 0.
        fluxes: (k,) in any unit, none below 0; nothing arrives beyond the last radius.
    """

    radii: Floats
    fluxes: Floats

    def __post_init__(self) -> None:
        """Scale the fluxes to the unit integral, and freeze the arrays."""
        inner, outer = self.radii[:-1], self.radii[1:]
        slopes = np.diff(self.fluxes) / np.diff(self.radii)
        heights = self.fluxes[:-1] - slopes * inner
        total = 2 * np.pi * np.sum(heights * (outer**2 - inner**2) / 2 + slopes * (outer**3 - inner**3) / 3)
        object.__setattr__(self, "fluxes", self.fluxes / total)
        super().__post_init__()

    @property
    def reach(self) -> float:
        """Return the same as `Footprint.reach`."""
        return float(self.radii[-1])

    def flux(self, radii: Floats) -> Floats:
        """Return the same as `Footprint.flux`.

        Examples:
            >>> Profile(np.array([0.0, 0.1]), np.array([2.0, 0.0])).flux(np.array([0.0, 0.05, 0.2])).round(3).tolist()
            [95.493, 47.746, 0.0]
        """
        return np.interp(np.abs(radii), self.radii, self.fluxes, right=0.0)

    def across(self, offsets: Floats) -> Floats:
        """Return the same as `Footprint.across`."""
        slopes = np.diff(self.fluxes) / np.diff(self.radii)
        heights = self.fluxes[:-1] - slopes * self.radii[:-1]
        offset = np.abs(offsets)[..., None]
        # Integrate (height + slope r) r / sqrt(r^2 - x^2) over r, from the larger of x and the inner radius.
        ends = np.maximum(self.radii, offset)
        chords = np.sqrt(ends**2 - offset**2)
        # At x = 0 and r = 0 the factor x^2 cancels the logarithm.
        logs = offset**2 * np.log(np.where(ends > 0, ends + chords, 1.0))
        level, rising = np.diff(chords, axis=-1), 0.5 * np.diff(ends * chords + logs, axis=-1)
        profile: Floats = 2.0 * np.sum(heights * level + slopes * rising, axis=-1)
        return profile


def footprint_of(setup: SpraySetup) -> Footprint:
    """Return the footprint of an arc spraying job; sizes that are not given follow from the spot's diameter.

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
    """Return the footprint in a text file: a radius in mm and a flux in any unit per line, `#` begins a comment.

    Raises:
        FootprintRefused: no pairs of numbers, radii that do not increase from 0, or fluxes below 0; all faults at once.
    """
    try:
        text = plain_text(path.read_bytes(), str(path), FootprintRefused).decode()
    except OSError as error:
        raise FootprintRefused.unreadable(str(path), error) from None
    except UnicodeDecodeError as error:
        sentence = f"byte {error.start} is not UTF-8; save the file as text, a radius in mm and a flux a line"
        raise FootprintRefused(str(path), [InputFault(0, sentence)]) from None
    faults: list[InputFault] = []
    pairs: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        pair = _pair(words)
        if pair is None:
            given = line.strip()
            given = given if len(given) <= 40 else given[:37] + "..."
            faults.append(InputFault(number, f"expected a radius in mm and a flux, two finite numbers, got {given!r}"))
            continue
        if pair[1] < 0:
            faults.append(InputFault(number, f"expected a flux of 0 or more, got {pair[1]:g}"))
        if not pairs and pair[0] != 0:
            faults.append(InputFault(number, f"expected radius 0 first, got {pair[0]:g} mm; begin on the gun's axis"))
        if pairs and not pair[0] > pairs[-1][0]:
            faults.append(InputFault(number, f"expected a radius above {pairs[-1][0]:g} mm, got {pair[0]:g} mm"))
        pairs.append(pair)
    if not faults and len(pairs) < 2:
        faults.append(InputFault(0, f"expected two pairs of radius and flux or more, got {len(pairs)}"))
    if not faults and not any(flux > 0 for _, flux in pairs):
        faults.append(InputFault(0, "expected a flux above 0 somewhere, got none"))
    if faults:
        raise FootprintRefused(str(path), faults)
    radii, fluxes = np.array(pairs).T
    return Profile(radii * MM, fluxes)


def _pair(words: list[str]) -> tuple[float, float] | None:
    if len(words) != 2 or "_" in "".join(words):
        return None
    try:
        radius, flux = float(words[0]), float(words[1])
    except ValueError:
        return None
    return (radius, flux) if math.isfinite(radius) and math.isfinite(flux) else None
