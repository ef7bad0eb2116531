"""Slicing against other slicers: chained curves of 500 planes through the same mesh, in the same run.

Every slicer starts from the arrays of vertices and facets, builds its own structures, and ends with the points of its
chained curves in NumPy arrays: trimesh by section_multiplane, VTK by its cutter and stripper, meshlib by
extractPlaneSections. The best round of each counts. Needs the extra `bench`.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable

import numpy as np
import trimesh
import vtk
from meshlib import mrmeshnumpy, mrmeshpy
from rich.console import Console
from rich.table import Table
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry import slicing
from tapelayer.geometry.mending import Mending
from tapelayer.geometry.mesh import Mesh

PLANES = 500
ROUNDS = 3
DIRECTION = np.array([0.6, 0.8, 0.0])
LEAST_RATIOS = {"trimesh": 25, "VTK": 15, "meshlib": 3}
MEMORY_LIMIT_GB = 3.0


def bumpy_sphere(sectors: int, rings: int) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) in metres and 2 sectors (rings - 1) facets (m, 3) of a closed, bumpy ball of radius 1."""
    latitudes = np.pi * np.arange(1, rings)[:, None] / rings
    longitudes = 2 * np.pi * np.arange(sectors) / sectors
    radii = 1 + 0.05 * np.sin(7 * latitudes) * np.cos(5 * longitudes)
    around = [radii * np.sin(latitudes) * np.cos(longitudes), radii * np.sin(latitudes) * np.sin(longitudes)]
    wall = np.stack([*around, radii * np.cos(latitudes)], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([wall, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    here = np.arange(sectors)
    beside = (here + 1) % sectors
    first = sectors * np.arange(rings - 2)[:, None]
    a, b, c, d = (
        rows.ravel() for rows in (first + here, first + beside, first + sectors + here, first + sectors + beside)
    )
    top, bottom = np.full(sectors, len(wall)), np.full(sectors, len(wall) + 1)
    last = sectors * (rings - 2)
    triples = [(a, c, b), (b, c, d), (top, here, beside), (bottom, last + beside, last + here)]
    return vertices, np.concatenate([np.stack(triple, axis=1) for triple in triples])


def ours(vertices: Floats, facets: Ints, heights: Floats) -> list[Floats]:
    """Return the curves of this project, which also gives the facet of every segment."""
    mesh = Mesh(vertices, facets, name="", sha256="", unit="m", mending=Mending(len(facets)))
    sections = slicing.slice(mesh, DIRECTION, heights)
    return np.split(sections.points, sections.offsets[1:-1])


def by_trimesh(vertices: Floats, facets: Ints, heights: Floats) -> list[Floats]:
    """Return the curves of trimesh, in the coordinates of each plane."""
    mesh = trimesh.Trimesh(vertices, facets, process=False)
    paths = mesh.section_multiplane(np.zeros(3), DIRECTION, heights)
    return [path.vertices[entity.points] for path in paths if path is not None for entity in path.entities]


def by_vtk(vertices: Floats, facets: Ints, heights: Floats) -> list[Floats]:
    """Return the curves of VTK's cutter, joined by its stripper."""
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(vertices))
    cells = vtk.vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(facets.ravel()))
    surface = vtk.vtkPolyData()
    surface.SetPoints(points)
    surface.SetPolys(cells)
    plane = vtk.vtkPlane()
    plane.SetNormal(*DIRECTION)
    cutter = vtk.vtkCutter()
    cutter.SetCutFunction(plane)
    cutter.SetInputData(surface)
    for index, height in enumerate(heights):
        cutter.SetValue(index, height)
    stripper = vtk.vtkStripper()
    stripper.SetInputConnection(cutter.GetOutputPort())
    stripper.SetMaximumLength(10**9)
    stripper.Update()
    output = stripper.GetOutput()
    places = vtk_to_numpy(output.GetPoints().GetData())
    order = vtk_to_numpy(output.GetLines().GetConnectivityArray())
    offsets = vtk_to_numpy(output.GetLines().GetOffsetsArray())
    return np.split(places[order], offsets[1:-1])


def by_meshlib(vertices: Floats, facets: Ints, heights: Floats) -> list[Floats]:
    """Return the curves of meshlib, plane by plane (single precision)."""
    mesh = mrmeshnumpy.meshFromFacesVerts(facets.astype(np.int32), vertices)
    part, normal = mrmeshpy.MeshPart(mesh), mrmeshpy.Vector3f(*DIRECTION)
    curves = []
    for height in heights:
        paths = mrmeshpy.extractPlaneSections(part, mrmeshpy.Plane3f(normal, float(height)))
        curves += [mrmeshnumpy.toNumpyArray(curve) for curve in mrmeshpy.surfacePathsToContours3f(mesh, paths)]
    return curves


SLICERS: dict[str, Callable[[Floats, Ints, Floats], list[Floats]]] = {
    "tapelayer": ours,
    "trimesh": by_trimesh,
    "VTK": by_vtk,
    "meshlib": by_meshlib,
}


def planes_through(vertices: Floats) -> Floats:
    """Return the heights (p,) in metres of planes spread over a body, none through a vertex."""
    altitudes = np.sort(vertices @ DIRECTION)
    return np.linspace(altitudes[0], altitudes[-1], PLANES + 2)[1:-1] + 1e-7


def length(curves: list[Floats]) -> float:
    """Return the total length in metres."""
    return sum(float(np.sum(np.linalg.norm(np.diff(curve, axis=0), axis=1))) for curve in curves)


def peak_memory_gb() -> float:
    """Return the peak memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e9 if sys.platform == "darwin" else peak / 1e6


def compared(vertices: Floats, facets: Ints) -> tuple[Table, bool]:
    """Return a table of all slicers on one mesh, and whether every ratio is reached with the same total length."""
    heights = planes_through(vertices)
    seconds, lengths, counts = dict.fromkeys(SLICERS, np.inf), dict.fromkeys(SLICERS, 0.0), dict.fromkeys(SLICERS, 0)
    for _ in range(ROUNDS):
        for name, slicer in SLICERS.items():
            begin = time.perf_counter()
            curves = slicer(vertices, facets, heights)
            seconds[name] = min(seconds[name], time.perf_counter() - begin)
            lengths[name], counts[name] = length(curves), len(curves)
    table = Table("slicer", title=f"{PLANES} planes through {len(facets):,} triangles")
    for heading in ("s", "tapelayer faster", "at least", "curves", "length m"):
        table.add_column(heading, justify="right")
    table.add_row(
        "tapelayer", f"{seconds['tapelayer']:.3f}", "", "", str(counts["tapelayer"]), f"{lengths['tapelayer']:.4f}"
    )
    reached = True
    for name, least in LEAST_RATIOS.items():
        ratio = seconds[name] / seconds["tapelayer"]
        numbers = (f"{seconds[name]:.3f}", f"{ratio:.1f}x", f"{least}x", str(counts[name]), f"{lengths[name]:.4f}")
        table.add_row(name, *numbers)
        # meshlib computes in single precision.
        reached &= ratio >= least and abs(lengths[name] / lengths["tapelayer"] - 1) < 1e-6
    return table, reached


def main() -> int:
    """Print the tables; return 1 if a ratio or the memory limit is missed."""
    console = Console()
    meshes = [bumpy_sphere(sectors=250, rings=401), bumpy_sphere(sectors=1000, rings=1001)]
    vertices, facets = meshes[-1]
    ours(vertices, facets, planes_through(vertices))
    memory = peak_memory_gb()
    reached = memory < MEMORY_LIMIT_GB
    for vertices, facets in meshes:
        table, all_reached = compared(vertices, facets)
        reached &= all_reached
        console.print(table)
    console.print(f"peak memory of tapelayer: {memory:.2f} GB, at most {MEMORY_LIMIT_GB:g} GB")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
