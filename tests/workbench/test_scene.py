"""Scene: the tables say what the program says, and lie where the tape and the coat lie."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tapelayer.arrays import Floats, Ints
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses
from tapelayer.geometry.mesh import Mesh
from tapelayer.jobs.kinds import kind_of
from tapelayer.laying.job import Job, LayingResult
from tapelayer.laying.scene import needed
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.spraying.coat import coat_of
from tapelayer.spraying.evidence import SpraySamples
from tapelayer.spraying.job import SprayJob, SprayResult
from tapelayer.spraying.reach import Reach
from tapelayer.spraying.scene import coat_table
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM
from tapelayer.workbench import scene
from tests.helpers.panels import mesh_of, sheet, write_stl
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course, helix_course

# Part origin of the default setup, metres.
ORIGIN = np.array([0.3, -1.9, -1.4])
RADIUS, HEADING, START = 1.5, 0.3, 0.5
ANGLES = (math.radians(45), math.radians(120))


class Scene:
    """A scene's files, read as a client reads them."""

    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = files
        self.blocks = json.loads(files["blocks.json"])

    def told(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.files[f"{name}.json"])
        return found

    def rows(self, name: str) -> Floats:
        """The table's rows, its bytes complete."""
        told = self.told(name)
        table = np.frombuffer(self.files[f"{name}.f32"], "<f4").reshape(-1, len(told["columns"]))
        assert len(table) == told["rows"]
        return table.astype(np.float64)

    def column(self, table: str, name: str) -> Floats:
        return self.rows(table)[:, self.told(table)["columns"].index(name)]

    def joints(self) -> Floats:
        """Axis values in metres and radians."""
        names = self.told("poses")["columns"][1:]
        return self.rows("poses")[:, 1:] * [MM if name.endswith("_mm") else DEG for name in names]


def made_of(courses: list[Course], setup: Setup) -> LayingResult:
    return Job.of(format_courses(courses), "panel.txt", setup).make("panel.nc")


def scene_of(made: LayingResult | SprayResult, mould: Mesh | None = None) -> Scene:
    kind = kind_of("spray" if isinstance(made, SprayResult) else "lay")
    drawn = kind.scene(made, mould)
    return Scene(scene.files(drawn) | scene.motion_files(drawn.numbers, made.trajectory, made.job.machine))


@pytest.fixture(scope="module")
def laid() -> LayingResult:
    """Two courses on a cylinder, the numbers not in order."""
    courses = [helix_course(number=7, heading=HEADING), helix_course(number=3, heading=HEADING, start=(0.6, 0.0))]
    made = made_of([replace(course, cut_angles=ANGLES) for course in courses], setup_of())
    assert made.failure is None
    return made


@pytest.fixture(scope="module")
def drawn(laid: LayingResult) -> Scene:
    return scene_of(laid)


@pytest.fixture(scope="module")
def sprayed(tmp_path_factory: pytest.TempPathFactory) -> SprayResult:
    path = tmp_path_factory.mktemp("spray") / "wave.stl"
    write_stl(path, sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y))
    setup = SpraySetup().with_values("footprint", rate_mm3_per_s=200.0)
    made = SprayJob.read(path, setup).make("wave.nc")
    assert made.failure is None
    return made


def ends_of(drawn: Scene) -> Ints:
    """Return the first row and those that end a block (n,)."""
    return np.flatnonzero(np.diff(drawn.blocks["blocks"], append=-1))


def test_rows_have_the_values_of_their_lines(laid: LayingResult, drawn: Scene) -> None:
    lines = laid.text.decode().splitlines()
    poses, names = drawn.rows("poses"), drawn.told("poses")["columns"]
    letters = {
        letter: names.index(next(n for n in names if n.startswith(f"{letter.lower()}_"))) for letter in "XYZCAUVDQE"
    }
    now = np.full(len(names), np.nan)
    assert len(poses) == drawn.blocks["rows"]
    ends = ends_of(drawn)
    assert len(ends) == len(laid.trajectory) + 1
    for row, line in zip(ends, np.array(drawn.blocks["lines"])[ends], strict=True):
        for letter, value in re.findall(r"([A-Z])(-?\d+\.\d*)", lines[line - 1] if line else ""):
            if letter in letters:
                now[letters[letter]] = float(value)
        now[0] = poses[row, 0]
        np.testing.assert_array_equal(poses[row], now.astype(np.float32))
    assert np.all(np.isnan(poses[0, 1:])) and poses[0, 0] == 0.0
    assert not np.any(np.isnan(poses[-1]))


def test_blocks_name_their_courses_kinds_and_events(laid: LayingResult, drawn: Scene) -> None:
    assert [drawn.blocks["blocks"][row] for row in ends_of(drawn)] == list(range(len(laid.trajectory) + 1))
    blocks, found, ends = dict(drawn.blocks), laid.trajectory, ends_of(drawn)
    for name in ("lines", "courses", "kinds", "events"):
        # What a block is, it is in all its rows.
        assert np.repeat(np.array(blocks[name])[ends], np.diff(ends, prepend=-1)).tolist() == blocks[name]
        blocks[name] = np.array(blocks[name])[ends].tolist()
    assert [len(blocks[name]) for name in ("lines", "courses", "kinds", "events")] == 4 * [len(found) + 1]
    assert [blocks["kind_names"][kind] for kind in blocks["kinds"]] == [
        "start",
        *(Kind(k).name.lower() for k in found.kinds),
    ]
    events = [blocks["event_names"][event] for event in blocks["events"]]
    assert events == ["none", *(Event(event).name.lower() for event in found.events)]
    down = [row for row, event in enumerate(events) if event == "shoe_down"]
    assert [blocks["courses"][row] for row in down] == [7, 3]
    assert blocks["courses"][0] == 0
    assert blocks["lines"][1:] == sorted(blocks["lines"][1:])


def test_the_roller_stands_on_the_course_in_every_row_that_lays(laid: LayingResult, drawn: Scene) -> None:
    times = drawn.column("poses", "time_s")
    events = np.array(drawn.blocks["events"])
    laying = np.cumsum((events == Event.SHOE_DOWN).astype(int) - (events == Event.SHOE_UP)) > 0
    joints = drawn.joints()[laying]
    machine, radius = laid.job.machine, laid.evidence.roller_radius
    centres = machine.forward_pinocchio(joints, "roller")[:, :3, 3] - ORIGIN - [0.0, 1.0, -RADIUS]
    report = laid.report()
    # Single precision: 2,000 mm to an eighth of a micrometre, and some axes add up.
    slack = report["max_position_error_mm"] * MM + 1e-6
    assert np.max(np.abs(np.hypot(centres[:, 1], centres[:, 2]) - RADIUS - radius)) <= slack
    angles, start = np.arctan2(centres[:, 1], centres[:, 2]), np.array(drawn.blocks["courses"])[laying]
    x = centres[:, 0] - np.where(start == 7, 0.5, 0.6)
    lateral = x * math.cos(HEADING) - RADIUS * angles * math.sin(HEADING)
    assert np.max(np.abs(lateral)) <= slack
    assert np.sum(laying) > 100 and np.all(np.diff(times) >= 0.0)


def test_what_is_drawn_is_where_the_control_is_at_every_time(laid: LayingResult, drawn: Scene) -> None:
    moves, times = laid.trajectory, drawn.column("poses", "time_s")
    ramped = np.flatnonzero(moves.clock.ramps > 0.0) if moves.clock else []
    assert len(ramped) > 20 and len(times) > len(moves) + len(ramped)
    moments = np.linspace(0.0, moves.duration, 20001)
    blocks = np.minimum(np.searchsorted(moves.times, moments), len(moves) - 1)
    there = moves.within(blocks, moves.fractions(blocks, moments))
    rows = np.column_stack([np.interp(moments, times, column) for column in drawn.joints().T])
    stated = np.isfinite(there) & np.isfinite(rows)
    assert np.mean(stated) > 0.9
    # Times are in single precision: so much may pass at the greatest speed.
    slack = np.spacing(np.float32(moves.duration)) * np.nanmax(np.abs(np.diff(there, axis=0)), axis=0) / moments[1]
    assert np.all(np.nanmax(np.where(stated, np.abs(rows - there), 0.0), axis=0) <= scene.TOLERANCE + slack + 1e-6)


def test_speeds_are_those_of_the_report(laid: LayingResult, drawn: Scene) -> None:
    feeding = np.array(drawn.blocks["kinds"]) == Kind.LINEAR
    rows = scene.TrajectoryRows.of(laid.trajectory, laid.job.machine)
    block = rows.block[feeding[1:]]
    shares: dict[str, float] = {}
    ways = np.abs(np.nan_to_num(laid.trajectory.positions - laid.trajectory.begins(np.arange(len(laid.trajectory)))))
    for axis in laid.evidence.axes:
        unit, scale = ("deg", 1 / DEG) if axis.revolute else ("mm", 1 / MM)
        speeds = np.abs(drawn.column("speeds", f"{axis.name}_{unit}_per_s")[feeding])
        # Verification takes one written digit off every way.
        digit = laid.job.controller.resolution(axis.name) * scale
        way = ways[block, laid.trajectory.column(axis.name)] * scale
        top = np.max(speeds * (1.0 - np.minimum(digit / np.maximum(way, digit), 1.0)), initial=0.0)
        if axis.top_speed > 0.0:
            shares[axis.name] = top / (axis.top_speed * scale)
        else:
            assert top == 0.0
    # A row has the mean of its speeds, which is less than their peak where nothing goes on at that.
    assert 0.7 < min(shares.values()) and max(shares.values()) < 1.0 + 1e-4
    assert sum(share > 1.0 - 1e-4 for share in shares.values()) > 4
    assert drawn.told("speeds")["rows"] == drawn.told("poses")["rows"]


def test_errors_are_the_samples(laid: LayingResult, drawn: Scene) -> None:
    samples, report = laid.evidence.samples, laid.report()
    assert drawn.told("errors")["rows"] == len(samples.times)
    assert set(drawn.column("errors", "course")) == {7.0, 3.0}
    for name in ("position_error_mm", "tape_error_mm", "roller_tilt_deg", "heading_error_deg"):
        assert np.max(np.abs(drawn.column("errors", name))) == pytest.approx(report[f"max_{name}"], rel=1e-6)
    hypot = np.hypot(drawn.column("errors", "normal_error_mm"), drawn.column("errors", "lateral_error_mm"))
    np.testing.assert_allclose(hypot, drawn.column("errors", "position_error_mm"), rtol=1e-5, atol=1e-9)
    for course, length in ((7.0, 600.0), (3.0, 600.0)):
        own = drawn.column("errors", "arc_length_mm")[drawn.column("errors", "course") == course]
        assert (own[0], own[-1]) == (0.0, pytest.approx(length, abs=0.05))


def assert_speeds_cover(ways: Floats, times: Floats, speeds: Floats, set_speed: float) -> None:
    """Over its time, the speed covers the way between neighbouring samples; both in mm."""
    covered = np.diff(times) * (speeds[:-1] + speeds[1:]) / 2.0
    assert np.sum(covered) == pytest.approx(np.sum(ways), rel=0.01)
    assert np.max(np.abs(covered - ways)) < 1.0
    assert np.min(speeds) >= 0.0 and np.max(speeds) <= set_speed * 1.001
    # Both at set speed and in ramps.
    assert np.any(speeds > 0.99 * set_speed) and np.sum(speeds < 0.9 * set_speed) > 10


def test_the_tape_s_speed_is_the_one_reached(laid: LayingResult, drawn: Scene) -> None:
    samples, set_speed = laid.evidence.samples, laid.job.setup.process.lay_speed_mm_per_s
    speeds = drawn.column("errors", "speed_mm_per_s")
    for index, number in enumerate((7, 3)):
        own = samples.courses == index
        assert np.all(drawn.column("errors", "course")[own] == number)
        assert_speeds_cover(np.diff(samples.arc_lengths[own]) / MM, samples.times[own], speeds[own], set_speed)


def test_the_gun_s_speed_is_the_one_reached(sprayed: SprayResult) -> None:
    samples, set_speed = sprayed.evidence.samples, sprayed.job.setup.spray.speed_mm_per_s
    speeds = scene_of(sprayed).column("errors", "speed_mm_per_s")
    ways = np.linalg.norm(np.diff(samples.points, axis=0), axis=1) / MM
    longest = max(np.unique(samples.pieces), key=lambda piece: np.sum(samples.pieces == piece))
    own = samples.pieces == longest
    assert_speeds_cover(ways[own[1:] & own[:-1]], samples.times[own], speeds[own], set_speed)


@pytest.mark.parametrize("degrees", [(90.0, 90.0), (45.0, 120.0), (150.0, 20.0), (90.0, 15.0)])
@pytest.mark.parametrize("length", [0.3, 0.6])
def test_flat_tape_is_as_long_and_wide_as_it_is_laid(degrees: tuple[float, float], length: float) -> None:
    heading, width = 0.2, 75.0
    alpha = np.radians(degrees)
    made = made_of([replace(flat_course(length=length, heading=heading), cut_angles=tuple(alpha))], setup_of())
    drawn = scene_of(made)
    rows = drawn.rows("tape")
    left, right = rows[:, 2:5] / 1e3 - ORIGIN - [0.5, 0.5, 0.0], rows[:, 5:8] / 1e3 - ORIGIN - [0.5, 0.5, 0.0]
    along, across = (
        np.array([math.sin(heading), math.cos(heading), 0]),
        np.array([-math.cos(heading), math.sin(heading), 0]),
    )
    area = sum(
        np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1)) / 2
        for a, b, c in ((left[:-1], right[:-1], right[1:]), (left[:-1], right[1:], left[1:]))
    )
    assert area == pytest.approx(length * width / 1e3, rel=2e-4)
    assert np.max(np.abs(np.concatenate([left, right])[:, 2])) < 1e-6
    assert np.min(left @ across - right @ across) > -1e-6
    # Both points of a pair are where the pair is said to be along the course, and the left one across it.
    for side in (left, right):
        np.testing.assert_allclose(side @ along, drawn.column("tape", "arc_length_mm") / 1e3, atol=1e-6)
    np.testing.assert_allclose(left @ across, drawn.column("tape", "left_mm") / 1e3, atol=1e-6)
    assert np.max(np.abs(np.concatenate([left, right]) @ across)) == pytest.approx(width / 2e3, abs=1e-6)
    # Ends of the cuts on both edges: the line at the angle, through the centre line at the course's end.
    for angle, place, pick in ((alpha[0], 0.0, np.min), (alpha[1], length, np.max)):
        for side, half in ((left, width / 2e3), (right, -width / 2e3)):
            edge = side[np.abs(side @ across - half) < 1e-6]
            expected = place + half / math.tan(angle)
            assert pick(edge @ along) == pytest.approx(expected, abs=2e-5)
    # Every point inside the width lies on one of the cuts.
    both = np.concatenate([left, right])
    inner = both[np.abs(both @ across) < width / 2e3 - 1e-6]
    off = [
        np.abs((inner @ along - place) * math.sin(a) - (inner @ across) * math.cos(a))
        for a, place in zip(alpha, (0, length), strict=True)
    ]
    assert np.max(np.minimum(*off), initial=0.0) < 2e-5
    assert len(inner) >= 2 * sum(angle != 90.0 for angle in degrees)


def test_tape_lies_on_the_surface_and_appears_under_the_nip(laid: LayingResult, drawn: Scene) -> None:
    rows, samples = drawn.rows("tape"), laid.evidence.samples
    assert list(dict.fromkeys(rows[:, 1])) == [7.0, 3.0]
    assert np.sum(np.diff(rows[:, 1]) != 0) == 1
    for number, index, start in ((7.0, 0, 0.5), (3.0, 1, 0.6)):
        own, seen = rows[rows[:, 1] == number], samples.courses == index
        assert np.all(np.diff(own[:, 0]) >= 0.0)
        assert (own[0, 0], own[-1, 0]) == pytest.approx((samples.times[seen][0], samples.times[seen][-1]), rel=1e-6)
        left, right = (own[:, columns] / 1e3 - ORIGIN - [start, 1.0, -RADIUS] for columns in (slice(2, 5), slice(5, 8)))
        wide = np.linalg.norm(left - right, axis=1) > 0.075 - 1e-6
        assert np.sum(wide) > 15
        # A line of half the width square to a course that runs at 0.3 rad rises above the cylinder by micrometres.
        for edge in (left, right):
            rise = np.hypot(edge[:, 1], edge[:, 2])[wide] - RADIUS
            expected = np.hypot(RADIUS, 0.0375 * math.sin(HEADING)) - RADIUS
            assert np.max(np.abs(rise - expected)) < 3e-6
        middle = (left + right)[wide] / 2
        angle = np.arctan2(middle[:, 1], middle[:, 2])
        reached = np.interp(own[wide, 0], samples.times[seen], samples.arc_lengths[seen])
        assert np.max(np.abs(middle[:, 0] - reached * math.sin(HEADING))) < 2e-5
        assert np.max(np.abs(RADIUS * angle - reached * math.cos(HEADING))) < 2e-5
        assert np.max(np.linalg.norm(np.diff(middle, axis=0), axis=1)) < 0.026


def test_points_are_the_file_s(laid: LayingResult, drawn: Scene) -> None:
    for course in laid.job.courses:
        own = drawn.column("points", "course") == course.number
        told = drawn.column("points", "arc_length_mm")[own] / 1e3
        np.testing.assert_allclose(told, course.arc_lengths - course.arc_lengths[0], atol=1e-6)
    assert drawn.told("points")["rows"] == sum(len(course.points) for course in laid.job.courses)


def test_what_is_left_out_of_the_tape_is_near_to_straight_lines() -> None:
    rng = np.random.default_rng(5)
    places = np.linspace(0.0, 1.0, 201)
    edges = np.column_stack([np.sin(rng.uniform(2, 9) * places) * 0.03 for _ in range(6)])
    kept = np.zeros(201, dtype=np.bool_)
    kept[[0, 60, 200]] = True
    chosen = needed(places, edges, kept)
    chords = np.column_stack([np.interp(places, places[chosen], column[chosen]) for column in edges.T])
    off = np.linalg.norm((edges - chords).reshape(-1, 2, 3), axis=2)
    assert 0.0 < np.max(off) <= 1e-4
    assert np.all(chosen[kept]) and np.sum(chosen) < 150


@pytest.mark.parametrize("radii", [(0.5, 0.5), (0.5, 0.46), (0.02, 0.02)])
def test_circles_are_divided_as_far_as_they_have_to_be(radii: tuple[float, float]) -> None:
    begin, end = np.array([radii[0], 0.0]), radii[1] * np.array([math.cos(-2.0), math.sin(-2.0)])
    found = circular(np.array([[*begin, 0.1], [*end, 0.2]]))
    path = scene.TrajectoryRows.of(found, Job.of(format_courses([flat_course()]), "a.txt", Setup()).machine)
    times, rows = path.times, path.positions
    dense = np.linspace(0.0, 1.0, 5001)
    on_arc = found.within(np.ones(len(dense), dtype=np.int64), dense)
    straight = np.column_stack([np.interp(1.0 + 3.0 * dense, times, rows[:, axis]) for axis in range(3)])
    off = np.max(np.linalg.norm(on_arc - straight, axis=1))
    assert scene.TOLERANCE / 3 < off <= scene.TOLERANCE
    np.testing.assert_array_equal(rows[-1], [*end, 0.2])
    np.testing.assert_allclose(np.diff(times[2:]), 3.0 / (len(times) - 3 + 1), rtol=1e-9)
    blocks = path.blocks(np.array([9]))
    assert blocks["lines"] == [0, 11, *[12] * (len(times) - 2)]
    assert blocks["courses"] == [0, *[9] * (len(times) - 1)]
    speeds = path.speeds().rows[2:]
    np.testing.assert_allclose(np.hypot(speeds[:, 0], speeds[:, 1]).max(), 1e3 * max(radii) * 2.0 / 3.0, rtol=0.03)


def circular(points: Floats) -> Trajectory:
    """A rapid to the first point (x, y, z), then a clockwise block about the origin to the second."""
    return Trajectory(
        axes=("x", "y", "z"),
        start=np.full(3, np.nan),
        positions=points,
        kinds=np.array([Kind.RAPID, Kind.CLOCKWISE], np.uint8),
        durations=np.array([1.0, 3.0]),
        events=np.zeros(2, np.uint8),
        courses=np.zeros(2, np.int32),
        stated=np.zeros(2, np.uint16),
        lines=np.array([11, 12], np.int32),
        centres=np.array([[np.nan] * 3, [0.0, 0.0, np.nan]]),
        planes=np.zeros(2, np.uint8),
    )


def test_nothing_is_known_of_what_is_not_stated(drawn: Scene) -> None:
    poses, speeds = drawn.rows("poses")[:, 1:], drawn.rows("speeds")
    unknown = np.isnan(poses)
    assert np.all(np.isnan(speeds[unknown]))
    stated = np.argmin(unknown, axis=0)
    for column, row in enumerate(stated):
        assert np.all(np.isnan(speeds[: row + 1, column])) and not np.any(np.isnan(speeds[row + 1 :, column]))
    assert stated[2] < np.min(np.delete(stated, 2))


def test_a_plan_that_failed_is_drawn_without_lines(laid: LayingResult) -> None:
    setup = Setup().with_values("verification", max_position_error_mm=1e-6)
    made = made_of([replace(course) for course in laid.job.courses], setup)
    assert made.text == b""
    drawn = scene_of(made)
    assert set(drawn.blocks["lines"]) == {0}
    assert drawn.told("tape")["rows"] > 50
    assert not np.any(np.isnan(drawn.rows("poses")[-1]))


def test_only_tape_that_is_laid_is_drawn(laid: LayingResult) -> None:
    lines = laid.text.splitlines(keepends=True)
    shoe = [number for number, line in enumerate(lines) if re.search(rb"M20\b", line)]
    made = laid.job.judge(b"".join(lines[: shoe[1]]) + b"M30\n%\n", "panel.nc")
    assert made.failure is not None
    drawn = scene_of(made)
    assert set(drawn.column("tape", "course")) == {7.0}
    never = laid.job.judge(b"".join(lines[: shoe[0]]) + b"M30\n%\n", "panel.nc")
    empty = scene_of(never)
    assert [empty.told(name)["rows"] for name in ("tape", "errors")] == [0, 0]
    assert empty.told("tape")["columns"] == drawn.told("tape")["columns"]


def test_a_mould_lies_where_the_setup_puts_the_part(laid: LayingResult) -> None:
    made = made_of([flat_course()], setup_of("[part]\nrotation_deg = [5, 0, 10]\n"))
    triangles = sheet([0, 100, 200], [0, 50], lambda x, y: 0.01 * x * y)
    tilt, turn = math.radians(5), math.radians(10)
    x, y, z = triangles.reshape(-1, 3).T
    y, z = y * math.cos(tilt) - z * math.sin(tilt), y * math.sin(tilt) + z * math.cos(tilt)
    x, y = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
    expected = np.column_stack([300 + x, y - 1900, z - 1400])
    found = scene_of(made, mesh_of(triangles)).rows("part")
    order = [np.lexsort(np.round(rows, 1).T) for rows in (found, expected)]
    np.testing.assert_allclose(found[order[0]], expected[order[1]], atol=2e-4)
    assert len(found) == 12
    assert "part.f32" not in scene_of(laid).files


def test_large_parts_become_coarser_and_stay_where_they_are() -> None:
    grid = np.linspace(0, 400, 101)
    mesh = mesh_of(sheet(grid, grid, lambda x, y: 20 * np.sin(x / 60) * np.cos(y / 80)))
    corners = scene.part_table(mesh).rows
    assert 0.8 * scene.MOST_TRIANGLES < len(corners) / 3 <= scene.MOST_TRIANGLES
    x, y, z = corners.T
    assert np.max(np.abs(z - 20 * np.sin(x / 60) * np.cos(y / 80))) < 0.5
    np.testing.assert_allclose([corners.min(axis=0)[:2], corners.max(axis=0)[:2]], [[0, 0], [400, 400]], atol=1e-3)


def until(samples: SpraySamples, moment: float) -> SpraySamples:
    """The samples before a moment and one at it, between those on either side."""
    after = int(np.searchsorted(samples.times, moment))
    share = (moment - samples.times[after - 1]) / (samples.times[after] - samples.times[after - 1])
    cut = {}
    for name, values in vars(samples).items():
        last = values[after - 1]
        if np.issubdtype(values.dtype, np.floating):
            last = last + share * (values[after] - last)
        cut[name] = np.concatenate([values[:after], [last]])
    return SpraySamples(**cut)


def test_the_coat_grows_to_what_the_program_leaves(sprayed: SprayResult) -> None:
    drawn, coat = scene_of(sprayed), sprayed.judged.coat
    assert coat is not None
    told, rows = drawn.told("coat"), drawn.rows("coat")
    thickness, times = rows[:, 3:], np.array(told["times"])
    assert (told["unit"], thickness.shape[1]) == ("um", 64)
    assert told["columns"] == ["x_mm", "y_mm", "z_mm", *(f"t{i}" for i in range(64))]
    np.testing.assert_array_equal(rows[:, :3], (coat.surface.points / MM).astype(np.float32))
    np.testing.assert_array_equal(thickness[:, -1], (coat.thickness * 1e6).astype(np.float32))
    assert np.all(thickness[:, 0] == 0.0)
    assert np.min(np.diff(thickness, axis=1)) >= -1e-3 * np.max(thickness)
    samples = sprayed.evidence.samples
    assert np.all(np.diff(times) > 0.0)
    assert (times[0], times[-1]) == pytest.approx((samples.times[0], samples.times[-1]))
    setup = sprayed.job.setup
    reach = Reach(sprayed.job.mesh, setup, sprayed.job.machine)
    for moment in range(5, 63, 6):
        partly = coat_of(until(samples, times[moment]), reach, setup).thickness * 1e6
        assert np.max(np.abs(partly - thickness[:, moment])) < 0.002 * np.max(partly)
        assert np.sum(thickness[:, moment]) == pytest.approx(np.sum(partly), rel=0.001)


def test_a_relative_coat_says_so_and_is_thinned_evenly(sprayed: SprayResult, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tapelayer.spraying.scene.MOST_COAT_SAMPLES", 300)
    coat, setup = sprayed.judged.coat, SpraySetup()
    assert coat is not None
    relative = replace(coat, thickness=coat.thickness / np.mean(coat.thickness), relative=True)
    table = coat_table(relative, sprayed.evidence.samples, setup)
    assert table.extra["unit"] == "relative"
    assert 200 <= len(table.rows) <= 300
    away = np.linalg.norm(table.rows[:, None, :2] - coat.surface.points[None, :, :2] / MM, axis=2)
    assert np.max(np.min(away, axis=0)) < 2 * math.sqrt(300 * 120 / 200)


def test_a_sprayed_program_is_one_of_passes(sprayed: SprayResult) -> None:
    text, passes = sprayed.text.decode(), len(sprayed.job.pass_plan.passes)
    titles = [line for line in text.splitlines() if line.startswith("(pass ")]
    assert titles == [f"(pass {number} of {passes})" for number in range(1, passes + 1)]
    assert "course" not in text


def test_a_spray_scene_has_its_passes_and_part(sprayed: SprayResult) -> None:
    drawn = scene_of(sprayed)
    names = ("poses", "speeds", "errors", "points", "part", "coat")
    assert set(drawn.files) == {"blocks.json", *(f"{name}.{end}" for name in names for end in ("f32", "json"))}
    assert drawn.told("poses")["columns"] == ["time_s", "x_mm", "y_mm", "z_mm", "theta_deg", "phi_deg"]
    passes = len(sprayed.job.pass_plan.passes)
    assert set(drawn.column("errors", "pass")) == set(range(1, passes + 1)) == set(drawn.blocks["courses"]) - {0}
    report = sprayed.report()
    assert np.max(drawn.column("errors", "position_error_mm")) == pytest.approx(
        report["max_position_error_mm"], rel=1e-6
    )
    counted = drawn.column("errors", "beside_crease") == 0.0
    lean = np.nanmax(drawn.column("errors", "deviation_deg")[counted])
    assert lean == pytest.approx(report["max_deviation_deg"], rel=1e-6)
    lengths = [one.path.arc_lengths for one in sprayed.job.pass_plan.passes]
    np.testing.assert_allclose(drawn.column("points", "arc_length_mm") / 1e3, np.concatenate(lengths), atol=1e-6)
    corners = drawn.rows("part") / 1e3
    np.testing.assert_allclose(
        np.sort(corners, axis=0),
        np.sort(sprayed.job.mesh.vertices[sprayed.job.mesh.facets].reshape(-1, 3), axis=0),
        atol=1e-6,
    )
