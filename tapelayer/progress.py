"""Progress: how long work says that it goes on, course by course."""

from __future__ import annotations

from collections.abc import Callable

# Called once for every course that is done.
Tick = Callable[[], None]


def silent() -> None:
    """Say nothing."""
