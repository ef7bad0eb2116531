"""Family: the strips of a ply, each beside the one before, with gaps as near to the nominal as the surface allows.

A strip beside another has two unknowns: its distance from the other's reference sample, and a turn there. What they do
to the gap along the other's edge is, to first order, given by its two Jacobi fields; a linear programme chooses them,
the strip is traced again, and so on until it stays where it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.errors import NoNaturalPaths
from tapelayer.geometry.geodesics import jacobi, trace, turned
from tapelayer.geometry.height_field import HeightField
from tapelayer.plies.reach import Reach
from tapelayer.plies.strip import LEFT, RIGHT, Side, Strip, strip_through
from tapelayer.progress import Tick, silent
from tapelayer.units import MM

# A neighbour that would still be moved by less than this, in metres, stays.
SETTLED = 1e-8
MOST_ROUNDS = 12
# Steps of the lateral geodesic from a strip's centre line to its neighbour's.
STEPS_ASIDE = 12
# Rounds of Newton's method from an edge to the facing one.
GAP_ROUNDS = 6
# Samples that a linear programme begins with, and by how many millimetres its solution may break the others.
FIRST_SAMPLES = 17
BROKEN = 1e-9
# Gaps are looked at up to this far beyond the ply, metres.
BEYOND = 10.0 * MM
# A strip that covers less of the ply's breadth than this, in metres, is left out where the gap allows it.
LEAST_BREADTH = 1.0 * MM
# A neighbour is at least this share of the width away.
LEAST_ASIDE = 0.5


@dataclass(frozen=True)
class GapLimits:
    """What gaps between neighbours are to be, in metres; negative is overlap.

    Attributes:
        least: least allowed.
        nominal: aimed at.
        largest: largest allowed.
    """

    least: float
    nominal: float
    largest: float


@dataclass(frozen=True, eq=False)
class Gap(Frozen):
    """The gap between two neighbours, along the edge of one of them.

    Attributes:
        plan: (n, 2) plan points of that edge.
        widths: (n,) metres along the lateral geodesics of that strip to the facing edge, negative for overlap; NaN
            where the edge is outside the ply or the other strip has no edge.
    """

    plan: Floats
    widths: Floats

    @property
    def known(self) -> Mask:
        """Samples (n,) that have a gap."""
        known: Mask = np.isfinite(self.widths)
        return known


@dataclass(frozen=True, eq=False)
class Family(Frozen):
    """The strips of a ply.

    Attributes:
        strips: from right to left.
        gaps: between each strip and the next, one less than the strips.
        reference: index of the strip through the seed.
        breadths: (2,) metres of the ply's breadth that the rightmost and the leftmost strip cover.
        left_out: metres of breadth left uncovered on the right and on the left, 0 where none.
    """

    strips: tuple[Strip, ...]
    gaps: tuple[Gap, ...]
    reference: int
    breadths: Floats
    left_out: Floats


def family_of(
    field: HeightField,
    outline: shapely.Polygon,
    seed: Floats,
    reach: Reach,
    limits: GapLimits,
    width: float,
    step: float,
    tick: Tick = silent,
) -> Family:
    """Return the strips that fill a ply, from the one through the seed to both sides.

    Args:
        field: the surface.
        outline: of what is to be covered, in plan.
        seed: state (4,) of the strip through the seed.
        reach: where strips are traced.
        limits: of the gaps.
        width: of the tape, metres.
        step: between samples, metres.
        tick: called for every strip.
    """
    first = strip_through(field, seed, reach, width, step)
    tick()
    near = outline.buffer(BEYOND)
    shapely.prepare(near)
    sides: dict[Side, list[tuple[Strip, Gap]]] = {}
    breadths, left_out = [], []
    for side in (RIGHT, LEFT):
        sides[side] = []
        breadth, missing = width, 0.0
        for neighbour, gap in _neighbours(field, near, first, side, reach, limits, step):
            covered = _breadth(neighbour, outline, side)
            if covered <= 0.0:
                break
            if covered < LEAST_BREADTH and np.nanmax(gap.widths, initial=0.0) + covered <= limits.largest:
                missing = covered
                break
            sides[side].append((neighbour, gap))
            breadth = covered
            tick()
        breadths.append(breadth)
        left_out.append(missing)
    right, left = sides[RIGHT][::-1], sides[LEFT]
    return Family(
        strips=(*(strip for strip, _ in right), first, *(strip for strip, _ in left)),
        gaps=(*(gap for _, gap in right), *(gap for _, gap in left)),
        reference=len(right),
        breadths=np.array(breadths),
        left_out=np.array(left_out),
    )


def _breadth(strip: Strip, outline: shapely.Polygon, side: Side) -> float:
    """Return how much of the ply's breadth a strip at its side covers, metres; 0 where it does not meet the ply."""
    met = strip.polygon().intersection(outline)
    if met.area <= 0.0:
        return 0.0
    _, across = strip.coordinates(shapely.get_coordinates(met))
    return float(np.max(side * across)) + strip.width / 2.0


def _neighbours(
    field: HeightField,
    near: shapely.Polygon,
    first: Strip,
    side: Side,
    reach: Reach,
    limits: GapLimits,
    step: float,
) -> Iterator[tuple[Strip, Gap]]:
    """Yield the strips on a side, each with its gap to the one before, while that one's edge is in the ply.

    Raises:
        NoNaturalPaths: so many do not cross the ply.
    """
    strip, aside = first, first.width + limits.nominal
    most = int(np.hypot(*(reach.upper - reach.lower)) / (LEAST_ASIDE * first.width))
    for _ in range(most):
        edge = strip.edge(side)
        inside = shapely.contains_xy(near, edge[:, 0], edge[:, 1])
        if not np.any(inside):
            return
        found = _beside(field, strip, inside, side, reach, limits, aside, step)
        yield found
        strip = found[0]
    middle = strip.states[len(strip.states) // 2, :2]
    raise NoNaturalPaths("courses do not get across the ply, but come together", middle.tolist())


def _beside(
    field: HeightField,
    strip: Strip,
    inside: Mask,
    side: Side,
    reach: Reach,
    limits: GapLimits,
    aside: float,
    step: float,
) -> tuple[Strip, Gap]:
    """Return the neighbour of a strip on a side, and the gap between them along the samples `inside` (n,)."""
    middle = round(float(np.mean(np.flatnonzero(inside))))
    fields = jacobi(field.curvatures(strip.states[:, :2]), strip.arcs, middle)
    turn = 0.0
    length = float(np.ptp(strip.arcs[inside])) + step
    across = turned(field, strip.states[middle][None], side * np.pi / 2.0)[0]
    for _ in range(MOST_ROUNDS):
        out = trace(field, across, np.linspace(0.0, aside, STEPS_ASIDE + 1))[-1:]
        state = turned(field, out, -side * np.pi / 2.0 + side * turn)[0]
        neighbour = strip_through(field, state, reach, strip.width, step)
        widths = np.where(inside, gap_widths(strip, neighbour, side), np.nan)
        known = np.isfinite(widths)
        if not np.any(known):
            break
        moved, turned_by = _best_move(widths[known], fields[:, known], limits, LEAST_ASIDE * strip.width - aside)
        if abs(moved) < SETTLED and abs(turned_by) * length < SETTLED:
            break
        aside, turn = aside + moved, turn + turned_by
    return neighbour, Gap(strip.edge(side)[:, :2], widths)


def gap_widths(strip: Strip, neighbour: Strip, side: Side) -> Floats:
    """Return the gaps (n,) in metres from a strip's edge on a side to the facing edge, along lateral geodesics.

    NaN where the lateral geodesic does not meet the facing edge.
    """
    edge, facing = strip.edge(side), neighbour.edge(-side)
    chord = strip.states[-1, :2] - strip.states[0, :2]
    axes = np.array([chord, [-chord[1], chord[0]]]).T / np.hypot(*chord)
    along, aside = (facing[:, :2] @ axes).T
    rows = _rising(along, int(np.searchsorted(neighbour.arcs, 0.0)))
    if len(rows) < 4:
        return np.full(len(edge), np.nan)
    curve = CubicSpline(along[rows], aside[rows])
    slope = curve.derivative()
    begin, out = (edge[:, :2] @ axes).T, (edge[:, 2:4] @ axes).T
    gaps = np.zeros(len(edge))
    for _ in range(GAP_ROUNDS):
        at = begin[0] + gaps * out[0]
        gaps = gaps - (begin[1] + gaps * out[1] - curve(at)) / (out[1] - slope(at) * out[0])
    at = begin[0] + gaps * out[0]
    met: Floats = np.where((at >= along[rows[0]]) & (at <= along[rows[-1]]), gaps, np.nan)
    return met


def _rising(values: Floats, about: int) -> Ints:
    """Return the indices of the longest run of rising values (n,) about an index."""
    falls = np.flatnonzero(np.diff(values) <= 0.0)
    begin = falls[falls < about][-1:] + 1
    end = falls[falls >= about][:1] + 1
    return np.arange(begin[0] if len(begin) else 0, end[0] if len(end) else len(values))


def _best_move(widths: Floats, fields: Floats, limits: GapLimits, nearest: float) -> tuple[float, float]:
    """Return by how much to move a neighbour away, metres, and to turn it, radians.

    The gaps are brought as near to the nominal as none below the least allows; where no move keeps the least, the
    largest violation of both limits is made least.

    Args:
        widths: (n,) gaps, metres.
        fields: (2, n) Jacobi fields there: what a metre of distance, and a radian of turn, add to the gap.
        limits: of the gaps.
        nearest: least move away, metres.
    """
    scale = max(1.0, float(np.max(np.abs(fields[1]))))
    moves = np.column_stack([fields[0], fields[1] / scale])
    gaps, one, none = widths / MM, np.ones((len(widths), 1)), np.zeros((len(widths), 1))
    least, nominal, largest = limits.least / MM, limits.nominal / MM, limits.largest / MM
    above, below, open_ = (np.hstack(pair) for pair in ((moves, -one), (-moves, -one), (-moves, none)))
    near = np.stack([above, below, open_]), np.stack([nominal - gaps, gaps - nominal, gaps - least])
    within = np.stack([above, below]), np.stack([largest - gaps, gaps - least])
    for rows, bounds in (near, within):
        solution = _least_of_all(rows, bounds, nearest / MM)
        if solution is not None:
            return float(solution[0]) * MM, float(solution[1]) * MM / scale
    return 0.0, 0.0


def _least_of_all(rows: Floats, bounds: Floats, nearest: float) -> Floats | None:
    """Return the x (3,) with the least last number of those with rows @ x <= bounds, and None where there is none.

    Few samples decide it. The programme is solved for some, and for those again that its solution breaks most, until
    it breaks none.

    Args:
        rows: (k, n, 3) of k kinds for each of n samples along a strip.
        bounds: (k, n).
        nearest: least first number.
    """
    count = rows.shape[1]
    chosen = np.zeros(count, dtype=np.bool_)
    chosen[np.linspace(0, count - 1, FIRST_SAMPLES).astype(np.int64)] = True
    while True:
        solved = linprog(
            [0.0, 0.0, 1.0],
            A_ub=rows[:, chosen].reshape(-1, 3),
            b_ub=bounds[:, chosen].ravel(),
            bounds=[(nearest, None), (None, None), (None, None)],
        )
        if solved.x is None:
            return None
        broken = np.max(rows @ solved.x - bounds, axis=0)
        # The worst of each stretch that is broken.
        worst = broken >= np.maximum(np.append(broken[1:], -np.inf), np.append(-np.inf, broken[:-1]))
        further = (broken > BROKEN) & worst & ~chosen
        if not np.any(further):
            found: Floats = solved.x
            return found
        chosen |= further
