"""Submission: the checks of a request's form, and the folder that a worker then reads it from.

A request cannot name files of the server: the files that a setup names are built in, or were sent with the request.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast, get_args
from xml.etree.ElementTree import ParseError

import defusedxml.ElementTree
from defusedxml import DefusedXmlException

from post import controllers
from tapelayer.jobs.kind import JobKind, MachineKind
from tapelayer.jobs.kinds import MACHINE_NAMES, NAMES, KindName, kind_of, machine_kinds, suppliers
from tapelayer.machines.urdf_file import xml_text
from tapelayer.setups.forms import NAME, text_of
from tapelayer.setups.sections import JobSetup, Settings, parse_setup
from tapelayer.units import Unit
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.products import open_product, product_of
from tapelayer.workbench.store import SOURCE, Store
from tapelayer.workbench.uploads import Form, Sort, invalid, shown

JOB_FIELDS: dict[str, Sort] = {
    "file": "file",
    "from_job": "text",
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

# Fields that are some kinds' alone, and what they hold.
ALONE = {"unit": "a unit", "controller": "a controller", "mould": "a mould"}

LARGEST_URDF = 10 * 2**20


def job_request(form: Form, folder: Path, store: Store) -> dict[str, Any]:
    """Return the request in a job's form, and prepare its folder for a worker.

    Args:
        form: with `JOB_FIELDS`.
        folder: with the form's files.
        store: of the jobs whose product may be the source.

    Raises:
        Problem: a field is missing or wrong, the setup names a file that was not sent, or the product that is to be the
            source cannot be had.
        InputRefused: the setup has faults.
    """
    kind = kind_of(cast(KindName, chosen(form, "kind", NAMES, "")))
    for field, what in ALONE.items():
        _check_field(field, what, form, kind)
    taken = _take(form, folder, kind, store) if "from_job" in form.texts else {}
    request = _request(form, folder, kind, taken.get("name", ""))
    mould = {"mould": form.names.get("mould", "")}
    return {**request, **mould, **taken, "program_name": f"{Path(request['name']).stem}{kind.product.suffix}"}


def verify_request(form: Form, folder: Path) -> dict[str, Any]:
    """Return the request in the form of a program to judge, and prepare its folder for a worker.

    Args:
        form: with `VERIFY_FIELDS`.
        folder: with the form's files.

    Raises:
        Problem: a field is missing or wrong, or the setup names a file that was not sent.
        InputRefused: the setup has faults.
    """
    if "program" not in form.names:
        raise invalid("program: is missing; send the NC program as a file")
    force = chosen(form, "force", ("true", "false"), "false") == "true"
    kind = kind_of(cast(KindName, chosen(form, "kind", MACHINE_NAMES, "")))
    _check_field("unit", ALONE["unit"], form, kind)
    request = _request(form, folder, kind)
    return {
        **request,
        "kind": "verify",
        "of": request["kind"],
        "program_name": form.names["program"],
        "force": force,
    }


def _request(form: Form, folder: Path, kind: JobKind, taken: str = "") -> dict[str, Any]:
    """Return what both forms have in common, and put the source and the setup where the worker reads them.

    Args:
        form: of a job, or of a program to judge.
        folder: with the form's files.
        kind: of the job.
        taken: name of the source that is there already; empty where it is the form's file.
    """
    if not taken and "file" not in form.names:
        raise invalid("file: is missing; send the course file or the STL as a file")
    name = taken or form.names["file"]
    unit = chosen(form, "unit", get_args(Unit), "mm")
    _check_parts(form.files)
    setup = _setup(form, kind, name)
    text = text_of(setup)
    (folder / NAME).write_text(text, encoding="utf-8")
    if not taken:
        (folder / "file").rename(folder / SOURCE)
    if place := kind.source.settings.get("unit"):
        unit = getattr(getattr(setup, place.section), place.key)
    return {
        "kind": kind.name,
        "name": name,
        "setup_name": form.names.get("setup", NAME if text else ""),
        "unit": unit,
        "parts": sorted(form.files),
    }


def _take(form: Form, folder: Path, kind: JobKind, store: Store) -> dict[str, Any]:
    """Copy what another job made, and what it was made on, and return what the request says of them.

    Raises:
        Problem: there is no such job, its product is none of the kind's sources, is withheld or not there yet.
    """
    if "file" in form.names:
        raise invalid("from_job: names the source, and so does file; leave one of them out")
    record = store.get(form.text("from_job", ""))
    if record.kind not in suppliers(kind):
        raise invalid(f"from_job: what a job of kind {record.kind} makes is no source of kind {kind.name}; send a file")
    _copy(open_product(store, record), folder / SOURCE)
    taken = {"name": f"{Path(record.name).stem}{product_of(record).suffix}", "from_job": record.id}
    if "mould" in kind.fields and "mould" not in form.names:
        _copy(store.open(record.id, SOURCE), folder / "mould")
        taken |= {"mould": record.name, "mould_unit": record.request["unit"]}
    return taken


def _copy(file: BinaryIO, target: Path) -> None:
    """Copy an open file of a job, and close it."""
    try:
        with file, target.open("xb") as copy:
            shutil.copyfileobj(file, copy)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise Problem("target-not-writable", f"the source cannot be stored: {reason}") from None


def _check_field(field: str, what: str, form: Form, kind: JobKind) -> None:
    """Refuse a field that belongs to jobs of another kind."""
    if (field in form.texts or field in form.names) and field not in kind.fields:
        owners = " or ".join(other for other in NAMES if field in kind_of(other).fields)
        place = kind.source.settings.get(field)
        if place:
            raise invalid(f"{field}: {what} stands in the setup: [{place.section}] {place.key}; leave it out")
        raise invalid(
            f"{field}: {what} belongs to kind {owners}"
            f"{', course files are in mm' if field == 'unit' else ''}; leave it out"
        )


def _setup(form: Form, kind: JobKind, source: str) -> Settings:
    """Return the job's setup, with what the form says in place of its values."""
    data, file = bytes(form.texts.get("setup", b"")), form.names.get("setup", "setup")
    own = kind.source.settings.get("name")
    given = {(own.section, own.key): source} if own else {}
    setup = parse_setup(data, file, kind.setup, given)
    if isinstance(kind, MachineKind) and isinstance(setup, JobSetup):
        return _machine_setup(form, kind, setup)
    check_files(setup, {place: (name,) for place, name in given.items()}, form.files)
    return setup


def _machine_setup(form: Form, kind: MachineKind, setup: JobSetup) -> JobSetup:
    """Return a setup with the form's controller put in and the name of a built-in machine left out."""
    if controller := form.text("controller", ""):
        setup = setup.with_values("output", controller=controller)
    _check_name("[output] controller", setup.output.controller, controllers.names(), form.files)
    check_files(setup, {("machine", "urdf"): (kind.machine.name,)}, form.files)
    urdf = setup.machine.urdf
    if urdf is None:
        return setup
    if urdf not in form.files:
        return setup.with_values("machine", urdf=None)
    _check_urdf(form.files[urdf], urdf, form.files)
    return setup


def check_files(setup: Settings, built_in: Mapping[tuple[str, str], Collection[str]], parts: Collection[str]) -> None:
    """Refuse a setup that names a file which was not sent.

    Args:
        setup: of the request.
        built_in: names that are none of files, by section and key.
        parts: names of the files that were sent.

    Raises:
        Problem: it names the place in the setup, and what there is.
    """
    for (section, key), name in reversed(setup.files().items()):
        _check_name(f"[{section}] {key}", name, built_in.get((section, key), ()), parts)


def _check_parts(parts: Collection[str]) -> None:
    for name in parts:
        if name in (*controllers.names(), *(kind.machine.name for kind in machine_kinds())):
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


def chosen(form: Form, name: str, choices: Collection[str], default: str) -> str:
    """Return the value of a field with a few choices; if the default is not among them, the field is required."""
    value = form.text(name, default)
    if value not in choices:
        given = f"got {shown(value)}" if name in form.texts else "it is missing"
        raise invalid(f"{name}: expected {' or '.join(choices)}, {given}")
    return value
