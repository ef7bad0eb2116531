"""The examples run from a fresh clone, and say what they show."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.helpers.paths import EXAMPLES, ROOT

# A line that each script prints, and the files that it leaves in the folder that it is given.
SHOWN = {
    "compare_kinematics": (r"max_roller_tilt_deg +0\.00\d\d +5\.\d{4}", set()),
    "drive_http": (r"cylinder_panel_15\.txt: done, \d+ blocks", {"panel.nc"}),
    "export_courses": (r"17 courses, \d+ blocks, \d+ s", {"panel.nc", "panel.json", "panel.html"}),
    "forward_inverse": (r"batch evaluator against Pinocchio: \d\.\de-1[4-9]", {"angles.svg"}),
    "make_moulds": (r".*panel_mould\.stl: 4160 facets", {"panel_mould.stl", "wing_mould.stl"}),
    "own_controller": (r"controller mill: passed", {"mill.toml", "flat.nc"}),
    "setup_sweep": (r" +150 +500 +\d+\.\d +\d+ +0\.\d\d$", set()),
    "spray_part": (
        r"pitch 25 mm: 13 passes, .* coverage 100\.0 %",
        {"panel_25.nc", "panel_25.html", "panel_40.nc", "panel_40.html"},
    ),
    "verify_edited": (r"line \d+: course 1 point \d+: position_error_mm is 0\.\d+, limit 0\.05", {"edited.nc"}),
}


def test_every_script_is_run() -> None:
    assert {path.stem for path in EXAMPLES.glob("[!_]*.py")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    if name == "drive_http" and find_spec("fastapi") is None:
        pytest.skip("the extra workbench is not installed")
    line, files = SHOWN[name]
    command = [sys.executable, "-W", "error", str(EXAMPLES / f"{name}.py"), str(tmp_path / "made")]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert re.search(f"^{line}", done.stdout, re.MULTILINE), done.stdout
    assert {path.name for path in tmp_path.rglob("*.*")} == files
