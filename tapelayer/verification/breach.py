"""Breach: a block of a program that breaks a rule, before it is known which course or pass the block serves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Breach:
    """A block that breaks a rule.

    Attributes:
        block: index of the block.
        what: the quantity, as in the report's keys.
        value: measured value, in the quantity's unit.
        limit: largest allowed value, in the same unit.
    """

    block: int
    what: str
    value: float
    limit: float
