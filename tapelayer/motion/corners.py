"""Corners: how a control passes from block to block, by its rule: with a stop, a blend or a look ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask

Corner = Literal["none", "stop", "linuxcnc", "look_ahead"]
# A corner sharper than this is a reversal, which LinuxCNC never passes without a stop.
REVERSAL = 1.0 - 0.5 * math.radians(2.0) ** 2
# Share of the acceleration that turning on an arc may take; the ramps have what is left of the whole.
ARC_SHARE = math.sqrt(3.0) / 2.0
# LinuxCNC keeps a block that follows a tangent corner a little longer than a servo cycle.
OVER_A_CYCLE = 1.02
# Shares below this are rounding.
ROUNDING = 1e-9
# What is left of a block between two arcs counts as no shorter than this, in path units.
NO_LENGTH = 1e-12


@dataclass(frozen=True)
class Rule:
    """How a control turns blocks into motion.

    Attributes:
        corner: `none`: every axis reaches its speed at once; `stop`: a full stop at every block's end; `linuxcnc`: its
            trajectory planner; `look_ahead`: over any number of blocks, corners rounded within the tolerance.
        paths: groups of columns; the first that moves in a block sets its path, all columns where none does.
        digits: last written digit of every column, metres and radians; empty where positions are not written.
        rotary: columns of rotary axes.
        outputs: columns that the control does not interpolate: they turn while all else stands still.
        switching: whether a switching word lets the motion go on, or stops it.
        cycle: servo period, seconds.
        kink: share of an axis's acceleration that LinuxCNC spends on a corner that it passes without a stop.
        drain: seconds for a word that lets the control finish all motion first.
        tolerance: metres by which corners are rounded off where blocks are blended; 0 where they cannot be.
        stated: whether a program can state that tolerance, so that each job has its own; `tolerance` is the least.
    """

    corner: Corner = "none"
    paths: tuple[tuple[int, ...], ...] = ()
    digits: tuple[float, ...] = ()
    rotary: frozenset[int] = frozenset()
    outputs: frozenset[int] = frozenset()
    switching: Literal["on_the_fly", "stops"] = "on_the_fly"
    cycle: float = 1e-3
    kink: float = 0.1
    drain: float = 0.0
    tolerance: float = 0.0
    stated: bool = False

    @property
    def blends(self) -> bool:
        """Whether the control can pass a block's end without a stop."""
        return self.corner in ("linuxcnc", "look_ahead")

    @property
    def eases(self) -> bool:
        """Whether the control keeps the jerk of axes within their limits; LinuxCNC 2.9 knows of none."""
        return self.corner in ("stop", "look_ahead")

    def rounding(self, allowed: float) -> float:
        """Return how far, in metres, corners are rounded off in a job whose path may be off by `allowed` metres.

        A chord that is balanced about its curve leaves corners of twice that to round off.
        """
        return max(2.0 * allowed, self.tolerance) if self.stated else self.tolerance

    def written(self, positions: Floats) -> Floats:
        """Return positions (n, k) in metres and radians as the control reads them, to its last written digits."""
        if not self.digits:
            return positions
        digits = np.array(self.digits)
        rounded: Floats = np.round(positions / digits) * digits
        return rounded

    @property
    def ramp_share(self) -> float:
        """Share of the acceleration that a block has for its own ramps while it blends into the next."""
        return 0.5 if self.corner == "linuxcnc" else 1.0

    def held(self, lengths: Floats, accelerations: Floats) -> Floats:
        """Return the greatest speed (n,) that a control holds through blended blocks of (n,) lengths.

        LinuxCNC plans every block from rest to rest at half its acceleration: the speed is held where the block is at
        least 2 v^2 / a long.

        Args:
            lengths: (n,) path units.
            accelerations: (n,) along the path, path units/s2.
        """
        if self.corner == "linuxcnc":
            return np.sqrt(accelerations * lengths / 2.0)
        return np.full(len(lengths), math.inf)


@dataclass(frozen=True, eq=False)
class Chain(Frozen):
    """Moving blocks in order, as a corner rule sees them.

    Attributes:
        begins: (m, k) change of every axis per path unit at the block's beginning.
        ends: (m, k) the same at its end, which differs where the block is an arc.
        shares: (m, k) greatest of that change anywhere in the block, of either sign.
        xyz: columns of X, Y, Z in it.
        lengths: (m,) path units.
        speeds: (m,) greatest path speed, by feed word and axes.
        tops: (m,) greatest path speed by the axes alone.
        accelerations: (m,) greatest path acceleration.
        axes: (k,) greatest acceleration of every axis.
        jerks: (k,) greatest jerk of every axis; inf where the control does not limit it.
        tolerances: (m,) metres by which the end may be rounded off, 0 for a full stop.
        scales: (k,) radians that count as a metre there: a degree as a millimetre; 1 for linear axes.
        rapid: (m,) whether a block is a rapid.
        groups: (m,) the rule's path group of each block.
        broken: (m,) whether words after a block let the control finish all motion.
    """

    begins: Floats
    ends: Floats
    shares: Floats
    xyz: tuple[int, ...]
    lengths: Floats
    speeds: Floats
    tops: Floats
    accelerations: Floats
    axes: Floats
    jerks: Floats
    tolerances: Floats
    scales: Floats
    rapid: Mask
    groups: Ints
    broken: Mask

    @property
    def joined(self) -> Mask:
        """Whether (m - 1,) a block and the next can go without a stop: both feeds or both rapids, no word between."""
        joined: Mask = ~self.broken[:-1] & (self.rapid[1:] == self.rapid[:-1])
        return joined


@dataclass(frozen=True, eq=False)
class Passing(Frozen):
    """How the control passes the blocks of a chain.

    Attributes:
        speeds: (m,) greatest path speed.
        accelerations: (m,) path acceleration of each block's ramps.
        caps: (m,) greatest path speed at each block's end; 0 for a stop or a blend.
        onsets: (m,) path speed below which a braking block lets the next begin; 0 where none may.
        pauses: (m,) seconds that a stop at the end costs beyond the ramps.
        rounding: (m,) seconds within which a corner that is passed at speed turns, 0 where it is straight or an arc.
        easing: (m,) seconds of these, at either end, in which the acceleration sets in and fades.
        trims: (m,) path units on either side of a corner that an arc replaces, 0 where there is none.
        arcs: (m,) path units of that arc, on which the speed is constant.
    """

    speeds: Floats
    accelerations: Floats
    caps: Floats
    onsets: Floats
    pauses: Floats
    rounding: Floats
    easing: Floats
    trims: Floats
    arcs: Floats


def passing(chain: Chain, rule: Rule) -> Passing:
    """Return how a control passes a chain of at least one block."""
    if rule.corner == "linuxcnc":
        return _linuxcnc(chain, rule)
    nothing = np.zeros(len(chain.lengths))
    caps = rounding = easing = nothing
    if rule.corner == "look_ahead":
        turning = Turning.of(chain)
        caps = _looked_ahead(chain, turning)
        rounding, easing = _turning_times(turning, caps)
    return Passing(chain.speeds, chain.accelerations, caps, nothing, nothing, rounding, easing, nothing, nothing)


def greatest(changes: Floats, units: Floats) -> Floats:
    """Return the greatest (m,) of changes (m, k) of axes either way, in units (k,) of their own; 0 without axes."""
    found = np.zeros(len(changes))
    for axis, unit in enumerate(units.tolist()):
        np.maximum(found, np.abs(changes[:, axis]) / unit, out=found)
    return found


@dataclass(frozen=True, eq=False)
class Turning(Frozen):
    """What the corners between the blocks of a chain ask of its axes, at a path unit/s.

    Attributes:
        slowest: (m - 1,) seconds of the turn by the axes' accelerations.
        eased: (m - 1,) the square of those by their jerks.
        widest: (m - 1,) greatest change of an axis's speed, m/s; a degree counts as a millimetre.
    """

    slowest: Floats
    eased: Floats
    widest: Floats

    @staticmethod
    def of(chain: Chain) -> Turning:
        """Return the turning of a chain's corners, one axis after the other: no array holds all of them."""
        slowest, eased, widest = np.zeros((3, len(chain.lengths) - 1))
        axes = zip(chain.begins.T, chain.ends.T, chain.axes, chain.jerks, chain.scales, strict=True)
        for begins, ends, acceleration, jerk, scale in axes:
            turns = np.abs(begins[1:] - ends[:-1])
            np.maximum(slowest, turns / acceleration, out=slowest)
            np.maximum(widest, turns / scale, out=widest)
            if np.isfinite(jerk):
                np.maximum(eased, np.where(turns > ROUNDING, turns, 0.0) / jerk, out=eased)
        return Turning(slowest, eased, widest)


def _turning_times(turning: Turning, caps: Floats) -> tuple[Floats, Floats]:
    """Return the seconds (m,) in which the corners at blocks' ends turn, and those of their easing.

    The acceleration sets in over the easing, stays, and fades over the easing; without limits of jerk it is there at
    once. A turn so slight that its axes need not reach their acceleration has nothing but easing.

    Args:
        turning: of its corners.
        caps: (m,) path speed at each block's end.
    """
    speeds = caps[:-1]
    squares = turning.eased * speeds
    even = np.maximum(turning.slowest * speeds, np.sqrt(squares))
    easing = np.divide(squares, even, out=np.zeros(len(speeds)), where=even > 0.0)
    return np.append(even + easing, 0.0), np.append(easing, 0.0)


def _looked_ahead(chain: Chain, turning: Turning) -> Floats:
    """Return the greatest path speed (m,) at each block's end.

    A corner is rounded by a parabola: it turns in the time that its axes need, stays within the tolerance in every
    axis (a millimetre counts as a degree), and takes no more than half of either block. Limits of jerk make the turn
    longer by its easing, and the parabola of the whole time is the widest that it can be.

    Args:
        chain: the moving blocks.
        turning: of its corners.
    """
    slowest, eased, widest = turning.slowest, turning.eased, turning.widest
    room = np.minimum(chain.lengths[1:], chain.lengths[:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        rounded = np.where(widest > 0.0, 8.0 * chain.tolerances[:-1] / widest, math.inf)
        squares = np.where(slowest > 0.0, np.minimum(rounded, room) / slowest, math.inf)
        caps = np.append(np.sqrt(squares), 0.0)
        # The time of the turn is v s + e / s at speed v, or without even acceleration 2 sqrt(v e).
        longer = np.sqrt(squares + (eased / slowest**2 / 2.0) ** 2) - eased / slowest**2 / 2.0
        slight = np.cbrt((squares * slowest) ** 2 / (4.0 * eased))
        caps[:-1] = np.where(eased > 0.0, np.where(longer * slowest**2 >= eased, longer, slight), caps[:-1])
    passed = chain.joined & (chain.tolerances[:-1] > 0.0) & (chain.groups[1:] == chain.groups[:-1])
    caps[:-1] = np.where(passed, np.minimum(caps[:-1], np.minimum(chain.speeds[:-1], chain.speeds[1:])), 0.0)
    return caps


def _linuxcnc(chain: Chain, rule: Rule) -> Passing:
    """Return LinuxCNC's way of passing blocks (its trajectory planner, 2.9).

    Where a rotary axis or U, V, W moves, a block ends in a full stop, or in a parabolic blend at half its acceleration.
    Where only X, Y, Z move, a corner is also passed at speed if it is straight enough, and its kink is taken off the
    acceleration of both blocks; or on an arc within the tolerance.
    """
    leaving, entering = _units(chain.ends[:-1, chain.xyz]), _units(chain.begins[1:, chain.xyz])
    others = np.any(np.delete(chain.shares, chain.xyz, axis=1) != 0.0, axis=1)
    blended = chain.tolerances > 0.0
    speeds = np.minimum(chain.speeds, chain.lengths / rule.cycle)
    tops = np.minimum(chain.tops, chain.lengths / rule.cycle)
    cosines = np.sum(leaving * entering, axis=1)
    half = np.cos(np.arccos(np.clip(-cosines, -1.0, 1.0)) / 2.0)
    reached = np.minimum(speeds[:-1], speeds[1:])
    swing = np.abs(entering - leaving) * (reached / rule.cycle + chain.accelerations[1:])[:, None]
    kinks = np.max(swing / chain.axes[list(chain.xyz)], axis=1, initial=0.0)
    plain, reversed_ = ~others[:-1] & ~others[1:], cosines < -REVERSAL
    kinked = chain.joined & plain & ~reversed_
    tangent, share, corner, radii = _passed(chain, kinked, blended[:-1], kinks, half, speeds, rule)
    parabolic = chain.joined & blended[:-1] & ~tangent & ~(plain & reversed_)
    ends = np.append(parabolic | (chain.broken[:-1] & blended[:-1]), blended[-1:])
    # Where only X, Y, Z move, a blend halves the acceleration of the next block, too.
    halved = ends | np.append(False, parabolic & plain)
    shares = np.maximum(np.append(share, 0.0), np.append(0.0, share))
    accelerations = chain.accelerations * (1.0 - shares) * np.where(halved, 0.5, 1.0)
    followed = np.append(False, tangent)
    tops = np.where(followed, np.minimum(tops, chain.lengths / (OVER_A_CYCLE * rule.cycle)), tops)
    speeds = np.minimum(speeds, tops)
    caps = np.zeros(len(speeds))
    caps[:-1] = np.where(tangent, np.minimum(np.minimum(tops[:-1], tops[1:]), corner), 0.0)
    onsets = np.zeros(len(speeds))
    trims = np.append(radii * half / np.sqrt(np.maximum(1.0 - half**2, 1e-12)), 0.0)
    arcs = np.append(radii * 2.0 * np.arcsin(half), 0.0)
    lengths = chain.lengths - trims - np.append(0.0, trims[:-1])
    blends = _onsets(lengths, speeds, accelerations, chain.tolerances, half, rule.cycle)
    onsets[:-1] = np.where(parabolic, blends, 0.0)
    # A full stop ends on a servo cycle: half a cycle on average.
    stops = np.append(~tangent & ~parabolic, True)
    pauses = np.where(stops, rule.cycle / 2.0, 0.0)
    nothing = np.zeros(len(speeds))
    return Passing(speeds, accelerations, caps, onsets, pauses, nothing, nothing, trims, arcs)


def _units(xyz: Floats) -> Floats:
    """Return the directions (m, 3) of changes (m, 3) of X, Y, Z; those without any all count as the same."""
    lengths = np.linalg.norm(xyz, axis=1, keepdims=True)
    units: Floats = np.where(lengths > 0.0, xyz / np.where(lengths > 0.0, lengths, 1.0), np.eye(1, xyz.shape[1]))
    return units


def _passed(
    chain: Chain, plain: Mask, blended: Mask, kinks: Floats, half: Floats, speeds: Floats, rule: Rule
) -> tuple[Mask, Floats, Floats, Floats]:
    """Return which corners (m - 1,) LinuxCNC passes at speed.

    Args:
        chain: the moving blocks.
        plain: (m - 1,) whether a corner can be passed at speed at all.
        blended: (m - 1,) whether it may be rounded off.
        kinks: (m - 1,) its kink as a share of the acceleration.
        half: (m - 1,) cosine of half the angle between the blocks.
        speeds: (m,) greatest path speed of each block.
        rule: of the control.

    Returns:
        (m - 1,) which are passed at speed, the share of acceleration that costs, the speed there, and the radius of the
        arc in path units, 0 where there is none.
    """
    reached = np.minimum(speeds[:-1], speeds[1:])
    smooth = plain & (kinks < rule.kink)
    kinked = reached * rule.kink / np.where(kinks > 0.0, kinks, 1.0)
    sines = np.sin(np.arccos(half))
    tolerances = chain.tolerances[:-1]
    shorter = np.minimum(chain.lengths[:-1], chain.lengths[1:]) / 2.0
    reach = np.minimum(tolerances * half / np.maximum(1.0 - sines, 1e-12), shorter)
    weaker = np.minimum(chain.accelerations[:-1], chain.accelerations[1:])
    widest = reach * sines / np.maximum(half, 1e-9)
    arc = np.sqrt(weaker * ARC_SHARE * widest)
    peaks = np.sqrt(chain.accelerations / 2.0 * chain.lengths)
    rounded = 2.0 * np.sqrt(chain.accelerations[:-1] / 2.0 * tolerances / np.maximum(half, 1e-9))
    parabola = sines * np.minimum(np.minimum(peaks[:-1], peaks[1:]), np.minimum(reached, rounded)) / 2.0
    arced = plain & ~smooth & blended & (np.maximum(kinked, arc) > parabola)
    curved = arced & (arc > kinked)
    share = np.where(smooth, kinks, np.where(plain & (arced | ~blended) & ~curved, rule.kink, 0.0))
    # The arc is no wider than its speed asks, or than a parabolic blend would reach.
    planned = np.minimum(arc, np.maximum(speeds[:-1], speeds[1:]))
    turned = 2.0 * np.arcsin(np.minimum(half, 1.0))
    blend = np.minimum(np.sqrt(weaker * reach), planned) * planned * 2.0 / weaker / np.maximum(turned, 1e-9)
    radii = np.where(curved, np.maximum(planned**2 / (weaker * ARC_SHARE), np.minimum(blend, widest)), 0.0)
    return smooth | arced, share, np.where(smooth, reached, np.minimum(np.maximum(kinked, arc), reached)), radii


def _onsets(
    lengths: Floats, speeds: Floats, accelerations: Floats, tolerances: Floats, half: Floats, cycle: float
) -> Floats:
    """Return the path speed (m - 1,) below which a braking block lets the next one begin."""
    lengths = np.maximum(lengths, NO_LENGTH)
    triangles = np.sqrt(accelerations * lengths)
    peaks = np.minimum(triangles, speeds)
    first, second = peaks[:-1], peaks[1:]
    longest = np.minimum(lengths[:-1] / first, lengths[1:] / second)
    span = np.minimum(longest, np.maximum(first / accelerations[:-1], second / accelerations[1:]))
    onsets = np.minimum(first, span * accelerations[:-1])
    rounded = 2.0 * np.sqrt(accelerations[:-1] * tolerances[:-1] / np.where(half > 0.0, half, 1.0))
    bounded = half > math.cos(math.pi / 2.0 - 1e-3)
    onsets = np.where(bounded, np.minimum(onsets, rounded), onsets)
    # The cycle in which the speed falls below it is the first of the next block, half a cycle early on average; at the
    # peak of a block that never reaches its speed, the fall is seen half a cycle late, too.
    overlaps = onsets / accelerations[:-1]
    spans = peaks / accelerations + np.maximum(lengths / peaks, peaks / accelerations)
    room = np.maximum(spans - np.append(0.0, overlaps) - np.append(overlaps, 0.0), 0.0) / 2.0
    seen = (onsets < first * (1.0 - ROUNDING)) | (speeds[:-1] < triangles[:-1] * (1.0 - ROUNDING))
    early = np.where(seen, np.minimum(cycle / 2.0, np.minimum(room[:-1], room[1:])), 0.0)
    earlier: Floats = onsets + accelerations[:-1] * early
    return earlier
