"""Models: files of a part's or a mould's surface, STL, STEP or IGES by their bytes, to meshes."""

from __future__ import annotations

from pathlib import Path

from tapelayer.errors import MeshRefused
from tapelayer.geometry.brep import is_iges, is_step, parse_brep
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.stl import parse_stl
from tapelayer.units import Unit


def read_mesh(path: Path, unit: Unit = "mm") -> Mesh:
    """Read a mended mesh from an STL, STEP or IGES file.

    Args:
        path: the file.
        unit: unit of an STL's numbers, which it does not state; the others do.

    Raises:
        MeshRefused: the file is missing, or as `parse_mesh`.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshRefused.unreadable(str(path), error) from None
    return parse_mesh(data, str(path), unit)


def parse_mesh(data: bytes, name: str, unit: Unit = "mm") -> Mesh:
    """Return a mended mesh from the bytes of an STL, STEP or IGES file.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: unit of an STL's numbers, which it does not state; the others do.

    Raises:
        MeshRefused: as `parse_stl` and `parse_brep`.
    """
    return (parse_brep if is_step(data) or is_iges(data) else parse_stl)(data, name, unit)
