"""Entry point: picks the command to run, and turns its errors into a sentence and an exit code."""

from __future__ import annotations

import codecs
import io
import locale
import os
import re
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING

from tapelayer.errors import TapelayerError, escaped, printable
from tapelayer.sentences import said

if TYPE_CHECKING:
    import typer

INTERRUPTED = 130


def main() -> None:
    """Run the command line; `serve` skips the imports of the other commands."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "0")
    if not re.fullmatch(r"\d{1,12}", epoch):
        # Libraries read it while they are imported, and end in a traceback.
        _say(
            f"SOURCE_DATE_EPOCH: expected whole seconds since 1970, got {epoch!r}; set it to such a number, or unset it"
        )
        sys.exit(2)
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
    _make_printable()
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


def _make_printable() -> None:
    """Let both streams take any text, in ASCII alone where the user's locale has no more.

    Python writes UTF-8 in the locale C, whose terminals may not show it.
    """
    codecs.register_error("readable", _readable)
    assumed = sys.flags.utf8_mode and not {"PYTHONUTF8", "PYTHONIOENCODING"} & os.environ.keys()
    named = next(filter(None, map(os.environ.get, ("LC_ALL", "LC_CTYPE", "LANG"))), "")
    # A locale that is not installed works as C, but its terminals show what its name says.
    shows_ascii = codecs.lookup(locale.getencoding()).name == "ascii" and not re.search(
        r"\.utf-?8\b", named, re.IGNORECASE
    )
    plain = assumed and shows_ascii
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="ascii" if plain else None, errors="readable")


def _readable(error: UnicodeError) -> tuple[str, int]:
    """Return characters that a stream cannot show as escapes, those of a file name that is no text as its bytes."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(escaped, error.object[error.start : error.end])), error.end


def _say(sentence: str) -> None:
    """Write a sentence, or several with a line each, to stderr in the user's language, if anyone can read it there."""
    with suppress(OSError):
        sys.stderr.write("".join(f"{printable(line)}\n" for line in said(sentence).split("\n")))


def _discard_stdout() -> None:
    """Lead stdout to nowhere, so that what it still holds raises nothing when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
