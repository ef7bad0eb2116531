"""Places on the work in 3D: what is pointed at is what is told, and where machine and program go."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from post import reader
from post.controllers import load
from tapelayer.arrays import Floats
from tapelayer.courses.course_file import parse_courses
from tapelayer.geometry.curves import Curve
from tapelayer.jobs.job import machine_of
from tapelayer.laying.placing import courses_in_machine
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import Event
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.settings import SpraySetup
from tests.helpers.browsing import Camera, Person, api
from tests.helpers.served import Workbench
from tests.workbench.test_page import COURSES, EXAMPLE, Made, assert_on_the_way
from urdf import SPRAYER

pytestmark = pytest.mark.browser

TAPE = re.compile(
    r"course (\d+), point (\d+)\n(-?[\d.]+) mm along, ([\d.]+) mm to the (left|right)\n"
    r"block (\d+), line (\d+)\nposition error ([\d.]+) mm"
)


def made_by(browser: Any, workbench: Workbench, example: str, **footprint: object) -> Person:
    person = Person(browser, workbench.url)
    person.open()
    person["example-select"].select_option(example)
    person.see("file-name", example)
    if footprint:
        person.fill("footprint", **footprint)
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
    person = made_by(browser, workbench, "curved_panel.stl", rate_mm3_per_s=60)
    yield person
    person.leave()


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


class Sprayed:
    """What a spray job made, by the program's own text, and the coat as the server tells it.

    Attributes:
        machine: the robot.
        moves: the blocks of the program.
        gun: (blocks, 3) working point at each block's end, metres.
        lit: (blocks,) whether the gun sprays in each block.
        samples: (n, 3) points of the surface, metres.
        thickness: (n,) of the finished coat, micrometres.
    """

    def __init__(self, person: Person) -> None:
        path = f"/api/v1/jobs/{person.job()}"
        self.setup = parse_setup(person.get(f"{path}/setup").body(), "setup.toml", SpraySetup)
        self.machine = machine_of(self.setup, SPRAYER)
        # The standoff is set by hand.
        self.axes = [axis for axis in self.machine.axes if axis.name != "standoff"]
        controller, limits = load(self.setup.output.controller), Limits.of(self.axes)
        text = person.get(f"{path}/program").body()
        names = tuple(axis.name for axis in self.axes)
        self.moves = reader.read(text, controller, names, limits, "a.nc").trajectory
        # Before every axis is stated, the gun is nowhere known.
        stated = np.isfinite(self.moves.positions).all(axis=1)
        self.gun = np.full((len(stated), 3), np.nan)
        self.gun[stated] = self.place(self.moves.positions[stated])
        switched = np.where(self.moves.events == Event.ARC_ON, 1, 0) - np.where(
            self.moves.events == Event.ARC_OFF, 1, 0
        )
        self.lit = (np.cumsum(switched) > 0) & (self.moves.events == Event.NONE)
        answer = person.get(f"{path}/coat")
        assert answer.headers["x-unit"] == "um"
        rows = (
            np.frombuffer(answer.body(), "<f4").reshape(-1, len(answer.headers["x-columns"].split(","))).astype(float)
        )
        self.samples, self.thickness = rows[:, :3] / 1e3, rows[:, -1]

    def place(self, joints: Floats) -> Floats:
        """Working point (n, 3) in metres at axis values (n, 5)."""
        values = np.zeros((len(joints), len(self.machine.axes)))
        values[:, [self.machine.names.index(axis.name) for axis in self.axes]] = joints
        poses: Floats = self.machine.forward_all(values, ("P",))["P"]
        return poses[:, :3, 3]

    def distances(self, place: Floats) -> Floats:
        """Distance (blocks,) of a place from the way of each block with the gun on, metres."""
        begin, end = self.gun[:-1], self.gun[1:]
        way = end - begin
        share = np.einsum("ij,ij->i", place - begin, way) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-18)
        off = np.linalg.norm(begin + np.clip(share, 0, 1)[:, None] * way - place, axis=1)
        return np.append(np.inf, np.where(self.lit[1:], off, np.inf))


@pytest.mark.parametrize("share", [0.3, 0.62])
def test_a_place_on_the_coat_tells_its_thickness_and_its_pass(sprayed: Person, share: float) -> None:
    made = Sprayed(sprayed)
    sprayed["view-top"].click()
    sprayed["view-fit"].click()
    low, high = made.samples.min(axis=0), made.samples.max(axis=0)
    wanted = low + np.array([share, 1 - share, 1]) * (high - low)
    sample = int(np.argmin(np.linalg.norm((made.samples - wanted)[:, :2], axis=1)))
    place = made.samples[sample]
    sprayed["clock-place"].click()
    sprayed.page.keyboard.press("End")
    camera = Camera(sprayed)
    camera.approach(place)
    camera.point_at(place)
    told = re.fullmatch(
        r"pass (\d+), point (\d+)\n([\d.]+) mm along, ([\d.]+) mm to the (?:left|right)\n"
        r"block (\d+), line (\d+)\nthickness ([\d.]+) µm",
        sprayed.text("scene-label"),
    )
    assert told, sprayed.text("scene-label")
    assert float(told[7]) == pytest.approx(made.thickness[sample], rel=0.01)
    row, distances = int(told[5]) - 1, made.distances(place)
    assert (made.moves.lines[row], made.moves.courses[row]) == (int(told[6]), int(told[1]) - 1)
    assert abs(1e3 * distances[row] - float(told[4])) < 1.0
    assert distances[row] <= np.min(distances) + 1e-3
    sprayed.page.mouse.click(*camera.pixel(place))
    sprayed.see("clock-place", re.compile(rf"^block {row + 1} of .* line {told[6]} .*pass {told[1]}"))
    api.expect(sprayed["course-select"]).to_have_value(told[1])
    values = np.array([[float(sprayed.axes()[axis.name]) for axis in made.axes]])
    there = made.place(np.where([axis.revolute for axis in made.axes], np.radians(values), values / 1e3))[0]
    assert abs(1e3 * np.linalg.norm(there - place) - float(told[4])) < 1.5
    sprayed.keep(f"spot-coat-{share}")
    # Before the gun came, there is nothing to go to.
    sprayed["clock-place"].click()
    sprayed.page.keyboard.press("Home")
    camera.still()
    camera.point_at(place)
    assert sprayed.text("scene-label") == "no coat yet"
    sprayed.page.mouse.click(*camera.pixel(place))
    api.expect(sprayed["spot"]).to_be_hidden()


def test_the_coat_s_scale_is_set(sprayed: Person) -> None:
    made = Sprayed(sprayed)
    sprayed["view-top"].click()
    sprayed["view-fit"].click()
    sprayed["clock-place"].click()
    sprayed.page.keyboard.press("End")
    mean = float(np.mean(made.thickness))

    def coloured() -> tuple[int, int, int]:
        """Pixels that are pale blue, between, and red."""
        camera.still()
        picture = sprayed.picture("scene")[60:, 230:]
        red, green, blue = np.moveaxis(picture, 2, 0)
        over = (red > 2 * green) & (red > 2 * blue) & (red > 90)
        under = (blue > 1.1 * green) & (green > 1.15 * red) & (blue > 130)
        between = (green > 1.3 * red) & (green > 1.1 * blue)
        return int(under.sum()), int(between.sum()), int(over.sum())

    camera = Camera(sprayed)
    sprayed.see("legend", "under the mean − 20 %")
    assert coloured()[1] > 5000
    for target, words, most in ((3 * mean, "under the target − 10 %", 0), (mean / 3, "over the target + 10 %", 2)):
        sprayed["coat-span"].fill("10")
        sprayed["coat-target"].fill(f"{target:.3f}")
        sprayed["coat-target"].press("Enter")
        sprayed.see("legend", words)
        counts = coloured()
        sprayed.keep(f"coat-scale-{most}")
        assert counts[most] > 5000 and counts[most] > 20 * counts[2 - most], (target, counts)
    sprayed["language"].select_option("zh")
    sprayed.see("legend", "目标值 + 10 %")
    sprayed["language"].select_option("en")
    sprayed["coat-target"].fill("")
    sprayed["coat-target"].press("Enter")
    sprayed.see("legend", "over the mean + 10 %")


def test_passes_are_coloured_by_the_speed_that_is_reached(sprayed: Person) -> None:
    made = Sprayed(sprayed)
    sprayed["view-top"].click()
    sprayed["view-fit"].click()
    sprayed["clock-place"].click()
    sprayed.page.keyboard.press("End")
    sprayed["colouring"].select_option("speed")
    sprayed.see("legend", "speed reached, mm/s")
    set_speed = made.setup.spray.speed_mm_per_s
    ticks = [float(tick) for tick in sprayed["legend"].locator(".ticks span").all_text_contents()]
    assert ticks == [0.0, set_speed / 2, set_speed]
    camera = Camera(sprayed)
    table = sprayed.get(f"/api/v1/jobs/{sprayed.job()}/errors")
    columns = table.headers["x-columns"].split(",")
    errors = dict(zip(columns, np.frombuffer(table.body(), "<f4").reshape(-1, len(columns)).T, strict=True))
    middle = made.samples[int(np.argmin(np.linalg.norm(made.samples - made.samples.mean(axis=0), axis=1)))]
    camera.approach(middle)
    camera.point_at(middle)
    sprayed.keep("colour-speed-sprayed")
    words = sprayed.text("scene-label").splitlines()
    number, along = (float(re.search(r"[\d.]+", line)[0]) for line in words[:2])
    own = errors["pass"] == number
    speed = float(re.fullmatch(r"speed ([\d.]+) mm/s", words[-1])[1])
    assert speed == pytest.approx(np.interp(along, errors["arc_length_mm"][own], errors["speed_mm_per_s"][own]), abs=2)
    # What is not sprayed yet has no colour: fewer and fewer coloured pixels towards the program's start.
    sprayed["view-fit"].click()
    coloured = []
    for share in (1.0, 0.5, 0.0):
        slider = sprayed["scrub"].bounding_box()
        sprayed.page.mouse.click(slider["x"] + 8 + share * (slider["width"] - 16), slider["y"] + slider["height"] / 2)
        camera.still()
        red, green, blue = np.moveaxis(sprayed.picture("scene")[60:, 230:], 2, 0)
        coloured.append(int(((red > 1.6 * blue) & (green > 1.5 * blue)).sum()))
    assert coloured[0] > 1.5 * coloured[1] > 3 * coloured[2] and coloured[1] > 500, coloured
    spans = sprayed["ruler"].locator("path.band[data-phase=on]").get_attribute("d")
    on = sum(float(end) - float(begin) for begin, end in re.findall(r"M([\d.]+) \.5H([\d.]+)", spans))
    assert on == pytest.approx(np.sum(made.moves.durations[made.lit]), rel=1e-3)
    sprayed["colouring"].select_option("coat")
    sprayed.see("legend", "thickness")


def test_a_spray_job_speaks_of_passes_alone(sprayed: Person) -> None:
    for place in ("program", "course-select", "scene", "ledger", "verdict"):
        told = " ".join([sprayed.text(place), sprayed[place].get_attribute("aria-label") or ""])
        assert "course" not in told.lower(), place
    first = sprayed["course-select"].locator("option")
    assert (first.nth(0).text_content(), first.nth(1).text_content()) == ("Go to pass", "pass 1")
    sprayed["course-select"].select_option("3")
    api.expect(sprayed.program().locator(".nc-chosen").first).to_have_text(re.compile(r"^\(pass 3 of \d+\)$"))
    sprayed["language"].select_option("zh")
    assert first.nth(0).text_content() == "跳转到喷涂道次"
    sprayed["language"].select_option("en")
