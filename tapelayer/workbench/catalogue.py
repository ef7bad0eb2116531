"""Catalogue: the routes that list what is available, and that read and write setups."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Body, Response
from fastapi.responses import FileResponse, PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field

from post import controllers
from tapelayer.jobs.kind import MachineKind
from tapelayer.jobs.kinds import NAMES, KindName, kind_of, kinds, suppliers
from tapelayer.machines.machine import Axis
from tapelayer.reporting.quantity import Group, Style, quantities
from tapelayer.reporting.words import Words
from tapelayer.setups.forms import Values, schema_of, text_of_values, values_of, whole_text_of_values
from tapelayer.units import DEG, MM
from tapelayer.workbench.answers import content
from tapelayer.workbench.problems import EVERYWHERE, Problem, responses
from tapelayer.workbench.solving import built_in_machines, machine_of


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
    kind: KindName
    title: str


class Examples(BaseModel):
    """Files to begin with."""

    examples: list[Example]


EXAMPLES = (
    Example(name="boss_panel_20.txt", kind="lay", title="panel with a boss, courses at 20 degrees"),
    Example(name="curved_panel.stl", kind="spray", title="curved panel, 480 x 320 mm"),
    Example(name="cylinder_panel_15.txt", kind="lay", title="cylinder panel, courses at 15 degrees"),
    Example(name="flat_panel_00.txt", kind="lay", title="flat panel, courses at 0 degrees"),
    Example(name="panel_mould.stl", kind="plan", title="doubly curved panel, a mould to plan a ply on"),
    Example(name="wing_mould.stl", kind="plan", title="tapered wing skin, a mould to plan a ply on"),
    Example(name="wing_skin_00.txt", kind="lay", title="wing skin, courses at 0 degrees"),
    Example(name="wing_skin_45.txt", kind="lay", title="wing skin, courses at 45 degrees: beyond the travel of c"),
)


class WordsTold(BaseModel):
    """A text in both languages."""

    en: str
    zh: str


class QuantityTold(BaseModel):
    """A number of the report."""

    key: Annotated[str, Field(description="in the report, with the unit at its end")]
    words: WordsTold
    about: Annotated[WordsTold, Field(description="what it means")]
    unit: str
    digits: Annotated[int, Field(description="behind the point")]
    style: Annotated[Style, Field(description="how it is written")]
    group: Annotated[Group, Field(description="what the program is, or how well it keeps to what was asked")]
    absent: Annotated[WordsTold, Field(description="why it may have no value")]
    headline: Annotated[bool, Field(description="whether it stands beside the verdict")]
    failure: Annotated[str, Field(description="what a failure of it is called")]


class StageTold(BaseModel):
    """A part of a job's work."""

    name: Annotated[str, Field(description="as progress names it")]
    words: WordsTold


class KindTold(BaseModel):
    """What jobs of a kind report, and what they do one after the other."""

    kind: KindName
    machine: Annotated[str | None, Field(description="name of the machine that comes along; null where there is none")]
    product: Annotated[str, Field(description="what a job makes: its address below the job")]
    suppliers: Annotated[list[KindName], Field(description="kinds of the jobs whose product may be the source")]
    fields: Annotated[list[str], Field(description="fields of a job's form that are this kind's alone")]
    quantities: Annotated[list[QuantityTold], Field(description="in the order of the report")]
    stages: list[StageTold]
    not_judged: Annotated[list[WordsTold], Field(description="what no verdict on a program covers")]


class Kinds(BaseModel):
    """The kinds of jobs."""

    kinds: list[KindTold]


class SetupValues(BaseModel):
    """The values that a setup sets."""

    values: Annotated[Values, Field(description="by section and key; a key left out has its default")]


class SetupWanted(BaseModel):
    """Values that are to be a setup."""

    model_config = ConfigDict(extra="forbid")

    kind: KindName
    values: Annotated[Values, Field(description="by section and key; a null is left out")]
    whole: Annotated[bool, Field(description="whether to write every other key with its default and meaning, too")] = (
        False
    )


router = APIRouter(prefix="/api/v1", tags=["catalogue"], responses=responses(*EVERYWHERE))


@router.get("/controllers")
def list_controllers() -> Controllers:
    """List the controls that there are tables for."""
    tables = [ControllerTold(name=name, title=controllers.load(name).title) for name in controllers.names()]
    return Controllers(controllers=tables)


@router.get("/machines")
def list_machines() -> Machines:
    """List the machines that come along, with their axes."""
    machines = []
    for name, machine in built_in_machines().items():
        axes = [_axis_told(axis) for axis in machine_of(name).axes]
        machines.append(MachineTold(name=name, title=machine.title, axes=axes, frames=[machine.frame]))
    return Machines(machines=machines)


@router.get(
    "/machines/{name}/urdf",
    response_class=FileResponse,
    responses=content("application/xml") | responses("not-found"),
)
def machine_urdf(name: str) -> FileResponse:
    """Download the URDF of a machine that comes along."""
    machines = built_in_machines()
    if name not in machines:
        raise Problem("not-found", f"there is no machine of that name; there are {', '.join(machines)}")
    return FileResponse(machines[name].urdf, media_type="application/xml")


@router.get("/examples")
def list_examples() -> Examples:
    """List files to begin with."""
    return Examples(examples=list(EXAMPLES))


@router.get(
    "/examples/{name}",
    response_class=FileResponse,
    responses=content(*sorted({kind.source.media_type for kind in kinds()})) | responses("not-found"),
)
def example(name: str) -> FileResponse:
    """Download a file to begin with."""
    found = {one.name: one for one in EXAMPLES}
    if name not in found:
        raise Problem("not-found", f"there is no example of that name; there are {', '.join(found)}")
    path = Path(str(resources.files("tapelayer.examples").joinpath(name)))
    return FileResponse(path, media_type=kind_of(found[name].kind).source.media_type, filename=name)


@router.get("/quantities")
def list_quantities() -> Kinds:
    """List what the jobs of each kind report, with its unit and meaning in both languages, and their stages."""
    return Kinds(kinds=[_kind_told(name) for name in NAMES])


@router.get("/setup-schema")
def setup_schema(kind: KindName) -> dict[str, Any]:
    """Show the JSON schema of a setup: every key with its unit in its name, default, limits and description."""
    return schema_of(kind_of(kind).setup)


@router.post("/setup/parse", responses=responses("setup-refused", "foreign-origin", "upload-too-large"))
def parse(kind: KindName, text: Annotated[bytes, Body(media_type="text/plain")] = b"") -> SetupValues:
    """Read a setup's TOML: only the keys that it sets."""
    return SetupValues(values=values_of(text, kind_of(kind).setup))


@router.post(
    "/setup/format",
    response_class=PlainTextResponse,
    responses=content("text/plain") | responses("setup-refused", "foreign-origin", "upload-too-large"),
)
def format(wanted: SetupWanted) -> Response:
    """Write values as a setup's TOML, which is read back as the same values."""
    kind = kind_of(wanted.kind)
    if wanted.whole:
        return PlainTextResponse(whole_text_of_values(wanted.values, kind.setup, kind.title))
    return PlainTextResponse(text_of_values(wanted.values, kind.setup))


def _axis_told(axis: Axis) -> AxisTold:
    scale, unit = (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")
    # Rounding to twelve digits restores the URDF's own round values.
    lower, upper, speed = (float(f"{value * scale:.12g}") for value in (axis.lower, axis.upper, axis.speed))
    return AxisTold(name=axis.name, unit=unit, lower=lower, upper=upper, speed=speed)


def _kind_told(name: KindName) -> KindTold:
    kind = kind_of(name)
    rows = [
        QuantityTold(
            key=row.key,
            words=_words_told(row.words),
            about=_words_told(row.about),
            unit=row.unit,
            digits=row.digits,
            style=row.style,
            group=row.group,
            absent=_words_told(row.absent),
            headline=row.headline,
            failure=row.failure,
        )
        for row in quantities(kind.rows)
    ]
    stages = [StageTold(name=stage.name, words=_words_told(stage.words)) for stage in kind.making]
    return KindTold(
        kind=name,
        machine=kind.machine.name if isinstance(kind, MachineKind) else None,
        product=kind.product.name,
        suppliers=suppliers(kind),
        fields=sorted(kind.fields),
        quantities=rows,
        stages=stages,
        not_judged=[_words_told(words) for words in kind.not_judged],
    )


def _words_told(words: Words) -> WordsTold:
    return WordsTold(en=words.en, zh=words.zh)
