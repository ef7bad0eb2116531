"""Slicing: planes cut a mesh into curves that record the facets they run on.

A vertex on a plane counts as above it. So a facet and a plane give one segment or none, every segment enters through
one edge and leaves through another, and the next segment lies on the neighbour: this needs no tolerance, and a closed
mesh gives closed curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import cosdg, sindg

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.geometry.adjacency import blocks
from tapelayer.geometry.mesh import Mesh

# Corners of a facet at the edges through which its segment enters (down) and leaves (up), by the corners that are above
# the plane: bit c of the index is corner c. So a segment runs along direction x normal.
_ENTRY_ABOVE = np.array([0, 0, 1, 1, 2, 0, 2, 0])
_ENTRY_BELOW = np.array([0, 1, 2, 2, 0, 1, 0, 0])
_EXIT_ABOVE = np.array([0, 0, 1, 0, 2, 2, 1, 0])
_EXIT_BELOW = np.array([0, 2, 0, 2, 1, 1, 0, 0])


@dataclass(frozen=True, eq=False)
class Sections(Frozen):
    """Curves in which parallel planes cut a surface, plane by plane.

    Curve c has the rows offsets[c] to offsets[c + 1]; each row but the curve's last begins a segment. A closed curve
    ends on its first point.

    Attributes:
        direction: (3,) unit normal of the planes.
        heights: (p,) distance of each plane from the origin along `direction`, in metres, not decreasing.
        points: (n, 3) metres, in the frame of the mesh.
        facets: (n,) facet that carries the segment from each point to the next; at a curve's end, the one before. It
            gives the normal: `mesh.normals`, or `mesh.upward_normals` for a gun above.
        offsets: (c + 1,) first row of each curve, and n.
        planes: (c,) index of the plane of each curve, not decreasing.
        closed: (c,) whether the curve is closed.
    """

    direction: Floats
    heights: Floats
    points: Floats
    facets: Ints
    offsets: Ints
    planes: Ints
    closed: Mask

    @property
    def segments(self) -> Ints:
        """Rows (s,) that begin a segment: all but the last of each curve."""
        begins = np.ones(len(self.points), dtype=np.bool_)
        begins[self.offsets[1:] - 1] = False
        return np.flatnonzero(begins)

    @property
    def lengths(self) -> Floats:
        """Length (s,) of each of `segments` in metres.

        Examples:
            >>> from tapelayer.geometry.mending import Mending
            >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
            >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
            >>> slice(mesh, plane_direction(0.0), np.array([0.25])).lengths.tolist()
            [0.25, 0.75]
        """
        rows = self.segments
        lengths: Floats = np.linalg.norm(self.points[rows + 1] - self.points[rows], axis=1)
        return lengths


def plane_direction(travel: float) -> Floats:
    """Return the unit normal (3,) of the vertical planes that contain a travel direction; exact at quarter turns.

    Args:
        travel: radians from +x towards +y, seen from above.

    Examples:
        >>> plane_direction(0.0).tolist(), plane_direction(math.radians(90)).tolist()
        ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0])
    """
    degrees = math.degrees(travel)
    return np.array([-sindg(degrees), cosdg(degrees), 0.0]) + 0.0


def plane_heights(mesh: Mesh, direction: Floats, pitch: float) -> Floats:
    """Return heights (p,) of the fewest planes a pitch apart along a direction that leave at most half a pitch outside.

    Args:
        mesh: the surface.
        direction: (3,) unit normal of the planes.
        pitch: distance from plane to plane in metres.

    Examples:
        >>> from tapelayer.geometry.mending import Mending
        >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
        >>> plane_heights(mesh, plane_direction(0.0), pitch=0.5).tolist()
        [0.25, 0.75]
    """
    heights = mesh.vertices @ direction
    low, high = float(heights.min()), float(heights.max())
    count = max(math.ceil((high - low) / pitch), 1)
    steps = np.arange(count, dtype=np.float64) - (count - 1) / 2
    return (low + high) / 2 + pitch * steps


def slice(mesh: Mesh, direction: Floats, heights: Floats) -> Sections:
    """Cut a mesh with parallel planes into sections, whose segments run along direction x facet normal.

    Segments of zero length, where a plane touches a vertex, are left out.

    Args:
        mesh: the surface.
        direction: (3,) unit normal of the planes.
        heights: (p,) distance of each plane from the origin along `direction`, in metres, not decreasing.

    Raises:
        ValueError: the direction does not have length 1, or the heights are not in order.

    Examples:
        >>> from tapelayer.geometry.mending import Mending
        >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
        >>> sections = slice(mesh, plane_direction(0.0), np.array([0.25]))
        >>> sections.points.tolist(), sections.facets.tolist()
        ([[0.0, 0.25, 0.0], [0.25, 0.25, 0.0], [1.0, 0.25, 0.0]], [1, 0, 0])
    """
    if not abs(float(direction @ direction) - 1.0) <= 1e-12:
        raise ValueError(f"expected a direction of length 1, got {direction}")
    if not (np.all(np.isfinite(heights)) and np.all(np.diff(heights) >= 0)):
        raise ValueError("expected finite heights that do not decrease")
    altitudes = mesh.vertices @ direction
    facets, planes, following, places = _segments(mesh, altitudes, heights)
    segments, offsets, closed = _chained(following, planes)
    ends = offsets[1:] - 1
    last = segments[ends]
    points = np.empty((len(segments), 3))
    for axis, place in enumerate(places):
        points[:, axis] = place.take(segments)
    # A closed curve's end is computed from the same edge as its first point, and is bit-equal to it.
    corners = mesh.facets[facets[last]]
    above = altitudes[corners] >= heights[planes[last], None]
    code = above @ np.array([1, 2, 4])
    curve = np.arange(len(last))
    points[ends] = _crossings(
        mesh.vertices.T,
        altitudes,
        heights[planes[last]],
        below=corners[curve, _EXIT_BELOW[code]],
        above=corners[curve, _EXIT_ABOVE[code]],
    ).T

    moving = _moving(points, offsets)
    sizes = np.diff(np.concatenate([[0], np.cumsum(moving)])[offsets])
    some = sizes > 0
    offsets = np.concatenate([[0], np.cumsum(sizes[some])])
    if not np.all(moving):
        kept = np.flatnonzero(moving)
        points, segments = points.take(kept, axis=0), segments.take(kept)
    on = facets.take(segments)
    on[offsets[1:] - 1] = on[offsets[1:] - 2]
    return Sections(
        direction=np.array(direction),
        heights=np.array(heights),
        points=points,
        facets=on,
        offsets=offsets,
        planes=planes[last][some],
        closed=closed[some],
    )


def strip_widths(normals: Floats, direction: Floats, spacing: float) -> Floats:
    """Return the width (k,) on the surface of the strip between planes, in metres, by facet normal.

    Args:
        normals: (k, 3) unit normals, none along `direction`.
        direction: (3,) unit normal of the planes.
        spacing: distance of the planes in metres.

    Examples:
        >>> flat, steep = [0.0, 0.0, 1.0], [0.0, 0.6, 0.8]
        >>> strip_widths(np.array([flat, steep]), np.array([0.0, 1.0, 0.0]), spacing=0.01).round(6).tolist()
        [0.01, 0.0125]
    """
    widths: Floats = spacing / np.linalg.norm(np.cross(normals, direction), axis=1)
    return widths


def _segments(mesh: Mesh, altitudes: Floats, heights: Floats) -> tuple[Ints, Ints, Ints, Floats]:
    """Return facet, plane and following segment (-1: none) of each segment (s,), by facet, and first points (3, s)."""
    level = np.searchsorted(heights, altitudes, side="right")  # number of planes at or below each vertex
    lowest, counts = np.empty(len(mesh.facets), dtype=np.int64), np.empty(len(mesh.facets), dtype=np.int64)
    for block in blocks(len(counts)):
        a, b, c = level.take(mesh.facets[block].T)
        lowest[block] = np.minimum(np.minimum(a, b), c)
        counts[block] = np.maximum(np.maximum(a, b), c) - lowest[block]
    first = np.concatenate([[0], np.cumsum(counts)])
    shift = first[:-1] - lowest  # the segment of facet f in plane p is shift[f] + p
    facets, planes, following = (np.empty(first[-1], dtype=np.int64) for _ in range(3))
    places = np.empty((3, first[-1]))
    vertices = np.ascontiguousarray(mesh.vertices.T)
    corners, across = mesh.facets.ravel(), mesh.neighbours.ravel()
    for block in blocks(len(counts)):
        here = np.s_[first[block.start] : first[block.stop]]
        local = np.repeat(np.arange(block.stop - block.start), counts[block])
        facet = block.start + local
        plane = np.arange(here.start, here.stop) - shift.take(facet)
        code = np.zeros(len(facet), dtype=np.int64)
        for corner, levels in enumerate(level.take(mesh.facets[block].T)):
            code |= (levels.take(local) > plane).astype(np.int64) << corner
        neighbour = across.take(3 * facet + _EXIT_BELOW.take(code)).astype(np.int64)
        facets[here], planes[here] = facet, plane
        following[here] = np.where(neighbour >= 0, shift.take(neighbour) + plane, -1)
        places[:, here] = _crossings(
            vertices,
            altitudes,
            heights.take(plane),
            below=corners.take(3 * facet + _ENTRY_BELOW.take(code)),
            above=corners.take(3 * facet + _ENTRY_ABOVE.take(code)),
        )
    return facets, planes, following, places


def _chained(following: Ints, planes: Ints) -> tuple[Ints, Ints, Mask]:
    """Return the segment (n,) of each row, the first row (c + 1,) of each curve, and whether each is closed (c,).

    Curves are in order of plane, then of their first segment. Each has one more row than segments, which repeats its
    last segment.

    Args:
        following: (s,) the segment after each, or -1.
        planes: (s,) its plane.
    """
    begins, lengths, stops, run, segment, step = _runs(following)
    count = len(begins)
    run_from = np.empty(len(following), dtype=np.int64)
    run_from[begins] = np.arange(count)
    linked = np.flatnonzero(stops >= 0)
    after = run_from[stops[linked]]
    before, back, head = np.arange(count), np.zeros(count, dtype=np.int64), np.ones(count, dtype=np.bool_)
    before[after], back[after], head[after] = linked, lengths[linked], False

    # The first run of a curve is its head or, where it is closed, the run that begins with the lowest segment. Each run
    # looks back along its curve, twice as far each time, for the lowest label and the segments from there to it.
    label = np.where(head, begins - len(following), begins)
    distance = np.zeros(count, dtype=np.int64)
    while np.any(lower := label[before] < label):
        label = np.where(lower, label[before], label)
        distance = np.where(lower, back + distance[before], distance)
        back = back + back[before]
        before = before[before]

    first = np.flatnonzero(distance == 0)
    first = first[np.lexsort((begins[first], planes[begins[first]]))]
    curve_from = np.empty(count, dtype=np.int64)
    curve_from[first] = np.arange(len(first))
    # A head's label, counted from the end of the segments, is its first segment as well.
    curve = curve_from[run_from[label]]
    sizes = np.bincount(curve, weights=lengths, minlength=len(first)).astype(np.int64) + 1
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    segments = np.empty(offsets[-1], dtype=np.int64)
    segments[(offsets[curve] + distance).take(run) + step] = segment
    segments[offsets[1:] - 1] = segments[offsets[1:] - 2]
    return segments, offsets, ~head[first]


def _runs(following: Ints) -> tuple[Ints, Ints, Ints, Ints, Ints, Ints]:
    """Return each run's (r,) first segment, length and successor or -1, and run, segment and place in it of all (s,).

    A run begins at the head of a curve and at one segment in 32, and all runs are followed at once.
    """
    count = len(following)
    is_head = np.ones(count, dtype=np.bool_)
    is_head[following[following >= 0]] = False
    # Multiplicative hashing (Knuth, TAOCP 6.4) scatters the beginnings, so no regular numbering makes a run long.
    scattered = np.arange(count, dtype=np.uint32) * np.uint32(2654435761) < np.uint32(2**27)
    begins = np.flatnonzero(is_head | scattered)
    is_over = np.zeros(count + 1, dtype=np.bool_)  # the last entry is for -1
    is_over[begins], is_over[-1] = True, True
    lengths, stops = np.empty(len(begins), dtype=np.int64), np.empty(len(begins), dtype=np.int64)
    is_left = np.ones(count, dtype=np.bool_)
    trail, steps = [(np.arange(len(begins)), begins)], [0]
    while len(trail[-1][0]):
        run, segment = trail[-1]
        is_left[segment] = False
        segment = following.take(segment)
        over = is_over.take(segment)
        ended, going = np.flatnonzero(over), np.flatnonzero(~over)
        lengths[run.take(ended)], stops[run.take(ended)] = len(trail), segment.take(ended)
        trail.append((run.take(going), segment.take(going)))
        steps.append(len(steps))
    # In short closed curves in which no run begins, each segment is a run.
    left = np.flatnonzero(is_left)
    trail.append((len(begins) + np.arange(len(left)), left))
    steps.append(0)
    return (
        np.concatenate([begins, left]),
        np.concatenate([lengths, np.ones(len(left), dtype=np.int64)]),
        np.concatenate([stops, following[left]]),
        np.concatenate([run for run, _ in trail]),
        np.concatenate([segment for _, segment in trail]),
        np.repeat(steps, [len(run) for run, _ in trail]),
    )


def _crossings(vertices: Floats, altitudes: Floats, heights: Floats, below: Ints, above: Ints) -> Floats:
    """Return the coordinates (3, k) in metres where edges cross planes; a vertex on its plane is met to the last bit.

    Args:
        vertices: (3, n) coordinates of the vertices in metres.
        altitudes: (n,) their heights.
        heights: (k,) heights of the planes.
        below: (k,) vertex below.
        above: (k,) vertex above or on the plane.
    """
    top = altitudes.take(above)
    share = (top - heights) / (top - altitudes.take(below))
    places = np.empty((3, len(heights)))
    for place, coordinate in zip(places, vertices, strict=True):
        start = coordinate.take(above)
        place[:] = start + share * (coordinate.take(below) - start)
    return places


def _moving(points: Floats, offsets: Ints) -> Mask:
    """Return the rows (n,) that begin a segment of non-zero length, and the last row of curves that have one."""
    moving = np.zeros(len(points), dtype=np.bool_)
    for coordinate in points.T:
        moving[:-1] |= coordinate[1:] != coordinate[:-1]
    ends = offsets[1:] - 1
    moving[ends] = False
    if len(ends):
        moving[ends] = np.logical_or.reduceat(moving, offsets[:-1])
    return moving
