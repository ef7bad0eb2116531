"""What a ply covers on moulds of every shape, and each reason why it covers nothing, with its place."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import trimesh
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats
from tapelayer.errors import PlyRefused
from tapelayer.geometry.mesh import Mesh
from tapelayer.plies.ply import Ply, parse_ply
from tapelayer.plies.region import NARROW, Region, region_of
from tests.helpers.panels import Height, flat, mesh_of, sheet

X, Y = np.linspace(0, 600, 25), np.linspace(0, 900, 37)
CORNERS = [[100.0, 100.0], [500.0, 100.0], [500.0, 800.0], [100.0, 800.0]]


def dome(x: Floats, y: Floats) -> Floats:
    return 40.0 - ((x - 300.0) ** 2 + (y - 450.0) ** 2) / 8000.0


def ply_of(**values: Any) -> Ply:
    width = values.pop("width", 75.0)
    told = "\n".join(f"{key} = {json.dumps(value)}" for key, value in ({"angle_deg": 0.0} | values).items())
    return parse_ply(f'[mould]\nfile = "m.stl"\n[ply]\n{told}\n[tape]\nwidth_mm = {width}\n'.encode(), "one.toml")


def on(height: Height, points: Any) -> list[list[float]]:
    """Points of a plan in mm, on a surface."""
    plan = np.asarray(points, dtype=float)
    return np.column_stack([plan, height(plan[:, 0], plan[:, 1])]).tolist()  # type: ignore[no-any-return]


def refused(ply: Ply, mould: Mesh) -> list[str]:
    with pytest.raises(PlyRefused) as caught:
        region_of(ply, mould, "one.toml")
    assert caught.value.exit_code == 2
    assert all(fault.place for fault in caught.value.faults)
    return [line.removeprefix("one.toml: ") for line in str(caught.value).splitlines()]


def outline_of(region: Region) -> shapely.Polygon:
    """Outline in the mould's x and y, in mm, of a mould whose plane lies along them."""
    plan = shapely.transform(region.outline, lambda points: points)
    rotation, origin = region.plane.rotation, region.plane.origin
    return shapely.transform(plan, lambda points: (points @ rotation[:2, :2] + origin[:2]) * 1e3)


SHEET, DOME = mesh_of(sheet(X, Y, flat)), mesh_of(sheet(X, Y, dome))


def test_the_edge_of_a_mould_is_its_outline() -> None:
    region = region_of(ply_of(), DOME, "one.toml")
    assert outline_of(region).symmetric_difference(shapely.box(0, 0, 600, 900)).area < 1e-6
    assert len(region.facets) == len(DOME.facets)
    assert region.plane.normal == pytest.approx([0, 0, 1], abs=1e-9)
    assert region.plane.out_of(np.array([[*region.seed, 0.0]]))[0, :2] == pytest.approx([0.3, 0.45])


def test_an_inset_moves_the_edge_and_its_holes() -> None:
    mould = mesh_of(sheet(X, Y, flat, (200, 300, 300, 400)))
    region = region_of(ply_of(inset_mm=30), mould, "one.toml")
    outline = outline_of(region)
    assert len(outline.interiors) == 1
    assert outline.bounds == pytest.approx((30, 30, 570, 870))
    assert shapely.Polygon(outline.interiors[0]).bounds == pytest.approx((170, 270, 330, 430))
    assert outline.area == pytest.approx(540 * 840 - 100**2 - 4 * 100 * 30 - np.pi * 30**2, rel=1e-3)


@pytest.mark.parametrize("turn", [[0, 0, 0], [0.3, -1.2, 0.4], [3.0, 0, 0]])
def test_a_ply_turns_with_its_mould(turn: list[float]) -> None:
    rotation = Rotation.from_rotvec(turn).as_matrix()
    shift = np.array([2.0, -1.0, 0.5])
    boundary, rosette = on(dome, np.array(CORNERS) + [3, 4]), [0.0, 1.0, 0.0]
    moved = (np.array(boundary) @ rotation.T + shift * 1e3).tolist()
    here = region_of(ply_of(boundary=boundary, rosette=rosette, angle_deg=30), DOME, "one.toml")
    turned = ply_of(boundary=moved, rosette=(rotation @ rosette).tolist(), angle_deg=30)
    there = region_of(turned, DOME.moved(rotation, shift), "one.toml")
    assert there.outline.area == pytest.approx(here.outline.area)
    assert there.facets.tolist() == here.facets.tolist()
    normals = DOME.normals[:50]
    for region, turning in ((here, np.eye(3)), (there, rotation)):
        told = region.plane.turned_out_of(region.headings(region.plane.turned_into(normals @ turning.T)))
        angles = np.arctan2(*np.moveaxis(told @ turning @ np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, 0]]).T, -1, 0)[:2])
        assert np.degrees(angles) == pytest.approx(30, abs=1.0)  # to the left of y, seen from above


def test_headings_lie_in_the_surface_at_the_angle() -> None:
    region = region_of(ply_of(angle_deg=-35), DOME, "one.toml")
    normals = region.plane.turned_into(DOME.normals)
    headings = region.headings(normals)
    assert np.einsum("ni,ni->n", headings, normals) == pytest.approx(0, abs=1e-12)
    rosette = region.plane.turned_into(region.rosette[None])[0]
    ahead = rosette - (normals @ rosette)[:, None] * normals
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    assert np.einsum("ni,ni->n", headings, ahead) == pytest.approx(np.cos(np.radians(35)))
    assert np.einsum("ni,ni->n", np.cross(ahead, headings), normals) == pytest.approx(-np.sin(np.radians(35)))


def test_holes_of_a_boundary_are_left_out() -> None:
    hole = on(flat, [[250, 300], [350, 300], [350, 400]])
    region = region_of(ply_of(boundary=on(flat, CORNERS), holes=[hole]), SHEET, "one.toml")
    assert outline_of(region).area == pytest.approx(400 * 700 - 5000)


def test_a_boundary_may_be_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "points.txt"
    path.write_text("\n".join(", ".join(map(repr, point)) for point in on(dome, CORNERS)))
    region = region_of(ply_of(boundary=str(path)), DOME, "one.toml")
    assert outline_of(region).area == pytest.approx(400 * 700)
    path.write_text(path.read_text() + "\n\n250 300 37\n350 300 37\n350 400 60\n")
    assert refused(ply_of(boundary=str(path)), DOME) == [
        "hole 1: point 3 (points.txt:8) is 20.6 mm off the mould, expected at most 5"
    ]


def test_the_seed_is_in_the_ply_even_where_its_middle_is_not() -> None:
    hook = [[0, 0], [600, 0], [600, 900], [500, 900], [500, 100], [0, 100]]
    region = region_of(ply_of(boundary=on(flat, hook), width=60), SHEET, "one.toml")
    from_edge = shapely.Point(region.seed).distance(region.outline.boundary)
    assert region.outline.contains(shapely.Point(region.seed)) and from_edge == pytest.approx(0.030, abs=1e-6)
    told = region_of(ply_of(seed=[300.0, 50.0, 0.0], boundary=on(flat, hook)), SHEET, "one.toml")
    assert told.plane.out_of(np.array([[*told.seed, 0.0]]))[0, :2] == pytest.approx([0.3, 0.05])


def test_facets_around_the_ply_belong_to_it_and_those_below_do_not() -> None:
    block = mesh_of(trimesh.creation.box(extents=[600, 900, 200]).subdivide_to_size(60).triangles)
    corners = on(lambda x, y: 100.0 + 0.0 * x, np.array(CORNERS) - [300, 450])
    region = region_of(ply_of(boundary=corners), block, "one.toml")
    assert np.all(block.normals[region.facets] @ [0, 0, 1] == pytest.approx(1.0))
    assert block.areas[region.facets].sum() == pytest.approx(0.54, rel=0.03)
    below = region_of(ply_of(boundary=(np.array(corners) * [1, 1, -1]).tolist()), block, "one.toml")
    assert below.plane.normal == pytest.approx([0, 0, -1])


def test_cracks_and_facets_that_do_not_meet_at_corners_are_no_holes() -> None:
    left = sheet(np.linspace(0, 300, 4), Y, flat)
    right = sheet(np.linspace(300, 600, 4) + 2e-4, np.linspace(0, 900, 50), flat)
    region = region_of(ply_of(), mesh_of(np.concatenate([left, right])), "one.toml")
    assert not region.outline.interiors and len(region.outline.exterior.coords) < 12
    assert len(region_of(ply_of(boundary=on(flat, CORNERS)), region.mould, "one.toml").facets) > 400


BOW = [CORNERS[0], CORNERS[2], CORNERS[1], CORNERS[3]]
HOLE = [[250.0, 300.0], [350.0, 300.0], [350.0, 400.0]]


def step(x: Floats, y: Floats) -> Floats:
    return np.where(np.abs(x - 300.0) < 60.0, 120.0, 0.0) + 0.0 * y


def turned(triangles: Floats) -> Floats:
    return triangles[:, ::-1]


CASES: dict[str, tuple[Callable[[], Mesh], dict[str, Any], list[str]]] = {
    "crossing": (lambda: SHEET, {"boundary": on(flat, BOW)}, ["boundary: it crosses itself near (300.0, 450.0, 0.0)"]),
    "no area": (
        lambda: SHEET,
        {"boundary": on(flat, [[0, 0], [100, 100], [200, 200]])},
        ["boundary: it encloses no area"],
    ),
    "off the mould": (
        lambda: SHEET,
        {"boundary": [*on(flat, CORNERS[:3]), [100.0, 800.0, 12.3], [-8.0, 400.0, 0.0]]},
        [
            "boundary: point 4 is 12.3 mm off the mould, expected at most 5",
            "boundary: point 5 is 8.0 mm off the mould, expected at most 5",
        ],
    ),
    "nothing left": (
        lambda: SHEET,
        {"boundary": on(flat, CORNERS), "inset_mm": 300},
        ["nothing is left of the boundary after an inset of 300 mm"],
    ),
    "two parts left": (
        lambda: mesh_of(sheet(X, Y, flat, (275, 325, 40, 860))),
        {"inset_mm": 45},
        [
            "boundary: the ply has 2 separate parts, near (137.5, 447.5, 0.0) and (462.5, 452.5, 0.0); "
            "make a ply of each"
        ],
    ),
    "two moulds": (
        lambda: mesh_of(np.concatenate([sheet(X, Y, flat), sheet(X + 700, Y[:-1], flat)])),
        {},
        [
            "boundary: the ply has 2 separate parts, near (300.0, 450.0, 0.0) and (1000.0, 437.5, 0.0); "
            "make a ply of each"
        ],
    ),
    "holes": (
        lambda: SHEET,
        {
            "boundary": on(flat, CORNERS),
            "holes": [
                on(flat, HOLE),
                on(flat, np.array(HOLE) + [20, 20]),
                on(flat, np.array(HOLE) - [200, 0]),
                on(flat, np.array(BOW) / 4 + 200),
            ],
        },
        [
            "hole 4: it crosses itself near (275.0, 312.5, 0.0)",
            "hole 3 is not inside the boundary",
            "holes 1 and 2 overlap",
        ],
    ),
    "seed off": (
        lambda: SHEET,
        {"seed": [300.0, 450.0, 20.0]},
        ["seed: it is 20.0 mm off the mould, expected at most 5"],
    ),
    "seed outside": (
        lambda: SHEET,
        {"seed": [50.0, 50.0, 0.0], "boundary": on(flat, CORNERS)},
        ["seed: (50.0, 50.0, 0.0) is outside the ply"],
    ),
    "rosette": (
        lambda: SHEET,
        {"rosette": [0.05, 0.0, 1.0]},
        [
            "rosette: it is 2.9 deg from the mould's normal at the seed, expected at least 5; "
            "give a direction along the mould"
        ],
    ),
    "several": (
        lambda: SHEET,
        {"boundary": on(flat, BOW), "rosette": [0.0, 0.0, 1.0], "seed": [300.0, 450.0, 4.0]},
        [
            "boundary: it crosses itself near (300.0, 450.0, 0.0)",
            "rosette: it is 0.0 deg from the mould's normal at the seed, expected at least 5; "
            "give a direction along the mould",
        ],
    ),
    "hole in the mould": (
        lambda: mesh_of(sheet(X, Y, flat, (200, 300, 300, 400))),
        {"boundary": on(flat, CORNERS)},
        [
            "the mould has no facets over 3.6 % of the ply, near (250.0, 362.5, 0.0): close the mould there, "
            "or leave it out by the boundary or a hole"
        ],
    ),
    "a wall": (
        lambda: mesh_of(sheet(X, Y, step)),
        {},
        ["the mould overhangs near (243.8, 187.5, 91.6): split the ply or choose another plane"],
    ),
    "two layers": (
        lambda: mesh_of(np.concatenate([sheet(X, Y, flat), sheet(X[:9] + 300, Y[:9], flat) + [0, 0, 50]])),
        {},
        ["the mould overhangs near (400.0, 112.5, 50.0): split the ply or choose another plane"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_ply_that_cannot_be(case: str) -> None:
    mould, values, sentences = CASES[case]
    assert refused(ply_of(**values), mould()) == sentences


def test_closed_bodies_need_a_boundary_on_one_side() -> None:
    tube = mesh_of(trimesh.creation.cylinder(250, 1000, sections=120).subdivide_to_size(80).triangles)
    (sentence,) = refused(ply_of(), tube)
    assert sentence.startswith("the mould faces all ways and overhangs near (")

    def around(angle: float) -> list[list[float]]:
        angles = np.radians([-angle, -angle / 2, 0, angle / 2, angle])
        arc = 250 * np.column_stack([np.cos(angles), np.sin(angles)])
        return [*np.insert(arc, 2, -200, axis=1).tolist(), *np.insert(arc[::-1], 2, 200, axis=1).tolist()]

    region = region_of(ply_of(boundary=around(60), rosette=[0, 0, 1]), tube, "one.toml")
    assert region.plane.normal == pytest.approx([1, 0, 0], abs=0.01)
    for angle in (84, 110, 150):
        sentence, *_ = refused(ply_of(boundary=around(angle), rosette=[0, 0, 1]), tube)
        assert sentence.startswith("the mould overhangs near ("), angle


def test_a_border_that_turns_down_is_cut_off_by_the_inset() -> None:
    def rolled(x: Floats, y: Floats) -> Floats:
        return -np.maximum(np.abs(x - 300.0) - 280.0, 0.0) * 6.0 + 0.0 * y

    mould = mesh_of(sheet(np.r_[0, np.linspace(20, 580, 15), 600], Y, rolled))
    (sentence,) = refused(ply_of(), mould)
    assert sentence.startswith("the mould overhangs near (")
    assert region_of(ply_of(inset_mm=20.1), mould, "one.toml").outline.area == pytest.approx(0.56 * 0.86, rel=2e-3)


def test_narrow_strips_without_facets_do_no_harm() -> None:
    """As where a boundary was drawn along the mould's own edge."""
    wide = np.array([[0.0, 0.0], [600.0, 0.0], [600.0, 900.0], [0.0, 900.0]])
    beyond = wide + 0.8e3 * NARROW * np.sign(wide - [300, 450])
    assert region_of(ply_of(boundary=on(flat, beyond)), SHEET, "one.toml").outline.area > 0.54


def test_a_large_mould_is_quick() -> None:
    mould = mesh_of(sheet(np.linspace(0, 600, 148), np.linspace(0, 900, 148), dome))
    begin = time.process_time()
    region_of(ply_of(inset_mm=30), mould, "one.toml")
    assert time.process_time() - begin < 2.0
