"""Application: what every command registers with, and the two streams that commands print on."""

from __future__ import annotations

import typer
from rich.console import Console

app = typer.Typer(
    name="tapelayer",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Offline programming for a ten-axis tape layer: tape courses in, verified NC programs out.",
    epilog="Start with: [bold]tapelayer demo[/bold], or [bold]tapelayer export COURSES.txt -o PROGRAM.nc[/bold]",
)
output = Console()
notices = Console(stderr=True)
