"""A smooth surface stands for every mould that has one, however few and long its facets."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.plies.job import PlyJob, PlyResult
from tapelayer.plies.ply import parse_ply
from tests.helpers.stl_files import binary

PLY = b'[mould]\nfile = "mould.stl"\n[ply]\nangle_deg = %g\n'


def planned(triangles: np.ndarray, angle: float, boundary: bytes = b"inset_mm = 60\n") -> PlyResult:
    ply = parse_ply(PLY % angle + boundary, "one.toml")
    return PlyJob.of(binary(triangles), "mould.stl", ply).make("courses.txt")


def plate() -> np.ndarray:
    """Two triangles, mm."""
    corners = np.array([[0, 0, 0], [1000, 0, 0], [1000, 800, 0], [0, 800, 0]], float)
    return corners[[[0, 1, 2], [0, 2, 3]]]


def extruded(radius: float = 1800.0, length: float = 1500.0, count: int = 60) -> np.ndarray:
    """Facets of a cylinder, each as long as it: corners along two lines of the plan alone, mm."""
    turns = np.radians(np.linspace(-20, 20, count))
    front = np.column_stack([radius * np.sin(turns), 0 * turns, radius * np.cos(turns) - radius])
    back = front + [0, length, 0]
    first = np.stack([front[:-1], front[1:], back[1:]], axis=1)
    return np.concatenate([first, np.stack([front[:-1], back[1:], back[:-1]], axis=1)])


@pytest.mark.parametrize("angle", [0.0, 20.0, 90.0, -45.0])
def test_a_plate_of_two_triangles_carries_a_ply(angle: float) -> None:
    made = planned(plate(), angle)
    assert made.failure is None
    report = made.report()
    assert report["max_gap_mm"] == pytest.approx(0.5, abs=1e-4) and report["max_strain_percent"] < 1e-6
    assert max(abs(course.points[:, 2]).max() for course in made.courses) < 1e-9


@pytest.mark.parametrize("angle", [0.0, 20.0, 90.0])
def test_an_extruded_panel_carries_a_ply(angle: float) -> None:
    made = planned(extruded(), angle)
    assert made.failure is None
    for course in made.courses:
        # Between two rows of corners 1.5 m apart the facets leave open by about their own sag where the surface is.
        off = np.hypot(course.points[:, 0], course.points[:, 2] + 1.8) - 1.8
        assert np.abs(off).max() < 0.2e-3
    assert made.report()["max_gap_mm"] == pytest.approx(0.5, abs=0.01)


def test_a_ply_as_broad_as_one_course_has_no_neighbours_and_passes() -> None:
    boundary = b"boundary = [[480, 100, 0], [540, 100, 0], [540, 700, 0], [480, 700, 0]]\n"
    made = planned(plate(), 0.0, boundary)
    assert len(made.courses) == 1
    assert made.report()["max_gap_mm"] is None
    assert made.failure is None and made.report()["passed"]
