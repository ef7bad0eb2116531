"""Results: the routes to what a job was made from, and to what it made."""

from __future__ import annotations

import json
import os
from io import BufferedReader
from pathlib import Path
from typing import Annotated, cast

from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.responses import FileResponse

from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.language import Language
from tapelayer.reporting.words import language_accepted
from tapelayer.setups.sections import parse_setup, whole_text
from tapelayer.workbench.answers import JobFile, Limits, LimitTold, content
from tapelayer.workbench.errands import store_of
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses
from tapelayer.workbench.record import Record
from tapelayer.workbench.store import PAGES

FLOAT_BYTES = 4
# File name, media type and description of each result that a job may have, by address.
FILES = {
    "report.json": ("report.json", "application/json", "Show the report."),
    "trajectory": ("trajectory.txt", "text/plain", "Show the gun's poses in the part's frame (spray)."),
    "urdf": ("machine.urdf", "application/xml", "Show the machine's URDF."),
    "withheld": (
        "withheld.json",
        "application/json",
        "Show the lines of a program that was judged bad: to be read, and no file to be run.",
    ),
    "blocks": ("blocks.json", "application/json", "Show block, line, course, kind and event of each row of the poses."),
}
TABLES = {
    "poses": "Show every axis at the end of each block, and between where it turns or changes its speed.",
    "speeds": "Show the speed of each axis in the motion that ends in the row.",
    "errors": "Show what verification measured along the courses or passes.",
    "points": "Show the arc length of every point of the courses or passes.",
    "tape": "Show the edges of the tape as it is laid, in `machine` axes (lay).",
    "part": "Show the part, or the mould that came along, as triangles in `machine` axes.",
    "coat": "Show the coat growing on the part: points in `machine` axes, thickness at X-Times (spray).",
}
# Folder of the results in a job's folder.
OUT = "out"
PROGRAM = "program.nc"
RESULTS = (
    {"program": PROGRAM, "report.html": PAGES["en"]}
    | {address: file for address, (file, *_) in FILES.items()}
    | {name: f"{name}.f32" for name in TABLES}
)

router = APIRouter(prefix="/api/v1", tags=["jobs"], responses=responses(*EVERYWHERE))


def job_of_path(id: str, request: Request) -> Record:
    """Return the job that the path names."""
    return store_of(request).get(id)


JobOfPath = Annotated[Record, Depends(job_of_path)]


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
    file = _result(record, request, PROGRAM)
    return JobFile(file, "text/plain", filename=f"{Path(record.name).stem}.nc")


@router.get(
    "/jobs/{id}/setup",
    response_class=FileResponse,
    responses=content("application/toml") | responses("not-found"),
)
def setup(record: JobOfPath, request: Request, whole: bool = False) -> Response:
    """Download the job's setup: the values that it was given, or the whole of it with every default and meaning."""
    if not whole:
        return JobFile(store_of(request).open(record.id, "setup.toml"), "application/toml")
    kind = kind_of(cast(KindName, record.kind))
    data = store_of(request).read(record.id, "setup.toml")
    return Response(whole_text(parse_setup(data, "setup.toml", kind.setup), kind.title), media_type="application/toml")


@router.get("/jobs/{id}/limits", responses=responses("not-found"))
def limits(record: JobOfPath, request: Request) -> Limits:
    """Show the limits that the job's setup sets, and which of them are judged."""
    kind = kind_of(cast(KindName, record.kind))
    data = store_of(request).read(record.id, "setup.toml")
    by_key = kind.limits(parse_setup(data, "setup.toml", kind.setup))
    return Limits(limits={key: LimitTold(value=limit.value, judged=limit.judged) for key, limit in by_key.items()})


@router.get(
    "/jobs/{id}/report.html",
    response_class=FileResponse,
    responses=content("text/html", headers=("Content-Language",))
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
    # Jobs that were made by a version without translations have the English page only.
    if not store_of(request).holds(record.id, OUT, PAGES[chosen]):
        chosen = "en"
    headers = {"Content-Language": chosen, "Vary": "Accept-Language"}
    return JobFile(_result(record, request, PAGES[chosen]), "text/html", headers=headers)


@router.get(
    "/jobs/{id}/source",
    response_class=FileResponse,
    responses=content("application/octet-stream") | responses("not-found"),
)
def source(record: JobOfPath, request: Request) -> FileResponse:
    """Download the course file or the STL that the job was made from."""
    return JobFile(store_of(request).open(record.id, "source"), "application/octet-stream", record.name)


@router.get(
    "/jobs/{id}/parts/{name}",
    response_class=FileResponse,
    responses=content("application/octet-stream") | responses("not-found"),
)
def part(record: JobOfPath, name: str, request: Request) -> FileResponse:
    """Download a file that came along as one of the job's parts."""
    if name not in record.request["parts"]:
        raise Problem("not-found", f"no part {name!r} came along with this job")
    return JobFile(store_of(request).open(record.id, "parts", name), "application/octet-stream")


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
    return JobFile(store_of(request).open(record.id, "mould"), "application/octet-stream", name)


def _add_file(address: str, file: str, media_type: str, description: str) -> None:
    """Add the route to a file among a job's results."""

    def endpoint(record: JobOfPath, request: Request) -> FileResponse:
        return JobFile(_result(record, request, file), media_type)

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
        file = _result(record, request, f"{name}.f32")
        about = json.loads(store_of(request).read(record.id, OUT, f"{name}.json"))
        columns = about["columns"]
        size = os.fstat(file.fileno()).st_size
        headers = {"X-Columns": ",".join(columns), "X-Rows": str(size // (FLOAT_BYTES * len(columns)))}
        if "times" in about:
            headers["X-Times"] = ",".join(f"{time:g}" for time in about["times"])
        if "unit" in about:
            headers["X-Unit"] = about["unit"]
        return JobFile(file, "application/octet-stream", headers=headers)

    router.add_api_route(
        f"/jobs/{{id}}/{name}",
        endpoint,
        name=name,
        response_class=FileResponse,
        responses=content("application/octet-stream", headers=("X-Columns", "X-Rows", "X-Times", "X-Unit"))
        | responses("not-found", "not-made", "job-not-finished", "job-failed"),
        description=f"{description} Little-endian float32, row by row; the columns are in X-Columns, units in names.",
    )


for _address, (_file, *_about) in FILES.items():
    _add_file(_address, _file, *_about)
for _name, _description in TABLES.items():
    _add_table(_name, _description)


def _result(record: Record, request: Request, name: str) -> BufferedReader:
    """Open a file among a job's results.

    Raises:
        Problem: there is no such file; the problem says why.
    """
    if not record.ended:
        raise Problem("job-not-finished", "the job is under way; follow its events and ask again when it is done")
    # Files left by a killed worker are not results.
    if record.summary is None:
        reason = record.error["detail"] if record.error else record.state
        raise Problem("job-failed", f"the job made nothing: {reason}")
    store = store_of(request)
    if store.holds(record.id, OUT, name):
        return store.open(record.id, OUT, name)
    raise Problem("not-made", f"this job has none: it is of kind {record.kind}")
