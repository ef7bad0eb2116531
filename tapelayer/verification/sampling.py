"""Sampling: how densely the judges look at a path between two block ends."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats, Ints

# Between two block ends the path is looked at this often, however short it is.
LEAST_SAMPLES = 4


def sample_counts(lengths: Floats, step: float) -> Ints:
    """Return how often (n,) blocks of (n,) lengths are looked at, one every `step` metres at least."""
    return np.maximum(LEAST_SAMPLES, np.ceil(lengths / step).astype(np.int64))
