"""Verification of spraying measures what it says, and bites."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.errors import VerificationFailed
from tapelayer.geometry.mesh import Mesh
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.spraying.evidence import SprayEvidence
from tapelayer.spraying.inspection import SprayInspector
from tapelayer.spraying.passes import Plan
from tapelayer.spraying.program import Spraying, spray
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM
from tapelayer.verification.failures import Failure
from tests.helpers.machines import limited, sprayer
from tests.helpers.panels import flat, mesh_of, sheet
from tests.helpers.sprayed import planned as planned_over
from tests.helpers.sprayed import roof
from tests.helpers.trajectories import moved, reordered, untimed, without

WAVE = "wave"
GAPS = "[spray]\nmax_gap_mm = 20\n"


def triangles_of(name: str) -> Floats:
    if name == WAVE:
        return sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y)
    if name in ("roof", "ridge"):
        return roof({"roof": 2 * math.degrees(math.atan(0.36)), "ridge": 120.0}[name])
    return sheet(np.linspace(0, 300, 7), [0, 50, 100], flat)


@cache
def planned(name: str, text: str = "") -> tuple[SprayInspector, Spraying, Plan, Mesh, SpraySetup]:
    plan, mesh, setup = planned_over(triangles_of(name), text)
    machine = limited(setup)
    spraying = spray(plan.passes, setup, machine, float(mesh.vertices[:, 2].max()))
    spraying = replace(spraying, trajectory=untimed(spraying.trajectory))
    return SprayInspector(plan.passes, spraying.splits, mesh, setup, machine), spraying, plan, mesh, setup


def examined(trajectory: Trajectory, name: str, text: str = "") -> SprayEvidence:
    return planned(name, text)[0].judge(trajectory)


def failures(trajectory: Trajectory, name: str, text: str = "") -> set[str]:
    evidence = examined(trajectory, name, text)
    assert not evidence.passed
    return {failure.what for failure in evidence.failures}


def at(trajectory: Trajectory, event: Event, number: int = 0) -> int:
    return int(np.flatnonzero(trajectory.events == event)[number])


def test_a_planned_program_passes_and_says_what_it_is() -> None:
    inspector, spraying, plan, _, _ = planned(WAVE)
    evidence = inspector.verify(spraying.trajectory).evidence
    assert evidence.passed and evidence.failures == () and evidence.splits == ()
    assert (evidence.passes, evidence.layers) == (len(plan.passes), 1) == (5, 1)
    length = sum(found.path.length for found in plan.passes)
    links = np.linalg.norm(
        [b.path.points[0] - a.path.points[-1] for a, b in zip(plan.passes, plan.passes[1:], strict=False)], axis=1
    )
    # Straight blocks balanced about the path, P within half a millimetre of it.
    assert evidence.sprayed_length == pytest.approx(length + np.sum(links), rel=2e-4)
    assert (evidence.duration, evidence.asked) == (spraying.trajectory.duration, spraying.trajectory.duration)
    samples = evidence.samples
    assert 0.4 * MM < np.max(samples.position_errors) <= 0.5 * MM + 1e-9
    assert np.nanmax(samples.surface_distances) <= 0.6 * MM + 1e-9
    assert 0.0 < np.nanmax(samples.deviations) <= 15 * DEG
    assert evidence.greatest_arc_distance <= 30 * MM + 1e-9
    assert evidence.forward_disagreement <= 1e-12


def test_the_gun_s_deviation_is_that_of_the_facets() -> None:
    """On a plane that the gun leans off by 7 deg, every sample on it says 7 deg."""
    inspector, spraying, _, _, _ = planned("plate", GAPS)
    trajectory = spraying.trajectory
    positions = trajectory.positions.copy()
    positions[1:, 4] += 7 * DEG
    leaning = inspector.judge(replace(trajectory, positions=positions))
    found = leaning.samples.deviations[~np.isnan(leaning.samples.deviations)]
    np.testing.assert_allclose(found, 7 * DEG, atol=1e-9)
    assert leaning.passed


@pytest.mark.parametrize(
    ("axis", "by", "what"),
    [
        ("z", 1.6 * MM, "position_error_mm"),
        ("y", -1.6 * MM, "position_error_mm"),
        ("z", 2.0 * MM, "surface_distance_mm"),
        ("phi", 16 * DEG, "deviation_deg"),
        ("theta", 61 * DEG, "theta_step_deg"),
        ("theta", 360 * DEG, "theta_step_deg"),
        ("x", 30 * MM, "gun_speed_mm_per_s"),
        ("x", np.nan, "unstated_axes"),
    ],
)
def test_one_block_that_is_off_is_found(axis: str, by: float, what: str) -> None:
    trajectory = planned(WAVE)[1].trajectory
    block = at(trajectory, Event.ARC_ON) + 20
    found = failures(moved(trajectory, block, axis, by), WAVE)
    assert what in found


@pytest.mark.parametrize(("axis", "by"), [("z", 1.0 * MM), ("y", -1.4 * MM), ("phi", 0.5 * DEG)])
def test_one_block_that_is_nearly_right_passes(axis: str, by: float) -> None:
    trajectory = planned(WAVE)[1].trajectory
    block = at(trajectory, Event.ARC_ON) + 20
    evidence = examined(moved(trajectory, block, axis, by), WAVE)
    assert {failure.what for failure in evidence.failures} <= {"gun_speed_mm_per_s", "slow_gun_speed_mm_per_s"}


def test_a_failure_says_where_it_is() -> None:
    inspector, spraying, _, _, _ = planned(WAVE)
    trajectory = replace(spraying.trajectory, lines=np.arange(len(spraying.trajectory), dtype=np.int32) + 11)
    block = at(trajectory, Event.ARC_ON) + 20
    with pytest.raises(VerificationFailed) as caught:
        inspector.verify(moved(trajectory, block, "y", 2 * MM))
    first = str(caught.value).splitlines()[0]
    assert re.fullmatch(rf"line {block + 11}: pass 2 point \d+: position_error_mm is 2\.\d+, limit 1.5", first), first
    assert caught.value.exit_code == 1
    assert Failure(0, 0, "x_mm", 1.0, 2.0, of="pass").sentence() == "x_mm is 1, limit 2"


@pytest.mark.parametrize(
    ("events", "what"),
    [
        ((Event.ARC_OFF,), "arc_left_on"),
        ((Event.AIR_OFF,), "air_left_on"),
        ((Event.AIR_ON, Event.AIR_OFF), "arc_on_without_air"),
        ((Event.ARC_ON,), "arc_switched_again"),
    ],
)
def test_a_missing_word_is_found(events: tuple[Event, ...], what: str) -> None:
    trajectory = planned("plate")[1].trajectory
    found = failures(without(trajectory, [at(trajectory, event) for event in events]), "plate")
    assert what in found


def test_an_arc_that_stays_on_between_passes_is_found() -> None:
    trajectory = planned("plate", GAPS)[1].trajectory
    gone = without(trajectory, [at(trajectory, Event.ARC_OFF), at(trajectory, Event.ARC_ON, 1)])
    found = failures(gone, "plate", GAPS)
    assert {"rapid_with_arc_on", "pause_with_arc_on", "position_error_mm"} <= found


def test_an_arc_before_its_air_is_found() -> None:
    trajectory = planned("plate")[1].trajectory
    durations = trajectory.durations.copy()
    durations[at(trajectory, Event.AIR_ON) + 1] = 0.4
    (failure,) = examined(replace(trajectory, durations=durations), "plate").failures
    assert (failure.what, failure.value, failure.limit) == ("air_lead_s", pytest.approx(0.4), 0.5)


def test_what_is_not_sprayed_is_found() -> None:
    trajectory = planned("plate", GAPS)[1].trajectory
    rows = np.flatnonzero(trajectory.courses == 1).tolist()
    (failure,) = examined(without(trajectory, rows), "plate", GAPS).failures
    assert (failure.number, failure.what, failure.value) == (2, "sprayed_length_mm", 0.0)
    assert failure.limit == pytest.approx(360.0)
    late = at(trajectory, Event.ARC_ON, 2)
    order = np.arange(len(trajectory))
    order[late : late + 6] = [late + 1, late + 2, late + 3, late + 4, late + 5, late]
    shifted = reordered(trajectory, order)
    positions = shifted.positions.copy()
    positions[late + 5] = positions[late + 4]
    assert "not_sprayed_mm" in failures(replace(shifted, positions=positions), "plate", GAPS)


def test_a_pass_sprayed_backwards_or_twice_is_found() -> None:
    wave = planned(WAVE)[1].trajectory
    positions = wave.positions.copy()
    middle = at(wave, Event.ARC_ON) + 8
    positions[middle] = positions[middle - 4]
    assert "run_back_mm" in failures(replace(wave, positions=positions), WAVE)
    trajectory = planned("plate", GAPS)[1].trajectory
    courses = trajectory.courses.copy()
    courses[courses == 3] = 9
    assert "pass" in failures(replace(trajectory, courses=courses), "plate", GAPS)


def test_a_gun_that_is_slow_for_no_reason_is_found() -> None:
    trajectory = planned("plate")[1].trajectory
    durations = trajectory.durations.copy()
    durations[at(trajectory, Event.ARC_ON) + 5] *= 1.5
    (failure,) = examined(replace(trajectory, durations=durations), "plate").failures
    assert (failure.what, failure.value, failure.limit) == (
        "slow_gun_speed_mm_per_s",
        pytest.approx(200.0),
        pytest.approx(300.0),
    )


def test_axes_beyond_travel_and_speed_are_found() -> None:
    trajectory = planned("plate")[1].trajectory
    assert "axis_z_mm" in failures(moved(trajectory, 0, "z", 2.0), "plate")
    durations = trajectory.durations.copy()
    last = np.flatnonzero(trajectory.kinds == Kind.LINEAR)[-1]
    durations[last] /= 10
    assert "axis_z_speed_mm_per_s" in failures(replace(trajectory, durations=durations), "plate")
    evidence = examined(trajectory, "plate")
    use = {axis.name: axis for axis in evidence.axes}
    assert (use["phi"].least, use["phi"].greatest) == (0.0, 0.0)
    assert use["x"].top_speed == pytest.approx(0.3)
    assert list(use) == ["x", "y", "z", "theta", "phi"]


def test_near_a_crease_no_deviation_counts_but_is_reported() -> None:
    inspector, spraying, plan, _, _ = planned("roof")
    evidence = inspector.verify(spraying.trajectory).evidence
    samples = evidence.samples
    assert evidence.crease_length == pytest.approx(len(plan.passes) * 60 * MM)
    beside = samples.deviations[samples.exempt]
    assert np.nanmax(beside) > 15 * DEG
    assert np.nanmax(samples.deviations[~samples.exempt]) <= 15 * DEG


def test_the_arc_beside_the_part_is_found() -> None:
    """The same program is judged by a part that is 100 mm shorter."""
    inspector, spraying, plan, mesh, setup = planned("plate")
    short = mesh_of(sheet(np.linspace(0, 200, 5), [0, 50, 100], flat))
    short = short.moved(np.eye(3), mesh.vertices.min(axis=0))
    nowhere = [replace(found, facets=np.full(len(found.facets), -1)) for found in plan.passes]
    judge = SprayInspector(nowhere, (), short, setup, sprayer())
    (failure,) = judge.judge(spraying.trajectory).failures
    assert failure.what == "arc_beside_part_mm"
    assert failure.value == pytest.approx(130.0, abs=1e-6)
    assert failure.limit == pytest.approx(61.5)


def test_splits_are_found_with_their_reasons() -> None:
    inspector, spraying, _, _, _ = planned("ridge", "[machine]\nlimits_deg = {phi = [-90, 90]}\n[spray]\npitch_mm = 80")
    evidence = inspector.verify(spraying.trajectory).evidence
    assert len(evidence.splits) == len(spraying.splits) >= 1
    for found, split in zip(evidence.splits, spraying.splits, strict=True):
        assert (found.number, found.reason) == (split.number, "crease")
        np.testing.assert_allclose(found.point, split.point, atol=1e-9)
    unplanned = SprayInspector(inspector.passes, (), inspector.mesh, inspector.setup, inspector.machine)
    assert {found.reason for found in unplanned.judge(spraying.trajectory).splits} == {""}


def test_a_program_without_any_arc_fails() -> None:
    trajectory = planned("plate")[1].trajectory
    gone = [at(trajectory, event) for event in (Event.ARC_ON, Event.ARC_OFF)]
    evidence = examined(without(trajectory, gone), "plate")
    assert [failure.what for failure in evidence.failures] == ["sprayed_length_mm"] * 4
    assert evidence.arc_time == 0.0 and len(evidence.samples.times) == 0
