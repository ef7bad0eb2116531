"""Plies on the page: a mould is looked at, a ply is drawn on it and planned, and its courses become a program."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tests.helpers.browsing import LARGE, Camera, Person, api
from tests.helpers.panels import sheet, stl_bytes

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")

pytestmark = pytest.mark.browser

RULES = {"resultTypes": ["violations"], "rules": {"target-size": {"enabled": True}}}
NAME = "hood.stl"
SQUARE = np.array([[150.0, 200.0], [450.0, 200.0], [450.0, 600.0], [150.0, 600.0]])


def height(x: Floats, y: Floats) -> Floats:
    """Millimetres of a mould that is curved both ways."""
    return 80.0 * np.sin(x / 400.0) - 30.0 * (y / 800.0) ** 2


MOULD = stl_bytes(sheet(np.linspace(0, 600, 25), np.linspace(0, 800, 33), height))


def on_mould(points: Floats) -> Floats:
    """Places (n, 3) in metres above plan points (n, 2) in mm."""
    return np.column_stack([points, height(points[:, 0], points[:, 1])]) / 1e3


def points_of(person: Person, key: str = "boundary-points") -> Floats:
    """The points (n, 3) that the form holds."""
    text = person[f"field-ply-{key}"].input_value()
    return np.array([[float(word) for word in line.split(",")] for line in text.splitlines() if line]).reshape(-1, 3)


@pytest.fixture
def planner(guest: Person) -> Person:
    """Somebody who brought a mould to plan courses on."""
    guest.page.set_viewport_size({"width": 1600, "height": 1000})
    guest.open()
    guest.drop(NAME, MOULD)
    guest["answer-plan"].click()
    api.expect(guest["model-size"]).to_be_visible()
    api.expect(guest["field-ply-angle_deg"]).to_be_visible()
    return guest


def draw(person: Person, points: Floats = SQUARE) -> Camera:
    """Draw a boundary by clicks."""
    person["draw-boundary"].click()
    camera = Camera(person)
    for place in on_mould(points):
        person.page.mouse.click(*camera.pixel(place))
    person.page.keyboard.press("Enter")
    return camera


def test_a_mould_is_seen_at_once_with_its_size(guest: Person) -> None:
    guest.open()
    empty = guest.picture("scene")
    guest.drop(NAME, MOULD)
    guest.see("question", "a mould to plan courses on, or a part to spray?")
    guest["answer-plan"].click()
    guest.see("model-size", re.compile(r"^600 × 800 × 1\d\d mm, 1536 facets$"))
    api.expect(guest["model-doubt"]).to_be_hidden()
    api.expect(guest["kind-plan"]).to_be_checked()
    api.expect(guest["seed"]).to_be_visible()
    assert (np.abs(empty - guest.picture("scene")[: len(empty), : empty.shape[1]]).max(axis=2) > 20).mean() > 0.02
    assert guest.get("/api/v1/jobs").json() == {"jobs": []}
    guest.keep("ply-mould")
    # What it is for can be changed: the part to spray is seen in the same way.
    guest.page.locator("label[for=kind-spray]").click()
    api.expect(guest["draw-boundary"]).to_be_hidden()
    api.expect(guest["model-size"]).to_be_visible()
    guest.page.locator("label[for=kind-lay]").click()
    api.expect(guest["model-size"]).to_be_hidden()


def test_an_unlikely_size_is_said_and_the_unit_is_chosen(planner: Person) -> None:
    planner["unit"].select_option("m")
    planner.see("model-size", "600000 × 800000")
    planner.see("model-doubt", "Is its unit m? That size is unlikely.")
    planner["model-doubt"].get_by_role("button", name="mm: 600").click()
    api.expect(planner["unit"]).to_have_value("mm")
    api.expect(planner["model-doubt"]).to_be_hidden()


def test_a_boundary_is_drawn_by_clicks(planner: Person) -> None:
    camera = draw(planner)
    api.expect(planner["point"]).to_have_count(4)
    found = points_of(planner)
    pixel = camera.pixel_size(on_mould(SQUARE)[0], np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(found[:, :2], SQUARE, atol=1.5 * pixel)
    # They lie on the facets, which leave the curved surface by little.
    np.testing.assert_allclose(found[:, 2], height(found[:, 0], found[:, 1]), atol=0.5)
    planner.keep("ply-boundary")
    assert planner.page.evaluate("document.activeElement.tagName") != "BODY"
    found_rules = axe.Axe().run(planner.page, options=RULES).response["violations"]
    assert [(rule["id"], [node["target"] for node in rule["nodes"]]) for rule in found_rules] == []


def test_points_are_dragged_moved_by_keys_removed_and_brought_back(planner: Person) -> None:
    camera = draw(planner)
    before = points_of(planner)
    x, y = camera.pixel(on_mould(SQUARE)[2])
    planner.page.mouse.move(x, y)
    planner.page.mouse.down()
    wanted = on_mould(np.array([[500.0, 650.0]]))[0]
    planner.page.mouse.move(*camera.pixel(wanted), steps=5)
    planner.page.mouse.up()
    moved = points_of(planner)
    np.testing.assert_allclose(moved[2, :2], [500.0, 650.0], atol=4)
    np.testing.assert_allclose(np.delete(moved, 2, axis=0), np.delete(before, 2, axis=0))
    planner["point"].nth(1).focus()
    planner.page.keyboard.press("Shift+ArrowRight")
    np.testing.assert_allclose(points_of(planner)[1, :2], before[1, :2] + [10.0, 0.0], atol=0.3)
    planner.page.keyboard.press("Delete")
    api.expect(planner["point"]).to_have_count(3)
    assert len(points_of(planner)) == 3
    for expected in (4, 4, 4):
        planner["undo-drawing"].click()
        api.expect(planner["point"]).to_have_count(expected)
    np.testing.assert_allclose(points_of(planner), before)
    planner["clear-drawing"].click()
    api.expect(planner["point"]).to_have_count(0)
    api.expect(planner["field-ply-boundary"]).to_have_value("edge")
    planner["scene"].focus()
    planner.page.keyboard.press("Control+z")
    api.expect(planner["point"]).to_have_count(4)


def test_what_is_typed_is_drawn_and_what_is_wrong_is_marked(planner: Person) -> None:
    planner["field-ply-boundary"].select_option("points")
    box = planner["field-ply-boundary-points"]
    box.fill("150, 200, 30\n450 200 70\n")
    api.expect(planner["point"]).to_have_count(2)
    api.expect(planner.page.locator("#field-ply-boundary-fault")).to_have_text("it has 2 points, expected at least 3")
    planner["generate"].click()
    # The first one that is wrong has the focus; nothing is sent.
    api.expect(planner["field-ply-angle_deg"]).to_be_focused()
    api.expect(planner.page.locator("#field-ply-angle_deg-fault")).to_have_text("expected a value")
    box.fill("150, 200, 30\n450 200 70\nx 600 0\n")
    api.expect(planner.page.locator("#field-ply-boundary-fault")).to_contain_text("point 3: expected three numbers")
    box.fill("150, 200, 30\n450 200 70\n300 600 0\n")
    api.expect(planner.page.locator("#field-ply-boundary-fault")).to_have_text("")
    api.expect(planner["point"]).to_have_count(3)


def test_holes_and_the_direction_are_drawn(planner: Person) -> None:
    camera = draw(planner)
    planner["draw-hole"].click()
    camera.still()
    for place in on_mould(np.array([[280.0, 350.0], [330.0, 350.0], [300.0, 430.0]])):
        planner.page.mouse.click(*camera.pixel(place))
    planner.page.keyboard.press("Escape")
    api.expect(planner["point"]).to_have_count(7)
    assert len(points_of(planner, "holes")) == 3
    planner.fill("ply", angle_deg=30)
    api.expect(planner["angle"]).to_have_text("30°")
    # The courses' direction is 30 degrees to the left of y, seen from above.
    turned = """() => {
        const [seed, tip] = ["seed", "angle"].map((id) =>
            document.querySelector(`[data-testid="${id}"]`).getBoundingClientRect());
        return tip.x < seed.x && tip.y < seed.y;
    }"""
    planner.page.wait_for_function(turned)
    # What the server finds: the area without the hole.
    planner.see("drawing", re.compile(r"^The ply covers 0\.1\d+ m²\.$"))
    planner.fill("ply", inset_mm=30)
    planner.see("drawing", re.compile(r"^The ply covers 0\.0\d+ m²\.$"))
    planner.keep("ply-hole")
    planner["language"].select_option("zh")
    planner["theme"].select_option("dark")
    planner.see("drawing", "铺层覆盖")
    planner.keep("ply-chinese")


def test_a_boundary_comes_from_a_file(planner: Person) -> None:
    text = "# corners\n" + "".join(f"{x:.1f} {y:.1f} {z:.1f}\n" for x, y, z in 1e3 * on_mould(SQUARE))
    planner.choose_file("field-ply-boundary-file", "points.txt", text.encode())
    api.expect(planner["point"]).to_have_count(4)
    np.testing.assert_allclose(points_of(planner)[:, :2], SQUARE)
    planner.choose_file("field-ply-boundary-file", "bad.txt", b"1 2 3\n4 five 6\n7 8 9\n")
    planner.see("problem", "five")
    planner.refused("/api/v1/boundary", 422)


def test_a_plan_is_drawn_changed_and_made_a_program(planner: Person) -> None:
    planner.page.set_viewport_size(LARGE)

    def worst(route: Any) -> None:
        report = route.fetch().json()
        for failure in report["failures"]:
            where = {"courses": [2, 3], "place_mm": [150.0, 700.0, 5.0]}
            failure |= {**where, "sentence": "course 2: strain of 0.10 %, expected at most 0.00326: use narrower tape"}
        route.fulfill(json=report)

    planner.page.route("**/report.json", worst)
    planner.fill("ply", angle_deg=0)
    # The surface is curved so that the outermost course alone is beyond it.
    planner.fill("limits", max_strain_percent=0.00326)
    assert planner.generate() == "judged-bad"
    api.expect(planner["verdict"]).to_contain_text("FAILED (1)")
    # What was planned is drawn in any case.
    api.expect(planner["course-number"].first).to_be_visible()
    numbers = planner["course-number"].count()
    assert numbers == 9
    api.expect(planner["make-program"]).to_be_hidden()
    camera = Camera(planner)
    before = camera.matrix()
    planner["failures"].get_by_role("button", name="courses 2, 3").click()
    camera.still()
    x, y = camera.pixel(np.array([0.15, 0.7, 0.005]))
    box = planner["scene"].bounding_box()
    np.testing.assert_allclose([x - box["x"], y - box["y"]], [box["width"] / 2, box["height"] / 2], atol=2)
    assert not np.allclose(before, camera.matrix())
    planner.keep("ply-failed")
    planner["view-top"].click()
    planner["colouring"].select_option("gap")
    planner.see("legend", "limits: gap 2, overlap 0")
    planner["colouring"].select_option("strain")
    planner.see("legend", re.compile(r"limit 0\.0033?\d*, largest found 0\.0033"))
    planner.see("legend", "beyond the limit")
    planner.keep("ply-strain")
    planner.fill("limits", max_strain_percent=0.3)
    planner.see("verdict", "Limits: Strain")
    assert planner.generate() == "done"
    api.expect(planner["verdict"]).to_contain_text("PASSED")
    planner.see("plan-change", "Against the plan before")
    planner.see("plan-change", "Limits: Strain")
    planner.see("legend", "limit 0.3")
    planner.keep("ply-passed")
    job = planner.job()
    planner["make-program"].click()
    api.expect(planner["kind-lay"]).to_be_checked()
    planner.ended()
    planner.made()
    sent = planner.get(f"/api/v1/jobs/{planner.job()}").json()
    assert sent["kind"] == "lay" and sent["sent"]["from_job"] == job
    planner.see("file-name", "hood.txt")
    planner.keep("ply-program")
    # The plan is still there, with its mould and its ply.
    planner.open(f"/#job={job}")
    api.expect(planner["course-number"]).to_have_count(numbers)
    api.expect(planner["field-limits-max_strain_percent"]).to_have_value("0.3")
    api.expect(planner["make-program"]).to_be_visible()
