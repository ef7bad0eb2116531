"""The API's document says what there is, and its clients do what it says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup
from tapelayer.workbench.problems import CODES
from tests.helpers.paths import ROOT
from tests.helpers.served import Workbench

DOCUMENT = (ROOT / "docs" / "api.md").read_text()
EXAMPLES = ROOT / "examples"
SETUP = "[part]\nl1_mm = 310\n"
TILTED = "[process]\nkinematics = 'published'\n[verification]\nmax_roller_tilt_deg = 1\n"
TOKEN = "a-token-of-the-shop-floor"


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:
    folder = tmp_path_factory.mktemp("workbench")
    token = folder / "token"
    token.write_text(TOKEN)
    token.chmod(0o600)
    with Workbench(folder / "work", "--token-file", token, "--workers", 1) as workbench:
        yield workbench


def client_of(language: str) -> list[str]:
    """Command that runs the document's client in a language."""
    if language == "sh" and not (shutil.which("curl") and shutil.which("jq")):
        pytest.skip("the client needs curl and jq")
    code = re.search(rf"```{language}\n(.*?)```", DOCUMENT, re.DOTALL)
    assert code
    return [sys.executable, "-c", code[1]] if language == "python" else ["sh", "-c", code[1]]


def run(
    workbench: Workbench, folder: Path, language: str, courses: bytes, setup: str, token: str = TOKEN
) -> subprocess.CompletedProcess[str]:
    """What a client did in a folder with its files."""
    (folder / "panel.txt").write_bytes(courses)
    (folder / "job.toml").write_text(setup)
    (folder / "token").write_text(token + "\n")
    (folder / "headers").write_text(f"Authorization: Bearer {token}\n")
    environment = os.environ | {"TAPELAYER": workbench.url}
    command = client_of(language)
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("language", ["python", "sh"])
def test_a_client_gets_its_program(workbench: Workbench, tmp_path: Path, language: str) -> None:
    courses = (EXAMPLES / "flat_panel_00.txt").read_bytes()
    done = run(workbench, tmp_path, language, courses, SETUP)
    assert (done.returncode, done.stderr) == (0, "")
    expected = Job.of(courses, "panel.txt", parse_setup(SETUP.encode(), "job.toml", Setup)).make("panel.nc")
    assert (tmp_path / "panel.nc").read_bytes() == expected.text
    assert '"passed": true' in (tmp_path / "panel.json").read_text()
    # The client removed its job.
    assert list((workbench.work / "jobs").iterdir()) == []


@pytest.mark.parametrize("language", ["python", "sh"])
@pytest.mark.parametrize(
    ("example", "setup", "token", "sentence", "reported"),
    [
        ("cylinder_panel_15.txt", TILTED, TOKEN, "verification-failed: ", True),
        ("wing_skin_45.txt", SETUP, TOKEN, "axis-beyond-travel: course 15 point 92: axis c would be at ", False),
        ("flat_panel_00.txt", "[tape]\nwidht_mm = 1\n", TOKEN, "setup-refused: setup:2: unknown key widht_mm ", False),
        ("flat_panel_00.txt", SETUP, "another-token-altogether", "wrong-token: ", False),
    ],
    ids=["judged bad", "impossible", "bad setup", "wrong token"],
)
def test_a_client_says_what_is_wrong(
    workbench: Workbench,
    tmp_path: Path,
    language: str,
    example: str,
    setup: str,
    token: str,
    sentence: str,
    reported: bool,
) -> None:
    done = run(workbench, tmp_path, language, (EXAMPLES / example).read_bytes(), setup, token)
    assert done.returncode == 1, done.stderr
    # curl says the status first.
    assert any(line.startswith(sentence) for line in done.stderr.splitlines()), done.stderr
    assert (tmp_path / "panel.json").exists() is reported
    assert not (tmp_path / "panel.nc").exists()


def test_every_code_is_listed() -> None:
    rows = re.findall(r"^\| `([a-z-]+)` \| (\d+) \| (.*) \|$", DOCUMENT, re.MULTILINE)
    assert rows == [(code, str(kind.status), kind.title) for code, kind in CODES.items()]


def test_every_route_is_listed(workbench: Workbench) -> None:
    with workbench.client() as client:
        client.headers["Authorization"] = f"Bearer {TOKEN}"
        paths = client.get("/openapi.json").json()["paths"]
    for path in paths:
        named = re.sub(r"^/api/v1(/jobs/\{id\}(?=/))?", "", path).replace("{name}", "NAME").replace("{id}", "ID")
        assert re.search(rf"{re.escape(named)}[`? ]", DOCUMENT), path
