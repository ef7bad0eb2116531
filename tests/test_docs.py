"""The documents say what is there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

DOCUMENTS = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", document.read_text()):
        if not target.startswith("http"):
            assert (document.parent / target).exists(), target


def test_the_readmes_python_runs(tmp_path: Path) -> None:
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert code
    script = code[1].replace("examples/", f"{ROOT}/examples/")
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert re.match(r"0\.0\d+ mm off the courses", done.stdout)
    assert (tmp_path / "panel.nc").read_bytes().startswith(b"%")


def test_the_code_flow_names_things_that_exist() -> None:
    code = "\n".join(path.read_text() for package in ("tapelayer", "post") for path in (ROOT / package).rglob("*.py"))
    for name in re.findall(r"`(?:\w+\.)?(_?[A-Za-z_]\w+)`", (ROOT / "docs" / "code-flow.md").read_text()):
        assert re.search(rf"\b{name}\b", code), name
