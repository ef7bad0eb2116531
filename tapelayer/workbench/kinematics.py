"""Kinematics: the routes that solve axis values for poses, and poses for axis values, many rows at once."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, Protocol

import numpy as np
from fastapi import APIRouter, Depends, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError
from pydantic_core import to_json
from starlette.concurrency import run_in_threadpool

from tapelayer import gantry, wrist
from tapelayer.arrays import Floats, Mask
from tapelayer.machine import Machine
from tapelayer.setup import DEG, MM
from tapelayer.spraying import AXES
from tapelayer.workbench.api import EVERYWHERE
from tapelayer.workbench.catalogue import MACHINES, machine_of
from tapelayer.workbench.problems import Problem, responses

MOST_ROWS = 100_000
# Millimetres, degrees and vectors beyond it are mistakes, and their squares would be no numbers.
GREATEST = 1e12

PLACE = ("x_mm", "y_mm", "z_mm")
NORMAL = ("nx", "ny", "nz")
TANGENT = ("tx", "ty", "tz")

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-GREATEST, le=GREATEST)]
Row = Annotated[list[Number], FailFast(), Field(max_length=9)]


class Asked(BaseModel):
    """Rows that are to be solved."""

    model_config = ConfigDict(extra="forbid")

    machine: Literal["tapelayer", "sprayer"]
    frame: Annotated[
        Literal["contact", "P"],
        Field(description="contact: the nose of the tape layer's roller; P: the point at which the spray gun points"),
    ]
    axes: Annotated[list[str], Field(max_length=9, description="what the columns of the values are, in any order")]
    values: Annotated[list[Row], FailFast(), Field(max_length=MOST_ROWS, description="rows in mm and degrees")]


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


class _Inverse(Protocol):
    def __call__(self, machine: Machine, places: Floats, vectors: Sequence[Floats]) -> Floats:
        """Axis values (2, n, 5) in metres and radians, NaN where there are none.

        Args:
            machine: whose they are.
            places: (n, 3) metres in the machine's axes.
            vectors: unit vectors (n, 3), as many as the chain has.
        """


class _Chain(NamedTuple):
    """How a machine is solved.

    Attributes:
        axes: names of the axes that take a pose.
        vectors: what the columns of a pose's unit vectors are called, each with the frame's axis that it is.
        inverse: solves poses.
    """

    axes: tuple[str, ...]
    vectors: tuple[tuple[tuple[str, ...], int], ...]
    inverse: _Inverse


def _lay(machine: Machine, places: Floats, vectors: Sequence[Floats]) -> Floats:
    return gantry.inverse(machine, places, *vectors)


def _spray(machine: Machine, places: Floats, vectors: Sequence[Floats]) -> Floats:
    angles = wrist.inverse(vectors[0])
    return np.concatenate([np.broadcast_to(places, (len(angles), *places.shape)), angles], axis=2)


CHAINS = {
    "tapelayer": _Chain(gantry.POSE, ((NORMAL, 2), (TANGENT, 0)), _lay),
    "sprayer": _Chain(AXES, ((NORMAL, 2),), _spray),
}

BODY = {"required": True, "content": {"application/json": {"schema": Asked.model_json_schema()}}}

router = APIRouter(
    prefix="/api/v1", tags=["kinematics"], responses=responses(*EVERYWHERE, "invalid-request", "upload-too-large")
)


async def asked_for(request: Request) -> Asked:
    """What a request asks for.

    Raises:
        RequestValidationError: it is no JSON, or not what `Asked` describes.
    """
    body = await request.body()
    try:
        # Beside the event loop and straight from the bytes: many thousand rows would hold up everybody else's requests.
        return await run_in_threadpool(Asked.model_validate_json, body)
    except ValidationError as error:
        faults = [{**fault, "loc": ("body", *fault["loc"])} for fault in error.errors(include_url=False)]
        raise RequestValidationError(faults) from None


Wanted = Annotated[Asked, Depends(asked_for)]


@router.post("/inverse", response_model=Solved, openapi_extra={"requestBody": BODY})
def inverse(asked: Wanted) -> Response:
    """Solve axis values for poses: place, normal out of the surface and, for the tape layer, direction of travel.

    Both branches of each pose, the turns of an axis chosen so that it is nearest to the middle of its travel.
    """
    chain, machine = CHAINS[asked.machine], machine_of(asked.machine)
    names = [name for vector, _ in chain.vectors for name in vector]
    poses = _values(asked, [*PLACE, *names])
    vectors = [_units(poses[:, first : first + 3], names[first - 3]) for first in range(3, poses.shape[1], 3)]
    joints = chain.inverse(machine, poses[:, :3] * MM, vectors)
    axes = [machine.axis(name) for name in chain.axes]
    for column, axis in enumerate(axes):
        if axis.revolute:
            middle = (axis.lower + axis.upper) / 2
            joints[:, :, column] -= 2 * np.pi * np.round((joints[:, :, column] - middle) / (2 * np.pi))
    inside = [(joints[:, :, i] >= axis.lower) & (joints[:, :, i] <= axis.upper) for i, axis in enumerate(axes)]
    reached = np.all(np.isfinite(joints), axis=2)
    branches = [_rows(joints[i] / _scales(machine, chain.axes), reached[i]) for i in range(len(joints))]
    columns = _columns(machine, chain.axes)
    return _answer(asked, columns, branches=branches, within_travel=np.all(inside, axis=0).tolist())


@router.post("/forward", response_model=Placed, openapi_extra={"requestBody": BODY})
def forward(asked: Wanted) -> Response:
    """Solve poses for axis values, in the columns that /inverse takes; all other axes stand at 0.

    The tape layer's place and vectors are those of the roller's nose, which is where the surface is, but where that
    climbs along the course: there it meets the round roller elsewhere, and the axis values are the same.
    """
    chain, machine = CHAINS[asked.machine], machine_of(asked.machine)
    values = _values(asked, _columns(machine, chain.axes)) * _scales(machine, chain.axes)
    joints = np.zeros((len(values), len(machine.axes)))
    joints[:, [machine.column(name) for name in chain.axes]] = values
    frames = machine.forward(joints, asked.frame)
    rows = np.hstack([frames[:, :3, 3] / MM, *(frames[:, :3, axis] for _, axis in chain.vectors)])
    return _answer(asked, [*PLACE, *(name for vector, _ in chain.vectors for name in vector)], values=rows.tolist())


def _values(asked: Asked, columns: Sequence[str]) -> Floats:
    """The values (n, k) with their columns in this order.

    Raises:
        Problem: it is not the machine's frame, the axes are others, or a row has not as many values.
    """
    expected = MACHINES[asked.machine].frame
    if asked.frame != expected:
        raise _invalid(f"frame: the {asked.machine} is solved for {expected}, not for {asked.frame}")
    for index, name in enumerate(asked.axes):
        if name not in columns:
            near = difflib.get_close_matches(name, columns, 1, 0.4)
            shown = repr(name if len(name) <= 40 else name[:37] + "...")
            advice = f"did you mean {near[0]}?" if near else f"expected {', '.join(columns)}"
            raise _invalid(f"axes[{index}]: there is no {shown} here; {advice}")
        if name in asked.axes[:index]:
            raise _invalid(f"axes[{index}]: {name} is there twice; name each column once")
    if missing := [name for name in columns if name not in asked.axes]:
        raise _invalid(f"axes: {', '.join(missing)} missing; expected {', '.join(columns)}")
    for index, row in enumerate(asked.values):
        if len(row) != len(columns):
            sentence = f"expected {len(columns)} numbers, one for each of axes, got {len(row)}"
            raise _invalid(f"values[{index}]: {sentence}")
    values = np.array(asked.values, dtype=np.float64).reshape(-1, len(columns))
    return values[:, [asked.axes.index(name) for name in columns]]


def _units(vectors: Floats, name: str) -> Floats:
    """Unit vectors (n, 3) in the directions of vectors of any length.

    Raises:
        Problem: one has none.
    """
    greatest = np.max(np.abs(vectors), axis=1)
    lost = np.flatnonzero(greatest == 0.0)
    if len(lost):
        what = "normal" if name in NORMAL else "tangent"
        raise _invalid(f"values[{lost[0]}]: the {what} has length zero; give the direction")
    # Squares of tiny numbers would be zero.
    scaled = vectors / greatest[:, None]
    units: Floats = scaled / np.linalg.norm(scaled, axis=1)[:, None]
    return units


def _columns(machine: Machine, axes: Sequence[str]) -> list[str]:
    return [f"{name}_{'deg' if machine.axis(name).revolute else 'mm'}" for name in axes]


def _scales(machine: Machine, axes: Sequence[str]) -> Floats:
    """Metres and radians (k,) of one unit of each axis's column."""
    return np.array([DEG if machine.axis(name).revolute else MM for name in axes])


def _rows(values: Floats, reached: Mask) -> list[list[float] | None]:
    rows: list[list[float] | None] = values.tolist()
    for row in np.flatnonzero(~reached).tolist():
        rows[row] = None
    return rows


def _answer(asked: Asked, columns: Sequence[str], **results: Any) -> Response:
    # Many thousand rows take no second way through a model.
    answer = {"machine": asked.machine, "frame": asked.frame, "axes": columns, **results}
    return Response(to_json(answer), media_type="application/json")


def _invalid(sentence: str) -> Problem:
    return Problem("invalid-request", sentence)
