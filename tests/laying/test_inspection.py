"""Verification measures what is there, and bites."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tapelayer.courses.course import Course
from tapelayer.errors import VerificationFailed
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.inspection import Inspector, verify
from tapelayer.laying.program import plan
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tapelayer.verification.failures import Failure
from tests.helpers.machines import TEN_AXES, limited, tape_layer
from tests.helpers.plies import PLIES, courses_of
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course, helix_course
from tests.helpers.trajectories import Rows, changed, moved, untimed, without

COURSES = (flat_course(7), helix_course(8, heading=0.4, start=(0.5, -0.1)))
C, A = TEN_AXES.index("c"), TEN_AXES.index("a")


@dataclass(frozen=True)
class Good:
    """A trajectory that is right, its inspector, and the rows at which it is spoilt."""

    inspector: Inspector
    trajectory: Trajectory

    def laid(self, index: int) -> np.ndarray:
        """Rows of a course's linear blocks between the shoe's words."""
        of_course = self.trajectory.courses == index
        down = np.flatnonzero(of_course & (self.trajectory.events == Event.SHOE_DOWN))[0]
        up = np.flatnonzero(of_course & (self.trajectory.events == Event.SHOE_UP))[0]
        rows = np.arange(down, up)
        return rows[self.trajectory.kinds[rows] == Kind.LINEAR]

    @property
    def middle(self) -> int:
        return int(self.laid(1)[10])

    def at(self, event: Event) -> list[int]:
        return np.flatnonzero(self.trajectory.events == event).tolist()

    def moved(self, axis: str, by: float, rows: Rows | None = None) -> Trajectory:
        return moved(self.trajectory, self.middle if rows is None else rows, axis, by)

    def without(self, rows: Rows) -> Trajectory:
        return without(self.trajectory, rows)

    def changed(self, name: str, value: float, row: int | None = None) -> Trajectory:
        return changed(self.trajectory, name, self.middle if row is None else row, value)


@pytest.fixture(scope="session")
def good() -> Good:
    trajectory = plan(COURSES, setup_of(), tape_layer())
    lines = np.arange(1, len(trajectory) + 1, dtype=np.int32)
    return Good(Inspector(COURSES, setup_of(), tape_layer()), replace(untimed(trajectory), lines=lines))


def test_a_good_trajectory_passes_with_its_numbers(good: Good) -> None:
    evidence = verify(good.trajectory, COURSES, setup_of(), tape_layer()).evidence
    assert evidence.passed
    samples = evidence.samples
    assert np.max(samples.position_errors) < 0.025 * MM
    assert np.max(np.abs(samples.tilts)) < 0.006 * DEG
    assert np.max(np.abs(samples.heading_errors)) < 0.006 * DEG
    assert np.max(np.abs(samples.tape_errors)) < 0.025 * MM
    assert (evidence.courses, evidence.points, evidence.blocks) == (2, 122, len(good.trajectory))
    assert evidence.laid_length == pytest.approx(1.2, abs=1e-12)
    assert evidence.duration == good.trajectory.duration
    assert evidence.forward_disagreement < 1e-12
    use = {axis.name: axis for axis in evidence.axes}
    assert use["c"].greatest == pytest.approx(0.4, abs=1e-5)
    assert use["u"].top_speed <= use["u"].speed_limit
    assert use["y"].margin == min(use["y"].least, 2.0 - use["y"].greatest)


Spoil = Callable[[Good], Trajectory]
Line = Callable[[Good], int]


def at_middle(good: Good) -> int:
    return good.middle + 1


def behind_middle(good: Good) -> int:
    return good.middle + 2


def at_end(good: Good) -> int:
    return len(good.trajectory)


def at_second(event: Event) -> Line:
    return lambda good: good.at(event)[1] + 1


def at_first(event: Event) -> Line:
    return lambda good: good.at(event)[0] + 1


def link_rows(good: Good) -> np.ndarray:
    return np.flatnonzero(good.trajectory.kinds == Kind.RAPID)[[3, 4]]


@pytest.mark.parametrize(
    ("what", "spoil", "course", "line"),
    [
        ("position_error_mm", lambda good: good.moved("z", 0.06 * MM), 8, at_middle),
        ("position_error_mm", lambda good: good.moved("x", 0.2 * MM), 8, at_middle),
        ("tape_error_mm", lambda good: good.moved("u", 0.06 * MM), 8, at_middle),
        ("roller_tilt_deg", lambda good: good.moved("a", 0.06 * DEG), 8, at_middle),
        ("heading_error_deg", lambda good: good.moved("c", 0.06 * DEG), 8, at_middle),
        ("position_error_mm", lambda good: good.without(good.laid(1)[8:11]), 8, behind_middle),
        ("laid_length_mm", lambda good: good.without(good.laid(1)[-1:]), 8, lambda good: good.laid(1)[-2] + 1),
        ("tape_run_back_mm", lambda good: good.moved("u", -60 * MM), 8, at_middle),
        ("courses_laid", lambda good: good.without(good.at(Event.SHOE_DOWN)[1:]), 0, at_end),
        ("shoe_switched_again", lambda good: good.without(good.at(Event.SHOE_UP)[:1]), 0, at_second(Event.SHOE_DOWN)),
        ("shoe_left_on", lambda good: good.without(good.at(Event.SHOE_UP)[1:]), 0, at_second(Event.SHOE_DOWN)),
        (
            "heater_switched_again",
            lambda good: good.without(good.at(Event.HEATER_ON)[:1]),
            0,
            at_first(Event.HEATER_OFF),
        ),
        (
            "auxiliary_roller_left_on",
            lambda good: good.without(good.at(Event.ROLLER_UP)[1:]),
            0,
            at_second(Event.ROLLER_DOWN),
        ),
        ("rapid_with_shoe_on", lambda good: good.changed("kinds", Kind.RAPID), 0, at_middle),
        ("axis_y_mm", lambda good: good.moved("y", -1.5, slice(1, None)), 8, at_end),
        (
            "lay_speed_mm_per_s",
            lambda good: good.changed("durations", 0.5 * good.trajectory.durations[good.middle]),
            8,
            at_middle,
        ),
        ("heater_time_s", lambda good: good.changed("durations", 14.0), 8, at_middle),
        (
            "heater_time_s",
            lambda good: replace(
                good.trajectory,
                durations=np.where(good.trajectory.courses == 1, 20.0, 1.0) * good.trajectory.durations,
            ),
            8,
            None,
        ),
        ("axis_x_speed_mm_per_s", lambda good: good.changed("durations", 1e-4), 8, at_middle),
        ("link_clearance_mm", lambda good: good.moved("z", 0.06, link_rows(good)), 8, None),
        ("unstated_axes", lambda good: good.changed("kinds", Kind.LINEAR, 0), 0, lambda good: 1),
        ("unstated_axes", lambda good: good.changed("positions", np.nan), 0, at_middle),
    ],
)
def test_what_is_wrong_is_named_with_its_place(
    good: Good, what: str, spoil: Spoil, course: int, line: Line | None
) -> None:
    found = good.inspector.judge(spoil(good)).failures
    failures = [failure for failure in found if failure.what == what]
    assert len(failures) == 1, found
    assert failures[0].number == course
    if line is not None:
        assert abs(failures[0].line - line(good)) <= 1
    assert ~(failures[0].value <= failures[0].limit) or what in ("laid_length_mm", "courses_laid", "axis_y_mm")


def test_failure_stops_the_way_to_a_program(good: Good) -> None:
    with pytest.raises(
        VerificationFailed, match=r"course 8 point \d+: position_error_mm is 0\.\d+, limit 0\.05"
    ) as caught:
        verify(good.moved("z", 0.06 * MM), COURSES, setup_of(), tape_layer())
    assert isinstance(caught.value.evidence, Evidence)
    assert not caught.value.evidence.passed


def test_a_sentence_names_its_place() -> None:
    assert Failure(3, 7, "tape_error_mm", 1.5, 0.05, 12).sentence() == (
        "line 12: course 3 point 7: tape_error_mm is 1.5, limit 0.05"
    )
    assert Failure(0, 0, "courses_laid", 1, 2).sentence() == "courses_laid is 1, limit 2"


def test_halving_the_sample_step_changes_nothing_visible(good: Good, monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = good.inspector.judge(good.trajectory).samples
    monkeypatch.setattr("tapelayer.verification.sampling.LEAST_SAMPLES", 8)
    monkeypatch.setattr("tapelayer.laying.sampling.LAID_SAMPLE_STEP", 2.5e-3)
    fine = good.inspector.judge(good.trajectory).samples
    assert len(fine.tilts) > 1.9 * len(coarse.tilts)
    for name in ("position_errors", "tilts", "heading_errors", "tape_errors"):
        was, now = (np.max(np.abs(getattr(samples, name))) for samples in (coarse, fine))
        assert now == pytest.approx(was, rel=0.05, abs=1e-6)


def test_a_written_digit_may_exceed_a_speed_by_no_more(good: Good) -> None:
    quick = good.changed("durations", 0.9 * good.trajectory.durations[good.middle])
    step = np.max(np.abs(good.trajectory.positions[good.middle] - good.trajectory.positions[good.middle - 1]))
    digits = np.full(10, 1e-6)
    assert not good.inspector.judge(quick, digits).passed
    assert good.inspector.judge(quick, np.full(10, 0.06 * step)).passed


def test_pinocchio_itself_judges_the_batch_evaluator(good: Good, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = Machine.forward_pinocchio
    monkeypatch.setattr(Machine, "forward_pinocchio", lambda self, q, frame: honest(self, q, frame) + 1e-8)
    assert [f.what for f in good.inspector.judge(good.trajectory).failures] == ["forward_disagreement_m"]


def test_delays_are_part_of_what_is_judged(good: Good) -> None:
    """The words stand earlier by the delay; without it in the setup the same program is wrong."""
    delayed = setup_of("[head]\ndelays_ms = {shoe = 100}")
    trajectory = plan(COURSES, delayed, tape_layer())
    assert Inspector(COURSES, delayed, tape_layer()).judge(trajectory).passed
    assert "laid_length_mm" in {f.what for f in good.inspector.judge(trajectory).failures}


def test_the_papers_form_is_reported_loudly_and_judged_only_where_asked() -> None:
    """Roller up to 28.4 degrees off the surface on the cylinder panel, 5.5 on the boss panel; centre 19.8 mm off."""
    for name, tilt, offset in (("cylinder_panel_15", 28.4, 19.8), ("boss_panel_20", 5.5, None)):
        courses = courses_of(name)
        setup = setup_of('[process]\nkinematics = "published"')
        evidence = verify(plan(courses, setup, tape_layer()), courses, setup, tape_layer()).evidence
        assert np.max(np.abs(evidence.samples.tilts)) / DEG == pytest.approx(tilt, abs=0.05)
        assert np.max(evidence.samples.position_errors) < 0.025 * MM
        if offset:
            assert np.max(evidence.samples.offsets) / MM == pytest.approx(offset, abs=0.05)
        asked = setup_of('[process]\nkinematics = "published"\n[verification]\nmax_roller_tilt_deg = 1')
        judged = Inspector(courses, asked, tape_layer()).judge(plan(courses, asked, tape_layer()))
        assert {failure.what for failure in judged.failures} == {"roller_tilt_deg"}


@pytest.mark.parametrize(("name", "text"), PLIES.items())
def test_every_ply_is_laid(name: str, text: str) -> None:
    courses = courses_of(name)
    setup = setup_of(text)
    machine = limited(setup)
    trajectory = plan(courses, setup, machine)
    samples = verify(trajectory, courses, setup, machine).evidence.samples
    assert np.max(samples.position_errors) <= 0.03 * MM
    assert np.max(np.abs(samples.tilts)) <= 0.01 * DEG
    assert np.max(np.abs(samples.heading_errors)) <= 0.02 * DEG
    # No jump: while the tape is laid every block's rotary step is small.
    shoe = np.cumsum((trajectory.events == Event.SHOE_DOWN).astype(int) - (trajectory.events == Event.SHOE_UP))
    laying = np.flatnonzero((trajectory.kinds == Kind.LINEAR) & (shoe == 1))
    turns = np.abs(trajectory.positions[laying] - trajectory.begins(laying))[:, [C, A]]
    assert np.max(turns) < 10 * DEG
    assert gantry.lengths(machine).radius == pytest.approx(0.04)


def test_a_dense_course_with_few_digits_is_measured_to_its_very_end() -> None:
    """1,500 points 0.5 mm apart over a mould of R 900, written to 0.001 mm: the nip is sought a roller's wrap away."""
    angle = np.linspace(-25 * DEG, 25 * DEG, 1500)
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    points = np.round(0.9 * normals + [0.5, 1.0, -0.7], 6)
    course = Course(1, points, normals, 0.9 * (angle - angle[0]), (90 * DEG, 90 * DEG))
    samples = verify(plan([course], setup_of(), tape_layer()), [course], setup_of(), tape_layer()).evidence.samples
    assert np.max(samples.position_errors) <= 0.03 * MM
    assert np.max(np.abs(samples.tape_errors)) <= 0.03 * MM
