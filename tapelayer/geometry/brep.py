"""Boundary representations: STEP and IGES files, bytes to meshes; no other module knows the formats.

OpenCASCADE reads them and turns their faces into facets: the extra `step`. Facets' corners lie on the faces, and shared
edges have the same corners on both sides.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.errors import InputFault, MeshRefused
from tapelayer.geometry.mending import mended
from tapelayer.geometry.mesh import Mesh
from tapelayer.units import MM, Unit

# Greatest distance of a facet from its face, mm, and angle between facets that share an edge, rad.
CHORD_MM, ANGLE = 0.02, 0.35
# Edges of two faces that are this close are one, mm: IGES files hold every face on its own.
SEWN_MM = 0.01
FARTHEST_MM = 1e6

STEP_SIGNATURE = b"ISO-10303-21"
# The 73rd character of a line of an IGES file names its section, and the first is the start section.
IGES_SECTION, IGES_LINE = 72, 80


def is_step(data: bytes) -> bool:
    """Return whether bytes begin as a STEP file (ISO 10303-21) does."""
    return data.startswith(STEP_SIGNATURE)


def is_iges(data: bytes) -> bool:
    r"""Return whether bytes begin as an IGES file (IGES 5.3, fixed length) does.

    >>> is_iges(b"made by hand".ljust(72) + b"S      1\n")
    True
    """
    line = data[: IGES_LINE + 1].rstrip(b"\r\n")
    return len(line) >= IGES_LINE and line[IGES_SECTION:IGES_LINE] in (b"S      1", b"S0000001")


def parse_brep(data: bytes, name: str, unit: Unit = "mm") -> Mesh:
    """Return the facets of all faces in the bytes of a STEP or IGES file.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: what the user says of its numbers. The file states its own unit, so this must be left at "mm".

    Raises:
        MeshRefused: OpenCASCADE is not installed or cannot read the file, another unit is asked for, or there is no
            face in it, or one far from any part.
    """
    form = "STEP" if is_step(data) else "IGES"
    if find_spec("OCP") is None:
        raise _refused(name, "what reads STEP and IGES models is not installed: pip install 'tapelayer[step]'")
    if unit != "mm":
        raise _refused(name, f'STEP and IGES models state their own unit; leave out the unit, got "{unit}"')
    shape = _sewn(_shape(data, name, form))
    corners = [_facets_of(face) for face in _faces(_meshed(shape))]
    triangles = np.concatenate([np.zeros((0, 3, 3)), *corners])
    if not len(triangles):
        raise _refused(name, f"no face is in this {form} model; export its surfaces, not only curves or points")
    far = float(np.max(np.abs(triangles)))
    if not far <= FARTHEST_MM:
        raise _refused(name, f"a face is {far:.3g} mm from the origin, expected at most {FARTHEST_MM:g} mm")
    vertices, facets, mending = mended(triangles * MM)
    return Mesh(
        vertices=vertices,
        facets=facets,
        name=Path(name).name,
        sha256=hashlib.sha256(data).hexdigest(),
        unit="mm",
        mending=mending,
    )


def _shape(data: bytes, name: str, form: str) -> Any:
    """Return all that a file holds, in millimetres."""
    message = _occ("Message")
    message.Message.DefaultMessenger_s().RemovePrinters(message.Message_Printer.get_type_descriptor_s())
    reader = getattr(_occ(f"{form}Control"), f"{form}Control_Reader")()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model"
        path.write_bytes(data)
        read = reader.ReadFile(str(path)) == _occ("IFSelect").IFSelect_RetDone
    if not read or not reader.TransferRoots():
        raise _refused(name, f"this {form} model cannot be read: it is damaged or cut short; export it again")
    return reader.OneShape()


def _sewn(shape: Any) -> Any:
    """Return a shape whose faces share the edges at which they meet."""
    sewing = _occ("BRepBuilderAPI").BRepBuilderAPI_Sewing(SEWN_MM)
    sewing.Add(shape)
    sewing.Perform()
    sewn = sewing.SewedShape()
    return shape if sewn.IsNull() else sewn


def _meshed(shape: Any) -> Any:
    """Return a shape with triangles on its faces."""
    _occ("BRepTools").BRepTools.Clean_s(shape)
    # Its other algorithm, ten times as fast, does not end on some spheres.
    _occ("BRepMesh").BRepMesh_IncrementalMesh(shape, CHORD_MM, False, ANGLE)
    return shape


def _faces(shape: Any) -> Iterator[Any]:
    """Yield the faces of a shape."""
    explorer = _occ("TopExp").TopExp_Explorer(shape, _occ("TopAbs").TopAbs_FACE)
    while explorer.More():
        yield _occ("TopoDS").TopoDS.Face(explorer.Current())
        explorer.Next()


def _facets_of(face: Any) -> Floats:
    """Return the corners (m, 3, 3) of a face's facets in mm, counterclockwise seen from its outer side."""
    place = _occ("TopLoc").TopLoc_Location()
    triangles = _occ("BRep").BRep_Tool.Triangulation_s(face, place)
    if triangles is None:
        return np.zeros((0, 3, 3))
    move = place.Transformation()
    points = (triangles.Node(i).Transformed(move) for i in range(1, triangles.NbNodes() + 1))
    nodes: Floats = np.array([(point.X(), point.Y(), point.Z()) for point in points])
    rows: Ints = np.array([triangles.Triangle(i).Get() for i in range(1, triangles.NbTriangles() + 1)]).reshape(-1, 3)
    corners: Floats = nodes[rows - 1]
    return corners[:, ::-1] if face.Orientation() == _occ("TopAbs").TopAbs_REVERSED else corners


def _occ(package: str) -> Any:
    """Return a package of OpenCASCADE, which an extra installs."""
    return import_module(f"OCP.{package}")


def _refused(name: str, message: str) -> MeshRefused:
    return MeshRefused(name, [InputFault(0, message)])
