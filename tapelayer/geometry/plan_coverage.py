"""Plan coverage: how far points are from a part, seen from above."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.geometry.mesh import Mesh
from tapelayer.vectors import dot

# Pairs of points and edges evaluated at a time.
_PAIRS = 1 << 21


class PlanCoverage:
    """A part seen from above: the edges that can bound the area it covers, and its facets.

    Args:
        mesh: the part.
    """

    def __init__(self, mesh: Mesh) -> None:
        upwards = np.sign(mesh.normals[:, 2])
        across = mesh.neighbours
        # An edge between two facets that face alike has the part on both sides.
        folded = (across < 0) | (upwards[:, None] * upwards[across] <= 0.0)
        facets, corners = np.nonzero(folded)
        plan = mesh.vertices[:, :2]
        self._begins = plan[mesh.facets[facets, corners]]
        self._edges = plan[mesh.facets[facets, (corners + 1) % 3]] - self._begins
        self._triangles = plan[mesh.facets]

    def distances(self, points: Floats, limit: float) -> Floats:
        """Return the distance (n,) in metres of points (n, 2) from the covered area; 0 inside, exact above the limit.

        Args:
            points: metres, in the mesh's frame.
            limit: metres up to which a point counts as over the part: there the distance is that to the nearest edge.

        Examples:
            >>> from tapelayer.geometry.mending import Mending
            >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
            >>> mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), "square.stl", "", "m", Mending(2))
            >>> PlanCoverage(mesh).distances(np.array([[0.5, 0.5], [1.0, 3.0]]), limit=0.01).tolist()
            [0.0, 2.0]
        """
        distances = np.concatenate([self._to_edges(part) for part in _parts(points, len(self._begins))])
        far = np.flatnonzero(distances > limit)
        if len(far):
            covered = np.concatenate([self._covered(part) for part in _parts(points[far], len(self._triangles))])
            distances[far[covered]] = 0.0
        return distances

    def _to_edges(self, points: Floats) -> Floats:
        away = points[:, None] - self._begins
        squares = dot(self._edges, self._edges)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nan_to_num(np.einsum("nij,ij->ni", away, self._edges) / squares)
        off = away - np.clip(share, 0.0, 1.0)[..., None] * self._edges
        distances: Floats = np.sqrt(np.min(np.einsum("nij,nij->ni", off, off), axis=1, initial=np.inf))
        return distances

    def _covered(self, points: Floats) -> Mask:
        sides = []
        for corner in range(3):
            begin, end = self._triangles[:, corner], self._triangles[:, (corner + 1) % 3]
            edge, away = end - begin, points[:, None] - begin
            sides.append(edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0])
        covered: Mask = np.any((np.min(sides, axis=0) >= 0.0) | (np.max(sides, axis=0) <= 0.0), axis=1)
        return covered


def _parts(points: Floats, others: int) -> list[Floats]:
    """Split the points into parts with no more than `_PAIRS` pairs each."""
    count = max(len(points) * others // _PAIRS + 1, 1)
    return np.array_split(points, min(count, max(len(points), 1)))
