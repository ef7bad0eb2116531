"""Jobs run one process each: in turn, apart from each other, and none is lost without a reason."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import signal
import sys
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.workbench import foreman as foreman_module
from tapelayer.workbench.foreman import Foreman, Limits
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import Store
from tests.helpers.panels import flat, sheet, write_stl
from tests.helpers.paths import EXAMPLES, ROOT

COURSES = EXAMPLES / "flat_panel_00.txt"
# A worker for what only the foreman decides: it starts at once, and does what the request's name says.
STAND_IN = """
import json, os, pathlib, signal, sys, time
def say(**message):
    sys.stdout.write(json.dumps(message) + "\\n")
    sys.stdout.flush()
say(ready=True)
order = json.loads(sys.stdin.readline())
folder = pathlib.Path(order["folder"])
request = json.loads((folder / "request.json").read_text())
say(stage="planning", progress=0.25)
(folder / "pid").write_text(str(os.getpid()))
act = request["name"].split()[0]
if act == "hold":
    (folder / "begun").touch()
    sys.stdin.read()
    sys.exit(1)
if act == "leave":
    sys.exit(3)
if act == "tear":
    sys.stdout.write('{"state": "do')
    sys.stdout.flush()
    os.kill(os.getpid(), signal.SIGTERM)
source = (folder / "source").read_text() if (folder / "source").exists() else ""
say(state="done", summary={"source": source, "memory": order["memory_bytes"]}, error=None)
time.sleep(100)
"""


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "stand_in.py"
    script.write_text(STAND_IN)
    monkeypatch.setattr(foreman_module, "COMMAND", (sys.executable, "-S", str(script)))


def add(store: Store, name: str, owner: str = "ann", source: bytes = b"", **request: Any) -> Record:
    staged = store.stage()
    (staged / "source").write_bytes(source or name.encode())
    (staged / "setup.toml").write_bytes(b"")
    asked = {"kind": "lay", "name": name, "program_name": "a.nc", "parts": []}
    return store.create(owner, asked | request, staged)


def served(work: Path, limits: Limits, scenario: Callable[[Store, Foreman], Awaitable[None]]) -> None:
    """Play a scenario with a foreman that is started before and stopped after it."""

    async def play() -> None:
        store = Store(work)
        foreman = Foreman(store, limits)
        await foreman.start()
        try:
            await scenario(store, foreman)
        finally:
            await foreman.stop()
            store.close()

    asyncio.run(play())


async def until(fact: Callable[[], bool]) -> None:
    async with asyncio.timeout(60):
        while not fact():
            await asyncio.sleep(0.01)


async def ended(foreman: Foreman, record: Record) -> Record:
    return [seen async for seen in foreman.watch(record.id)][-1]


async def begun(store: Store, record: Record) -> int:
    """Process of a job that holds, and has been heard."""
    await until((store.folder(record.id) / "begun").exists)
    await until(lambda: store.get(record.id).stage == "planning")
    return int((store.folder(record.id) / "pid").read_text())


def gone(process: int) -> bool:
    """Whether a process has ended, also where nobody has asked how."""
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_real_jobs_run_side_by_side(tmp_path: Path) -> None:
    """One is laid, one sprayed, and one is killed, which is all that becomes of it."""
    plate = write_stl(tmp_path / "plate.stl", sheet(np.linspace(0, 300, 7), [0, 50, 100], flat)).read_bytes()

    async def scenario(store: Store, foreman: Foreman) -> None:
        laid = add(store, "a.txt", source=COURSES.read_bytes())
        sprayed = add(store, "plate.stl", source=plate, kind="spray", unit="mm")
        stuck = add(store, "b.txt")
        (store.folder(stuck.id) / "source").unlink()
        os.mkfifo(store.folder(stuck.id) / "source")
        for record in (stuck, laid, sprayed):
            foreman.submit(record)
        await until(lambda: store.get(stuck.id).stage == "reading")
        inside = store.folder(stuck.id) / "parts"
        [process] = [int(found.parent.name) for found in Path("/proc").glob("[0-9]*/cwd") if stands_in(found, inside)]
        os.kill(process, signal.SIGKILL)
        killed = await ended(foreman, stuck)
        assert killed.state == "failed" and killed.error is not None
        assert killed.error["code"] == "worker-killed"
        assert killed.error["detail"] == (
            "the job's process was killed by SIGKILL; only this job is lost, submit it again"
        )
        done = await ended(foreman, laid)
        assert (done.state, done.error, done.progress) == ("done", None, 1.0)
        told = Job.read(COURSES, Setup()).make("a.nc")
        assert done.summary is not None and done.summary["blocks"] == told.evidence.blocks
        assert (await ended(foreman, sprayed)).state == "done"

    served(tmp_path / "work", Limits(workers=2), scenario)


def stands_in(link: Path, folder: Path) -> bool:
    try:
        return link.readlink() == folder
    except OSError:
        return False


def test_fifty_jobs_of_eight_owners_are_not_mixed_up(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        records = [add(store, f"done {n}", f"owner{n % 8}") for n in range(50)]
        for record in records:
            foreman.submit(record)
        for n, last in enumerate(await asyncio.gather(*(ended(foreman, record) for record in records))):
            assert last.state == "done" and last.id == records[n].id
            assert last.summary == {"source": f"done {n}", "memory": 12345678}
        for k in range(8):
            assert [record.name for record in store.of_owner(f"owner{k}")] == [
                f"done {n}" for n in reversed(range(50)) if n % 8 == k
            ]

    served(tmp_path / "work", Limits(workers=3, memory_bytes=12345678), scenario)


def test_owners_take_turns(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        first = add(store, "hold")
        foreman.submit(first)
        await begun(store, first)
        records = [add(store, f"done {owner}", owner) for owner in "aaaabbc"]
        for record in records:
            foreman.submit(record)
        await foreman.cancel(records[1].id)
        await foreman.cancel(first.id)
        ends = [await ended(foreman, record) for record in records]
        in_turn = sorted((last for last in ends if last.state == "done"), key=lambda last: str(last.finished_at))
        assert "".join(last.owner for last in in_turn) == "abcaba"
        assert [last.id for last in in_turn if last.owner == "a"] == [records[n].id for n in (0, 2, 3)]

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_watchers_see_a_job_from_where_it_is_to_its_end(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        record = add(store, "hold")
        foreman.submit(record)
        first = foreman.watch(record.id)
        assert (await anext(first)).state == "queued"
        await begun(store, record)
        second = foreman.watch(record.id)
        assert (await anext(second)).stage == "planning"
        cancelled = await foreman.cancel(record.id)
        store.delete(record.id)
        seen = [found async for found in first]
        assert seen == [cancelled] == [found async for found in second]
        with pytest.raises(Problem, match="there is no job"):
            await anext(foreman.watch(record.id))
        other = add(store, "done")
        foreman.submit(other)
        states = [(found.state, found.stage, found.progress) async for found in foreman.watch(other.id)]
        assert states[0] == ("queued", "", 0.0) and states[-1] == ("done", "planning", 1.0)
        assert [found async for found in foreman.watch(other.id)] == [store.get(other.id)]

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_job_can_be_cancelled_while_it_waits_and_while_it_runs(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        running, waiting, after = add(store, "hold"), add(store, "hold"), add(store, "done")
        for record in (running, waiting, after):
            foreman.submit(record)
        process = await begun(store, running)
        first = await foreman.cancel(waiting.id)
        assert (first.state, first.stage) == ("cancelled", "")
        second = await foreman.cancel(running.id)
        assert (second.state, second.stage, second.progress) == ("cancelled", "planning", 0.25)
        assert second.error is not None and second.error["code"] == "cancelled"
        assert gone(process)
        done = await ended(foreman, after)
        assert done.state == "done"
        assert await foreman.cancel(after.id) == done
        assert not (store.folder(waiting.id) / "begun").exists()
        with pytest.raises(Problem, match="there is no job ffff"):
            await foreman.cancel("ffff")

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_job_ends_when_the_disk_has_room_for_that(
    tmp_path: Path, stand_in: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreman_module, "RETRY_SECONDS", 0.01)
    monkeypatch.setattr(foreman_module, "STOP_SECONDS", 0.1)

    async def scenario(store: Store, foreman: Foreman) -> None:
        record, removed = add(store, "hold"), add(store, "hold too")
        foreman.submit(record)
        foreman.submit(removed)
        await begun(store, record)
        watcher = asyncio.create_task(ended(foreman, record))
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
        try:
            assert (await foreman.cancel(record.id)).state == "running"
            await foreman.cancel(removed.id)
            assert not watcher.done()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        store.delete(removed.id)
        assert (await watcher).state == "cancelled"
        assert store.get(record.id).state == "cancelled"
        await until(lambda: not foreman._jobs)

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_slow_disk_holds_nobody_up(tmp_path: Path, stand_in: None) -> None:
    held, seen = threading.Event(), threading.Event()

    def slow(store: Store) -> bool:
        with store._change():
            held.set()
            return seen.wait(10)

    async def scenario(store: Store, foreman: Foreman) -> None:
        running, waiting = add(store, "hold"), add(store, "done")
        foreman.submit(running)
        worker = await begun(store, running)
        disk = asyncio.create_task(asyncio.to_thread(slow, store))
        await until(held.is_set)
        cancelling = asyncio.create_task(foreman.cancel(running.id))
        foreman.submit(waiting)
        await until(lambda: gone(worker))
        await asyncio.sleep(0.1)
        assert not cancelling.done()
        seen.set()
        assert await disk
        assert (await cancelling).state == "cancelled"
        assert (await ended(foreman, waiting)).state == "done"

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_job_that_takes_too_long_is_ended(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        record = add(store, "hold")
        foreman.submit(record)
        last = await ended(foreman, record)
        assert last.state == "failed" and last.error is not None and last.error["code"] == "out-of-time"
        assert last.error["detail"].startswith("the job took longer than the 0.5 s that the server gives to one; ")
        assert gone(int((store.folder(record.id) / "pid").read_text()))

    served(tmp_path / "work", Limits(workers=1, job_seconds=0.5), scenario)


@pytest.mark.parametrize(
    ("act", "cause"), [("leave", "ended with status 3"), ("tear", "was killed by SIGTERM")], ids=["leave", "tear"]
)
def test_a_worker_that_ends_without_an_answer_is_a_reason(tmp_path: Path, stand_in: None, act: str, cause: str) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        record, other = add(store, act), add(store, "done")
        foreman.submit(record)
        foreman.submit(other)
        last = await ended(foreman, record)
        assert last.state == "failed" and last.error is not None
        assert last.error["detail"] == f"the job's process {cause}; only this job is lost, submit it again"
        assert (await ended(foreman, other)).state == "done"

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_full_queue_says_when_to_come_again(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        records = [add(store, "hold") for _ in range(3)]
        foreman.submit(records[0])
        foreman.check_room()
        foreman.submit(records[1])
        with pytest.raises(Problem, match=r"the queue is full \(1 waiting\); try again in 10 s") as caught:
            foreman.submit(records[2])
        assert (caught.value.code, caught.value.headers) == ("queue-full", {"Retry-After": "10"})
        with pytest.raises(Problem, match="the queue is full"):
            await foreman.run(store.folder(records[2].id), "ann")
        await foreman.cancel(records[1].id)
        foreman.submit(records[2])

    served(tmp_path / "work", Limits(workers=1, queue=1), scenario)


def test_errands_share_the_workers(tmp_path: Path, stand_in: None) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        record = add(store, "hold")
        foreman.submit(record)
        await begun(store, record)
        staged = store.stage()
        (staged / "request.json").write_text(json.dumps({"name": "done"}))
        errand = asyncio.create_task(foreman.run(staged, "bob"))
        await asyncio.sleep(0.2)
        assert not errand.done()
        await foreman.cancel(record.id)
        assert (await errand)["state"] == "done"
        held = store.stage()
        (held / "request.json").write_text(json.dumps({"name": "hold"}))
        errand = asyncio.create_task(foreman.run(held, "bob"))
        await until((held / "begun").exists)
        errand.cancel()
        with pytest.raises(asyncio.CancelledError):
            await errand
        assert gone(int((held / "pid").read_text()))
        (held / "begun").unlink()
        errand = asyncio.create_task(foreman.run(held, "bob"))
        await until((held / "begun").exists)
        await foreman.stop()
        with pytest.raises(Problem, match="the server was stopped while this job ran"):
            await errand
        with pytest.raises(Problem, match="the server is being stopped; send this again to the next one"):
            foreman.check_room()

    served(tmp_path / "work", Limits(workers=1), scenario)


def test_a_stop_ends_what_runs_and_keeps_what_waits(tmp_path: Path, stand_in: None) -> None:
    kept: list[Record] = []

    async def first(store: Store, foreman: Foreman) -> None:
        running, waiting = add(store, "hold"), add(store, "done")
        foreman.submit(running)
        foreman.submit(waiting)
        process = await begun(store, running)
        watchers = [asyncio.create_task(ended(foreman, record)) for record in (running, waiting)]
        await asyncio.sleep(0)
        await foreman.stop()
        last, left = await asyncio.gather(*watchers)
        assert gone(process)
        assert last.state == "failed" and last.error is not None and last.error["code"] == "server-stopped"
        assert left == waiting == store.get(waiting.id)
        kept.extend([last, waiting])

    async def second(store: Store, foreman: Foreman) -> None:
        assert store.get(kept[0].id) == kept[0]
        assert (await ended(foreman, kept[1])).state == "done"

    served(tmp_path / "work", Limits(workers=1), first)
    served(tmp_path / "work", Limits(workers=1), second)


def test_a_server_that_is_killed_loses_what_ran_alone(tmp_path: Path, stand_in: None) -> None:
    """Its worker goes with it; at the next start that job has failed, what was done stands, and what waited runs."""
    killed = (
        "import asyncio, os, signal, sys\n"
        "sys.path[:0] = sys.argv[2:]\n"
        "import pathlib\n"
        "import tests.workbench.test_foreman as these\n"
        "these.foreman_module.COMMAND = (sys.executable, '-S', str(pathlib.Path(sys.argv[1]).parent / 'stand_in.py'))\n"
        "async def scenario(store, foreman):\n"
        "    records = [these.add(store, name) for name in ('done', 'hold', 'done')]\n"
        "    for record in records:\n"
        "        foreman.submit(record)\n"
        "    process = await these.begun(store, records[1])\n"
        "    print(*(record.id for record in records), process, flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "these.served(pathlib.Path(sys.argv[1]), these.Limits(workers=1), scenario)\n"
    )

    async def scenario(store: Store, foreman: Foreman) -> None:
        assert store.get(done).state == "done"
        lost = store.get(ran)
        assert lost.state == "failed" and lost.error is not None and lost.error["code"] == "server-stopped"
        assert (await ended(foreman, store.get(waited))).state == "done"

    async def run() -> tuple[int, list[str]]:
        command = (sys.executable, "-c", killed, str(tmp_path / "work"), str(ROOT))
        server = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
        said, _ = await server.communicate()
        assert server.returncode is not None
        return server.returncode, said.decode().split()

    code, (done, ran, waited, process) = asyncio.run(run())
    assert code == -signal.SIGKILL
    asyncio.run(until(lambda: gone(int(process))))
    served(tmp_path / "work", Limits(workers=1), scenario)


def test_workers_wait_before_there_is_a_job(tmp_path: Path, stand_in: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that died while it waited is not given a job."""
    monkeypatch.setattr(foreman_module, "WARM_AFTER_SECONDS", 0.0)
    started: list[int] = []

    async def scenario(store: Store, foreman: Foreman) -> None:
        await until(lambda: len(foreman._spares) == 2)
        dead, alive = foreman._spares
        os.kill(dead.pid, signal.SIGKILL)
        await until(lambda: dead.returncode is not None)
        record = add(store, "hold")
        foreman.submit(record)
        assert await begun(store, record) == alive.pid
        await until(lambda: len(foreman._spares) == 2)
        started.extend([alive.pid, *(spare.pid for spare in foreman._spares)])
        assert len(set(started)) == 3 and not any(gone(process) for process in started)

    served(tmp_path / "work", Limits(workers=2), scenario)
    assert len(started) == 3 and all(gone(process) for process in started)


def test_a_mistake_of_ours_fails_the_job_with_a_reference(
    tmp_path: Path, stand_in: None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario(store: Store, foreman: Foreman) -> None:
        monkeypatch.setattr(foreman_module, "COMMAND", (str(tmp_path / "nothing"),))
        record = add(store, "done")
        foreman.submit(record)
        last = await ended(foreman, record)
        assert last.state == "failed" and last.error is not None and last.error["code"] == "internal"
        assert f"reference {last.error['reference']}" in caplog.text and "FileNotFoundError" in caplog.text

    served(tmp_path / "work", Limits(workers=1), scenario)
