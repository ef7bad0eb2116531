"""Foreman: the scheduler that runs each job in a worker process of its own and reports its progress.

Processes are started ahead of need and used once. If a job's process dies or is killed, other jobs are unaffected.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Mapping
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from tapelayer.workbench.problems import Problem, internal
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import SERVER_STOPPED, Store
from tapelayer.workbench.turns import Turns

# The last line of a worker: {"state": "done" | "failed", "summary": {...} | None, "error": {...} | None}.
Message = dict[str, Any]
Hear = Callable[[str, float], None]
Turn = AbstractAsyncContextManager[None]

# -P keeps Python from importing modules from the server's current folder.
COMMAND = (sys.executable, "-P", "-m", "tapelayer.workbench.worker")
WARM_AFTER_SECONDS = 2.0  # so that starting workers does not slow down the page's first view
RETRY_SECONDS = 10
SWEEP_SECONDS = 600.0
STOP_SECONDS = 2.0
LONGEST_LINE = 2**26
# Processes for brief work, beside those of the jobs.
BRIEF_WORKERS = 1

log = logging.getLogger(__name__)


def _spare_cores() -> int:
    return max(1, len(os.sched_getaffinity(0)) - 1)


@dataclass(frozen=True)
class Limits:
    """Limits on jobs.

    Attributes:
        workers: jobs that run at the same time.
        queue: jobs that may wait.
        job_seconds: longest run of a job.
        memory_bytes: most memory of a job's process.
        keep_days: days from the end of a job to its removal.
        undo_seconds: seconds from the deletion of a job to its removal, in which it can be brought back.
    """

    workers: int = field(default_factory=_spare_cores)
    queue: int = 200
    job_seconds: float = 1800.0
    memory_bytes: int = 8 * 2**30
    keep_days: float = 30.0
    undo_seconds: float = 3600.0


class Foreman:
    """Scheduler of the waiting and running jobs of a store.

    Args:
        store: keeps the jobs.
        limits: on the jobs.
    """

    def __init__(self, store: Store, limits: Limits) -> None:
        self.limits = limits
        self._store = store
        self._jobs: dict[str, _Run] = {}
        self._errands: set[asyncio.Task[Message]] = set()
        self._places: Mapping[str, int] = {}
        self._turns = Turns(limits.workers, self._moved)
        self._brief_turns = Turns(BRIEF_WORKERS, lambda: None)
        self._spares: deque[Process] = deque()
        self._chores: set[asyncio.Task[None]] = set()
        self._hiring: asyncio.Task[None] | None = None
        self._stopping = False

    async def start(self) -> None:
        """Clean up after the last server and resume the queued jobs."""
        for record in self._store.recover():
            self._take_on(record)
        self._chore(self._sweep())
        self._chore(self._warm_up())

    async def stop(self) -> None:
        """End every process; running jobs fail, queued jobs stay queued for the next start."""
        self._stopping = True
        for task in (*(run.work for run in self._jobs.values()), *self._errands, *self._chores):
            task.cancel()
        if tasks := [*(run.ending for run in self._jobs.values()), *self._errands, *self._chores]:
            await asyncio.wait(tasks, timeout=STOP_SECONDS)
        await asyncio.gather(*(_end(spare) for spare in self._spares))
        self._spares.clear()

    def check_room(self) -> None:
        """Refuse new work if the queue is full.

        Raises:
            Problem: the queue is full, or the server is being stopped.
        """
        if self._stopping:
            raise Problem("server-stopped", "the server is being stopped; send this again to the next one")
        waiting = len(self._jobs) + len(self._errands) - self.limits.workers
        if waiting >= self.limits.queue:
            sentence = f"the queue is full ({waiting} waiting); try again in {RETRY_SECONDS} s"
            raise Problem("queue-full", sentence, {"Retry-After": str(RETRY_SECONDS)})

    def submit(self, record: Record) -> None:
        """Schedule a queued job.

        Raises:
            Problem: as `check_room`; the job stays in the store.
        """
        self.check_room()
        self._take_on(record)

    async def run(self, folder: Path, owner: str, *, brief: bool = False) -> Message:
        """Run a request from a folder outside the store, when its turn comes, and return the worker's last message.

        Args:
            folder: of the request.
            owner: whose turn it takes.
            brief: it takes seconds, and does not wait for the jobs.

        Raises:
            Problem: as `check_room`, or the server was stopped meanwhile.
        """
        self.check_room()
        turn = (self._brief_turns if brief else self._turns).of(owner, "")
        task = asyncio.create_task(self._work(folder, turn, partial(asyncio.sleep, 0), lambda stage, progress: None))
        self._errands.add(task)
        task.add_done_callback(self._errands.discard)
        try:
            return await task
        except asyncio.CancelledError:
            if self._stopping:
                raise Problem("server-stopped", SERVER_STOPPED) from None
            raise

    async def cancel(self, job: str) -> Record:
        """Cancel a waiting or running job, and return its record once its process has ended and the store knows.

        Raises:
            Problem: there is no such job.
        """
        run = self._jobs.get(job)
        if run:
            run.work.cancel()
            # A full disk must not block the request that frees space.
            await asyncio.wait([run.ending], timeout=STOP_SECONDS)
        return await asyncio.to_thread(self._store.find, job)

    def places(self) -> Mapping[str, int]:
        """Return the place of each waiting job in the queue, from 1; programs that wait to be judged count too."""
        return self._places

    def describe(self, record: Record) -> None:
        """Tell the watchers of a job that its title or its note has changed."""
        if run := self._jobs.get(record.id):
            run.tell(replace(run.record, title=record.title, note=record.note))

    async def watch(self, job: str) -> AsyncIterator[Record]:
        """Yield a job's record now and at every change, until the job has ended or the server stops.

        Raises:
            Problem: there is no such job.
        """
        run = self._jobs.get(job)
        if not run:
            yield await asyncio.to_thread(self._store.get, job)
            return
        over = False
        while not over:
            # Take the bell before yielding, so that a change while the watcher is busy is not missed.
            bell, over = run.bell, run.over
            yield run.record
            if not over:
                await bell.wait()

    def _take_on(self, record: Record) -> None:
        run = _Run(record)
        begin, hear = partial(self._begin, run), partial(self._advance, run)
        turn = self._turns.of(record.owner, record.id)
        run.work = asyncio.create_task(self._work(self._store.folder(record.id), turn, begin, hear))
        run.ending = asyncio.create_task(self._settle(run))
        self._jobs[record.id] = run

    def _moved(self) -> None:
        """Note the places in the queue, and tell the watchers of waiting jobs that it has moved."""
        # Other threads read the places, so they are replaced and never changed.
        self._places = {job: place for place, job in enumerate(self._turns.line(), 1) if job}
        for run in self._jobs.values():
            if run.record.state == "queued":
                run.tell(run.record)

    async def _begin(self, run: _Run) -> None:
        run.tell(await asyncio.to_thread(self._store.begin, run.record.id))

    def _advance(self, run: _Run, stage: str, progress: float) -> None:
        self._store.advance(run.record.id, stage, progress)
        run.tell(replace(run.record, stage=stage, progress=progress))

    async def _settle(self, run: _Run) -> None:
        """Store how a job ended, and notify its watchers."""
        await asyncio.wait([run.work])
        try:
            if not (run.work.cancelled() and self._stopping and run.record.state == "queued"):
                await self._keep(run, self._outcome(run.work))
        finally:
            self._jobs.pop(run.record.id)
            run.end()

    async def _keep(self, run: _Run, message: Message) -> None:
        """Store the last message about a job; retry while the disk is full, since only then has the job ended."""
        while True:
            try:
                finish = partial(self._store.finish, run.record.id, message["state"])
                run.tell(await asyncio.to_thread(finish, message["summary"], message["error"]))
                return
            except Problem as problem:
                # The job was removed meanwhile.
                if problem.code == "not-found":
                    return
                log.error("job %s: %s", run.record.id, problem)
                await asyncio.sleep(RETRY_SECONDS)

    def _outcome(self, task: asyncio.Task[Message]) -> Message:
        if task.cancelled() and self._stopping:
            return _failed(Problem("server-stopped", SERVER_STOPPED))
        if task.cancelled():
            return _failed(Problem("cancelled", "the job was cancelled")) | {"state": "cancelled"}
        error = task.exception()
        if error is None:
            return task.result()
        if isinstance(error, Problem):
            return _failed(error)
        problem = internal()
        log.error("reference %s", problem.evidence["reference"], exc_info=error)
        return _failed(problem)

    async def _work(self, folder: Path, turn: Turn, begin: Callable[[], Awaitable[None]], hear: Hear) -> Message:
        """Wait for the turn, give the folder to a worker, and return the worker's last message."""
        async with turn:
            process = await self._hire()
            try:
                await begin()
                async with asyncio.timeout(self.limits.job_seconds):
                    return await self._converse(process, folder, hear)
            except TimeoutError:
                sentence = f"the job took longer than the {self.limits.job_seconds:g} s that the server gives to one"
                return _failed(Problem("out-of-time", f"{sentence}; thin its points or triangles out, or split it"))
            finally:
                await _end(process)

    async def _converse(self, process: Process, folder: Path, hear: Hear) -> Message:
        assert process.stdin and process.stdout
        order = {"folder": str(folder), "memory_bytes": self.limits.memory_bytes}
        process.stdin.write(json.dumps(order).encode() + b"\n")
        async for line in process.stdout:
            # A killed worker may leave an incomplete last line.
            message = json.loads(line) if line.endswith(b"\n") else {}
            if "state" in message:
                return dict(message)
            if "stage" in message:
                hear(message["stage"], message["progress"])
        code = await process.wait()
        cause = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with status {code}"
        return _failed(Problem("worker-killed", f"the job's process {cause}; only this job is lost, submit it again"))

    async def _hire(self) -> Process:
        """Return a worker that waits for its order."""
        process = None
        while self._spares and not process:
            spare = self._spares.popleft()
            process = spare if spare.returncode is None else None
        process = process or await _spawn()
        self._refill()
        return process

    def _refill(self) -> None:
        if not self._hiring or self._hiring.done():
            self._hiring = self._chore(self._fill_up())

    async def _fill_up(self) -> None:
        while len(self._spares) < self.limits.workers:
            self._spares.append(await _spawn())

    async def _warm_up(self) -> None:
        await asyncio.sleep(WARM_AFTER_SECONDS)
        self._refill()

    async def _sweep(self) -> None:
        """Remove expired jobs every `SWEEP_SECONDS`."""
        while True:
            try:
                await asyncio.to_thread(self._store.expire, self.limits.keep_days, self.limits.undo_seconds)
            except Exception:
                log.exception("expired jobs could not be removed")
            await asyncio.sleep(SWEEP_SECONDS)

    def _chore(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._chores.add(task)
        task.add_done_callback(self._chores.discard)
        return task


class _Run:
    """A waiting or running job, and the bell that its watchers wait for.

    Args:
        record: current record of the job.

    Attributes:
        work: task that returns the last message about the job.
        ending: task that ends once that message is stored.
    """

    work: asyncio.Task[Message]
    ending: asyncio.Task[None]

    def __init__(self, record: Record) -> None:
        self.record = record
        self.bell = asyncio.Event()
        self.over = False

    def tell(self, record: Record) -> None:
        """Replace the record and notify the watchers."""
        self.record = record
        self._ring()

    def end(self) -> None:
        """Release the watchers."""
        self.over = True
        self._ring()

    def _ring(self) -> None:
        self.bell.set()
        self.bell = asyncio.Event()


async def _spawn() -> Process:
    """Start a worker in a process group of its own."""
    return await asyncio.create_subprocess_exec(
        *COMMAND, stdin=PIPE, stdout=PIPE, limit=LONGEST_LINE, start_new_session=True
    )


async def _end(process: Process) -> None:
    """Kill a worker and all its children; it reports results only after saving them, so none are lost."""
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    await process.wait()


def _failed(problem: Problem) -> Message:
    return {"state": "failed", "summary": None, "error": problem.body()}
