"""STEP and IGES files for tests, made by OpenCASCADE."""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path
from typing import Any


def occ(package: str) -> Any:
    """Return a package of OpenCASCADE."""
    return import_module(f"OCP.{package}")


def box(*size: float) -> Any:
    """Return a box of a size in mm."""
    return occ("BRepPrimAPI").BRepPrimAPI_MakeBox(*size).Shape()


def sphere(radius: float) -> Any:
    """Return a sphere about the origin, mm."""
    return occ("BRepPrimAPI").BRepPrimAPI_MakeSphere(radius).Shape()


def panel(major: float, minor: float, length: float, width: float) -> Any:
    """Return a patch of a torus about the y axis, with its outer equator along x on top of it at z = 0, mm.

    Args:
        major: radius of the tube's centre, mm.
        minor: radius of the tube, mm.
        length: along x, mm.
        width: of the arc across, mm.
    """
    gp = occ("gp")
    axes = gp.gp_Ax3(gp.gp_Pnt(0, 0, -major - minor), gp.gp_Dir(0, 1, 0), gp.gp_Dir(0, 0, 1))
    torus = occ("Geom").Geom_ToroidalSurface(axes, major, minor)
    turn, tilt = length / (major + minor) / 2, width / minor / 2
    return occ("BRepBuilderAPI").BRepBuilderAPI_MakeFace(torus, -turn, turn, -tilt, tilt, 1e-6).Face()


def half_tube(radius: float, length: float) -> Any:
    """Return half the side of a cylinder about the x axis, open below, mm."""
    gp = occ("gp")
    axes = gp.gp_Ax2(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(1, 0, 0), gp.gp_Dir(0, 1, 0))
    cylinder = occ("Geom").Geom_CylindricalSurface(gp.gp_Ax3(axes), radius)
    return occ("BRepBuilderAPI").BRepBuilderAPI_MakeFace(cylinder, 0.0, math.pi, 0.0, length, 1e-6).Face()


def write_step(path: Path, shape: Any, unit: str = "MM") -> bytes:
    """Write a STEP file in a unit, and return its bytes."""
    control, interface = occ("STEPControl"), occ("Interface")
    writer = control.STEPControl_Writer()
    interface.Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(shape, control.STEPControl_AsIs)
    assert writer.Write(str(path)) == occ("IFSelect").IFSelect_RetDone
    return path.read_bytes()


def write_iges(path: Path, shape: Any, unit: str = "MM") -> bytes:
    """Write an IGES file in a unit, every face on its own, and return its bytes."""
    writer = occ("IGESControl").IGESControl_Writer(unit, 0)
    writer.AddShape(shape)
    writer.ComputeModel()
    assert writer.Write(str(path))
    return path.read_bytes()
