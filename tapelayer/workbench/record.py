"""Record: a job as it stands in the index, and the schema of that."""

from __future__ import annotations

from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, Literal

State = Literal["queued", "running", "done", "failed", "cancelled"]
Ending = Literal["done", "failed", "cancelled"]

SCHEMA = 2
TABLE = """
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    owner TEXT NOT NULL,
    kind TEXT NOT NULL,
    name TEXT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    stage TEXT NOT NULL,
    progress REAL NOT NULL,
    created_at TEXT NOT NULL,
    finished_at TEXT,
    request TEXT NOT NULL,
    summary TEXT,
    error TEXT
) STRICT
"""
# What each schema adds to the one before.
ADDED = {
    2: """
ALTER TABLE jobs ADD COLUMN started_at TEXT;
ALTER TABLE jobs ADD COLUMN deleted_at TEXT;
ALTER TABLE jobs ADD COLUMN source_sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN title TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN note TEXT NOT NULL DEFAULT ''
"""
}


@dataclass(frozen=True)
class Record:
    """A job as recorded in the index.

    Attributes:
        id: 32 hexadecimal digits, 128 random bits.
        owner: hash of the owner's key.
        kind: lay or spray.
        name: of the uploaded file, for people.
        state: current state.
        stage: current stage, or the last one if the job has ended; empty before it starts.
        progress: 0 to 1.
        created_at: RFC 3339, UTC.
        started_at: likewise; None until it runs.
        finished_at: likewise; None until the job has ended.
        deleted_at: likewise; None unless its owner deleted it, which can be undone for a while.
        source_sha256: of the uploaded file; empty where it is not known.
        title: name that its owner gave it; may be empty.
        note: of its owner; may be empty.
        request: the submitted request, as in request.json.
        summary: of the results; None if there are none.
        error: problem details; None if there is no error.
    """

    id: str
    owner: str
    kind: str
    name: str
    state: State
    stage: str
    progress: float
    created_at: str
    started_at: str | None
    finished_at: str | None
    deleted_at: str | None
    source_sha256: str
    title: str
    note: str
    request: dict[str, Any]
    summary: dict[str, Any] | None
    error: dict[str, Any] | None

    @property
    def run_s(self) -> float | None:
        """Seconds from its start to its end; None where it has not ended, or never started."""
        if not (self.started_at and self.finished_at):
            return None
        return (datetime.fromisoformat(self.finished_at) - datetime.fromisoformat(self.started_at)).total_seconds()

    @property
    def ended(self) -> bool:
        """Whether the state is final."""
        return self.state not in ("queued", "running")


COLUMNS = ", ".join(field.name for field in fields(Record))
