"""The page: its texts in both languages, what it loads, and that the built files are what the source builds."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest

from post import controllers
from tapelayer.jobs.kinds import NAMES, kind_of
from tapelayer.workbench.catalogue import EXAMPLES
from tapelayer.workbench.problems import CODES
from tapelayer.workbench.record import State
from tests.helpers.paths import ROOT

WORKBENCH = ROOT / "tapelayer" / "workbench"
CLIENT = WORKBENCH / "client"
STATIC = WORKBENCH / "static"
LANGUAGES = ("en", "zh")
SOURCES = sorted((CLIENT / "src").rglob("*.ts"))
# A text by its key: t("key"), say(element, "key"), h(..., { t: "key" }); keys made up at run time have other quotes.
KEY = re.compile(r"""(?:\bt\(|\bsay\([^,()]+,\s*|\bt(?:Title|Label|Placeholder)?:\s*)"([^"]+)"(?=\s*[,)}])""")
PLACE = re.compile(r"\{(\w+)\}")
ADDRESS = re.compile(r"(?:https?:)?//[\w.-]+", re.IGNORECASE)


def texts(language: str) -> dict[str, str]:
    found: dict[str, str] = json.loads((CLIENT / "src" / "locales" / f"{language}.json").read_text(encoding="utf-8"))
    return found


def fields(kind: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Section, key and schema of every field of a setup, references resolved."""
    schema = kind_of(kind).setup.model_json_schema()

    def resolved(value: dict[str, Any]) -> dict[str, Any]:
        return schema["$defs"][value["$ref"].rsplit("/", 1)[1]] | value if "$ref" in value else value

    for section, reference in schema["properties"].items():
        for key, value in resolved(reference)["properties"].items():
            yield section, key, resolved(value)


def test_languages_have_the_same_keys_and_places() -> None:
    english, chinese = texts("en"), texts("zh")
    assert list(english) == list(chinese)
    for key, text in english.items():
        assert text.strip() and chinese[key].strip(), key
        assert sorted(PLACE.findall(text)) == sorted(PLACE.findall(chinese[key])), key


def test_no_key_is_there_twice() -> None:
    for language in LANGUAGES:
        text = (CLIENT / "src" / "locales" / f"{language}.json").read_text(encoding="utf-8")
        keys = [key for key, _ in json.loads(text, object_pairs_hook=lambda pairs: pairs)]
        assert sorted(keys) == sorted(set(keys))


@pytest.mark.parametrize("kind", NAMES)
def test_every_field_has_a_name_and_a_description(kind: str) -> None:
    english = texts("en")
    for section, key, schema in fields(kind):
        name = f"setup.{kind}.{section}.{key}"
        assert f"setup.{kind}.{section}" in english
        assert name in english
        assert english[f"{name}.about"] == schema["description"]
        for option in schema.get("enum", ()):
            assert f"option.{option}" in english
        for member in schema.get("properties", ()):
            assert f"member.{member}" in english


def test_no_field_is_described_that_is_not_there() -> None:
    there = {f"setup.{kind}.{section}.{key}" for kind in NAMES for section, key, _ in fields(kind)}
    pattern = re.compile(rf"setup\.({'|'.join(NAMES)})\.\w+\.\w+.*")
    described = {key.removesuffix(".about") for key in texts("en") if pattern.fullmatch(key)}
    assert described == there


def test_every_problem_has_the_title_of_the_server() -> None:
    english = texts("en")
    assert {code: english.get(f"problem.{code}") for code in CODES} == {
        code: kind.title for code, kind in CODES.items()
    }


def test_every_example_has_the_title_of_the_server() -> None:
    english = texts("en")
    assert [english.get(f"example.{one.name}") for one in EXAMPLES] == [one.title for one in EXAMPLES]


def test_every_controller_has_the_title_of_its_table() -> None:
    english = texts("en")
    titles = {name: controllers.load(name).title for name in controllers.names()}
    assert {name: english.get(f"controller.{name}") for name in titles} == titles


def test_every_state_has_a_text() -> None:
    english = texts("en")
    names = {f"state.{state}" for state in get_args(State)}
    assert names and names <= set(english)


def test_every_key_of_the_source_has_a_text() -> None:
    english = texts("en")
    used = {(source.name, key) for source in SOURCES for key in KEY.findall(source.read_text(encoding="utf-8"))}
    assert len(used) > 50
    assert {(name, key) for name, key in used if key not in english} == set()


def test_lock_file_names_no_registry() -> None:
    lock = json.loads((CLIENT / "package-lock.json").read_text(encoding="utf-8"))
    entries = {name: entry for name, entry in lock["packages"].items() if name}
    assert entries
    for name, entry in entries.items():
        assert "resolved" not in entry, name
        assert entry["integrity"].startswith("sha512-"), name


def test_packages_have_exact_versions() -> None:
    package = json.loads((CLIENT / "package.json").read_text(encoding="utf-8"))
    for versions in (package["dependencies"], package["devDependencies"]):
        for name, version in versions.items():
            assert re.fullmatch(r"\d+\.\d+\.\d+", version), name


@pytest.mark.parametrize("page", [CLIENT / "index.html", STATIC / "index.html"], ids=["source", "built"])
def test_page_loads_nothing_from_elsewhere_and_has_no_inline_script(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not ADDRESS.search(text)
    for opening, content in re.findall(r"(<script[^>]*>)(.*?)</script>", text, re.DOTALL):
        assert "src=" in opening and not content.strip()
    assert not re.search(r"<style|\sstyle=|\son\w+=", text)


def test_built_page_refers_to_built_files_only() -> None:
    text = (STATIC / "index.html").read_text(encoding="utf-8")
    files = re.findall(r'(?:src|href)="([^"]+)"', text)
    assert files
    for file in files:
        assert (STATIC / file).is_file(), file


def test_styles_and_swagger_load_nothing_from_elsewhere() -> None:
    for style in STATIC.rglob("*.css"):
        for address in re.findall(r"url\(\s*[\"']?([^\"')]+)", style.read_text(encoding="utf-8")):
            assert address.startswith(("data:", "#")), style.name


def test_every_bundled_package_has_its_notice() -> None:
    notices = (STATIC / "NOTICES.txt").read_text(encoding="utf-8")
    package = json.loads((CLIENT / "package.json").read_text(encoding="utf-8"))
    for name, version in package["dependencies"].items():
        assert re.search(rf"^{re.escape(name)} {re.escape(version)} \(", notices, re.MULTILINE), name


def built(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("npm") is None, reason="npm, which builds the page, is not installed")
def test_built_files_are_what_the_source_builds(tmp_path: Path) -> None:
    # The notices take the project's own licence from beside the package.
    copy = tmp_path / "tapelayer" / "workbench" / "client"
    shutil.copytree(CLIENT, copy, ignore=shutil.ignore_patterns("node_modules"))
    shutil.copy(ROOT / "LICENSE", tmp_path)
    for command in (["npm", "ci", "--ignore-scripts"], ["npm", "run", "build"]):
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert built(copy.parent / "static") == built(STATIC)
