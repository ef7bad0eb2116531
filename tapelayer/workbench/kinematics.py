"""Kinematics: the routes that compute axis values from poses, and poses from axis values, many rows at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from fastapi import APIRouter, Depends, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError, to_json
from starlette.concurrency import run_in_threadpool

from tapelayer.arrays import Floats, Mask
from tapelayer.jobs.kind import BuiltIn
from tapelayer.machines.machine import Machine
from tapelayer.units import DEG, MM
from tapelayer.workbench.catalogue import built_in_machines, machine_of
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses

MOST_ROWS = 100_000
MOST_TEXTS = 100
# Larger values in any unit are mistakes, and their squares could overflow.
GREATEST = 1e12

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-GREATEST, le=GREATEST)]
Rows5 = Annotated[
    list[Annotated[list[Number], FailFast(), Field(min_length=5, max_length=5)]],
    FailFast(),
    Field(max_length=MOST_ROWS, description="of each row: mm and degrees"),
]
Rows6 = Annotated[
    list[Annotated[list[Number], FailFast(), Field(min_length=6, max_length=6)]],
    FailFast(),
    Field(max_length=MOST_ROWS, description="of each row: place in mm in the machine's axes, direction of any length"),
]
Rows9 = Annotated[
    list[Annotated[list[Number], FailFast(), Field(min_length=9, max_length=9)]],
    FailFast(),
    Field(max_length=MOST_ROWS, description="of each row: place in mm in the machine's axes, directions of any length"),
]


def _once(names: list[str]) -> list[str]:
    if len(set(names)) < len(names):
        raise PydanticCustomError("column_twice", "name each column once")
    return names


Once = AfterValidator(_once)
PLACE = ["x_mm", "y_mm", "z_mm"]


class _Asked(BaseModel):
    """Rows to solve, with their columns in any order."""

    model_config = ConfigDict(extra="forbid")


class LayPoses(_Asked):
    """Where the tape layer's roller is to meet the surface: place, normal out of it, direction of travel."""

    machine: Literal["tapelayer"]
    frame: Literal["contact"]
    axes: Annotated[
        list[Literal["x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "tx", "ty", "tz"]],
        Field(min_length=9, max_length=9, json_schema_extra={"uniqueItems": True}),
        FailFast(),
        Once,
    ]
    values: Rows9


class SprayPoses(_Asked):
    """What the spray gun is to point at: place, normal out of the surface."""

    machine: Literal["sprayer"]
    frame: Literal["P"]
    axes: Annotated[
        list[Literal["x_mm", "y_mm", "z_mm", "nx", "ny", "nz"]],
        Field(min_length=6, max_length=6, json_schema_extra={"uniqueItems": True}),
        FailFast(),
        Once,
    ]
    values: Rows6


class LayJoints(_Asked):
    """Axis values of the tape layer."""

    machine: Literal["tapelayer"]
    frame: Literal["contact"]
    axes: Annotated[
        list[Literal["x_mm", "y_mm", "z_mm", "c_deg", "a_deg"]],
        Field(min_length=5, max_length=5, json_schema_extra={"uniqueItems": True}),
        FailFast(),
        Once,
    ]
    values: Rows5


class SprayJoints(_Asked):
    """Axis values of the spray robot."""

    machine: Literal["sprayer"]
    frame: Literal["P"]
    axes: Annotated[
        list[Literal["x_mm", "y_mm", "z_mm", "theta_deg", "phi_deg"]],
        Field(min_length=5, max_length=5, json_schema_extra={"uniqueItems": True}),
        FailFast(),
        Once,
    ]
    values: Rows5


Poses = LayPoses | SprayPoses
Joints = LayJoints | SprayJoints
Model = TypeVar("Model")


class Solved(BaseModel):
    """Axis values for each pose, branch by branch."""

    machine: str
    frame: str
    axes: Annotated[list[str], Field(description="what the columns are")]
    branches: Annotated[
        list[list[list[float] | None]],
        Field(description="of each branch, of each row: axis values, or null where the pose cannot be taken"),
    ]
    within_travel: Annotated[
        list[list[bool]], Field(description="of each branch, of each row: whether every axis is within its travel")
    ]


class Placed(BaseModel):
    """Pose for each row of axis values."""

    machine: str
    frame: str
    axes: Annotated[list[str], Field(description="what the columns are")]
    values: Annotated[list[list[float]], Field(description="of each row: place in the machine's axes, unit vectors")]


POSES: TypeAdapter[Poses] = TypeAdapter(Annotated[Poses, Field(discriminator="machine")])
JOINTS: TypeAdapter[Joints] = TypeAdapter(Annotated[Joints, Field(discriminator="machine")])

router = APIRouter(
    prefix="/api/v1", tags=["kinematics"], responses=responses(*EVERYWHERE, "invalid-request", "upload-too-large")
)


def _body(*models: type[_Asked]) -> dict[str, Any]:
    """Return OpenAPI's description of a body that is one of the models."""
    schema = {"oneOf": [model.model_json_schema() for model in models]}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


async def parse_poses(request: Request) -> Poses:
    """Parse the poses in a request's body."""
    return await _parse(request, POSES)


async def parse_joints(request: Request) -> Joints:
    """Parse the axis values in a request's body."""
    return await _parse(request, JOINTS)


async def _parse(request: Request, models: TypeAdapter[Model]) -> Model:
    """Parse a request's body as one of the models.

    Raises:
        Problem: it has too many names and texts.
        RequestValidationError: it is no JSON, or matches none of the models.
    """
    body = await request.body()
    # The parser cannot be interrupted, and would report a fault for every surplus name.
    if body.count(b'"') > 2 * MOST_TEXTS:
        raise Problem("invalid-request", f"the JSON has more than {MOST_TEXTS} names and texts; send numbers as rows")
    try:
        # In a thread and straight from the bytes: parsing thousands of rows must not block other requests.
        return await run_in_threadpool(models.validate_json, body)
    except ValidationError as error:
        faults = []
        for fault in error.errors(include_url=False):
            place = fault["loc"][1:] if fault["loc"][:1] in [(name,) for name in built_in_machines()] else fault["loc"]
            faults.append({**fault, "loc": ("body", *place)})
        raise RequestValidationError(faults) from None


@router.post("/inverse", response_model=Solved, openapi_extra=_body(LayPoses, SprayPoses))
def inverse(body: Annotated[Poses, Depends(parse_poses)]) -> Response:
    """Solve axis values for poses: place, normal out of the surface and, for the tape layer, direction of travel.

    Both branches of each pose, the turns of an axis chosen so that it is nearest to the middle of its travel.
    """
    chain, machine = built_in_machines()[body.machine], machine_of(body.machine)
    poses = _values(body, [*PLACE, *_vector_columns(chain)])
    vectors = [_units(poses[:, first : first + 3]) for first in range(3, poses.shape[1], 3)]
    joints = chain.inverse(machine, poses[:, :3] * MM, *vectors)
    axes = [machine.axis(name) for name in chain.axes]
    for column, axis in enumerate(axes):
        if axis.revolute:
            middle = (axis.lower + axis.upper) / 2
            joints[:, :, column] -= 2 * np.pi * np.round((joints[:, :, column] - middle) / (2 * np.pi))
    inside = [(joints[:, :, i] >= axis.lower) & (joints[:, :, i] <= axis.upper) for i, axis in enumerate(axes)]
    reached = np.all(np.isfinite(joints), axis=2)
    branches = [_rows(joints[i] / _scales(machine, chain.axes), reached[i]) for i in range(len(joints))]
    columns = _columns(machine, chain.axes)
    return _answer(body, columns, branches=branches, within_travel=np.all(inside, axis=0).tolist())


@router.post("/forward", response_model=Placed, openapi_extra=_body(LayJoints, SprayJoints))
def forward(body: Annotated[Joints, Depends(parse_joints)]) -> Response:
    """Solve poses for axis values, in the columns that /inverse takes; all other axes stand at 0.

    The tape layer's place and vectors are those of the roller's nose, which is where the surface is, but where that
    climbs along the course: there it meets the round roller elsewhere, and the axis values are the same.
    """
    chain, machine = built_in_machines()[body.machine], machine_of(body.machine)
    values = _values(body, _columns(machine, chain.axes)) * _scales(machine, chain.axes)
    joints = np.zeros((len(values), len(machine.axes)))
    joints[:, [machine.column(name) for name in chain.axes]] = values
    frames = machine.forward(joints, body.frame)
    rows = np.hstack([frames[:, :3, 3] / MM, *(frames[:, :3, axis] for axis in chain.vectors.values())])
    return _answer(body, [*PLACE, *_vector_columns(chain)], values=rows.tolist())


def _values(body: Poses | Joints, columns: Sequence[str]) -> Floats:
    """Return the values (n, k) of a body with the columns in this order."""
    values = np.array(body.values, dtype=np.float64).reshape(-1, len(columns))
    names: list[str] = [*body.axes]
    return values[:, [names.index(name) for name in columns]]


def _vector_columns(chain: BuiltIn) -> list[str]:
    """Return the column names of a pose's unit vectors."""
    return [f"{vector}{axis}" for vector in chain.vectors for axis in "xyz"]


def _units(vectors: Floats) -> Floats:
    """Return vectors (n, 3) scaled to unit length; NaN for zero vectors."""
    with np.errstate(invalid="ignore"):
        # The squares of tiny numbers would underflow to zero.
        scaled = vectors / np.max(np.abs(vectors), axis=1)[:, None]
    units: Floats = scaled / np.linalg.norm(scaled, axis=1)[:, None]
    return units


def _columns(machine: Machine, axes: Sequence[str]) -> list[str]:
    return [f"{name}_{'deg' if machine.axis(name).revolute else 'mm'}" for name in axes]


def _scales(machine: Machine, axes: Sequence[str]) -> Floats:
    """Return the factors (k,) from each axis's column unit, mm or degrees, to metres or radians."""
    return np.array([DEG if machine.axis(name).revolute else MM for name in axes])


def _rows(values: Floats, reached: Mask) -> list[list[float] | None]:
    rows: list[list[float] | None] = values.tolist()
    for row in np.flatnonzero(~reached).tolist():
        rows[row] = None
    return rows


def _answer(body: Poses | Joints, columns: Sequence[str], **results: Any) -> Response:
    # Validating thousands of rows a second time would be slow.
    answer = {"machine": body.machine, "frame": body.frame, "axes": columns, **results}
    return Response(to_json(answer), media_type="application/json")
