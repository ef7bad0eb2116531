"""Answers: what the routes of jobs give and take, as models for OpenAPI."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, BinaryIO

from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.types import Receive, Scope, Send

from tapelayer.jobs.kinds import NAMES, KindName
from tapelayer.workbench.record import State
from tapelayer.workbench.uploads import Sort


class JobFile(FileResponse):
    """Response with an open file of a job, which may be deleted while it is sent.

    Args:
        file: from `Store.open`; closed when it is sent.
        media_type: of its contents.
        filename: that a browser saves it by.
        headers: further ones.
    """

    def __init__(
        self, file: BinaryIO, media_type: str, filename: str | None = None, headers: Mapping[str, str] | None = None
    ) -> None:
        self._file = file
        path, about = f"/proc/self/fd/{file.fileno()}", os.fstat(file.fileno())
        super().__init__(path, headers=headers, media_type=media_type, filename=filename, stat_result=about)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file."""
        with self._file:
            await super().__call__(scope, receive, send)


class Fault(BaseModel):
    """One fault of a file."""

    model_config = ConfigDict(extra="allow")

    line: Annotated[int, Field(description="from 1; 0 where no line applies")]
    column: Annotated[int, Field(description="from 1; 0 where no column applies")]
    sentence: Annotated[str, Field(description="what is wrong, for a person")]
    translations: Annotated[dict[str, str], Field(description="the sentence, by the code of another language")] = {}


class ProblemDetails(BaseModel):
    """What is wrong (RFC 9457); `code` is for programs, `detail` for people."""

    model_config = ConfigDict(extra="allow")

    type: Annotated[str, Field(description="/problems/CODE, a page that says what the code means")]
    title: Annotated[str, Field(description="the same for every problem with this code")]
    status: Annotated[int, Field(description="HTTP status")]
    detail: Annotated[str, Field(description="what is wrong this time; one line a fault")]
    translations: Annotated[dict[str, str], Field(description="the detail, by the code of another language")] = {}
    code: Annotated[str, Field(description="stable")]
    faults: Annotated[list[Fault], Field(description="of a file that is refused")] = []
    failures: Annotated[list[dict[str, Any]], Field(description="of verification, as in the report")] = []


class Summary(BaseModel):
    """What a job made, in numbers."""

    model_config = ConfigDict(extra="allow")

    passed: bool
    failures: int
    bytes: Annotated[int, Field(description="of the program, or of the course file")]
    courses: Annotated[int, Field(description="lay and plan only")] = 0
    passes: Annotated[int, Field(description="spray only")] = 0
    program_sha256: Annotated[
        str, Field(description="of the program's bytes; empty where the plan failed already; programs only")
    ] = ""
    courses_sha256: Annotated[str, Field(description="of the course file's bytes; plan only")] = ""
    blocks: Annotated[int, Field(description="programs only")] = 0
    duration_s: Annotated[float, Field(description="programs only")] = 0.0
    max_position_error_mm: Annotated[float | None, Field(description="programs only")] = None
    controller: Annotated[str, Field(description="programs only")] = ""


class Sent(BaseModel):
    """What came along with a job's file."""

    unit: Annotated[str, Field(description="of the STL that is sprayed")] = "mm"
    mould: Annotated[str, Field(description="name of the mould's file; empty where none came along")] = ""
    parts: list[str] = []
    from_job: Annotated[str, Field(description="id of the job whose product is the source; empty where a file is")] = ""


Moment = Annotated[str, Field(json_schema_extra={"format": "date-time"})]


class Job(BaseModel):
    """A job as it is."""

    id: Annotated[str, Field(pattern="^[0-9a-f]{32}$", description="whoever has it may read the job")]
    kind: KindName
    name: Annotated[str, Field(description="of the uploaded file")]
    source_sha256: Annotated[str, Field(description="of the uploaded file's bytes; empty where it is not known")]
    title: Annotated[str, Field(description="name that its owner gave it; may be empty")]
    note: Annotated[str, Field(description="of its owner; may be empty")]
    state: State
    progress: Annotated[float, Field(ge=0, le=1)]
    stage: Annotated[str, Field(description="what is under way, or was when the job ended; empty before it began")]
    place: Annotated[int | None, Field(ge=1, description="in the queue; null where it does not wait")]
    created_at: Moment
    started_at: Annotated[Moment | None, Field(description="null until it runs")]
    finished_at: Annotated[Moment | None, Field(description="null until it has ended")]
    deleted_at: Annotated[Moment | None, Field(description="null unless it is deleted")]
    run_s: Annotated[float | None, Field(description="from its start to its end; null where there is none")]
    summary: Annotated[Summary | None, Field(description="null where nothing was made")]
    error: Annotated[ProblemDetails | None, Field(description="null where there is none")]
    results: Annotated[list[str], Field(description="what there is below the job's address; empty until it ends")]
    sent: Sent
    mine: Annotated[bool, Field(description="whether who asks is its owner")]
    owner_key: Annotated[
        str, Field(description="only in the answer to a new job, and where the request named no owner; keep it")
    ] = ""


class Description(BaseModel):
    """What a job's owner says of it; what is left out stays as it is."""

    model_config = ConfigDict(extra="forbid")

    title: Annotated[str | None, Field(max_length=200)] = None
    note: Annotated[str | None, Field(max_length=2000)] = None


class Jobs(BaseModel):
    """Jobs, the newest first."""

    jobs: list[Job]


class LimitTold(BaseModel):
    """What a quantity may be at most."""

    value: float
    judged: Annotated[bool, Field(description="false where the quantity is measured, and fails nothing")]


class Limits(BaseModel):
    """Limits of a job."""

    limits: Annotated[dict[str, LimitTold], Field(description="by the key of the quantity, in its unit")]


class Progress(BaseModel):
    """How far a job is."""

    progress: Annotated[float, Field(ge=0, le=1)]
    stage: str


def content(*media_types: str, headers: Sequence[str] = ()) -> dict[int | str, dict[str, Any]]:
    """Return OpenAPI's description of a route's 200 response: its media types and optional headers."""
    described = {name: {"schema": {"type": "string"}} for name in headers}
    return {200: {"description": "", "content": {each: {} for each in media_types}, "headers": described}}


def form(fields: Mapping[str, Sort], required: tuple[str, ...], described: Mapping[str, Any]) -> dict[str, Any]:
    """Return OpenAPI's description of a multipart form."""
    file = {"type": "string", "format": "binary"}
    schemas: dict[Sort, dict[str, Any]] = {
        "text": {"type": "string"},
        "file": file,
        "files": {"type": "array", "items": file},
    }
    properties = {name: schemas[sort] | described[name] for name, sort in fields.items()}
    schema = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
    return {"requestBody": {"required": True, "content": {"multipart/form-data": {"schema": schema}}}}


FORM = {
    "file": {"description": "the course file, the STL that is sprayed, or the mould's"},
    "from_job": {
        "pattern": "^[0-9a-f]{32}$",
        "description": "in place of a file: id of the job whose product is the source, such as a plan's course file",
    },
    "kind": {"enum": [*NAMES]},
    "setup": {"description": "TOML, as a field or as a file; without it the defaults"},
    "controller": {"description": "in place of the setup's: the name of a built-in or of one of the parts"},
    "unit": {"enum": ["mm", "cm", "m", "in"], "description": "spray only: unit of the STL's numbers; without it mm"},
    "mould": {"description": "lay only: an STL of the mould in mm, in the part's frame, to look at"},
    "parts": {
        "description": "files that the setup names: a URDF and its meshes, a controller table, a profile; "
        "with plain names, [A-Za-z0-9][A-Za-z0-9._-]{0,99}"
    },
    "program": {"description": "the NC program"},
    "force": {"enum": ["true", "false"], "description": "judge it although its header names another setup"},
}
REFUSED_FORMS = (
    *(
        "foreign-origin",
        "upload-too-large",
        "unsupported-media-type",
        "invalid-request",
        "setup-refused",
        "name-not-allowed",
    ),
    *("xml-refused", "queue-full", "target-not-writable"),
)
