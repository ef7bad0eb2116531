"""Vectors: products, lengths and directions of rows of vectors, and the numbering of parts."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats, Ints


def dot(left: Floats, right: Floats) -> Floats:
    """Return the scalar product (n,) of each row of (n, k) and (n, k) vectors.

    Examples:
        >>> dot(np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])).tolist()
        [11.0]
    """
    products: Floats = np.einsum("ij,ij->i", left, right)
    return products


def norms(vectors: Floats) -> Floats:
    """Return the length (n,) of each of (n, k) vectors.

    Examples:
        >>> norms(np.array([[3.0, 4.0], [0.0, 0.0]])).tolist()
        [5.0, 0.0]
    """
    lengths: Floats = np.sqrt(dot(vectors, vectors))
    return lengths


def unit(vectors: Floats) -> Floats:
    """Return the direction (n, k) of each of (n, k) vectors, of length 1; NaN for a vector of length 0.

    Examples:
        >>> unit(np.array([[3.0, 4.0]])).tolist()
        [[0.6, 0.8]]
    """
    return vectors / norms(vectors)[:, None]


def ramp(counts: Ints) -> tuple[Ints, Ints]:
    """Return the owner (m,) of each part, for owners of (n,) parts each, and the part's number (m,) in it from 0.

    Examples:
        >>> owners, numbers = ramp(np.array([2, 0, 3]))
        >>> owners.tolist(), numbers.tolist()
        ([0, 0, 2, 2, 2], [0, 1, 0, 1, 2])
    """
    owners = np.repeat(np.arange(len(counts)), counts)
    return owners, np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
