from __future__ import annotations

import numpy as np
import pytest

from tapelayer.geometry.mending import Mending
from tapelayer.geometry.models import read_mesh
from tests.helpers.stl_files import TETRAHEDRON, binary, written


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
