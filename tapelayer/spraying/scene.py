"""Scene: the measured errors, the part and the growing coat of a spraying program, for a page to draw."""

from __future__ import annotations

import math

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.kind import Scene, SceneTable, point_table
from tapelayer.spraying.coat import Coat, growth
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.job import SprayResult
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM

MOST_COAT_SAMPLES = 20_000
COAT_MOMENTS = 64


def scene(result: SprayResult, mould: Mesh | None) -> Scene:
    """Return the scene of a result; the part is its own mould."""
    samples, coat = result.evidence.samples, result.judged.coat
    paths = [one.path for one in result.job.pass_plan.passes]
    numbers = np.array([path.number for path in paths])
    tables = {"errors": error_table(samples, numbers), "points": point_table("pass", paths)}
    if coat is not None:
        tables["coat"] = coat_table(coat, samples, result.job.setup)
    return Scene(numbers.tolist(), tables, {"part": result.job.mesh})


def error_table(samples: SpraySamples, numbers: Ints) -> SceneTable:
    """Return the measurements with the arc on; `beside_crease` is 1 where deviations are not judged.

    Args:
        samples: measured with the arc on.
        numbers: number of each pass, by index.
    """
    columns = {
        "time_s": samples.times,
        "pass": numbers[samples.passes.astype(np.int64)],
        "arc_length_mm": samples.arc_lengths / MM,
        "speed_mm_per_s": samples.speeds / MM,
        "position_error_mm": samples.position_errors / MM,
        "surface_distance_mm": samples.surface_distances / MM,
        "deviation_deg": samples.deviations / DEG,
        "beside_crease": samples.exempt,
    }
    return SceneTable(tuple(columns), np.column_stack(list(columns.values())))


def coat_table(coat: Coat, samples: SpraySamples, setup: SpraySetup) -> SceneTable:
    """Return surface samples with their thickness as the coat grows, the `times` of these moments, and the `unit`.

    Args:
        coat: what the program leaves.
        samples: measured with the arc on.
        setup: the job's values.
    """
    chosen = _spread(coat.surface.points, float(np.sum(coat.surface.areas)))
    times, thickness = growth(coat, samples, setup, chosen, COAT_MOMENTS)
    scale, unit = (1.0, "relative") if coat.relative else (1e6, "um")
    moments = tuple(f"t{number}" for number in range(COAT_MOMENTS))
    rows = np.hstack([coat.surface.points[chosen] / MM, thickness * scale])
    return SceneTable(("x_mm", "y_mm", "z_mm", *moments), rows, {"times": times.tolist(), "unit": unit})


def _spread(points: Floats, area: float) -> Mask:
    """Return a mask (m,) of at most MOST_COAT_SAMPLES points, spread evenly over a surface with an area in m^2."""
    chosen = np.ones(len(points), dtype=np.bool_)
    cell = math.sqrt(area / MOST_COAT_SAMPLES)
    while np.count_nonzero(chosen) > MOST_COAT_SAMPLES:
        _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
        chosen = np.zeros(len(points), dtype=np.bool_)
        chosen[first] = True
        cell *= 1.1
    return chosen
