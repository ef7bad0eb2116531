"""Surfaces to spray: sheets over a grid, and the STL files of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.geometry.mending import mended
from tapelayer.geometry.mesh import Mesh

Height = Callable[[Floats, Floats], Floats]


def sheet(x: Sequence[float], y: Sequence[float], height: Height, hole: Sequence[float] = ()) -> Floats:
    """Triangles (m, 3, 3) of a sheet over a grid in mm, without the cells inside a hole (x0, x1, y0, y1)."""
    across, along = np.meshgrid(np.asarray(x, float), np.asarray(y, float), indexing="ij")
    points = np.stack([across, along, height(across, along)], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2).reshape(-1, 3, 3)
    if len(hole):
        middles = triangles.mean(axis=1)
        inside = (middles[:, 0] > hole[0]) & (middles[:, 0] < hole[1]) & (middles[:, 1] > hole[2])
        triangles = triangles[~(inside & (middles[:, 1] < hole[3]))]
    return triangles


def flat(x: Floats, y: Floats) -> Floats:
    return np.zeros_like(x + y)


def mesh_of(triangles: Floats) -> Mesh:
    """Mesh of triangles in mm."""
    vertices, facets, mending = mended(triangles / 1e3)
    return Mesh(vertices, facets, "panel.stl", "0" * 64, "mm", mending)


def stl_bytes(triangles: Floats) -> bytes:
    """Binary STL of triangles (m, 3, 3)."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records = np.zeros(len(triangles), dtype=record)
    records["corners"] = triangles
    return b"\0" * 80 + len(triangles).to_bytes(4, "little") + records.tobytes()


def write_stl(path: Path, triangles: Floats) -> Path:
    """Binary STL file of triangles (m, 3, 3)."""
    path.write_bytes(stl_bytes(triangles))
    return path
