"""Vectors: rows of vectors, each with its own product, length or direction, and rows that are parts of others."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats, Ints


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


def ramp(counts: Ints) -> tuple[Ints, Ints]:
    """Return the owner (m,) of each part of things with (n,) parts, one after the other, and its number (m,) from 0."""
    owners = np.repeat(np.arange(len(counts)), counts)
    return owners, np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
