"""Layout: where the blocks along a path end, so that they are as long and as even as tolerances allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Frozen, Mask
from tapelayer.vectors import ramp

# Where blocks are off, the layout is made this often with more of them, then they are split.
LAYOUTS = 8
# A block that is off is made shorter than its excess asks by this share, so that one round mostly does.
MARGIN = 1.02
# Blocks per metre where nothing bends, so that they are of one length.
LEAST_LOAD = 1e-9
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
        excess: gives, for (b,) ends, the deviation of each block (b - 1,) as a share of what is allowed.
    """
    load = load + LEAST_LOAD
    ends = _laid_out(knots, load, stops)
    layouts = 1
    while True:
        over = excess(ends)
        off = ~(over <= 1.0)
        if not np.any(off):
            return BlockLayout(ends)
        if layouts < LAYOUTS and np.all(np.isfinite(over)):
            load = np.maximum(load, _needed(knots, ends, np.where(off, np.sqrt(over) * MARGIN, 0.0)))
            ends = _laid_out(knots, load, stops)
            layouts += 1
            continue
        short = off & (np.diff(ends) < SHORTEST_BLOCK)
        if np.any(short):
            return BlockLayout(ends, float(ends[np.argmax(short)]))
        ends = _split(ends, off)


def _laid_out(knots: Floats, load: Floats, stops: Floats) -> Floats:
    """Return block ends that share the load evenly between each of the stops and the next; arguments as above."""
    carried = np.append(0.0, np.cumsum(load * np.diff(knots)))
    at = np.interp(stops, knots, carried)
    pieces = np.maximum(np.ceil(np.diff(at) - 1e-6), 1.0).astype(np.int64)
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


def _split(ends: Floats, off: Mask) -> Floats:
    """Return block ends with each block in `off` split in its middle."""
    return np.sort(np.append(ends, (ends[:-1][off] + ends[1:][off]) / 2.0))
