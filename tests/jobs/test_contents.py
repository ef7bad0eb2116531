"""What a file is, told by its bytes: every file that comes along, in every encoding, cut short or damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tapelayer.jobs.contents import HEAD_BYTES, Content, content_of, content_of_file, kind_of_source
from tapelayer.jobs.kind import Form
from tapelayer.jobs.kinds import NAMES, KindName, kind_of
from tapelayer.plies.ply import parse_ply
from tapelayer.setups.sections import whole_text
from tests.helpers.paths import ROOT

COURSES = sorted((ROOT / "examples").glob("*.txt"))
FLAT = (ROOT / "examples" / "flat_panel_00.txt").read_bytes()
PROGRAM = (ROOT / "tests" / "faults" / "inputs" / "laid.nc").read_bytes()
STL = (ROOT / "examples" / "curved_panel.stl").read_bytes()
ASCII = (ROOT / "tests" / "faults" / "inputs" / "plate.stl").read_bytes()
LAYING, SPRAYING = Content(Form.COURSES, "lay"), Content(Form.MODEL, "spray")


@pytest.mark.parametrize("path", COURSES, ids=lambda path: path.stem)
def test_the_course_files_that_come_along(path: Path) -> None:
    assert content_of_file(path) == LAYING


@pytest.mark.parametrize("path", sorted((ROOT / "post" / "controllers").glob("*.toml")), ids=lambda path: path.stem)
def test_the_controller_tables_that_come_along(path: Path) -> None:
    assert content_of_file(path) == Content(Form.CONTROLLER)


@pytest.mark.parametrize("path", sorted((ROOT / "urdf").glob("*.urdf")), ids=lambda path: path.stem)
def test_the_machines_that_come_along(path: Path) -> None:
    assert content_of_file(path) == Content(Form.MACHINE)


@pytest.mark.parametrize("name", NAMES)
def test_a_setup_is_of_its_kind_whichever_section_it_has(name: KindName) -> None:
    kind = kind_of(name)
    text = whole_text(kind.first_setup(), kind.title)
    assert content_of(text.encode()) == Content(Form.SETUP, name)
    if any(field.is_required() for field in kind.setup.model_fields.values()):
        # Without the sections that it needs it is none; what is left may be another's.
        return
    for section in text.split("\n\n")[1:]:
        content = content_of(section.encode())
        assert content.form is Form.SETUP and content.kind in (name, None), section


def test_a_whole_ply_file_is_one_and_a_setup_with_its_tape_is_none() -> None:
    ply = parse_ply(b'[mould]\nfile = "hood.stl"\n[ply]\nangle_deg = 45\n', "one.toml")
    assert content_of(whole_text(ply, "A ply").encode()) == Content(Form.SETUP, "plan")
    assert content_of(b"[tape]\nwidth_mm = 75\n[head]\nrun_out = 'none'\n") == Content(Form.SETUP, "lay")


def test_a_setup_with_shared_keys_alone_is_of_either_kind() -> None:
    assert content_of(b'[machine]\nurdf = "m.urdf"\n') == Content(Form.SETUP)


@pytest.mark.parametrize(("data", "content"), [(FLAT, LAYING), (PROGRAM, Content(Form.PROGRAM)), (ASCII, SPRAYING)])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-be"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_text_is_known_in_every_encoding_and_with_every_line_end(
    data: bytes, content: Content, encoding: str, end: str
) -> None:
    text = data.decode().replace("\n", end)
    assert content_of(text.encode(encoding)) == content
    assert content_of(f"{text}\x1a".encode(encoding)) == content
    assert content_of(text.encode(encoding)[:-1]) == content


def test_a_model_in_wide_characters_is_a_model() -> None:
    assert content_of_file(ROOT / "tests" / "faults" / "inputs" / "utf16.stl") == SPRAYING


def test_a_damaged_model_is_still_a_model() -> None:
    assert content_of(STL) == SPRAYING
    for damaged in (STL[:-20], STL + bytes(100), b"solid " + STL[6:]):
        assert content_of(damaged) == SPRAYING
    assert content_of(STL[:HEAD_BYTES], len(STL)) == SPRAYING
    assert content_of(ASCII[: len(ASCII) // 2]) == SPRAYING


@pytest.mark.parametrize(
    ("data", "form"),
    [
        (b"", Form.UNKNOWN),
        (b"Dear Sir,\nplease find enclosed\n", Form.UNKNOWN),
        (b"[project]\nname = 'x'\n", Form.UNKNOWN),
        (b"x,y,z\n1,2,3\n", Form.UNKNOWN),
        (b"0 1\n20 0.5\n30 0\n", Form.UNKNOWN),
        (bytes(range(256)) * 4, Form.BINARY),
        (b"\x89PNG\r\n\x1a\n", Form.PICTURE),
        (b"PK\x03\x04", Form.ARCHIVE),
        (b"%PDF-1.7\n", Form.DOCUMENT),
        (b"# made by a modeller\nmtllib a.mtl\nv 0 0 0\n", Form.MESH),
        (b"v 0 0 0\nv 1 0 0\n", Form.MESH),
        (b"<!DOCTYPE html>\n<html>", Form.PAGE),
        (b'{\n  "passed": true\n}\n', Form.JSON),
        (b"# corners\n0 0 0\n100, 0, 0\n100;100;0\n\n10 10 0\n20 10", Form.BOUNDARY),
        (b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n", Form.DXF),
        (b"999\nmade by hand\n0\nSECTION\n", Form.DXF),
        (b"AutoCAD Binary DXF\r\n\x1a\x00\x00\x00SECTION\x00", Form.DXF),
        (b"G21 G90\nG1 X10 Y20 F100\nM30\n", Form.PROGRAM),
        (b"; made by hand\nN10 X1.5Y2\nN20 X3Y4\n", Form.PROGRAM),
        (b"(no percent sign)\nN10 G0 X1\n", Form.PROGRAM),
    ],
)
def test_other_files(data: bytes, form: Form) -> None:
    assert content_of(data) == Content(form)


def test_models_of_faces_are_sources() -> None:
    assert content_of(b"ISO-10303-21;\nHEADER;\n") == Content(Form.STEP, "spray")
    assert content_of(b"".ljust(72) + b"S      1\n") == Content(Form.IGES, "spray")
    assert {form.read_as for form in (Form.STEP, Form.IGES, Form.MODEL)} == {Form.MODEL}


def test_no_bytes_at_all_raise_and_sources_have_a_kind() -> None:
    chance = np.random.default_rng(11)
    for length in (1, 80, 84, 134, 500):
        for whole in (FLAT, PROGRAM, STL, ASCII):
            data = bytearray(whole[:length])
            data[int(chance.integers(len(data)))] = int(chance.integers(256))
            assert kind_of_source(content_of(bytes(data))) in NAMES


@pytest.mark.parametrize(
    "data",
    [
        b'[mould]\nfile = "hood.stl"\n[ply]\nangle_deg = 45\n',
        b"[ply]\nangle_deg = 45\n[tape]\nwidth_mm = 75\n[gap]\nlargest_mm = 3\n",
    ],
)
def test_ply_files(data: bytes) -> None:
    assert content_of(data) == Content(Form.SETUP, "plan")
