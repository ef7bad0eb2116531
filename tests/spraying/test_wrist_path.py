"""The wrist's path against brute force, and everything that it promises at every point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats, Mask
from tapelayer.errors import ModelRefused
from tapelayer.machines.wrist import Wrist, angles_between, gun_axes, inverse, reachable
from tapelayer.spraying.passes import Reason
from tapelayer.spraying.wrist_path import Followed, follow
from tests.helpers.wrists import PRINTED, SPECIAL, WIDE, leans_of, wrist_of


def pieces_of(found: Followed) -> list[slice]:
    ends = [*found.starts[1:].tolist(), len(found.theta)]
    return [slice(start, end) for start, end in zip(found.starts.tolist(), ends, strict=True)]


def assert_kept(wrist: Wrist, normals: Floats, arc_lengths: Floats, leans: Floats, found: Followed) -> None:
    """Everything that `follow` promises, point by point."""
    assert np.all((found.theta >= wrist.theta.lower - 1e-12) & (found.theta <= wrist.theta.upper + 1e-12))
    assert np.all((found.phi >= wrist.phi.lower - 1e-12) & (found.phi <= wrist.phi.upper + 1e-12))
    axes = gun_axes(found.theta, found.phi)
    cosines = np.einsum("ij,ij->i", axes, normals[found.points])
    assert np.all(cosines >= np.cos(np.minimum(leans[found.points], np.pi)) - 1e-8)
    assert len(found.reasons) == len(found.starts) - 1
    steps_between = np.diff(found.points)
    assert set(steps_between.tolist()) <= {0, 1}
    assert found.points[0] == 0 and found.points[-1] == len(normals) - 1
    for piece in pieces_of(found):
        rows = found.points[piece]
        assert np.all(np.diff(rows) == 1)
        seconds = np.diff(arc_lengths[rows]) / (0.5 * wrist.gun_speed)
        for angles, axis in ((found.theta, wrist.theta), (found.phi, wrist.phi)):
            steps = np.abs(np.diff(angles[piece]))
            assert np.all(steps <= np.minimum(axis.speed * seconds, math.radians(30)) + 1e-9)


def followed(wrist: Wrist, normals: Floats, arc_lengths: Floats, before: float = 0.0) -> Followed:
    leans = leans_of(wrist, normals)
    found = follow(wrist, normals, arc_lengths, leans, before)
    assert_kept(wrist, normals, arc_lengths, leans, found)
    return found


def sphere_pass(radius: float, offset: float, direction: float, spacing: float, ends: float) -> tuple[Floats, Floats]:
    """Normals and arc lengths of the pass over a sphere in the plane at an offset, as far as nz >= ends."""
    ring = math.sqrt(radius**2 - offset**2)
    half = math.acos(ends * radius / ring)
    swing = np.linspace(-half, half, math.ceil(2 * half * ring / spacing) + 1)
    travel = np.array([math.cos(direction), math.sin(direction), 0.0])
    across = np.array([-math.sin(direction), math.cos(direction), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    normals = (np.outer(np.sin(swing), travel) + np.outer(np.cos(swing), up)) * ring / radius + across * offset / radius
    return normals, (swing + half) * ring


def dome() -> Iterator[tuple[Floats, Floats]]:
    """The 33 passes at 30 deg and a pitch of 25 mm over a closed dome of 825 mm, down to nz = 0.02."""
    for offset in 0.025 * (np.arange(33) - 16.0):
        yield sphere_pass(0.4125, offset, math.radians(30), 0.01, 0.02)


def test_a_closed_dome_with_the_printed_travel_splits_twice_at_most() -> None:
    wrist = wrist_of()
    reasons: list[Reason] = []
    for normals, arc_lengths in dome():
        reasons += followed(wrist, normals, arc_lengths).reasons
    assert len(reasons) <= 2
    assert set(reasons) <= {Reason.TRAVEL}


@pytest.mark.parametrize("phi", [(0.0, 90.0), (-90.0, 90.0)])
def test_a_closed_dome_with_wide_travel_does_not_split(phi: tuple[float, float]) -> None:
    wrist = wrist_of(WIDE, phi)
    for normals, arc_lengths in dome():
        assert not followed(wrist, normals, arc_lengths).reasons


@pytest.mark.parametrize("degrees", [0, 30, 45, 90, 180, 270])
@pytest.mark.parametrize("offset", [0.0, 1e-9, 0.001, -0.001])
def test_the_pole_is_crossed_without_a_jump(degrees: int, offset: float) -> None:
    normals, arc_lengths = sphere_pass(0.4, offset, math.radians(degrees), 0.005, 0.5)
    found = followed(wrist_of(), normals, arc_lengths)
    assert not found.reasons
    # The one thing that the printed travel lets it do: half a turn, near the pole.
    assert abs(found.theta[-1] - found.theta[0]) == pytest.approx(math.pi, abs=math.radians(5))
    assert np.sum(np.abs(np.diff(found.theta))) <= math.pi + math.radians(5)
    # What follows exactly turns by half a turn within a few millimetres.
    assert np.max(np.abs(np.diff(found.theta))) < math.radians(6)


def test_with_a_phi_that_swings_through_the_pole_needs_no_turn() -> None:
    normals, arc_lengths = sphere_pass(0.4, 0.0, math.radians(30), 0.005, 0.5)
    found = followed(wrist_of(phi=(-90.0, 90.0)), normals, arc_lengths)
    np.testing.assert_allclose(gun_axes(found.theta, found.phi), normals, rtol=0, atol=1e-12)
    assert np.ptp(found.theta) <= 1e-12


def cone_pass(first: float, last: float, tilt: float, count: int = 61) -> tuple[Floats, Floats]:
    """Normals whose theta goes evenly from one angle to another at a constant tilt (degrees), 5 mm apart."""
    theta = np.radians(np.linspace(first, last, count))
    return gun_axes(theta, np.full(count, math.radians(tilt))), 0.005 * np.arange(count)


def test_across_ny_0_with_nx_above_0() -> None:
    normals, arc_lengths = cone_pass(10, -10, 50)
    paper = np.mod(np.degrees(np.arctan2(normals[:, 1], normals[:, 0])), 360)
    assert np.max(np.abs(np.diff(paper))) > 350
    leaning = followed(wrist_of(), normals, arc_lengths)
    assert not leaning.reasons
    # The gun stays at the end of theta's travel and leans the rest.
    assert leaning.theta[-1] == pytest.approx(0, abs=1e-12)
    unwrapped = followed(wrist_of(WIDE), normals, arc_lengths)
    assert not unwrapped.reasons
    np.testing.assert_allclose(np.degrees(unwrapped.theta), np.linspace(10, -10, 61), rtol=0, atol=3)

    normals, arc_lengths = cone_pass(60, -60, 50)
    split = followed(wrist_of(), normals, arc_lengths)
    assert split.reasons == (Reason.TRAVEL,)
    # Both pieces have a pose for the point between them.
    assert split.points[split.starts[1]] == split.points[split.starts[1] - 1]
    assert not followed(wrist_of(WIDE), normals, arc_lengths).reasons


@pytest.mark.parametrize("branch_phi", [(0.0, 90.0), (-90.0, 0.0), (-90.0, 90.0)])
def test_a_straight_normal_is_followed_exactly(branch_phi: tuple[float, float]) -> None:
    arc_lengths = 0.01 * np.arange(30)
    for theta in SPECIAL:
        normals = gun_axes(np.full(30, theta), np.linspace(0.3, 1.2, 30))
        found = followed(wrist_of(phi=branch_phi), normals, arc_lengths)
        np.testing.assert_allclose(gun_axes(found.theta, found.phi), normals, rtol=0, atol=1e-12)
        assert np.ptp(found.theta) <= 1e-12


def test_a_level_surface_holds_theta_where_it_was() -> None:
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    found = followed(wrist_of(), normals, 0.01 * np.arange(20), before=math.radians(123.4))
    assert np.degrees(found.theta) == pytest.approx(123.4, abs=1.0)
    assert np.ptp(found.theta) <= 1e-12 and np.all(found.phi == 0)


def test_noise_about_the_vertical_does_not_make_theta_whirl() -> None:
    chance = np.random.default_rng(1)
    normals = np.column_stack([chance.normal(0, 0.005, (200, 2)), np.ones(200)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    exact = np.unwrap(inverse(normals)[0][:, 0])
    assert np.sum(np.abs(np.diff(exact))) > 200
    found = followed(wrist_of(), normals, 0.005 * np.arange(200))
    assert np.sum(np.abs(np.diff(found.theta))) < 0.2
    assert np.max(angles_between(gun_axes(found.theta, found.phi), normals)) < math.radians(1.5)


def test_the_turn_nearest_to_where_theta_comes_from_is_taken() -> None:
    normals, arc_lengths = cone_pass(30, 40, 40)
    for before, expected in ((-100.0, 30.0), (0.0, 30.0), (250.0, 390.0), (540.0, 390.0)):
        found = followed(wrist_of(WIDE), normals, arc_lengths, before=math.radians(before))
        assert np.degrees(found.theta[0]) == pytest.approx(expected, abs=1.5)


def ridge(tilt: float, spacing: float = 0.002) -> tuple[Floats, Floats]:
    """A pass along x over a roof with two slopes (degrees), the ridge at 100 mm, a row for each slope there."""
    arc_lengths = np.concatenate([np.arange(0, 0.1, spacing), [0.1, 0.1], np.arange(0.1, 0.2, spacing) + spacing])
    down = np.arange(len(arc_lengths)) > np.argmax(arc_lengths >= 0.1)
    normals = gun_axes(np.where(down, 0.0, np.pi), np.full(len(down), math.radians(tilt)))
    return normals, arc_lengths


def test_a_ridge_that_no_lean_covers_splits_right_on_it() -> None:
    normals, arc_lengths = ridge(25)
    for wrist in (wrist_of(), wrist_of(phi=(-90.0, 90.0))):
        found = followed(wrist, normals, arc_lengths)
        assert found.reasons == (Reason.CREASE,)
        first, second = found.points[found.starts[1] - 1], found.points[found.starts[1]]
        assert arc_lengths[first] == arc_lengths[second] == 0.1 and second == first + 1
        np.testing.assert_allclose(
            gun_axes(found.theta, found.phi)[[0, -1]], normals[[0, -1]], rtol=0, atol=math.radians(1)
        )


def test_a_ridge_that_leaning_covers_does_not_split() -> None:
    normals, arc_lengths = ridge(14)
    assert not followed(wrist_of(), normals, arc_lengths).reasons


def test_the_gun_swings_through_a_crease_where_the_axes_follow() -> None:
    normals, arc_lengths = ridge(25)

    def through(wrist: Wrist) -> Followed:
        leans = np.where(np.abs(arc_lengths - 0.1) <= 0.03, np.inf, wrist.max_deviation)
        found = follow(wrist, normals, arc_lengths, leans, 0.0)
        assert_kept(wrist, normals, arc_lengths, leans, found)
        return found

    swung = through(wrist_of(phi=(-90.0, 90.0)))
    assert not swung.reasons
    # With phi from 0 the gun has to turn by more than theta can within the crease.
    assert through(wrist_of()).reasons == (Reason.TRAVEL,)
    # 40 mm/s at the slowest, 90 deg/s: time for everything.
    assert not through(wrist_of(speed=0.08)).reasons
    # 1 deg/s: no travel makes that fast enough.
    quick = wrist_of(phi=(-90.0, 90.0))
    slow = replace(quick, phi=replace(quick.phi, speed=0.02), theta=replace(quick.theta, speed=0.02))
    assert through(slow).reasons == (Reason.CREASE,)
    split = through(slow)
    assert abs(arc_lengths[split.points[split.starts[1]]] - 0.1) <= 0.005


def test_normals_that_turn_faster_than_phi_can_are_creases() -> None:
    # A bead of 20 mm radius, 60 deg to both sides: 2.9 deg/mm, where phi does 0.6 deg/mm and the lean saves 30 deg.
    normals, arc_lengths = sphere_pass(0.02, 0.0, 0.0, 0.0005, 0.5)
    found = followed(wrist_of(WIDE, (-90.0, 90.0)), normals, arc_lengths)
    assert len(found.reasons) >= 1 and set(found.reasons) == {Reason.CREASE}


def fewest_splits(wrist: Wrist, normals: Floats, arc_lengths: Floats, more_lean: float, more_turn: float) -> int:
    """Splits by brute force over grids of theta and phi with other limits (radians), phi as fast as you like."""
    cell = math.radians(0.25)
    theta = np.arange(wrist.theta.lower, wrist.theta.upper + cell / 2, cell)
    phi = np.linspace(max(wrist.phi.lower, -np.pi / 2), wrist.phi.upper, 361)
    grid = gun_axes(*np.meshgrid(theta, phi))
    served = np.array([np.any(grid @ n >= math.cos(wrist.max_deviation + more_lean), axis=0) for n in normals])
    reach = np.diff(arc_lengths) / (0.5 * wrist.gun_speed) * wrist.theta.speed + more_turn
    splits, here = 0, served[0]
    for row in range(1, len(normals)):

        def spread(mask: Mask, cells: int) -> Mask:
            counts = np.concatenate([np.zeros(cells + 1), np.cumsum(mask), np.full(cells, np.sum(mask))])
            inside: Mask = counts[2 * cells + 1 :] > counts[: -2 * cells - 1]
            return inside

        cells = int(reach[row - 1] / cell + 1e-9)
        following = spread(here, cells) & served[row]
        if not np.any(following):
            # Beginning anew on the next point leaves every way open.
            splits += 1
            following = served[row]
        here = following
    return splits


@pytest.mark.parametrize("seed", range(8))
def test_fewest_splits_by_brute_force(seed: int) -> None:
    chance = np.random.default_rng(seed)
    count = 60
    along = np.linspace(0, 1, count)
    # Smooth wanderings over the upper half of the sphere.
    waves = sum(
        chance.normal(0, 1.5 / k, (2, 1)) * np.sin(2 * np.pi * k * along + chance.uniform(0, 7, (2, 1)))
        for k in (1, 2, 3)
    )
    normals = np.column_stack([*(waves + chance.normal(0, 0.7, (2, 1))), np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    arc_lengths = chance.uniform(0.004, 0.01, count).cumsum()
    theta = [PRINTED, (0.0, 200.0), (-180.0, 180.0), WIDE][seed % 4]
    wrist = wrist_of(theta, [(0.0, 90.0), (-90.0, 90.0)][seed // 4 % 2], speed=[0.3, 0.6][seed // 8 % 2])
    wrist = replace(wrist, phi=replace(wrist.phi, speed=1e3))
    leans = leans_of(wrist, normals)
    kept = reachable(wrist, normals, leans)
    normals, arc_lengths = normals[kept], arc_lengths[: np.count_nonzero(kept)]
    found = followed(wrist, normals, arc_lengths)
    # Cells of 0.25 deg cost the search 0.25 deg of lean and 0.5 deg of a step, and the brute force as much again.
    least = fewest_splits(wrist, normals, arc_lengths, *np.radians([0.25, 0.5]))
    most = fewest_splits(wrist, normals, arc_lengths, *np.radians([-0.25, -0.5]))
    assert least <= len(found.reasons) <= most


@pytest.mark.parametrize("seed", range(25))
def test_whatever_comes_is_kept(seed: int) -> None:
    """Normals without any order, leans of any size with and without limit, points on each other, slow and fast axes."""
    chance = np.random.default_rng(seed)
    lower, tilt = chance.uniform(-200, 200), chance.uniform(-90, 60)
    wrist = wrist_of(
        (lower, lower + chance.choice([20, 100, 360])),
        (tilt, tilt + chance.choice([30, 90, 180])),
        chance.choice([0.1, 0.3, 1.0]),
        chance.choice([0.5, 5, 15, 40]),
    )
    speeds = chance.choice([0.01, 1.5, 3.0], 2).tolist()
    wrist = replace(wrist, theta=replace(wrist.theta, speed=speeds[0]), phi=replace(wrist.phi, speed=speeds[1]))
    normals = chance.normal(size=(20, 3)) if seed % 2 else chance.normal(0, 0.1, (20, 3)).cumsum(axis=0)
    normals[:, 2] = np.abs(normals[:, 2]) + 0.05
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    leans = np.where(chance.random(20) < 0.2, np.inf, chance.uniform(0, 1, 20) * wrist.max_deviation)
    kept = reachable(wrist, normals, leans)
    normals, leans = normals[kept], leans[kept]
    arc_lengths = chance.choice([0, 1e-5, 0.001, 0.01], len(normals)).cumsum()
    assert_kept(wrist, normals, arc_lengths, leans, follow(wrist, normals, arc_lengths, leans, 1.0))


@given(
    st.floats(-200, 200),
    st.floats(5, 700),
    st.floats(-90, 80),
    st.floats(1, 170),
    st.floats(0.5, 40),
    st.floats(0, 360),
    st.floats(0, 89),
    st.floats(0, 1),
)
@settings(max_examples=100)
def test_reachable_is_what_some_pose_reaches(
    theta_lower: float,
    theta_travel: float,
    phi_lower: float,
    phi_travel: float,
    deviation: float,
    theta: float,
    slant: float,
    share: float,
) -> None:
    wrist = wrist_of((theta_lower, theta_lower + theta_travel), (phi_lower, phi_lower + phi_travel), 0.3, deviation)
    normals = gun_axes(np.radians([theta]), np.radians([slant]))
    leans = np.array([share * wrist.max_deviation])
    turns = np.linspace(wrist.theta.lower, wrist.theta.upper, 241)
    tilts = np.linspace(wrist.tilts[0], wrist.tilts[1], 91)
    best = np.min(angles_between(gun_axes(*np.meshgrid(turns, tilts)), normals[0]))
    if best <= leans[0]:
        assert reachable(wrist, normals, leans)[0]
    if reachable(wrist, normals, leans)[0]:
        found = follow(wrist, normals, np.zeros(1), leans, 0.0)
        assert_kept(wrist, normals, np.zeros(1), leans, found)
    # The grid may be off by that much.
    if best > leans[0] + math.radians(3.0):
        assert not reachable(wrist, normals, leans)[0]
        with pytest.raises(ValueError, match="point 0: the wrist cannot reach the normal"):
            follow(wrist, normals, np.zeros(1), leans, 0.0)


def test_a_lean_within_rounding_of_its_limit_is_followed() -> None:
    # Between what `reachable` lets pass as rounding and what the search does.
    wrist, normals = wrist_of((75.0, 80.0)), np.tile([1.04e-9, 0.0, 1.0], (3, 1))
    found = follow(wrist, normals, 0.01 * np.arange(3), np.zeros(3), 1.3)
    assert_kept(wrist, normals, 0.01 * np.arange(3), np.zeros(3), found)


def test_level_and_downward_and_undefined_normals_are_not_reached() -> None:
    normals = np.array([[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [np.nan, 0.0, 1.0], [0.6, 0.0, 0.8]])
    wrist = wrist_of()
    assert reachable(wrist, normals, leans_of(wrist, normals)).tolist() == [False, False, False, True]
    for point in range(3):
        rows = normals[[3, 3, point]]
        with pytest.raises(ValueError, match="point 2: the wrist cannot reach the normal"):
            follow(wrist, rows, 0.01 * np.arange(3), leans_of(wrist, rows), 0.0)


@pytest.mark.parametrize("spacing", [1e-6, 1e-4, 1e-3, 0.01, 0.05, 1.0])
def test_any_spacing_of_the_points(spacing: float) -> None:
    chance = np.random.default_rng(11)
    theta = np.linspace(0.5, 2.5, 50) + chance.normal(0, 0.02, 50)
    normals = gun_axes(theta, np.linspace(0.1, 1.0, 50))
    steps = np.where(np.arange(50) % 7 == 3, 0.0, spacing)
    followed(wrist_of(), normals, steps.cumsum())


def test_no_lean_left_follows_exactly() -> None:
    normals, arc_lengths = cone_pass(20, 80, 35)
    wrist = wrist_of()
    leans = np.zeros(len(normals))
    found = follow(wrist, normals, arc_lengths, leans, 0.0)
    assert not found.reasons
    np.testing.assert_allclose(gun_axes(found.theta, found.phi), normals, rtol=0, atol=1e-8)


def test_what_no_gun_does_is_refused() -> None:
    wrist = wrist_of()
    for deviation, speed in ((0.0, 0.3), (np.pi / 2, 0.3), (np.nan, 0.3), (0.2, 0.0), (0.2, np.inf), (0.2, np.nan)):
        with pytest.raises(ValueError, match="no gun has max_deviation"):
            replace(wrist, max_deviation=deviation, gun_speed=speed)
    with pytest.raises(ModelRefused, match=r"axis theta turns without end.*limits_deg.*\{theta = \[-180, 540\]\}"):
        replace(wrist, theta=replace(wrist.theta, upper=np.inf))
    normals, arc_lengths = cone_pass(0, 10, 20)
    with pytest.raises(ValueError, match="do not match"):
        follow(wrist, normals, arc_lengths[1:], leans_of(wrist, normals), 0.0)
