"""Kind: everything that the command line and the server have to know of a kind of machine and its jobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from tapelayer.arrays import Floats
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.job import MachineJob
from tapelayer.jobs.stages import Weights
from tapelayer.reporting.quantity import Row
from tapelayer.setups.sections import JobSetup
from tapelayer.verification.limits import Limits


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
    """A machine that comes along.

    Attributes:
        name: short.
        title: one line for people.
        urdf: its file.
        frame: the frame that the inverse brings to a pose.
        axes: the axes that take a pose.
        vectors: the unit vectors of a pose, by the column of the frame that each is.
        inverse: solves poses: of a machine, places (n, 3) in metres and unit vectors (n, 3) each, axis values
            (2, n, 5) in metres and radians, NaN where there are none.
    """

    name: str
    title: str
    urdf: Path
    frame: str
    axes: tuple[str, ...]
    vectors: Mapping[str, int]
    inverse: Callable[..., Floats]


@dataclass(frozen=True)
class Source:
    """What a kind's programs are made from.

    Attributes:
        name: what one is called.
        plural: what many are called.
        media_type: of its bytes.
        fields: what a request may say of it, beside the file.
    """

    name: str
    plural: str
    media_type: str
    fields: frozenset[str]


class ReadsJobs(Protocol):
    """Makes jobs of the bytes of a source."""

    def __call__(self, data: bytes, name: str, setup: Any, unit: Any = "mm") -> MachineJob[Any, Any]:
        """Return the job of the bytes of a source, which messages call by its name."""


class ReadsFiles(Protocol):
    """Makes jobs of the file of a source."""

    def __call__(self, path: Path | str, setup: Any, unit: Any = "mm") -> MachineJob[Any, Any]:
        """Return the job of a source's file."""


@dataclass(frozen=True, eq=False)
class SceneTable:
    """Rows of numbers with their columns' names.

    Attributes:
        columns: k names, with their units.
        rows: (n, k), in these units.
        extra: what else a reader has to know.
    """

    columns: tuple[str, ...]
    rows: Floats
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Scene:
    """What a page draws of a judged program, beside its path.

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
    """A kind of machine, and what its jobs are.

    Attributes:
        name: short.
        title: of its setup.
        machine: the machine that comes along.
        source: what a program is made from.
        parts: what a program is made of: the report's key of their number.
        setup: model of its setup.
        options: of the command line, that set values of the setup.
        job: makes jobs of bytes.
        read: makes jobs of files.
        rows: of its report.
        limits: of a setup.
        making: stages of making a program.
        judging: stages of judging one.
        scene: what a page draws of a result and, where there is one, the mould.
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
    making: Weights
    judging: Weights
    scene: Callable[[Any, Mesh | None], Scene]
