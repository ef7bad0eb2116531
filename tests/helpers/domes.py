"""A shallow dome as a mould, and plies on it."""

from __future__ import annotations

from functools import cache

import numpy as np

from tapelayer.plies.job import PlyJob, PlyResult
from tapelayer.plies.ply import parse_ply
from tests.helpers.panels import sheet, stl_bytes

RADIUS = 5000.0
# A ply that keeps every limit.
PLY = '[mould]\nfile = "dome.stl"\n[ply]\nangle_deg = 20\ninset_mm = 90\n[tape]\nwidth_mm = 50\n'
# The same with gaps that no courses on a dome have, and with a strain that they do not keep.
STRICT = f"{PLY}[gap]\nnominal_mm = 0\nlargest_mm = 0.01\n[limits]\nmax_strain_percent = 0.0001\n"


@cache
def dome() -> bytes:
    """STL of a sheet of 400 mm by 500 mm on a sphere of 5 m."""
    return stl_bytes(
        sheet(
            np.linspace(0, 400, 21),
            np.linspace(0, 500, 26),
            lambda x, y: np.sqrt(RADIUS**2 - (x - 200) ** 2 - (y - 250) ** 2) - RADIUS,
        )
    )


def job_on_dome(text: str = PLY) -> PlyJob:
    """The job of a ply file's text."""
    return PlyJob.of(dome(), "moulds/dome.stl", parse_ply(text.encode(), "plies/one.toml"), ply_name="plies/one.toml")


@cache
def planned(text: str = PLY) -> PlyResult:
    """The courses of a ply file's text."""
    return job_on_dome(text).make("courses.txt")
