"""Envelope: the parts of a section or a surface that are visible from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.slicing import Sections, plane_direction, plane_heights, slice, strip_widths
from tapelayer.vectors import ramp


@dataclass(frozen=True)
class Areas:
    """The area of a mesh by what a gun above it can reach; the three add up to the whole, in square metres.

    Attributes:
        seen: met first by a vertical ray from above.
        too_steep: too steep for a gun from above.
        hidden: below another part of the surface.
    """

    seen: float
    too_steep: float
    hidden: float


def upper_envelope(mesh: Mesh, sections: Sections, min_normal_z: float) -> Sections:
    """Return the parts of vertical sections that are visible from above, as successive curves along direction x z.

    Facets steeper than `min_normal_z` hide those below them and are themselves left out. A curve ends where the next
    piece does not begin on its last point: at an edge of the surface, at a step, or below the border of a part above.

    Args:
        mesh: the surface.
        sections: its sections with planes whose direction is level.
        min_normal_z: least |nz| of a facet to be sprayed, above 0.

    Raises:
        ValueError: the planes are not vertical.

    Examples:
        >>> from tapelayer.geometry.mending import Mending
        >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
        >>> sections = slice(mesh, plane_direction(0.0), np.array([0.25]))
        >>> seen = upper_envelope(mesh, sections, min_normal_z=0.1)
        >>> seen.points[seen.offsets[:-1]].tolist(), float(seen.lengths.sum())
        ([[0.0, 0.25, 0.0]], 1.0)
    """
    if sections.direction[2] != 0.0:
        raise ValueError(f"expected vertical planes, got the direction {sections.direction}")
    along = np.array([sections.direction[1], -sections.direction[0], 0.0])
    pieces = _monotone_pieces(sections, along)
    while np.any(pieces["layer"] > 0):
        pieces = _merged_layers(pieces)
    pieces = pieces[np.abs(mesh.normals[pieces["facet"], 2]) >= min_normal_z]

    joined = np.zeros(len(pieces), dtype=np.bool_)
    joined[1:] = (
        (pieces["plane"][1:] == pieces["plane"][:-1])
        & (pieces["x0"][1:] == pieces["x1"][:-1])
        & (pieces["z0"][1:] == pieces["z1"][:-1])
    )
    first = np.flatnonzero(~joined)
    offsets = np.append(first + np.arange(len(first)), len(pieces) + len(first))
    ends = offsets[1:] - 1
    begins = np.ones(offsets[-1], dtype=np.bool_)
    begins[ends] = False
    piece = np.cumsum(begins) - 1
    x = np.where(begins, pieces["x0"][piece], pieces["x1"][piece])
    z = np.where(begins, pieces["z0"][piece], pieces["z1"][piece])
    height = sections.heights[pieces["plane"][piece]]
    return Sections(
        direction=sections.direction,
        heights=sections.heights,
        points=x[:, None] * along + height[:, None] * sections.direction + z[:, None] * np.array([0.0, 0.0, 1.0]),
        facets=pieces["facet"][piece],
        offsets=offsets,
        planes=pieces["plane"][first],
        closed=np.zeros(len(first), dtype=np.bool_),
    )


def areas_from_above(mesh: Mesh, travel: float, spacing: float, min_normal_z: float) -> Areas:
    """Return the areas of a surface as a gun above it sees them: too steep exactly, seen and hidden by strips.

    Args:
        mesh: the surface.
        travel: direction of the strips, radians from +x towards +y.
        spacing: width of the strips in metres; the visible part is exact within each strip's middle plane.
        min_normal_z: least |nz| of a facet to be sprayed, above 0.

    Examples:
        >>> from tapelayer.geometry.mending import Mending
        >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
        >>> areas_from_above(mesh, travel=0.0, spacing=0.1, min_normal_z=0.1)
        Areas(seen=1.0, too_steep=0.0, hidden=0.0)
    """
    steep = np.abs(mesh.normals[:, 2]) < min_normal_z
    too_steep, rest = float(np.sum(mesh.areas[steep])), float(np.sum(mesh.areas[~steep]))
    direction = plane_direction(travel)
    sections = slice(mesh, direction, plane_heights(mesh, direction, spacing))
    widths = np.zeros(len(steep))
    widths[~steep] = strip_widths(mesh.normals[~steep], direction, spacing)
    envelope = upper_envelope(mesh, sections, min_normal_z)
    cut, seen = (float(curves.lengths @ widths[curves.facets[curves.segments]]) for curves in (sections, envelope))
    share = min(seen / cut, 1.0) if cut else 0.0
    return Areas(seen=rest * share, too_steep=too_steep, hidden=rest - rest * share)


_PIECE = np.dtype(
    [("plane", "i8"), ("layer", "i8"), ("x0", "f8"), ("z0", "f8"), ("x1", "f8"), ("z1", "f8"), ("facet", "i8")]
)
Pieces = NDArray[np.void]


def _monotone_pieces(sections: Sections, along: Floats) -> Pieces:
    """Return segments as pieces from x0 to x1 > x0 along a level direction, layer by layer and from left to right.

    A layer is part of a curve that runs in one direction only, so that no piece of it lies above another. Upright
    segments are invisible from above.
    """
    x = sections.points[:, 0] * along[0] + sections.points[:, 1] * along[1]
    z = sections.points[:, 2]
    rows = sections.segments
    rows = rows[x[rows + 1] != x[rows]]
    forward = x[rows + 1] > x[rows]
    left, right = np.where(forward, rows, rows + 1), np.where(forward, rows + 1, rows)
    new = np.ones(len(rows), dtype=np.bool_)
    # The last row of a curve, which begins no segment, separates it from the next.
    new[1:] = (np.diff(rows) != 1) | (forward[1:] != forward[:-1])
    layer = np.cumsum(new) - 1
    plane = np.repeat(sections.planes, np.diff(sections.offsets))[rows]
    pieces = np.empty(len(rows), dtype=_PIECE)
    pieces["plane"], pieces["facet"] = plane, sections.facets[rows]
    pieces["layer"] = layer - layer[np.searchsorted(plane, plane)]
    pieces["x0"], pieces["z0"], pieces["x1"], pieces["z1"] = x[left], z[left], x[right], z[right]
    ordered: Pieces = pieces[np.lexsort((pieces["x0"], layer))]
    return ordered


def _merged_layers(pieces: Pieces) -> Pieces:
    """Merge each two layers of a plane into their upper envelope, for all planes at once, halving the layers.

    Between neighbouring ends of pieces, each of the two layers is one piece or empty; where two cross, both are cut.
    """
    layer = pieces["layer"] // 2
    group = np.cumsum(np.append([False], (np.diff(pieces["plane"]) != 0) | (np.diff(layer) != 0)))
    xs, groups = np.concatenate([pieces["x0"], pieces["x1"]]), np.concatenate([group, group])
    order = np.lexsort((xs, groups))
    new = np.append([True], (np.diff(xs[order]) != 0) | (np.diff(groups[order]) != 0))
    knots = xs[order[new]]
    knot = np.empty(len(order), dtype=np.int64)
    knot[order] = np.cumsum(new) - 1

    # Interval i is from knot i to knot i + 1.
    begin, end = knot[: len(pieces)], knot[len(pieces) :]
    spans = end - begin
    piece, number = ramp(spans)
    interval = begin[piece] + number
    side = pieces["layer"][piece] % 2
    on = np.full((2, len(knots)), -1)
    on[side, interval] = piece
    left, right = np.full((2, len(knots)), -np.inf), np.full((2, len(knots)), -np.inf)
    left[side, interval] = _altitudes(pieces[piece], knots[interval])
    right[side, interval] = _altitudes(pieces[piece], knots[interval + 1])

    used = np.flatnonzero(np.any(on >= 0, axis=0))
    on, left, right = on[:, used], left[:, used], right[:, used]
    x0, x1 = knots[used], knots[used + 1]
    lead, trail = left[0] - left[1], right[0] - right[1]
    crossing = np.flatnonzero(((lead > 0) & (trail < 0)) | ((lead < 0) & (trail > 0)))
    share = lead[crossing] / (lead[crossing] - trail[crossing])
    cut_x, cut_z = np.full(len(used), np.nan), np.full(len(used), np.nan)
    cut_x[crossing] = x0[crossing] + share * (x1[crossing] - x0[crossing])
    cut_z[crossing] = left[0, crossing] + share * (right[0, crossing] - left[0, crossing])
    cut = (cut_x > x0) & (cut_x < x1)
    upper = np.where(cut, lead < 0, lead + trail < 0).astype(np.int64)

    source = np.repeat(np.arange(len(used)), 1 + cut)
    behind = np.append([False], source[1:] == source[:-1])  # the part after the crossing
    before = cut[source] & ~behind
    top = np.where(behind, 1 - upper[source], upper[source])
    piece = on[top, source]
    first = np.flatnonzero(np.append([True], piece[1:] != piece[:-1]))
    last = np.append(first[1:], len(piece)) - 1
    merged: Pieces = pieces[piece[first]]
    merged["layer"] //= 2
    merged["x0"] = np.where(behind, cut_x[source], x0[source])[first]
    merged["z0"] = np.where(behind, cut_z[source], left[top, source])[first]
    merged["x1"] = np.where(before, cut_x[source], x1[source])[last]
    merged["z1"] = np.where(before, cut_z[source], right[top, source])[last]
    return merged


def _altitudes(pieces: Pieces, x: Floats) -> Floats:
    """Return the height z (k,) of each piece (k,) at x (k,), in metres; exact to the last bit at its ends."""
    share = (x - pieces["x0"]) / (pieces["x1"] - pieces["x0"])
    altitudes: Floats = (1.0 - share) * pieces["z0"] + share * pieces["z1"]
    return altitudes
