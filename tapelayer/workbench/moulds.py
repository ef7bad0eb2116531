"""Moulds: the routes that tell what a mould, a boundary's file and a ply are, before there is a job.

Reading a large file would keep the server from answering others, so that is done in a worker, and nothing is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from tapelayer.plies.ply import Ply
from tapelayer.setups.forms import NAME, text_of
from tapelayer.setups.sections import parse_setup
from tapelayer.units import Unit
from tapelayer.workbench.answers import REFUSED_FORMS, form
from tapelayer.workbench.errands import foreman_of, staged, store_of, while_there
from tapelayer.workbench.problems import EVERYWHERE, problem_of_body, responses
from tapelayer.workbench.store import write_request
from tapelayer.workbench.submission import check_files, chosen
from tapelayer.workbench.surveying import BoundaryTold, MouldTold, RegionTold, Survey
from tapelayer.workbench.uploads import Form, Sort, invalid, receive

FILE_FIELDS: dict[str, Sort] = {"file": "file", "unit": "text"}
PLY_FIELDS: dict[str, Sort] = {"file": "file", "setup": "text", "parts": "files"}
FORM = {
    "file": {"description": "the mould's STL, or the boundary's points or DXF"},
    "unit": {"enum": [*get_args(Unit)], "description": "unit of the file's numbers; without it mm"},
    "setup": {"description": "the ply file: TOML, as a field or as a file; [mould] file need not be there"},
    "parts": {"description": "the boundary's file, if the ply file names one; with a plain name"},
}

router = APIRouter(
    prefix="/api/v1",
    tags=["plies"],
    responses=responses(
        *(*EVERYWHERE, *REFUSED_FORMS, "mesh-refused", "ply-refused"),
        *("out-of-memory", "out-of-time", "worker-killed"),
    ),
)


@router.post("/mould", response_model=MouldTold, openapi_extra=form(FILE_FIELDS, ("file",), FORM))
async def mould(request: Request) -> Response:
    """Read a mould: its size, its edges, and its surface to draw."""
    return await _surveyed("mould", request, FILE_FIELDS)


@router.post("/boundary", response_model=BoundaryTold, openapi_extra=form(FILE_FIELDS, ("file",), FORM))
async def boundary(request: Request) -> Response:
    """Read the file of a ply's boundary: its points, as a ply file may hold them."""
    return await _surveyed("boundary", request, FILE_FIELDS)


@router.post("/region", response_model=RegionTold, openapi_extra=form(PLY_FIELDS, ("file", "setup"), FORM))
async def region(request: Request) -> Response:
    """Find what a ply covers on its mould, and every fault of its boundary, holes, seed and rosette."""
    return await _surveyed("region", request, PLY_FIELDS)


async def _surveyed(kind: Survey, request: Request, fields: Mapping[str, Sort]) -> Response:
    """Return the answer of a worker.

    Raises:
        Problem: a file is refused, or the worker could not read it.
        PlyRefused: the ply file has faults.
    """
    foreman = foreman_of(request)
    foreman.check_room()
    async with staged(store_of(request)) as folder:
        sent = await receive(request, folder, fields)
        order = await run_in_threadpool(_order, kind, sent, folder)
        await run_in_threadpool(write_request, folder, order)
        message = await while_there(request, foreman.run(folder, request.state.owner, brief=True))
        if message["state"] != "done":
            raise problem_of_body(message["error"])
        answer = await run_in_threadpool((folder / "answer.json").read_bytes)
    return Response(answer, media_type="application/json")


def _order(kind: Survey, sent: Form, folder: Path) -> dict[str, Any]:
    """Return what a worker is asked for by a form, and put the ply file, if there is one, where it reads it."""
    if "file" not in sent.names:
        raise invalid("file: is missing; send it as a file")
    name = sent.names["file"]
    if "setup" in sent.texts:
        ply = parse_setup(bytes(sent.texts["setup"]), NAME, Ply, {("mould", "file"): name})
        check_files(ply, {("mould", "file"): (name,)}, sent.files)
        (folder / NAME).write_text(text_of(ply), encoding="utf-8")
    return {"kind": kind, "name": name, "unit": chosen(sent, "unit", get_args(Unit), "mm")}
