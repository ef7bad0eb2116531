"""Vectors: rows of vectors, each with its own product, length or direction."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats


def dot(left: Floats, right: Floats) -> Floats:
    """Return the scalar product (n,) of each row of (n, k) and (n, k) vectors."""
    products: Floats = np.einsum("ij,ij->i", left, right)
    return products


def norms(vectors: Floats) -> Floats:
    """Return the length (n,) of each of (n, k) vectors."""
    lengths: Floats = np.sqrt(dot(vectors, vectors))
    return lengths


def unit(vectors: Floats) -> Floats:
    """Return the direction (n, k) of each of (n, k) vectors, of length 1; NaN for a vector of length 0."""
    return vectors / norms(vectors)[:, None]
