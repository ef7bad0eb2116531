"""Store: the jobs of a work directory, as an SQLite index and a folder per job, safe across restarts and power cuts.

    WORK/lock            held while a server uses the directory
    WORK/index.sqlite    one row per job
    WORK/jobs/<id>/      files of a job
    WORK/staging/<x>/    uploads that are not yet a job
    WORK/trash/<x>/      folders being deleted

A folder is renamed before its row is added or deleted, so that the next start can clean up after a crash.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import secrets
import shutil
import sqlite3
import threading
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from io import BufferedReader
from pathlib import Path
from typing import Any

from tapelayer.atomic_files import write_files
from tapelayer.errors import WorkDirectoryRefused
from tapelayer.language import Language
from tapelayer.workbench.own_files import open_own
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.record import ADDED, COLUMNS, SCHEMA, TABLE, Ending, Record

# File of the report's page by its language.
PAGES: dict[Language, str] = {"en": "report.html", "zh": "report.zh.html"}

# File of what a job is made from, in its folder.
SOURCE = "source"

SERVER_STOPPED = "the server was stopped while this job ran; submit it again"


class Store:
    """Jobs of a work directory, which only one server at a time may use.

    Args:
        work: the directory; created if missing.

    Raises:
        WorkDirectoryRefused: it cannot be used, or another server uses it.
    """

    def __init__(self, work: Path) -> None:
        self.work = work.resolve()
        self._jobs, self._staging, self._trash = (self.work / name for name in ("jobs", "staging", "trash"))
        # Progress changes often and means nothing after a restart, so it is not written to the index.
        self._steps: dict[str, tuple[str, float]] = {}
        self._guard = threading.RLock()
        try:
            # Other users of this machine must not read the uploads.
            if not self.work.exists():
                self.work.mkdir(mode=0o700, parents=True)
            for folder in (self._jobs, self._staging, self._trash):
                folder.mkdir(exist_ok=True)
            self._lock = (self.work / "lock").open("w")
        except OSError as error:
            raise self._refused(str(error.strerror).lower()) from None
        try:
            self._hold()
            self._index = self._opened()
        except BaseException:
            self._lock.close()
            raise

    def close(self) -> None:
        """Release the directory for another server."""
        with self._guard:
            self._index.close()
            self._lock.close()

    def stage(self) -> Path:
        """Create an empty folder for uploads, on the same disk as the jobs."""
        folder = self._staging / secrets.token_hex(16)
        folder.mkdir()
        return folder

    def create(self, owner: str, request: Mapping[str, Any], staged: Path) -> Record:
        """Create a queued job.

        Args:
            owner: hash of the owner's key.
            request: with at least `kind` and `name`; written to request.json.
            staged: folder from `stage` with the uploads, which becomes the job's.

        Raises:
            TargetNotWritable: the disk is full.
            Problem: likewise, if writing the index fails.
        """
        record = Record(
            id=secrets.token_hex(16),
            owner=owner,
            kind=request["kind"],
            name=request["name"],
            state="queued",
            stage="",
            progress=0.0,
            created_at=_now(),
            started_at=None,
            finished_at=None,
            deleted_at=None,
            source_sha256=_digest((staged / SOURCE).open("rb")),
            title="",
            note="",
            request=dict(request),
            summary=None,
            error=None,
        )
        write_request(staged, request)
        # After a power cut, a job whose row survived must not have a partial file.
        _flush(staged, *staged.rglob("*"))
        staged.rename(self.folder(record.id))
        _flush(self._jobs)
        begun = (record.id, owner, record.kind, record.name, record.state, "", 0.0, record.created_at)
        values = (*begun, record.source_sha256, _text(request))
        with self._change() as index:
            index.execute(
                "INSERT INTO jobs (id, owner, kind, name, state, stage, progress, created_at, source_sha256, request)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                values,
            )
        return record

    def folder(self, job: str) -> Path:
        """Return the folder of a job's files."""
        return self._jobs / job

    def open(self, job: str, *place: str) -> BufferedReader:
        """Open a file of a job for reading.

        Raises:
            Problem: as `open_own`.
        """
        return open_own(self._jobs, job, *place)

    def read(self, job: str, *place: str) -> bytes:
        """Return the contents of a file of a job.

        Raises:
            Problem: as `open_own`.
        """
        with self.open(job, *place) as file:
            return file.read()

    def holds(self, job: str, *place: str) -> bool:
        """Return whether a job has a file."""
        try:
            self.open(job, *place).close()
        except Problem:
            return False
        return True

    def get(self, job: str) -> Record:
        """Return a job by its id.

        Raises:
            Problem: there is no such job, or it is deleted.
        """
        record = self.find(job)
        if record.deleted_at:
            undo = "its owner can bring it back for a while"
            raise Problem("not-found", f"job {job} was deleted at {record.deleted_at}; {undo}")
        return record

    def find(self, job: str) -> Record:
        """Return a job by its id, also one that is deleted and can be brought back.

        Raises:
            Problem: there is no such job.
        """
        records = self._select("WHERE id = ?", job)
        if not records:
            raise Problem("not-found", f"there is no job {job[:40]}; it may have expired or been removed")
        return records[0]

    def of_owner(self, owner: str, deleted: bool = False) -> list[Record]:
        """Return an owner's jobs, newest first: those that are there, or those that are deleted."""
        return self._select(f"WHERE owner = ? AND deleted_at IS {'NOT ' * deleted}NULL ORDER BY number DESC", owner)

    def describe(self, job: str, title: str, note: str) -> Record:
        """Record the title and the note that a job's owner gave it.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        with self._change() as index:
            index.execute("UPDATE jobs SET title = ?, note = ? WHERE id = ?", (title, note, job))
        return self.get(job)

    def hide(self, job: str) -> None:
        """Record that a job is deleted; it stays until `expire`, and `restore` brings it back.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        self.get(job)
        with self._change() as index:
            index.execute("UPDATE jobs SET deleted_at = ? WHERE id = ?", (_now(), job))

    def restore(self, job: str) -> Record:
        """Bring a deleted job back; one that is not deleted stays as it is.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        with self._change() as index:
            index.execute("UPDATE jobs SET deleted_at = NULL WHERE id = ?", (job,))
        return self.get(job)

    def begin(self, job: str) -> Record:
        """Mark a queued job as running; a job that has ended meanwhile stays as it is.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        with self._change() as index:
            begun = "UPDATE jobs SET state = 'running', started_at = ? WHERE id = ? AND state = 'queued'"
            index.execute(begun, (_now(), job))
            return self.find(job)

    def advance(self, job: str, stage: str, progress: float) -> None:
        """Record the progress of a running job, in memory only."""
        self._steps[job] = (stage, progress)

    def finish(
        self, job: str, state: Ending, summary: Mapping[str, Any] | None, error: Mapping[str, Any] | None
    ) -> Record:
        """Record how a job ended.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        with self._change() as index:
            stage, progress = self._steps.get(job, ("", 0.0))
            index.execute(
                "UPDATE jobs SET state = ?, stage = ?, progress = ?, finished_at = ?, summary = ?, error = ?"
                " WHERE id = ?",
                (state, stage, 1.0 if state == "done" else progress, _now(), _text(summary), _text(error), job),
            )
        with self._guard:
            self._steps.pop(job, None)
            return self.find(job)

    def delete(self, job: str) -> None:
        """Remove a job that is not running for good, with its files.

        Raises:
            Problem: there is no such job, or the disk is full.
        """
        self._remove([self.find(job).id])

    def expire(self, keep_days: float, undo_seconds: float) -> int:
        """Remove the jobs that ended so many days, or were deleted so many seconds ago; return how many there were.

        Raises:
            Problem: the disk is full.
        """
        now = datetime.now(UTC)
        ended, deleted = _stamp(now - timedelta(days=keep_days)), _stamp(now - timedelta(seconds=undo_seconds))
        old = [record.id for record in self._select("WHERE finished_at < ? OR deleted_at < ?", ended, deleted)]
        self._remove(old)
        return len(old)

    def recover(self) -> list[Record]:
        """Clean up after the last server, and return the queued jobs, oldest first.

        Jobs that were running are marked as failed; a row without a folder, or a folder without a row, is removed.
        """
        with self._guard:
            for record in self._select("WHERE state = 'running'"):
                self.finish(record.id, "failed", None, Problem("server-stopped", SERVER_STOPPED).body())
            folders = {folder.name for folder in self._jobs.iterdir()}
            rows = {record.id for record in self._select("")}
            self._remove(rows ^ folders)
            for parent in (self._staging, self._trash):
                for left in parent.iterdir():
                    shutil.rmtree(left, ignore_errors=True)
            self._fill_digests()
            return self._select("WHERE state = 'queued' AND deleted_at IS NULL ORDER BY number")

    def _fill_digests(self) -> None:
        """Record the hash of the file of each job that was made before hashes were recorded."""
        old = [record.id for record in self._select("WHERE source_sha256 = ''")]
        digests = [(_digest(self.open(job, SOURCE)), job) for job in old if self.holds(job, SOURCE)]
        with self._change() as index:
            index.executemany("UPDATE jobs SET source_sha256 = ? WHERE id = ?", digests)

    def _remove(self, jobs: Collection[str]) -> None:
        """Remove files, then rows, so that on a full disk the files free the space that the index needs.

        A folder that cannot be removed stays in the trash until the next start.
        """
        for job in jobs:
            gone = self._trash / secrets.token_hex(16)
            with suppress(FileNotFoundError):
                self.folder(job).rename(gone)
            shutil.rmtree(gone, ignore_errors=True)
        with self._change() as index:
            index.executemany("DELETE FROM jobs WHERE id = ?", [(job,) for job in jobs])

    @contextmanager
    def _change(self) -> Iterator[sqlite3.Connection]:
        """Yield the index inside a transaction.

        Raises:
            Problem: the index cannot be written.
        """
        try:
            with self._guard, self._index as index:
                index.execute("BEGIN")
                yield index
        except sqlite3.OperationalError as error:
            raise Problem("target-not-writable", f"the index of the jobs cannot be written: {error}") from None

    def _select(self, clause: str, *values: str) -> list[Record]:
        with self._guard:
            rows = self._index.execute(f"SELECT {COLUMNS} FROM jobs {clause}", values).fetchall()
            return [self._record(row) for row in rows]

    def _record(self, row: tuple[Any, ...]) -> Record:
        *plain, request, summary, error = row
        values = (*plain, _value(request), _value(summary), _value(error))
        record = Record(**{field.name: value for field, value in zip(fields(Record), values, strict=True)})
        if record.id not in self._steps:
            return record
        stage, progress = self._steps[record.id]
        return replace(record, stage=stage, progress=progress)

    def _hold(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EACCES):
                raise self._refused("another server uses it") from None
            raise self._refused(str(error.strerror).lower()) from None

    def _opened(self) -> sqlite3.Connection:
        """Open the index; create it if missing."""
        # The guard ensures that only one thread at a time uses the connection.
        index = sqlite3.connect(self.work / "index.sqlite", isolation_level=None, check_same_thread=False)
        try:
            index.execute("PRAGMA journal_mode = WAL")
            index.execute("PRAGMA synchronous = FULL")
            schema = index.execute("PRAGMA user_version").fetchone()[0]
            if schema > SCHEMA:
                raise self._refused(f"its index has schema {schema}, this version reads up to {SCHEMA}")
            steps = [TABLE] if schema == 0 else []
            steps += [added for number, added in ADDED.items() if number > schema]
            if steps:
                index.executescript(f"BEGIN; {'; '.join(steps)}; PRAGMA user_version = {SCHEMA}; COMMIT;")
        except sqlite3.Error as error:
            index.close()
            raise self._refused(f"its index.sqlite: {error}") from None
        except WorkDirectoryRefused:
            index.close()
            raise
        return index

    def _refused(self, reason: str) -> WorkDirectoryRefused:
        return WorkDirectoryRefused(
            f"work directory {self.work} cannot be used: {reason}; give another one with --work-dir"
        )


def write_request(folder: Path, request: Mapping[str, Any]) -> None:
    """Write request.json, which a worker reads, into a folder of uploads.

    Raises:
        TargetNotWritable: the disk is full.
    """
    write_files({folder / "request.json": json.dumps(request, ensure_ascii=False).encode()})


def _digest(file: BufferedReader) -> str:
    """Return the SHA-256 of a file, and close it."""
    with file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _flush(*paths: Path) -> None:
    """Flush files and folders to the disk."""
    for path in paths:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _now() -> str:
    return _stamp(datetime.now(UTC))


def _stamp(moment: datetime) -> str:
    """Return a moment in UTC as RFC 3339 of fixed length, so that the texts sort by time."""
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _text(value: Mapping[str, Any] | None) -> str | None:
    return None if value is None else json.dumps(value, allow_nan=False)


def _value(text: str | None) -> Any:
    return None if text is None else json.loads(text)
