"""Surveying: what a mould, a boundary's file and a ply are before anything is planned, from uploads to JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import BaseModel, Field
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from tapelayer.arrays import Floats
from tapelayer.geometry.models import parse_mesh
from tapelayer.geometry.rings import rings
from tapelayer.plies.boundary import parse_boundary
from tapelayer.plies.ply import Ply
from tapelayer.plies.region import Region, region_of
from tapelayer.setups.forms import NAME
from tapelayer.setups.sections import parse_setup
from tapelayer.units import METRES, MM, Unit
from tapelayer.workbench.scene import simplified

Survey = Literal["mould", "boundary", "region"]

# Sides of what courses are planned on, from the least to the largest that is likely, metres.
LIKELY = (0.1, 30.0)
# Decimals of millimetres, and of unit vectors.
LENGTH_DECIMALS, VECTOR_DECIMALS = 4, 9
# Largest distance of the points of a region's rings, so that they lie on the mould where it is curved, metres.
RING_STEP = 10.0 * MM

Point = Annotated[list[float], Field(min_length=3, max_length=3)]


class EdgeTold(BaseModel):
    """A closed line along which a mould ends."""

    points_mm: Annotated[list[Point], Field(description="as its facets run; the first one is not repeated")]
    length_mm: float


class MouldTold(BaseModel):
    """A mould, to be looked at before a ply is planned on it; lengths in the frame of its file."""

    name: str
    sha256: str
    unit: Annotated[Unit, Field(description="in which its numbers were read")]
    unit_guess: Annotated[Unit, Field(description="the unit in which it would be of a likely size; `unit` where it is")]
    size_mm: Point
    lower_mm: Annotated[Point, Field(description="corner of its box")]
    upper_mm: Annotated[Point, Field(description="likewise")]
    area_m2: float
    facets: Annotated[int, Field(description="of the file")]
    vertices_mm: Annotated[list[Point], Field(description="of the surface to draw, which is simplified if it is large")]
    triangles: Annotated[list[list[int]], Field(description="corners of each facet, from 0 among the vertices")]
    edges: Annotated[list[EdgeTold], Field(description="the longest first; of more than 100, the longest 100")]


class BoundaryTold(BaseModel):
    """The closed lines in a boundary's file, which no first point is repeated in."""

    name: str
    points_mm: Annotated[list[Point], Field(description="of the line around the largest area")]
    holes_mm: Annotated[list[list[Point]], Field(description="of the others")]


class RegionTold(BaseModel):
    """What a ply covers on its mould; lengths in the mould's frame."""

    area_m2: Annotated[float, Field(description="in the ply's plane")]
    rings_mm: Annotated[
        list[list[Point]], Field(description="its boundary after the inset, then its holes, over the mould; closed")
    ]
    seed_mm: Annotated[Point, Field(description="where the first course has the ply's angle")]
    normal: Annotated[Point, Field(description="of the ply's plane, outwards; a unit vector")]
    rosette: Annotated[Point, Field(description="along the ply's plane; a unit vector")]
    direction: Annotated[Point, Field(description="of the courses, along the ply's plane; a unit vector")]


def survey(request: Mapping[str, Any], folder: Path) -> bytes:
    """Return the answer to a request in a folder, as JSON.

    Args:
        request: its kind, a `Survey`, and `name` and `unit` of the file.
        folder: with the `file`, and the `setup.toml` of a ply.

    Raises:
        MeshRefused: the mould cannot be used.
        PlyRefused: the boundary's file or the ply cannot be used.
    """
    surveyed = SURVEYS[request["kind"]]((folder / "file").read_bytes(), request, folder)
    return surveyed.model_dump_json().encode()


def _mould(data: bytes, request: Mapping[str, Any], folder: Path) -> MouldTold:
    unit: Unit = request["unit"]
    mesh = parse_mesh(data, request["name"], unit)
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    vertices, facets = simplified(mesh)
    return MouldTold(
        name=request["name"],
        sha256=mesh.sha256,
        unit=unit,
        unit_guess=likely_unit(float(np.max(upper - lower)), unit),
        size_mm=_point(upper - lower),
        lower_mm=_point(lower),
        upper_mm=_point(upper),
        area_m2=round(float(mesh.areas.sum()), 6),
        facets=len(mesh.facets),
        vertices_mm=_points(vertices),
        triangles=facets.tolist(),
        edges=[
            EdgeTold(points_mm=_points(ring), length_mm=round(_around(ring) / MM, LENGTH_DECIMALS))
            for ring in rings(mesh)
        ],
    )


def _boundary(data: bytes, request: Mapping[str, Any], folder: Path) -> BoundaryTold:
    outer, *holes = parse_boundary(data, request["name"], request["unit"])
    return BoundaryTold(
        name=request["name"], points_mm=_points(outer.points), holes_mm=[_points(hole.points) for hole in holes]
    )


def _region(data: bytes, request: Mapping[str, Any], folder: Path) -> RegionTold:
    # The name of a boundary's file is relative to this folder.
    parts = folder / "parts"
    ply = parse_setup((folder / NAME).read_bytes(), str(parts / NAME), Ply)
    mesh = parse_mesh(data, request["name"], ply.mould.unit)
    region = region_of(ply, mesh, NAME)
    up = np.array([[0.0, 0.0, 1.0]])
    rosette = region.plane.turned_into(region.rosette[None])
    rosette[:, 2] = 0.0
    outline = [region.outline.exterior, *region.outline.interiors]
    return RegionTold(
        area_m2=round(region.outline.area, 6),
        rings_mm=[_points(_over(region, shapely.get_coordinates(ring.segmentize(RING_STEP))[:-1])) for ring in outline],
        seed_mm=_point(_over(region, region.seed[None])[0]),
        normal=_vector(region.plane.normal),
        rosette=_vector(region.plane.turned_out_of(rosette / np.linalg.norm(rosette))[0]),
        direction=_vector(region.plane.turned_out_of(region.headings(up))[0]),
    )


SURVEYS: dict[Survey, Callable[[bytes, Mapping[str, Any], Path], BaseModel]] = {
    "mould": _mould,
    "boundary": _boundary,
    "region": _region,
}


def likely_unit(largest: float, unit: Unit) -> Unit:
    """Return the unit in which a mould would be of a likely size: that in which it was read, if it is.

    Args:
        largest: side of its box as it was read, metres.
        unit: in which it was read.

    Examples:
        >>> likely_unit(1.2, "mm"), likely_unit(0.0012, "mm"), likely_unit(1200.0, "m")
        ('mm', 'm', 'mm')
    """
    lower, upper = LIKELY
    units: tuple[Unit, ...] = (unit, "mm", "m", "in", "cm")
    sizes = {other: largest * METRES[other] / METRES[unit] for other in units}
    return next((other for other, size in sizes.items() if lower <= size <= upper), unit)


def _over(region: Region, plan: Floats) -> Floats:
    """Return the points (n, 3) of the mould over plan points (n, 2), about as it is drawn, in its frame in metres."""
    corners = region.plane.into(region.mould.vertices[np.unique(region.mould.facets[region.facets])])
    heights = LinearNDInterpolator(corners[:, :2], corners[:, 2])(plan)
    beyond = np.isnan(heights)
    if np.any(beyond):
        heights[beyond] = NearestNDInterpolator(corners[:, :2], corners[:, 2])(plan[beyond])
    return region.plane.out_of(np.column_stack([plan, heights]))


def _around(ring: Floats) -> float:
    """Return the length of a closed line (n, 3)."""
    return float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum())


def _points(points: Floats) -> list[list[float]]:
    """Return points (n, 3) in metres as rows in mm."""
    rows: list[list[float]] = (np.round(points / MM, LENGTH_DECIMALS) + 0.0).tolist()
    return rows


def _point(point: Floats) -> list[float]:
    return _points(point[None])[0]


def _vector(vector: Floats) -> list[float]:
    values: list[float] = (np.round(vector, VECTOR_DECIMALS) + 0.0).tolist()
    return values
