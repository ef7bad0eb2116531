"""Entry point: picks the command to run, and turns its errors into a sentence and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING

from tapelayer.errors import TapelayerError
from tapelayer.sentences import said

if TYPE_CHECKING:
    import typer

INTERRUPTED = 130


def main() -> None:
    """Run the command line; `serve` skips the imports of the other commands."""
    # An interrupt within an import may end in any error, or in none.
    signal.signal(signal.SIGINT, _leave)
    command = import_module("tapelayer.workbench.command" if sys.argv[1:2] == ["serve"] else "tapelayer.cli")
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        command.main()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    finally:
        signal.signal(signal.SIGINT, _leave)


def _leave(*_: object) -> None:
    """End at once: nothing has been begun, or all is done."""
    os._exit(INTERRUPTED)


def run(app: typer.Typer, arguments: Sequence[str], name: str) -> None:
    """Run an application, and turn each of our errors into a sentence on stderr and an exit code.

    Args:
        app: the application.
        arguments: those after its name.
        name: as the user typed it.
    """
    try:
        try:
            app(arguments, prog_name=name)
        finally:
            sys.stdout.flush()
    except TapelayerError as error:
        _say(str(error))
        sys.exit(error.exit_code)
    except BrokenPipeError:
        _discard_stdout()
        sys.exit(1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        _say(f"{error.filename or 'the output'}: cannot be read or written: {reason}")
        _discard_stdout()
        sys.exit(2)


def _say(sentence: str) -> None:
    """Write a sentence to stderr in the user's language, if anyone can read it there."""
    with suppress(OSError):
        sys.stderr.write(f"{said(sentence)}\n")


def _discard_stdout() -> None:
    """Lead stdout to nowhere, so that what it still holds raises nothing when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
