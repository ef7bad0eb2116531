"""Places on the work in 3D: what is pointed at is what is told, and where machine and program go."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.courses.course_file import parse_courses
from tapelayer.geometry.curves import Curve
from tapelayer.laying.placing import courses_in_machine
from tests.helpers.browsing import Person, api, chromium
from tests.helpers.served import Workbench
from tests.workbench.test_page import COURSES, EXAMPLE, Made, assert_on_the_way

pytestmark = pytest.mark.browser

TAPE = re.compile(
    r"course (\d+), point (\d+)\n(-?[\d.]+) mm along, ([\d.]+) mm to the (left|right)\n"
    r"block (\d+), line (\d+)\nposition error ([\d.]+) mm"
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory, browser: Any) -> Iterator[Workbench]:
    with Workbench(tmp_path_factory.mktemp("work"), "--workers", 1) as workbench:
        yield workbench


def made_by(browser: Any, workbench: Workbench, example: str) -> Person:
    person = Person(browser, workbench.url)
    person.open()
    person["example-select"].select_option(example)
    person.see("file-name", example)
    assert person.generate() == "done"
    person.made()
    return person


@pytest.fixture(scope="module")
def laid(browser: Any, workbench: Workbench) -> Iterator[Person]:
    person = made_by(browser, workbench, EXAMPLE)
    yield person
    person.leave()


@pytest.fixture(scope="module")
def sprayed(browser: Any, workbench: Workbench) -> Iterator[Person]:
    person = made_by(browser, workbench, "curved_panel.stl")
    yield person
    person.leave()


class Camera:
    """What the view shows where, once it is at rest."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self.still()

    def still(self) -> None:
        """Wait until nothing is drawn any more."""
        scene, drawn = self.person["scene"], ""
        while drawn != (drawn := scene.get_attribute("data-frames")):
            self.person.page.wait_for_timeout(1200)

    def pixel(self, place: Floats) -> tuple[float, float]:
        """Where a place (3,) in metres in `machine` is seen on the page."""
        scene = self.person["scene"]
        matrix = np.array(scene.get_attribute("data-camera").split(), float).reshape(4, 4).T
        x, y, _, w = matrix @ np.append(place, 1.0)
        box = scene.bounding_box()
        return box["x"] + (1 + x / w) / 2 * box["width"], box["y"] + (1 - y / w) / 2 * box["height"]

    def pixel_size(self, place: Floats, way: Floats) -> float:
        """Millimetres in a way (3,) that a pixel covers at a place."""
        step = np.subtract(self.pixel(place + 1e-3 * way), self.pixel(place))
        return 1.0 / float(np.hypot(*step))

    def approach(self, place: Floats) -> None:
        """Zoom in on a place."""
        self.person.page.mouse.move(*self.pixel(place))
        for _ in range(25):
            self.person.page.mouse.wheel(0, -200)
        self.still()

    def point_at(self, place: Floats) -> None:
        """Point at a place."""
        x, y = self.pixel(place)
        self.person.page.mouse.move(x - 3, y)
        self.person.page.mouse.move(x, y)
        self.person.page.wait_for_timeout(400)


class Places:
    """Places on the courses of the example by the file and the setup alone."""

    def __init__(self, made: Made) -> None:
        self.courses = parse_courses(COURSES, EXAMPLE)
        self.curves = [Curve(path) for path in courses_in_machine(self.courses, made.setup)]

    def at(self, course: int, along: float, across: float) -> tuple[Floats, Floats, Floats]:
        """Place, way along and way to the left at millimetres along and to the left of a course."""
        points, normals, tangents = self.curves[course - 1].at(np.array([along / 1e3]))
        left = np.cross(normals[0], tangents[0])
        return points[0] + across / 1e3 * left, tangents[0], left


def roller(made: Made, joints: Floats) -> Floats:
    """Middle of the roller (n, 3) in metres: square above the tape's nip."""
    poses: Floats = made.machine.forward_all(joints, ("roller",))["roller"]
    return poses[:, :3, 3]


@pytest.mark.parametrize("view", ["top", "iso"])
@pytest.mark.parametrize(("course", "share", "across"), [(2, 0.31, 20.0), (6, 0.73, -25.0), (9, 0.5, 3.0)])
def test_a_click_goes_to_the_place(laid: Person, view: str, course: int, share: float, across: float) -> None:
    made = Made(laid)
    places = Places(made)
    laid.page.keyboard.press("Control+Home")
    laid[f"view-{view}"].click()
    laid["view-fit"].click()
    if laid["hide-head"].get_attribute("aria-pressed") == "false":
        laid["hide-head"].click()
    laid.page.keyboard.press("End")
    camera = Camera(laid)
    along = share * 1e3 * places.curves[course - 1].length
    place, forwards, left = places.at(course, along, across)
    camera.approach(place)
    camera.point_at(place)
    found = TAPE.fullmatch(laid.text("scene-label"))
    assert found, laid.text("scene-label")
    x, y = camera.pixel(place)
    laid.page.mouse.click(x, y)
    api.expect(laid["spot"]).to_have_text(found[0])
    assert int(found[1]) == course
    # The tape is drawn 0.4 mm above the course, and between points up to 0.1 mm off it.
    doubt = 0.5 + 1.5 * camera.pixel_size(place, forwards), 0.5 + 1.5 * camera.pixel_size(place, left)
    told = float(found[3]), float(found[4]) * (1 if found[5] == "left" else -1)
    assert abs(told[0] - along) < doubt[0] < 4 and abs(told[1] - across) < doubt[1] < 4
    lengths = 1e3 * (places.courses[course - 1].arc_lengths - places.courses[course - 1].arc_lengths[0])
    assert abs(lengths[int(found[2]) - 1] - told[0]) <= np.min(np.abs(lengths - told[0])) + 0.1
    # Between its ends, the block that is named takes the roller over the place, by the program and the URDF alone.
    row, moves = int(found[6]) - 1, made.trajectory
    assert moves.lines[row] == int(found[7]) and moves.courses[row] == course - 1
    centre, forwards, left = places.at(course, told[0], 0.0)
    before, after = (roller(made, moves.positions[row - 1 : row + 1]) - centre) @ forwards
    assert before - 1e-4 <= 0 <= after + 1e-4
    # Clock, machine and program are there.
    laid.see("clock-place", re.compile(rf"^block {row + 1} of .* line {found[7]} .*course {course}"))
    assert_on_the_way(laid, made)
    off = roller(made, made.joints(laid.axes()))[0] - centre
    assert abs(off @ forwards) < 1.5e-4 and abs(off @ left) < 1.5e-4
    api.expect(laid["course-select"]).to_have_value(str(course))
    laid.keep(f"spot-{view}-{course}")


def test_only_what_is_laid_and_visible_is_met(laid: Person) -> None:
    places = Places(Made(laid))
    laid["view-iso"].click()
    laid["view-fit"].click()
    place, *_ = places.at(8, 200.0, 0.0)
    for key, met in (("End", True), ("Home", False)):
        laid["clock-place"].click()
        laid.page.keyboard.press(key)
        camera = Camera(laid)
        camera.point_at(place)
        assert laid["scene-label"].is_visible() is met, key
    x, y = camera.pixel(place)
    laid.page.mouse.click(x, y)
    assert not laid["spot"].is_visible()


def test_tape_behind_the_head_is_not_met_through_it(laid: Person) -> None:
    made = Made(laid)
    laid["view-iso"].click()
    laid["view-fit"].click()
    row = sum(made.course_rows(8)) // 2
    laid.click_line(int(made.trajectory.lines[row]))
    if laid["hide-head"].get_attribute("aria-pressed") == "true":
        laid["hide-head"].click()
    # The middle of the roller is inside the head, and the tape of the courses before lies behind it.
    middle = roller(made, made.joints(laid.axes()))[0]
    for hidden in (False, True):
        camera = Camera(laid)
        camera.point_at(middle)
        laid.keep(f"head-{'hidden' if hidden else 'shown'}")
        assert laid["scene-label"].is_visible() is hidden
        laid["hide-head"].click()
