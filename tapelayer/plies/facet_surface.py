"""Facet surface: what the facets of a mould say of the surface that they stand for, in the frame of a ply's plane.

Facets lie below or above the surface by their chords' sag. A quadric through the vertices round each vertex gives its
normal and curvature; from these follow the sag anywhere, and the surface's normal, without any fit of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.sparse import coo_array

from tapelayer.arrays import Floats, Frozen, Ints, Mask, SampleTable
from tapelayer.geometry.adjacency import facet_spans
from tapelayer.vectors import dot, norms, ramp, unit

# Vertices whose quadrics are fitted at a time.
_BATCH = 2048
# Weight of the flattest quadric, which decides where the vertices do not.
_DAMPING = 1e-6
# Weight of vertices two edges away; those at one edge, which count 1, are nearly enough.
_FAR = 0.05
# Least square of the breadth of a vertex's surroundings over that of their length.
_NARROWEST = 1e-8


@dataclass(frozen=True, eq=False)
class Spots(SampleTable):
    """Places on facets.

    Attributes:
        facets: (n,) their numbers.
        shares: (n, 3) weights of the facet's corners, from 0 to 1, 1 together.
        inside: (n,) whether the place is over the facets; where it is not, the spot is the nearest in plan.
    """

    facets: Ints
    shares: Floats
    inside: Mask

    def rows(self, kept: Mask) -> Spots:
        """Return the spots (k,) of a mask (n,)."""
        return Spots(self.facets[kept], self.shares[kept], self.inside[kept])


@dataclass(frozen=True, eq=False)
class FacetSurface(Frozen):
    """The facets of a mould over a ply's plane.

    Attributes:
        vertices: (n, 3) metres in the plane's frame.
        facets: (m, 3) vertex indices, anticlockwise from above; no two above each other.
        vertex_normals: (n, 3) unit normals of the quadrics.
        vertex_shapes: (n, 3, 3) their second fundamental forms as tensors in space, 1/m, positive where hollow.
    """

    vertices: Floats
    facets: Ints
    vertex_normals: Floats
    vertex_shapes: Floats

    @staticmethod
    def of(vertices: Floats, facets: Ints) -> FacetSurface:
        """Return the surface of facets (m, 3) with vertices (n, 3) in the plane's frame; unused vertices are left out.

        Examples:
            >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
            >>> FacetSurface.of(vertices, np.array([[0, 1, 2], [0, 2, 3]])).vertex_normals[0].tolist()
            [0.0, 0.0, 1.0]
        """
        used, corners = np.unique(facets, return_inverse=True)
        vertices, facets = vertices[used], corners.reshape(-1, 3)
        spans = facet_spans(vertices, facets)
        sums: Floats = np.stack(
            [np.bincount(facets.ravel(), np.repeat(spans[:, axis], 3), len(vertices)) + 0.0 for axis in range(3)],
            axis=1,
        )
        normals, shapes = _quadrics(vertices, unit(sums), *_surroundings(facets, len(vertices)))
        return FacetSurface(vertices, facets, normals, shapes)

    @cached_property
    def facet_normals(self) -> Floats:
        """Unit normals (m, 3) of the facets."""
        return unit(facet_spans(self.vertices, self.facets))

    @cached_property
    def areas(self) -> Floats:
        """Areas (m,) of the facets, m^2."""
        return norms(facet_spans(self.vertices, self.facets)) / 2

    @cached_property
    def vertex_doubts(self) -> Floats:
        """Angles (n,) by which the normals near a vertex fail to explain the edges within two steps, radians.

        A surface that is a quadric as far as an edge goes rises along it as the normals at its two ends say.
        """
        doubts = np.zeros(len(self.vertices))
        for one, other in ((0, 1), (1, 2), (2, 0)):
            begins, ends = self.facets[:, one], self.facets[:, other]
            edges = unit(self.vertices[ends] - self.vertices[begins])
            doubt = np.abs(dot(self.vertex_normals[begins] + self.vertex_normals[ends], edges)) / 2
            np.maximum.at(doubts, begins, doubt)
            np.maximum.at(doubts, ends, doubt)
        around = doubts.copy()
        np.maximum.at(around, self.facets, np.max(doubts[self.facets], axis=1)[:, None])
        return around

    @cached_property
    def _tree(self) -> shapely.STRtree:
        corners = self.vertices[self.facets][:, [0, 1, 2, 0], :2]
        return shapely.STRtree(shapely.polygons(corners))

    def spots(self, plan: Floats) -> Spots:
        """Return the spots above or below points (n, 2) of the plane, metres.

        Examples:
            >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
            >>> surface = FacetSurface.of(vertices, np.array([[0, 1, 2]]))
            >>> spots = surface.spots(np.array([[0.5, 0.25], [2.0, 0.0]]))
            >>> spots.shares.tolist(), spots.inside.tolist()
            ([[0.25, 0.5, 0.25], [0.0, 1.0, 0.0]], [True, False])
        """
        points = shapely.points(plan)
        asked, found = self._tree.query(points, predicate="intersects")
        facets = np.full(len(plan), -1)
        facets[asked] = found
        inside = facets >= 0
        if not np.all(inside):
            outside = np.flatnonzero(~inside)
            asked, found = self._tree.query_nearest(points[outside], all_matches=False)
            facets[outside[asked]] = found
        shares = _shares(self.vertices[self.facets[facets]][:, :, :2], plan)
        return Spots(facets, shares, inside)

    def sampled(self, count: int, seed: int) -> Spots:
        """Return spots drawn evenly by area, the same for the same seed."""
        chance = np.random.default_rng(seed)
        sums = np.cumsum(self.areas)
        facets = np.searchsorted(sums, chance.uniform(0.0, sums[-1], count), side="right")
        one, other = chance.uniform(size=(2, count))
        root = np.sqrt(one)
        shares = np.stack([1.0 - root, root * (1.0 - other), root * other], axis=1)
        return Spots(np.minimum(facets, len(sums) - 1), shares, np.ones(count, dtype=np.bool_))

    def on_facets(self, spots: Spots) -> Floats:
        """Return the points (n, 3) of spots on their facets, metres."""
        points: Floats = np.einsum("ni,nij->nj", spots.shares, self.vertices[self.facets[spots.facets]])
        return points

    def sags(self, spots: Spots) -> Floats:
        """Return how far (n,) the surface lies above its facets along their normals, metres."""
        corners = self.facets[spots.facets]
        points, normals = self.vertices[corners], self.vertex_normals[corners]
        sags = np.zeros(len(corners))
        for one, other in ((0, 1), (1, 2), (2, 0)):
            turned = dot(normals[:, other] - normals[:, one], points[:, other] - points[:, one])
            sags += spots.shares[:, one] * spots.shares[:, other] * turned / 2
        return sags

    def points(self, spots: Spots) -> Floats:
        """Return the points (n, 3) of spots on the surface that the facets stand for, metres."""
        return self.on_facets(spots) + self.sags(spots)[:, None] * self.facet_normals[spots.facets]

    def normals(self, spots: Spots) -> Floats:
        """Return the surface's unit normals (n, 3) at spots."""
        return unit(np.einsum("ni,nij->nj", spots.shares, self.vertex_normals[self.facets[spots.facets]]))

    def shapes(self, spots: Spots) -> Floats:
        """Return the surface's second fundamental forms (n, 3, 3) at spots, 1/m."""
        shapes: Floats = np.einsum("ni,nijk->njk", spots.shares, self.vertex_shapes[self.facets[spots.facets]])
        return shapes

    def chord_errors(self, spots: Spots) -> Floats:
        """Return how far (n,) the surface may lie off the spots' facets by its normals and their doubts, metres."""
        corners = self.facets[spots.facets]
        points, normals = self.vertices[corners], self.vertex_normals[corners]
        edges = np.roll(points, -1, axis=1) - points
        turned = np.abs(np.einsum("nij,nij->ni", np.roll(normals, -1, axis=1) - normals, edges))
        doubted = 2.0 * self.doubts(spots)[:, None] * np.linalg.norm(edges, axis=2)
        errors: Floats = np.max(turned + doubted, axis=1) / 8
        return errors

    def doubts(self, spots: Spots) -> Floats:
        """Return the angles (n,) that the facets leave open in the normals at spots, radians; 0 on quadrics."""
        doubts: Floats = np.max(self.vertex_doubts[self.facets[spots.facets]], axis=1)
        return doubts

    def spreads(self, spots: Spots) -> Floats:
        """Return the largest angle (n,) between a corner's normal and that of its facet, radians."""
        normals = self.vertex_normals[self.facets[spots.facets]]
        cosines = np.einsum("nij,nj->ni", normals, self.facet_normals[spots.facets])
        spreads: Floats = np.arccos(np.clip(np.min(cosines, axis=1), -1.0, 1.0))
        return spreads


def _shares(triangles: Floats, points: Floats) -> Floats:
    """Return the weights (n, 3) of triangles' (n, 3, 2) corners at the points of them nearest to points (n, 2)."""
    away, sides = points[:, None] - triangles, np.roll(triangles, -1, axis=1) - triangles
    doubled = sides[:, 0, 0] * -sides[:, 2, 1] + sides[:, 0, 1] * sides[:, 2, 0]
    # The weight of a corner is the area opposite to it.
    areas = sides[..., 0] * away[..., 1] - sides[..., 1] * away[..., 0]
    shares = areas[:, [1, 2, 0]] / doubled[:, None]
    out = np.flatnonzero(np.min(shares, axis=1) < 0.0)
    if len(out):
        along = np.einsum("nij,nij->ni", away[out], sides[out]) / np.einsum("nij,nij->ni", sides[out], sides[out])
        along = np.clip(along, 0.0, 1.0)
        off = away[out] - along[..., None] * sides[out]
        side = np.argmin(np.einsum("nij,nij->ni", off, off), axis=1)
        row = np.arange(len(out))
        nearest = np.zeros((len(out), 3))
        nearest[row, side] = 1.0 - along[row, side]
        nearest[row, (side + 1) % 3] = along[row, side]
        shares[out] = nearest
    return shares


def _surroundings(facets: Ints, count: int) -> tuple[Ints, Ints, Floats]:
    """Return the vertices within two edges of each of `count` vertices: rows' begins (n + 1,), columns and weights."""
    begins, ends = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    ones = np.ones(2 * len(begins) + count)
    every = np.arange(count)
    rows, columns = np.concatenate([begins, ends, every]), np.concatenate([ends, begins, every])
    near = coo_array((ones, (rows, columns)), shape=(count, count)).tocsr()
    wide = near @ near
    near.data[:], wide.data[:] = 1.0 - _FAR, _FAR
    both = near + wide
    return both.indptr.astype(np.int64), both.indices.astype(np.int64), both.data


def _quadrics(vertices: Floats, normals: Floats, begins: Ints, columns: Ints, weights: Floats) -> tuple[Floats, Floats]:
    """Return normals (n, 3) and second fundamental forms (n, 3, 3) of quadrics through each vertex's surroundings.

    Args:
        vertices: (n, 3) metres.
        normals: (n, 3) about their normals.
        begins: (n + 1,) of each vertex's surroundings in `columns`.
        columns: of all surroundings, one after the other.
        weights: of the same.
    """
    # A direction across the normal, away from it by at least 45 deg.
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = unit(np.cross(axis, normals))
    second = np.cross(normals, first)
    fitted, shapes = np.empty_like(normals), np.empty((len(normals), 3, 3))
    for begin in range(0, len(vertices), _BATCH):
        rows = np.arange(begin, min(begin + _BATCH, len(vertices)))
        counts = begins[rows + 1] - begins[rows]
        owner, number = ramp(counts)
        entries = begins[rows][owner] + number
        away = vertices[columns[entries]] - vertices[rows][owner]
        frame = np.stack([first[rows], second[rows], normals[rows]], axis=1)
        local = np.zeros((len(rows), int(counts.max()), 3))
        held = np.zeros(local.shape[:2])
        local[owner, number], held[owner, number] = np.einsum("nij,nj->ni", frame[owner], away), weights[entries]
        # Lengths in units of how far the surroundings reach each way, so that long facets are as good as others.
        spans = np.einsum("nk,nki,nkj->nij", held, local[..., :2], local[..., :2]) / np.sum(held, axis=1)[:, None, None]
        squares, axes = np.linalg.eigh(spans)
        scales = np.sqrt(np.maximum(squares, squares[:, 1:] * _NARROWEST))
        x, y = np.moveaxis(np.einsum("nki,nij->nkj", local[..., :2], axes) / scales[:, None], 2, 0)
        terms = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], axis=2)
        weighted = terms * held[..., None]
        square = np.einsum("nki,nkj->nij", weighted, terms) + _DAMPING * np.sum(held, axis=1)[:, None, None] * np.eye(6)
        found = np.linalg.solve(square, np.einsum("nki,nk->ni", weighted, local[..., 2])[..., None])[..., 0]
        slopes = np.einsum("nij,nj->ni", axes, found[:, 1:3] / scales)
        hessian = np.stack([found[:, [3, 4]], found[:, [4, 5]]], axis=1) / (scales[:, :, None] * scales[:, None, :])
        hessian = np.einsum("nij,njk,nlk->nil", axes, hessian, axes)
        tilted = frame[:, 2] - np.einsum("ni,nij->nj", slopes, frame[:, :2])
        lengths = norms(tilted)
        fitted[rows] = tilted / lengths[:, None]
        # The form in space takes two tangents to their part of the heights' second derivatives.
        metric = np.eye(2) + slopes[:, :, None] * slopes[:, None, :]
        duals = np.linalg.solve(metric, frame[:, :2] + slopes[:, :, None] * frame[:, None, 2])
        shapes[rows] = np.einsum("nij,nik,njl->nkl", hessian / lengths[:, None, None], duals, duals)
    return fitted, shapes
