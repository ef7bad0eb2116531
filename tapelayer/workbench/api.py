"""API: the routes for jobs, and for judging programs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from tapelayer.workbench.answers import (
    FORM,
    REFUSED_FORMS,
    Description,
    Job,
    Jobs,
    Progress,
    form,
)
from tapelayer.workbench.comparison import Comparison, compare
from tapelayer.workbench.errands import foreman_of, staged, store_of, while_there
from tapelayer.workbench.problems import EVERYWHERE, Problem, problem_of_body, responses
from tapelayer.workbench.products import OUT, products
from tapelayer.workbench.record import Record
from tapelayer.workbench.results import RESULTS, JobOfPath
from tapelayer.workbench.store import write_request
from tapelayer.workbench.submission import JOB_FIELDS, VERIFY_FIELDS, job_request, verify_request
from tapelayer.workbench.uploads import receive

JobId = Annotated[str, Query(description="id of a job")]
# What a request that changes a job may be refused for.
CHANGED = ("not-found", "not-owner", "foreign-origin", "target-not-writable")
# What a new job may be refused for whose source is to be what another one made.
NOT_TAKEN = ("not-found", "job-not-finished", "job-failed", *(f"{name}-withheld" for name in products()))
ACCEPTED: dict[int | str, dict[str, Any]] = {202: {"headers": {"Location": {"schema": {"type": "string"}}}}}

router = APIRouter(prefix="/api/v1", tags=["jobs"], responses=responses(*EVERYWHERE))


def own_job(record: JobOfPath, request: Request) -> Record:
    """Return the job that the path names if it is the caller's."""
    if record.owner != request.state.owner:
        raise Problem("not-owner", "this job is somebody else's; only its owner may change it")
    return record


OwnJob = Annotated[Record, Depends(own_job)]


def own_job_even_deleted(id: str, request: Request) -> Record:
    """Return the job that the path names if it is the caller's, also where it is deleted."""
    return own_job(store_of(request).find(id), request)


OwnJobEvenDeleted = Annotated[Record, Depends(own_job_even_deleted)]


@router.post(
    "/jobs",
    status_code=202,
    response_model_exclude_unset=True,
    responses=ACCEPTED | responses(*REFUSED_FORMS, *NOT_TAKEN),
    openapi_extra=form(JOB_FIELDS, ("kind",), FORM),
)
async def submit(request: Request, response: Response) -> Job:
    """Submit a job; a file that cannot be read fails inside the job."""
    store, foreman = store_of(request), foreman_of(request)
    foreman.check_room()
    async with staged(store) as folder:
        sent = await receive(request, folder, JOB_FIELDS)
        order = await run_in_threadpool(job_request, sent, folder, store)
        record = await run_in_threadpool(store.create, request.state.owner, order, folder)
    try:
        foreman.submit(record)
    except Problem:
        await run_in_threadpool(store.delete, record.id)
        raise
    # Let the job join the queue before its place is told.
    await asyncio.sleep(0)
    response.headers["Location"] = f"/api/v1/jobs/{record.id}"
    job = _job(record, request)
    if hasattr(request.state, "owner_key"):
        job.owner_key = request.state.owner_key
    return job


@router.get("/jobs", response_model_exclude_unset=True)
def jobs(request: Request, deleted: bool = False) -> Jobs:
    """List the caller's own jobs: those that are there, or those that are deleted and can be brought back."""
    records = store_of(request).of_owner(request.state.owner, deleted)
    places = foreman_of(request).places()
    return Jobs(jobs=[_job(record, request, places) for record in records])


@router.get("/jobs/compare", responses=responses("not-found", "job-not-finished", "job-failed"))
def compare_jobs(a: JobId, b: JobId, request: Request) -> Comparison:
    """Compare two jobs of one kind: every number of their reports, the keys of their setups and files that differ."""
    store = store_of(request)
    return compare(store, store.get(a), store.get(b))


@router.get("/jobs/{id}", response_model_exclude_unset=True, responses=responses("not-found"))
def job(record: JobOfPath, request: Request) -> Job:
    """Show a job; whoever has its id may."""
    return _job(record, request)


@router.patch("/jobs/{id}", response_model_exclude_unset=True, responses=responses(*CHANGED, "upload-too-large"))
async def describe(record: OwnJob, description: Description, request: Request) -> Job:
    """Give a job a title or a note; the name of its file stays."""
    title = record.title if description.title is None else description.title
    note = record.note if description.note is None else description.note
    described = await run_in_threadpool(store_of(request).describe, record.id, title, note)
    foreman_of(request).describe(described)
    return _job(described, request)


@router.delete("/jobs/{id}", status_code=204, responses=responses(*CHANGED))
async def delete(record: OwnJobEvenDeleted, request: Request, forever: bool = False) -> None:
    """Delete a job, which can be brought back for a while; one that is under way is cancelled first.

    With `forever`, its files are removed at once, also those of a job that is deleted already.
    """
    store = store_of(request)
    await foreman_of(request).cancel(record.id)
    await run_in_threadpool(store.delete if forever else store.hide, record.id)


@router.post("/jobs/{id}/restore", response_model_exclude_unset=True, responses=responses(*CHANGED))
def restore(record: OwnJobEvenDeleted, request: Request) -> Job:
    """Bring a deleted job back, as it was; one that was under way stays cancelled."""
    return _job(store_of(request).restore(record.id), request)


@router.post(
    "/jobs/{id}/cancel",
    status_code=202,
    response_model_exclude_unset=True,
    responses=responses(*CHANGED),
)
async def cancel(record: OwnJob, request: Request) -> Job:
    """Cancel a job that waits or runs; one that has ended stays as it is."""
    return _job(await foreman_of(request).cancel(record.id), request)


@router.get("/jobs/{id}/events", response_class=EventSourceResponse, responses=responses("not-found"))
async def events(record: JobOfPath, request: Request) -> AsyncIterator[ServerSentEvent]:
    """Follow a job: `state` with the whole job at once and when its state changes, `progress`, at last `done`."""
    state, place = "", None
    async for now in foreman_of(request).watch(record.id):
        job = _job(now, request)
        moved = job.place is not None and job.place != place
        if now.ended and state:
            yield _event("done", job)
        elif now.state != state or moved:
            yield _event("state", job)
            if now.ended:
                yield _event("done", job)
        elif now.state == "running":
            yield _event("progress", Progress(progress=now.progress, stage=now.stage))
        state, place = now.state, job.place


@router.post(
    "/verify",
    responses=responses(
        *(*REFUSED_FORMS, "course-file-refused", "mesh-refused", "program-refused"),
        *("controller-refused", "model-refused", "program-of-other-setup", "out-of-memory", "out-of-time"),
    ),
    openapi_extra=form(VERIFY_FIELDS, ("program", "file", "kind"), FORM),
)
async def verify(request: Request) -> dict[str, Any]:
    """Judge an NC program by its text: the report, whether it passed or not, with remarks beside the verdict."""
    store, foreman = store_of(request), foreman_of(request)
    foreman.check_room()
    async with staged(store) as folder:
        sent = await receive(request, folder, VERIFY_FIELDS)
        order = await run_in_threadpool(verify_request, sent, folder)
        await run_in_threadpool(write_request, folder, order)
        message = await while_there(request, foreman.run(folder, request.state.owner))
        if message["state"] != "done":
            raise problem_of_body(message["error"])
        report: dict[str, Any] = json.loads((folder / "out" / "report.json").read_bytes())
    # The hash is that of the file, which this answer is not.
    del report["text_sha256"]
    return report | {"remarks": message["summary"]["remarks"]}


def _job(record: Record, request: Request, places: Mapping[str, int] | None = None) -> Job:
    """Return a job as it is told, by the places in the queue if these are known already."""
    places = foreman_of(request).places() if places is None else places
    store = store_of(request)
    results = [address for address, file in RESULTS.items() if record.summary and store.holds(record.id, OUT, file)]
    return Job.model_validate(
        {
            "id": record.id,
            "kind": record.kind,
            "name": record.name,
            "source_sha256": record.source_sha256,
            "title": record.title,
            "note": record.note,
            "state": record.state,
            "progress": record.progress,
            "stage": record.stage,
            "place": places.get(record.id),
            "created_at": record.created_at,
            "started_at": record.started_at,
            "finished_at": record.finished_at,
            "deleted_at": record.deleted_at,
            "run_s": record.run_s,
            "summary": record.summary,
            "error": record.error,
            "results": results,
            "sent": record.request,
            "mine": record.owner == request.state.owner,
        }
    )


def _event(name: Literal["state", "progress", "done"], body: BaseModel) -> ServerSentEvent:
    return ServerSentEvent(event=name, raw_data=body.model_dump_json(exclude_unset=True))
