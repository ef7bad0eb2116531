"""The page's frame: panes that fold and fill the window, in windows of every size, by keys alone, and for everybody."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from tests.helpers.browsing import Person, api
from tests.helpers.paths import ROOT
from tests.helpers.served import Workbench

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")

pytestmark = pytest.mark.browser

EXAMPLE = "flat_panel_00.txt"
COURSES = (ROOT / "examples" / EXAMPLE).read_bytes()
JUDGED_BAD = "[verification]\nmax_position_error_mm = 0.0001\n"
# The rule of WCAG 2.2 that axe leaves out unless it is asked for.
RULES = {"resultTypes": ["violations"], "rules": {"target-size": {"enabled": True}}}
SIZES = [(640, 360), (911, 512), (960, 540), (1280, 720), (1920, 1080)]
COLUMN_PX = 1000


@dataclass(frozen=True)
class Jobs:
    """Paths of pages that show a job.

    Attributes:
        done: whose program passed.
        failed: whose program was withheld.
        refused: whose file could not be read.
    """

    done: str
    failed: str
    refused: str


def mistyped() -> bytes:
    """The courses with a word that is no number, another one each time, at every fourth point."""
    lines = COURSES.splitlines()
    points = [row for row, line in enumerate(lines) if line.count(b" ") == 6]
    for row in points[::4]:
        words = lines[row].split()
        words[row % 7] += b"x%d" % row
        lines[row] = b" ".join(words)
    return b"\n".join(lines)


@pytest.fixture(scope="module")
def jobs(workbench: Workbench) -> Jobs:
    sent = ((EXAMPLE, COURSES, {}), (EXAMPLE, COURSES, {"setup": JUDGED_BAD}), ("a" * 180 + ".txt", mistyped(), {}))
    with workbench.client() as client:
        return Jobs(*(f"/#job={client.made(name, data, **fields)['id']}" for name, data, fields in sent))


@pytest.fixture
def visitor(guest: Person, jobs: Jobs) -> Person:
    """Somebody who was sent a link to the job."""
    guest.open(jobs.done)
    guest.made()
    return guest


def violations(person: Person) -> list[tuple[str, list[str]]]:
    """Rules of accessibility that the page breaks, and where."""
    found = axe.Axe().run(person.page, options=RULES).response["violations"]
    return [(rule["id"], [str(node["target"]) for node in rule["nodes"]]) for rule in found]


def sized(person: Person, width: int, height: int) -> None:
    person.page.set_viewport_size({"width": width, "height": height})


# Share of the window that an element covers where it is in sight and nothing lies over it, by points of a grid.
SHARE = """(element) => {
    const canvas = element;
    let seen = 0;
    const count = 40;
    for (let i = 0; i < count; i++) for (let j = 0; j < count; j++) {
        const [x, y] = [(i + 0.5) * innerWidth / count, (j + 0.5) * innerHeight / count];
        if (document.elementFromPoint(x, y) === canvas) seen++;
    }
    return seen / count ** 2;
}"""


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_machine_and_verdict_are_seen_in_every_window(visitor: Person, width: int, height: int) -> None:
    sized(visitor, width, height)
    for language, theme in (("en", "light"), ("zh", "dark")):
        visitor["language"].select_option(language)
        visitor["theme"].select_option(theme)
        if width < COLUMN_PX:
            # What is scrolled to stands below the head that stays.
            visitor["scene"].evaluate("(scene) => scroll(0, scene.getBoundingClientRect().top + scrollY - 90)")
        badge = visitor["verdict"].bounding_box()
        assert 0 <= badge["y"] and badge["y"] + badge["height"] <= height and badge["height"] > 20
        api.expect(visitor["not-judged"]).to_be_in_viewport()
        assert visitor["scene"].evaluate(SHARE) > (0.35 if width < COLUMN_PX else 0.18)
        assert visitor.page.evaluate("document.documentElement.scrollWidth") <= width
        assert violations(visitor) == []
        visitor["fill-centre"].click()
        assert visitor["scene"].evaluate(SHARE) > 0.4
        visitor.keep(f"full-{width}-{language}")
        visitor["fill-centre"].click()
        api.expect(visitor["generate"]).to_be_visible()


def test_panes_fold_and_are_remembered(visitor: Person) -> None:
    whole = visitor["scene"].bounding_box()
    for name, inside in (("left", "generate"), ("dock", "tab-verdict"), ("program", "program")):
        api.expect(visitor[f"fold-{name}"]).to_have_attribute("aria-pressed", "true")
        visitor[f"fold-{name}"].click()
        api.expect(visitor[f"fold-{name}"]).to_have_attribute("aria-pressed", "false")
        api.expect(visitor[inside]).to_be_hidden()
    visitor.page.reload()
    visitor.made()
    for inside in ("generate", "tab-verdict", "program"):
        api.expect(visitor[inside]).to_be_hidden()
    alone = visitor["scene"].bounding_box()
    assert alone["width"] == 1280 and alone["height"] > 1.5 * whole["height"]
    assert violations(visitor) == []
    visitor.keep("all-folded")
    # Who asks for something that is folded away gets it.
    visitor.page.keyboard.press("2")
    api.expect(visitor["tab-plots"]).to_be_visible()
    visitor.page.keyboard.press("Control+f")
    api.expect(visitor.program()).to_be_visible()
    visitor.page.keyboard.press("Escape")
    visitor["fold-left"].click()
    assert visitor["scene"].bounding_box() == whole


def test_panes_are_folded_and_filled_by_keys(visitor: Person) -> None:
    keys = visitor.page.keyboard
    for key, inside in (("i", "generate"), ("n", "program"), ("t", "tab-verdict")):
        keys.press(key)
        api.expect(visitor[inside]).to_be_hidden()
        keys.press(key)
        api.expect(visitor[inside]).to_be_visible()
    keys.press("m")
    assert visitor["scene"].evaluate(SHARE) > 0.6
    # A pane that is covered is asked for, not folded away.
    keys.press("n")
    api.expect(visitor["program"]).to_be_visible()
    api.expect(visitor["generate"]).to_be_visible()
    visitor["tab-ledger"].focus()
    keys.press("m")
    api.expect(visitor["scene"]).to_be_hidden()
    assert visitor["tab-verdict"].locator("xpath=ancestor::section").bounding_box()["width"] == 1280
    visitor.page.reload()
    visitor.made()
    api.expect(visitor["scene"]).to_be_hidden()
    keys.press("m")
    api.expect(visitor["scene"]).to_be_visible()


@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_everybody_can_use_it(guest: Person, jobs: Jobs, language: str, theme: str) -> None:
    """Neither the page in any state nor its dialogs break a rule of axe."""
    guest.open()
    guest["language"].select_option(language)
    guest["theme"].select_option(theme)
    assert violations(guest) == []
    for link, tabs in ((jobs.done, ("plots", "ledger", "jobs")), (jobs.failed, ("verdict",))):
        guest.open(link)
        guest.made()
        api.expect(guest["not-judged"]).to_be_in_viewport()
        for tab in tabs:
            guest[f"tab-{tab}"].click()
            assert violations(guest) == [], tab
    guest["help"].click()
    assert violations(guest) == []


def test_faults_of_a_file_leave_the_machine_in_sight(guest: Person, jobs: Jobs) -> None:
    guest.open(jobs.refused)
    problem = guest["problem"]
    api.expect(problem.locator(".faults li").nth(5)).to_be_attached()
    assert problem.evaluate("(box) => box.scrollHeight > box.clientHeight")
    problem.focus()
    last = problem.locator(".faults li").last
    for _ in range(100):
        guest.page.keyboard.press("PageDown")
        guest.page.wait_for_timeout(50)
        below, end = last.bounding_box(), problem.bounding_box()
        if below["y"] < end["y"] + end["height"]:
            break
    api.expect(last).to_be_in_viewport()
    for width, height in SIZES[-2:]:
        sized(guest, width, height)
        assert guest["scene"].bounding_box()["height"] > 0.3 * height
    # A long name takes two lines, and is told whole on demand.
    line = guest["file-name"].evaluate("(name) => parseFloat(getComputedStyle(name).lineHeight)")
    assert guest["file-name"].bounding_box()["height"] <= 2.1 * line
    assert guest["file-name"].get_attribute("title") == "a" * 180 + ".txt"
    assert violations(guest) == []
    guest.keep("faults")
    for width, height in SIZES[:2]:
        sized(guest, width, height)
        guest["problem-close"].click()
        api.expect(problem).to_have_count(0)
        guest["generate"].click()
        assert guest.ended() == "failed"
        api.expect(problem).to_be_in_viewport(ratio=0.5)


# Texts of plots' titles that do not fit.
CUT = """() => [...document.querySelectorAll(".plot h3 span")].filter((span) => {
    const { left, right } = span.closest(".plot").getBoundingClientRect();
    const place = span.getBoundingClientRect();
    return place.left < left || place.right > right + 0.5;
}).map((span) => span.textContent)"""


def test_a_plot_is_enlarged(visitor: Person) -> None:
    visitor["tab-plots"].click()
    for view in ("errors", "speeds", "positions"):
        visitor[f"plots-{view}"].click()
        figures = visitor["plots"].locator("figure")
        api.expect(figures.nth(1)).to_be_visible()
        assert visitor.page.evaluate(CUT) == []
    count, small = figures.count(), visitor["plot-c"].bounding_box()
    visitor["enlarge-c"].click()
    api.expect(figures).to_have_count(1)
    large = visitor["plot-c"].bounding_box()
    assert large["width"] * large["height"] > 5 * small["width"] * small["height"]
    api.expect(visitor["enlarge-c"]).to_be_focused()
    visitor.page.keyboard.press("Enter")
    api.expect(figures).to_have_count(count)
    api.expect(visitor["enlarge-c"]).to_be_focused()
    visitor.keep("plots")


def test_the_report_is_looked_at(visitor: Person) -> None:
    with visitor.context.expect_page() as opened:
        visitor["look-at-report"].click()
    report = opened.value
    report.wait_for_load_state()
    assert report.url.endswith("/report.html") and report.locator("table").count() > 1
