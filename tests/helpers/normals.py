"""Unit vectors."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats


def unit(vectors: Floats) -> Floats:
    normalised: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return normalised


def tilted(degrees: Floats | list[float], azimuth: float = 0.0) -> Floats:
    """Unit normals (n, 3) that lean by (n,) degrees towards an azimuth in degrees."""
    phi, theta = np.radians(degrees), math.radians(azimuth)
    return np.column_stack([np.sin(phi) * math.cos(theta), np.sin(phi) * math.sin(theta), np.cos(phi)])
