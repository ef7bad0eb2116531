"""Footprints, one of each model."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.spraying.footprint import Gaussian, ParabolicFlux, ParabolicPass, Profile

H = 0.15
RING = Profile(np.array([0.0, 0.01, 0.018, 0.03]), np.array([2.0, 5.0, 1.0, 1.0]))
FOOTPRINTS = [Gaussian(0.015), ParabolicFlux(0.03), ParabolicPass(0.03), RING]
each_footprint = pytest.mark.parametrize("footprint", FOOTPRINTS, ids=lambda one: type(one).__name__)
