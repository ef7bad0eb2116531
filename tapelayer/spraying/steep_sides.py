"""Steep sides: extra planes where the surface is so steep across the passes that one pitch is too wide on it.

A strip between two planes is 1 / |n x d| pitches wide on a facet with the normal n, where d is the planes' normal.
Where that is more than a pitch and a half, extra planes halve the distance, repeatedly if necessary.
"""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.spraying.reach import Segments

# A strip wider than this many pitches gets a plane in its middle.
WIDEST = 1.5
# How often the distance between planes is halved at most.
HALVINGS = 4


def flank_heights(heights: Floats, pitch: float, extent: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return heights (q,) of extra planes between planes a pitch apart, and the strip width (q,) that calls for each.

    Args:
        heights: (p,) heights of the planes, metres.
        pitch: metres.
        extent: smallest and largest height of the surface, metres.

    Returns:
        Metres and pitches, sorted by height.
    """
    extra, widths = [], []
    firsts = np.append(heights[0] - pitch, heights)
    for halving in range(HALVINGS):
        parts = 2 << halving
        places = (firsts[:, None] + pitch * np.arange(1, parts, 2) / parts).ravel()
        places = places[(places > extent[0]) & (places < extent[1])]
        extra.append(places)
        widths.append(np.full(len(places), WIDEST * (1 << halving)))
    order = np.argsort(np.concatenate(extra), kind="stable")
    return np.concatenate(extra)[order], np.concatenate(widths)[order]


def on_steep_sides(segments: Segments, widths: Floats, least: Floats, gap: float, short: float) -> Segments:
    """Return the segments on steep sides, in chains with short gaps between them filled and short chains dropped.

    Args:
        segments: on the extra planes.
        widths: (n,) width of a strip on each segment's facet, in pitches.
        least: (n,) strip width that calls for each segment's plane, in pitches.
        gap: longest part in metres that is not steep but that a chain continues over.
        short: longest chain in metres that is left to the other planes.
    """
    count = len(segments.planes)
    if not count:
        return segments
    joined = np.zeros(count + 1, dtype=np.bool_)
    joined[1:-1] = (np.diff(segments.planes) == 0) & np.all(segments.begins[1:] == segments.ends[:-1], axis=1)
    chosen = widths > least
    lengths = segments.lengths
    for value, limit in ((False, gap), (True, short)):
        first = np.flatnonzero(~joined[:-1] | np.append(True, chosen[1:] != chosen[:-1]))
        last = np.append(first[1:], count)
        runs = np.add.reduceat(lengths, first)
        turned = (chosen[first] == value) & (runs <= limit)
        if not value:
            # Only between two steep sides, not at the surface's edge.
            turned &= joined[first] & joined[last]
        chosen = np.where(np.repeat(turned, last - first), not value, chosen)
    goes_on = np.column_stack(
        [joined[:-1] & ~np.append(False, chosen[:-1]), joined[1:] & ~np.append(chosen[1:], False)]
    )
    return Segments(
        segments.begins[chosen],
        segments.ends[chosen],
        segments.facets[chosen],
        segments.planes[chosen],
        goes_on[chosen],
    )
