"""TOML: tables from bytes that anybody may have written, or the fault that they have."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from tapelayer.errors import Fault, InputRefused

# A key of very many dots, or a number of very many digits, takes a parser of TOML more memory and time than there is.
MOST_BYTES = 1 << 18
LONGEST_LINE = 1000


def read_toml(data: bytes, name: str, refused: type[InputRefused]) -> tuple[dict[str, Any], str]:
    """Table of a TOML file, and its text.

    Args:
        data: the file's bytes, with a byte order mark or without.
        name: the file as the user named it.
        refused: what is raised of the file's faults.

    Raises:
        InputRefused: `refused`, where the bytes are too many, no UTF-8 or no TOML.
    """
    if len(data) > MOST_BYTES:
        raise refused(name, [Fault(0, f"has {len(data)} bytes, expected at most {MOST_BYTES}; is it the right file?")])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refused(name, [Fault(0, f"byte {error.start} is not UTF-8; save the file as UTF-8")]) from None
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > LONGEST_LINE:
            sentence = f"the line has {len(line)} characters, expected at most {LONGEST_LINE}; break it"
            raise refused(name, [Fault(number, sentence)])
    try:
        return tomllib.loads(text), text
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        place = re.search(r"\(at line (\d+), column (\d+)\)", message)
        at = (int(place[1]), int(place[2])) if place else (0, 0)
        raise refused(name, [Fault(at[0], f"not TOML: {message.split(' (at ')[0].lower()}", at[1])]) from None
    except RecursionError:
        raise refused(name, [Fault(0, "tables or arrays are nested too deeply to be read")]) from None
