"""Mesh: a part's surface as facets.

Corners that are equal to the last bit are one vertex. Whether a gun can spray a facet depends on its normal, so
a facet without a reliable normal is not kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Frozen, Ints, frozen
from tapelayer.geometry.adjacency import blocks, facet_spans, neighbours
from tapelayer.geometry.mending import Mending
from tapelayer.units import Unit
from tapelayer.vectors import norms, unit


@dataclass(frozen=True, eq=False)
class Mesh(Frozen):
    """A surface of triangular facets.

    Attributes:
        vertices: (n, 3) metres, in the frame of the file.
        facets: (m, 3) vertex indices; counterclockwise seen from the side the normal points to.
        name: base name of the file.
        sha256: SHA-256 of the file's bytes, hexadecimal.
        unit: unit of the file's numbers.
        mending: repairs made.
    """

    vertices: Floats
    facets: Ints
    name: str
    sha256: str
    unit: Unit
    mending: Mending

    def moved(self, rotation: Floats, origin: Floats) -> Mesh:
        """Return the mesh turned by a rotation (3, 3), then moved by an origin (3,) in metres."""
        return replace(self, vertices=self.vertices @ rotation.T + origin)

    @cached_property
    def normals(self) -> Floats:
        """Unit normals (m, 3) of the facets, by their winding."""
        normals = np.empty(self.facets.shape)
        for block in blocks(len(normals)):
            spans = facet_spans(self.vertices, self.facets[block])
            normals[block] = unit(spans)
        return frozen(normals)

    @cached_property
    def upward_normals(self) -> Floats:
        """Unit normals (m, 3) of the facets on their upper side, nz >= 0, whatever the winding."""
        return frozen(np.where(self.normals[:, 2:] < 0, -self.normals, self.normals))

    @cached_property
    def areas(self) -> Floats:
        """Areas (m,) of the facets in square metres."""
        areas = np.empty(len(self.facets))
        for block in blocks(len(areas)):
            areas[block] = norms(facet_spans(self.vertices, self.facets[block])) / 2
        return frozen(areas)

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """Facet (m, 3) across the edge from each corner to the next, or -1: see `neighbours`."""
        return frozen(neighbours(self.facets, len(self.vertices)))
