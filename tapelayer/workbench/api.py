"""API: the routes for jobs and their results, and for judging programs."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import AsyncIterator, Awaitable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.responses import FileResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.language import Language
from tapelayer.reporting.words import language_accepted
from tapelayer.setups.sections import parse_setup, whole_text
from tapelayer.workbench.answers import (
    FORM,
    REFUSED_FORMS,
    Job,
    JobFile,
    Jobs,
    Limits,
    LimitTold,
    Progress,
    content,
    form,
)
from tapelayer.workbench.foreman import Foreman, Message
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses
from tapelayer.workbench.store import PAGES, Record, Store, write_request
from tapelayer.workbench.submission import JOB_FIELDS, VERIFY_FIELDS, job_request, verify_request
from tapelayer.workbench.uploads import receive

FLOAT_BYTES = 4
# File name, media type and description of each result that a job may have, by address.
FILES = {
    "report.json": ("report.json", "application/json", "Show the report."),
    "trajectory": ("trajectory.txt", "text/plain", "Show the gun's poses in the part's frame (spray)."),
    "urdf": ("machine.urdf", "application/xml", "Show the machine's URDF."),
    "blocks": ("blocks.json", "application/json", "Show line, course, kind and event of each row of the poses."),
}
TABLES = {
    "poses": "Show every axis at the end of each block, and between where a block is an arc.",
    "speeds": "Show the speed of each axis in the motion that ends in the row.",
    "errors": "Show what verification measured along the courses or passes.",
    "tape": "Show the edges of the tape as it is laid, in `machine` axes (lay).",
    "part": "Show the part, or the mould that came along, as triangles in `machine` axes.",
    "coat": "Show the coat growing on the part: points in `machine` axes, thickness at X-Times (spray).",
}
PROGRAM = "program.nc"
RESULTS = (
    {"program": PROGRAM, "report.html": PAGES["en"]}
    | {address: file for address, (file, *_) in FILES.items()}
    | {name: f"{name}.f32" for name in TABLES}
)

ACCEPTED: dict[int | str, dict[str, Any]] = {202: {"headers": {"Location": {"schema": {"type": "string"}}}}}

router = APIRouter(prefix="/api/v1", tags=["jobs"], responses=responses(*EVERYWHERE))


def job_of_path(id: str, request: Request) -> Record:
    """Return the job that the path names."""
    return _store(request).get(id)


JobOfPath = Annotated[Record, Depends(job_of_path)]


def own_job(record: JobOfPath, request: Request) -> Record:
    """Return the job that the path names if it is the caller's."""
    if record.owner != request.state.owner:
        raise Problem("not-owner", "this job is somebody else's; only its owner may change it")
    return record


OwnJob = Annotated[Record, Depends(own_job)]


@router.post(
    "/jobs",
    status_code=202,
    response_model_exclude_unset=True,
    responses=ACCEPTED | responses(*REFUSED_FORMS),
    openapi_extra=form(JOB_FIELDS, ("file", "kind"), FORM),
)
async def submit(request: Request, response: Response) -> Job:
    """Submit a job; a file that cannot be read fails inside the job."""
    store, foreman = _store(request), _foreman(request)
    foreman.check_room()
    async with _staged(store) as folder:
        sent = await receive(request, folder, JOB_FIELDS)
        order = await run_in_threadpool(job_request, sent, folder)
        record = await run_in_threadpool(store.create, request.state.owner, order, folder)
    try:
        foreman.submit(record)
    except Problem:
        await run_in_threadpool(store.delete, record.id)
        raise
    response.headers["Location"] = f"/api/v1/jobs/{record.id}"
    job = _job(record, request)
    if hasattr(request.state, "owner_key"):
        job.owner_key = request.state.owner_key
    return job


@router.get("/jobs", response_model_exclude_unset=True)
def jobs(request: Request) -> Jobs:
    """List the caller's own jobs."""
    return Jobs(jobs=[_job(record, request) for record in _store(request).of_owner(request.state.owner)])


@router.get("/jobs/{id}", response_model_exclude_unset=True, responses=responses("not-found"))
def job(record: JobOfPath, request: Request) -> Job:
    """Show a job; whoever has its id may."""
    return _job(record, request)


@router.delete("/jobs/{id}", status_code=204, responses=responses("not-found", "not-owner"))
async def delete(record: OwnJob, request: Request) -> None:
    """Remove a job with its files; one that is under way is cancelled first."""
    await _foreman(request).cancel(record.id)
    await run_in_threadpool(_store(request).delete, record.id)


@router.post(
    "/jobs/{id}/cancel",
    status_code=202,
    response_model_exclude_unset=True,
    responses=responses("not-found", "not-owner"),
)
async def cancel(record: OwnJob, request: Request) -> Job:
    """Cancel a job that waits or runs; one that has ended stays as it is."""
    return _job(await _foreman(request).cancel(record.id), request)


@router.get("/jobs/{id}/events", response_class=EventSourceResponse, responses=responses("not-found"))
async def events(record: JobOfPath, request: Request) -> AsyncIterator[ServerSentEvent]:
    """Follow a job: `state` with the whole job at once and when its state changes, `progress`, at last `done`."""
    state = ""
    async for now in _foreman(request).watch(record.id):
        if now.ended and state:
            yield _event("done", _job(now, request))
        elif now.state != state:
            yield _event("state", _job(now, request))
            if now.ended:
                yield _event("done", _job(now, request))
        elif now.state == "running":
            yield _event("progress", Progress(progress=now.progress, stage=now.stage))
        state = now.state


@router.get(
    "/jobs/{id}/program",
    response_class=FileResponse,
    responses=content("text/plain") | responses("not-found", "job-not-finished", "job-failed", "program-withheld"),
)
def program(record: JobOfPath, request: Request) -> FileResponse:
    """Download the NC program; it is given only where verification passed it."""
    if record.error and record.error["code"] == "verification-failed":
        evidence = {key: record.error[key] for key in ("failures", "failure_count") if key in record.error}
        raise Problem("program-withheld", f"verification judged the program bad: {record.error['detail']}", **evidence)
    path = _result(record, request, PROGRAM)
    return JobFile(path, media_type="text/plain", filename=f"{Path(record.name).stem}.nc")


@router.get(
    "/jobs/{id}/setup",
    response_class=FileResponse,
    responses=content("application/toml") | responses("not-found"),
)
def setup(record: JobOfPath, request: Request, whole: bool = False) -> Response:
    """Download the job's setup: the values that it was given, or the whole of it with every default and meaning."""
    path = _store(request).folder(record.id) / "setup.toml"
    if not whole:
        return JobFile(path, media_type="application/toml")
    kind = kind_of(cast(KindName, record.kind))
    text = whole_text(parse_setup(path.read_bytes(), "setup.toml", kind.setup), kind.title)
    return Response(text, media_type="application/toml")


@router.get("/jobs/{id}/limits", responses=responses("not-found"))
def limits(record: JobOfPath, request: Request) -> Limits:
    """Show the limits that the job's setup sets, and which of them are judged."""
    kind = kind_of(cast(KindName, record.kind))
    data = (_store(request).folder(record.id) / "setup.toml").read_bytes()
    by_key = kind.limits(parse_setup(data, "setup.toml", kind.setup))
    return Limits(limits={key: LimitTold(value=limit.value, judged=limit.judged) for key, limit in by_key.items()})


@router.get(
    "/jobs/{id}/report.html",
    response_class=FileResponse,
    responses=content("text/html", "Content-Language")
    | responses("not-found", "not-made", "job-not-finished", "job-failed"),
)
def report_page(
    record: JobOfPath,
    request: Request,
    language: Language | None = None,
    accept_language: Annotated[str, Header()] = "",
) -> FileResponse:
    """Show the report as a page, in the language asked for, or else in the one that the browser likes best."""
    chosen = language or language_accepted(accept_language)
    path = _result(record, request, PAGES["en"])
    translated = path.with_name(PAGES[chosen])
    # Jobs that were made by a version without translations have the English page only.
    told, chosen = (translated, chosen) if translated.is_file() else (path, "en")
    headers = {"Content-Language": chosen, "Vary": "Accept-Language"}
    return JobFile(told, media_type="text/html", headers=headers)


@router.get(
    "/jobs/{id}/source",
    response_class=FileResponse,
    responses=content("application/octet-stream") | responses("not-found"),
)
def source(record: JobOfPath, request: Request) -> FileResponse:
    """Download the course file or the STL that the job was made from."""
    path = _store(request).folder(record.id) / "source"
    return JobFile(path, media_type="application/octet-stream", filename=record.name)


@router.get(
    "/jobs/{id}/parts/{name}",
    response_class=FileResponse,
    responses=content("application/octet-stream") | responses("not-found"),
)
def part(record: JobOfPath, name: str, request: Request) -> FileResponse:
    """Download a file that came along as one of the job's parts."""
    if name not in record.request["parts"]:
        raise Problem("not-found", f"no part {name!r} came along with this job")
    path = _store(request).folder(record.id) / "parts" / name
    return JobFile(path, media_type="application/octet-stream")


@router.get(
    "/jobs/{id}/mould",
    response_class=FileResponse,
    responses=content("application/octet-stream") | responses("not-found"),
)
def mould(record: JobOfPath, request: Request) -> FileResponse:
    """Download the mould that came along with the job."""
    name = record.request.get("mould")
    if not name:
        raise Problem("not-found", "no mould came along with this job")
    path = _store(request).folder(record.id) / "mould"
    return JobFile(path, media_type="application/octet-stream", filename=name)


def _add_file(address: str, file: str, media_type: str, description: str) -> None:
    """Add the route to a file among a job's results."""

    def endpoint(record: JobOfPath, request: Request) -> FileResponse:
        return JobFile(_result(record, request, file), media_type=media_type)

    router.add_api_route(
        f"/jobs/{{id}}/{address}",
        endpoint,
        name=address,
        response_class=FileResponse,
        responses=content(media_type) | responses("not-found", "not-made", "job-not-finished", "job-failed"),
        description=description,
    )


def _add_table(name: str, description: str) -> None:
    """Add the route to a table among a job's results."""

    def endpoint(record: JobOfPath, request: Request) -> FileResponse:
        path = _result(record, request, f"{name}.f32")
        about = json.loads(path.with_suffix(".json").read_bytes())
        columns = about["columns"]
        headers = {"X-Columns": ",".join(columns), "X-Rows": str(path.stat().st_size // (FLOAT_BYTES * len(columns)))}
        if "times" in about:
            headers["X-Times"] = ",".join(f"{time:g}" for time in about["times"])
        if "unit" in about:
            headers["X-Unit"] = about["unit"]
        return JobFile(path, media_type="application/octet-stream", headers=headers)

    router.add_api_route(
        f"/jobs/{{id}}/{name}",
        endpoint,
        name=name,
        response_class=FileResponse,
        responses=content("application/octet-stream", "X-Columns", "X-Rows", "X-Times", "X-Unit")
        | responses("not-found", "not-made", "job-not-finished", "job-failed"),
        description=f"{description} Little-endian float32, row by row; the columns are in X-Columns, units in names.",
    )


for _address, (_file, *_about) in FILES.items():
    _add_file(_address, _file, *_about)
for _name, _description in TABLES.items():
    _add_table(_name, _description)


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
    store, foreman = _store(request), _foreman(request)
    foreman.check_room()
    async with _staged(store) as folder:
        sent = await receive(request, folder, VERIFY_FIELDS)
        order = await run_in_threadpool(verify_request, sent, folder)
        await run_in_threadpool(write_request, folder, order)
        message = await _while_there(request, foreman.run(folder, request.state.owner))
        if message["state"] != "done":
            raise _problem(message["error"])
        report: dict[str, Any] = json.loads((folder / "out" / "report.json").read_bytes())
    # The hash is that of the file, which this answer is not.
    del report["text_sha256"]
    return report | {"remarks": message["summary"]["remarks"]}


async def _while_there(request: Request, work: Awaitable[Message]) -> Message:
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


@asynccontextmanager
async def _staged(store: Store) -> AsyncIterator[Path]:
    """Yield a folder for uploads, and remove it unless it has become a job's."""
    folder = await run_in_threadpool(store.stage)
    try:
        yield folder
    finally:
        await run_in_threadpool(shutil.rmtree, folder, ignore_errors=True)


def _store(request: Request) -> Store:
    store: Store = request.app.state.store
    return store


def _foreman(request: Request) -> Foreman:
    foreman: Foreman = request.app.state.foreman
    return foreman


def _job(record: Record, request: Request) -> Job:
    out = _store(request).folder(record.id) / "out"
    return Job.model_validate(
        {
            "id": record.id,
            "kind": record.kind,
            "name": record.name,
            "state": record.state,
            "progress": record.progress,
            "stage": record.stage,
            "created_at": record.created_at,
            "summary": record.summary,
            "error": record.error,
            "results": [address for address, file in RESULTS.items() if record.summary and (out / file).is_file()],
            "sent": record.request,
            "mine": record.owner == request.state.owner,
        }
    )


def _event(name: Literal["state", "progress", "done"], body: BaseModel) -> ServerSentEvent:
    return ServerSentEvent(event=name, raw_data=body.model_dump_json(exclude_unset=True))


def _result(record: Record, request: Request, name: str) -> Path:
    """Return the path of a file among a job's results.

    Raises:
        Problem: there is no such file; the problem says why.
    """
    if not record.ended:
        raise Problem("job-not-finished", "the job is under way; follow its events and ask again when it is done")
    # Files left by a killed worker are not results.
    if record.summary is None:
        reason = record.error["detail"] if record.error else record.state
        raise Problem("job-failed", f"the job made nothing: {reason}")
    path = _store(request).folder(record.id) / "out" / name
    if path.is_file():
        return path
    raise Problem("not-made", f"this job has none: it is of kind {record.kind}")


# Members of a problem that it makes itself.
REBUILT = ("type", "title", "status", "detail", "translations", "code")


def _problem(body: Mapping[str, Any]) -> Problem:
    """Return a problem that a worker reported."""
    evidence = {key: value for key, value in body.items() if key not in REBUILT}
    return Problem(body["code"], body["detail"], **evidence)
