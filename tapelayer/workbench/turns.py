"""Turns: who may work next, fairly among owners."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class _Waiting:
    """Whoever waits for a turn: a job, or without a name what is not in the store."""

    job: str
    turn: asyncio.Future[None]


class Turns:
    """A limited number of concurrent turns: round robin over the owners, first come, first served for each owner.

    Args:
        count: turns at the same time.
        moved: called whenever the line of those who wait has changed.
    """

    def __init__(self, count: int, moved: Callable[[], None]) -> None:
        self._free = count
        self._moved = moved
        self._waiting: dict[str, deque[_Waiting]] = {}

    @asynccontextmanager
    async def of(self, owner: str, job: str) -> AsyncIterator[None]:
        """Wait for an owner's turn and hold it."""
        await self._take(owner, job)
        try:
            yield
        finally:
            self._give_back()

    def line(self) -> list[str]:
        """Return the jobs that wait, in the order in which they get their turns if nobody joins."""
        queues = deque(deque(each for each in queue if not each.turn.cancelled()) for queue in self._waiting.values())
        line = []
        while queues:
            queue = queues.popleft()
            if queue:
                line.append(queue.popleft().job)
                queues.append(queue)
        return line

    async def _take(self, owner: str, job: str) -> None:
        if self._free:
            self._free -= 1
            return
        waiting = _Waiting(job, asyncio.get_running_loop().create_future())
        self._waiting.setdefault(owner, deque()).append(waiting)
        self._moved()
        try:
            await waiting.turn
        except asyncio.CancelledError:
            # The turn was granted before the cancellation arrived: pass it on.
            if not waiting.turn.cancelled():
                self._give_back()
            raise
        finally:
            self._moved()

    def _give_back(self) -> None:
        """Hand the turn to the next owner, who then moves to the end of the line."""
        while self._waiting:
            owner = next(iter(self._waiting))
            queue = self._waiting.pop(owner)
            turn = queue.popleft().turn
            if queue:
                self._waiting[owner] = queue
            if not turn.cancelled():
                turn.set_result(None)
                return
        self._free += 1
