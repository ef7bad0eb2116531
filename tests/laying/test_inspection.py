"""Verification measures what is there, and bites."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.courses.course import Course
from tapelayer.courses.course_file import read_courses
from tapelayer.errors import VerificationFailed
from tapelayer.laying import sampling
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.inspection import Inspector, verify
from tapelayer.laying.program import plan
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tapelayer.verification import sampling as density
from tests.helpers.surfaces import flat_course, helix_course, setup_of

MACHINE = Machine.load()
COLUMN = {name: column for column, name in enumerate(MACHINE.names)}
COURSES = (flat_course(7), helix_course(8, heading=0.4, start=(0.5, -0.1)))
SETUP = setup_of()
INSPECTOR = Inspector(COURSES, SETUP, MACHINE)
GOOD = plan(COURSES, SETUP, MACHINE)

Change = Callable[[Trajectory], Trajectory]


def laying_rows(index: int) -> np.ndarray:
    of_course = GOOD.courses == index
    down = np.flatnonzero(of_course & (GOOD.events == Event.SHOE_DOWN))[0]
    up = np.flatnonzero(of_course & (GOOD.events == Event.SHOE_UP))[0]
    rows = np.arange(down, up)
    return rows[GOOD.kinds[rows] == Kind.LINEAR]


def moved(axis: str, by: float, rows: np.ndarray | slice | int) -> Change:
    def change(trajectory: Trajectory) -> Trajectory:
        positions = trajectory.positions.copy()
        positions[rows, COLUMN[axis]] += by
        return replace(trajectory, positions=positions)

    return change


def without(rows: np.ndarray) -> Change:
    def change(trajectory: Trajectory) -> Trajectory:
        keep = np.setdiff1d(np.arange(len(trajectory)), rows)
        columns = ("positions", "kinds", "durations", "events", "courses", "stated", "lines")
        return replace(trajectory, **{name: getattr(trajectory, name)[keep] for name in columns})

    return change


def event_rows(event: Event) -> np.ndarray:
    return np.flatnonzero(GOOD.events == event)


def changed(name: str, rows: np.ndarray | int, value: float) -> Change:
    def change(trajectory: Trajectory) -> Trajectory:
        values = getattr(trajectory, name).copy()
        values[rows] = value
        return replace(trajectory, **{name: values})

    return change


def examined(change: Change) -> Evidence:
    lines = np.arange(1, len(GOOD) + 1, dtype=np.int32)
    return INSPECTOR.judge(change(replace(GOOD, lines=lines)))


MIDDLE = laying_rows(1)[10]
AFTER = np.arange(MIDDLE, laying_rows(1)[-1] + 1)


def test_a_good_trajectory_passes_with_its_numbers() -> None:
    evidence = verify(GOOD, COURSES, SETUP, MACHINE).evidence
    assert evidence.passed
    samples = evidence.samples
    assert np.max(samples.position_errors) < 0.025 * MM
    assert np.max(np.abs(samples.tilts)) < 0.006 * DEG
    assert np.max(np.abs(samples.heading_errors)) < 0.006 * DEG
    assert np.max(np.abs(samples.tape_errors)) < 0.025 * MM
    assert (evidence.courses, evidence.points, evidence.blocks) == (2, 122, len(GOOD))
    assert evidence.laid_length == pytest.approx(1.2, abs=1e-12)
    assert evidence.duration == GOOD.duration
    assert evidence.forward_disagreement < 1e-12
    use = {axis.name: axis for axis in evidence.axes}
    assert use["c"].greatest == pytest.approx(0.4, abs=1e-6)
    assert use["u"].top_speed <= use["u"].speed_limit
    assert use["y"].margin == min(use["y"].least, 2.0 - use["y"].greatest)


@pytest.mark.parametrize(
    ("what", "change", "course", "line"),
    [
        ("position_error_mm", moved("z", 0.06 * MM, MIDDLE), 8, MIDDLE + 1),
        ("position_error_mm", moved("x", 0.2 * MM, MIDDLE), 8, MIDDLE + 1),
        ("tape_error_mm", moved("u", 0.06 * MM, MIDDLE), 8, MIDDLE + 1),
        ("roller_tilt_deg", moved("a", 0.06 * DEG, MIDDLE), 8, MIDDLE + 1),
        ("heading_error_deg", moved("c", 0.06 * DEG, MIDDLE), 8, MIDDLE + 1),
        ("position_error_mm", without(laying_rows(1)[8:11]), 8, MIDDLE + 2),
        ("laid_length_mm", without(laying_rows(1)[-1:]), 8, laying_rows(1)[-2] + 1),
        ("tape_run_back_mm", moved("u", -20 * MM, MIDDLE), 8, MIDDLE + 1),
        ("courses_laid", without(event_rows(Event.SHOE_DOWN)[1:]), 0, len(GOOD)),
        ("shoe_switched_again", without(event_rows(Event.SHOE_UP)[:1]), 0, event_rows(Event.SHOE_DOWN)[1] + 1),
        ("shoe_left_on", without(event_rows(Event.SHOE_UP)[1:]), 0, event_rows(Event.SHOE_DOWN)[1] + 1),
        ("heater_switched_again", without(event_rows(Event.HEATER_ON)[:1]), 0, event_rows(Event.HEATER_OFF)[0] + 1),
        ("auxiliary_roller_left_on", without(event_rows(Event.ROLLER_UP)[1:]), 0, event_rows(Event.ROLLER_DOWN)[1] + 1),
        ("rapid_with_shoe_on", changed("kinds", MIDDLE, Kind.RAPID), 0, MIDDLE + 1),
        ("axis_y_mm", moved("y", -1.5, slice(1, None)), 8, len(GOOD)),
        ("lay_speed_mm_per_s", changed("durations", MIDDLE, 0.5 * GOOD.durations[MIDDLE]), 8, MIDDLE + 1),
        ("axis_x_speed_mm_per_s", changed("durations", MIDDLE, 1e-4), 8, MIDDLE + 1),
        ("link_clearance_mm", moved("z", 0.06, np.flatnonzero(GOOD.kinds == Kind.RAPID)[[3, 4]]), 8, None),
        ("unstated_axes", changed("kinds", 0, Kind.LINEAR), 0, 1),
        ("unstated_axes", changed("positions", MIDDLE, np.nan), 0, MIDDLE + 1),
    ],
)
def test_what_is_wrong_is_named_with_its_place(what: str, change: Change, course: int, line: int | None) -> None:
    failures = [failure for failure in examined(change).failures if failure.what == what]
    assert len(failures) == 1, examined(change).failures
    assert failures[0].number == course
    if line is not None:
        assert abs(failures[0].line - line) <= 1
    assert ~(failures[0].value <= failures[0].limit) or what in ("laid_length_mm", "courses_laid", "axis_y_mm")


def test_failure_stops_the_way_to_a_program() -> None:
    with pytest.raises(
        VerificationFailed, match=r"course 8 point \d+: position_error_mm is 0\.\d+, limit 0\.05"
    ) as caught:
        verify(moved("z", 0.06 * MM, MIDDLE)(GOOD), COURSES, SETUP, MACHINE)
    assert isinstance(caught.value.evidence, Evidence)
    assert not caught.value.evidence.passed


def test_halving_the_sample_step_changes_nothing_visible(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = INSPECTOR.judge(GOOD).samples
    monkeypatch.setattr(density, "LEAST_SAMPLES", 8)
    monkeypatch.setattr(sampling, "LAID_SAMPLE_STEP", 2.5e-3)
    fine = INSPECTOR.judge(GOOD).samples
    assert len(fine.tilts) > 1.9 * len(coarse.tilts)
    for name in ("position_errors", "tilts", "heading_errors", "tape_errors"):
        was, now = (np.max(np.abs(getattr(samples, name))) for samples in (coarse, fine))
        assert now == pytest.approx(was, rel=0.05, abs=1e-6)


def test_a_written_digit_may_exceed_a_speed_by_no_more() -> None:
    quick = changed("durations", MIDDLE, 0.9 * GOOD.durations[MIDDLE])(GOOD)
    step = np.max(np.abs(GOOD.positions[MIDDLE] - GOOD.positions[MIDDLE - 1]))
    digits = np.full(10, 1e-6)
    assert not INSPECTOR.judge(quick, digits).passed
    assert INSPECTOR.judge(quick, np.full(10, 0.06 * step)).passed


def test_pinocchio_itself_judges_the_batch_evaluator(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = Machine.forward_pinocchio
    monkeypatch.setattr(Machine, "forward_pinocchio", lambda self, q, frame: honest(self, q, frame) + 1e-8)
    assert [f.what for f in INSPECTOR.judge(GOOD).failures] == ["forward_disagreement_m"]


def test_delays_are_part_of_what_is_judged() -> None:
    """The words stand earlier by the delay; without it in the setup the same program is wrong."""
    delayed = setup_of("[head]\ndelays_ms = {shoe = 100}")
    trajectory = plan(COURSES, delayed, MACHINE)
    assert Inspector(COURSES, delayed, MACHINE).judge(trajectory).passed
    assert "laid_length_mm" in {f.what for f in INSPECTOR.judge(trajectory).failures}


def test_the_papers_form_is_reported_loudly_and_judged_only_where_asked(shared: object) -> None:
    """Roller up to 28.4 degrees off the surface on the cylinder panel, 5.5 on the boss panel; centre 19.8 mm off."""
    for name, tilt, offset in (("cylinder_panel_15", 28.4, 19.8), ("boss_panel_20", 5.5, None)):
        courses = read_courses(shared / "courses" / f"{name}.txt")  # type: ignore[operator]
        setup = setup_of('[process]\nkinematics = "published"')
        evidence = verify(plan(courses, setup, MACHINE), courses, setup, MACHINE).evidence
        assert np.max(np.abs(evidence.samples.tilts)) / DEG == pytest.approx(tilt, abs=0.05)
        assert np.max(evidence.samples.position_errors) < 0.025 * MM
        if offset:
            assert np.max(evidence.samples.offsets) / MM == pytest.approx(offset, abs=0.05)
        asked = setup_of('[process]\nkinematics = "published"\n[verification]\nmax_roller_tilt_deg = 1')
        assert {f.what for f in Inspector(courses, asked, MACHINE).judge(plan(courses, asked, MACHINE)).failures} == {
            "roller_tilt_deg"
        }


WIDE = "limits_deg = {c = [-180, 180], a = [-30, 30]}"
CLOSED = """
[part]
l1_mm = 1200
l2_mm = -1000
[machine]
limits_deg = {c = [-330, 330], a = [-40, 40]}
[head]
run_out = "none"
wrap_compensation = false
"""


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("flat_panel_00", ""),
        ("boss_panel_20", ""),
        ("cylinder_panel_15", ""),
        ("wing_skin_00", ""),
        ("wing_skin_45", f"[machine]\n{WIDE}"),
        ("real/GEBracket_151", CLOSED),
    ],
)
def test_every_shared_course_file_is_laid(shared: object, name: str, text: str) -> None:
    courses = read_courses(shared / "courses" / f"{name}.txt")  # type: ignore[operator]
    setup = setup_of(text)
    machine = MACHINE.with_limits(setup.machine.travel(), setup.machine.speeds())
    trajectory = plan(courses, setup, machine)
    samples = verify(trajectory, courses, setup, machine).evidence.samples
    assert np.max(samples.position_errors) <= 0.03 * MM
    assert np.max(np.abs(samples.tilts)) <= 0.01 * DEG
    assert np.max(np.abs(samples.heading_errors)) <= 0.02 * DEG
    # No jump: while the tape is laid every block's rotary step is small.
    shoe = np.cumsum((trajectory.events == Event.SHOE_DOWN).astype(int) - (trajectory.events == Event.SHOE_UP))
    laying = np.flatnonzero((trajectory.kinds == Kind.LINEAR) & (shoe == 1))
    turns = np.abs(trajectory.positions[laying] - trajectory.begins(laying))[:, [COLUMN["c"], COLUMN["a"]]]
    assert np.max(turns) < 10 * DEG
    assert gantry.lengths(machine).radius == pytest.approx(0.04)


def test_a_dense_course_with_few_digits_is_measured_to_its_very_end() -> None:
    """1,500 points 0.5 mm apart over a mould of R 900, written to 0.001 mm: the nip is sought a roller's wrap away."""
    angle = np.linspace(-25 * DEG, 25 * DEG, 1500)
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    points = np.round(0.9 * normals + [0.5, 1.0, -0.7], 6)
    course = Course(1, points, normals, 0.9 * (angle - angle[0]), (90 * DEG, 90 * DEG))
    samples = verify(plan([course], SETUP, MACHINE), [course], SETUP, MACHINE).evidence.samples
    assert np.max(samples.position_errors) <= 0.03 * MM
    assert np.max(np.abs(samples.tape_errors)) <= 0.03 * MM
