"""Progress: how long-running work reports its steps and finished courses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

# Called once per finished course.
Tick = Callable[[], None]


def silent() -> None:
    """Report nothing."""


class Steps(Protocol):
    """The receiver of a job's progress."""

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Start a step, with its number of ticks where that is known."""

    def tick(self) -> None:
        """Count one more tick as done."""


class _Unseen:
    """Steps that are not reported."""

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Report nothing."""

    def tick(self) -> None:
        """Report nothing."""


UNSEEN: Steps = _Unseen()
