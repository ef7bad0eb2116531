"""Wrist of the spray robot: closed-form inverse, and how far theta may turn while the gun is near enough to a normal.

The remote-centre wrist turns the gun about P, so its two axes serve the gun's direction alone (the 2004 paper, 2.1):

    gun axis = (sin phi cos theta, sin phi sin theta, cos phi), out of the surface

Following a normal exactly would make theta spin near the pole phi = 0 and run out of its travel elsewhere. The process
lets the gun lean off the normal, which leaves theta the ranges computed here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.errors import ModelRefused
from tapelayer.machines.machine import Axis

# Radians by which a lean may exceed its limit through rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Wrist:
    """The axes and limits that govern the gun's direction.

    Attributes:
        theta: the axis about the vertical.
        phi: the axis that tilts the gun.
        gun_speed: m/s over the surface.
        max_deviation: greatest lean of the gun off the surface's normal, radians, above 0 and below pi / 2.
    """

    theta: Axis
    phi: Axis
    gun_speed: float
    max_deviation: float

    def __post_init__(self) -> None:
        """Refuse a theta without ends, and limits that no gun has.

        Raises:
            ModelRefused: theta turns without end.
        """
        if not math.isfinite(self.theta.upper - self.theta.lower):
            raise ModelRefused(
                f"axis {self.theta.name} turns without end, and its hoses do not: "
                f"give it travel with limits_deg, e.g. {{{self.theta.name} = [-180, 540]}}"
            )
        if not (0.0 < self.max_deviation < math.pi / 2 and 0.0 < self.gun_speed < math.inf):
            raise ValueError(f"no gun has max_deviation {self.max_deviation} rad and gun_speed {self.gun_speed} m/s")

    @property
    def tilts(self) -> tuple[float, float]:
        """The part of phi's travel that serves normals pointing upwards, radians.

        Examples:
            >>> wrist = Wrist(Axis("theta", True, 0.0, 2 * np.pi, 1.0), Axis("phi", True, 0.0, 2.0, 1.0), 0.3, 0.1)
            >>> np.degrees(wrist.tilts).tolist()
            [0.0, 90.0]
        """
        return max(self.phi.lower, -math.pi / 2), min(self.phi.upper, math.pi / 2)


def inverse(normals: Floats) -> Floats:
    """Return both (theta, phi) of each normal, (2, n, 2) radians, NaN where a normal does not point upwards.

    Branch 0 has theta in [0, 2 pi) and phi in [0, pi / 2); branch 1 is (theta + pi, -phi). Branch 0 equals the paper's
    eqs. (1) to (4) where they are defined. At the pole, where any theta will do, theta is 0.

    Args:
        normals: (n, 3) unit normals out of the surface, in `machine`.

    Examples:
        >>> one, other = np.degrees(inverse(np.array([[0.0, 0.6, 0.8]])))
        >>> np.round(one, 3).tolist(), np.round(other, 3).tolist()
        ([[90.0, 36.87]], [[270.0, -36.87]])
    """
    x, y, z = normals.T
    up = z > 0
    theta = np.where(up, np.mod(np.arctan2(y, x), 2 * np.pi), np.nan)
    # The remainder of a tiny negative angle rounds to a whole turn.
    theta[theta >= 2 * np.pi] = 0.0
    phi = np.where(up, np.arctan2(np.hypot(x, y), z), np.nan)
    return np.stack([np.column_stack([theta, phi]), np.column_stack([theta + np.pi, -phi])])


def gun_axes(theta: Floats, phi: Floats) -> Floats:
    """Return the unit direction (..., 3) of the gun from P to the nozzle, in `machine`, for angles in radians.

    Examples:
        >>> np.round(gun_axes(np.radians([90.0]), np.radians([30.0])), 6).tolist()
        [[0.0, 0.5, 0.866025]]
    """
    sine = np.sin(phi)
    axes: Floats = np.stack([sine * np.cos(theta), sine * np.sin(theta), np.cos(phi)], axis=-1)
    return axes


def angles_between(first: Floats, second: Floats) -> Floats:
    """Return angles (...) in radians between unit vectors (..., 3), accurate for small ones as well.

    Examples:
        >>> np.round(np.degrees(angles_between(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]))), 6).tolist()
        [90.0]
    """
    apart = np.linalg.norm(first - second, axis=-1)
    angles: Floats = 2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))
    return angles


def reachable(wrist: Wrist, normals: Floats, leans: Floats) -> Mask:
    """Return whether some theta and phi in travel bring the gun near enough to each normal, (n,).

    Args:
        wrist: travel and limits.
        normals: (n, 3) unit normals out of the surface, in `machine`; one that does not point upwards is not reached.
        leans: (n,) greatest lean off each normal, radians; inf where there is no limit.

    Examples:
        >>> wrist = Wrist(Axis("theta", True, 0.0, 2 * np.pi, 1.0), Axis("phi", True, 0.0, 2.0, 1.0), 0.3, 0.1)
        >>> up, down = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]
        >>> reachable(wrist, np.array([up, down]), np.full(2, 0.1)).tolist()
        [True, False]
    """
    azimuth, ahead, behind = turns(wrist, normals, leans)
    reached = np.zeros(len(normals), dtype=np.bool_)
    for middle, half in ((azimuth, ahead), (azimuth + np.pi, behind)):
        # Some whole number of turns brings the range into the travel.
        most = np.floor((wrist.theta.upper + half - middle + ROUNDING) / (2 * np.pi))
        least = np.ceil((wrist.theta.lower - half - middle - ROUNDING) / (2 * np.pi))
        reached |= (half >= 0) & (most >= least)
    return reached & (normals[:, 2] > 0)


def turns(wrist: Wrist, normals: Floats, leans: Floats) -> tuple[Floats, Floats, Floats]:
    """Return each normal's theta (n,), and how far theta may turn off it with phi > 0, off its opposite with phi < 0.

    The turn is -1 where no phi comes near enough to the normal.

    Examples:
        >>> wrist = Wrist(Axis("theta", True, 0.0, 2 * np.pi, 1.0), Axis("phi", True, 0.0, 2.0, 1.0), 0.3, 0.1)
        >>> theta, ahead, behind = turns(wrist, np.array([[0.0, 0.6, 0.8]]), np.array([0.1]))
        >>> np.round(np.degrees([theta, ahead]), 2).tolist(), behind.tolist()
        ([[90.0], [9.58]], [-1.0])
    """
    x, y, z = normals.T
    slant = np.arctan2(np.hypot(x, y), z)
    lower, upper = wrist.tilts
    ahead = widest_turn(slant, leans, max(lower, 0.0), upper)
    return np.arctan2(y, x), ahead, widest_turn(slant, leans, max(-upper, 0.0), -lower)


def widest_turn(slant: Floats, leans: Floats, lower: float, upper: float) -> Floats:
    """Return the largest turn (n,) off a normal's theta at which a phi in [lower, upper] >= 0 is near enough; or -1.

    The gun is near enough where sin(slant) sin(phi) cos(turn) + cos(slant) cos(phi) >= cos(lean). Of all phi the one
    with cos(phi) = cos(slant) / cos(lean) permits the widest turn, sin(turn) = sin(lean) / sin(slant): there the
    meridian touches the cap. Away from it the turn narrows, so where travel excludes that phi, its nearer end is best.

    Args:
        slant: (n,) angle of the normals to the vertical, radians.
        leans: (n,) greatest lean, radians.
        lower: least tilt, radians.
        upper: greatest tilt, radians.

    Examples:
        >>> slants, leans = np.radians([5.0, 45.0]), np.radians([10.0, 10.0])
        >>> np.round(np.degrees(widest_turn(slants, leans, 0.0, np.pi / 2)), 2).tolist()
        [180.0, 14.22]
    """
    lean = np.minimum(leans + ROUNDING, np.pi / 2)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        touching = np.arccos(np.minimum(np.cos(slant) / np.cos(lean), 1.0))
        tilt = np.clip(touching, lower, upper)
        at_tilt = (np.cos(lean) - np.cos(slant) * np.cos(tilt)) / (np.sin(slant) * np.sin(tilt))
        turn = np.where(
            tilt == touching, np.arcsin(np.sin(lean) / np.sin(slant)), np.arccos(np.clip(at_tilt, -1.0, 1.0))
        )
    everywhere = (lean >= np.pi / 2) | (slant + lower <= lean)
    near = np.abs(slant - np.clip(slant, lower, upper)) <= lean
    return np.where(near & (lower <= upper), np.where(everywhere, np.pi, turn), -1.0)


# The axes that a program moves; the standoff is set by hand.
AXES = ("x", "y", "z", "theta", "phi")
# Links that touch by nature, besides those that a joint connects: the pins C and F of the linkage, and the gun, which
# passes the eye of E.
TOUCHING = (("gun", "rod_bce"), ("rod_bce", "rod_dgc"), ("rod_ef", "rod_fg"))
