"""Solving: axis values from poses, and poses from axis values, many rows at once, from JSON to JSON."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError, to_json

from tapelayer.arrays import Floats, Mask
from tapelayer.jobs.kind import BuiltIn
from tapelayer.jobs.kinds import machine_kinds
from tapelayer.machines.machine import Machine
from tapelayer.units import DEG, MM
from tapelayer.workbench.problems import Problem, not_valid

Way = Literal["inverse", "forward"]

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


class Asked(BaseModel):
    """Rows to solve, with their columns in any order."""

    model_config = ConfigDict(extra="forbid")


class LayPoses(Asked):
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


class SprayPoses(Asked):
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


class LayJoints(Asked):
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


class SprayJoints(Asked):
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
Model = TypeVar("Model", Poses, Joints)


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


def solve(way: Way, body: bytes) -> bytes:
    """Return the answer to a body of rows, both as JSON: a `Solved` of the inverse, a `Placed` of the forward way.

    Raises:
        Problem: it is no JSON, or matches none of the models of that way.
    """
    return inverse(_parsed(body, POSES)) if way == "inverse" else forward(_parsed(body, JOINTS))


def inverse(body: Poses) -> bytes:
    """Solve axis values for poses; of the turns of an axis, take that nearest to the middle of its travel."""
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


def forward(body: Joints) -> bytes:
    """Solve poses for axis values; all other axes stand at 0."""
    chain, machine = built_in_machines()[body.machine], machine_of(body.machine)
    values = _values(body, _columns(machine, chain.axes)) * _scales(machine, chain.axes)
    joints = np.zeros((len(values), len(machine.axes)))
    joints[:, [machine.column(name) for name in chain.axes]] = values
    frames = machine.forward(joints, body.frame)
    rows = np.hstack([frames[:, :3, 3] / MM, *(frames[:, :3, axis] for axis in chain.vectors.values())])
    return _answer(body, [*PLACE, *_vector_columns(chain)], values=rows.tolist())


@lru_cache
def built_in_machines() -> dict[str, BuiltIn]:
    """Return the built-in machines by name."""
    return {kind.machine.name: kind.machine for kind in machine_kinds()}


@lru_cache
def machine_of(name: str) -> Machine:
    """Load the built-in machine of that name."""
    return Machine.load(built_in_machines()[name].urdf)


def _parsed(body: bytes, models: TypeAdapter[Model]) -> Model:
    """Parse a body as one of the models.

    Raises:
        Problem: it has too many names and texts, is no JSON, or matches none of the models.
    """
    # The parser cannot be interrupted, and would report a fault for every surplus name.
    if body.count(b'"') > 2 * MOST_TEXTS:
        raise Problem("invalid-request", f"the JSON has more than {MOST_TEXTS} names and texts; send numbers as rows")
    try:
        return models.validate_json(body)
    except ValidationError as error:
        raise _not_valid(error) from None


def _not_valid(error: ValidationError) -> Problem:
    return not_valid([{**fault, "loc": _untagged(fault["loc"])} for fault in error.errors(include_url=False)])


def _untagged(place: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return a fault's place in the body, without the name of the machine, by which the model was chosen."""
    tagged = place[:1] in [(name,) for name in built_in_machines()]
    return ("body", *place[tagged:])


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


def _answer(body: Poses | Joints, columns: Sequence[str], **results: Any) -> bytes:
    # Validating thousands of rows a second time would be slow.
    answer = {"machine": body.machine, "frame": body.frame, "axes": columns, **results}
    return to_json(answer)
