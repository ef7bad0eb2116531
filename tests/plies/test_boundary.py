"""Boundary files: closed lines from text and DXF however they are spelt, and every fault with its line."""

from __future__ import annotations

import io
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing

from tapelayer.errors import PlyRefused
from tapelayer.plies import boundary
from tapelayer.plies.boundary import is_dxf, parse_boundary, read_boundary

SQUARE = [[0, 0, 1], [100, 0, 2], [100, 80, 3], [0, 80, 4]]


def refused(data: bytes, name: str = "points.txt") -> list[str]:
    with pytest.raises(PlyRefused) as caught:
        parse_boundary(data, name)
    return str(caught.value).splitlines()


@pytest.mark.parametrize("separator", [" ", "\t", ",", ", ", ";", " ; ", "   "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_points_are_read_however_they_are_separated(separator: str, end: str) -> None:
    lines = ["# a boundary", *(separator.join(map(str, point)) for point in SQUARE), "0 0 1 # closed"]
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        (loop,) = parse_boundary(end.join(lines).encode(encoding), "points.txt")
        assert loop.points == pytest.approx(np.array(SQUARE) * 1e-3)
        assert loop.lines.tolist() == [2, 3, 4, 5]


def test_the_line_around_the_largest_area_is_the_boundary() -> None:
    text = (
        "10 10 0\n20 10 0\n20 20 0\n\n\n0 0 0\n# a comment ends no line\n100 0 0\n100 80 0\n\n5 5 0\n6 5 0\n6 6 0\n\n"
    )
    outer, *holes = parse_boundary(text.encode(), "points.txt", "cm")
    assert outer.area == pytest.approx(0.4)
    assert [hole.points[0].tolist() for hole in holes] == [[0.1, 0.1, 0.0], [0.05, 0.05, 0.0]]
    assert outer.lines.tolist() == [6, 8, 9]


@pytest.mark.parametrize(
    ("data", "sentences"),
    [
        (b"", ["points.txt: the file has no points; expected x y z a line"]),
        (b"# none\n\n", ["points.txt: the file has no points; expected x y z a line"]),
        (b"0 0 0\n1 0 0\n0 0 0\n", ["points.txt:1: the line has 2 points, expected at least 3"]),
        (
            b"0 0 0\n1 0\n1 a 0\n1 nan 0\n1 1 0 0\n\n0 0 0\n\n0 0 0\n1 0 0\n1 1 1e999\n",
            [
                "points.txt:2: expected three finite numbers x y z, got '1 0'",
                "points.txt:3: expected three finite numbers x y z, got '1 a 0'",
                "points.txt:4: expected three finite numbers x y z, got '1 nan 0'",
                "points.txt:5: expected three finite numbers x y z, got '1 1 0 0'",
                "points.txt:7: the line has 1 point, expected at least 3",
                "points.txt:11: expected three finite numbers x y z, got '1 1 1e999'",
            ],
        ),
        (b"0,0 1,5 2,5\n", ["points.txt:1: numbers have decimal commas, got '0,0 1,5 2,5'; write decimal points"]),
        (b"0 0 0\n\x01\n", ["points.txt:2: byte 0x01 is not text; expected points x y z a line, or a DXF"]),
        (b"1" * 2000, ["points.txt:1: the line has 2000 characters, expected three numbers x y z"]),
    ],
)
def test_all_faults_of_a_text_at_once(data: bytes, sentences: list[str]) -> None:
    assert refused(data) == sentences


def test_a_file_of_faults_alone_is_given_up() -> None:
    assert len(refused(b"a\n" * 100_000)) == 21


def test_a_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(PlyRefused, match=r"none\.txt: cannot be read: no such file or directory"):
        read_boundary(tmp_path / "none.txt")


def drawing(units: int = 0) -> Drawing:
    made = ezdxf.new()
    made.header["$INSUNITS"] = units
    return made


def as_bytes(made: Drawing) -> bytes:
    text = io.StringIO()
    made.write(text)
    return text.getvalue().encode()


def test_polylines_of_a_drawing() -> None:
    made = drawing()
    space = made.modelspace()
    space.add_lwpolyline([(10, 10), (20, 10), (20, 20)], close=True, dxfattribs={"elevation": 5})
    space.add_polyline3d([(x, y, z) for x, y, z in SQUARE], close=True)
    space.add_text("a note")
    outer, hole = parse_boundary(as_bytes(made), "ply.dxf")
    assert outer.points == pytest.approx(np.array(SQUARE) * 1e-3)
    assert hole.points == pytest.approx(np.array([[10, 10, 5], [20, 10, 5], [20, 20, 5]]) * 1e-3)
    assert outer.lines.tolist() == [0] * 4


def test_a_polyline_with_arcs_follows_them() -> None:
    made = drawing()
    made.modelspace().add_lwpolyline([(0, 0, 1), (200, 0, 1)], format="xyb", close=True)
    made.modelspace().add_polyline2d([(90, 0, -1), (110, 0, -1)], format="xyb", close=True)
    loops = parse_boundary(as_bytes(made), "ply.dxf")
    for loop, radius in zip(loops, (0.1, 0.01), strict=True):
        assert np.hypot(*(loop.points - [0.1, 0, 0]).T[:2]) == pytest.approx(radius, abs=1e-9)
        assert loop.area == pytest.approx(np.pi * radius**2, rel=2e-3)


def test_lines_and_arcs_that_meet_become_one() -> None:
    made = drawing()
    space = made.modelspace()
    space.add_line((0, 0, 0), (100, 0, 0))
    space.add_line((0, 50, 0), (100, 50, 0))
    space.add_arc((100, 25, 0), 25, -90, 90)
    space.add_line((0, 50, 0), (0, 0, 0))
    (loop,) = parse_boundary(as_bytes(made), "ply.dxf")
    assert loop.area == pytest.approx(100 * 50e-6 + np.pi * 25**2 / 2 * 1e-6, rel=1e-4)


@pytest.mark.parametrize(("units", "metres"), [(0, 0.01), (1, 0.0254), (4, 0.001), (5, 0.01), (6, 1.0)])
def test_a_drawing_may_state_its_unit(units: int, metres: float) -> None:
    made = drawing(units)
    made.modelspace().add_circle((0, 0, 0), 10)
    (loop,) = parse_boundary(as_bytes(made), "ply.dxf", "cm")
    assert np.hypot(*loop.points.T[:2]) == pytest.approx(10 * metres, rel=1e-6)


def test_faults_of_a_drawing() -> None:
    made = drawing()
    assert refused(as_bytes(made), "ply.dxf") == [
        "ply.dxf: the DXF has no line in its model space; expected one of ARC, CIRCLE, ELLIPSE, LINE, LWPOLYLINE, "
        "POLYLINE, SPLINE"
    ]
    space = made.modelspace()
    space.add_lwpolyline([(0, 0), (20, 0), (20, 20)])
    space.add_lwpolyline([(0, 0), (1, 0)], close=True)
    assert refused(as_bytes(made), "ply.dxf") == [
        "ply.dxf: a line from (0.0, 0.0, 0.0) to (20.0, 20.0, 0.0) is open by 28.3 mm; close it",
        "ply.dxf: the line has 2 points, expected at least 3",
    ]
    whole = as_bytes(made)
    for damaged in (b"  0\nSECTION\n", whole[:200], whole[: len(whole) // 3]):
        assert is_dxf(damaged)
        assert refused(damaged, "ply.dxf")[0].startswith("ply.dxf: the DXF ")


def test_without_ezdxf_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boundary, "find_spec", lambda name: None)
    assert refused(as_bytes(drawing()), "ply.dxf") == [
        "ply.dxf: reading a DXF needs ezdxf: pip install 'tapelayer[cad]', or give the points as text, x y z a line"
    ]
