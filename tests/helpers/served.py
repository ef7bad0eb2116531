"""A workbench of its own process, as people start it, and a client that asks it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import httpx

from tapelayer.workbench.foreman import COMMAND as WORKER
from tests.helpers.paths import ROOT

COMMAND = (sys.executable, "-c", "from tapelayer.dispatch import main; main()", "serve", "--port", "0", "--no-open")


class Workbench:
    """`tapelayer serve` on a work directory, with further options; its end is waited for.

    Attributes:
        work: the work directory.
        url: where it listens.
        process: the server.
    """

    def __init__(self, work: Path, *options: object) -> None:
        self.work = work
        command = [*COMMAND, "--work-dir", str(work), *map(str, options)]
        self.process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=os.environ | {"NO_COLOR": "1"}
        )
        assert self.process.stdout
        said = self.process.stdout.readline()
        if not said.startswith("workbench: http"):
            self.end(signal.SIGKILL)
            raise AssertionError("the workbench does not start; its stderr says why")
        self.url = said.split()[1].rstrip("/")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.end(signal.SIGTERM)

    def end(self, number: signal.Signals) -> int:
        """Send a signal; the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(20)
        assert self.process.stdout
        self.process.stdout.close()
        return code

    def workers(self) -> list[int]:
        """Processes of the server's workers, under way or waiting for an order."""
        children = [
            int(child)
            for task in Path(f"/proc/{self.process.pid}/task").glob("*/children")
            for child in task.read_text().split()
        ]
        # A process that is not yet the worker's is still the server's, with its `--workers`: whoever stops it stops the
        # server.
        module = WORKER[-1].encode()
        return [child for child in children if module in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")]

    def client(self) -> Client:
        """Somebody new."""
        return Client(base_url=self.url, timeout=60)


class Client(httpx.Client):
    """Somebody who submits jobs, and keeps the key that makes them theirs."""

    def submit(self, file: str, data: bytes, kind: str = "lay", **fields: Any) -> httpx.Response:
        """Submit a job; bytes are files, and `parts` a dict of them. Without a name, there is no file."""
        parts = [("parts", (name, content)) for name, content in fields.pop("parts", {}).items()]
        files = {name: (f"{name}.stl", value) for name, value in fields.items() if isinstance(value, bytes)}
        texts = {name: value for name, value in fields.items() if not isinstance(value, bytes)}
        sent = [*([("file", (file, data))] if file else []), *files.items(), *parts]
        # So that a form without a file is one of parts, too.
        spoken = [(name, (None, value)) for name, value in {"kind": kind, **texts}.items()]
        answer = self.post("/api/v1/jobs", files=[*sent, *spoken])
        if "owner_key" in answer.text:
            self.headers["X-Owner-Key"] = answer.json()["owner_key"]
        return answer

    def follow(self, job: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """Events of a job: name and data."""
        with self.stream("GET", f"/api/v1/jobs/{job}/events") as answer:
            assert answer.status_code == 200
            name = ""
            for line in answer.iter_lines():
                field, _, value = line.partition(": ")
                if field == "event":
                    name = value
                elif field == "data":
                    yield name, json.loads(value)

    def ended(self, job: str) -> dict[str, Any]:
        """A job when it has ended."""
        ((_, last),) = list(self.follow(job))[-1:]
        return last

    def made(self, file: str, data: bytes, kind: str = "lay", **fields: Any) -> dict[str, Any]:
        """A job that was submitted, and has ended."""
        accepted = self.submit(file, data, kind, **fields)
        assert accepted.status_code == 202, accepted.text
        return self.ended(accepted.json()["id"])

    def result(self, job: str, name: str) -> httpx.Response:
        """Answer of an address below a job."""
        return self.get(f"/api/v1/jobs/{job}/{name}")
