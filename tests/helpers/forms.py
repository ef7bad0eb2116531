"""Multipart forms, byte by byte as a client may send them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

BOUNDARY = b"boundary"
FORM = f"multipart/form-data; boundary={BOUNDARY.decode()}"


class Part(NamedTuple):
    """A part of a form: a field, its bytes, and a file name where it is a file."""

    field: str
    data: bytes
    file: str | bytes | None = None


def body_of(parts: Sequence[Part]) -> bytes:
    """Body of a form."""
    return b"".join(map(_encoded, parts)) + b"--" + BOUNDARY + b"--\r\n"


def _encoded(part: Part) -> bytes:
    file = part.file.encode() if isinstance(part.file, str) else part.file
    name = b"" if file is None else b'; filename="' + file + b'"'
    head = b'Content-Disposition: form-data; name="' + part.field.encode() + b'"' + name
    return b"--" + BOUNDARY + b"\r\n" + head + b"\r\n\r\n" + part.data + b"\r\n"
