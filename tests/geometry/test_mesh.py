from __future__ import annotations

import dataclasses
import hashlib
import struct

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.errors import MeshRefused
from tapelayer.geometry.adjacency import neighbours
from tapelayer.geometry.mending import Mending, mended
from tapelayer.geometry.stl import read_mesh
from tests.helpers.parts import CLEAN, DIRTY, DUPLICATES, SLIVERS, real_parts

TETRAHEDRON = np.array([[0.0, 0, 0], [60, 0, 0], [0, 70, 0], [0, 0, 80]])[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]


def binary(triangles, count=None, tail=b""):
    triangles = np.asarray(triangles, dtype="<f4")
    body = b"".join(bytes(12) + corners.tobytes() + b"\0\0" for corners in triangles)
    return (
        b"solid made by a test".ljust(80) + struct.pack("<I", len(triangles) if count is None else count) + body + tail
    )


def ascii(triangles, name="part"):
    lines = [f"solid {name}"]
    for corners in np.asarray(triangles):
        lines += ["facet normal 0 0 1", " outer loop"]
        lines += [f"  vertex {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


def written(directory, data):
    path = directory / "part.stl"
    path.write_bytes(data)
    return path


def refusal(path, **arguments):
    with pytest.raises(MeshRefused) as caught:
        read_mesh(path, **arguments)
    prefix = f"{path}:"
    assert str(caught.value).startswith(prefix)
    return str(caught.value).removeprefix(prefix).strip()


def as_set(triangles):
    """Triangles as a set, whatever the order of facets, the corner they begin with, and the winding."""
    return {tuple(sorted(map(tuple, corners))) for corners in triangles.tolist()}


# Reading


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


@pytest.mark.parametrize("name", DIRTY)
def test_dirty_parts_are_mended_and_the_surface_stays(part, name):
    path = part(name)
    mesh, other = read_mesh(path), trimesh.load_mesh(path, process=False)
    mending = mesh.mending
    dropped = mending.degenerate_facets + mending.duplicate_facets
    assert len(mesh.facets) == mending.facets_read - dropped == len(other.faces) - dropped
    before = as_set(np.float64(other.triangles) * 1e-3)
    after = as_set(mesh.vertices[mesh.facets])
    # A dissolved facet takes its neighbour along.
    assert len(after - before) <= 2 * mending.dissolved_facets
    assert len(after & before) >= len(before) - mending.degenerate_facets - 2 * mending.dissolved_facets
    unique = [np.array(corners) for corners in before]
    area = sum(float(np.linalg.norm(np.cross(b - a, c - a))) / 2 for a, b, c in unique)
    assert float(np.sum(mesh.areas)) == pytest.approx(area, rel=1e-6)
    assert mending.seam_edges == 0
    one, two = np.nonzero(mesh.neighbours >= 0)
    assert np.array_equal(runs_of(mesh.facets, one, two), np.ones(len(one), dtype=bool))


@pytest.mark.parametrize(
    ("name", "facets", "duplicates", "nonmanifold"),
    [("aircraft", 4467, DUPLICATES, 128), *((name, 15576, 51, 260) for name in real_parts("yf23_2m"))],
)
def test_the_dirty_aircraft_is_reported_as_it_is(part, name, facets, duplicates, nonmanifold):
    mending = read_mesh(part(name)).mending
    assert (mending.facets_read, mending.duplicate_facets) == (facets, duplicates)
    assert mending.dissolved_facets >= SLIVERS and mending.degenerate_facets == 0
    assert mending.flipped_facets > 0 and mending.nonmanifold_edges >= 0.75 * nonmanifold


@pytest.mark.parametrize("name", ["wing_wound_wrongly", *real_parts("c172_wing")])
def test_the_flipped_skin_of_the_wing_is_turned(part, name):
    path = part(name)
    mesh, other = read_mesh(path), trimesh.load_mesh(path, process=False)
    sure = other.area_faces > 1e-5 * np.max(other.area_faces)
    turned = sure & (np.einsum("ij,ij->i", mesh.normals, other.face_normals) < 0)
    assert mesh.mending.flipped_facets == np.sum(turned) > 1000


def runs_of(facets, rows, corners):
    """Whether the edge of a facet from a corner to the next is run the other way in some neighbour's facet."""
    edges = {(int(a), int(b)) for f in facets for a, b in zip(f, np.roll(f, -1), strict=True)}
    begin, end = facets[rows, corners], facets[rows, (corners + 1) % 3]
    return np.array([(int(b), int(a)) in edges for a, b in zip(begin, end, strict=True)])


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


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("m", 1.0), ("in", 0.0254)])
def test_units(tmp_path, unit, metres):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON)), unit)
    np.testing.assert_array_equal(mesh.vertices[mesh.facets], TETRAHEDRON * metres)
    assert mesh.unit == unit


def test_bytes_after_the_counted_facets_are_ignored_and_counted(tmp_path):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON, tail=b"a comment")))
    assert mesh.mending == Mending(facets_read=4, bytes_ignored=9)
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON, count=3)))
    assert mesh.mending == Mending(facets_read=3, bytes_ignored=50, open_edges=3)


def test_one_triangle_is_a_mesh(tmp_path):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON[:1])))
    assert mesh.mending == Mending(facets_read=1, open_edges=3)
    np.testing.assert_allclose(mesh.normals, [[0, 0, -1]])
    np.testing.assert_allclose(mesh.upward_normals, [[0, 0, 1]])
    np.testing.assert_allclose(mesh.areas, [0.06 * 0.07 / 2])


def test_arrays_are_read_only(tmp_path):
    mesh = read_mesh(written(tmp_path, binary(TETRAHEDRON)))
    for array in (mesh.vertices, mesh.facets, mesh.normals, mesh.upward_normals, mesh.areas, mesh.neighbours):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


# Refusing


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
            "the part's largest side is 8e+34 m, expected at most 1000 m; if the file is not in mm, say so: --unit in",
        ),
    ],
    ids=[
        *("empty", "html", "no header", "cut between facets", "counts one more", "no facets", "counts none"),
        *("ascii without facets", "ascii cut between facets", "ascii cut inside a facet", "letter in a number"),
        *("four corners", "windows nan", "nan", "infinity", "all on a line", "all at a point", "too large"),
    ],
)
def test_what_cannot_be_mended_is_refused_in_one_sentence(tmp_path, data, sentence):
    assert refusal(written(tmp_path, data)) == sentence


def test_a_part_smaller_than_the_spot_is_in_another_unit(tmp_path):
    path = written(tmp_path, binary(TETRAHEDRON * 1e-3))
    assert refusal(path, spot=0.06) == (
        "the part's largest side is 0.08 mm, less than the spot of 60 mm; if the file is not in mm, say so: --unit m"
    )
    assert read_mesh(path, "m", spot=0.06).mending == Mending(facets_read=4)


def test_a_millimetre_file_read_as_metres_is_too_large(tmp_path):
    assert refusal(written(tmp_path, binary(TETRAHEDRON * 20)), unit="m") == (
        "the part's largest side is 1.6e+03 m, expected at most 1000 m; if the file is not in m, say so: --unit mm"
    )


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


# Mending


@given(st.sets(st.integers(0, 79), max_size=80), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_winding_is_made_consistent_with_the_fewest_turns(turned, seed):
    ball = trimesh.creation.icosphere(subdivisions=1).triangles.copy()
    rows = sorted(turned)
    ball[rows] = ball[rows, ::-1]
    ball = np.random.default_rng(seed).permutation(ball)
    vertices, facets, mending = mended(ball)
    assert mending == Mending(facets_read=80, flipped_facets=min(len(turned), 80 - len(turned)))
    assert np.all(neighbours(facets, len(vertices)) >= 0)
    assert as_set(vertices[facets]) == as_set(ball)
    volume = np.sum(np.linalg.det(vertices[facets])) / 6
    expected = trimesh.creation.icosphere(subdivisions=1).volume
    assert abs(volume) == pytest.approx(expected, rel=1e-12)


def test_a_surface_with_one_side_keeps_its_facets_and_a_seam():
    turns = np.linspace(0, np.pi, 25)
    middle = np.stack([np.cos(2 * turns), np.sin(2 * turns), 0 * turns], axis=1)
    arm = np.stack([np.cos(turns) * np.cos(2 * turns), np.cos(turns) * np.sin(2 * turns), np.sin(turns)], axis=1)
    upper, lower = middle + 0.3 * arm, middle - 0.3 * arm
    upper[-1], lower[-1] = lower[0], upper[0]
    strip = [(upper[i], lower[i], upper[i + 1]) for i in range(24)] + [
        (lower[i], lower[i + 1], upper[i + 1]) for i in range(24)
    ]
    _, facets, mending = mended(np.array(strip))
    assert len(facets) == 48
    assert mending.seam_edges >= 1 and mending.flipped_facets == 0 and mending.open_edges == 48


def test_equal_corners_are_one_vertex_in_order_of_appearance():
    triangles = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [-0.0, 1, -0.0]]])
    vertices, facets, _ = mended(triangles)
    np.testing.assert_array_equal(vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    np.testing.assert_array_equal(facets, [[0, 1, 2], [1, 3, 2]])


def test_duplicates_are_dropped_whatever_their_winding():
    doubled = np.concatenate([TETRAHEDRON, TETRAHEDRON[:2, ::-1], np.roll(TETRAHEDRON[3:], 1, axis=1)])
    vertices, facets, mending = mended(doubled)
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=7, duplicate_facets=3)


def test_facets_with_a_corner_twice_are_dropped():
    spoiled = np.concatenate([TETRAHEDRON, TETRAHEDRON[:1, [0, 0, 1]], TETRAHEDRON[1:2, [2, 2, 2]]])
    vertices, facets, mending = mended(spoiled)
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=6, degenerate_facets=2)


@pytest.mark.parametrize("share", [0.5, 0.25, 1e-3])
def test_a_thin_facet_on_an_edge_is_dissolved_and_the_solid_stays_closed(share):
    a, b, c, d = TETRAHEDRON[0][[0, 2, 1]][[0, 1, 2]].tolist() + [TETRAHEDRON[1][2].tolist()]
    a, b, c, d = (np.array(corner) for corner in (a, b, c, d))
    on = a + share * (b - a)
    # Facet a c b is cut at a point on its edge a b, facet a b d is not: between them lies a facet without area.
    solid = np.array([[a, c, on], [on, c, b], [a, on, b], [a, b, d], [b, c, d], [a, d, c]])
    vertices, facets, mending = mended(solid)
    assert mending == Mending(facets_read=6, dissolved_facets=1)
    assert np.all(neighbours(facets, len(vertices)) >= 0)
    assert np.sum(np.linalg.det(vertices[facets])) / 6 == pytest.approx(60 * 70 * 80 / 6, rel=1e-12)
    assert np.all(trimesh.triangles.area(vertices[facets]) > 0.5)


def test_a_thin_facet_without_neighbour_is_dropped():
    loose = np.array([[[500.0, 0, 0], [600, 0, 0], [550, 1e-6, 0]]])
    vertices, facets, mending = mended(np.concatenate([TETRAHEDRON, loose]))
    np.testing.assert_array_equal(vertices[facets], TETRAHEDRON)
    assert mending == Mending(facets_read=5, degenerate_facets=1)


def test_nothing_left_is_nothing():
    vertices, facets, mending = mended(TETRAHEDRON * 0)
    assert vertices.shape == facets.shape == (0, 3)
    assert mending == Mending(facets_read=4, degenerate_facets=4)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_the_facets_that_are_counted_add_up(seed):
    random = np.random.default_rng(seed)
    lattice = random.integers(0, 4, (60, 3)).astype(np.float64)
    triangles = lattice[random.integers(0, 60, (40, 3))]
    vertices, facets, mending = mended(triangles)
    assert mending.facets_read - mending.degenerate_facets - mending.duplicate_facets == len(facets)
    assert np.array_equal(np.unique(facets), np.arange(len(vertices)))
    assert len({tuple(sorted(facet)) for facet in facets.tolist()}) == len(facets)
    again = mended(vertices[facets])
    np.testing.assert_array_equal(again[0][again[1]], vertices[facets])
    assert again[2] == dataclasses.replace(
        mending, facets_read=len(facets), degenerate_facets=0, dissolved_facets=0, duplicate_facets=0, flipped_facets=0
    )


# Neighbours


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(3, 9))
@settings(max_examples=100, deadline=None)
def test_neighbours_are_mutual_and_none_is_left_out(seed, facet_count, vertex_count):
    """Any facets on few vertices: many edges of three facets or more."""
    random = np.random.default_rng(seed)
    facets = np.array([random.permutation(vertex_count)[:3] for _ in range(facet_count)])
    across = neighbours(facets, vertex_count)
    runs = {}
    for facet, corners in enumerate(facets.tolist()):
        for corner in range(3):
            runs.setdefault((corners[corner], corners[(corner + 1) % 3]), []).append((facet, corner))
    for (begin, end), half_edges in runs.items():
        others = [facet for facet, _ in runs.get((end, begin), [])]
        found = [int(across[half_edge]) for half_edge in half_edges]
        paired = [other for other in found if other >= 0]
        assert len(paired) == min(len(half_edges), len(others))
        assert len(set(paired)) == len(paired) and set(paired) <= set(others)
        for (facet, _), other in zip(half_edges, found, strict=True):
            if other >= 0:
                back = dict(runs[end, begin])[other]
                assert across[other, back] == facet


def test_two_cubes_on_one_edge_have_neighbours_all_round():
    cube = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).triangles
    vertices, facets, mending = mended(np.concatenate([cube, cube + [1, 1, 0]]))
    assert mending.nonmanifold_edges == 1 and mending.open_edges == 0
    assert np.all(neighbours(facets, len(vertices)) >= 0)
