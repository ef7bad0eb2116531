"""Parsing: a controller from the bytes of its table, or every fault of it with its line."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from post.controllers.table import AxisWord, Controller
from tapelayer.errors import ControllerRefused, InputFault
from tapelayer.motion.trajectory import Event
from tapelayer.toml_files import read_toml


def parse(data: bytes, path: str) -> Controller:
    """Controller from the bytes of its table; `path` names it, in messages and, without folder and ending, in programs.

    Raises:
        ControllerRefused: not TOML, unknown keys (with the nearest known one), or values that cannot be; all at once.
    """
    table, text = read_toml(data, path, ControllerRefused)
    if "name" in table:
        raise ControllerRefused(
            path, [InputFault(_line(text, ("name",)), "unknown key name; the file's name is the name")]
        )
    try:
        return Controller.model_validate({"name": Path(path).stem, **table})
    except ValidationError as error:
        faults = {fault for found in error.errors() for fault in _worded(text, found)}
        raise ControllerRefused(path, sorted(faults, key=lambda fault: (fault.line, fault.sentence))) from None


def _worded(text: str, found: ErrorDetails) -> list[InputFault]:
    """What validation found, in sentences of one fault each."""
    place = found["loc"]
    if not place:
        # The lint's own sentences begin with the place they speak of.
        sentences = found["msg"].removeprefix("Value error, ").splitlines()
        return [InputFault(_line(text, tuple(sentence.split(":")[0].split("."))), sentence) for sentence in sentences]
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    if found["type"] == "extra_forbidden" or place[-1] == "[key]":
        known = _known(place)
        key = str(place[-2] if place[-1] == "[key]" else place[-1])
        near = difflib.get_close_matches(key, known, 1, 0.4)
        sentence = f"unknown key {key}; " + (f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}")
    elif found["type"] == "missing":
        sentence = f"{where} is missing"
    else:
        message, shown = found["msg"], repr(found["input"])
        shown = shown if len(shown) <= 40 else shown[:37] + "..."
        sentence = f"{where}: {message[0].lower()}{message[1:]}, got {shown}"
    return [InputFault(_line(text, place), sentence)]


def _known(place: tuple[int | str, ...]) -> list[str]:
    """Keys that may stand where an unknown one was found."""
    if place[-1] == "[key]":
        return (
            [event.name.lower() for event in Event if event]
            if str(place[0]).startswith("events")
            else ["xy", "zx", "yz"]
        )
    model: Any = Controller
    for part in place[:-1]:
        if isinstance(part, str):
            annotation = model.model_fields[part].annotation
            model = AxisWord if part == "axes" else annotation
    return [name for name in model.model_fields if (name, model) != ("name", Controller)]


def _line(text: str, place: tuple[int | str, ...]) -> int:
    """Line (from 1) of a key in the table's text, or of what it stands in; 0 where neither has one."""
    parts = [str(part) for part in place if isinstance(part, str) and part != "[key]"]
    lines: dict[str, int] = {}
    section = ""
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\s*\[\s*([\w.]+)\s*\]", line):
            section = header[1] + "."
            lines.setdefault(header[1], number)
        elif key := re.match(r"\s*([\w-]+)\s*=", line):
            lines.setdefault(section + key[1], number)
    places = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((lines[place] for place in places if place in lines), 0)
