"""Region: what a ply covers on its mould, or every reason why it can cover nothing; planner and judge share it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import shapely
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.errors import InputFault, PlyRefused
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plane import Plane, best_plane, plane_across
from tapelayer.plies.boundary import Loop, loop_of, read_boundary
from tapelayer.plies.plan_view import SLIVER, PlanView, Shapes, broad_parts, without_slivers
from tapelayer.plies.ply import Ply
from tapelayer.units import DEG, MM
from tapelayer.vectors import unit

# Boundary points, and the seed, may be this far off the mould, in metres.
FARTHEST_OFF = 5.0 * MM
# Cosine of the steepest facets to the ply's plane that do not overhang, 75 degrees.
STEEPEST = math.cos(75.0 * DEG)
# The rosette has no direction on a surface on which it stands within this angle.
LEAST_TO_NORMAL = 5.0 * DEG
# A mould whose facets' mean normal is shorter than this faces all ways.
LEAST_MEAN_NORMAL = 0.1
# Strips narrower than this without a facet, or with two, lie at borders of facets and move no course, in metres.
NARROW = 1.0 * MM
# The plane and the facets inside the boundary depend on each other; each round takes one from the other.
_ROUNDS = 2

_MOULD, _BOUNDARY, _HOLES = ("mould", "file"), ("ply", "boundary"), ("ply", "holes")
_SEED, _ROSETTE = ("ply", "seed"), ("ply", "rosette")


@dataclass(frozen=True, eq=False)
class Region(Frozen):
    """A ply on its mould.

    Attributes:
        plane: the ply's plane, in the mould's frame.
        mould: all facets of the mould, in its own frame.
        facets: (k,) facets that carry the ply, and those around it that its courses may reach; all face the plane's
            upper side.
        outline: the ply in plan, in metres, with its holes, after the inset.
        rosette: (3,) unit, in the mould's frame.
        angle: of the ply to the rosette in radians, positive to the left.
        seed: (2,) in plan, metres.
    """

    plane: Plane
    mould: Mesh
    facets: Ints
    outline: Polygon
    rosette: Floats
    angle: float
    seed: Floats

    def headings(self, normals: Floats) -> Floats:
        """Return the ply's direction (n, 3), unit, at unit normals (n, 3), both in the plane's frame.

        The rosette is turned into the surface, then by the angle about the normal.
        """
        rosette = self.plane.turned_into(self.rosette[None])
        ahead = unit(rosette - (normals @ rosette[0])[:, None] * normals)
        left = np.cross(normals, ahead)
        headings: Floats = math.cos(self.angle) * ahead + math.sin(self.angle) * left
        return headings


def region_of(ply: Ply, mould: Mesh, name: str, boundary: Sequence[Loop] | None = None) -> Region:
    """Return what a ply covers on its mould.

    Args:
        ply: the ply.
        mould: its mould.
        name: the ply file as the user named it, for messages.
        boundary: the closed lines of the boundary's file, the outer one first; read from there unless given.

    Raises:
        PlyRefused: boundary, holes, seed, rosette and mould do not go together: every fault that can be told at once,
            places in mm in the mould's frame; or the boundary's file cannot be read.
    """
    if boundary is None and ply.boundary_file is not None:
        boundary = read_boundary(ply.boundary_file, ply.mould.unit)
    return _Finder(ply, mould, name).region(boundary or ())


@dataclass(frozen=True, eq=False)
class _Line:
    """A closed line of the ply, with its name in messages and the key that it stands in."""

    loop: Loop
    what: str
    place: tuple[str, str]
    file: str = ""

    def point(self, index: int) -> str:
        line = int(self.loop.lines[index])
        return f"{index + 1} ({self.file}:{line})" if line else f"{index + 1}"


class _Finder:
    """Finds a region, and every fault on the way to it."""

    def __init__(self, ply: Ply, mould: Mesh, name: str) -> None:
        self.ply, self.mould, self.name = ply, mould, name
        self.faults: list[InputFault] = []

    def region(self, boundary: Sequence[Loop]) -> Region:
        """Return the region.

        Raises:
            PlyRefused: there are faults.
        """
        outer, holes = self._lines(boundary)
        if outer is None:
            view, outline = self._by_edge()
        else:
            view, outline = self._by_points(outer)
        outline = self._with_holes(view, outline, [*([outer] if outer else []), *holes])
        rosette = np.array(self.ply.ply.rosette) / np.linalg.norm(self.ply.ply.rosette)
        told = self._told_seed(view, rosette)
        self._stop()
        outline = self._inset(view, outline)
        used = self._used(view, outline, outer)
        seed = self._seed(view, outline, used, rosette) if told is None else self._inside(view, outline, told)
        self._stop()
        land = self._land(view, outline, used)
        return Region(view.plane, self.mould, land, outline, rosette, self.ply.angle, seed)

    def _lines(self, boundary: Sequence[Loop]) -> tuple[_Line | None, list[_Line]]:
        """Return the outer line, None for the mould's edge, and those around holes."""
        told, metres = self.ply.ply, self.ply.metres
        file = Path(self.ply.boundary_file or "").name
        outer = None
        if isinstance(told.boundary, list):
            outer = _Line(loop_of(told.boundary, metres), "boundary", _BOUNDARY)
        elif boundary:
            outer = _Line(boundary[0], "boundary", _BOUNDARY, file)
        holes = [(loop, _BOUNDARY, file) for loop in boundary[1:]]
        holes += [(loop_of(points, metres), _HOLES, "") for points in told.holes]
        return outer, [_Line(loop, f"hole {n}", place, at) for n, (loop, place, at) in enumerate(holes, 1)]

    def _by_edge(self) -> tuple[PlanView, BaseGeometry]:
        """Return the mould in its plane, and its outline."""
        mesh = self.mould
        corners = mesh.vertices[mesh.facets]
        mean = mesh.areas @ mesh.normals / mesh.areas.sum()
        if np.linalg.norm(mean) < LEAST_MEAN_NORMAL:
            self._refuse_all_ways(corners)
        facing = np.flatnonzero(mesh.normals @ mean > 0)
        for _ in range(_ROUNDS):
            plane = best_plane(corners[facing], mesh.areas[facing], mesh.normals[facing])
            facing = np.flatnonzero(mesh.normals @ plane.normal > 0)
        view = PlanView.of(mesh, plane)
        pieces, layers = view.pieces(view.upward)
        outline = without_slivers(shapely.union_all(pieces[layers > 0]))
        return view, self._one_part(view, outline)

    def _refuse_all_ways(self, corners: Floats) -> None:
        """Refuse a mould without a side of its own."""
        away = self.mould.vertices - self.mould.vertices.mean(axis=0)
        across = np.linalg.eigh(away.T @ away)[1][:, 0]
        slopes = np.abs(self.mould.normals @ across)
        steep = np.flatnonzero(slopes <= max(STEEPEST, float(slopes.min())))
        at = corners[steep[np.argmax(self.mould.areas[steep])]].mean(axis=0)
        self._add(
            _MOULD,
            f"the mould faces all ways and overhangs near {_at(at)}: "
            "give [ply] boundary points around a ply on one side of it",
        )
        self._stop()

    def _by_points(self, outer: _Line) -> tuple[PlanView, BaseGeometry]:
        """Return the mould in the plane of the facets inside a line, and the line in plan."""
        points = outer.loop.points
        away = points - points.mean(axis=0)
        normal = np.cross(away, np.roll(away, -1, axis=0)).sum(axis=0)
        _, sizes, axes = np.linalg.svd(away)
        if sizes[1] < SLIVER:
            self._add(outer.place, f"{outer.what}: it encloses no area")
            self._stop()
        if np.linalg.norm(normal) < sizes[1] ** 2:
            # It crosses itself, or turns back on itself.
            normal = axes[2]
        view = PlanView.of(self.mould, plane_across(normal, points.mean(axis=0)))
        for _ in range(_ROUNDS):
            near, _ = view.nearest(view.plane.into(points), FARTHEST_OFF)
            if view.slopes[near].sum() < 0:
                view = PlanView.of(self.mould, plane_across(-view.plane.normal, view.plane.origin))
            # Of a line that crosses itself the hull is enough for the plane.
            shape = Polygon(view.plane.into(points)[:, :2])
            shape = shape if shape.is_valid else shape.convex_hull
            inside = self._facing(view, shape, near)
            if len(inside):
                mesh = self.mould
                corners = mesh.vertices[mesh.facets[inside]]
                view = PlanView.of(mesh, best_plane(corners, mesh.areas[inside], mesh.normals[inside]))
        return view, Polygon(view.plane.into(points)[:, :2])

    def _facing(self, view: PlanView, shape: BaseGeometry, near: Ints) -> Ints:
        """Return the facets over a shape that face up and hang together with some, or all of one layer."""
        # Facets that only touch the line would move the plane by rounding.
        within = shape.buffer(-NARROW / 2)
        over = view.over(shape if within.is_empty else within)
        labels = view.linked(over, shape)
        up = view.slopes[over] > 0
        own = np.isin(labels, labels[np.isin(over, near)])
        return over[up & own] if np.any(up & own) else over[up]

    def _with_holes(self, view: PlanView, outline: BaseGeometry, lines: Sequence[_Line]) -> Polygon:
        """Return the outline without the holes; faults of all lines are found first."""
        shapes = {}
        for line in lines:
            points = view.plane.into(line.loop.points)
            near, off = view.nearest(points, FARTHEST_OFF)
            self._check_side(view, points[(off <= FARTHEST_OFF) & (view.slopes[near] < STEEPEST)])
            for index in np.flatnonzero(off > FARTHEST_OFF).tolist():
                self._add(
                    line.place,
                    f"{line.what}: point {line.point(index)} is {off[index] / MM:.1f} mm off the mould, "
                    f"expected at most {FARTHEST_OFF / MM:g}",
                )
            shape = Polygon(points[:, :2])
            if shape.is_valid and shape.area > SLIVER**2:
                shapes[line.what] = shape
                continue
            self._add(line.place, self._crossing(view, line, shape))
        if not outline.is_valid:
            return Polygon()
        holes = [line for line in lines if line.what in shapes and line.what != "boundary"]
        for line in holes:
            if not shapely.buffer(outline, SLIVER).contains(shapes[line.what]):
                self._add(line.place, f"{line.what} is not inside the boundary")
        for one, other in combinations(holes, 2):
            if shapely.intersection(shapes[one.what], shapes[other.what]).area > SLIVER**2:
                first, second = (line.what.removeprefix("hole ") for line in (one, other))
                self._add(other.place, f"holes {first} and {second} overlap")
        rest = outline.difference(shapely.union_all([shapes[line.what] for line in holes]))
        return self._one_part(view, rest)

    def _check_side(self, view: PlanView, points: Floats) -> None:
        """Refuse points (n, 3) of the plane's frame that are on no facet of the ply's side."""
        if len(points):
            facing = np.flatnonzero(view.slopes >= STEEPEST)
            _, off = view.nearest(points, FARTHEST_OFF, facing)
            if np.any(off > FARTHEST_OFF):
                self._overhangs(self._spot(view, points[np.argmax(off)]))

    def _crossing(self, view: PlanView, line: _Line, shape: Polygon) -> str:
        """Return what is wrong with a line that encloses no valid polygon."""
        reason = shapely.is_valid_reason(shape)
        if "[" not in reason:
            return f"{line.what}: it encloses no area"
        x, y = map(float, reason.partition("[")[2].rstrip("]").split()[:2])
        points = view.plane.into(line.loop.points)
        height = points[np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)), 2]
        return f"{line.what}: it crosses itself near {self._spot(view, [x, y, height])}"

    def _inset(self, view: PlanView, outline: Polygon) -> Polygon:
        """Return the outline moved inwards."""
        inset = self.ply.ply.inset_mm
        if not inset:
            return outline
        inner = outline.buffer(-inset * MM)
        if not broad_parts(inner, NARROW):
            self._add(_BOUNDARY, f"nothing is left of the boundary after an inset of {inset:g} mm")
            self._stop()
        return self._one_part(view, inner)

    def _one_part(self, view: PlanView, shape: BaseGeometry) -> Polygon:
        """Return the one part of a shape that is broad enough for a ply."""
        parts = broad_parts(shape, NARROW)
        if len(parts) > 1:
            one, other = (self._over(view, part) for part in parts[:2])
            self._add(
                _BOUNDARY,
                f"boundary: the ply has {len(parts)} separate parts, near {one} and {other}; make a ply of each",
            )
        if not parts:
            self._add(_BOUNDARY, f"boundary: no part of the ply is {NARROW / MM:g} mm broad")
        return parts[0] if parts else Polygon()

    def _used(self, view: PlanView, outline: Polygon, outer: _Line | None) -> Ints:
        """Return the facets that carry the ply; overhangs and missing facets are faults."""
        over = view.over(outline)
        labels = view.linked(over, outline)
        up = view.slopes[over] > 0
        # The lower side of a closed body lies below the ply and has no part in it.
        carrying = np.isin(labels, labels[up])
        used, pieces, layers = self._layers(view, over[carrying & up])
        if outer is not None and len(self._doubled(pieces, layers, outline)):
            near, _ = view.nearest(view.plane.into(outer.loop.points), FARTHEST_OFF)
            carrying = np.isin(labels, labels[np.isin(over, near)])
            used, pieces, layers = self._layers(view, over[carrying & up])
        self._check_steep(view, over[carrying & (view.slopes[over] < STEEPEST)], outline)
        if doubled := self._doubled(pieces, layers, outline):
            self._overhangs(self._over(view, doubled[0]))
        missing = broad_parts(outline.difference(shapely.union_all(pieces[layers > 0])), NARROW)
        if missing:
            share = 100 * sum(part.area for part in missing) / outline.area
            self._add(
                _MOULD,
                f"the mould has no facets over {share:.2g} % of the ply, near {self._over(view, missing[0])}: "
                "close the mould there, or leave it out by the boundary or a hole",
            )
        return used

    @staticmethod
    def _layers(view: PlanView, facets: Ints) -> tuple[Ints, Shapes, Ints]:
        pieces, layers = view.pieces(facets)
        return facets, pieces, layers

    @staticmethod
    def _doubled(pieces: Shapes, layers: Ints, outline: Polygon) -> list[Polygon]:
        """Return the parts of a ply with two layers of facets in plan."""
        return broad_parts(shapely.union_all(pieces[layers > 1]).intersection(outline), NARROW)

    def _check_steep(self, view: PlanView, steep: Ints, outline: Polygon) -> None:
        """Refuse steep facets within a ply; at its border they end it."""
        within = outline.buffer(-NARROW / 2, join_style="mitre")
        shapely.prepare(within)
        # A facet that stands nearly upright may be told as a line only.
        shapes = view.shapes[steep]
        meets = shapely.intersects(within, shapes) | shapely.intersects(within, shapely.boundary(shapes))
        if np.any(meets):
            found = steep[meets]
            worst = found[np.argmin(view.slopes[found])]
            x, y = shapely.get_coordinates(view.shapes[worst].intersection(within).representative_point())[0]
            height = self._height(view.corners[worst], np.array([x, y]))
            self._overhangs(self._spot(view, [x, y, height]))

    @staticmethod
    def _height(corners: Floats, at: Floats) -> float:
        """Return a height of a facet (3, 3), of whatever slope, near a plan point."""
        shares = 1.0 / (np.hypot(*(corners[:, :2] - at).T) + SLIVER)
        return float(shares @ corners[:, 2] / shares.sum())

    def _overhangs(self, place: str) -> None:
        self._add(_MOULD, f"the mould overhangs near {place}: split the ply or choose another plane")

    def _told_seed(self, view: PlanView, rosette: Floats) -> Floats | None:
        """Return the seed of the ply file (3,) in the plane's frame, with the rosette checked there."""
        told = self.ply.ply.seed
        if told is None:
            return None
        point = view.plane.into(np.array([told]) * self.ply.metres)
        near, off = view.nearest(point, FARTHEST_OFF)
        if off[0] > FARTHEST_OFF:
            self._add(_SEED, f"seed: it is {off[0] / MM:.1f} mm off the mould, expected at most {FARTHEST_OFF / MM:g}")
        else:
            self._check_rosette(rosette, self.mould.normals[near[0]])
        seed: Floats = point[0]
        return seed

    def _inside(self, view: PlanView, outline: Polygon, seed: Floats) -> Floats:
        """Return a seed (3,) in plan."""
        if not outline.contains(Point(seed[:2])):
            self._add(_SEED, f"seed: {self._spot(view, seed)} is outside the ply")
        return seed[:2]

    def _seed(self, view: PlanView, outline: Polygon, used: Ints, rosette: Floats) -> Floats:
        """Return the middle of an outline, with the rosette checked there."""
        seed = self._middle(outline)
        at = used[shapely.intersects(view.shapes[used], Point(seed))]
        if len(at):  # a seed without a facet over it is a fault of its own
            self._check_rosette(rosette, self.mould.normals[at[np.argmax(view.slopes[at])]])
        return seed

    def _middle(self, outline: Polygon) -> Floats:
        """Return the centroid of an outline, or the inner point nearest to it, at best half a tape's width inside."""
        middle = outline.centroid
        if not outline.contains(middle):
            inner = (outline.buffer(-self.ply.width / parts) for parts in (2, 4, 8, 16))
            deep = next((shape for shape in inner if not shape.is_empty), outline.representative_point())
            middle = shapely.shortest_line(deep, middle)
        seed: Floats = shapely.get_coordinates(middle)[0]
        return seed

    def _check_rosette(self, rosette: Floats, normal: Floats) -> None:
        """Refuse a rosette that stands on the surface at the seed."""
        angle = math.asin(min(float(np.linalg.norm(np.cross(rosette, normal))), 1.0))
        if angle < LEAST_TO_NORMAL:
            self._add(
                _ROSETTE,
                f"rosette: it is {angle / DEG:.1f} deg from the mould's normal at the seed, expected at least "
                f"{LEAST_TO_NORMAL / DEG:g}; give a direction along the mould",
            )

    def _land(self, view: PlanView, outline: Polygon, used: Ints) -> Ints:
        """Return the facets that carry the ply and those around it, which hang together with them."""
        reach = outline.buffer(2 * self.ply.width + self.ply.ply.margin_mm * MM)
        around = np.union1d(view.over(reach), used)
        around = around[view.slopes[around] > STEEPEST]
        labels = view.linked(around, reach)
        return around[np.isin(labels, labels[np.isin(around, used)])]

    def _over(self, view: PlanView, part: Polygon) -> str:
        """Return a place of the mould in or nearest to a part of the plan."""
        at = part.representative_point()
        facets = view.over(at)
        facets = facets if len(facets) else view.nearest(np.array([[at.x, at.y, 0.0]]), NARROW)[0]
        heights = [self._height(corners, np.array([at.x, at.y])) for corners in view.corners[facets]]
        return self._spot(view, [at.x, at.y, max(heights)])

    def _spot(self, view: PlanView, point: Sequence[float] | Floats) -> str:
        return _at(view.plane.out_of(np.array([point]))[0])

    def _add(self, place: tuple[str, str], sentence: str) -> None:
        self.faults.append(InputFault(0, sentence, place=place))

    def _stop(self) -> None:
        if self.faults:
            raise PlyRefused(self.name, self.faults)


def _at(point: Floats) -> str:
    """Return a point of the mould's frame in mm, for a message."""
    return "(" + ", ".join(f"{round(value / MM, 1) + 0.0:.1f}" for value in point) + ")"
