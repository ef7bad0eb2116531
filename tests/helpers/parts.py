"""Whole parts to spray, made up: skins that are clean, and bodies with the faults that real files come with.

The real parts and courses beside the project may not be copied into it; where they are there, they are tried as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from tapelayer.arrays import Floats
from tests.helpers.panels import sheet
from tests.helpers.paths import SHARED

DUPLICATES, SLIVERS = 51, 32


def real_parts(*names: str) -> list[str]:
    """Those of the real parts that are there."""
    return [name for name in names if (SHARED / "geometry" / f"{name}.stl").is_file()]


def real_course(name: str) -> Path:
    """Path of a real course file."""
    return SHARED / "courses" / "real" / f"{name}.txt"


def real_courses(*names: str) -> list[str]:
    """Those of the real course files that are there."""
    return [name for name in names if real_course(name).is_file()]


def trimmed(triangles: Floats, keep: Callable[[Floats, Floats], Floats]) -> Floats:
    """The triangles whose middle (x, y) is one to keep."""
    x, y, _ = triangles.mean(axis=1).T
    return triangles[keep(x, y)]


def saddle() -> Floats:
    """A smooth saddle of 1 m."""
    even = np.linspace(-500, 500, 41)
    return sheet(even, even, lambda x, y: (x**2 - y**2) / 2000)


def hood() -> Floats:
    """A hood of 960 x 1160 mm with two creases along it."""
    return sheet(
        np.linspace(-483, 477, 34),
        np.linspace(-580, 580, 39),
        lambda x, y: 258 - 3.5e-4 * x**2 - 4.5e-4 * (y - 100) ** 2 - 0.1 * np.maximum(np.abs(x) - 240, 0),
    )


def fender() -> Floats:
    """A quarter of a tube, as steep as 75 deg, with a wheel arch cut out."""
    turns = np.radians(np.linspace(-75, 20, 33))
    skin = sheet(
        np.linspace(-400, 400, 33), 300 * np.sin(turns), lambda x, y: np.sqrt(300**2 - y**2) + 40 * np.cos(x / 300)
    )
    return trimmed(skin, lambda x, y: x**2 + (y + 290) ** 2 > 170**2)


def blade() -> Floats:
    """A shell of 2.4 x 1.8 m out of long thin triangles."""
    return sheet(np.linspace(1, 2400, 4), np.linspace(1, 1800, 117), lambda x, y: 60 * np.sin(y / 600) + 0.02 * x)


def wavy() -> Floats:
    """A wavy panel with a ragged border and a hole."""
    even = np.linspace(-500, 500, 31)
    skin = sheet(even, even, lambda x, y: 20 * np.sin(x / 90) * np.cos(y / 70), hole=(-120, 150, -90, 110))
    return trimmed(skin, lambda x, y: np.hypot(x, y) < 440 + 60 * np.cos(5 * np.arctan2(y, x)))


def skin_of_a_wing(chords: int = 41, spans: int = 23, side: float = 1.0) -> Floats:
    """One skin of a swept and tapered wing of 12 % thickness, steep at its leading edge."""
    chord = (1 - np.cos(np.linspace(0, np.pi, chords))) / 2

    def thickness(t: Floats, y: Floats) -> Floats:
        half = 0.2969 * np.sqrt(t) - 0.126 * t - 0.3516 * t**2 + 0.2843 * t**3 - 0.1036 * t**4
        return side * 600 * half + 0 * y

    unit = sheet(chord, np.linspace(0, 1200, spans), thickness)
    taper = 1 - unit[..., 1] / 2400
    return np.stack([1000 * taper * unit[..., 0] + 0.6 * unit[..., 1], unit[..., 1], taper * unit[..., 2]], axis=2)


def cylinder() -> Floats:
    """A closed upright cylinder."""
    shape = trimesh.creation.cylinder(radius=250, height=1000, sections=96)
    return np.asarray(shape.subdivide().subdivide().triangles, dtype=np.float64)


def split(triangles: Floats, rows: Iterable[int]) -> Floats:
    """The triangles, some of them cut at the middle of their first edge, the gap filled by one without area."""
    rows = np.array(list(rows))
    a, b, c = triangles[rows].transpose(1, 0, 2)
    middle = (a + b) / 2
    pieces = [np.stack(corners, axis=1) for corners in ((a, middle, c), (middle, b, c), (a, b, middle))]
    return np.concatenate([np.delete(triangles, rows, axis=0), *pieces])


def wing_wound_wrongly() -> Floats:
    """A wing without ribs, its lower skin wound as the upper one, with slivers in its upper skin."""
    upper, lower = skin_of_a_wing(), skin_of_a_wing(side=-1.0)
    return np.concatenate([split(upper, range(5, 1600, 50)), lower])


def aircraft() -> Floats:
    """A body over a plate with fins: edges of three facets, facets twice, slivers, and any winding."""
    chance = np.random.default_rng(23)
    body = np.asarray(trimesh.creation.icosphere(subdivisions=3).triangles) * [900, 120, 100] + [0, 0, 60]
    even = np.arange(-800.0, 801.0, 50.0)
    plate = sheet(even, even, lambda x, y: 0 * x + 0 * y)
    fins = sheet(even, np.arange(0.0, 201.0, 50.0), lambda x, y: 0 * x + 0 * y)
    upright = [np.stack([fins[..., 0], 0 * fins[..., 0] + at, fins[..., 1]], axis=2) for at in (-600, -400, 400, 600)]
    plate = split(plate, range(1, 64 * SLIVERS, 64))
    triangles = np.concatenate([body, plate, *upright])
    whole = np.flatnonzero(trimesh.triangles.area(triangles) > 0)
    triangles = np.concatenate([triangles, triangles[chance.choice(whole, DUPLICATES, replace=False)][:, [1, 2, 0]]])
    wrong = chance.random(len(triangles)) < 0.3
    triangles[wrong] = triangles[wrong, ::-1]
    return chance.permutation(triangles)


PARTS: dict[str, Callable[[], Floats]] = {
    "saddle": saddle,
    "cylinder": cylinder,
    "fender": fender,
    "hood": hood,
    "blade": blade,
    "wing_skin": skin_of_a_wing,
    "wavy_with_hole": wavy,
    "wing_wound_wrongly": wing_wound_wrongly,
    "aircraft": aircraft,
}
OPEN_SKINS = ["hood", "wavy_with_hole", "blade", "fender"]
REAL_OPEN_SKINS = real_parts("drivaer_hood", "wavy_with_hole_1m", "iea15mw_blade_skin_30m", "drivaer_front_fender")
CLEAN = ["saddle", "cylinder", "wing_skin", *OPEN_SKINS, *REAL_OPEN_SKINS]
CLEAN += real_parts("autofiber_curved_panel_1m", "cylinder_1m", "onera_m6_upper_skin")
DIRTY = ["wing_wound_wrongly", "aircraft", *real_parts("c172_wing", "yf23_2m")]


@cache
def triangles_of(name: str) -> Floats:
    """Triangles (m, 3, 3) in mm of a part that is made up."""
    return PARTS[name]()
