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
_ADVICE = {
    Form.PROGRAM: "tapelayer verify {file} COURSES.txt",
    Form.SETUP: "give it to export or spray by --setup {file}",
    Form.CONTROLLER: "tapelayer export COURSES.txt --controller {file}",
    Form.MACHINE: "name it in a setup: [machine] urdf = {quoted}",
    Form.POSES: "spray --trajectory writes it, and no command reads it",
    Form.STEP: "export the part as STL, then: tapelayer spray MODEL.stl",
    Form.MESH: "export the part as STL, then: tapelayer spray MODEL.stl",
    Form.ARCHIVE: "unpack it first",
}


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
    if content.form in (wanted.form, Form.UNKNOWN, Form.BINARY) and content.kind in (wanted.kind, None):
        return ""
    return f"this is {content.words}{_advice(content, wanted, file)}"


def check_order(program: str, source: str) -> None:
    """Refuse a program and its source in the wrong order.

    Raises:
        ProgramRefused: the source stands first.
    """
    first, second = content_at(program), content_at(source)
    if first.form in _MAKES and second.form is Form.PROGRAM:
        command = f"tapelayer verify {shlex.quote(source)} {shlex.quote(program)}"
        raise ProgramRefused(program, [InputFault(0, f"this is {first.words}; the program comes first: {command}")])


def _advice(content: Content, wanted: Content, file: str) -> str:
    """Return what to do with a file instead."""
    quoted = shlex.quote(file)
    if content.form in _MAKES:
        if wanted.form is Form.PROGRAM:
            return f"; the program comes first: tapelayer verify PROGRAM.nc {quoted}"
        return f": tapelayer {_MAKES[content.form][0]} {quoted}"
    if content.form is Form.SETUP and content.kind is not None:
        command, source = _MAKES[kind_of(content.kind).source.form]
        return f": tapelayer {command} {source} --setup {quoted}"
    if content.form in _ADVICE:
        return ": " + _ADVICE[content.form].format(file=quoted, quoted=f'"{file}"')
    return f"; expected {wanted.words}"
