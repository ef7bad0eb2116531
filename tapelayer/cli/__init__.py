"""The command line: it may import every package, and no package imports it."""

from __future__ import annotations

import sys

from tapelayer.cli import making, showing
from tapelayer.cli.application import app
from tapelayer.dispatch import run
from tapelayer.workbench import command

__all__ = ["app", "main", "making", "showing"]

app.command(epilog=command.EPILOG)(command.serve)


def main() -> None:
    """Run the command line."""
    run(app, sys.argv[1:], "tapelayer")
