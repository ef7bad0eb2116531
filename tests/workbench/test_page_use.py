"""The page in use: results not for what is set now, files that are dropped, small windows, colours of one's own."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.helpers.browsing import Person, api
from tests.helpers.paths import ROOT
from tests.helpers.served import Workbench

pytestmark = pytest.mark.browser

EXAMPLE = "flat_panel_00.txt"
COURSES = (ROOT / "examples" / EXAMPLE).read_bytes()
OTHER = (ROOT / "examples" / "cylinder_panel_15.txt").read_bytes()


@pytest.fixture(scope="module")
def link(browser: Any, workbench: Workbench) -> str:
    """Path of the page that shows a job."""
    with workbench.client() as client:
        return f"/#job={client.made(EXAMPLE, COURSES)['id']}"


@pytest.fixture
def visitor(guest: Person, link: str) -> Person:
    """Somebody who was sent a link to the job."""
    guest.open(link)
    guest.made()
    return guest


def assert_current(person: Person) -> None:
    api.expect(person["verdict"]).to_have_attribute("data-verdict", "passed")
    assert person.text("verdict").startswith("PASSED")


def assert_stale(person: Person, *changes: str) -> None:
    api.expect(person["verdict"]).to_have_attribute("data-verdict", "stale")
    person.see("verdict", re.compile(f"^not for what is set nowchanged: {re.escape(', '.join(changes))}PASSED for "))


def test_a_result_is_stale_while_something_else_is_set(visitor: Person) -> None:
    assert_current(visitor)
    visitor.fill("process", lay_speed_mm_per_s=400)
    assert_stale(visitor, "Process: Laying speed")
    visitor.keep("stale")
    visitor["language"].select_option("zh")
    visitor.see("verdict", "与当前设置不符")
    visitor["language"].select_option("en")
    # What was made is still there, and says what it was made from.
    name, _ = visitor.download("download-report-json")
    assert name == EXAMPLE.replace(".txt", ".json")
    for what in ("report-html", "report-json", "setup"):
        title = visitor[f"download-{what}"].get_attribute("title")
        assert title.endswith(f"{EXAMPLE}, job {visitor.job()[:8]}")
    visitor.fill("process", lay_speed_mm_per_s=None)
    assert_current(visitor)
    visitor.choose_file("import-file", "other.txt", OTHER)
    assert_stale(visitor, "other.txt")
    # The same name does not make it the same file; the same bytes do.
    visitor.choose_file("import-file", EXAMPLE, OTHER)
    assert_stale(visitor, EXAMPLE)
    visitor.choose_file("import-file", EXAMPLE, COURSES)
    assert_current(visitor)
    visitor.choose_file("import-parts", "table.toml", b"[arcs]\n")
    assert_stale(visitor, "table.toml")
    assert visitor.generate() == "done"
    assert_current(visitor)


def test_what_is_not_judged_is_said(guest: Person, link: str) -> None:
    def told(route: Any) -> None:
        answer = route.fetch().json()
        for kind in answer["kinds"]:
            kind["not_judged"] = [{"en": "collision", "zh": "碰撞"}, {"en": "acceleration", "zh": "加速度"}]
        route.fulfill(json=answer)

    guest.page.route("**/api/v1/quantities", told)
    guest.open(link)
    guest.made()
    guest.see("not-judged", "not judged: collision, acceleration")


MODEL = (ROOT / "examples" / "curved_panel.stl").read_bytes()
PICTURE = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(100)


def test_a_second_course_file_replaces_the_first_when_told(guest: Person) -> None:
    guest.open()
    guest.drop("one.txt", COURSES)
    guest.see("file-name", "one.txt")
    guest.drop("two.txt", OTHER)
    guest["answer-keep"].click()
    api.expect(guest["file-name"]).to_have_text("one.txt")
    guest.drop("two.txt", OTHER)
    guest.see("question", "Replace one.txt by two.txt?")
    guest["answer-replace"].click()
    api.expect(guest["file-name"]).to_have_text("two.txt")
    # The same file, saved anew, is no other file.
    guest.drop("two.txt", COURSES)
    api.expect(guest["question"]).to_have_count(0)


def test_a_model_dropped_on_courses_is_their_mould_when_told(guest: Person) -> None:
    guest.open()
    guest.drop("one.txt", COURSES)
    guest.see("file-name", "one.txt")
    guest.drop("tool.stl", MODEL)
    guest["answer-mould"].click()
    api.expect(guest.page.locator(".chips li")).to_have_text(["mouldtool.stl✕"])
    api.expect(guest["kind-lay"]).to_be_checked()


def test_a_dropped_setup_is_loaded_and_asks_before_it_replaces(guest: Person) -> None:
    guest.open()
    guest.drop("a.toml", b"[tape]\nwidth_mm = 50\n")
    api.expect(guest["field-tape-width_mm"]).to_have_value("50")
    guest.drop("b.toml", b"[tape]\nwidth_mm = 75\n")
    guest.see("question", "b.toml replaces the parameters that you changed: 1.")
    guest["answer-keep"].click()
    api.expect(guest["field-tape-width_mm"]).to_have_value("50")
    guest.drop("b.toml", b"[tape]\nwidth_mm = 75\n")
    guest["answer-load"].click()
    api.expect(guest["field-tape-width_mm"]).to_have_value("75")
    api.expect(guest.page.locator(".chips li")).to_have_count(0)


@pytest.mark.parametrize(
    ("name", "data", "sentence"),
    [
        ("a.nc", b"%\n(part)\nN10 G90\nN20 G01 X1 F100\n", "a.nc is an NC program; the page judges none yet"),
        ("a.txt", b"G90\nG01 X1 F100\n", "a.txt is an NC program; the page judges none yet"),
        ("a.png", PICTURE, "a.png is neither a course file, a model, a setup"),
        ("b.toml", b"[spray]\npitch_mm = 30\n", "b.toml is a setup for another kind of job (Spraying)"),
    ],
)
def test_what_cannot_be_taken_is_refused_by_name(guest: Person, name: str, data: bytes, sentence: str) -> None:
    guest.open()
    guest.drop(name, data)
    guest.see("problem", sentence)
    api.expect(guest["file-name"]).to_have_text("no file yet")
    api.expect(guest.page.locator(".chips li")).to_have_count(0)


def test_a_table_and_a_machine_are_further_files(guest: Person) -> None:
    guest.open()
    for name, data in (("own.toml", b"title = 'own'\n[codes]\n"), ("own.urdf", b"<?xml version='1.0'?><robot/>")):
        guest.drop(name, data)
        api.expect(guest.page.locator(".chips .name", has_text=name)).to_be_visible()


# What hangs over the page's sides, and what is cut off.
BESIDE = """() => {
    const wide = document.documentElement.scrollWidth > innerWidth ? [["page"]] : [];
    const all = [...document.querySelectorAll("button, select, .button, h2, output, [role=tab]")];
    const lost = all.filter((each) => {
        if (!each.checkVisibility() || each.closest("dialog, details, [role=tabpanel]")) return false;
        const { left, right } = each.getBoundingClientRect();
        return left < 0 || right > innerWidth + 0.5;
    });
    return [...wide, ...lost.map((each) => [each.dataset.testid, each.textContent])];
}"""


@pytest.mark.parametrize(("width", "height"), [(640, 360), (911, 512)])
def test_small_windows_are_one_column(visitor: Person, width: int, height: int) -> None:
    visitor.page.set_viewport_size({"width": width, "height": height})
    for language in ("zh", "en"):
        visitor["language"].select_option(language)
        assert visitor.page.evaluate(BESIDE) == []
        for testid in ("generate", "scene", "play", "program", "tab-verdict", "course-select"):
            visitor[testid].scroll_into_view_if_needed()
            api.expect(visitor[testid]).to_be_in_viewport()
            badge = visitor["verdict"].bounding_box()
            assert 0 <= badge["y"] < height and badge["height"] > 20
            visitor[testid].click(trial=True)
        assert visitor["scene"].bounding_box()["height"] >= 240
        head = visitor.page.locator(".top").bounding_box()
        assert head["height"] <= 0.3 * height
    visitor["scene"].scroll_into_view_if_needed()
    visitor.keep(f"page-{width}x{height}")


COLOURS = """() => {
    const style = (element, name) => getComputedStyle(element)[name];
    const row = (key) => document.querySelector(`.field:has([data-testid=field-process-${key}])`);
    const field = (key) => style(row(key), "borderLeftColor");
    const lines = document.querySelector("[data-testid=program]").shadowRoot;
    return {
        changed: field("lay_speed_mm_per_s"),
        unchanged: field("tolerance_mm"),
        current: style(lines.querySelector(".nc-current"), "backgroundColor"),
        shadow: style(lines.querySelector(".nc-current"), "boxShadow"),
        other: style(lines.querySelector(".cm-line:not(.nc-current)"), "backgroundColor"),
        now: style(document.querySelector(".plot-now"), "backgroundColor"),
        plain: style(document.body, "backgroundColor"),
    };
}"""


def test_marks_are_seen_in_colours_of_one_s_own(visitor: Person) -> None:
    visitor["course-select"].select_option("2")
    visitor.fill("process", lay_speed_mm_per_s=300)
    visitor["tab-plots"].click()
    visitor.page.wait_for_selector(".plot-now", state="attached")
    visitor.page.emulate_media(forced_colors="active")
    seen = visitor.page.evaluate(COLOURS)
    assert seen["changed"] != seen["unchanged"] == seen["plain"]
    assert seen["current"] != seen["other"] and seen["shadow"] != "none"
    assert seen["now"] not in (seen["plain"], "rgba(0, 0, 0, 0)")
    visitor.keep("forced-colours")
