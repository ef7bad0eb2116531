"""Pages of both kinds read well: by a screen reader, on a phone, in print, and in Chinese."""

from __future__ import annotations

import io
import re
import tomllib
from html import unescape

import pytest
from rich.console import Console

from tapelayer.jobs.kinds import MACHINE_NAMES, MachineKindName, machine_kind_of
from tapelayer.reporting.failure_names import failure_name
from tapelayer.reporting.page import STYLE
from tapelayer.reporting.quantity import quantities
from tapelayer.reporting.subject import Occasion
from tapelayer.reporting.summary import explained
from tapelayer.reporting.words import Say
from tapelayer.verification.failures import Failure
from tests.helpers.judged import evidence
from tests.helpers.kinds import made
from tests.helpers.pages import Elements, page
from tests.helpers.paths import ROOT

CHINESE = Say("zh")
# What is the same in every language: units, names of axes, keys of setups and of the machine, and names of its parts.
SAME = {
    *"mm m2 m deg s um min h SHA x y z c a u v d q e nc toml txt urdf theta phi toolpath".split(),
    *"tapelayer Pinocchio program job source sprayer jb generic published roller arc".split(),
}


@pytest.fixture(params=MACHINE_NAMES)
def kind(request: pytest.FixtureRequest) -> MachineKindName:
    name: MachineKindName = request.param
    return name


def visible(text: str) -> str:
    """The words of a page that are seen or read out."""
    body = text[text.index("<body") :]
    labels = " ".join(re.findall(r'aria-label="([^"]*)"', body))
    return unescape(f"{re.sub('<[^>]*>', ' ', body)} {labels}")


def test_everything_is_in_a_landmark_and_every_column_has_a_name(kind: MachineKindName) -> None:
    text = made(kind).page(Occasion("program.nc"))
    body = text[text.index("<body>") + 6 : text.index("</body>")]
    depth, top = 0, []
    for closing, tag in re.findall(r"<(/?)(\w+)[^>]*?>", re.sub(r"<\w+[^>]*/>|<meta[^>]*>", "", body)):
        if closing:
            depth -= 1
        else:
            top += [tag] if depth == 0 else []
            depth += 1
    assert top == ["header", "nav", "main"]
    elements = Elements(text)
    headers = elements.of("th")
    assert headers and all(words.strip() and own["scope"] == "col" for own, words in headers)
    assert len(elements.of("main")) == 1


def test_the_table_of_contents_leads_to_every_section(kind: MachineKindName) -> None:
    elements = Elements(made(kind).page(Occasion("program.nc")))
    links = [((own["href"] or "")[1:], words) for own, words in elements.of("a")]
    assert links == [(own["id"], words) for own, words in elements.of("h2")] and len(links) > 6


def test_every_table_scrolls_within_the_page(kind: MachineKindName) -> None:
    text = made(kind).page(Occasion("program.nc"))
    boxes = re.findall(r'<div class="scroll" tabindex="0" role="group" aria-label="[^"]+"><table', text)
    assert len(boxes) == text.count("<table") > 3
    assert ".scroll { overflow-x: auto; }" in STYLE


def test_printed_pages_are_numbered() -> None:
    assert re.search(r'@page \{[^}]*@bottom-right \{ content: counter\(page\) " / " counter\(pages\)', STYLE)


def test_a_chinese_page_has_no_english_word(kind: MachineKindName) -> None:
    text = made(kind).page(Occasion("program.nc", "job.toml", "2026-01-01T00:00:00Z"), "zh")
    assert '<html lang="zh-CN">' in text
    words = visible(text)
    # Hashes, moments, keys of the setup and formulas are no words.
    words = re.sub(r"\b[0-9a-f]{64}\b|\d{4}-\d\d-\d\dT[\d:]+Z|\w+_\w+", " ", words)
    assert not set(re.findall(r"[A-Za-z]{2,}", words)) - SAME - {"null", "false", "sin"}


def test_a_chinese_page_says_the_same_numbers(kind: MachineKindName) -> None:
    pages = [made(kind).page(Occasion("program.nc"), language) for language in ("en", "zh")]  # type: ignore[arg-type]
    found = [[re.findall(r"-?\d[\d,.]*", words) for _, words in Elements(text).of("td")] for text in pages]
    for english, chinese in zip(*found, strict=True):
        assert english == chinese or not english


def test_a_chinese_failure_is_headed_and_listed_in_chinese() -> None:
    failures = (Failure(3, 7, "lay_speed_mm_per_s", 261.0, 250.0, 100), Failure(0, 0, "courses_laid", 1, 2))
    elements = Elements(page(evidence(failures=failures), say=CHINESE))
    ((_, words),) = elements.of("p", "verdict failed")
    assert words.startswith("不合格：2 项，第一项：道次 3 点 7 铺放速度 261 mm/s，限值 250 mm/s")
    cells = [words for _, words in elements.of("td")]
    assert "铺放速度" in cells and "已铺道次数" in cells


# Failures that the terminal names.
CATALOGUED = tomllib.loads((ROOT / "tapelayer/languages/zh/failures.toml").read_text("utf-8"))
NAMED = [what for what in CATALOGUED if "{" not in what]


def test_every_failure_has_a_chinese_name(kind: MachineKindName) -> None:
    rows = machine_kind_of(kind).rows
    keys = [row.failure for row in quantities(rows)]
    keys += [
        "axis_c_deg",
        "axis_x_speed_mm_per_s",
        "axis_x_acceleration_mm_per_s2",
        "knife_1_off_every_cut_mm",
        "heater_left_on",
        "heater_on_astray_ms",
    ]
    keys += ["auxiliary_roller_down_words", "auxiliary_roller_up_mm", "rapid_with_knife_2_on", "heater_off_words"]
    for what in (*keys, *NAMED):
        name, _ = failure_name(what, rows, CHINESE)
        assert re.search(r"[\u4e00-\u9fff]", name), what
        assert not re.search(r"[a-z]{3,}", name.replace("theta", "")), what


def test_the_terminal_speaks_chinese(kind: MachineKindName) -> None:
    found, shown = made(kind), io.StringIO()
    Console(file=shown, width=200).print(found.summary("zh"))
    text = shown.getvalue()
    assert "校验：合格" in text and "未作判定" in text
    assert f"未判定：{'、'.join(words.zh for words in found.job.not_judged)}" in text
    assert not set(re.findall(r"[A-Za-z]{2,}", text)) - SAME
    for row in quantities(machine_kind_of(kind).rows):
        assert row.words.zh in text
    meanings = io.StringIO()
    chosen = machine_kind_of(kind)
    Console(file=meanings, width=400).print(explained(chosen.rows, chosen.limits(chosen.setup()), CHINESE))
    assert all(row.about.zh[:20] in meanings.getvalue() for row in quantities(chosen.rows))


def test_long_times_are_read_in_hours() -> None:
    found = evidence(duration=9229.2)
    row = next(row for row in quantities(machine_kind_of("lay").rows) if row.key == "duration_s")
    assert row.measure(found) == 9229.2
    assert "2 h 33 min 49 s" in [words for _, words in Elements(page(found)).of("dd")]
