"""Progress: how long work says that it goes on, step by step and course by course."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

# Called once for every course that is done.
Tick = Callable[[], None]


def silent() -> None:
    """Say nothing."""


class Steps(Protocol):
    """Who is told what is under way."""

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Go on to a step, of so many ticks where they are known."""

    def tick(self) -> None:
        """One more is done."""


class _Unseen:
    """Steps that nobody looks at."""

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Say nothing."""

    def tick(self) -> None:
        """Say nothing."""


UNSEEN: Steps = _Unseen()
