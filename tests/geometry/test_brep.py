"""STEP and IGES files against the surfaces that they hold."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tapelayer.errors import MeshRefused
from tapelayer.geometry import brep
from tapelayer.geometry.brep import ANGLE, CHORD_MM, is_iges, is_step, parse_brep
from tapelayer.geometry.models import parse_mesh, read_mesh
from tapelayer.units import MM
from tests.helpers.brep_files import box, half_tube, occ, panel, sphere, write_iges, write_step

pytestmark = pytest.mark.skipif(brep.find_spec("OCP") is None, reason="the extra step is not installed")

FORMS: dict[str, Callable[..., bytes]] = {"step": write_step, "iges": write_iges}
MAJOR, MINOR = 4000.0, 2000.0
forms = pytest.mark.parametrize("form", FORMS)


@forms
@pytest.mark.parametrize("unit", ["MM", "INCH"])
def test_a_box_is_closed_and_of_its_size_whatever_the_unit(tmp_path: Path, form: str, unit: str) -> None:
    mesh = parse_mesh(FORMS[form](tmp_path / "box", box(100.0, 200.0, 300.0), unit), "box")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.1, 0.2, 0.3], rel=1e-9)
    assert np.sum(mesh.areas) == pytest.approx(0.22, rel=1e-9)
    assert (mesh.mending.open_edges, mesh.mending.seam_edges, len(mesh.facets)) == (0, 0, 12)
    # Facets face outward: the volume by the divergence theorem is positive.
    corners = mesh.vertices[mesh.facets]
    assert np.sum(np.linalg.det(corners)) / 6.0 == pytest.approx(0.006, rel=1e-9)
    assert (mesh.unit, mesh.name) == ("mm", "box")


@forms
def test_corners_lie_on_the_face_and_chords_near_it(tmp_path: Path, form: str) -> None:
    """On a sphere: corners at the radius, facets' middles within the chord, and no gap but at the poles."""
    radius = 60.0
    mesh = parse_mesh(FORMS[form](tmp_path / "sphere", sphere(radius)), "sphere")
    assert np.linalg.norm(mesh.vertices, axis=1) == pytest.approx(np.full(len(mesh.vertices), radius * MM), rel=1e-7)
    middles = np.linalg.norm(np.mean(mesh.vertices[mesh.facets], axis=1), axis=1)
    assert np.min(middles) >= (radius - 1.5 * CHORD_MM) * MM
    assert np.sum(mesh.areas) == pytest.approx(4.0 * math.pi * (radius * MM) ** 2, rel=1e-3)


@forms
def test_a_face_bounded_by_nothing_else_has_its_own_edges(tmp_path: Path, form: str) -> None:
    mesh = parse_mesh(FORMS[form](tmp_path / "tube", half_tube(500.0, 1000.0)), "tube")
    assert np.linalg.norm(mesh.vertices[:, 1:], axis=1) == pytest.approx(np.full(len(mesh.vertices), 0.5), rel=1e-7)
    assert np.sum(mesh.areas) == pytest.approx(math.pi / 2.0, rel=1e-4)
    turns = np.linalg.norm(mesh.normals[:, None] - mesh.normals[mesh.neighbours], axis=2)[mesh.neighbours >= 0]
    assert np.max(turns) <= ANGLE


@forms
def test_a_doubly_curved_face(tmp_path: Path, form: str) -> None:
    mesh = read_mesh(saved(tmp_path / f"panel.{form}", FORMS[form], panel(MAJOR, MINOR, 1000.0, 800.0)))
    x, y, z = mesh.vertices.T / MM
    ring = np.hypot(x, z + MAJOR + MINOR) - MAJOR
    assert np.hypot(ring, y) == pytest.approx(np.full(len(x), MINOR), abs=1e-5)


def saved(path: Path, write: Callable[[Path, Any], bytes], shape: Any) -> Path:
    write(path, shape)
    return path


def test_forms_are_known_by_their_bytes(tmp_path: Path) -> None:
    step, iges = write_step(tmp_path / "a", box(1, 1, 1)), write_iges(tmp_path / "b", box(1, 1, 1))
    assert (is_step(step), is_iges(step), is_step(iges), is_iges(iges)) == (True, False, False, True)
    assert not is_iges(b"solid S      1") and not is_step(b"") and not is_iges(b"")


@forms
def test_what_cannot_be_read_is_refused_by_a_sentence(tmp_path: Path, form: str, capfd: Any) -> None:
    whole = FORMS[form](tmp_path / "panel", panel(MAJOR, MINOR, 1000.0, 800.0))
    capfd.readouterr()
    for data in (whole[: len(whole) // 3], whole[:100]):
        with pytest.raises(MeshRefused, match=r"tool: (this (STEP|IGES) model cannot be read|no face is in this)"):
            parse_brep(data, "tool")
    assert capfd.readouterr() == ("", "")


@forms
def test_curves_are_no_surface(tmp_path: Path, form: str) -> None:
    gp = occ("gp")
    line = occ("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(gp.gp_Pnt(0, 0, 0), gp.gp_Pnt(100, 0, 0)).Edge()
    with pytest.raises(MeshRefused, match=r"tool: no face is in this (STEP|IGES) model; export its surfaces"):
        parse_brep(FORMS[form](tmp_path / "line", line), "tool")


@forms
def test_the_file_states_its_unit(tmp_path: Path, form: str) -> None:
    data = FORMS[form](tmp_path / "box", box(1, 1, 1))
    with pytest.raises(MeshRefused, match='state their own unit; leave out the unit, got "in"'):
        parse_brep(data, "tool", "in")


def test_what_reads_it_must_be_installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    data = write_step(tmp_path / "box", box(1, 1, 1))
    monkeypatch.setattr(brep, "find_spec", lambda name: None)
    with pytest.raises(
        MeshRefused, match=r"tool: what reads STEP and IGES models is not installed: pip install 'tapelayer\[step\]'"
    ):
        parse_brep(data, "tool")
