"""The work directory keeps its jobs: whole, apart by owner, and over a restart."""

from __future__ import annotations

import hashlib
import json
import re
import resource
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tapelayer.errors import WorkDirectoryRefused
from tapelayer.workbench import store as store_module
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import Store

REQUEST = {"kind": "lay", "name": "铺层.txt", "parts": []}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    opened = Store(tmp_path / "work")
    yield opened
    opened.close()


def add(store: Store, owner: str = "ann", **request: Any) -> Record:
    staged = store.stage()
    (staged / "source").write_bytes(b"1\nstart\n")
    return store.create(owner, REQUEST | request, staged)


@contextmanager
def full_disk() -> Iterator[None]:
    """No file of this process grows."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def folders(store: Store, name: str) -> set[str]:
    return {path.name for path in (store.work / name).iterdir()}


def test_a_job_is_what_was_asked_for_with_its_files(store: Store) -> None:
    record = add(store)
    assert re.fullmatch(r"[0-9a-f]{32}", record.id)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", record.created_at)
    made = record.created_at
    digest = hashlib.sha256(b"1\nstart\n").hexdigest()
    moments = (made, None, None, None)
    described = (digest, "", "")
    state = ("queued", "", 0.0)
    assert record == Record(record.id, "ann", "lay", "铺层.txt", *state, *moments, *described, REQUEST, None, None)
    assert store.get(record.id) == record
    assert json.loads((store.folder(record.id) / "request.json").read_text()) == REQUEST
    assert (store.folder(record.id) / "source").read_bytes() == b"1\nstart\n"
    assert folders(store, "staging") == set()


def test_lists_are_an_owners_own_the_newest_first(store: Store) -> None:
    first, other, second = add(store), add(store, "bob"), add(store)
    assert store.of_owner("ann") == [second, first]
    assert store.of_owner("bob") == [other]
    assert store.of_owner("eve") == []


def test_a_job_goes_through_its_states(store: Store) -> None:
    record = add(store)
    assert not record.ended
    assert store.begin(record.id).state == "running"
    store.advance(record.id, "planning", 0.25)
    seen = store.get(record.id)
    assert (seen.state, seen.stage, seen.progress, seen.ended) == ("running", "planning", 0.25, False)
    done = store.finish(record.id, "done", {"blocks": 3}, None)
    assert (done.state, done.progress, done.summary, done.error) == ("done", 1.0, {"blocks": 3}, None)
    assert done.ended and done.finished_at is not None and done.finished_at >= done.created_at
    assert store.get(record.id) == done


def test_what_has_ended_does_not_begin(store: Store) -> None:
    record = add(store)
    ended = store.finish(record.id, "cancelled", None, None)
    assert store.begin(record.id) == ended


def test_a_failed_job_stays_where_it_was(store: Store) -> None:
    record = add(store)
    store.begin(record.id)
    store.advance(record.id, "planning", 0.25)
    failed = store.finish(record.id, "failed", None, {"code": "cuts-cross"})
    assert (failed.stage, failed.progress, failed.error) == ("planning", 0.25, {"code": "cuts-cross"})


def test_an_unknown_job_is_a_problem(store: Store) -> None:
    for ask in (store.get, store.delete, store.begin):
        with pytest.raises(Problem, match="there is no job ffff; it may have expired or been removed") as caught:
            ask("ffff")
        assert caught.value.code == "not-found"


def test_delete_removes_row_and_folder(store: Store) -> None:
    record, other = add(store), add(store)
    store.delete(record.id)
    assert store.of_owner("ann") == [other]
    assert folders(store, "jobs") == {other.id}
    assert folders(store, "trash") == set()


def test_a_deleted_job_can_be_brought_back_until_it_expires(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    record, other, late = add(store), add(store), add(store)
    done = store.finish(record.id, "done", {"blocks": 3}, None)
    store.hide(record.id)
    store.hide(late.id)
    with pytest.raises(
        Problem, match=f"^job {record.id} was deleted at 20.*Z; its owner can bring it back for a while$"
    ):
        store.get(record.id)
    assert store.of_owner("ann") == [other]
    assert [each.id for each in store.of_owner("ann", deleted=True)] == [late.id, record.id]
    assert store.expire(30, 60) == 0
    assert store.restore(record.id) == store.get(record.id) == done
    assert store.expire(30, -1) == 1
    assert store.of_owner("ann") == [other, done]
    with pytest.raises(Problem, match="there is no job"):
        store.restore(late.id)
    assert folders(store, "jobs") == {record.id, other.id}


def test_a_deleted_job_stays_deleted_over_a_restart(tmp_path: Path) -> None:
    first = Store(tmp_path)
    record = add(first)
    first.hide(record.id)
    first.close()
    second = Store(tmp_path)
    assert second.recover() == []
    assert second.restore(record.id) == record
    second.close()


def test_a_job_is_described(store: Store) -> None:
    record = add(store)
    described = store.describe(record.id, "left wing", "first with the new tape\nsecond line")
    assert (described.title, described.note, described.name) == (
        "left wing",
        "first with the new tape\nsecond line",
        record.name,
    )
    assert store.get(record.id) == described


def test_how_long_a_job_ran(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    record = add(store)
    monkeypatch.setattr(store_module, "_now", lambda: "2020-01-01T00:00:59.500Z")
    assert store.begin(record.id).run_s is None
    monkeypatch.setattr(store_module, "_now", lambda: "2020-01-01T01:01:00.750Z")
    assert store.finish(record.id, "done", None, None).run_s == 3601.25
    assert store.finish(add(store).id, "cancelled", None, None).run_s is None


# The index as version 0.1.0 made it.
SCHEMA_1 = """
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, owner TEXT NOT NULL, kind TEXT NOT NULL,
    name TEXT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    stage TEXT NOT NULL, progress REAL NOT NULL, created_at TEXT NOT NULL, finished_at TEXT, request TEXT NOT NULL,
    summary TEXT, error TEXT
) STRICT;
PRAGMA user_version = 1;
"""


def test_an_older_index_is_brought_up_to_date(tmp_path: Path) -> None:
    Store(tmp_path).close()
    (tmp_path / "index.sqlite").unlink()
    index = sqlite3.connect(tmp_path / "index.sqlite")
    index.executescript(SCHEMA_1)
    job = "ab" * 16
    values = (job, "ann", "lay", "a.txt", "done", "saving", 1.0, "2020-01-01T00:00:00.000Z", None, "{}", "{}", None)
    index.execute(f"INSERT INTO jobs VALUES (7, {', '.join('?' * len(values))})", values)
    index.commit()
    index.close()
    (tmp_path / "jobs" / job).mkdir()
    (tmp_path / "jobs" / job / "source").write_bytes(b"1\nstart\n")
    for _ in range(2):
        store = Store(tmp_path)
        assert store.recover() == []
        (record,) = store.of_owner("ann")
        assert (record.id, record.title, record.note, record.started_at, record.deleted_at) == (job, "", "", None, None)
        assert record.source_sha256 == hashlib.sha256(b"1\nstart\n").hexdigest()
        store.close()


def test_a_job_without_a_folder_can_be_deleted(store: Store) -> None:
    record = add(store)
    store.folder(record.id).rename(store.work / "elsewhere")
    store.delete(record.id)
    assert store.of_owner("ann") == []


def test_the_index_survives_a_restart(tmp_path: Path) -> None:
    first = Store(tmp_path)
    done, queued, later, ran = add(first), add(first), add(first), add(first)
    first.finish(done.id, "done", {"blocks": 3}, None)
    kept = first.get(done.id)
    first.begin(ran.id)
    first.advance(ran.id, "planning", 0.5)
    first.stage()
    first.close()
    second = Store(tmp_path)
    assert second.recover() == [queued, later]
    assert second.get(done.id) == kept
    lost = second.get(ran.id)
    assert lost.state == "failed" and lost.error is not None and lost.error["code"] == "server-stopped"
    assert lost.error["detail"] == "the server was stopped while this job ran; submit it again"
    assert folders(second, "staging") == set()
    second.close()


def test_what_a_crash_leaves_half_done_is_finished(tmp_path: Path) -> None:
    first = Store(tmp_path)
    whole, no_folder = add(first), add(first)
    first.folder(no_folder.id).rename(tmp_path / "trash" / "half")
    staged = first.stage()
    staged.rename(first.folder("0" * 32))
    first.close()
    second = Store(tmp_path)
    assert second.recover() == [whole]
    assert second.of_owner("ann") == [whole]
    assert folders(second, "jobs") == {whole.id}
    assert folders(second, "trash") == set()
    second.close()


def test_jobs_expire_by_the_day_they_ended(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    old, recent, queued = add(store), add(store), add(store)
    monkeypatch.setattr(store_module, "_now", lambda: "2020-01-01T00:00:00.000Z")
    store.finish(old.id, "failed", None, {"code": "cuts-cross"})
    monkeypatch.undo()
    store.finish(recent.id, "done", {}, None)
    assert store.expire(30, 60) == 1
    assert store.of_owner("ann") == [queued, store.get(recent.id)]
    assert folders(store, "jobs") == {queued.id, recent.id}


def test_a_full_disk_changes_nothing_and_can_be_made_room_on(store: Store) -> None:
    record = store.begin(add(store).id)
    store.advance(record.id, "planning", 0.5)
    with full_disk():
        for change in (lambda: store.finish(record.id, "done", None, None), lambda: store.delete(record.id)):
            with pytest.raises(Problem, match="^the index of the jobs cannot be written: ") as problem:
                change()
            assert problem.value.code == "target-not-writable"
        assert folders(store, "jobs") | folders(store, "trash") == set()
    assert store.get(record.id).state == "running"
    assert store.finish(record.id, "done", None, None).stage == "planning"
    store.delete(record.id)


def test_what_is_sent_is_for_nobody_else_of_this_machine(tmp_path: Path) -> None:
    work = tmp_path / "new" / "work"
    Store(work).close()
    assert work.stat().st_mode & 0o777 == 0o700
    work.chmod(0o750)
    Store(work).close()
    assert work.stat().st_mode & 0o777 == 0o750


def test_one_server_at_a_time(tmp_path: Path) -> None:
    first = Store(tmp_path)
    with pytest.raises(WorkDirectoryRefused) as caught:
        Store(tmp_path)
    assert str(caught.value) == (
        f"work directory {tmp_path} cannot be used: another server uses it; give another one with --work-dir"
    )
    assert caught.value.exit_code == 2
    first.close()
    Store(tmp_path).close()


def test_a_directory_that_cannot_be_used_is_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    with pytest.raises(
        WorkDirectoryRefused, match=r"file cannot be used: not a directory; give another one with --work-dir$"
    ):
        Store(file)
    with pytest.raises(WorkDirectoryRefused, match=r"proc/none cannot be used: no such file or directory; give"):
        Store(Path("/proc/none"))


def test_an_index_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    index = tmp_path / "index.sqlite"
    index.write_bytes(b"no database at all, but long enough to be one" * 40)
    with pytest.raises(WorkDirectoryRefused, match=r"its index\.sqlite: file is not a database; give"):
        Store(tmp_path)
    index.unlink()
    newer = sqlite3.connect(index)
    newer.execute("PRAGMA user_version = 7")
    newer.close()
    with pytest.raises(WorkDirectoryRefused, match="its index has schema 7, this version reads up to 2; give"):
        Store(tmp_path)
    index.unlink()
    Store(tmp_path).close()


def test_threads_share_the_index(store: Store) -> None:
    def work(owner: str) -> None:
        for count in range(10):
            record = add(store, owner, name=f"{owner}{count}")
            store.begin(record.id)
            store.finish(record.id, "done", {"of": owner}, None)

    owners = [f"owner{n}" for n in range(4)]
    threads = [threading.Thread(target=work, args=(owner,)) for owner in owners]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for owner in owners:
        records = store.of_owner(owner)
        assert [record.name for record in records] == [f"{owner}{count}" for count in reversed(range(10))]
        assert {json.dumps(record.summary) for record in records} == {json.dumps({"of": owner})}
