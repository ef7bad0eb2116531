"""Facets: single triangles."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.vectors import dot


def distances_to(triangles: Floats, points: Floats) -> Floats:
    """Return the distance (n,) of each point (n, 3) from its triangle (n, 3, 3), in their unit.

    Examples:
        >>> triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        >>> above, beside = [0.2, 0.2, 0.5], [-3.0, 0.0, 4.0]
        >>> distances_to(np.stack([triangle, triangle]), np.array([above, beside])).tolist()
        [0.5, 5.0]
    """
    begins, edges = triangles, np.roll(triangles, -1, axis=1) - triangles
    away = points[:, None] - begins
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    over = np.all(np.einsum("nij,nij->ni", np.cross(edges, away), normals[:, None]) >= 0.0, axis=1)
    share = np.einsum("nij,nij->ni", away, edges) / np.einsum("nij,nij->ni", edges, edges)
    to_edges = np.linalg.norm(away - np.clip(share, 0.0, 1.0)[..., None] * edges, axis=2).min(axis=1)
    distances: Floats = np.where(over, np.abs(dot(away[:, 0], normals)), to_edges)
    return distances
