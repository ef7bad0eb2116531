"""Contents: what a file is, by its bytes and never by its name; the command line and the server ask here."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from post.controllers.table import Controller
from tapelayer.geometry.brep import is_iges, is_step
from tapelayer.geometry.stl import HEADER_BYTES, RECORD
from tapelayer.jobs.kind import Form
from tapelayer.jobs.kinds import MACHINE_NAMES, NAMES, KindName, MachineKindName, kind_of
from tapelayer.setups.sections import Settings
from tapelayer.text import beginning

# As much as tells what a file is.
HEAD_BYTES = 1 << 16
# Numbers of a facet that are none of these are not numbers of a facet.
LARGEST, SMALLEST, LONGEST_NORMAL = 1e9, 1e-30, 1.01

_BINARY = re.compile(r"[\x00-\x08\x0e-\x19]")
_SECTION = re.compile(r"[ \t]*\[{1,2}[ \t]*([\w-]+)([\w.\t -]*)\]")
_KEY = re.compile(r"""[ \t]*["']?([\w-]+)["']?[ \t]*[.=]""")
_START = re.compile(r"^\s*\d+[ \t]*\n\s*start\b", re.IGNORECASE)
_FACET = re.compile(r"\A\s*solid\b.*?^\s*(?:facet\s+normal|endsolid)\b", re.IGNORECASE | re.MULTILINE | re.DOTALL)
_ROBOT = re.compile(r"^\s*<robot\b", re.MULTILINE)
_BLOCK = re.compile(
    r"^[ \t]*/?[ \t]*(?:N\d+[ \t]*)?(?:[GMFST]\d|[A-Z]\d?[ \t]*=?[ \t]*[-+]?(?:\d+\.?\d*|\.\d+)[ \t]*(?=[A-Z(;\n]))",
    re.IGNORECASE | re.MULTILINE,
)
_PERCENT = re.compile(r"\A\s*%[ \t\w]*\n")


@dataclass(frozen=True)
class Content:
    """What a file is.

    Attributes:
        form: its form.
        kind: kind of job that a source or a setup is for; None where it fits every kind, or no job.
    """

    form: Form
    kind: KindName | None = None

    @property
    def words(self) -> str:
        """Return its name in a sentence.

        >>> Content(Form.SETUP, "spray").words
        'a spraying setup'
        """
        if self.form is not Form.SETUP or self.kind is None:
            return self.form.value
        return kind_of(self.kind).setup_name


# Beginnings that no text of ours has.
_SIGNATURES = (
    (b"PK\x03\x04", Form.ARCHIVE),
    (b"\x1f\x8b", Form.ARCHIVE),
    (b"7z\xbc\xaf", Form.ARCHIVE),
    (b"%PDF-", Form.DOCUMENT),
    (b"\xd0\xcf\x11\xe0", Form.DOCUMENT),
    (b"\x89PNG", Form.PICTURE),
    (b"\xff\xd8\xff", Form.PICTURE),
    (b"GIF8", Form.PICTURE),
    (b"ply\n", Form.MESH),
    (b"ply\r", Form.MESH),
    (b"glTF", Form.MESH),
)
_TEXTS = (
    (re.compile(r"\A(?:[ \t]*(?:#[^\n]*)?\n)*(?:mtllib |[og] [A-Za-z_]|v +[-+.\d])"), Form.MESH),
    (re.compile(r"\A\s*OFF\b"), Form.MESH),
    (re.compile(r"\A\s*(?:<!doctype html|<html)\b", re.IGNORECASE), Form.PAGE),
    (re.compile(r'\A\s*\{\s*"'), Form.JSON),
    (re.compile(r"\A# tapelayer [^\n]*\n(?:#[^\n]*\n)*# columns: x y z theta phi", re.IGNORECASE), Form.POSES),
)


def content_of(data: bytes, size: int | None = None) -> Content:
    r"""Return what a file is.

    Args:
        data: the file's bytes, or the first `HEAD_BYTES` of them.
        size: number of the file's bytes; that of `data` unless given.

    Examples:
        >>> content_of(b"1\nstart\n45\n0 0 0 0 0 1 0\n").form.value
        'a course file'
        >>> content_of(b"[footprint]\nrate_mm3_per_s = 100\n")
        Content(form=<Form.SETUP: 'a setup'>, kind='spray')
        >>> content_of(b"%\nN10 G90\n").form.value
        'an NC program'
    """
    text = _text(data[:HEAD_BYTES])
    if text is None and _is_binary_stl(data, len(data) if size is None else size):
        return source_of(Form.MODEL)
    for knows, form in ((is_step, Form.STEP), (is_iges, Form.IGES)):
        if knows(data):
            return source_of(form)
    for signature, form in _SIGNATURES:
        if data.startswith(signature):
            return Content(form)
    if text is None:
        return Content(_further(data) or Form.BINARY)
    for pattern, form in _TEXTS:
        if pattern.search(text):
            return Content(form)
    if _FACET.search(text):
        return source_of(Form.MODEL)
    if _ROBOT.search(text):
        return Content(Form.MACHINE)
    bare = re.sub(r"#[^\n]*", "", text)
    if _START.search(bare):
        return source_of(Form.COURSES)
    if further := _further(text.encode()):
        return Content(further)
    return _table(text) or Content(Form.PROGRAM if _is_program(text) else Form.UNKNOWN)


def content_of_file(path: Path | str) -> Content:
    """Return what a file is.

    Raises:
        OSError: it cannot be read.
    """
    with open(path, "rb") as file:
        return content_of(file.read(HEAD_BYTES), os.fstat(file.fileno()).st_size)


def kind_of_source(content: Content) -> MachineKindName:
    """Return the kind that makes programs from a source, or that says best why it can make none."""
    likely = Form.MODEL if content.form is Form.BINARY else Form.COURSES
    return _maker(content.form) or _maker(likely) or MACHINE_NAMES[0]


def source_of(form: Form) -> Content:
    """Return the content of a file that programs are made from, with the kind that makes them."""
    return Content(form, _maker(form))


def _maker(form: Form) -> MachineKindName | None:
    """Return the kind that makes programs from files of a form; None where none does."""
    return next((name for name in MACHINE_NAMES if kind_of(name).source.form is form.read_as), None)


def _further(data: bytes) -> Form | None:
    """Return the form of a file that a setup of some kind may name; None where no kind knows it."""
    known = (item for name in NAMES for item in kind_of(name).further.items())
    return next((form for form, knows in known if knows(data)), None)


def _is_binary_stl(data: bytes, size: int) -> bool:
    """Return whether a file is binary and begins with a facet, or has as many bytes as its count of facets says."""
    first = HEADER_BYTES + 4
    if len(data) < first + RECORD.itemsize or b"\0" not in data[:1024]:
        return False
    count = int.from_bytes(data[HEADER_BYTES:first], "little")
    if size == first + RECORD.itemsize * count:
        return True
    numbers = np.frombuffer(data, dtype="<f4", count=12, offset=first).astype(np.float64)
    sized = (np.abs(numbers) < LARGEST) & ((numbers == 0) | (np.abs(numbers) > SMALLEST))
    return bool(count and np.all(sized) and np.linalg.norm(numbers[:3]) < LONGEST_NORMAL)


def _text(data: bytes) -> str | None:
    """Return text with lines ended by LF; None where the bytes are no text."""
    text = beginning(data)
    return None if _BINARY.search(text.rstrip("\x1a")) else text


def _table(text: str) -> Content | None:
    """Return the kind of TOML table in a text: the one that knows most of its keys; None where none knows any."""
    keys = list(_keys(text))
    known = {Content(Form.CONTROLLER): _controller_keys()}
    for name in NAMES:
        setup = kind_of(name).setup
        needed = {(section, "") for section, field in setup.model_fields.items() if field.is_required()}
        # Other setups may have sections of the same names beside those that this one cannot be without.
        if not needed or needed & set(keys):
            known[Content(Form.SETUP, name)] = _keys_of(setup)
    scores = {content: sum(key in own for key in keys) for content, own in known.items()}
    most = max(scores.values())
    best = [content for content, score in scores.items() if score == most]
    if not most or 2 * most < len(keys):
        return None
    # A file that has nothing but keys of several is a setup.
    return best[0] if len(best) == 1 else Content(Form.SETUP)


def _keys(text: str) -> Iterator[tuple[str, str]]:
    """Yield section and key of every line that sets a value, and each section with an empty key."""
    section = ""
    for line in text.split("\n"):
        if header := _SECTION.match(line):
            section = header[1]
            yield section, ""
        elif key := _KEY.match(line):
            yield section, key[1]


def _keys_of(model: type[Settings]) -> set[tuple[str, str]]:
    return {(section, key) for section, field in model.model_fields.items() for key in ("", *_inner(field.annotation))}


def _controller_keys() -> set[tuple[str, str]]:
    keys = {("", name) for name in Controller.model_fields}
    for section, field in Controller.model_fields.items():
        keys |= {(section, key) for key in ("", *_inner(field.annotation))}
    return keys


def _inner(annotation: object) -> Iterator[str]:
    """Yield the keys of a table of this type."""
    if isinstance(annotation, str):
        yield annotation
    yield from getattr(annotation, "model_fields", ())
    for argument in get_args(annotation):
        yield from _inner(argument)


def _is_program(text: str) -> bool:
    """Return whether most lines outside comments begin as a block of a program."""
    if _PERCENT.match(text):
        return True
    plain = re.sub(r"\([^)\n]*\)|;[^\n]*", "", text)
    lines = [line for line in plain.split("\n")[:200] if line.strip(" \t%")]
    return 2 * sum(_BLOCK.match(f"{line}\n") is not None for line in lines) > len(lines)
