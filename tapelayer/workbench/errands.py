"""Errands: work of a worker that a request waits for, in a folder that goes with it."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import Request
from starlette.concurrency import run_in_threadpool

from tapelayer.workbench.foreman import Foreman, Message
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.store import Store


def store_of(request: Request) -> Store:
    """Return the server's store."""
    store: Store = request.app.state.store
    return store


def foreman_of(request: Request) -> Foreman:
    """Return the server's foreman."""
    foreman: Foreman = request.app.state.foreman
    return foreman


@asynccontextmanager
async def staged(store: Store) -> AsyncIterator[Path]:
    """Yield a folder for uploads, and remove it unless it has become a job's."""
    folder = await run_in_threadpool(store.stage)
    try:
        yield folder
    finally:
        await run_in_threadpool(shutil.rmtree, folder, ignore_errors=True)


async def while_there(request: Request, work: Awaitable[Message]) -> Message:
    """Return the result of work, which is cancelled if the client disconnects.

    Raises:
        Problem: the client has disconnected.
    """
    working = asyncio.ensure_future(work)
    # The body has been read: the next message can only be a disconnect.
    going = asyncio.ensure_future(request.receive())
    try:
        await asyncio.wait((working, going), return_when=asyncio.FIRST_COMPLETED)
    finally:
        going.cancel()
        working.cancel()
        await asyncio.wait((working,))
    if working.cancelled():
        raise Problem("cancelled", "whoever asked has gone")
    return working.result()
