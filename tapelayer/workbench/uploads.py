"""Uploads: multipart forms, written to a folder part by part while they arrive."""

from __future__ import annotations

import email.errors
import email.header
import re
import unicodedata
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request

from tapelayer.workbench.problems import Problem

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

# text: a value, kept in memory. file: one file. files: any number of files with distinct plain names.
Sort = Literal["text", "file", "files"]

MOST_PARTS = 100
LONGEST_TEXT = 1 << 20
LONGEST_NAME = 200
# Control and format characters, surrogates, line and paragraph separators.
HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")
PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True)
class Form:
    """Contents of a form.

    Attributes:
        texts: values by field.
        names: display names of files by field, including texts sent as a file.
        files: paths of the files in a field of sort `files`, by their plain names.
    """

    texts: dict[str, bytearray] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)

    def text(self, name: str, default: str) -> str:
        """Return a field's value, or the default if the form does not have the field.

        Raises:
            Problem: it is no UTF-8.
        """
        try:
            return self.texts[name].decode() if name in self.texts else default
        except UnicodeDecodeError:
            raise invalid(f"{name}: is not UTF-8; send it as UTF-8") from None


async def receive(request: Request, folder: Path, fields: Mapping[str, Sort]) -> Form:
    """Receive the form of a request; write a single file to FOLDER/field, files with plain names to FOLDER/field/name.

    Args:
        request: with the form as its body, not read yet.
        folder: an empty folder.
        fields: sort of each allowed field.

    Raises:
        Problem: the body is no form or exceeds a limit, a name is not allowed, or the disk is full.
    """
    kind, options = parse_options_header(request.headers.get("content-type"))
    if kind != b"multipart/form-data" or b"boundary" not in options:
        raise Problem("unsupported-media-type", "send the request as multipart/form-data")
    with ExitStack() as files:
        parts = _Parts(folder, fields, files)
        try:
            parser = MultipartParser(options[b"boundary"], parts.callbacks())
            async for chunk in request.stream():
                # The callbacks write to disk.
                await run_in_threadpool(parser.write, chunk)
        except FormParserError as error:
            raise invalid(f"the body is no multipart form: {error}") from None
        except ClientDisconnect:
            raise invalid("the body ended before the form did") from None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise Problem("target-not-writable", f"the upload cannot be stored: {reason}") from None
        if not parts.ended:
            raise invalid("the body ended before the form did")
    return parts.form


class _Parts:
    """Callbacks of the parser, which build the form.

    Args:
        folder: destination of files.
        fields: sort of each allowed field.
        files: closes the files.
    """

    def __init__(self, folder: Path, fields: Mapping[str, Sort], files: ExitStack) -> None:
        self.form = Form()
        self.ended = False
        self._folder, self._fields, self._files = folder, fields, files
        self._count = 0
        self._header = self._value = self._disposition = b""
        self._field = ""
        self._target: BinaryIO | None = None

    def callbacks(self) -> MultipartCallbacks:
        """Return the callbacks by the parser's names for them."""
        return {
            "on_part_begin": self._begin,
            "on_header_field": self._on_header,
            "on_header_value": self._on_value,
            "on_header_end": self._end_header,
            "on_headers_finished": self._open,
            "on_part_data": self._on_data,
            "on_part_end": self._close,
            "on_end": self._end,
        }

    def _begin(self) -> None:
        self._count += 1
        if self._count > MOST_PARTS:
            raise invalid(f"the form has more than {MOST_PARTS} parts; send fewer")
        self._disposition = b""

    def _on_header(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end]

    def _on_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _end_header(self) -> None:
        if self._header.lower() == b"content-disposition":
            self._disposition = self._value
        self._header = self._value = b""

    def _open(self) -> None:
        """Begin a part once its headers are known."""
        _, options = parse_options_header(self._disposition)
        name = self._field = options.get(b"name", b"").decode("utf-8", "replace")
        file = options.get(b"filename")
        if name not in self._fields:
            raise invalid(f"the form has no field {shown(name)}; there are {', '.join(self._fields)}")
        if self._fields[name] == "files":
            if file is None:
                raise invalid(f"{name}: is no file; send it with a file name")
            self._target = self._part(file)
            return
        if name in self.form.texts or name in self.form.names:
            raise invalid(f"{name}: is there twice; send it once")
        if file is not None:
            self.form.names[name] = display_name(file)
        if self._fields[name] == "text":
            self.form.texts[name] = bytearray()
        elif file is None:
            raise invalid(f"{name}: is no file; send it with a file name")
        else:
            self._target = self._files.enter_context((self._folder / name).open("xb"))

    def _part(self, file: bytes) -> BinaryIO:
        """Open the target of a file with a plain name."""
        name = file.decode("utf-8", "replace")
        if not PLAIN_NAME.fullmatch(name):
            raise Problem(
                "name-not-allowed",
                f"{self._field}: {shown(name)} is no plain file name; use letters, digits, points, _ and -, "
                "at most 100, the first a letter or digit",
            )
        path = self._folder / self._field / name
        # Names that differ only in case are the same file on some file systems.
        if name.lower() in map(str.lower, self.form.files):
            raise invalid(f"{self._field}: there are two files {name}; give each a name of its own")
        path.parent.mkdir(exist_ok=True)
        self.form.files[name] = path
        return self._files.enter_context(path.open("xb"))

    def _on_data(self, data: bytes, start: int, end: int) -> None:
        if self._target is not None:
            self._target.write(data[start:end])
            return
        if len(self.form.texts[self._field]) + end - start > LONGEST_TEXT:
            raise Problem("upload-too-large", f"{self._field}: has more than {LONGEST_TEXT} bytes")
        self.form.texts[self._field] += data[start:end]

    def _close(self) -> None:
        if self._target is not None:
            self._target.close()
            self._target = None

    def _end(self) -> None:
        self.ended = True


def display_name(file: bytes) -> str:
    """Return the name of an uploaded file for people: the last part of the sent name, never a path.

    Raises:
        Problem: it is no UTF-8, empty or too long, or has control characters.
    """
    try:
        name = file.decode()
        # .NET sends non-ASCII names as encoded words (RFC 2047).
        if name.startswith("=?"):
            name = str(email.header.make_header(email.header.decode_header(name)))
    except (UnicodeError, LookupError, email.errors.MessageError):
        raise Problem("name-not-allowed", "a file's name is not UTF-8; send it as UTF-8") from None
    name = re.split(r"[/\\]", name)[-1].strip()
    if name in ("", ".", ".."):
        raise Problem("name-not-allowed", "a file has no name; send it with its name")
    if len(name) > LONGEST_NAME:
        raise Problem("name-not-allowed", f"a file's name has more than {LONGEST_NAME} characters; rename it")
    if any(unicodedata.category(character) in HIDDEN for character in name):
        raise Problem("name-not-allowed", f"the file name {shown(name)} has characters that cannot be shown; rename it")
    return name


def shown(text: str) -> str:
    """Return untrusted text quoted and shortened for a message."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def invalid(sentence: str) -> Problem:
    """Return the problem for an invalid form."""
    return Problem("invalid-request", sentence)
