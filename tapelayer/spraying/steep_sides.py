"""Flanks: what is so steep across the passes that planes a pitch apart are too far apart on the surface.

A strip between two planes is 1 / |n x d| pitches wide on a facet with the normal n, d being the planes' normal. Where
that is more than a pitch and a half, further planes halve the distance, and halve it again.
"""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.spraying.reach import Segments

# Width of a strip in pitches beyond which a plane is put in its middle.
WIDEST = 1.5
# Times that the distance of planes is halved at most.
HALVINGS = 4


def flank_heights(heights: Floats, pitch: float, extent: tuple[float, float]) -> tuple[Floats, Floats]:
    """Heights (q,) of further planes between planes a pitch apart, and width (q,) of a strip that calls for each.

    Args:
        heights: (p,) of the planes, metres.
        pitch: metres.
        extent: least and greatest height of the surface, metres.
    """
    found, widths = [], []
    firsts = np.append(heights[0] - pitch, heights)
    for halving in range(HALVINGS):
        parts = 2 << halving
        places = (firsts[:, None] + pitch * np.arange(1, parts, 2) / parts).ravel()
        places = places[(places > extent[0]) & (places < extent[1])]
        found.append(places)
        widths.append(np.full(len(places), WIDEST * (1 << halving)))
    order = np.argsort(np.concatenate(found), kind="stable")
    return np.concatenate(found)[order], np.concatenate(widths)[order]


def on_steep_sides(segments: Segments, widths: Floats, least: Floats, gap: float, short: float) -> Segments:
    """The segments on flanks, in chains: with what lies between two of them, and without what is short.

    Args:
        segments: of the further planes.
        widths: (n,) width of a strip on each segment's facet, in pitches.
        least: (n,) width of a strip that calls for each segment's plane.
        gap: a chain goes on over a stretch up to this length that is no flank, metres.
        short: a chain that is shorter is left to the other planes, metres.
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
            # Only between two flanks, not at the surface's edge.
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
