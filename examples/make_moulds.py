"""Two moulds to plan plies on, as STL files: a doubly curved panel, and a wing's skin with a taper.

    python examples/make_moulds.py FOLDER

The moulds of this folder were made by it. Each is a grid of facets of about 25 mm over its outline in plan.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

Grid = NDArray[np.float64]
EDGE_MM = 25.0


def panel(u: Grid, v: Grid) -> Grid:
    """Return points (n, n, 3) in mm of a panel of 1000 x 1300 that is curved by 6 m one way and by 9 m the other.

    Args:
        u: shares (n, n) of its breadth.
        v: shares (n, n) of its length.
    """
    x, y = 1000.0 * (u - 0.5), 1300.0 * (v - 0.5)
    return np.stack([x, y, -(x**2) / 12000.0 - y**2 / 18000.0], axis=2)


def wing(u: Grid, v: Grid) -> Grid:
    """Return points (n, n, 3) in mm of the skin between the spars of a wing 1600 long, whose chord tapers.

    Args:
        u: shares (n, n) of the chord, from the front spar to the rear one.
        v: shares (n, n) of the span, from the root to the tip.
    """
    chord, y = 1100.0 - 350.0 * v, 1600.0 * (v - 0.5)
    x = chord * (u - 0.45)
    # Flatter towards the rear spar, and thinner with the chord; the tip bends up a little.
    arch = chord * 0.09 * (1.0 - (1.6 * (u - 0.35)) ** 2)
    return np.stack([x, y, arch + 25.0 * v**2], axis=2)


def mesh(points: Grid) -> trimesh.Trimesh:
    """Return the facets between points (m, n, 3) of a grid, upward side outwards."""
    rows, columns = points.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up = first + 1, first + columns
    facets = np.concatenate([np.column_stack([first, right, up + 1]), np.column_stack([first, up + 1, up])])
    return trimesh.Trimesh(points.reshape(-1, 3), facets, process=False)


def main(folder: str = ".") -> None:
    """Write both moulds into a folder."""
    for name, shape, breadth, length in (("panel_mould", panel, 1000.0, 1300.0), ("wing_mould", wing, 1100.0, 1600.0)):
        counts = (round(size / EDGE_MM) + 1 for size in (breadth, length))
        u, v = np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in counts))
        path = Path(folder) / f"{name}.stl"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(mesh(shape(u, v)).export(file_type="stl"))
        print(f"{path}: {2 * (u.shape[0] - 1) * (u.shape[1] - 1)} facets")


if __name__ == "__main__":
    main(*sys.argv[1:])
