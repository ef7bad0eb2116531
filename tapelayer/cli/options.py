"""Options: the arguments and options that several commands share, with their help, and the refusal of a value."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, cast, get_args

import typer

from post import controllers
from tapelayer.errors import InputFault, InputRefused, SetupRefused
from tapelayer.jobs.kinds import MACHINE_NAMES, NAMES, KindName, MachineKindName
from tapelayer.language import LANGUAGES, Language, language_of
from tapelayer.units import Unit

UNITS = get_args(Unit)


def _controller(default: str) -> typer.models.OptionInfo:
    """Return the option that names a controller table, with the default that its help shows."""
    option: typer.models.OptionInfo = typer.Option(
        "--controller",
        metavar="NAME",
        help=rf"Controller table, or the path of one. \[default: {default}]",
        autocompletion=lambda: list(controllers.names()),
    )
    return option


Courses = Annotated[str, typer.Argument(metavar="COURSES.txt", help="Course file (the paper's Table 3).")]
SetupFile = Annotated[str | None, typer.Option("--setup", metavar="S.toml", help="Setup; without it the defaults.")]
LayController = Annotated[str | None, _controller("jb3208")]
SprayController = Annotated[str | None, _controller("generic5")]
EitherController = Annotated[str | None, _controller("jb3208, for a model generic5")]
KinematicsName = Annotated[
    str | None,
    typer.Option(
        "--kinematics",
        metavar="roller|published",
        help=r"Closed form in use. \[default: roller]",
        autocompletion=lambda: ["roller", "published"],
    ),
]
Target = Annotated[
    str | None,
    typer.Option(
        "-o",
        metavar="OUT.nc",
        help=r"Program; of several, a folder; - for stdout. \[default: beside the source, with its name and .nc]",
    ),
]
ReportFile = Annotated[
    str | None, typer.Option("--report", metavar="OUT.json", help="Write the report as JSON; of several, a folder.")
]
HtmlFile = Annotated[
    str | None, typer.Option("--html", metavar="OUT.html", help="Write the report with plots; of several, a folder.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the report as JSON, and the table on stderr.")]
UnitName = Annotated[
    str,
    typer.Option(
        "--unit",
        metavar="|".join(UNITS),
        help="Unit of the numbers of the model or course file, which do not state it.",
        autocompletion=lambda: list(UNITS),
    ),
]
Direction = Annotated[
    str | None,
    typer.Option("--direction-deg", metavar="DEG", help=r"Travel of the passes, from +x towards +y. \[default: 0]"),
]
Pitch = Annotated[str | None, typer.Option("--pitch-mm", metavar="MM|auto", help=r"From pass to pass. \[default: 25]")]
LanguageName = Annotated[
    str | None,
    typer.Option(
        "--language",
        metavar="|".join(LANGUAGES),
        help=r"Language of reports and tables. \[default: the locale's]",
        autocompletion=lambda: list(LANGUAGES),
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Replace files that were edited, or that tapelayer did not write.")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="Say how long each step takes.")]
Kind = Annotated[
    str,
    typer.Option(
        "--kind",
        metavar="|".join(NAMES),
        help="The job: tape laying or spraying.",
        autocompletion=lambda: list(NAMES),
    ),
]


class OptionRefused(InputRefused):
    """An option cannot have the value that was typed."""

    @classmethod
    def because(cls, option: str, sentence: str) -> OptionRefused:
        """Return the refusal of an option.

        >>> print(OptionRefused.because("--unit", "expected mm, cm, m or in, got 'ft'"))
        --unit: expected mm, cm, m or in, got 'ft'
        """
        return cls(option, [InputFault(0, sentence)])


def unit_of(text: str) -> Unit:
    """Return the unit of the numbers of a model or course file.

    Raises:
        OptionRefused: there is no such unit.
    """
    return cast(Unit, _one_of("--unit", text, UNITS))


def kind_name(text: str) -> KindName:
    """Return the name of a kind of job.

    Raises:
        OptionRefused: there is no such kind.
    """
    return cast(KindName, _one_of("--kind", text, NAMES))


def machine_kind_name(text: str) -> MachineKindName:
    """Return the name of a kind of machine.

    Raises:
        OptionRefused: there is no such kind.

    Examples:
        >>> machine_kind_name("spray")
        'spray'
    """
    return cast(MachineKindName, _one_of("--kind", text, MACHINE_NAMES))


def language_named(text: str | None) -> Language:
    """Return the language of reports and tables: the locale's where the option is left out.

    Raises:
        OptionRefused: there is no such language.
    """
    return language_of(os.environ) if text is None else cast(Language, _one_of("--language", text, LANGUAGES))


def _one_of(option: str, text: str, known: tuple[str, ...]) -> str:
    if text not in known:
        raise OptionRefused.because(option, f"expected {', '.join(known[:-1])} or {known[-1]}, got {text!r}")
    return text


@contextmanager
def typed_as(option: str) -> Iterator[None]:
    """Name the option in refusals of the value of the setup that it sets."""
    try:
        yield
    except SetupRefused as error:
        sentences = [
            fault.sentence.removeprefix(f"[{fault.place[0]}] {'.'.join(fault.place[1:])}: ")
            if fault.place
            else fault.sentence
            for fault in error.faults
        ]
        raise OptionRefused(option, [InputFault(0, sentence) for sentence in sentences]) from None
