"""Submission: the checks of a request's form, and the folder that a worker then reads it from.

A request cannot name files of the server: the files that a setup names are built in, or were sent with the request.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, cast, get_args
from xml.etree.ElementTree import ParseError

import defusedxml.ElementTree
from defusedxml import DefusedXmlException

from post import controllers
from tapelayer.jobs.kinds import NAMES, KindName, kind_of, kinds
from tapelayer.machines.urdf_file import xml_text
from tapelayer.setups.forms import NAME, text_of
from tapelayer.setups.sections import parse_setup
from tapelayer.units import Unit
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.uploads import Form, Sort, invalid, shown

JOB_FIELDS: dict[str, Sort] = {
    "file": "file",
    "kind": "text",
    "setup": "text",
    "controller": "text",
    "unit": "text",
    "mould": "file",
    "parts": "files",
}
VERIFY_FIELDS: dict[str, Sort] = {
    "program": "file",
    "file": "file",
    "kind": "text",
    "setup": "text",
    "controller": "text",
    "unit": "text",
    "force": "text",
    "parts": "files",
}

LARGEST_URDF = 10 * 2**20


def job_request(form: Form, folder: Path) -> dict[str, Any]:
    """Return the request in a job's form, and prepare its folder for a worker.

    Args:
        form: with `JOB_FIELDS`.
        folder: with the form's files.

    Raises:
        Problem: a field is missing or wrong, or the setup names a file that was not sent.
        SetupRefused: the setup has faults.
    """
    request = _request(form, folder)
    _check_field("mould", "a mould", form.names, request["kind"])
    return {**request, "mould": form.names.get("mould", ""), "program_name": f"{Path(request['name']).stem}.nc"}


def verify_request(form: Form, folder: Path) -> dict[str, Any]:
    """Return the request in the form of a program to judge, and prepare its folder for a worker.

    Args:
        form: with `VERIFY_FIELDS`.
        folder: with the form's files.

    Raises:
        Problem: as `job_request`.
        SetupRefused: the setup has faults.
    """
    if "program" not in form.names:
        raise invalid("program: is missing; send the NC program as a file")
    force = _chosen(form, "force", ("true", "false"), "false") == "true"
    request = _request(form, folder)
    return {
        **request,
        "kind": "verify",
        "of": request["kind"],
        "program_name": form.names["program"],
        "force": force,
    }


def _request(form: Form, folder: Path) -> dict[str, Any]:
    """Return what both forms have in common, and put the source and the setup where the worker reads them."""
    if "file" not in form.names:
        raise invalid("file: is missing; send the course file or the STL as a file")
    kind = cast(KindName, _chosen(form, "kind", NAMES, ""))
    _check_field("unit", "a unit", form.texts, kind)
    unit = _chosen(form, "unit", get_args(Unit), "mm")
    _check_parts(form.files)
    setup = _setup(form, kind)
    (folder / NAME).write_text(setup, encoding="utf-8")
    (folder / "file").rename(folder / "source")
    return {
        "kind": kind,
        "name": form.names["file"],
        "setup_name": form.names.get("setup", NAME if setup else ""),
        "unit": unit,
        "parts": sorted(form.files),
    }


def _check_field(field: str, what: str, given: Collection[str], name: KindName) -> None:
    """Refuse a field that belongs to jobs of another kind."""
    if field in given and field not in kind_of(name).source.fields:
        owners = " or ".join(other for other in NAMES if field in kind_of(other).source.fields)
        raise invalid(
            f"{field}: {what} belongs to kind {owners}"
            f"{', course files are in mm' if field == 'unit' else ''}; leave it out"
        )


def _setup(form: Form, name: KindName) -> str:
    """Return the job's setup as TOML, with the form's controller put in and the name of a built-in machine left out."""
    kind = kind_of(name)
    data, file = bytes(form.texts.get("setup", b"")), form.names.get("setup", "setup")
    setup = parse_setup(data, file, kind.setup)
    if controller := form.text("controller", ""):
        setup = setup.with_values("output", controller=controller)
    _check_name("[output] controller", setup.output.controller, controllers.names(), form.files)
    built_in = {("machine", "urdf"): (kind.machine.name,)}
    for section, key in reversed(setup.FILES):
        value = getattr(getattr(setup, section), key)
        if value is not None:
            _check_name(f"[{section}] {key}", value, built_in.get((section, key), ()), form.files)
    if (urdf := setup.machine.urdf) is not None:
        if urdf in form.files:
            _check_urdf(form.files[urdf], urdf, form.files)
        else:
            setup = setup.with_values("machine", urdf=None)
    return text_of(setup)


def _check_parts(parts: Collection[str]) -> None:
    for name in parts:
        if name in (*controllers.names(), *(kind.machine.name for kind in kinds())):
            raise Problem("name-not-allowed", f"parts: {name} is the name of a built-in; rename the file")


def _check_name(place: str, name: str, built_in: Collection[str], parts: Collection[str]) -> None:
    if name not in built_in and name not in parts:
        allowed = ", ".join([*built_in, *sorted(parts)]) or "none"
        raise Problem(
            "name-not-allowed",
            f"{place}: {shown(name)} is neither built in nor a file sent along as one of parts; there are: {allowed}",
        )


def _check_urdf(path: Path, name: str, parts: Mapping[str, Path]) -> None:
    """Refuse XML with a document type or entities, and names of meshes that were not sent."""
    size = path.stat().st_size
    if size > LARGEST_URDF:
        raise Problem("upload-too-large", f"{name}: has {size} bytes, a URDF may have {LARGEST_URDF}")
    try:
        root = defusedxml.ElementTree.fromstring(xml_text(path.read_bytes()), forbid_dtd=True)
    except DefusedXmlException:
        sentence = f"{name}: declares a document type, entities or what lies elsewhere; send plain XML"
        raise Problem("xml-refused", sentence) from None
    except (ParseError, ValueError, LookupError) as error:
        raise Problem("xml-refused", f"{name}: is no XML: {error}") from None
    for element in root.iter():
        file = element.get("filename")
        if file is not None and file not in parts:
            raise Problem(
                "name-not-allowed",
                f"{name}: {element.tag} names {shown(file)}, which did not come along; send it as one of parts, "
                "or take it out",
            )


def _chosen(form: Form, name: str, choices: Collection[str], default: str) -> str:
    """Return the value of a field with a few choices; if the default is not among them, the field is required."""
    value = form.text(name, default)
    if value not in choices:
        given = f"got {shown(value)}" if name in form.texts else "it is missing"
        raise invalid(f"{name}: expected {' or '.join(choices)}, {given}")
    return value
