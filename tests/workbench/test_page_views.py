"""Search, tables and the view of the machine, as a person meets them on the page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses
from tests.helpers.browsing import Person, api, chromium
from tests.helpers.served import Workbench
from tests.workbench.test_page import EXAMPLE, Made

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory, browser: Any) -> Iterator[Workbench]:
    with Workbench(tmp_path_factory.mktemp("work"), "--workers", 1) as workbench:
        yield workbench


@pytest.fixture(scope="module")
def laid(browser: Any, workbench: Workbench) -> Iterator[Person]:
    person = Person(browser, workbench.url)
    person.open()
    person["example-select"].select_option(EXAMPLE)
    person.see("file-name", EXAMPLE)
    assert person.generate() == "done"
    person.made()
    yield person
    person.leave()


def test_places_of_a_word_are_counted_and_gone_round(laid: Person) -> None:
    words = Made(laid).text.decode().lower()
    count = words.count("m2")
    assert count > 2
    laid["program-search"].click()
    laid.page.keyboard.type("m2")
    laid.see("search-count", f"{count} found")
    for number in (1, 2):
        laid.page.keyboard.press("Enter")
        api.expect(laid["search-count"]).to_have_text(f"{number} of {count}")
    for number in (1, count):
        laid.page.keyboard.press("Shift+Enter")
        api.expect(laid["search-count"]).to_have_text(f"{number} of {count}")
    laid.page.keyboard.press("Enter")
    api.expect(laid["search-count"]).to_have_text(f"1 of {count}")
    laid["program"].locator("[name=search]").fill("no such word")
    api.expect(laid["search-count"]).to_have_text("not found")
    laid.page.keyboard.press("Escape")
    api.expect(laid["search-count"]).to_have_count(0)


def test_elevations_are_parallel_until_they_are_turned(laid: Person) -> None:
    scene = laid["scene"]
    for direction in ("top", "front", "side"):
        laid[f"view-{direction}"].click()
        api.expect(scene).to_have_attribute("data-projection", "parallel")
        laid.keep(f"view-{direction}")
        box = scene.bounding_box()
        laid.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        laid.page.mouse.wheel(0, -200)
        api.expect(scene).to_have_attribute("data-projection", "parallel")
        laid.page.mouse.down()
        laid.page.mouse.move(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2 - 40, steps=4)
        laid.page.mouse.up()
        api.expect(scene).to_have_attribute("data-projection", "perspective")
        laid.keep(f"view-{direction}-turned")
    laid["view-iso"].click()
    api.expect(scene).to_have_attribute("data-projection", "perspective")


def rows_of(count: int) -> bytes:
    """Short straight courses side by side."""
    y = np.linspace(0, 0.4, 3)
    paths = [np.column_stack([np.full_like(y, 2e-3 * number), y, 0 * y]) for number in range(count)]
    normals, square = np.tile([0.0, 0.0, 1.0], (3, 1)), (np.pi / 2, np.pi / 2)
    return format_courses(Course(number + 1, path, normals, y, square) for number, path in enumerate(paths))


def test_a_long_ledger_draws_the_rows_in_view(laid: Person) -> None:
    laid.choose_file("import-file", "many.txt", rows_of(300))
    assert laid.generate() == "done"
    laid.made()
    laid["tab-ledger"].click()
    ledger = laid["ledger"]
    rows = ledger.locator("tbody tr[aria-rowindex]")
    api.expect(ledger.locator("table")).to_have_attribute("aria-rowcount", "302")
    api.expect(rows.nth(15)).to_contain_text("16")
    assert rows.count() < 100
    ledger.evaluate("(panel) => panel.scrollTo(0, panel.scrollHeight)")
    api.expect(rows.last).to_have_attribute("aria-rowindex", "301")
    assert rows.count() < 100
    laid.keep("long-ledger")
    rows.last.locator("button").first.click()
    laid.see("clock-place", "course 300")
    laid.page.keyboard.press("Control+Home")


def test_machine_and_passes_are_hidden(laid: Person) -> None:
    laid["view-iso"].click()
    laid["view-machine"].click()
    laid.page.wait_for_timeout(1000)
    before = laid.picture("scene")
    laid["hide-machine"].click()
    api.expect(laid["hide-machine"]).to_have_attribute("aria-pressed", "true")
    laid.page.wait_for_timeout(1000)
    laid.keep("machine-hidden")
    assert (np.abs(before - laid.picture("scene")).max(axis=2) > 20).mean() > 0.01
    laid["hide-machine"].click()
    api.expect(laid["hide-passes"]).to_be_hidden()
    assert "wheel: zoom" in laid["scene"].get_attribute("title")
