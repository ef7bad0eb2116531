"""The example plies are planned on the example moulds, judged, and laid by programs that pass."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tapelayer import Setup
from tapelayer.laying.job import Job
from tapelayer.plies.job import PlyJob
from tests.helpers.paths import EXAMPLES

PLIES = sorted(EXAMPLES.glob("*_ply_*.toml"))


def test_the_moulds_are_those_that_the_script_makes(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(EXAMPLES / "make_moulds.py"), str(tmp_path)], check=True, capture_output=True)
    for made in tmp_path.glob("*.stl"):
        assert made.read_bytes() == (EXAMPLES / made.name).read_bytes()


def test_there_are_four_plies_on_each_mould() -> None:
    angles = {(path.stem.partition("_")[0], PlyJob.read(path).ply.ply.angle_deg) for path in PLIES}
    assert angles == {(mould, angle) for mould in ("panel", "wing") for angle in (0, 45, -45, 90)}


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in ("panel_ply_0", "wing_ply_45") else pytest.mark.slow)
        for path in PLIES
    ],
)
def test_an_example_ply_is_planned_judged_and_laid(path: Path) -> None:
    made = PlyJob.read(path).make("courses.txt")
    assert made.failure is None and made.report()["passed"]
    setup = Setup().with_values("part", l1_mm=1250.0, l2_mm=-1000.0, l3_mm=1400.0)
    setup = setup.with_values(
        "machine", limits_mm={"x": [-500, 3000], "y": [-500, 2500]}, limits_deg={"c": [-120, 120]}
    )
    assert Job.of(made.text, "courses.txt", setup).make("panel.nc").failure is None
