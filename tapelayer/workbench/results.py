"""Results: the routes to what a job was made from, and to what it made."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated, cast

from fastapi import APIRouter, Depends, Header, Request, Response
from fastapi.responses import FileResponse

from tapelayer.jobs.kind import Product
from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.language import Language
from tapelayer.reporting.words import language_accepted
from tapelayer.setups.sections import parse_setup, whole_text
from tapelayer.workbench.answers import JobFile, Limits, LimitTold, content
from tapelayer.workbench.errands import store_of
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses
from tapelayer.workbench.products import OUT, open_product, open_result, product_of, products
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
PRODUCTS = products()
TABLES = {
    "poses": "Show every axis at the end of each block, and between where it turns or changes its speed.",
    "speeds": "Show the speed of each axis in the motion that ends in the row.",
    "errors": "Show what verification measured along the courses or passes.",
    "points": "Show the arc length of every point of the courses or passes.",
    "tape": "Show the edges of the laid tape, in `machine` axes; of a plan with its maps, in the mould's frame.",
    "part": "Show the part, or the mould, as triangles in `machine` axes; of a plan in the mould's frame.",
    "lines": "Show the points of the courses with their normals, in the mould's frame (plan).",
    "gaps": "Show the gaps between neighbouring courses along their edges, in the mould's frame (plan).",
    "boundary": "Show the rings of the ply's boundary, the outer one first, in the mould's frame (plan).",
    "coat": "Show the coat growing on the part: points in `machine` axes, thickness at X-Times (spray).",
}
RESULTS = (
    {name: product.file for name, product in PRODUCTS.items()}
    | {"report.html": PAGES["en"]}
    | {address: file for address, (file, *_) in FILES.items()}
    | {name: f"{name}.f32" for name in TABLES}
)

router = APIRouter(prefix="/api/v1", tags=["jobs"], responses=responses(*EVERYWHERE))


def job_of_path(id: str, request: Request) -> Record:
    """Return the job that the path names."""
    return store_of(request).get(id)


JobOfPath = Annotated[Record, Depends(job_of_path)]


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
    return JobFile(open_result(store_of(request), record, PAGES[chosen]), "text/html", headers=headers)


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


def _add_product(product: Product) -> None:
    """Add the route to what jobs make."""

    def endpoint(record: JobOfPath, request: Request) -> FileResponse:
        store = store_of(request)
        own = product_of(record) == product
        file = open_product(store, record) if own else open_result(store, record, product.file)
        return JobFile(file, product.media_type, filename=f"{Path(record.name).stem}{product.suffix}")

    router.add_api_route(
        f"/jobs/{{id}}/{product.name}",
        endpoint,
        name=product.name,
        response_class=FileResponse,
        responses=content(product.media_type)
        | responses("not-found", "not-made", "job-not-finished", "job-failed", f"{product.name}-withheld"),
        description=f"Download {product.description}; it is given only where verification passed it.",
    )


def _add_file(address: str, file: str, media_type: str, description: str) -> None:
    """Add the route to a file among a job's results."""

    def endpoint(record: JobOfPath, request: Request) -> FileResponse:
        return JobFile(open_result(store_of(request), record, file), media_type)

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
        file = open_result(store_of(request), record, f"{name}.f32")
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


for _product in PRODUCTS.values():
    _add_product(_product)
for _address, (_file, *_about) in FILES.items():
    _add_file(_address, _file, *_about)
for _name, _description in TABLES.items():
    _add_table(_name, _description)
