"""Parsing: a controller from the bytes of its table, or all faults of the table with their lines."""

from __future__ import annotations

import difflib
import hashlib
import re
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from post.controllers.contradictions import contradictions
from post.controllers.table import EXPECTED, AxisWord, Controller
from tapelayer.errors import ControllerRefused, InputFault
from tapelayer.motion.trajectory import Event
from tapelayer.toml_files import read_toml

# What the file itself gives, and no key of it may.
GIVEN = {"name": "the file's name is the name", "sha256": "the file's bytes have one of their own"}


def parse(data: bytes, path: str) -> Controller:
    """Return the controller in the bytes of a table; messages name it by `path`, programs by the stem of `path`.

    Raises:
        ControllerRefused: not TOML, unknown keys (with the nearest known one), or impossible values; all at once.
    """
    table, text = read_toml(data, path, ControllerRefused)
    taken = [key for key in GIVEN if key in table]
    if taken:
        raise ControllerRefused(
            path, [InputFault(_line(text, (key,)), f"unknown key {key}; {GIVEN[key]}") for key in taken]
        )
    try:
        given = {"name": Path(path).stem, "sha256": hashlib.sha256(data).hexdigest()}
        controller = Controller.model_validate({**given, **table})
    except ValidationError as error:
        faults = {_worded(text, detail) for detail in error.errors()}
        raise ControllerRefused(path, sorted(faults, key=lambda fault: (fault.line, fault.sentence))) from None
    # The sentences begin with the place they refer to.
    sentences = dict.fromkeys(contradictions(controller))
    faults = {InputFault(_line(text, tuple(sentence.split(":")[0].split("."))), sentence) for sentence in sentences}
    if faults:
        raise ControllerRefused(path, sorted(faults, key=lambda fault: (fault.line, fault.sentence)))
    return controller


def _worded(text: str, detail: ErrorDetails) -> InputFault:
    """Return one validation error as a fault."""
    place = detail["loc"]
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    if detail["type"] == "extra_forbidden" or place[-1] == "[key]":
        known = _known(place)
        key = str(place[-2] if place[-1] == "[key]" else place[-1])
        near = difflib.get_close_matches(key, known, 1, 0.4)
        sentence = f"unknown key {key}; " + (f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}")
    elif detail["type"] == "missing":
        sentence = f"{where} is missing"
    else:
        message, shown = detail["msg"], repr(detail["input"])
        shown = shown if len(shown) <= 40 else shown[:37] + "..."
        if detail["type"] == "string_pattern_mismatch":
            sentence = f"{where}: expected {EXPECTED[detail['ctx']['pattern']]}, got {shown}"
        else:
            sentence = f"{where}: {message[0].lower()}{message[1:]}, got {shown}"
    return InputFault(_line(text, place), sentence)


def _known(place: tuple[int | str, ...]) -> list[str]:
    """Return the keys allowed in the place of an unknown one."""
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
    return [name for name in model.model_fields if model is not Controller or name not in GIVEN]


def _line(text: str, place: tuple[int | str, ...]) -> int:
    """Return the line (from 1) of a key in the table's text, or of what contains it; 0 where neither has one."""
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
