"""Options: the arguments and options that several commands share, with their help."""

from __future__ import annotations

from typing import Annotated

import typer

from tapelayer.geometry.mesh import Unit
from tapelayer.jobs.kinds import KindName

Courses = Annotated[str, typer.Argument(metavar="COURSES.txt", help="Course file (the paper's Table 3), mm.")]
SetupFile = Annotated[str | None, typer.Option("--setup", metavar="S.toml", help="Setup; without it the defaults.")]
ControllerName = Annotated[
    str | None, typer.Option("--controller", metavar="NAME", help="Controller table, or the path of one.")
]
KinematicsName = Annotated[
    str | None, typer.Option("--kinematics", metavar="roller|published", help="Closed form in use.")
]
ReportFile = Annotated[str | None, typer.Option("--report", metavar="OUT.json", help="Write the report as JSON.")]
HtmlFile = Annotated[str | None, typer.Option("--html", metavar="OUT.html", help="Write the report with plots.")]
UnitName = Annotated[Unit, typer.Option("--unit", help="Unit of the model's numbers; STL does not state one.")]
Direction = Annotated[
    float | None, typer.Option("--direction-deg", metavar="DEG", help="Travel of the passes, from +x towards +y.")
]
Pitch = Annotated[str | None, typer.Option("--pitch-mm", metavar="MM|auto", help="From pass to pass.")]
Force = Annotated[
    bool, typer.Option("--force", metavar="", help="Replace files that were edited, or that tapelayer did not write.")
]
Quiet = Annotated[bool, typer.Option("--quiet", metavar="", help="Say nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", metavar="", help="Say how long each step takes.")]
Kind = Annotated[KindName, typer.Option("--kind", help="The job: tape laying or spraying.")]
