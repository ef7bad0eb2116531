"""Entry point: finds the command that is wanted, and ends it with a sentence and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

import typer

from tapelayer.errors import TapelayerError


def main() -> None:
    """Run the command line; `serve` does not wait for what the other commands import."""
    import_module("tapelayer.workbench.command" if sys.argv[1:2] == ["serve"] else "tapelayer.cli").main()


def run(app: typer.Typer, arguments: Sequence[str], name: str) -> None:
    """Run an application: every error of ours becomes its sentence on stderr and its exit code.

    Args:
        app: the application.
        arguments: behind its name.
        name: as the user typed it.
    """
    try:
        app(arguments, prog_name=name)
    except TapelayerError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.exit(1)
