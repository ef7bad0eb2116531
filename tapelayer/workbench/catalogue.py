"""Catalogue: the routes that tell what there is to choose from, and that read and write setups."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from fastapi import APIRouter, Body, Response
from fastapi.responses import FileResponse, PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field

from post import controllers
from tapelayer.jobs.kinds import MODELS, JobKind
from tapelayer.machines.machine import Axis, Machine
from tapelayer.setups.forms import Values, schema_of, text_of_values, values_of
from tapelayer.units import DEG, MM
from tapelayer.workbench.api import content
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses
from urdf import SPRAYER, TAPELAYER

EXAMPLES = {
    "boss_panel_20.txt": "panel with a boss, courses at 20 degrees",
    "curved_panel.stl": "curved panel, 480 x 320 mm",
    "cylinder_panel_15.txt": "cylinder panel, courses at 15 degrees",
    "flat_panel_00.txt": "flat panel, courses at 0 degrees",
    "wing_skin_00.txt": "wing skin, courses at 0 degrees",
    "wing_skin_45.txt": "wing skin, courses at 45 degrees: beyond the travel of c",
}


class BuiltIn(NamedTuple):
    """A machine that comes along.

    Attributes:
        title: one line for people.
        urdf: the file.
        frame: the frame that the inverse brings to a pose.
    """

    title: str
    urdf: Path
    frame: str


MACHINES = {
    "tapelayer": BuiltIn("ten-axis tape-laying gantry", TAPELAYER, "contact"),
    "sprayer": BuiltIn("five-axis spray robot", SPRAYER, "P"),
}


class ControllerTold(BaseModel):
    """A control that there is a table for."""

    name: str
    title: str


class Controllers(BaseModel):
    """The controls that there are tables for."""

    controllers: list[ControllerTold]


class AxisTold(BaseModel):
    """A driven joint, in the unit that it names."""

    name: str
    unit: Annotated[str, Field(pattern="^(mm|deg)$")]
    lower: float
    upper: float
    speed: Annotated[float, Field(description="a second, at most")]


class MachineTold(BaseModel):
    """A machine that comes along."""

    name: str
    title: str
    axes: list[AxisTold]
    frames: Annotated[list[str], Field(description="what `frame` may be in /inverse and /forward")]


class Machines(BaseModel):
    """The machines that come along."""

    machines: list[MachineTold]


class Example(BaseModel):
    """A file to begin with."""

    name: str
    kind: JobKind
    title: str


class Examples(BaseModel):
    """Files to begin with."""

    examples: list[Example]


class SetupValues(BaseModel):
    """The values that a setup sets."""

    values: Annotated[Values, Field(description="by section and key; a key left out has its default")]


class SetupWanted(BaseModel):
    """Values that are to be a setup."""

    model_config = ConfigDict(extra="forbid")

    kind: JobKind
    values: Annotated[Values, Field(description="by section and key; a null is left out")]


router = APIRouter(prefix="/api/v1", tags=["catalogue"], responses=responses(*EVERYWHERE))


@router.get("/controllers")
def list_controllers() -> Controllers:
    """List the controls that there are tables for."""
    found = [ControllerTold(name=name, title=controllers.load(name).title) for name in controllers.names()]
    return Controllers(controllers=found)


@router.get("/machines")
def list_machines() -> Machines:
    """List the machines that come along, with their axes."""
    found = []
    for name, built_in in MACHINES.items():
        axes = [_told(axis) for axis in machine_of(name).axes]
        found.append(MachineTold(name=name, title=built_in.title, axes=axes, frames=[built_in.frame]))
    return Machines(machines=found)


@router.get(
    "/machines/{name}/urdf",
    response_class=FileResponse,
    responses=content("application/xml") | responses("not-found"),
)
def machine_urdf(name: str) -> FileResponse:
    """Download the URDF of a machine that comes along."""
    if name not in MACHINES:
        raise Problem("not-found", f"there is no machine of that name; there are {', '.join(MACHINES)}")
    return FileResponse(MACHINES[name].urdf, media_type="application/xml")


@router.get("/examples")
def list_examples() -> Examples:
    """List files to begin with."""
    found = [Example(name=name, kind=_kind(name), title=title) for name, title in EXAMPLES.items()]
    return Examples(examples=found)


@router.get(
    "/examples/{name}",
    response_class=FileResponse,
    responses=content("text/plain") | content("model/stl") | responses("not-found"),
)
def example(name: str) -> FileResponse:
    """Download a file to begin with."""
    if name not in EXAMPLES:
        raise Problem("not-found", f"there is no example of that name; there are {', '.join(EXAMPLES)}")
    path = Path(str(resources.files("tapelayer.examples").joinpath(name)))
    return FileResponse(path, media_type="text/plain" if _kind(name) == "lay" else "model/stl", filename=name)


@router.get("/setup-schema")
def setup_schema(kind: JobKind) -> dict[str, Any]:
    """Show the JSON schema of a setup: every key with its unit in its name, default, limits and description."""
    return schema_of(MODELS[kind])


@router.post("/setup/parse", responses=responses("setup-refused", "foreign-origin", "upload-too-large"))
def parse(kind: JobKind, text: Annotated[bytes, Body(media_type="text/plain")] = b"") -> SetupValues:
    """Read a setup's TOML: only the keys that it sets."""
    return SetupValues(values=values_of(text, MODELS[kind]))


@router.post(
    "/setup/format",
    response_class=PlainTextResponse,
    responses=content("text/plain") | responses("setup-refused", "foreign-origin", "upload-too-large"),
)
def format(wanted: SetupWanted) -> Response:
    """Write values as a setup's TOML, which is read back as the same values."""
    return PlainTextResponse(text_of_values(wanted.values, MODELS[wanted.kind]))


@lru_cache
def machine_of(name: str) -> Machine:
    """The machine of that name that comes along."""
    return Machine.load(MACHINES[name].urdf)


def _told(axis: Axis) -> AxisTold:
    scale, unit = (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")
    # Twelve digits give back the URDF's own round values.
    lower, upper, speed = (float(f"{value * scale:.12g}") for value in (axis.lower, axis.upper, axis.speed))
    return AxisTold(name=axis.name, unit=unit, lower=lower, upper=upper, speed=speed)


def _kind(name: str) -> JobKind:
    return "spray" if name.endswith(".stl") else "lay"
