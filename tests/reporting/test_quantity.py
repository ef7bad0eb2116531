"""A figure is one row: whatever shows a report finds it there."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from docs.render_tables import DOCUMENTS, rendered
from tapelayer.jobs import kinds
from tapelayer.jobs.kinds import NAMES, KindName, kind_of, machine_kinds
from tapelayer.laying import job, page
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.quantities import ROWS
from tapelayer.reporting import quantity
from tapelayer.reporting.page import quantities_table
from tapelayer.reporting.quantity import Listing, Quantity, Row, numbers, quantities
from tapelayer.reporting.summary import summary
from tapelayer.reporting.words import ENGLISH, Words
from tapelayer.verification.limits import Limit
from tests.helpers.judged import evidence, trajectory
from tests.helpers.pages import subject
from tests.helpers.paths import ROOT

MADE_UP: Quantity[Evidence] = Quantity(
    "max_roller_squeak_mm",
    Words("roller squeak", "压辊啸叫"),
    Words("how far the roller is heard", "压辊啸叫的传播距离"),
    "mm",
    1,
    lambda judged: 1000.0 * judged.laid_length,
    required=True,
)


@pytest.fixture
def with_a_row(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Row[Evidence], ...]]:
    """The rows of the tape layer with one more: the only place that is changed."""
    rows = (*ROWS, MADE_UP)
    for module in (job, page):
        monkeypatch.setattr(module, "ROWS", rows)
    entry = replace(kind_of("lay"), rows=rows)
    kinds.kind_of.cache_clear()
    monkeypatch.setattr("tapelayer.laying.kind.KIND", entry)
    yield rows
    kinds.kind_of.cache_clear()


def test_a_new_quantity_is_everywhere(with_a_row: tuple[Row[Evidence], ...]) -> None:
    httpx = pytest.importorskip("fastapi.testclient", reason="the extra workbench is not installed")
    fastapi = pytest.importorskip("fastapi", reason="the extra workbench is not installed")
    catalogue = pytest.importorskip("tapelayer.workbench.catalogue", reason="the extra workbench is not installed")
    judged = evidence(limits={MADE_UP.key: Limit(2000.0)} | dict(evidence().limits))
    report = numbers(with_a_row, judged, judged)
    assert report[MADE_UP.key] == 1500.0

    text = io.StringIO()
    Console(file=text, width=120).print(summary(with_a_row, report, judged.limits, ()))
    (line,) = (line for line in text.getvalue().splitlines() if "roller squeak" in line)
    assert [cell.strip() for cell in line.split("│")[1:4]] == ["roller squeak", "1,500.0 mm", "2,000 mm"]

    html = page.html(judged, trajectory(), {**report, "subject": subject("p.nc").values()}, job.Setup(), ())
    assert "<td>roller squeak</td><td>1,500.0</td><td>mm</td><td>2,000</td><td>75%</td>" in html

    app = fastapi.FastAPI()
    app.include_router(catalogue.router)
    answer = httpx.TestClient(app).get("/api/v1/quantities").json()
    (row,) = (row for row in answer["kinds"][0]["quantities"] if row["key"] == MADE_UP.key)
    assert row["words"] == {"en": "roller squeak", "zh": "压辊啸叫"} and row["failure"] == "roller_squeak_mm"


def test_what_is_required_and_was_not_measured_fails() -> None:
    lost: tuple[Row[Evidence], ...] = (replace(MADE_UP, measure=lambda _: float("nan")),)
    report = numbers(lost, evidence(), evidence())
    assert report[MADE_UP.key] is None and not report["passed"]
    assert [failure["what"] for failure in report["failures"]] == ["roller_squeak_mm"]
    free: tuple[Row[Evidence], ...] = (replace(MADE_UP, measure=lambda _: float("nan"), required=False),)
    assert numbers(free, evidence(), evidence())["passed"]
    hollow: tuple[Row[Evidence], ...] = (Listing("parts", lambda _: [{"a": [1.0, None]}], required=True),)
    assert [failure["what"] for failure in numbers(hollow, evidence(), evidence())["failures"]] == ["parts"]


def test_a_value_beyond_its_limit_is_drawn_as_such() -> None:
    report: dict[str, Any] = {MADE_UP.key: 2001.0}
    rows = (MADE_UP,)
    beyond = quantities_table(rows, report, {MADE_UP.key: Limit(2000.0)}, ENGLISH)
    kept = quantities_table(rows, report, {MADE_UP.key: Limit(2001.0)}, ENGLISH)
    drawn = [{node.get("class") for node in table.iter()} for table in (beyond, kept)]
    assert ["used beyond" in styles for styles in drawn] == [True, False]


@pytest.mark.parametrize("name", NAMES)
def test_every_row_speaks_both_languages(name: KindName) -> None:
    rows = quantities(kind_of(name).rows)
    assert len({row.key for row in rows}) == len(rows) and sum(row.headline for row in rows) >= 3
    for row in rows:
        for words in (row.words, row.about, row.absent):
            assert words.en.isascii() or "²" in words.en or "·" in words.en
            assert any("\u4e00" <= letter <= "\u9fff" for letter in words.zh), row.key
        assert not row.about.en.endswith(".") and not row.about.zh.endswith("。")
    for stage in kind_of(name).making:
        assert stage.words.en and stage.words.zh


def test_every_stage_of_judging_speaks_both_languages() -> None:
    for kind in machine_kinds():
        assert all(stage.words.en and stage.words.zh for stage in kind.judging)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_the_documents_say_what_the_rows_say(document: str) -> None:
    assert (ROOT / "docs" / document).read_text(encoding="utf-8") == rendered(document), "run docs/render_tables.py"


def test_every_limit_is_of_a_quantity() -> None:
    for name in NAMES:
        kind = kind_of(name)
        keys = {row.key for row in quantities(kind.rows)}
        assert set(kind.limits(kind.first_setup())) <= keys
    assert quantity.Group.ERROR.value == "error"
