"""Progress bar: how far a job has come, on a terminal."""

from __future__ import annotations

import sys
import time
from typing import Self

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from tapelayer.cli.application import notices


class ProgressBar:
    """Progress on stderr: a bar if it is a terminal, and a line for each step if verbose.

    Args:
        quiet: print nothing.
        verbose: print how long each step took.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
        )
        hidden = quiet or not notices.is_terminal
        self._bar = Progress(*columns, console=notices, transient=True, disable=hidden)
        self._task = self._bar.add_task("", total=None)
        self._verbose = verbose and not quiet
        self._step, self._begun = "", 0.0

    def __enter__(self) -> Self:
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(self, *raised: object) -> None:
        """Remove the bar."""
        self._end()
        self._bar.stop()

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Begin a step, with its number of ticks if that is known."""
        self._end()
        self._step, self._begun = step, time.perf_counter()
        self._bar.reset(self._task, description=step, total=ticks)

    def tick(self) -> None:
        """Count one more tick as done."""
        self._bar.advance(self._task)

    def _end(self) -> None:
        if self._verbose and self._step:
            sys.stderr.write(f"{self._step}: {time.perf_counter() - self._begun:.2f} s\n")
