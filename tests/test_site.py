"""The documentation's site, as `make docs` builds it: whole, and without a network."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

SITE = ROOT / "build" / "site"
# Tags that make a browser load something, and the attributes that say what.
LOADS = {
    **{tag: ("src", "srcset") for tag in ("script", "img", "source", "video", "audio", "iframe", "embed")},
    "link": ("href",),
    "object": ("data",),
    "image": ("href", "xlink:href"),
    "use": ("href", "xlink:href"),
}

pytestmark = pytest.mark.site


class Page(HTMLParser):
    """What a page of the site loads, and which names stand on it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.ids: list[str] = []
        self.classes: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.loads += [values[name] for name in LOADS.get(tag, ()) if name in values]
        self.ids.append(values.get("id", ""))
        self.classes.update(values.get("class", "").split())


def test_pages_load_nothing_from_outside() -> None:
    pages = {path: Page(path) for path in SITE.rglob("*.html")}
    assert len(pages) > 20
    for path, page in pages.items():
        assert not [load for load in page.loads if re.match(r"(\w+:)?//", load)], path
        # The theme fetches the program that draws these diagrams.
        assert "mermaid" not in page.classes, path


def test_styles_load_nothing_from_outside() -> None:
    styles = [*SITE.rglob("*.css"), *SITE.rglob("*.html"), *SITE.rglob("*.svg")]
    assert len(styles) > 20
    for path in styles:
        assert not re.search(r"""(url\(|@import)\s*["']?(\w+:)?//""", path.read_text()), path


def test_every_module_is_in_the_reference() -> None:
    names = {name for path in (SITE / "reference").glob("*.html") for name in Page(path).ids}
    for package in ("tapelayer", "post"):
        for path in (ROOT / package).rglob("[!_]*.py"):
            assert ".".join(path.relative_to(ROOT).with_suffix("").parts) in names
    assert not [name for name in names if re.match(r"(tapelayer|post)\b.*\._", name)], "private names are shown"


def test_formulas_are_drawn() -> None:
    text = (SITE / "kinematics.html").read_text()
    assert text.count("<math") == (ROOT / "docs" / "kinematics.md").read_text().count("```math")
    assert "<mi>&</mi>" not in text
