"""Meshes in metres, of arrays."""

from __future__ import annotations

import numpy as np
import trimesh

from tapelayer.geometry.mending import Mending, mended
from tapelayer.geometry.mesh import Mesh


def surface(vertices, facets):
    """A mesh of exactly these facets."""
    facets = np.asarray(facets, dtype=np.int64)
    return Mesh(np.asarray(vertices, dtype=np.float64), facets, "", "", "m", Mending(len(facets)))


def of_shape(shape):
    """A mesh of exactly the facets of a trimesh shape."""
    return surface(shape.vertices, shape.faces)


def from_triangles(triangles):
    vertices, facets, mending = mended(np.asarray(triangles, dtype=np.float64))
    return Mesh(vertices, facets, "", "", "m", mending)


def box(low, high):
    return trimesh.creation.box(bounds=[low, high]).triangles


def inside(mesh, direction, count):
    altitudes = mesh.vertices @ direction
    return np.linspace(altitudes.min(), altitudes.max(), count + 2)[1:-1]
