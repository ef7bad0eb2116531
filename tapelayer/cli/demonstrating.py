"""Demonstrating: the command that runs a job on an example."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from tapelayer.cli.application import command, output
from tapelayer.cli.making import export
from tapelayer.cli.options import Force
from tapelayer.cli.outputs import make_folder
from tapelayer.cli.planning import plan as plan_ply


@command(epilog="Examples: [bold]tapelayer demo --into demo[/bold], [bold]tapelayer demo --plan[/bold]")
def demo(
    into: Annotated[str, typer.Option("--into", metavar="FOLDER", help="Where the results go.")] = "demo",
    plan: Annotated[
        bool, typer.Option("--plan", help="Plan the courses of a ply on a mould, and make their program.")
    ] = False,
    force: Force = False,
) -> None:
    """Run a job on an example: a cylinder panel at 15 degrees, or a ply on a doubly curved panel."""
    folder, examples = Path(into), files("tapelayer.examples")
    make_folder(folder, "--into")
    stem = folder / ("panel_ply_0" if plan else "cylinder_panel_15")
    program, report, page = f"{stem}.nc", f"{stem}.json", f"{stem}.html"
    if plan:
        ply, setup = (str(examples.joinpath(name)) for name in ("panel_ply_0.toml", "panel_setup.toml"))
        plan_ply(ply, setup, program, report, page, export=True, force=force)
    else:
        courses = str(examples.joinpath("cylinder_panel_15.txt"))
        export([courses], target=program, report_file=report, html_file=page, force=force)
    output.print(f"open {page} to look at it", highlight=False, soft_wrap=True, markup=False)
