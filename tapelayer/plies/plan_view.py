"""Plan view of a mould: its facets seen along the normal of a plane, what lies over what, and what hangs together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array, csgraph
from scipy.spatial import cKDTree
from shapely import Polygon, STRtree
from shapely.geometry.base import BaseGeometry

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.geometry.adjacency import neighbours
from tapelayer.geometry.facets import distances_to
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plane import Plane

# Cracks between facets, and bends of an outline, that are narrower than this are none, in metres.
SLIVER = 1e-6
# Cosine below which a facet is a line in plan.
_UPRIGHT = 1e-6
# A point moved by this, in no direction that facets are drawn in, lies on no edge of theirs any more, in metres.
_ASIDE = 1e-8 * np.array([np.cos(1.0), np.sin(1.0)])
# Corners are kept that are as sharp as one in so many.
_SHARPEST = 1000.0

Shapes = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class PlanView(Frozen):
    """A mould in the frame of a plane.

    Attributes:
        plane: the plane.
        mould: the mould, in its own frame.
        corners: (m, 3, 3) of its facets in the plane's frame, metres.
        slopes: (m,) cosines of the angle between facets and the plane; below 0 where they face its lower side.
    """

    plane: Plane
    mould: Mesh
    corners: Floats
    slopes: Floats

    @classmethod
    def of(cls, mould: Mesh, plane: Plane) -> PlanView:
        """Return the view of a mould along a plane's normal."""
        return cls(plane, mould, plane.into(mould.vertices)[mould.facets], mould.normals @ plane.normal)

    @property
    def upward(self) -> Ints:
        """Return the facets (k,) that face the plane's upper side."""
        return np.flatnonzero(self.slopes > _UPRIGHT)

    @cached_property
    def shapes(self) -> Shapes:
        """Shapes (m,) of the facets in plan: triangles, but lines of those that stand upright."""
        rings = self.corners[:, [0, 1, 2, 0], :2]
        shapes: Shapes = shapely.polygons(rings)
        upright = np.abs(self.slopes) <= _UPRIGHT
        shapes[upright] = shapely.linestrings(rings[upright])
        return shapes

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """Facet (m, 3) across each edge, or -1, as `Mesh.neighbours`; vertices within a sliver are one."""
        vertices, facets = self.mould.vertices, self.mould.facets
        pairs = cKDTree(vertices).query_pairs(SLIVER, output_type="ndarray")
        if not len(pairs):
            return self.mould.neighbours
        graph = coo_array((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(len(vertices),) * 2)
        count, labels = csgraph.connected_components(graph, directed=False)
        welded = labels.astype(np.int64)[facets]
        whole = np.flatnonzero(np.all(welded != np.roll(welded, 1, axis=1), axis=1))
        across = np.full(facets.shape, -1, dtype=np.int32)
        found = neighbours(welded[whole], count)
        across[whole] = np.where(found < 0, -1, whole[found])
        return across

    def over(self, shape: BaseGeometry) -> Ints:
        """Return the facets (k,), in their order, whose plan meets a shape."""
        return np.sort(self._tree.query(shape, predicate="intersects"))

    def nearest(self, points: Floats, reach: float, among: Ints | None = None) -> tuple[Ints, Floats]:
        """Return the facet (n,) nearest to each point (n, 3) of the plane's frame, and its distance (n,) in metres.

        Args:
            points: metres.
            reach: where no facet is as near as this in plan, that nearest in plan is taken.
            among: the facets (k,) that are looked at; all unless given.
        """
        tree = self._tree if among is None else STRtree(self.shapes[among])
        marks = shapely.points(points[:, :2])
        owners, facets = tree.query(marks, predicate="dwithin", distance=reach)
        alone = np.setdiff1d(np.arange(len(points)), owners)
        others, beside = tree.query_nearest(marks[alone], all_matches=False)
        owners, facets = np.concatenate([owners, alone[others]]), np.concatenate([facets, beside])
        facets = facets if among is None else among[facets]
        distances = distances_to(self.corners[facets], points[owners])
        order = np.lexsort((facets, distances, owners))
        best = order[np.unique(owners[order], return_index=True)[1]]
        return facets[best], distances[best]

    def pieces(self, facets: Ints) -> tuple[Shapes, Ints]:
        """Return the pieces (p,) into which the open edges of some facets divide the plan, and the layers (p,) in each.

        Args:
            facets: (k,) none upright, all facing one side: within a piece they are as many everywhere.
        """
        used = np.zeros(len(self.corners), dtype=np.bool_)
        used[facets] = True
        across = self.neighbours[facets]
        edges = np.stack([self.corners[facets], np.roll(self.corners[facets], -1, axis=1)], axis=2)[..., :2]
        lines = shapely.linestrings(edges[(across < 0) | ~used[across]])
        pieces: Shapes = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
        marks = shapely.points(shapely.get_coordinates(shapely.point_on_surface(pieces)) + _ASIDE)
        owners, _ = STRtree(self.shapes[facets]).query(marks, predicate="intersects")
        return pieces, np.bincount(owners, minlength=len(pieces))

    def linked(self, facets: Ints, shape: BaseGeometry) -> Ints:
        """Return the number (k,) of the part of the mould that each facet belongs to, as parts meet within a shape.

        Args:
            facets: (k,) in rising order; only these are looked at.
            shape: facets that share an edge hang together where the edge, in plan, meets it.
        """
        shapely.prepare(shape)
        position = np.full(len(self.corners), -1, dtype=np.int64)
        position[facets] = np.arange(len(facets))
        across = self.neighbours[facets]
        other = np.where(across < 0, -1, position[across])
        one, corner = np.nonzero(other > np.arange(len(facets))[:, None])
        whole = shapely.contains(shape, self.shapes[facets])
        meets = whole[one] | whole[other[one, corner]]
        unsure = np.flatnonzero(~meets)
        begins = self.corners[facets[one[unsure]], corner[unsure], :2]
        ends = self.corners[facets[one[unsure]], (corner[unsure] + 1) % 3, :2]
        meets[unsure] = shapely.intersects(shape, shapely.linestrings(np.stack([begins, ends], axis=1)))
        pairs = one[meets], other[one, corner][meets]
        graph = coo_array((np.ones(len(pairs[0]), dtype=np.int8), pairs), shape=(len(facets),) * 2)
        labels: Ints = csgraph.connected_components(graph, directed=False)[1].astype(np.int64)
        return labels

    @cached_property
    def _tree(self) -> STRtree:
        return STRtree(self.shapes)


def without_slivers(shape: BaseGeometry) -> BaseGeometry:
    """Return a shape without cracks narrower than a sliver, and without corners that move its outline by less."""
    # A corner that is cut off on the way out would not come back.
    closed = shape.buffer(SLIVER / 2, join_style="mitre", mitre_limit=_SHARPEST)
    closed = closed.buffer(-SLIVER / 2, join_style="mitre", mitre_limit=_SHARPEST)
    return shapely.simplify(closed, SLIVER / 2)


def broad_parts(shape: BaseGeometry, breadth: float) -> list[Polygon]:
    """Return the polygons of a shape that are as broad as a breadth in metres somewhere, the largest first.

    Examples:
        >>> shape = shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 2.001, 1)])
        >>> [part.area for part in broad_parts(shape, 0.01)]
        [1.0]
    """
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, Polygon)]
    broad = [part for part in parts if not part.buffer(-breadth / 2, join_style="mitre").is_empty]
    return sorted(broad, key=lambda part: -part.area)
