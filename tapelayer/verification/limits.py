"""Limits: what a setup allows, resolved once and carried with the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Limit:
    """What a quantity may be at most.

    Attributes:
        value: in the unit of the quantity's key.
        judged: False where the setup leaves the quantity free: it is measured, and fails nothing.
    """

    value: float
    judged: bool = True

    def kept(self, value: float | None) -> bool:
        """Return whether a value keeps the limit; what was not measured keeps none.

        Examples:
            >>> [Limit(0.05).kept(value) for value in (0.05, 0.06, None, float("nan"))]
            [True, False, False, False]
        """
        return value is not None and value <= self.value


# Limits by the key of the quantity.
Limits = Mapping[str, Limit]
