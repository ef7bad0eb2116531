"""Axis use: how far and how fast the axes of a program go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.motion.trajectory import CIRCULAR, Kind, Trajectory
from tapelayer.units import DEG, MM, json_number
from tapelayer.verification.breach import Breach

if TYPE_CHECKING:
    from tapelayer.machines.machine import Axis


# A feed word of six digits and the time computed from it agree within this share.
FEED_DIGITS = 1e-5
# Where two blocks overlap, a control may exceed an axis's acceleration by this share.
OVERLAP_SHARE = 0.01


@dataclass(frozen=True)
class AxisUse:
    """How far and how fast an axis goes, in metres and radians.

    Attributes:
        name: joint name.
        revolute: True for radians.
        least: smallest value.
        greatest: largest value.
        lower: lower end of travel.
        upper: upper end of travel.
        top_speed: highest speed that a feed block asks for.
        speed_limit: the axis's speed limit.
        top_acceleration: highest acceleration on the control, in ramps and over corners; NaN where it is not predicted.
        acceleration_limit: the axis's acceleration; inf where none is stated.
        top_jerk: highest jerk on the control, in ramps and over corners; NaN where the control does not limit it,
            and on arcs, whose ends change the acceleration at once.
        jerk_limit: the axis's jerk; inf where none is stated.
    """

    name: str
    revolute: bool
    least: float
    greatest: float
    lower: float
    upper: float
    top_speed: float
    speed_limit: float
    top_acceleration: float = math.nan
    acceleration_limit: float = math.inf
    top_jerk: float = math.nan
    jerk_limit: float = math.inf

    @property
    def margin(self) -> float:
        """Least distance to an end of the travel."""
        return min(self.least - self.lower, self.upper - self.greatest)

    @property
    def unit(self) -> str:
        """Unit in which the axis is reported."""
        return "deg" if self.revolute else "mm"

    @property
    def scale(self) -> float:
        """Factor from metres or radians to that unit."""
        return 1 / DEG if self.revolute else 1 / MM

    @property
    def failures(self) -> tuple[str, str, str, str]:
        """Names of failures of its travel, of its speed, of its acceleration and of its jerk."""
        name, unit = f"axis_{self.name}", self.unit
        acceleration, jerk = f"{name}_acceleration_{unit}_per_s2", f"{name}_jerk_{unit}_per_s3"
        return f"{name}_{unit}", f"{name}_speed_{unit}_per_s", acceleration, jerk

    def values(self) -> dict[str, Any]:
        """Return the axis for JSON, in its unit."""
        values = {
            "min": self.least,
            "max": self.greatest,
            "lower": self.lower,
            "upper": self.upper,
            "margin": self.margin,
            "max_speed": self.top_speed,
            "speed_limit": self.speed_limit,
            "max_acceleration": self.top_acceleration,
            "acceleration_limit": self.acceleration_limit,
            "max_jerk": self.top_jerk,
            "jerk_limit": self.jerk_limit,
        }
        return {"unit": self.unit, **{key: json_number(value * self.scale) for key, value in values.items()}}


def axes_used(
    trajectory: Trajectory,
    axes: Sequence[Axis],
    digits: Floats,
    rounding: Floats,
    outputs: frozenset[int] = frozenset(),
) -> tuple[tuple[AxisUse, ...], list[Breach]]:
    """Return travel, speed, acceleration and jerk of every axis, and the worst block of each that exceeds its limits.

    Args:
        trajectory: planned, or read back from a program.
        axes: its axes, in the order of its columns.
        digits: (k,) last written digit of each axis, metres and radians: positions are known to half of it.
        rounding: (k,) metres and radians by which an axis's true step in one block may be less than its words state.
        outputs: columns that the control does not interpolate, whose acceleration and jerk it therefore does not set.
    """
    uses, breaches = [], []
    feeding = np.flatnonzero(np.isin(trajectory.kinds, (Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    begins, ends = trajectory.begins(feeding), trajectory.positions[feeding]
    spans = trajectory.requested[feeding]
    ramped, accelerations = _accelerations(trajectory)
    jerked, jerks = _jerks(trajectory)
    accelerations[:, sorted(outputs)], jerks[:, sorted(outputs)] = 0.0, 0.0
    eased = trajectory.clock is not None and trajectory.clock.jerks is not None
    for column, axis in enumerate(axes):
        values = trajectory.positions[:, column]
        stated = values[~np.isnan(values)]
        least, greatest = float(np.min(stated, initial=np.inf)), float(np.max(stated, initial=-np.inf))
        steps = np.abs(ends[:, column] - begins[:, column])
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.where(steps > rounding[column], (steps - rounding[column]) / spans, 0.0)
        top = float(np.max(speeds, initial=0.0))
        steepest = float(np.max(accelerations[:, column], initial=0.0)) if trajectory.clock else math.nan
        jerk = float(np.max(jerks[:, column], initial=0.0)) if eased else math.nan
        use = AxisUse(
            axis.name,
            axis.revolute,
            least,
            greatest,
            axis.lower,
            axis.upper,
            top,
            axis.speed,
            steepest,
            axis.acceleration,
            jerk,
            axis.jerk,
        )
        travel, speed, acceleration, sudden = use.failures
        inside = (stated >= axis.lower - digits[column] / 2) & (stated <= axis.upper + digits[column] / 2)
        if not np.all(inside):
            row = int(np.argmax(np.nan_to_num(np.maximum(axis.lower - values, values - axis.upper), nan=-np.inf)))
            bound = axis.lower if values[row] < axis.lower else axis.upper
            breaches.append(Breach(row, travel, float(values[row]) * use.scale, bound * use.scale))
        if not top <= axis.speed * (1 + FEED_DIGITS):
            row = int(feeding[np.argmax(np.nan_to_num(speeds, nan=np.inf))])
            breaches.append(Breach(row, speed, top * use.scale, axis.speed * use.scale))
        if not (math.isnan(steepest) or steepest <= axis.acceleration * (1 + OVERLAP_SHARE)):
            row = int(ramped[np.argmax(accelerations[:, column])])
            breaches.append(Breach(row, acceleration, steepest * use.scale, axis.acceleration * use.scale))
        if not (math.isnan(jerk) or jerk <= axis.jerk * (1 + OVERLAP_SHARE)):
            row = int(jerked[np.argmax(jerks[:, column])])
            breaches.append(Breach(row, sudden, jerk * use.scale, axis.jerk * use.scale))
        uses.append(use)
    return tuple(uses), breaches


def _accelerations(trajectory: Trajectory) -> tuple[Ints, Floats]:
    """Return blocks (m,) in which the velocity changes, and the largest acceleration (m, k) of each axis in each.

    A block's ramps and the turning of its arc, and its blend into the next: there one brakes while the other starts.
    """
    clock = trajectory.clock
    if clock is None:
        return np.zeros(0, np.int64), np.zeros((0, len(trajectory.axes)))
    turns = np.isin(trajectory.kinds, CIRCULAR) & (np.diff(clock.reached) > 0.0)
    ramped = np.flatnonzero((clock.ramps > 0.0) | turns)
    lengths = (clock.reached[ramped + 1] - clock.reached[ramped])[:, None]
    changes, bends = trajectory.extremes(ramped)
    ramps, peaks = clock.ramps[ramped, None], clock.peaks[ramped, None]
    found = np.hypot(changes / lengths * ramps, bends * (peaks / lengths) ** 2)
    if clock.blends is None:
        return ramped, found
    blends = clock.blends
    joined = np.flatnonzero(blends.overlaps > 0.0)
    following = trajectory.directions(blends.following[joined], np.zeros(len(joined))) * blends.starting[joined, None]
    braking = trajectory.directions(joined, np.ones(len(joined))) * blends.braking[joined, None]
    over = np.abs(following - braking)
    return np.append(ramped, joined), np.vstack([found, over])


def _jerks(trajectory: Trajectory) -> tuple[Ints, Floats]:
    """Return blocks (m,) in which the acceleration changes, and the largest jerk (m, k) of each axis in each.

    In a block's ramps, and in the turn into the next block. Where an arc begins or ends, the acceleration of its
    plane changes at once, so that the jerk of those axes is not a number.
    """
    clock = trajectory.clock
    if clock is None or clock.jerks is None:
        return np.zeros(0, np.int64), np.zeros((0, len(trajectory.axes)))
    moving = np.flatnonzero(np.diff(clock.reached) > 0.0)
    lengths = (clock.reached[moving + 1] - clock.reached[moving])[:, None]
    changes, bends = trajectory.extremes(moving)
    ramps = np.zeros_like(changes)
    np.multiply(changes / lengths, clock.jerks[moving, None], out=ramps, where=changes > 0.0)
    found = np.where(bends > 0.0, np.nan, ramps)
    if clock.blends is None:
        return moving, found
    blends = clock.blends
    joined = np.flatnonzero(blends.overlaps > 0.0)
    leaving = trajectory.directions(joined, np.ones(len(joined)))
    entering = trajectory.directions(blends.following[joined], np.zeros(len(joined)))
    turned = np.abs(entering - leaving) * blends.braking[joined, None]
    easing = np.broadcast_to(blends.easing[joined, None], turned.shape)
    sudden = np.divide(turned, easing, out=np.full(turned.shape, np.inf), where=easing > 0.0)
    return np.append(moving, joined), np.vstack([found, np.where(turned > 0.0, sudden, 0.0)])
