"""Every file of tests/faults: a command, and the exit code and the words that it must end with.

A case is a TOML file; its inputs lie in tests/faults/inputs, from which the command starts in a copy of its own:

    command = ["spray", "snan.stl"]
    exit = 2                      # 0, 1 or 2
    stderr = "..."                # the whole of it; with stderr_holds = ["...", ...] parts of it
    stdout_holds = ["..."]        # optional: parts of the standard output
    writes = ["snan.nc"]          # optional: the files that it leaves behind; none otherwise
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

FAULTS = ROOT / "tests" / "faults"
CASES = sorted(FAULTS.glob("*.toml"))
KEYS = {"command", "exit", "stderr", "stderr_holds", "stdout_holds", "writes"}


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_a_command_ends_as_its_case_says(path: Path, tmp_path: Path) -> None:
    """The code and the words are the case's, no library speaks, and nothing but what it names is left behind."""
    case = tomllib.loads(path.read_text("utf-8"))
    assert case.keys() <= KEYS
    assert {"stderr", "stderr_holds"} & case.keys(), "a case states what the user reads"
    folder = tmp_path / "here"
    shutil.copytree(FAULTS / "inputs", folder)
    before = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", *case["command"]]
    environment = os.environ | {"COLUMNS": "80", "NO_COLOR": "1", "PYTHONPATH": str(ROOT), "LANG": "C.UTF-8"}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env=environment, timeout=300, check=False
    )
    assert done.returncode == case["exit"], done.stdout + done.stderr
    for alien in ("Traceback", "Warning", ".py:"):
        assert alien not in done.stderr
    if "stderr" in case:
        assert done.stderr.rstrip("\n") == case["stderr"].rstrip("\n")
    for words in case.get("stderr_holds", ()):
        assert words in done.stderr
    for words in case.get("stdout_holds", ()):
        assert words in done.stdout
    after = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    assert after.keys() - before.keys() == set(case.get("writes", ()))
    assert {name: after.get(name) for name in before} == before
