"""The command line: it may import every package, and no package imports it."""

from __future__ import annotations

import sys

from tapelayer.cli import comparing, demonstrating, making, planning, showing
from tapelayer.cli.application import app, command
from tapelayer.dispatch import run
from tapelayer.workbench.command import EPILOG, serve

__all__ = ["app", "comparing", "demonstrating", "main", "making", "planning", "showing"]

command(epilog=EPILOG)(serve)


def main() -> None:
    """Run the command line."""
    run(app, sys.argv[1:], "tapelayer")
