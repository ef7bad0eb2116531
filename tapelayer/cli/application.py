"""Application: what every command registers with, and the two streams that commands print on."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer
from rich.console import Console

from tapelayer.command_help import Command, Group
from tapelayer.provenance import VERSION

app = typer.Typer(
    name="tapelayer",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Offline programming for a ten-axis tape layer and a spray robot: verified NC programs out of tape courses "
    "and models (STL, STEP, IGES).",
    epilog="Start with: [bold]tapelayer demo[/bold], or [bold]tapelayer export COURSES.txt -o PROGRAM.nc[/bold]",
)
command = partial(app.command, cls=Command)
output = Console()
notices = Console(stderr=True)


def _show_version(asked: bool) -> None:
    if asked:
        output.print(f"tapelayer {VERSION}", highlight=False)
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass
