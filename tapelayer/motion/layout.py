"""Layout: where the blocks along a path end, so that they are as long and as even as tolerances allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.vectors import ramp

# Where blocks are off, the whole path is laid out at most this often, then only the stretches around them.
LAYOUTS = 6
# A block that is off is made shorter than its excess asks by this share, so that one round mostly does.
MARGIN = 1.02
# Blocks per metre where nothing bends, so that they are of one length.
LEAST_LOAD = 1e-9
# A block that is off is made shorter together with so many on each side, each less than the one before it: blocks whose
# ends stand off the path as far as their middles bear no much shorter neighbour.
GIVING_WAY = 5
SHORTEST_BLOCK = 1e-6


@dataclass(frozen=True, eq=False)
class BlockLayout(Frozen):
    """Block ends along a path.

    Attributes:
        ends: (n,) metres along the path, rising.
        faulty: metres along the path where no block is short enough to keep the tolerances; None where all do.
    """

    ends: Floats
    faulty: float | None = None


def even_blocks(knots: Floats, load: Floats, stops: Floats, excess: Callable[[Floats], Floats]) -> BlockLayout:
    """Return block ends that share a load evenly between stops, with more blocks where their excess is above 1.

    The excess of a block is taken to grow with the square of its length, as that of a chord does.

    Args:
        knots: (n,) metres along the path.
        load: (n - 1,) blocks per metre between the knots, as a first guess.
        stops: (m,) metres, rising: ends that are given, the path's own among them.
        excess: gives, for (b,) ends, the deviation of each block (b - 1,) as a share of what is allowed; it depends on
            the block's ends and on the next ends on both sides, and on nothing else.
    """
    load = load + LEAST_LOAD
    ends = _laid_out(knots, load, stops)
    over = excess(ends)
    for _ in range(LAYOUTS - 1):
        if np.all(over <= 1.0) or not np.all(np.isfinite(over)):
            break
        load = np.maximum(load, _needed(knots, ends, np.where(over > 1.0, np.sqrt(over) * MARGIN, 0.0)))
        ends = _laid_out(knots, load, stops)
        over = excess(ends)
    while np.any(off := ~(over <= 1.0)):
        short = off & (np.diff(ends) < SHORTEST_BLOCK)
        if np.any(short):
            return BlockLayout(ends, float(ends[np.argmax(short)]))
        closer = _closer(ends, stops, over)
        ends, over = closer, _judged_again(closer, ends, over, excess)
    return BlockLayout(ends)


def _laid_out(knots: Floats, load: Floats, stops: Floats) -> Floats:
    """Return block ends that share the load evenly between each of the stops and the next; arguments as above."""
    carried = np.append(0.0, np.cumsum(load * np.diff(knots)))
    pieces = np.maximum(np.ceil(np.diff(np.interp(stops, knots, carried)) - 1e-6), 1.0)
    return _divided(knots, carried, stops, pieces.astype(np.int64))


def _divided(knots: Floats, carried: Floats, stops: Floats, pieces: Ints) -> Floats:
    """Return block ends that divide what is carried up to knots (n,) evenly, in (m - 1,) pieces from stop to stop."""
    at = np.interp(stops, knots, carried)
    gap, number = ramp(pieces)
    ends = np.interp(at[gap] + np.diff(at)[gap] * number / pieces[gap], carried, knots)
    ends[number == 0] = stops[:-1]
    return np.append(ends, stops[-1])


def _needed(knots: Floats, ends: Floats, factors: Floats) -> Floats:
    """Return the load (n - 1,) between knots (n,) of blocks (m,) `ends` shortened by factors (m - 1,); 0 where by 0."""
    needed = factors / np.diff(ends)
    middles = (knots[1:] + knots[:-1]) / 2.0
    load = needed[np.clip(np.searchsorted(ends, middles) - 1, 0, len(needed) - 1)]
    at = np.clip(np.searchsorted(knots, (ends[1:] + ends[:-1]) / 2.0) - 1, 0, len(load) - 1)
    np.maximum.at(load, at, needed)
    return load


def _closer(ends: Floats, stops: Floats, over: Floats) -> Floats:
    """Return the block ends (n,) with more and shorter blocks around each whose excess (n - 1,) is above 1."""
    off = ~(over <= 1.0)
    needed = np.sqrt(np.nan_to_num(over, nan=np.inf)) * MARGIN - 1.0
    # The least that one block and those beside it give way makes room for one more.
    shares = 1.0 - np.abs(np.arange(1 - GIVING_WAY, GIVING_WAY)) / GIVING_WAY
    padded = np.pad(np.where(off, np.clip(needed, 1.0 / GIVING_WAY, 1.0), 0.0), GIVING_WAY - 1)
    more = np.max(np.lib.stride_tricks.sliding_window_view(padded, len(shares)) * shares, axis=1)
    inner = (more[:-1] > 0.0) & (more[1:] > 0.0) & ~np.isin(ends[1:-1], stops)
    kept = np.flatnonzero(np.concatenate([[True], ~inner, [True]]))
    added = np.maximum(np.rint(np.add.reduceat(more, kept[:-1])), np.logical_or.reduceat(off, kept[:-1]))
    carried = np.append(0.0, np.cumsum(1.0 + more))
    return _divided(ends, carried, ends[kept], np.diff(kept) + added.astype(np.int64))


def _judged_again(ends: Floats, before: Floats, over: Floats, excess: Callable[[Floats], Floats]) -> Floats:
    """Return the excess of each block (n - 1,), known for those before (m - 1,) and judged where an end is new."""
    new = ~np.isin(ends, before)
    beside = _spread(new)
    judged = beside[1:] | beside[:-1]
    seen = _spread(_spread(beside))
    known: Floats = over[np.minimum(np.searchsorted(before, ends[:-1]), len(over) - 1)]
    known[judged] = excess(ends[seen])[np.cumsum(seen)[:-1][judged] - 1]
    return known


def _spread(marked: Mask) -> Mask:
    """Return where the mark (n,), the one before or the one after is set."""
    wider = marked.copy()
    wider[1:] |= marked[:-1]
    wider[:-1] |= marked[1:]
    return wider
