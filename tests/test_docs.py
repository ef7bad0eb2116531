"""The documents say what is there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.render_rooms import ROOMS, drawn
from tests.helpers.paths import ROOT
from tests.test_imports import FLOORS

DOCUMENTS = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])
ENDINGS = {".css", ".json", ".md", ".py", ".svg", ".toml", ".ts", ".urdf", ".yml"}
# Documents that speak of the code, and the words in them that stand for names yet to be chosen.
ON_CODE = ("CONTRIBUTING.md", "docs/extending.md", "docs/code-flow.md")
PLACEHOLDERS = frozenset({"NAME", "KEY", "ID"})
# Folders that commands make.
MADE = re.compile(r"(build|\.venv)/")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", document.read_text()):
        if not target.startswith("http"):
            assert (document.parent / target).exists(), target


def marked(document: str) -> list[str]:
    """Return what stands in backticks in a document, outside its blocks of code."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", (ROOT / document).read_text(), flags=re.DOTALL))


@pytest.mark.parametrize("document", ON_CODE)
def test_paths_in_backticks_exist(document: str) -> None:
    """A path has a slash or a known ending; one with a placeholder, or of a folder that is made, is left out."""
    words = [word for word in marked(document) if re.fullmatch(r"[\w./-]+", word) and not MADE.match(word)]
    paths = [word for word in words if "/" in word or Path(word).suffix in ENDINGS]
    paths = [path for path in paths if not PLACEHOLDERS.intersection(re.split(r"\W", path))]
    assert len(paths) > 20
    for path in paths:
        places = [ROOT / path, ROOT / "tapelayer" / path] if document == "docs/code-flow.md" else [ROOT / path]
        assert any(place.exists() for place in places), path


def changed(text: str, diff: str) -> str:
    """Return a file's text with the hunks of a diff, which begin with @@, each a run of lines that is there once."""
    for hunk in re.split(r"^@@\n", diff, flags=re.MULTILINE):
        old, new = ("".join(f"{x[1:]}\n" for x in hunk.splitlines() if x[:1] in signs) for signs in ("- ", "+ "))
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def test_the_diffs_of_extending_fit_the_code() -> None:
    text = (ROOT / "docs" / "extending.md").read_text()
    diffs = re.findall(r"^```diff\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    files = [part.partition("\n") for diff in diffs for part in re.split(r"^--- ", diff, flags=re.MULTILINE)[1:]]
    assert len(diffs) == 7
    for path, _, diff in files:
        if path != "/dev/null":
            result = changed((ROOT / path).read_text(), diff)
            assert not path.endswith(".py") or compile(result, path, "exec")


def test_the_drawing_of_the_rooms_is_in_import_order() -> None:
    """And it is what its script draws."""
    assert (ROOT / "docs" / "rooms.svg").read_text(encoding="utf-8") == drawn(), "run docs/render_rooms.py"
    floors = [[room.removeprefix("tapelayer.") for room in floor] for floor in FLOORS]
    assert [room.split(" · ") for room in ROOMS] == [floors[0], ["tapelayer"], *floors[floors.index(["geometry"]) :]]


def test_the_readmes_layout_is_what_there_is() -> None:
    layout = (ROOT / "README.md").read_text().partition("## Layout\n")[2].partition("\n\nEach package")[0]
    top, within = (re.findall(rf"^ {{{margin}}}(\w\S+)", layout, re.MULTILINE) for margin in (4, 6))
    assert set(top) == {f"{path.parent.name}/" for path in ROOT.glob("*/*.py") if path.parent.name != "build"}
    packages = {f"{path.parent.name}/" for path in (ROOT / "tapelayer").glob("*/__init__.py")}
    assert set(within) == packages


def test_the_readmes_python_runs(tmp_path: Path) -> None:
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert code
    script = code[1].replace("examples/", f"{ROOT}/examples/")
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert re.match(r"0\.0\d+ mm off the courses", done.stdout)
    assert (tmp_path / "panel.nc").read_bytes().startswith(b"%")


@pytest.mark.parametrize("document", ON_CODE)
def test_names_in_backticks_exist(document: str) -> None:
    code = "\n".join(
        path.read_text() for folder in ("tapelayer", "post", "tests") for path in (ROOT / folder).rglob("*.py")
    )
    names = [word for word in marked(document) if re.fullmatch(r"[\w.]+", word) and Path(word).suffix not in ENDINGS]
    assert len(names) > 5
    for name in names:
        last = name.rpartition(".")[2]
        assert last in PLACEHOLDERS or re.search(rf"\b{last}\b", code), name
