"""Limits: the limits of a setup, resolved once and carried with the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Limit:
    """The largest or least allowed value of a quantity.

    Attributes:
        value: in the unit of the quantity's key.
        judged: False where the setup leaves the quantity free, so that it is measured and cannot fail.
        least: whether it is the least allowed value.
    """

    value: float
    judged: bool = True
    least: bool = False

    def kept(self, value: float | None) -> bool:
        """Return whether a value keeps the limit; what was not measured keeps none.

        Examples:
            >>> [Limit(0.05).kept(value) for value in (0.05, 0.06, None, float("nan"))]
            [True, False, False, False]
            >>> [Limit(95.0, least=True).kept(value) for value in (95.0, 94.0, None, float("nan"))]
            [True, False, False, False]
        """
        return value is not None and (value >= self.value if self.least else value <= self.value)


# Limits by the key of the quantity.
Limits = Mapping[str, Limit]
