"""Kinematics: the routes that compute axis values from poses, and poses from axis values, many rows at once.

Parsing and writing many numbers would keep the server from answering others, so that is done in a worker.
"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from tapelayer.workbench.errands import foreman_of, staged, store_of, while_there
from tapelayer.workbench.problems import EVERYWHERE, problem_of_body, responses
from tapelayer.workbench.solving import Asked, LayJoints, LayPoses, Placed, Solved, SprayJoints, SprayPoses, Way, solve
from tapelayer.workbench.store import write_request

# Smaller bodies take a few milliseconds, less than a process.
HEAVY_BYTES = 2**16

router = APIRouter(
    prefix="/api/v1",
    tags=["kinematics"],
    responses=responses(
        *(*EVERYWHERE, "upload-too-large", "foreign-origin", "queue-full"),
        *("out-of-memory", "out-of-time", "worker-killed", "target-not-writable"),
    ),
)


def _body(*models: type[Asked]) -> dict[str, Any]:
    """Return OpenAPI's description of a body that is one of the models."""
    schema = {"oneOf": [model.model_json_schema() for model in models]}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


@router.post("/inverse", response_model=Solved, openapi_extra=_body(LayPoses, SprayPoses))
async def inverse(request: Request) -> Response:
    """Solve axis values for poses: place, normal out of the surface and, for the tape layer, direction of travel.

    Both branches of each pose, the turns of an axis chosen so that it is nearest to the middle of its travel.
    """
    return await _solved("inverse", request)


@router.post("/forward", response_model=Placed, openapi_extra=_body(LayJoints, SprayJoints))
async def forward(request: Request) -> Response:
    """Solve poses for axis values, in the columns that /inverse takes; all other axes stand at 0.

    The tape layer's place and vectors are those of the roller's nose, which is where the surface is, but where that
    climbs along the course: there it meets the round roller elsewhere, and the axis values are the same.
    """
    return await _solved("forward", request)


async def _solved(way: Way, request: Request) -> Response:
    body = await request.body()
    heavy = len(body) > HEAVY_BYTES
    answer = await _by_worker(way, body, request) if heavy else await run_in_threadpool(solve, way, body)
    return Response(answer, media_type="application/json")


async def _by_worker(way: Way, body: bytes, request: Request) -> bytes:
    """Return the answer of a worker.

    Raises:
        Problem: as `solve`, or the worker could not do it.
    """
    foreman = foreman_of(request)
    foreman.check_room()
    async with staged(store_of(request)) as folder:
        await run_in_threadpool((folder / "rows.json").write_bytes, body)
        await run_in_threadpool(write_request, folder, {"kind": way})
        message = await while_there(request, foreman.run(folder, request.state.owner, brief=True))
        if message["state"] != "done":
            raise problem_of_body(message["error"])
        return await run_in_threadpool((folder / "answer.json").read_bytes)
