"""Course files: what is read is what stands there, and what cannot be read is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tapelayer.course import Course, format_courses, parse_courses, read_courses

ANALYTIC = ("boss_panel_20", "cylinder_panel_15", "flat_panel_00", "wing_skin_00", "wing_skin_45")


def assert_same(first: tuple[Course, ...], second: tuple[Course, ...]) -> None:
    """Bit for bit, the signs of zeros included."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert (one.number, one.cut_angles) == (other.number, other.cut_angles)
        for name in ("points", "normals", "arc_lengths"):
            assert np.array_equal(getattr(one, name).view(np.int64), getattr(other, name).view(np.int64)), name


@pytest.mark.parametrize("name", ANALYTIC)
def test_shared_files_make_the_round_trip(shared: Path, name: str) -> None:
    courses = read_courses(shared / "courses" / f"{name}.txt")
    text = format_courses(courses)
    again = parse_courses(text, "again")
    assert_same(again, courses)
    assert format_courses(again) == text
