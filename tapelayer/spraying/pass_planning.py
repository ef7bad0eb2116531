"""Pass planning: a surface in the machine becomes the paths of the gun's point P, plane by plane and layer by layer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import NothingToSpray, PartBeyondReach
from tapelayer.geometry.envelope import areas_from_above
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.polyline import NORMAL_TOLERANCE, kept
from tapelayer.geometry.slicing import plane_direction, plane_heights, strip_widths
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import reachable
from tapelayer.spraying.passes import NO_FACET, Pass, Plan
from tapelayer.spraying.reach import ROUNDING, SAME_POINT, Reach, Segments
from tapelayer.spraying.settings import SpraySetup
from tapelayer.spraying.smoothing import Smoothed, creases, smooth
from tapelayer.spraying.steep_sides import flank_heights, on_steep_sides
from tapelayer.units import DEG, MM
from tapelayer.vectors import ramp

# Part of the permitted deviation that planning reserves for the motion between points, which is not exact.
LEAN_MARGIN = NORMAL_TOLERANCE
# Share of the area seen from above that may lie beyond reach: with more, the part is not where it should be.
MOST_BEYOND = 0.5
# Strips per pitch for measuring areas.
_AREA_STRIPS = 5


def plan_passes(mesh: Mesh, setup: SpraySetup, machine: Machine, pitch: float) -> Plan:
    """Return the passes over the part of a surface that is visible from above and can be reached.

    Args:
        mesh: the surface in `machine`.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        pitch: distance from pass to pass, metres.

    Raises:
        NothingToSpray: no part of the surface can be reached.
        PartBeyondReach: most of what is seen from above cannot be reached.
    """
    planner = _Planner(mesh, setup, machine, pitch)
    passes = planner.passes()
    seen = areas_from_above(mesh, planner.travel(0), pitch / _AREA_STRIPS, setup.spray.min_normal_z)
    beyond = seen.seen * planner.beyond_share
    if not passes:
        parts = ((seen.too_steep, "too steep"), (seen.hidden, "hidden"), (beyond, "beyond the travel"))
        lost = ", ".join(f"{area * 1e4:.4g} cm2 {words}" for area, words in parts)
        raise NothingToSpray(
            f"{mesh.name}: no pass can be sprayed on it: of the surface {lost}; turn the part or place it elsewhere"
        )
    if planner.beyond_share > MOST_BEYOND:
        raise PartBeyondReach(
            f"{mesh.name}: {beyond:.4g} m2 of the {seen.seen:.4g} m2 seen from above lie beyond the machine's reach; "
            "place the part elsewhere by [part], turn it, or see whether its --unit is right"
        )
    return Plan(tuple(passes), seen.seen - beyond, seen.too_steep, seen.hidden, beyond)


class _Planner:
    """Planner of passes, layer by layer; the area beyond the travel is measured in the first layer."""

    def __init__(self, mesh: Mesh, setup: SpraySetup, machine: Machine, pitch: float) -> None:
        self.reach, self.spray, self.pitch = Reach(mesh, setup, machine), setup.spray, pitch
        self.window, self.limit = setup.smoothing, setup.planned_deviation
        self.beyond_share = 0.0

    def passes(self) -> list[Pass]:
        """Return the numbered passes of all layers, replanned until no facet has to be given up.

        A facet is given up where the deviation left by smoothing is too small for the wrist to reach the normal.
        """
        while True:
            facets = self.reach.facets.copy()
            passes = [one for layer in range(self.spray.layers) for one in self._layer(layer)]
            if np.array_equal(facets, self.reach.facets):
                return [replace(one, path=replace(one.path, number=number)) for number, one in enumerate(passes, 1)]

    def travel(self, layer: int) -> float:
        """Return the direction of a layer's passes, radians from +x towards +y."""
        return (self.spray.direction_deg + layer * self.spray.layer_turn_deg) * DEG

    def _layer(self, layer: int) -> Iterator[Pass]:
        """Yield the passes of a layer in order."""
        direction = plane_direction(self.travel(layer))
        heights = self._heights(layer, direction)
        segments, beyond_share = self.reach.segments(direction, heights)
        if layer == 0:
            self.beyond_share = beyond_share
        for among, before in ((segments, 0), (self._flanks(direction, heights), len(heights))):
            for one in self._chained(among, direction):
                yield replace(one, layer=layer + 1, plane=before + one.plane)

    def _flanks(self, direction: Floats, heights: Floats) -> Segments:
        """Return segments on extra planes where the surface is steep across the passes."""
        reach = self.reach
        altitudes = reach.mesh.vertices @ direction
        extent = (float(np.min(altitudes)), float(np.max(altitudes)))
        further, least = flank_heights(heights, self.pitch, extent)
        segments, _ = reach.segments(direction, further)
        widths = strip_widths(reach.normals[segments.facets], direction, 1.0)
        gap = self.spray.max_gap_mm * MM
        steep = on_steep_sides(segments, widths, least[segments.planes], gap, self.pitch)
        return replace(steep, planes=np.unique(steep.planes, return_inverse=True)[1])

    def _chained(self, segments: Segments, direction: Floats) -> Iterator[Pass]:
        """Yield the passes over segments in order, plane by plane, with gaps inside a pass bridged."""
        gaps = np.linalg.norm(segments.begins[1:] - segments.ends[:-1], axis=1)
        apart = (np.diff(segments.planes) != 0) | ~(gaps <= self.spray.max_gap_mm * MM)
        starts = np.append(0, np.flatnonzero(apart) + 1) if len(segments.planes) else np.zeros(0, dtype=np.int64)
        ends = np.append(starts[1:], len(segments.planes))
        lengths = np.add.reduceat(np.linalg.norm(segments.ends - segments.begins, axis=1), starts)
        # A curve shorter than the path's tolerance comes from a plane that grazes a corner.
        starts, ends = (rows[lengths > self.spray.chord_tolerance_mm * MM] for rows in (starts, ends))
        planes = segments.planes[starts]
        for row, plane in enumerate(np.unique(planes).tolist()):
            chosen = np.flatnonzero(planes == plane)
            backwards = self.spray.pattern == "boustrophedon" and row % 2 == 1
            for curve in (chosen[::-1] if backwards else chosen).tolist():
                planned = self._pass(segments, int(starts[curve]), int(ends[curve]), direction)
                planned = replace(planned, plane=plane + 1, curve=int(curve - chosen[0]) + 1)
                yield planned.reversed() if backwards else planned

    def _heights(self, layer: int, direction: Floats) -> Floats:
        """Return the heights (p,) of a layer's planes, shifted against earlier layers in the same direction."""
        # A part exactly some pitches wide must not get one more plane by rounding.
        heights = plane_heights(self.reach.mesh, direction, self.pitch * (1.0 + ROUNDING))
        angles = [math.cos(2 * (self.travel(other) - self.travel(layer))) for other in range(layer)]
        shift = (sum(angle > 1.0 - 1e-9 for angle in angles) * self.spray.layer_shift) % 1.0
        if not shift:
            return heights
        shifted = np.append(heights[0] - self.pitch, heights) + shift * self.pitch
        extent = self.reach.mesh.vertices @ direction
        inside: Floats = shifted[(shifted > extent.min()) & (shifted < extent.max())]
        return inside

    def _pass(self, segments: Segments, first: int, last: int, direction: Floats) -> Pass:
        """Return one pass over the segments `first` to `last` (exclusive), with gaps bridged and both ends overrun."""
        stations, points, facets = _polyline(segments, first, last)
        normals = np.where((facets == NO_FACET)[:, None], np.nan, self.reach.normals[facets])
        spot = self.spray.spot_mm * MM
        exempt = _joined(creases(stations, normals, spot / 2, self.limit) + [-spot / 2, spot / 2])
        exempt = np.clip(exempt, stations[0], stations[-1])
        inner = exempt[(exempt > stations[0]) & (exempt < stations[-1])]
        # Long facets get extra vertices so that the gun can turn on them.
        spacing = self.spray.max_point_spacing_mm * MM
        further = np.append(inner, np.arange(stations[0] + spacing, stations[-1], spacing))
        further = further[facets[np.searchsorted(stations, further) - 1] != NO_FACET]
        stations, points, facets, normals = _cut(stations, points, facets, normals, further)
        free = _inside_intervals(stations, exempt)
        smoothed = smooth(stations, normals, free, self.window, spot / 2, self.limit)
        fixed = np.isin(stations, inner)
        fixed[:-1] |= facets == NO_FACET
        fixed[1:] |= facets == NO_FACET
        remain = kept(stations, points, smoothed.normals, fixed, self.spray.chord_tolerance_mm * MM)
        leans = self._leans(facets, free, smoothed, np.flatnonzero(remain))
        return self._finished(
            points[remain],
            smoothed.normals[remain],
            leans,
            stations,
            facets,
            exempt,
            remain,
            direction,
            (bool(segments.goes_on[first, 0]), bool(segments.goes_on[last - 1, 1])),
        )

    def _leans(self, facets: Ints, free: Mask, smoothed: Smoothed, remain: Ints) -> Floats:
        """Return the lean (k,) that the deviations of all vertices leave at those that remain."""
        deviations = np.where(free, 0.0, smoothed.deviations)
        spans = np.maximum.reduceat(deviations, remain[:-1])
        spans = np.maximum(spans, deviations[remain[1:]])
        worst = np.maximum(np.append(0.0, spans), np.append(spans, 0.0))
        leans = np.maximum(self.limit - LEAN_MARGIN - worst, 0.0)
        return np.where(free[remain], np.inf, leans)

    def _finished(
        self,
        points: Floats,
        normals: Floats,
        leans: Floats,
        stations: Floats,
        facets: Ints,
        exempt: Floats,
        remain: Mask,
        direction: Floats,
        goes_on: tuple[bool, bool],
    ) -> Pass:
        """Return the pass of a smoothed section, overrun at its ends and subdivided as the setup asks."""
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        places = np.append(0.0, np.cumsum(lengths))
        bounds = np.interp(stations, stations[remain], places)
        swings = np.interp(exempt, stations[remain], places)
        bridged = np.isin(places[:-1], bounds[:-1][facets == NO_FACET])
        lead, out = (
            _overrun(
                self.reach.box,
                points[row],
                sign * np.cross(direction, normals[row]),
                0.0 if over else self.spray.overrun_mm * MM,
            )
            for row, sign, over in ((0, -1.0, goes_on[0]), (-1, 1.0, goes_on[1]))
        )
        most = self.limit - LEAN_MARGIN
        leans = np.concatenate(
            [np.full(len(lead), min(leans[0], most)), leans, np.full(len(out), min(leans[-1], most))]
        )
        normals = np.vstack([np.tile(normals[0], (len(lead), 1)), normals, np.tile(normals[-1], (len(out), 1))])
        points = np.vstack([lead[::-1], points, out])
        places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        begin = float(places[len(lead)])
        bridged = np.concatenate([np.zeros(len(lead), np.bool_), bridged, np.zeros(len(out), np.bool_)])
        points, normals, leans, places = _subdivided(
            points, normals, leans, places, bridged, self.spray.max_point_spacing_mm * MM
        )
        bounds, facets = np.concatenate([[0.0], bounds + begin, [places[-1]]]), np.concatenate([[-1], facets, [-1]])
        real = np.append(np.diff(bounds) > 0.0, True)
        lost = places[~reachable(self.reach.wrist, normals, leans)]
        given_up = facets[np.clip(np.searchsorted(bounds, lost), 2, len(facets) - 1) - 1]
        self.reach.facets[given_up[given_up != NO_FACET]] = False
        return Pass(
            path=Toolpath(1, np.clip(points, *self.reach.box), normals, places),
            leans=leans,
            facets=facets[real[:-1]],
            bounds=np.append(bounds[:-1][real[:-1]], bounds[-1]),
            exempt=swings + begin,
            layer=1,
            plane=1,
            curve=1,
        )


def _polyline(segments: Segments, first: int, last: int) -> tuple[Floats, Floats, Ints]:
    """Return arc lengths (n,), vertices (n, 3) and facets (n - 1,) of a chain of segments with its gaps bridged."""
    begins, ends = segments.begins[first:last], segments.ends[first:last]
    points = np.stack([begins, ends], axis=1).reshape(-1, 3)
    facets = np.full(len(points) - 1, NO_FACET)
    facets[::2] = segments.facets[first:last]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moving = lengths > SAME_POINT
    stations = np.append(0.0, np.cumsum(lengths[moving]))
    return stations, points[np.append(True, moving)], facets[moving]


def _cut(
    stations: Floats, points: Floats, facets: Ints, normals: Floats, places: Floats
) -> tuple[Floats, Floats, Ints, Floats]:
    """Return the same polyline with extra vertices at some arc lengths `places` inside it."""
    new = np.setdiff1d(places, stations)
    if not len(new):
        return stations, points, facets, normals
    after = np.searchsorted(stations, new)
    share = ((new - stations[after - 1]) / (stations[after] - stations[after - 1]))[:, None]
    between = points[after - 1] + share * (points[after] - points[after - 1])
    return (
        np.insert(stations, after, new),
        np.insert(points, after, between, axis=0),
        np.insert(facets, after, facets[after - 1]),
        np.insert(normals, after, normals[after - 1], axis=0),
    )


def _joined(intervals: Floats) -> Floats:
    """Return sorted intervals (k, 2) with overlapping ones merged."""
    if not len(intervals):
        return intervals
    apart = np.append(True, intervals[1:, 0] > np.maximum.accumulate(intervals[:, 1])[:-1])
    first = np.flatnonzero(apart)
    return np.column_stack([intervals[first, 0], np.maximum.reduceat(intervals[:, 1], first)])


def _inside_intervals(stations: Floats, intervals: Floats) -> Mask:
    """Return a mask (n,) of the stations inside any open interval (k, 2); the section's own ends count as inside."""
    inside = np.zeros(len(stations), dtype=np.bool_)
    for low, high in intervals:
        begins = (stations > low) | ((stations == low) & (low == stations[0]))
        inside |= begins & ((stations < high) | ((stations == high) & (high == stations[-1])))
    return inside


def _overrun(box: Floats, point: Floats, tangent: Floats, length: float) -> Floats:
    """Return the points (k, 3) in metres of the overrun beyond the end of a section, k from 0 to 2.

    It continues straight along the tangent; where that leaves the travel, as below its lowest z, the rest is level.

    Args:
        box: (2, 3) travel, metres.
        point: (3,) the section's end, metres.
        tangent: (3,) out of the section, of any length.
        length: of the overrun, metres.
    """
    points: list[Floats] = []
    for direction in (tangent, tangent * [1.0, 1.0, 0.0]):
        size = float(np.linalg.norm(direction))
        going = min(length, _distance_to_travel_end(box, point, direction / size)) if size > 0.0 else 0.0
        if going > ROUNDING:
            point = np.clip(point + going * direction / size, *box)
            points.append(point)
            length -= going
    return np.array(points).reshape(-1, 3)


def _distance_to_travel_end(box: Floats, point: Floats, tangent: Floats) -> float:
    """Return the metres that P can move from a point (3,) along a unit tangent (3,) inside the travel (2, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = np.where(tangent > 0, (box[1] - point) / tangent, (box[0] - point) / tangent)
    return max(float(np.min(distances[tangent != 0])), 0.0)


def _subdivided(
    points: Floats, normals: Floats, leans: Floats, places: Floats, bridged: Mask, spacing: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the same path with points no farther apart than the spacing; normals in between are blended.

    Args:
        points: (n, 3) metres.
        normals: (n, 3) unit normals.
        leans: (n,) radians.
        places: (n,) arc lengths, metres, not decreasing.
        bridged: (n - 1,) intervals without surface, inside which the gun may swing.
        spacing: largest distance between points, metres.
    """
    lengths = np.diff(places)
    counts = np.where(lengths > 0.0, np.ceil(lengths / spacing - 1e-9), 0.0).astype(np.int64)
    row, step = ramp(counts)
    share = step / counts[row]
    inner = step > 0
    blended = normals[row] + share[:, None] * (normals[row + 1] - normals[row])
    between = np.minimum(leans[row], leans[row + 1])
    # Between a limited point and an unlimited one the lean is unlimited.
    between = np.where(bridged[row] | np.isinf(leans[row]) | np.isinf(leans[row + 1]), np.inf, between)
    return (
        np.vstack([points[row] + share[:, None] * (points[row + 1] - points[row]), points[-1:]]),
        np.vstack([blended / np.linalg.norm(blended, axis=1)[:, None], normals[-1:]]),
        np.append(np.where(inner, between, leans[row]), leans[-1]),
        np.append(places[row] + share * lengths[row], places[-1]),
    )
