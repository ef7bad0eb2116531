"""Submissions: what a worker gets of a form, and what is refused before there is a job."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tapelayer.errors import SetupRefused
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.settings import SpraySetup
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.store import Store
from tapelayer.workbench.submission import LARGEST_URDF, job_request, verify_request
from tapelayer.workbench.uploads import Form
from urdf import TAPELAYER

URDF = TAPELAYER.read_bytes()
MESHED = b'<robot><link name="a"><visual><geometry><mesh filename="%b"/></geometry></visual></link></robot>'
LAUGHS = b'<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
OUTSIDE = b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="&a;"/>'


def form_of(folder: Path, texts: Mapping[str, str], parts: Mapping[str, bytes], **names: str) -> Form:
    """Form whose files are in a folder already."""
    (folder / "parts").mkdir()
    for name in names:
        (folder / name).write_bytes(b"data")
    for name, data in parts.items():
        (folder / "parts" / name).write_bytes(data)
    return Form(
        {name: bytearray(text.encode()) for name, text in texts.items()},
        dict(names),
        {name: folder / "parts" / name for name in parts},
    )


def asked(folder: Path, parts: Mapping[str, bytes] | None = None, /, **texts: str) -> dict[str, Any]:
    return requested(form_of(folder, texts, parts or {}, file="铺层.txt"), folder)


def requested(form: Form, folder: Path) -> dict[str, Any]:
    """What a worker gets of a form, where there are no other jobs."""
    store = Store(folder / "work")
    try:
        return job_request(form, folder, store)
    finally:
        store.close()


def test_a_worker_finds_its_folder_as_it_expects_it(tmp_path: Path) -> None:
    request = asked(tmp_path, {"mine.toml": b"", "gun.txt": b""}, kind="spray", unit="in", controller="mine.toml")
    assert request == {
        "kind": "spray",
        "name": "铺层.txt",
        "setup_name": "setup.toml",
        "unit": "in",
        "parts": ["gun.txt", "mine.toml"],
        "mould": "",
        "program_name": "铺层.nc",
    }
    assert (tmp_path / "source").read_bytes() == b"data"
    setup = parse_setup((tmp_path / "setup.toml").read_bytes(), "setup.toml", SpraySetup)
    assert setup == SpraySetup().with_values("output", controller="mine.toml")


def test_the_setup_says_what_was_set_and_no_more(tmp_path: Path) -> None:
    """Some limits are judged only where the setup itself sets them, so what is default stays unsaid."""
    text = '[machine]\nurdf = "tapelayer"\nlimits_mm = {x = [0, 2500]}\n[verification]\nmax_roller_tilt_deg = 0.05\n'
    asked(tmp_path, kind="lay", setup=text)
    written = (tmp_path / "setup.toml").read_bytes()
    setup = parse_setup(written, "setup.toml", Setup)
    assert setup.model_dump(exclude_unset=True) == {
        "machine": {"limits_mm": {"x": [0.0, 2500.0]}},
        "verification": {"max_roller_tilt_deg": 0.05},
    }
    assert setup.sha256(URDF) == parse_setup(text.encode(), "a.toml", Setup).sha256(URDF)


def test_a_setup_names_what_came_along(tmp_path: Path) -> None:
    parts = {"mine.urdf": MESHED % b"link.stl", "link.stl": b"", "mine.toml": b""}
    asked(tmp_path, parts, kind="lay", setup='[machine]\nurdf = "mine.urdf"\n[output]\ncontroller = "mine.toml"\n')
    setup = parse_setup((tmp_path / "setup.toml").read_bytes(), "setup.toml", Setup)
    assert (setup.machine.urdf, setup.output.controller) == ("mine.urdf", "mine.toml")


def test_what_is_judged(tmp_path: Path) -> None:
    form = form_of(tmp_path, {"kind": "lay", "force": "true"}, {}, file="a.txt", program="b.nc")
    request = verify_request(form, tmp_path)
    assert request == {
        "kind": "verify",
        "of": "lay",
        "name": "a.txt",
        "setup_name": "",
        "unit": "mm",
        "parts": [],
        "program_name": "b.nc",
        "force": True,
    }
    assert (tmp_path / "program").is_file() and (tmp_path / "source").is_file()


@pytest.mark.parametrize(
    "name", ["mine.urdf", "../mine.urdf", "/etc/passwd", "sprayer", "http://x/a.urdf", "package://a/b.urdf", "."]
)
@pytest.mark.parametrize(
    ("kind", "section", "key"),
    [
        ("lay", "machine", "urdf"),
        ("spray", "output", "controller"),
        ("spray", "footprint", "profile"),
    ],
)
def test_a_setup_names_no_file_of_the_server(tmp_path: Path, kind: str, section: str, key: str, name: str) -> None:
    text = f'[{section}]\n{key} = "{name}"\n' + ('model = "profile"\n' if section == "footprint" else "")
    with pytest.raises(Problem) as problem:
        asked(tmp_path, {"other.urdf": URDF}, kind=kind, setup=text)
    assert problem.value.code == "name-not-allowed"
    assert problem.value.detail.startswith(f"[{section}] {key}: '")
    assert " is neither built in nor a file sent along as one of parts; there are: " in problem.value.detail
    assert problem.value.detail.endswith("other.urdf")


@pytest.mark.parametrize(
    ("data", "code", "sentence"),
    [
        (LAUGHS, "xml-refused", "mine.urdf: declares a document type, entities or what lies elsewhere; send plain XML"),
        (OUTSIDE, "xml-refused", "mine.urdf: declares a document type, entities or what lies elsewhere; "),
        (b"<!DOCTYPE robot><robot/>", "xml-refused", "mine.urdf: declares a document type"),
        (b"<robot", "xml-refused", "mine.urdf: is no XML: unclosed token: line 1, column 0"),
        (b"", "xml-refused", "mine.urdf: is no XML: no element found"),
        (b'<?xml version="1.0" encoding="none"?><robot/>', "xml-refused", "mine.urdf: is no XML: unknown encoding"),
        (MESHED % b"link.stl", "name-not-allowed", "mine.urdf: mesh names 'link.stl', which did not come along; "),
        (MESHED % b"package://a/b.stl", "name-not-allowed", "mine.urdf: mesh names 'package://a/b.stl', "),
        (MESHED % b"../../x", "name-not-allowed", "mine.urdf: mesh names '../../x', which did not come along; "),
        (b" " * (LARGEST_URDF + 1), "upload-too-large", "mine.urdf: has 10485761 bytes, a URDF may have 10485760"),
    ],
)
def test_a_urdf_only_describes(tmp_path: Path, data: bytes, code: str, sentence: str) -> None:
    with pytest.raises(Problem) as problem:
        asked(tmp_path, {"mine.urdf": data}, kind="lay", setup='[machine]\nurdf = "mine.urdf"\n')
    assert (problem.value.code, problem.value.detail[: len(sentence)]) == (code, sentence)


@pytest.mark.parametrize(
    ("texts", "code", "sentence"),
    [
        ({}, "invalid-request", "kind: expected lay or spray or plan, it is missing"),
        ({"kind": "Lay"}, "invalid-request", "kind: expected lay or spray or plan, got 'Lay'"),
        ({"kind": "lay", "unit": "mm"}, "invalid-request", "unit: a unit belongs to kind spray, course files are in "),
        ({"kind": "spray", "unit": "ft"}, "invalid-request", "unit: expected mm or cm or m or in, got 'ft'"),
        ({"kind": "lay", "controller": "fanuc"}, "name-not-allowed", "[output] controller: 'fanuc' is neither built "),
    ],
)
def test_what_is_refused_at_once(tmp_path: Path, texts: dict[str, str], code: str, sentence: str) -> None:
    with pytest.raises(Problem) as problem:
        asked(tmp_path, **texts)
    assert (problem.value.code, problem.value.detail[: len(sentence)]) == (code, sentence)


def test_a_setup_is_refused_with_its_faults(tmp_path: Path) -> None:
    with pytest.raises(SetupRefused) as refused:
        asked(tmp_path, kind="lay", setup="[tape]\nwidth = 75\nthickness_mm = 0\n")
    assert [fault.line for fault in refused.value.faults] == [2, 3]
    with pytest.raises(SetupRefused, match=r"^setup:1: unknown section \[tape\]; "):
        requested(Form({"kind": bytearray(b"spray"), "setup": bytearray(b"[tape]\n")}, {"file": "a"}), tmp_path)


def test_files_that_are_missing_or_out_of_place(tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"^file: is missing; send the course file or the STL as a file$"):
        requested(Form({"kind": bytearray(b"lay")}), tmp_path)
    with pytest.raises(Problem, match=r"^program: is missing; send the NC program as a file$"):
        verify_request(Form({"kind": bytearray(b"lay")}), tmp_path)
    with pytest.raises(Problem, match=r"^mould: a mould belongs to kind lay; leave it out$"):
        requested(form_of(tmp_path, {"kind": "spray"}, {}, file="a.stl", mould="b.stl"), tmp_path)


def test_a_part_does_not_stand_for_a_built_in(tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"^parts: jb3208 is the name of a built-in; rename the file$"):
        asked(tmp_path, {"jb3208": b""}, kind="lay")
