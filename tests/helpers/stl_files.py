"""STL files, byte by byte."""

from __future__ import annotations

import struct

import numpy as np

TETRAHEDRON = np.array([[0.0, 0, 0], [60, 0, 0], [0, 70, 0], [0, 0, 80]])[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]


def binary(triangles, count=None, tail=b""):
    triangles = np.asarray(triangles, dtype="<f4")
    body = b"".join(bytes(12) + corners.tobytes() + b"\0\0" for corners in triangles)
    return (
        b"solid made by a test".ljust(80) + struct.pack("<I", len(triangles) if count is None else count) + body + tail
    )


def ascii(triangles, name="part"):
    lines = [f"solid {name}"]
    for corners in np.asarray(triangles):
        lines += ["facet normal 0 0 1", " outer loop"]
        lines += [f"  vertex {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


def written(directory, data):
    path = directory / "part.stl"
    path.write_bytes(data)
    return path
