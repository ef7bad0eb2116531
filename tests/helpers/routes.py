"""Routes asked without a server: an application of one router, with the workbench's own answers to what it refuses."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
from fastapi import APIRouter, FastAPI

from tapelayer.workbench.server import answer_problems


class Asking:
    """A client of one router."""

    def __init__(self, router: APIRouter) -> None:
        self.app = FastAPI()
        self.app.include_router(router)
        answer_problems(self.app)

    def get(self, path: str, **options: Any) -> httpx.Response:
        return asyncio.run(self._ask("GET", path, options))

    def post(self, path: str, **options: Any) -> httpx.Response:
        return asyncio.run(self._ask("POST", path, options))

    async def _ask(self, method: str, path: str, options: dict[str, Any]) -> httpx.Response:
        transport = httpx.ASGITransport(self.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
            return await client.request(method, path, **options)
