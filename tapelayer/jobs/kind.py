"""Kind: everything that the command line and the server need to know about a kind of machine and its jobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.jobs.job import MachineJob
from tapelayer.jobs.stages import Weights
from tapelayer.machines.machine import Machine
from tapelayer.reporting.quantity import Row
from tapelayer.reporting.words import Words
from tapelayer.setups.sections import JobSetup
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
    POSES = "a file of the gun's poses"
    PAGE = "an HTML page"
    JSON = "a JSON file"
    STEP = "a STEP model"
    MESH = "a model in another format than STL"
    ARCHIVE = "a packed file"
    DOCUMENT = "a document"
    PICTURE = "a picture"
    BINARY = "a binary file"
    UNKNOWN = "a text of no known form"


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
    """The source of a kind's programs.

    Attributes:
        name: its name in the singular.
        plural: its name in the plural.
        form: of its files.
        media_type: of its bytes.
        fields: what a request may specify about it, besides the file.
    """

    name: str
    plural: str
    form: Form
    media_type: str
    fields: frozenset[str]


class ReadsJobs(Protocol):
    """Makes jobs from the bytes of a source."""

    def __call__(self, data: bytes, name: str, setup: Any, unit: Any = "mm") -> MachineJob[Any, Any]:
        """Return the job of the bytes of a source, with its name for messages."""


class ReadsFiles(Protocol):
    """Makes jobs from the file of a source."""

    def __call__(self, path: Path | str, setup: Any, unit: Any = "mm") -> MachineJob[Any, Any]:
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
    """The contents of a page's drawing of a judged program, besides its path.

    Attributes:
        numbers: of the courses or passes, by their index.
        tables: by name, in millimetres and degrees.
        surfaces: by name, in `machine`, to be drawn as facets.
    """

    numbers: list[int]
    tables: Mapping[str, SceneTable]
    surfaces: Mapping[str, Mesh]


@dataclass(frozen=True)
class JobKind:
    """A kind of machine, and the parts of its jobs.

    Attributes:
        name: short name.
        title: of its setup.
        machine: the built-in machine.
        source: the source of a program.
        parts: the report's key for the number of courses or passes.
        setup: model of its setup.
        options: command-line options that set values of the setup.
        job: makes jobs from bytes.
        read: makes jobs from files.
        rows: of its report.
        limits: of a setup.
        not_judged: what no verdict on its programs covers.
        making: stages of making a program.
        judging: stages of judging one.
        scene: makes the page's drawing from a result and the mould, if any.
    """

    name: str
    title: str
    machine: BuiltIn
    source: Source
    parts: str
    setup: type[JobSetup]
    options: Mapping[str, Option]
    job: ReadsJobs
    read: ReadsFiles
    rows: tuple[Row[Any], ...]
    limits: Callable[[Any], Limits]
    not_judged: tuple[Words, ...]
    making: Weights
    judging: Weights
    scene: Callable[[Any, Mesh | None], Scene]
