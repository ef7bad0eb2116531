"""Misfits: files that are something else than what a command was to be given, and the command that fits."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager

from tapelayer.errors import InputFault, InputRefused, ProgramRefused
from tapelayer.jobs.contents import Content, content_of_file
from tapelayer.jobs.kind import Form
from tapelayer.jobs.kinds import kind_of

# The command that makes programs from a form of source, and a source of that form as its help names it.
_MAKES = {Form.COURSES: ("export", "COURSES.txt"), Form.MODEL: ("spray", "MODEL.stl")}


def content_at(file: str) -> Content:
    """Return what a file is; one that cannot be read is of no known form."""
    try:
        return content_of_file(file)
    except OSError:
        return Content(Form.UNKNOWN)


@contextmanager
def expecting(file: str | None, wanted: Content) -> Iterator[None]:
    """Say what a refused file is, and the command that fits, where it is something else than what was wanted.

    Args:
        file: as the user named it; None where there is none.
        wanted: what the file should be.
    """
    try:
        yield
    except InputRefused as error:
        if error.name == file and (sentence := _misfit(file, wanted)):
            raise type(error)(file, [InputFault(0, sentence)]) from None
        raise


def check_form(file: str, wanted: Content) -> None:
    """Refuse a file that is known to be something else than what was wanted.

    Raises:
        InputRefused: it says what it is, and the command that fits.
    """
    if sentence := _misfit(file, wanted):
        raise InputRefused(file, [InputFault(0, sentence)])


def _misfit(file: str, wanted: Content) -> str:
    """Return what a file is and the command that fits; empty where nothing else is known than what was wanted."""
    content = content_at(file)
    if content.form.read_as in (wanted.form, Form.UNKNOWN, Form.BINARY) and content.kind in (wanted.kind, None):
        return ""
    if wanted.form is Form.SETUP and wanted.kind is not None:
        kind = kind_of(wanted.kind)
        if kind.source.form is content.form.read_as and (place := kind.source.settings.get("name")):
            return f'this is {content.words}: name it in {kind.setup_name}: [{place.section}] {place.key} = "{file}"'
    if content.form.read_as in _MAKES and wanted.form is Form.PROGRAM:
        return _first_the_program(content, f"tapelayer verify PROGRAM.nc {shlex.quote(file)}")
    advice = _advice(content, file)
    return f"this is {content.words}: {advice}" if advice else f"this is {content.words}; expected {wanted.words}"


def check_order(program: str, source: str) -> None:
    """Refuse a program and its source in the wrong order.

    Raises:
        ProgramRefused: the source stands first.
    """
    first, second = content_at(program), content_at(source)
    if first.form.read_as in _MAKES and second.form is Form.PROGRAM:
        command = f"tapelayer verify {shlex.quote(source)} {shlex.quote(program)}"
        raise ProgramRefused(program, [InputFault(0, _first_the_program(first, command))])


def _first_the_program(content: Content, command: str) -> str:
    return f"this is {content.words}; the program comes first: {command}"


def _advice(content: Content, file: str) -> str:
    """Return what to do with a file; empty where no command takes it."""
    quoted = shlex.quote(file)
    if content.form is Form.SETUP and content.kind is not None:
        return kind_of(content.kind).command.format(quoted)
    match form := content.form.read_as:
        case Form.COURSES | Form.MODEL:
            return f"tapelayer {_MAKES[form][0]} {quoted}"
        case Form.PROGRAM:
            return f"tapelayer verify {quoted} COURSES.txt"
        case Form.SETUP:
            return f"give it to export or spray by --setup {quoted}"
        case Form.CONTROLLER:
            return f"tapelayer export COURSES.txt --controller {quoted}"
        case Form.MACHINE:
            return f'name it in a setup: [machine] urdf = "{file}"'
        case Form.BOUNDARY | Form.DXF:
            return f'name it in a ply file: [ply] boundary = "{file}"'
        case Form.POSES:
            return "spray --trajectory writes it, and no command reads it"
        case Form.MESH:
            return "export the part as STL, then: tapelayer spray MODEL.stl"
        case Form.ARCHIVE:
            return "unpack it first"
    return ""
