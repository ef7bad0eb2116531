"""Tables of course files: normals, angles and steps."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.courses import table
from tests.helpers.course_files import NUMBERS


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS).filter(any), min_size=1))
def test_normals_are_made_unit_once(vectors: list[tuple[float, float, float]]) -> None:
    normals = np.array(vectors)
    units = table.unit_normals(normals)
    assert np.all(np.abs(np.linalg.norm(units, axis=1) - 1.0) <= 1e-15)
    assert np.array_equal(np.sign(units) * (units != 0), np.sign(normals) * (units != 0))
    assert table.unit_normals(units).tobytes() == units.tobytes()
