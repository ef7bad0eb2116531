"""Sampling: how densely the judges sample a path between two block ends."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats, Ints

# Least number of samples between two block ends, however close they are.
LEAST_SAMPLES = 4


def sample_counts(lengths: Floats, step: float) -> Ints:
    """Return the number of samples (n,) of blocks of (n,) lengths in metres, at least one every `step` metres.

    Examples:
        >>> sample_counts(np.array([0.001, 0.095]), step=0.01).tolist()
        [4, 10]
    """
    return np.maximum(LEAST_SAMPLES, np.ceil(lengths / step).astype(np.int64))
