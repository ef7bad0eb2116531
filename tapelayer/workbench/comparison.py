"""Comparison: what differs between two jobs of one kind, in their reports, setups and files."""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field

from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.reporting.quantity import quantities
from tapelayer.setups.sections import Settings, parse_setup
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import SOURCE, Store

MOULD, PARTS = "mould", "parts"


class QuantityPair(BaseModel):
    """A number of both reports."""

    key: Annotated[str, Field(description="in the report; its name and unit are among the quantities")]
    a: Annotated[float | None, Field(description="null where it was not measured")]
    b: Annotated[float | None, Field(description="likewise")]


class KeyPair(BaseModel):
    """A key of the setup that differs."""

    section: Annotated[str, Field(description="of the setup, or `job` for what was sent beside it")]
    key: str
    a: Annotated[Any, Field(description="its value, the default included")]
    b: Annotated[Any, Field(description="likewise")]


class FilePair(BaseModel):
    """A file that differs."""

    file: Annotated[str, Field(description="source, mould, or the name of a part")]
    a: Annotated[str, Field(description="its SHA-256; empty where there is none")]
    b: Annotated[str, Field(description="likewise")]


class Comparison(BaseModel):
    """Two jobs of one kind beside each other."""

    kind: KindName
    quantities: Annotated[list[QuantityPair], Field(description="all of the report, in its order")]
    setup: Annotated[list[KeyPair], Field(description="those that differ only")]
    files: Annotated[list[FilePair], Field(description="those that differ only")]


def compare(store: Store, a: Record, b: Record) -> Comparison:
    """Compare two jobs that made a report.

    Raises:
        Problem: they are of two kinds, or one of them has no report.
    """
    if a.kind != b.kind:
        detail = f"job a is of kind {a.kind}, job b of kind {b.kind}; compare jobs of one kind"
        raise Problem("invalid-request", detail)
    name = cast(KindName, a.kind)
    reports = [_report(store, record, letter) for record, letter in ((a, "a"), (b, "b"))]
    setups = [_values(store, record, kind_of(name).setup) for record in (a, b)]
    files = [_files(store, record) for record in (a, b)]
    return Comparison(
        kind=name,
        quantities=[
            QuantityPair(key=row.key, a=reports[0].get(row.key), b=reports[1].get(row.key))
            for row in quantities(kind_of(name).rows)
        ],
        setup=[
            KeyPair(section=section, key=key, a=setups[0][section, key], b=setups[1][section, key])
            for section, key in setups[0]
            if setups[0][section, key] != setups[1][section, key]
        ],
        files=[
            FilePair(file=file, a=files[0].get(file, ""), b=files[1].get(file, ""))
            for file in dict.fromkeys((*files[0], *files[1]))
            if files[0].get(file) != files[1].get(file)
        ],
    )


def _report(store: Store, record: Record, letter: str) -> dict[str, Any]:
    """Return the report of a job.

    Raises:
        Problem: it has none; the problem says why.
    """
    if not record.ended:
        raise Problem("job-not-finished", f"job {letter} is under way; compare it when it has ended")
    if record.summary is None:
        reason = record.error["detail"] if record.error else record.state
        raise Problem("job-failed", f"job {letter} has no report: {reason}")
    report: dict[str, Any] = json.loads(store.read(record.id, "out", "report.json"))
    return report


def _values(store: Store, record: Record, model: type[Settings]) -> dict[tuple[str, str], Any]:
    """Return every value that a job was made with, the defaults included, by section and key."""
    setup = parse_setup(store.read(record.id, "setup.toml"), "setup.toml", model)
    sections = setup.model_dump(mode="json")
    beside = {("job", "unit"): record.request.get("unit", "mm")}
    return beside | {(section, key): value for section, values in sections.items() for key, value in values.items()}


def _files(store: Store, record: Record) -> dict[str, str]:
    """Return the SHA-256 of each file that a job was made from."""
    places = {SOURCE: (SOURCE,)} | ({MOULD: (MOULD,)} if record.request.get("mould") else {})
    places |= {name: (PARTS, name) for name in record.request["parts"]}
    digests = {}
    for name, place in places.items():
        with store.open(record.id, *place) as file:
            digests[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return digests
