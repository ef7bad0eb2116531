"""STL files: what is read is what stands there, and what cannot be read is refused in one sentence."""

from __future__ import annotations

import hashlib
import time

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.errors import MeshRefused
from tapelayer.geometry.mending import Mending
from tapelayer.geometry.models import read_mesh
from tests.helpers.parts import CLEAN
from tests.helpers.stl_files import TETRAHEDRON, ascii, binary, written


def refusal(path, **arguments):
    with pytest.raises(MeshRefused) as caught:
        read_mesh(path, **arguments)
    prefix = f"{path}:"
    assert str(caught.value).startswith(prefix)
    return str(caught.value).removeprefix(prefix).strip()


@pytest.mark.parametrize("name", CLEAN)
def test_clean_parts_come_through_as_trimesh_reads_them(part, name):
    path = part(name)
    mesh, other = read_mesh(path), trimesh.load_mesh(path, process=False)
    np.testing.assert_array_equal(mesh.vertices[mesh.facets], np.float64(other.triangles) * 1e-3)
    _, uses = np.unique(trimesh.load_mesh(path).edges_sorted, axis=0, return_counts=True)
    assert mesh.mending == Mending(facets_read=len(other.faces), open_edges=int(np.sum(uses == 1)))
    assert (mesh.name, mesh.unit) == (path.name, "mm")
    assert mesh.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    np.testing.assert_allclose(mesh.areas, other.area_faces * 1e-6, rtol=1e-6, atol=1e-14)
    sure = other.area_faces > 1e-6 * np.max(other.area_faces)
    np.testing.assert_allclose(mesh.normals[sure], other.face_normals[sure], atol=1e-5)


def test_ascii_and_binary_are_one_part(tmp_path):
    triangles = trimesh.creation.icosphere(subdivisions=2, radius=100.0).triangles.astype(np.float32).astype(np.float64)
    meshes = [read_mesh(written(tmp_path, data)) for data in (binary(triangles), ascii(triangles))]
    for mesh in meshes:
        np.testing.assert_array_equal(mesh.vertices[mesh.facets], triangles * 1e-3)
    assert meshes[0].mending == meshes[1].mending == Mending(facets_read=len(triangles))


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.replace(b"\n", b"\r\n"),
        lambda data: data.upper(),
        lambda data: data.replace(b"0 0 1", b"-nan(ind) nan 1.#QNAN"),
        lambda data: data.replace(b"solid part", b"solid facet with a vertex of 3 words"),
        lambda data: data.replace(b"  vertex", b"\tvertex\t"),
        lambda data: b"\n\n" + data + b"\n\n",
        lambda data: data.replace(b"endfacet\n", b"endfacet\nendsolid part\nsolid part\n", 2),
    ],
    ids=["crlf", "upper case", "nan normals", "keywords in the name", "tabs", "blank lines", "several solids"],
)
def test_ascii_spelling_does_not_matter(tmp_path, change):
    mesh = read_mesh(written(tmp_path, change(ascii(TETRAHEDRON))))
    np.testing.assert_array_equal(mesh.vertices[mesh.facets], TETRAHEDRON * 1e-3)


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)])
def test_units(tmp_path, unit, metres):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON)), unit)
    np.testing.assert_array_equal(mesh.vertices[mesh.facets], TETRAHEDRON * metres)
    assert mesh.unit == unit


def test_bytes_after_the_counted_facets_are_ignored_and_counted(tmp_path):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON, tail=b"a comment")))
    assert mesh.mending == Mending(facets_read=4, bytes_ignored=9)


@pytest.mark.parametrize(
    "tail",
    [
        bytes(1000),
        b" " * 500,
        b"\xff" * 500,
        b"made by a test on a machine of its own, " * 20,
        b"1234567890" * 60,
        b"AAAA AAABBBBB CCCA" * 50,
    ],
    ids=["zeros", "blanks", "ones", "words", "digits", "capitals"],
)
def test_padding_and_text_after_the_last_facet_are_no_facets(tmp_path, tail):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON, tail=tail)))
    assert mesh.mending == Mending(facets_read=4, bytes_ignored=len(tail))


@given(st.integers(1, 79), st.binary(max_size=49))
@settings(deadline=None)
def test_facets_after_the_counted_ones_are_never_dropped(tmp_path_factory, count, rest):
    sphere = trimesh.creation.icosphere(subdivisions=1, radius=100.0).triangles
    data = binary(sphere, count=count, tail=rest)
    sentence = f"the header counts {count} facets, and {80 - count} more follow them; export it again"
    assert refusal(written(tmp_path_factory.getbasetemp(), data)) == sentence


@given(st.lists(st.sampled_from([" ", "\n", "\t", "\r\n", "\n\n", " \t "]), min_size=1), st.integers(1, 3))
@settings(deadline=None)
def test_words_may_be_split_by_any_blanks(tmp_path_factory, blanks, solids):
    """A name ends with its line, so a solid without a name has none to end."""
    words = (ascii(TETRAHEDRON, "").decode().split()) * solids
    text = "".join(word + blanks[row % len(blanks)] for row, word in enumerate(words))
    mesh = read_mesh(written(tmp_path_factory.getbasetemp(), text.encode()))
    assert mesh.mending == Mending(facets_read=4 * solids, duplicate_facets=4 * (solids - 1))
    np.testing.assert_array_equal(mesh.vertices[mesh.facets], TETRAHEDRON * 1e-3)


@pytest.mark.parametrize("solids", [1, 2])
@pytest.mark.parametrize("name", ["part", "part of a solid", "facet 3", "vertex normal µ", ""])
def test_a_file_may_be_one_line(tmp_path, name, solids):
    data = ascii(TETRAHEDRON, name).replace(b"\n", b" ") * solids
    mesh = read_mesh(written(tmp_path, data))
    assert mesh.mending == Mending(facets_read=4 * solids, duplicate_facets=4 * (solids - 1))


def test_no_name_is_slow(tmp_path):
    for word in (b"solid ", b"facet normal ", b" " * 9, b"endsolid ", b"solid facet "):
        begun = time.perf_counter()
        refusal(written(tmp_path, b"solid " + word * 100_000))
        assert time.perf_counter() - begun < 10.0


def test_a_signalling_nan_is_refused_and_numpy_says_nothing(tmp_path):
    data = bytearray(binary(TETRAHEDRON))
    data[84 + 12 : 84 + 16] = b"\x01\0\x80\x7f"
    sentence = "a facet has corners that are no finite numbers, first facet 1; export it again"
    assert refusal(written(tmp_path, bytes(data))) == sentence


def test_a_missing_file_is_refused(tmp_path):
    assert refusal(tmp_path / "part.stl") == "cannot be read: no such file or directory"


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "the file is empty"),
        (
            b"<!DOCTYPE html>\n<html><body>404</body></html>",
            "this is no STL file, it begins with '<!DOCTYPE html>'; export the part as STL",
        ),
        (b"\0" * 50, "the file has 50 bytes, expected a header of 84: it is cut short"),
        (
            binary(TETRAHEDRON)[:-60],
            "a binary STL of 4 facets has 284 bytes, got 224: it is cut short; export it again",
        ),
        (
            binary(TETRAHEDRON, count=5),
            "a binary STL of 5 facets has 334 bytes, got 284: it is cut short; export it again",
        ),
        (binary([]), "the header counts no facets, and 0 bytes follow; export it again"),
        (binary(TETRAHEDRON, count=0), "the header counts no facets, and 200 bytes follow; export it again"),
        (b"solid nothing\nendsolid nothing\n", "the file holds no facets"),
        (
            ascii(TETRAHEDRON)[:-14],
            "29: the file ends without endsolid: it is cut short; export it again",
        ),
        (
            ascii(TETRAHEDRON)[:300],
            "19: the file ends inside facet 3: it is cut short; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"60.0", b"6o.0", 1),
            "6: expected a number, got '6o.0' in facet 1; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b" endloop", b"  vertex 1 2 3\n endloop", 1),
            "7: expected endloop, got 'vertex' in facet 1; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"80.0", b"-nan(ind)", 1),
            "13: expected a number, got '-nan(ind)' in facet 2; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"0.0", b"0,0"),
            "4: expected a number, got '0,0' in facet 1: the file has decimal commas, STL has decimal points; "
            "export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"60.0 0.0", b"60.0, 0.0"),
            "6: expected a number, got '60.0,' in facet 1: the numbers are separated by commas, STL has blanks; "
            "export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"60.0 0.0 0.0", b"60.0;0.0;0.0"),
            "6: expected a number, got '60.0;0.0;0.0' in facet 1: the numbers are separated by semicolons, STL has "
            "blanks; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"endloop", b"\x1b[2J", 1),
            "7: expected endloop, got '\\x1b[2j' in facet 1; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"80.0", b"nan", 1),
            "a facet has corners that are no finite numbers, first facet 2; export it again",
        ),
        (
            binary(np.where(TETRAHEDRON == 80, np.inf, TETRAHEDRON)),
            "3 of 4 facets have corners that are no finite numbers, first facet 2; export it again",
        ),
        (binary(TETRAHEDRON * [1, 0, 0]), "no facet is left: all 4 are without area; export it again"),
        (binary(TETRAHEDRON * 0), "no facet is left: all 4 are without area; export it again"),
        (
            binary(TETRAHEDRON * 1e36),
            "4 of 4 facets have corners 7e+37 mm from the origin, expected at most 1e+06 mm, first facet 1: it is "
            "damaged; export it again",
        ),
        (
            ascii(TETRAHEDRON).replace(b"80.0", b"-1e308", 1),
            "a facet has a corner 1e+308 mm from the origin, expected at most 1e+06 mm, first facet 2: it is damaged; "
            "export it again",
        ),
    ],
    ids=[
        *("empty", "html", "no header", "cut between facets", "counts one more", "no facets", "counts none"),
        *("ascii without facets", "ascii cut between facets", "ascii cut inside a facet", "letter in a number"),
        *("decimal commas", "commas", "semicolons", "control character"),
        *(
            "four corners",
            "windows nan",
            "nan",
            "infinity",
            "all on a line",
            "all at a point",
            "too large",
            "one corner too far",
        ),
    ],
)
def test_what_cannot_be_mended_is_refused_in_one_sentence(tmp_path, data, sentence):
    assert refusal(written(tmp_path, data)) == sentence


@given(st.binary(max_size=400))
@settings(max_examples=200, deadline=None)
def test_any_bytes_are_a_mesh_or_refused(tmp_path_factory, data):
    path = written(tmp_path_factory.getbasetemp(), data)
    try:
        mesh = read_mesh(path)
    except MeshRefused:
        return
    assert np.all(np.isfinite(mesh.normals)) and np.all(mesh.areas > 0)


@given(st.integers(0, len(ascii(TETRAHEDRON)) - 9), st.integers(0, len(binary(TETRAHEDRON)) - 1))
@settings(max_examples=200, deadline=None)
def test_no_file_cut_short_is_read(tmp_path_factory, characters, length):
    for data in (ascii(TETRAHEDRON)[:characters], binary(TETRAHEDRON)[:length]):
        with pytest.raises(MeshRefused):
            read_mesh(written(tmp_path_factory.getbasetemp(), data))
