"""Entry point: picks the command to run, and turns its errors into a sentence and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

import typer

from tapelayer.errors import TapelayerError


def main() -> None:
    """Run the command line; `serve` skips the imports of the other commands."""
    import_module("tapelayer.workbench.command" if sys.argv[1:2] == ["serve"] else "tapelayer.cli").main()


def run(app: typer.Typer, arguments: Sequence[str], name: str) -> None:
    """Run an application, and turn each of our errors into a sentence on stderr and an exit code.

    Args:
        app: the application.
        arguments: those after its name.
        name: as the user typed it.
    """
    try:
        app(arguments, prog_name=name)
    except TapelayerError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.exit(1)
