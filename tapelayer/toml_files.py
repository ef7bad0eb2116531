"""TOML files: tables from untrusted bytes, or the fault in them, and tables as text."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tapelayer.errors import InputFault, InputRefused
from tapelayer.text import plain_text

# Keys with many dots and numbers with very many digits exhaust the memory and time of a TOML parser.
MOST_BYTES = 1 << 18
LONGEST_LINE = 1000
# Lists of lists that are longer stand on several lines.
LONGEST_LIST = 100
KEY_OF_DOTS = re.compile(r"""(?:(?:[\w-]++|"(?:[^"\\]|\\.)*+"|'[^']*+')[ \t]*+\.[ \t]*+){17}""", re.ASCII)


def read_toml(data: bytes, name: str, refused: type[InputRefused]) -> tuple[dict[str, Any], str]:
    r"""Return the table of a TOML file, and its text.

    Args:
        data: the file's bytes.
        name: the file as the user named it.
        refused: error to raise with the file's faults.

    Raises:
        InputRefused: `refused`, where there are too many bytes, or they are not UTF-8 or not TOML.

    Examples:
        >>> read_toml(b"[tape]\nwidth_mm = 75.0", "job.toml", InputRefused)[0]
        {'tape': {'width_mm': 75.0}}
        >>> read_toml(b"[tape]\nwidth_mm = 75,0", "job.toml", InputRefused)
        Traceback (most recent call last):
            ...
        tapelayer.errors.InputRefused: job.toml:2:14: not TOML: ...
    """
    if len(data) > MOST_BYTES:
        raise refused(
            name, [InputFault(0, f"has {len(data)} bytes, expected at most {MOST_BYTES}; is it the right file?")]
        )
    try:
        text = plain_text(data, name, refused).decode()
    except UnicodeDecodeError as error:
        raise refused(name, [InputFault(0, f"byte {error.start} is not UTF-8; save the file as UTF-8")]) from None
    # Only LF ends a line of TOML.
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > LONGEST_LINE:
            sentence = f"the line has {len(line)} characters, expected at most {LONGEST_LINE}; break it"
            raise refused(name, [InputFault(number, sentence)])
        if KEY_OF_DOTS.search(line):
            raise refused(name, [InputFault(number, "the line has a name with more than 16 dots; use fewer")])
    try:
        return tomllib.loads(text), text
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        place = re.search(r"\(at line (\d+), column (\d+)\)", message)
        at = (int(place[1]), int(place[2])) if place else (0, 0)
        raise refused(name, [InputFault(at[0], f"not TOML: {message.split(' (at ')[0].lower()}", at[1])]) from None
    except RecursionError:
        raise refused(name, [InputFault(0, "tables or arrays are nested too deeply to be read")]) from None


def toml_text(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Return tables of keys and values as TOML that reads back the same; tables within them become dotted keys.

    Args:
        tables: of strings, numbers, booleans, lists of them, and tables by string.

    Examples:
        >>> print(toml_text({"machine": {"urdf": "gantry.urdf", "limits_mm": {"x": [0.0, 2500.0]}}}), end="")
        [machine]
        urdf = "gantry.urdf"
        limits_mm.x = [0.0, 2500.0]
    """
    blocks = ["".join([f"[{toml_key(name)}]\n", *_lines(table, "")]) for name, table in tables.items()]
    return "\n".join(blocks)


def _lines(table: Mapping[str, Any], prefix: str) -> Iterator[str]:
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from _lines(value, f"{prefix}{toml_key(key)}.")
        else:
            yield f"{prefix}{toml_key(key)} = {toml_value(value)}\n"


def toml_key(key: str) -> str:
    """Return a key as TOML, quoted where it must be.

    >>> toml_key("width_mm"), toml_key("a b")
    ('width_mm', '"a b"')
    """
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else toml_value(key)


def toml_value(value: object) -> str:
    """Return a string, number, boolean, list of them or empty table as TOML.

    >>> toml_value([0.0, 2500.0]), toml_value("a")
    ('[0.0, 2500.0]', '"a"')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON's escapes are TOML's, except that JSON does not escape this one control character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return toml_list([toml_value(item) for item in value])
    return "{}" if isinstance(value, Mapping) else repr(value)


def toml_list(items: Sequence[str]) -> str:
    """Return a list of values that are TOML already; a long list of lists with one a line.

    >>> toml_list(["[0.0]", "[1.0]"])
    '[[0.0], [1.0]]'
    """
    text = ", ".join(items)
    if len(text) <= LONGEST_LIST or not text.startswith("["):
        return f"[{text}]"
    lines = ",\n".join(items).replace("\n", "\n  ")
    return f"[\n  {lines},\n]"
