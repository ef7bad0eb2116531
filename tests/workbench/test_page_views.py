"""Search, tables and the view of the machine, as a person meets them on the page."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses
from tapelayer.geometry.curves import Curve
from tapelayer.laying.placing import courses_in_machine
from tapelayer.motion.trajectory import Event, Kind
from tests.helpers.browsing import Camera, Person, api
from tests.helpers.served import Workbench
from tests.workbench.test_page import COURSES, EXAMPLE, Made

pytestmark = pytest.mark.browser


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


def triad(person: Person) -> dict[str, tuple[float, float]]:
    """Ends of the arms of the directions on the page, to the right and upwards."""
    arms = {name: person[f"triad-{name}"].locator("line") for name in "xyz"}
    return {name: (float(arm.get_attribute("x2")), -float(arm.get_attribute("y2"))) for name, arm in arms.items()}


def below_the_buttons(person: Person) -> Floats:
    """The view as it looks, without the buttons that lie over it."""
    tool = person["colouring"].bounding_box()
    first = math.ceil(tool["y"] + tool["height"] - person["scene"].bounding_box()["y"])
    return person.picture("scene")[first:]


def test_directions_and_a_grid_in_mm_are_shown(laid: Person) -> None:
    seen = {"top": ("x", "y", "z"), "front": ("x", "z", "y"), "side": ("y", "z", "x")}
    for view, (right, up, away) in seen.items():
        laid[f"view-{view}"].click()
        laid["view-fit"].click()
        camera = Camera(laid)
        arms = triad(laid)
        assert arms[right] == pytest.approx((0.62, 0.0), abs=1e-3), view
        assert arms[up] == pytest.approx((0.0, 0.62), abs=1e-3), view
        assert arms[away] == pytest.approx((0.0, 0.0), abs=1e-3), view
        assert laid[f"triad-{right}"].text_content() == right
        # What the grid adds to the picture are lines at multiples of the spacing that is told.
        spacing = float(laid.text("grid-spacing").removeprefix("grid ").removesuffix(" mm"))
        shown = below_the_buttons(laid)
        laid["hide-grid"].click()
        camera.still()
        differ = np.abs(shown - below_the_buttons(laid)).max(axis=2) > 4
        laid["hide-grid"].click()
        lines = np.flatnonzero(differ.mean(axis=0) > 0.3)
        box = laid["scene"].bounding_box()
        middle = np.zeros(3)
        way = np.eye(3)["xyz".index(right)]
        start, end = (camera.pixel(middle + length * way)[0] - box["x"] for length in (0.0, 1.0))
        places = 1e3 * (lines + 0.5 - start) / (end - start)
        off = np.abs(places - spacing * np.round(places / spacing))
        assert len(lines) >= 4 and np.max(off) <= 1.5e3 / (end - start), (view, places)


def test_nothing_veils_the_work_from_above(laid: Person) -> None:
    laid["view-top"].click()
    laid["view-fit"].click()
    camera = Camera(laid)
    shown = below_the_buttons(laid)
    laid["hide-machine"].click()
    camera.still()
    hidden = below_the_buttons(laid)
    laid["hide-machine"].click()
    assert len(shown) > 200
    # The background is dithered.
    np.testing.assert_allclose(shown, hidden, atol=1)


def test_the_machine_is_left_out_in_motion_and_nothing_is_drawn_at_rest(laid: Person) -> None:
    scene = laid["scene"]
    laid["view-iso"].click()
    laid["view-fit"].click()
    camera = Camera(laid)
    api.expect(scene).to_have_attribute("data-frame", "ghost")
    laid["play"].click()
    api.expect(scene).to_have_attribute("data-frame", "hidden")
    laid["play"].click()
    api.expect(scene).to_have_attribute("data-frame", "ghost")
    camera.still()
    frames = scene.get_attribute("data-frames")
    laid.page.wait_for_timeout(3000)
    assert scene.get_attribute("data-frames") == frames


def test_keys_turn_move_and_zoom(laid: Person) -> None:
    scene = laid["scene"]
    laid["view-iso"].click()
    laid["view-fit"].click()
    camera = Camera(laid)
    assert scene.get_attribute("aria-label")
    scene.focus()
    clock = laid.text("clock-time")
    whole = camera.matrix()
    place = np.zeros(3)

    def after(key: str) -> tuple[Floats, Floats]:
        """How a place moves on the page by a key, and the turn of what is seen."""
        before, turned = np.array(camera.pixel(place)), np.array(list(triad(laid).values()))
        laid.page.keyboard.press(key)
        camera.still()
        return np.array(camera.pixel(place)) - before, np.array(list(triad(laid).values())) - turned

    for key in ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"):
        _, turned = after(key)
        assert np.max(np.abs(turned)) > 0.02, key
    np.testing.assert_allclose(camera.matrix(), whole, atol=1e-6)
    for key, (right, down) in {"Left": (-1, 0), "Right": (1, 0), "Up": (0, -1), "Down": (0, 1)}.items():
        moved, turned = after(f"Shift+Arrow{key}")
        np.testing.assert_allclose(turned, 0.0, atol=1e-6)
        share = 0.05 * scene.bounding_box()["height"]
        assert np.sign(np.round(moved / share)).tolist() == [right, down], (key, moved)
    laid.page.keyboard.press("+")
    camera.still()
    assert not np.allclose(camera.matrix(), whole, atol=1e-3)
    laid.page.keyboard.press("Home")
    camera.still()
    np.testing.assert_allclose(camera.matrix(), whole, atol=1e-6)
    assert laid.text("clock-time") == clock
    laid["help"].click()
    laid.see("help-page", "turn the 3D view")
    laid.page.keyboard.press("Escape")


def test_the_tape_is_coloured_by_the_speed_that_is_reached(laid: Person) -> None:
    made = Made(laid)
    set_speed = made.setup.process.lay_speed_mm_per_s
    laid["view-top"].click()
    laid["view-fit"].click()
    laid["clock-place"].click()
    laid.page.keyboard.press("End")
    laid["colouring"].select_option("speed")
    laid.see("legend", "speed reached, mm/s")
    ticks = [float(tick) for tick in laid["legend"].locator(".ticks span").all_text_contents()]
    assert ticks == [0.0, set_speed / 2, set_speed]
    camera = Camera(laid)
    red, green, blue = np.moveaxis(below_the_buttons(laid), 2, 0)
    # Most of the tape is laid at the set speed, and its ends are not.
    fast = ((red > 2 * blue) & (green > 1.8 * blue)).sum()
    slow = ((green > 1.2 * red) & (blue > 1.2 * red)).sum()
    assert fast > 5000 and 50 < slow < fast / 2, (fast, slow)
    laid.keep("colour-speed")
    answer = laid.get(f"/api/v1/jobs/{laid.job()}/errors")
    columns = answer.headers["x-columns"].split(",")
    errors = dict(zip(columns, np.frombuffer(answer.body(), "<f4").reshape(-1, len(columns)).T, strict=True))
    own = errors["course"] == 5
    along, speeds = errors["arc_length_mm"][own], errors["speed_mm_per_s"][own]
    curve = Curve(courses_in_machine(parse_courses(COURSES, EXAMPLE), made.setup)[4])
    for wanted in (int(np.argmax(speeds > set_speed / 2)), len(along) // 2):
        place = curve.at(np.array([along[wanted] / 1e3]))[0][0]
        laid["view-fit"].click()
        camera.still()
        camera.approach(place)
        camera.point_at(place)
        words = laid.text("scene-label").splitlines()
        told = float(words[1].split(" mm")[0])
        assert words[-1].startswith("speed ") and words[-1].endswith(" mm/s"), words
        assert abs(told - along[wanted]) < 5
        speed = float(words[-1].removeprefix("speed ").removesuffix(" mm/s"))
        assert speed == pytest.approx(np.interp(told, along, speeds), abs=0.03 * set_speed)
    laid["colouring"].select_option("course")
    api.expect(laid["legend"]).to_have_count(0)


def phases_of(made: Made) -> list[str]:
    """What the machine does in each block, by the program alone."""
    moves = made.trajectory
    held = np.vstack([moves.start, moves.positions])
    for row in range(1, len(held)):
        held[row] = np.where(np.isnan(held[row]), held[row - 1], held[row])
    moved = np.nan_to_num(held[1:]) != np.nan_to_num(held[:-1])
    down = np.cumsum((moves.events == Event.SHOE_DOWN).astype(int) - (moves.events == Event.SHOE_UP)) > 0
    fed = moved[:, moves.column("u")] & (moves.kinds == Kind.LINEAR)
    found = np.where(down, "laying", np.where(fed, "threading", "link"))
    return list(np.where(moved.any(axis=1), found, "stop"))


# So fast that the tape stops for knives, and a shoe that the machine waits for.
HASTY = b"[process]\nlay_speed_mm_per_s = 1000\n[head]\ndelays_ms = {shoe = 400, knife = 600}\n"


def test_the_ruler_tells_what_the_machine_does_when(laid: Person) -> None:
    laid.choose_file("load-setup", "hasty.toml", HASTY)
    api.expect(laid["field-process-lay_speed_mm_per_s"]).to_have_value("1000")
    assert laid.generate() == "done"
    laid.made()
    made = Made(laid)
    duration, bands = made.report["duration_s"], []
    for path in laid["ruler"].locator("path.band").all():
        spans = re.findall(r"M([\d.]+) \.5H([\d.]+)", path.get_attribute("d"))
        bands += [(float(begin), float(end), path.get_attribute("data-phase")) for begin, end in spans]
    bands.sort()
    begins, ends, phases = (np.array(column) for column in zip(*bands, strict=True))
    # They cover the program's time without gaps, on the slider's scale.
    np.testing.assert_allclose(begins, [0.0, *ends[:-1]], atol=1e-4)
    assert ends[-1] == pytest.approx(duration, abs=1e-3)
    assert float(laid["scrub"].get_attribute("max")) == pytest.approx(duration, abs=1e-3)
    assert float(laid["ruler"].get_attribute("viewBox").split()[2]) == pytest.approx(duration, abs=1e-3)
    slider, ruler = laid["scrub"].bounding_box(), laid["ruler"].bounding_box()
    assert ruler["y"] >= slider["y"] and slider["width"] - 24 < ruler["width"] < slider["width"]
    moves, expected = made.trajectory, phases_of(made)
    assert moves.duration == pytest.approx(duration, rel=1e-6)
    lasting = np.flatnonzero(moves.durations > 2e-3)
    told = phases[np.searchsorted(ends, moves.times[lasting] - moves.durations[lasting] / 2)]
    assert list(told) == [expected[block] for block in lasting]
    assert set(phases) == {"laying", "threading", "link", "stop"}
    share = 100 * np.sum((ends - begins)[phases == "threading"]) / duration
    threading = np.sum(moves.durations[[phase == "threading" for phase in expected]])
    assert share == pytest.approx(100 * threading / duration, abs=0.1)
    # Stops that take no time are marked where they are.
    marks = laid["ruler"].locator("path.mark[data-phase=stop]").get_attribute("d")
    stops = [moves.times[np.flatnonzero(moves.lines == stop["line"])[-1]] for stop in made.report["stops"]]
    assert len(stops) == made.report["laying_stops"] > 0
    np.testing.assert_allclose([float(mark) for mark in re.findall(r"M([\d.]+) 0V1", marks)], stops, atol=1e-3)
    legend = {span.text_content(): span.get_attribute("title") for span in laid["phases"].locator("span").all()}
    assert set(legend) == {"laying", "threading", "links", "stops"}
    assert legend["threading"].endswith(f", {share:.1f} %")
    assert legend["stops"].endswith(f" %, {len(stops)} while laying")
    laid.keep("ruler")
    laid["reset-setup"].click()


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
