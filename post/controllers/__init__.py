"""Controllers: every letter, code and rule of a control is in a TOML table, and none in the code."""

from __future__ import annotations

import difflib
import re
from functools import cache
from importlib import resources
from pathlib import Path

from post.controllers.parsing import parse
from post.controllers.table import Controller
from tapelayer.errors import ControllerRefused, InputFault

__all__ = ["Controller", "load", "names"]


@cache
def names() -> tuple[str, ...]:
    """Return the names of the built-in controllers."""
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def load(name_or_path: str) -> Controller:
    """Load a built-in controller by name, or a user's table by the path of its TOML file.

    Raises:
        ControllerRefused: there is no such table, or it has faults; all of them at once.
    """
    if name_or_path in names():
        return _built_in(name_or_path)
    if not re.search(r"\.toml$|[/\\]", name_or_path):
        near = difflib.get_close_matches(name_or_path, names(), 1, 0.7)
        meant = f"did you mean {near[0]}? " if near else ""
        advice = f"{meant}there are {', '.join(names())}; a table of your own is named by its path, ending in .toml"
        sentence = f"is not a built-in controller; {advice}"
        raise ControllerRefused(name_or_path, [InputFault(0, sentence)])
    try:
        data = Path(name_or_path).read_bytes()
    except OSError as error:
        raise ControllerRefused.unreadable(name_or_path, error) from None
    return parse(data, name_or_path)


@cache
def _built_in(name: str) -> Controller:
    """Return a built-in controller, whose table does not change at run time."""
    return parse(resources.files(__name__).joinpath(f"{name}.toml").read_bytes(), f"{name}.toml")
