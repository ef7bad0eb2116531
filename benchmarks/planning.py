"""Planning against a tracer on facets: CPU seconds of each stage of a plan, and of potpourri3d on the same courses.

Two plies are planned, judged and reported: an example of a metre, and a mould of 7.9 x 10.3 m that takes 100 courses of
10 m. Then every course is traced once more from its start over its length, by this project on the smooth surface and by
potpourri3d's `GeodesicTracer` on the mould's facets. A plan asks for more: where neighbours go, how they are cut, and
whether all that is right. A tracer does not do this; the rows of the stages say what each takes.

Each time is the least CPU time of several rounds, so that other programs on the machine do not count. How far
potpourri3d's paths are from those on the smooth surface, in plan, says what facets are good for, and not how well it
traces. Needs the extra `bench`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import shapely
from rich.console import Console
from rich.table import Table

from examples.make_moulds import Grid, mesh
from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.geodesics import tangents, trace
from tapelayer.plies import failures, family, job, plan
from tapelayer.plies.facet_surface import FacetSurface, Spots
from tapelayer.plies.job import PlyJob, PlyResult
from tapelayer.plies.plan import CoursePlan
from tapelayer.units import MM

ROUNDS = 3
EXAMPLE = Path(__file__).parent.parent / "examples" / "panel_ply_0.toml"
# Of the large mould, mm: so broad that 100 courses of 75 mm lie in it, and so long that they are 10 m.
BREADTH_MM, LENGTH_MM, EDGE_MM, INSET_MM = 7900.0, 10300.0, 50.0, 150.0
LARGE_PLY = f"""[mould]
file = "large_mould.stl"
[ply]
angle_deg = 0
inset_mm = {INSET_MM:g}
[gap]
largest_mm = 5.0
"""
# The stages of a plan and the functions that they are, in the order of the table.
STAGES: dict[str, tuple[Any, str]] = {
    "fitting the surface": (plan, "fitted"),
    "family": (plan, "family_of"),
    "of that, tracing": (family, "strip_through"),
    "cuts": (plan, "pieces_of"),
    "judge": (job, "judge_courses"),
    "report's figures": (failures, "measured"),
}
WHOLE = "whole job"
PATHS, BUILT = "every course traced once", "facets made ready"
# Seconds that are asked for.
ASKED = {"example": 5.0, "large": 60.0}


@dataclass(frozen=True)
class Row:
    """What a stage took.

    Attributes:
        mould: which one.
        stage: name of the stage.
        seconds: of CPU time.
        other: the same for potpourri3d; NaN where it does not do this.
        asked: seconds that are asked for, 0 for none.
    """

    mould: str
    stage: str
    seconds: float
    other: float = math.nan
    asked: float = 0.0

    @property
    def ratio(self) -> float:
        """How many times faster than potpourri3d."""
        return self.other / self.seconds


@dataclass(frozen=True)
class Compared:
    """A plan beside potpourri3d.

    Attributes:
        mould: which one.
        facets: of the mould.
        courses: of the ply.
        length_m: of all courses.
        off_mm: largest distance in plan of potpourri3d's path from the course.
        path_error_mm: by how much half the steps move a course of this project.
        rows: of the stages.
    """

    mould: str
    facets: int
    courses: int
    length_m: float
    off_mm: float
    path_error_mm: float
    rows: tuple[Row, ...]


def large_panel(u: Grid, v: Grid) -> Grid:
    """Return points (n, n, 3) in mm of a panel bent by 60 m one way and by 90 m the other, with shallow waves.

    Args:
        u: shares (n, n) of its breadth.
        v: shares (n, n) of its length.
    """
    x, y = BREADTH_MM * (u - 0.5), LENGTH_MM * (v - 0.5)
    waves = 6.0 * np.sin(x / 900.0) * np.cos(y / 1100.0)
    return np.stack([x, y, waves - x**2 / 120000.0 - y**2 / 180000.0], axis=2)


def write_large_ply(folder: Path) -> Path:
    """Write the large mould and its ply into a folder, and return the ply's path."""
    counts = [round(size / EDGE_MM) + 1 for size in (BREADTH_MM, LENGTH_MM)]
    u, v = np.meshgrid(*(np.linspace(0.0, 1.0, count) for count in counts))
    (folder / "large_mould.stl").write_bytes(mesh(large_panel(u, v)).export(file_type="stl"))
    path = folder / "large_ply.toml"
    path.write_text(LARGE_PLY)
    return path


def clocked_job(path: Path) -> tuple[PlyResult, dict[str, float]]:
    """Plan a ply as `tapelayer plan` does, and return its courses with the CPU seconds of every stage."""
    spent: dict[str, float] = defaultdict(float)

    def clocked(stage: str, run: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*values: Any) -> Any:
            begin = time.process_time()
            made = run(*values)
            spent[stage] += time.process_time() - begin
            return made

        return timed

    with ExitStack() as patched:
        for stage, (module, name) in STAGES.items():
            patched.enter_context(patch.object(module, name, clocked(stage, getattr(module, name))))
        begin = time.process_time()
        made = PlyJob.read(path).make("courses.txt")
        made.report()
        spent[WHOLE] = time.process_time() - begin
    return made, spent


def paths_of(planned: CoursePlan) -> Iterator[tuple[Floats, Floats]]:
    """Yield the first state (4,) of every course, and the arc lengths (n,) of its samples from there, metres."""
    for piece in planned.pieces:
        strip = planned.family.strips[piece.strip]
        rows = np.flatnonzero((strip.arcs >= piece.start.offset) & (strip.arcs <= piece.end.offset))
        yield strip.states[rows[0]], strip.arcs[rows] - strip.arcs[rows[0]]


def traced_on_facets(tracer: Any, starts: Spots, tangents: Floats, lengths: Floats) -> list[Floats]:
    """Return potpourri3d's paths (n, 3) from places on facets, along tangents (m, 3) and over lengths (m,), metres."""
    return [
        tracer.trace_geodesic_from_face(int(facet), shares, tangent * length)
        for facet, shares, tangent, length in zip(starts.facets, starts.shares, tangents, lengths, strict=True)
    ]


def tracer_of(vertices: Floats, facets: Ints) -> Any:
    """Return potpourri3d's tracer of a mesh."""
    import potpourri3d

    return potpourri3d.GeodesicTracer(vertices, facets)


def seconds(rounds: int, run: Callable[[], Any]) -> float:
    """Return the least CPU time of a run."""
    best = math.inf
    for _ in range(rounds):
        begin = time.process_time()
        run()
        best = min(best, time.process_time() - begin)
    return best


def compared(mould: str, path: Path, rounds: int) -> Compared:
    """Plan a ply, trace its courses both ways, and return what that took."""
    runs = [clocked_job(path) for _ in range(rounds)]
    made, spent = runs[-1][0], {name: min(times[name] for _, times in runs) for name in (*STAGES, WHOLE)}
    planned = made.evidence.plan
    field, region = planned.mould.field, planned.region
    rows = [Row(mould, name, spent[name]) for name in STAGES]
    rows.append(Row(mould, WHOLE, spent[WHOLE], asked=ASKED.get(mould, 0.0)))

    surface = FacetSurface.of(region.plane.into(region.mould.vertices), region.mould.facets[region.facets])
    begun = list(paths_of(planned))
    states = np.stack([state for state, _ in begun])
    starts, ahead = surface.spots(states[:, :2]), tangents(field, states)
    lengths = np.array([arcs[-1] for _, arcs in begun])
    build = partial(tracer_of, surface.vertices, surface.facets)
    rows.append(Row(mould, BUILT, spent["fitting the surface"], seconds(rounds, build)))
    on_facets = partial(traced_on_facets, build(), starts, ahead, lengths)
    own = seconds(rounds, lambda: [trace(field, state, arcs) for state, arcs in begun])
    rows.append(Row(mould, PATHS, own, seconds(rounds, on_facets)))
    ours = [trace(field, state, arcs)[:, :2] for state, arcs in begun]
    off = [
        float(np.max(shapely.distance(shapely.points(plan), shapely.linestrings(path[:, :2]))))
        for plan, path in zip(ours, on_facets(), strict=True)
    ]
    return Compared(
        mould=mould,
        facets=len(surface.facets),
        courses=len(planned.courses),
        length_m=made.evidence.laid_length,
        off_mm=max(off) / MM,
        path_error_mm=planned.path_error / MM,
        rows=tuple(rows),
    )


def table(one: Compared) -> Table:
    """Return the rows of a mould as a table for a terminal."""
    made = Table(
        title=f"{one.mould}: {one.courses} courses, {one.length_m:.1f} m, on {one.facets:,} triangles; CPU seconds"
    )
    for heading in ("stage", "tapelayer", "potpourri3d", "ratio", "asked"):
        made.add_column(heading, justify="left" if heading == "stage" else "right", no_wrap=True)
    for row in one.rows:
        known = not math.isnan(row.other)
        other, ratio = (f"{row.other:.3f}", f"{row.ratio:.3g}") if known else ("", "")
        made.add_row(row.stage, f"{row.seconds:.3f}", other, ratio, f"{row.asked:g}" if row.asked else "")
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; return 1 if a plan takes longer than is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("plies", type=Path, nargs="*", help="ply files to plan in place of these two")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="rounds of which the best counts")
    parser.add_argument("--json", action="store_true", help="print JSON in place of tables")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        plies = [(path.stem, path) for path in options.plies]
        plies = plies or [("example", EXAMPLE), ("large", write_large_ply(Path(folder)))]
        everything = [compared(mould, path, options.rounds) for mould, path in plies]
    if options.json:
        print(json.dumps([asdict(one) for one in everything], indent=2))
    else:
        console = Console(width=120)
        for one in everything:
            console.print(table(one))
            console.print(
                f"potpourri3d's paths on the facets are up to {one.off_mm:.3f} mm off the smooth surface's; half the "
                f"steps move those by {one.path_error_mm:.6f} mm",
                highlight=False,
            )
    rows = [row for one in everything for row in one.rows]
    return 0 if all(not row.asked or row.seconds <= row.asked for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
