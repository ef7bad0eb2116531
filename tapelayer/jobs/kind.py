"""Kind: everything that the command line and the server need to know about a kind of job."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.jobs.job import MachineJob
from tapelayer.jobs.result import Makes
from tapelayer.jobs.stages import Weights
from tapelayer.machines.machine import Machine
from tapelayer.reporting.quantity import Row
from tapelayer.reporting.words import Words
from tapelayer.setups.sections import JobSetup, Settings
from tapelayer.units import MM
from tapelayer.verification.limits import Limits


class Form(Enum):
    """The form of a file, with its name in a sentence."""

    COURSES = "a course file"
    MODEL = "an STL model"
    PROGRAM = "an NC program"
    SETUP = "a setup"
    CONTROLLER = "a controller table"
    MACHINE = "a URDF"
    BOUNDARY = "a file of boundary points"
    DXF = "a DXF drawing"
    POSES = "a file of the gun's poses"
    PAGE = "an HTML page"
    JSON = "a JSON file"
    STEP = "a STEP model"
    IGES = "an IGES model"
    MESH = "a model in another format than STL"
    ARCHIVE = "a packed file"
    DOCUMENT = "a document"
    PICTURE = "a picture"
    BINARY = "a binary file"
    UNKNOWN = "a text of no known form"

    @property
    def read_as(self) -> Form:
        """The form of the files that are read in the same places."""
        return Form.MODEL if self in (Form.STEP, Form.IGES) else self


class Option(NamedTuple):
    """An option of the command line that sets a value of the setup.

    Attributes:
        section: of the setup.
        key: in that section.
    """

    section: str
    key: str


@dataclass(frozen=True)
class BuiltIn:
    """A built-in machine.

    Attributes:
        name: short name.
        title: one line for people.
        urdf: its file.
        frame: the frame that the inverse moves to a pose.
        axes: the axes that the inverse solves for.
        vectors: names of the unit vectors of a pose, with the frame's column of each.
        inverse: solves poses: from a machine, points (n, 3) in metres and unit vectors (n, 3) each to axis values
            (2, n, 5) in metres and radians, NaN where there are none.
        lengths: lengths of the closed form in metres by name, of a machine that is refused if it is of another kind.
    """

    name: str
    title: str
    urdf: Path
    frame: str
    axes: tuple[str, ...]
    vectors: Mapping[str, int]
    inverse: Callable[..., Floats]
    lengths: Callable[[Machine], Mapping[str, float]]


@dataclass(frozen=True)
class Source:
    """What a kind's jobs are made from.

    Attributes:
        name: its name in the singular.
        plural: its name in the plural.
        form: of its files.
        media_type: of its bytes.
        fields: what a request may specify about it, besides the file.
        settings: values of the setup that speak of it, by `name` and `unit`, where they stand there.
    """

    name: str
    plural: str
    form: Form
    media_type: str
    fields: frozenset[str] = frozenset()
    settings: Mapping[str, Option] = field(default_factory=dict)


@dataclass(frozen=True)
class Product:
    """What a kind's jobs make.

    Attributes:
        name: its name, as keys and addresses begin with it.
        form: of its bytes.
        media_type: of its bytes.
        suffix: of its files.
        description: what it is.
    """

    name: str
    form: Form
    media_type: str
    suffix: str
    description: str

    @property
    def file(self) -> str:
        """Name of its file among the results of a job.

        >>> PROGRAM.file
        'program.nc'
        """
        return f"{self.name}{self.suffix}"

    @property
    def hash_key(self) -> str:
        """Key of its SHA-256 in the summary of a job.

        >>> COURSE_FILE.hash_key
        'courses_sha256'
        """
        return f"{self.name}_sha256"


PROGRAM = Product("program", Form.PROGRAM, "text/plain", ".nc", description="the NC program")
COURSE_FILE = Product("courses", Form.COURSES, "text/plain", ".txt", description="the course file")

Made_co = TypeVar("Made_co", bound=Makes, covariant=True)


class ReadsJobs(Protocol[Made_co]):
    """Makes jobs from the bytes of a source."""

    def __call__(self, data: bytes, name: str, setup: Any, unit: Any = "mm", /) -> Made_co:
        """Return the job of the bytes of a source, with its name for messages."""


class ReadsFiles(Protocol[Made_co]):
    """Makes jobs from the file of a source."""

    def __call__(self, path: Path | str, setup: Any, unit: Any = "mm", /) -> Made_co:
        """Return the job of a source's file."""


@dataclass(frozen=True, eq=False)
class SceneTable:
    """Rows of numbers with their columns' names.

    Attributes:
        columns: k names, with their units.
        rows: (n, k), in these units.
        extra: further values that a reader needs.
    """

    columns: tuple[str, ...]
    rows: Floats
    extra: Mapping[str, Any] = field(default_factory=dict)


def point_table(what: str, paths: Sequence[Toolpath]) -> SceneTable:
    """Return the arc length of every point of courses or passes from their first point, in their order.

    Args:
        what: column of their numbers.
        paths: the courses or passes.

    Examples:
        >>> path = Toolpath(3, np.zeros((2, 3)), np.zeros((2, 3)), np.array([0.1, 0.6]))
        >>> point_table("course", [path]).rows.tolist()
        [[3.0, 0.0], [3.0, 500.0]]
    """
    rows = [np.zeros((0, 2))]
    for path in paths:
        along = path.arc_lengths - path.arc_lengths[0]
        rows.append(np.column_stack([np.full(len(along), path.number), along / MM]))
    return SceneTable((what, "arc_length_mm"), np.vstack(rows))


@dataclass(frozen=True)
class Scene:
    """The contents of a page's drawing of what a job made, besides the motion of a program.

    Attributes:
        numbers: of the courses or passes, by their index.
        tables: by name, in millimetres and degrees.
        surfaces: by name, in the frame of the drawing, to be drawn as facets.
    """

    numbers: list[int]
    tables: Mapping[str, SceneTable]
    surfaces: Mapping[str, Mesh]


@dataclass(frozen=True, kw_only=True)
class JobKind:
    """A kind of job, and the parts of its jobs.

    Attributes:
        name: short name.
        title: of its setup.
        setup_name: what a file of its setup is called in a sentence.
        command: the command line that a file of its setup is for, with {} where the file stands.
        source: what its jobs are made from.
        product: what its jobs make.
        parts: the report's key for the number of courses or passes.
        setup: model of its setup.
        start: values that a setup must give, by section and key, as one begins.
        job: makes jobs from bytes.
        rows: of its report.
        summary: keys of the report that a list of jobs tells, besides the verdict.
        limits: of a setup.
        not_judged: what no verdict on its products covers.
        further: forms of files that a setup may name and no other kind knows, with what tells them by their bytes.
        making: stages of making a product.
        scene: makes the page's drawing from a result and the mould, if any.
    """

    name: str
    title: str
    setup_name: str
    command: str
    source: Source
    product: Product
    parts: str
    setup: type[Settings]
    start: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    job: ReadsJobs[Makes]
    rows: tuple[Row[Any], ...]
    summary: tuple[str, ...]
    limits: Callable[[Any], Limits]
    not_judged: tuple[Words, ...] = ()
    further: Mapping[Form, Callable[[bytes], bool]] = field(default_factory=dict)
    making: Weights
    scene: Callable[[Any, Mesh | None], Scene]

    @property
    def fields(self) -> frozenset[str]:
        """What a request may specify, besides source and setup."""
        return self.source.fields

    def first_setup(self) -> Settings:
        """Return the setup to begin with: every default, and what has none as in `start`.

        Examples:
            >>> from tapelayer.laying.kind import KIND
            >>> KIND.first_setup() == KIND.setup()
            True
        """
        return self.setup.model_validate(self.start)


@dataclass(frozen=True, kw_only=True)
class MachineKind(JobKind):
    """A kind of machine: its jobs make programs.

    Attributes:
        machine: the built-in machine.
        setup: model of its setup.
        options: command-line options that set values of the setup.
        job: makes jobs from bytes.
        read: makes jobs from files.
        judging: stages of judging a program.
    """

    product: Product = PROGRAM
    machine: BuiltIn
    setup: type[JobSetup]
    options: Mapping[str, Option]
    job: ReadsJobs[MachineJob[Any, Any]]
    read: ReadsFiles[MachineJob[Any, Any]]
    judging: Weights

    @property
    def fields(self) -> frozenset[str]:
        """What a request may specify, besides source and setup."""
        return self.source.fields | {"controller"}
