"""Verification: the only door to an NC program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tapelayer.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Verified:
    """A trajectory that passed verification, with its evidence; only `verify` makes one.

    Attributes:
        trajectory: what was verified.
        evidence: every number that was measured.
    """

    trajectory: Trajectory
    evidence: Any
