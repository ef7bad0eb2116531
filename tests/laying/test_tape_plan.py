"""The plan of cuts, replayed step by step on a tape by a checker that knows only the definitions."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from tapelayer.arrays import Floats, Mask
from tapelayer.errors import CourseLongerThanRoll, CoursesRefused, CutAngleTooSmall, CutsCross
from tapelayer.laying.head import Head
from tapelayer.laying.tape_plan import KnifeSteps, Step, TapePlan, plan_tape
from tests.helpers.heads import HEAD
from tests.helpers.paths import EXAMPLES

NEAR = 1e-8


def ply(head: Head, lengths: list[float], angles: list[tuple[float, float]], wraps: Floats | None = None) -> TapePlan:
    count = len(lengths)
    return plan_tape(
        head,
        range(1, count + 1),
        np.array(lengths),
        np.radians(np.array(angles, dtype=float)),
        np.zeros((count, 2)) if wraps is None else wraps,
    )


def cot(degrees: float) -> float:
    return math.tan(math.radians(90.0 - degrees))


@dataclass
class Stroke:
    """What one lowered knife marked on the material: stations and places across, in order."""

    knife: int
    sigma: list[float]
    w: list[float]
    blades: list[float]
    u: list[float]

    def line(self) -> tuple[float, float]:
        """Station on the centre line and slope d sigma / d w, from the two ends."""
        slope = (self.sigma[-1] - self.sigma[0]) / (self.w[-1] - self.w[0])
        return self.sigma[0] - slope * self.w[0], slope


def near(got: ArrayLike, expected: ArrayLike) -> bool:
    return bool((np.abs(np.subtract(got, expected)) <= NEAR).all())


def replay(plan: TapePlan) -> list[Stroke]:
    """Follow both knives through the steps; every conflict is an assertion."""
    head, steps = plan.head, plan.steps
    half = head.tape_width / 2.0
    reach = half + head.knife_clearance
    assert steps.u[0] == 0.0 and steps.kinds[0] == Step.FEED
    assert near(steps.poses[0, [0, 2]], [reach, -reach])
    down: dict[int, Stroke] = {}
    strokes: list[Stroke] = []
    u, pose = 0.0, steps.poses[0]
    feeds = set()
    rows = zip(steps.u.tolist(), steps.poses, steps.kinds.tolist(), steps.knives.tolist(), strict=True)
    for new_u, new, kind, knife in itertools.islice(rows, 1, None):
        assert np.isfinite(new_u) and np.isfinite(new).all()
        still = [0, 1, 2, 3]
        if kind == Step.FEED:
            assert knife == 0 and new_u > u and new_u not in feeds
            feeds.add(new_u)
            still = []
        else:
            assert knife in (1, 2) and new_u == u
            if kind in (Step.MOVE, Step.CUT):
                still = [2, 3] if knife == 1 else [0, 1]
                assert (knife in down) == (kind == Step.CUT)
        assert (new[still] == pose[still]).all()
        if kind == Step.DOWN:
            assert knife not in down
            assert abs(pose[2 * knife - 2]) >= half
            down[knife] = Stroke(knife, [], [], [], [])
        for number, stroke in down.items():
            stroke.u.append(new_u)
            stroke.sigma.append(new_u + (head.knife_pitch if number == 2 else 0.0))
            stroke.w.append(float(new[2 * number - 2]))
            stroke.blades.append(float(new[2 * number - 1]))
        if kind == Step.UP:
            assert knife in down and abs(pose[2 * knife - 2]) >= half
            strokes.append(down.pop(knife))
        assert head.travel_v[0] - NEAR <= new[0] <= head.travel_v[1] + NEAR
        assert head.travel_q[0] - NEAR <= new[2] <= head.travel_q[1] + NEAR
        # Between two steps v - q is linear: it passes 0 where its sign changes.
        before, after = pose[0] - pose[2], new[0] - new[2]
        across = 0.0 if before * after < 0.0 else min(abs(before), abs(after))
        assert math.hypot(head.knife_pitch, across) >= head.blade_length
        u, pose = new_u, new
    assert not down
    return strokes


def check(plan: TapePlan, lengths: list[float], angles: list[tuple[float, float]], wraps: Floats | None = None) -> None:
    """Prove a plan from the definitions: geometry, knives, rolls, ledger and the way through it."""
    head = plan.head
    count = len(lengths)
    wraps = np.zeros((count, 2)) if wraps is None else wraps
    half, reach = head.tape_width / 2.0, head.tape_width / 2.0 + head.knife_clearance
    starts = plan.stations
    ends = starts + np.array(lengths)
    strokes = replay(plan)

    # Every stroke runs over the full width and the clearance, straight, blade along it, low station first.
    for stroke in strokes:
        assert near(sorted([stroke.w[0], stroke.w[-1]]), [-reach, reach])
        centre, slope = stroke.line()
        along = np.array(stroke.w)
        assert np.abs(np.array(stroke.sigma) - centre - slope * along).max() <= NEAR
        assert (np.diff(along) * (stroke.w[-1] - stroke.w[0]) >= -NEAR).all()
        assert np.ptp(stroke.blades) == 0.0
        # The blade (sin d, cos d) in (-sigma, w).
        blade = stroke.blades[0]
        assert abs(-math.sin(blade) - slope * math.cos(blade)) * 2 * reach <= 1.1e-5
        assert stroke.sigma[-1] >= stroke.sigma[0] - NEAR

    # Each end of each course is cut once, on its line; each stroke belongs to an end.
    centres = np.array([stroke.line()[0] for stroke in strokes])
    served: dict[int, list[tuple[int, int]]] = {}
    for k in range(count):
        for end, station in enumerate((starts[k], ends[k])):
            hits = np.flatnonzero(np.abs(centres - station) <= NEAR)
            assert len(hits) == 1, (k, end)
            served.setdefault(int(hits[0]), []).append((k, end))
            stroke = strokes[hits[0]]
            assert abs(stroke.line()[1] - cot(angles[k][end])) * 2 * reach <= 2e-5 + NEAR
            square = abs(cot(angles[k][end])) * 2 * reach <= 1e-5
            assert square == (np.ptp(stroke.u) == 0.0) or abs(abs(cot(angles[k][end])) * 2 * reach - 1e-5) < 1e-7
            index = int(plan.course_cuts[k, end])
            cuts = plan.cuts
            assert near(cuts.stations[index], station)
            assert (cuts.starting, cuts.ending)[end][index] == k
            assert cuts.knives[index] == stroke.knife
            assert near(cuts.u[index], [stroke.u[0], stroke.u[-1]])
            assert near(cuts.slides[index], [stroke.w[0], stroke.w[-1]])
            assert cuts.blades[index] == stroke.blades[0]
    assert len(served) == len(strokes) == len(plan.cuts)
    for owners in served.values():
        if len(owners) > 1:
            (k, first), (after, second) = owners
            assert (after, first, second) == (k + 1, 1, 0) and plan.rolls[k] == plan.rolls[after]

    # No cut runs through the tape of a course of the roll that is in the head at the time.
    for stroke in strokes:
        centre, slope = stroke.line()
        before = after = np.ones(count, dtype=bool)
        for w in (-half, half):
            at = centre + slope * w
            before = before & (at <= starts + w * np.array([cot(a) for a, _ in angles]) + 1e-5)
            after = after & (at >= ends + w * np.array([cot(a) for _, a in angles]) - 1e-5)
        roll = int(np.searchsorted(plan.roll_u, stroke.u[0] + NEAR)) - 1
        assert (before | after | (plan.rolls != roll)).all()

    # Knives take their sweeps one after the other, from where they stand.
    for knife, side in ((1, 1.0), (2, -1.0)):
        own = [stroke for stroke in strokes if stroke.knife == knife]
        moves = [row for row in range(len(plan.moves)) if plan.moves.knives[row] == knife]
        standing, free, blade = side * reach, 0.0, own[0].blades[0] if own else 0.0
        for stroke in own:
            assert stroke.u[0] >= free
            if abs(stroke.w[0] - standing) > NEAR or stroke.blades[0] != blade:
                row = moves.pop(0)
                begin, end = plan.moves.u[row]
                assert free - NEAR <= begin <= end <= stroke.u[0] + NEAR
                assert (begin == end) == (stroke.u[0] - free <= 1e-5)
                assert near(plan.moves.slides[row], [standing, stroke.w[0]])
                assert plan.moves.blades[row].tolist() == [blade, stroke.blades[0]]
            standing, free, blade = stroke.w[-1], stroke.u[-1], stroke.blades[0]
        assert not moves

    # Rolls, and the tape before each course.
    begins = starts + head.knife_to_nip - wraps[:, 0]
    lasts = ends + head.knife_to_nip - wraps[:, 1]
    assert near(plan.begins, begins) and near(plan.ends, lasts)
    assert plan.roll_u[0] == 0.0 and plan.rolls[0] == 0 and len(plan.roll_u) == plan.rolls[-1] + 1
    for k in range(count):
        edge = float(plan.roll_u[plan.rolls[k]])
        limit = edge + head.roll_length - head.knife_pitch
        own = [strokes[i] for i, owners in served.items() if owners[0][0] == k or owners[-1][0] == k]
        assert lasts[k] <= limit + NEAR
        assert all(edge - NEAR <= stroke.u[0] and stroke.u[-1] <= limit + NEAR for stroke in own)
        if plan.rolls[k] < plan.rolls[-1]:
            following = plan.roll_u[plan.rolls[k] + 1]
            assert lasts[k] <= following + NEAR and all(stroke.u[-1] <= following + NEAR for stroke in own)
        new = k == 0 or plan.rolls[k] != plan.rolls[k - 1]
        cot_before = 0.0 if new else cot(angles[k - 1][1])
        apart = abs(cot_before - cot(angles[k][0]))
        one_line = not new and apart * 2 * reach <= 1e-5 * (1 + 1e-6)
        shared = not new and plan.course_cuts[k, 0] == plan.course_cuts[k - 1, 1]
        assert one_line or not shared
        formula = 0.0 if one_line else half * apart + head.scrap_margin
        assert near(plan.waste_formula[k], formula)
        before = 0.0 if k == 0 else float(ends[k - 1])
        assert near(starts[k] - before, plan.waste[k])
        assert near(plan.waste_roll[k], edge - before if new else 0.0)
        assert min(plan.waste_roll[k], plan.waste_formula[k], plan.waste_knives[k]) >= 0.0
        if shared:
            assert plan.waste[k] == 0.0
        else:
            assert plan.waste_formula[k] + plan.waste_knives[k] >= head.scrap_margin - NEAR
    assert near(plan.used, sum(lengths) + np.sum(plan.waste))
    walk(plan)


def walk(plan: TapePlan) -> None:
    """Go through the plan as a program does: every step done once, at its u, tape never back with a knife down."""
    steps = plan.steps
    done, u, furthest = 1, 0.0, 0.0
    down = [0, 0]
    stops = plan.laying_stops
    at, kinds, knives = steps.u.tolist(), steps.kinds.tolist(), steps.knives.tolist()

    def carry_out(rows: tuple[int, int]) -> None:
        nonlocal done, u, furthest
        first, last = rows
        assert first == done
        for row in range(first, last):
            assert at[row] >= furthest - 2e-9
            u = furthest = max(at[row], furthest)
            if kinds[row] in (Step.DOWN, Step.UP):
                down[knives[row] - 1] = int(kinds[row] == Step.DOWN)
        done = last

    def feed(to: float) -> None:
        """Feed or take back with no step on the way."""
        nonlocal u, furthest
        assert to >= u - 2e-9 or down == [0, 0]
        assert done == len(steps) or steps.u[done] >= to - 2e-9
        u, furthest = to, max(furthest, to)

    for k in range(len(plan)):
        carry_out(tuple(plan.changing[k]))
        if k and plan.rolls[k] != plan.rolls[k - 1]:
            feed(float(plan.roll_u[plan.rolls[k]]))
            assert down == [0, 0]
        carry_out(tuple(plan.threading[k]))
        if plan.taken_back[k] > 0.0:
            assert u == pytest.approx(plan.threaded[k]) and u - plan.begins[k] == pytest.approx(plan.taken_back[k])
        feed(float(plan.begins[k]))
        first, last = plan.laying[k]
        assert ((steps.u[first:last] > plan.begins[k]) & (steps.u[first:last] < plan.ends[k])).all()
        assert stops[k] == len({at[row] for row in range(first, last) if kinds[row] in (Step.MOVE, Step.CUT)})
        carry_out((int(first), int(last)))
        feed(float(plan.ends[k]))
    carry_out((done, len(steps)))
    assert down == [0, 0]


def handed_out(begins: Floats, ends: Floats, pitch: float) -> Mask:
    """Whether (m, c) sweeps can be handed to two knives, none busy twice, none before u = 0: every way is tried."""
    count = begins.shape[1]
    pairs = list(itertools.combinations(range(count), 2))
    first, second = np.array(pairs).T
    busy = (begins[:, first] < ends[:, second] - NEAR) & (begins[:, second] < ends[:, first] - NEAR)
    ways = np.array(list(itertools.product((0, 1), repeat=count)))
    same = ways[:, first] == ways[:, second]
    twice = busy.astype(np.float32) @ same.T.astype(np.float32) > 0.0
    early = (begins < -NEAR).astype(np.float32) @ (ways.T == 0).astype(np.float32) > 0.0
    early |= (begins - pitch < -NEAR).astype(np.float32) @ (ways.T == 1).astype(np.float32) > 0.0
    possible: Mask = (~(twice | early)).any(axis=1)
    return possible


def prove_smallest(plan: TapePlan, lengths: list[float], angles: list[tuple[float, float]], grid: float) -> None:
    """Each station is the smallest: on a grid below it no way to hand out the sweeps works, at it one does."""
    head = plan.head
    reach = head.tape_width / 2.0 + head.knife_clearance
    halves = [[0.0 if abs(cot(a)) * 2 * reach <= 1e-5 else abs(cot(a)) * reach for a in ends] for ends in angles]
    sweeps: list[tuple[float, float]] = []
    end = 0.0
    for k, length in enumerate(lengths):
        before = 0.0 if k == 0 else cot(angles[k - 1][1])
        apart = abs(before - cot(angles[k][0]))

        def possible(stations: Floats, shared: bool, k: int = k, length: float = length) -> Mask:
            columns = [np.full((len(stations), 2), sweep) for sweep in sweeps]
            if not shared:
                columns.append(stations[:, None] + [-halves[k][0], halves[k][0]])
            columns.append(stations[:, None] + length + [-halves[k][1], halves[k][1]])
            table = np.stack(columns, axis=1)
            return handed_out(table[:, :, 0], table[:, :, 1], head.knife_pitch)

        station = float(plan.stations[k])
        shared = k > 0 and plan.course_cuts[k, 0] == plan.course_cuts[k - 1, 1]
        if k > 0 and apart * 2 * reach <= 1e-5:
            assert possible(np.array([end]), True)[0] == shared
        if not shared:
            lowest = end + head.tape_width / 2.0 * apart + head.scrap_margin
            assert station >= lowest - NEAR
            below = np.append(np.arange(lowest, station - 1e-6, grid), station - 1e-6)
            assert not possible(below[below >= lowest], False).any()
            assert possible(np.array([station]), False)[0]
            sweeps.append((station - halves[k][0], station + halves[k][0]))
        end = station + length
        sweeps.append((end - halves[k][1], end + halves[k][1]))


# Angles that are special, and the rest between them.
ANGLES = [15.0, 20.0, 30.0, 45.0, 60.0, 75.0, 89.0, 89.99, 89.9995, 90.0, 90.0005, 91.0, 120.0, 135.0, 160.0, 165.0]


def random_ply(rng: np.random.Generator) -> tuple[Head, list[float], list[tuple[float, float]], Floats]:
    head = replace(
        HEAD,
        tape_width=float(rng.choice([0.075, 0.15, 0.3])),
        knife_to_nip=float(rng.uniform(0.2, 0.8)),
        knife_clearance=float(rng.choice([0.0, 0.003, 0.01, 0.03])),
        scrap_margin=float(rng.choice([0.0, 0.005, 0.05])),
        knife_pitch=float(rng.choice([0.02, 0.1, 0.25])),
        roll_length=float(rng.choice([4.0, 8.0, 20.0, 150.0, 150.0])),
    )
    count = int(rng.integers(1, 9))
    longest = rng.choice([0.1, 0.5, 1.0, 5.0])
    lengths = np.exp(rng.uniform(math.log(0.02), math.log(longest), count))
    if rng.random() < 0.3:
        lengths[:] = lengths[0]
    kind = rng.integers(4)
    low = rng.choice([15.0, 60.0])
    angles = rng.uniform(low, 180.0 - low, (count, 2))
    if kind == 0:
        angles[:] = angles[0, 0]
    elif kind == 1:
        angles[:, 1] = angles[:, 0]
        angles = angles[np.sort(rng.integers(0, count, count))]
    elif kind == 2:
        angles = rng.choice(ANGLES, (count, 2))
    wraps = rng.uniform(-0.03, 0.03, (count, 2)) * rng.integers(2)
    # The nip goes forward along a course, whatever the roller's wrap does.
    wraps[:, 1] = np.minimum(wraps[:, 1], wraps[:, 0] + 0.9 * lengths)
    return head, lengths.tolist(), [tuple(pair) for pair in angles.tolist()], wraps


def test_every_random_ply_is_a_checked_plan_or_a_named_refusal() -> None:
    rng = np.random.default_rng(20080)
    planned = 0
    refusals = {CutsCross: 0, CourseLongerThanRoll: 0}
    for _ in range(3000):
        head, lengths, angles, wraps = random_ply(rng)
        crossing = [
            k + 1
            for k, (length, (a, b)) in enumerate(zip(lengths, angles, strict=True))
            if length <= head.tape_width / 2.0 * abs(cot(a) - cot(b)) * (1.0 + 1e-12)
        ]
        try:
            plan = ply(head, lengths, angles, wraps)
        except CoursesRefused as refusal:
            refusals[type(refusal)] += 1
            if isinstance(refusal, CutsCross):
                assert list(refusal.courses) == crossing
            else:
                assert not crossing and refusal.courses
                for number in refusal.courses:
                    k = number - 1
                    alone = ply(replace(head, roll_length=150.0), [lengths[k]], [angles[k]], wraps[k : k + 1])
                    needed = max(float(alone.cuts.u.max()), float(alone.ends[0])) + head.knife_pitch
                    assert needed > head.roll_length
            continue
        assert not crossing
        planned += 1
        check(plan, lengths, angles, wraps)
    assert planned > 1500 and min(refusals.values()) > 20


def test_every_waste_is_the_smallest_that_frees_a_knife() -> None:
    rng = np.random.default_rng(7)
    grown = split = done = 0
    while done < 500:
        head, lengths, angles, _ = random_ply(rng)
        head = replace(head, roll_length=150.0)
        lengths, angles = lengths[:4], angles[:4]
        try:
            plan = ply(head, lengths, angles)
        except CutsCross:
            continue
        prove_smallest(plan, lengths, angles, 0.25e-3)
        done += 1
        grown += int(np.sum(plan.waste_knives[1:] > 1e-6))
        split += int(np.sum((plan.waste_formula[1:] == 0.0) & (plan.waste[1:] > 0.0)))
    assert grown > 180 and split > 100


def test_no_way_to_hand_out_the_sweeps_has_fewer_waits() -> None:
    rng = np.random.default_rng(11)
    waiting = done = 0
    while done < 150:
        head, lengths, angles, _ = random_ply(rng)
        head = replace(head, roll_length=150.0)
        lengths, angles = lengths[:4], angles[:4]
        try:
            plan = ply(head, lengths, angles)
        except CutsCross:
            continue
        done += 1
        cuts = plan.cuts
        half = np.where(
            cuts.square, 0.0, (head.tape_width / 2.0 + head.knife_clearance) * np.abs(1 / np.tan(cuts.angles))
        )
        rising = np.where(cuts.square, 0, np.sign(np.cos(cuts.angles)))
        fewest = len(cuts) + 1
        for way in itertools.product((0, 1), repeat=len(cuts)):
            free, side, blade, waits = [0.0, 0.0], [1, -1], [math.nan, math.nan], 0
            for cut, knife in enumerate(way):
                begin = cuts.stations[cut] - half[cut] - head.knife_pitch * knife
                if begin < free[knife] - NEAR:
                    break
                start = -int(rising[cut]) or side[knife]
                turns = not math.isnan(blade[knife]) and blade[knife] != cuts.blades[cut]
                waits += (start != side[knife] or turns) and begin - free[knife] <= 1e-5
                free[knife], side[knife], blade[knife] = begin + 2 * half[cut], -start, cuts.blades[cut]
            else:
                fewest = min(fewest, waits)
        assert np.sum(plan.moves.u[:, 0] == plan.moves.u[:, 1]) == fewest
        waiting += fewest
    assert waiting > 50


def test_square_cuts_share_everything_and_stop_the_tape() -> None:
    plan = ply(replace(HEAD, tape_width=0.075), [0.9] * 4, [(90.0, 90.0)] * 4)
    check(plan, [0.9] * 4, [(90.0, 90.0)] * 4)
    assert plan.stations == pytest.approx([0.005, 0.905, 1.805, 2.705])
    assert plan.waste == pytest.approx([0.005, 0.0, 0.0, 0.0])
    assert len(plan.cuts) == 5 and plan.cuts.square.all()
    assert plan.waste_percent == pytest.approx(100 * 0.005 / 3.605)
    # Each course but the last is laid while the cut one course further up the tape is made.
    assert plan.laying_stops.tolist() == [1, 1, 1, 1]
    assert plan.taken_back.tolist() == [0.0] * 4


def test_a_course_shorter_than_knife_to_nip_is_cut_before_it_is_laid() -> None:
    plan = ply(replace(HEAD, tape_width=0.075), [0.1], [(90.0, 90.0)])
    first, last = plan.threading[0]
    assert (plan.steps.kinds[first:last] == Step.CUT).sum() == 2
    assert plan.laying_stops.tolist() == [0]


def test_parallel_cuts_closer_than_a_sweep_are_split_until_a_knife_is_free() -> None:
    run = 0.32 * cot(20.0)
    plan = ply(HEAD, [0.1] * 3, [(20.0, 20.0)] * 3)
    check(plan, [0.1] * 3, [(20.0, 20.0)] * 3)
    # Two cuts a course keep both knives busy for one run: the next course starts one run further.
    assert np.diff(plan.stations) == pytest.approx([run, run])
    assert plan.waste_formula[1:].tolist() == [0.0, 0.0]
    assert plan.waste_knives[1:] == pytest.approx([run - 0.1] * 2)
    assert set(zip(plan.cuts.knives[::2], plan.cuts.knives[1::2], strict=True)) <= {(1, 2), (2, 1)}


def test_first_course_leaves_room_for_its_leading_sweep() -> None:
    for angle in (20.0, 45.0, 89.0, 135.0, 160.0):
        plan = ply(HEAD, [3.0], [(angle, angle)])
        assert plan.stations[0] == pytest.approx(max(0.16 * abs(cot(angle)), 0.15 * abs(cot(angle)) + 0.005))
        assert plan.cuts.u[0, 0] == pytest.approx(max(0.0, 0.005 - 0.01 * abs(cot(angle))), abs=NEAR)


def test_tape_is_taken_back_with_both_knives_up() -> None:
    wraps = np.array([[0.0, 0.0], [0.004, 0.0]])
    plan = ply(replace(HEAD, tape_width=0.075), [1.0, 1.0], [(90.0, 90.0)] * 2, wraps)
    assert plan.taken_back == pytest.approx([0.0, 0.004])
    # The second course's end comes under the nip while knife 2 is cutting the third one's.
    head = replace(HEAD, tape_width=0.075, knife_to_nip=0.44)
    plan = ply(head, [0.5, 0.5, 0.5, 0.5], [(45.0, 45.0)] * 4, np.array([[0.0, 0.0], [0.0, 0.0], [0.004, 0.0], [0, 0]]))
    sweep = plan.cuts.u[3]
    assert sweep[0] < plan.ends[1] < sweep[1]
    assert plan.threaded[2] == pytest.approx(sweep[1])
    assert plan.taken_back[2] == pytest.approx(sweep[1] - plan.begins[2])


def test_a_roll_is_changed_before_it_runs_out() -> None:
    head = replace(HEAD, tape_width=0.075, roll_length=3.0)
    plan = ply(head, [1.0] * 5, [(90.0, 90.0)] * 5)
    check(plan, [1.0] * 5, [(90.0, 90.0)] * 5)
    assert plan.rolls.tolist() == [0, 0, 1, 1, 2]
    assert plan.roll_u == pytest.approx([0.0, 2.355, 4.71])
    assert plan.waste_roll == pytest.approx([0.0, 0.0, 0.35, 0.0, 0.35])
    # To the last of its tape: a third course fits on 3.455 m (5 mm, three courses, the nip, knife 2) and no less.
    for roll, rolls in ((3.455 + 1e-6, [0, 0, 0]), (3.455 - 1e-6, [0, 0, 1])):
        assert ply(replace(head, roll_length=roll), [1.0] * 3, [(90.0, 90.0)] * 3).rolls.tolist() == rolls


def test_knives_between_steps_stay_on_the_lines() -> None:
    lengths, angles = [1.2, 0.7, 0.9], [(20.0, 45.0), (120.0, 90.0), (90.0, 160.0)]
    plan = ply(HEAD, lengths, angles)
    steps = plan.steps
    u = np.linspace(0.0, float(steps.u[-1]), 4001)
    rows = np.searchsorted(steps.u, u)
    poses = steps.at(u[1:], rows[1:])
    for cut in range(len(plan.cuts)):
        begin, end = plan.cuts.u[cut]
        inside = (u[1:] > begin) & (u[1:] < end)
        column = 2 * (int(plan.cuts.knives[cut]) - 1)
        sigma = u[1:][inside] + (0.1 if column else 0.0)
        line = plan.cuts.stations[cut] + poses[inside, column] / math.tan(plan.cuts.angles[cut])
        assert np.abs(sigma - line).max(initial=0.0) < NEAR
        assert (poses[inside, column + 1] == plan.cuts.blades[cut]).all()
    # Tape that was taken back leaves the knives where they are; beyond the last step they stay.
    done = np.array([5, 5, len(steps)])
    assert (steps.at(np.array([0.0, float(steps.u[4]), 1e3]), done) == steps.poses[done - 1]).all()


def broken(plan: TapePlan, **changes: object) -> TapePlan:
    fields = {
        name: np.array(getattr(plan.steps, name)) for name in ("u", "kinds", "knives", "poses", "speeds", "raised")
    }
    for name, change in changes.items():
        row, value = change  # type: ignore[misc]
        fields[name][row] = fields[name][row] + value
    return replace(plan, steps=KnifeSteps(**fields))


def test_the_checker_bites() -> None:
    lengths, angles = [0.4, 0.6, 0.5], [(20.0, 30.0), (30.0, 90.0), (120.0, 160.0)]
    plan = ply(HEAD, lengths, angles)
    check(plan, lengths, angles)
    kinds = plan.steps.kinds
    down, up, cut = (int(np.flatnonzero(kinds == kind)[-1]) for kind in (Step.DOWN, Step.UP, Step.CUT))
    fed = up - 1
    mutants = [
        broken(plan, poses=((up, 0), 1e-3), u=(0, 0.0)),
        broken(plan, poses=((slice(down, up + 1), slice(1, 4, 2)), 1e-3)),
        broken(plan, poses=(slice(None), 1e-3)),
        broken(plan, poses=((slice(None), slice(0, 4, 2)), 0.05)),
        broken(plan, u=(slice(1, None), 1e-3)),
        broken(plan, u=(fed, -1e-3)),
        broken(plan, kinds=(down, 1)),
        broken(plan, kinds=(cut, 2)),
        broken(plan, knives=(down, 1 if plan.steps.knives[down] == 1 else -1)),
        replace(plan, stations=plan.stations + [0.0, 0.0, 1e-4]),
        replace(plan, stations=plan.stations - [0.0, 1e-4, 1e-4]),
        replace(plan, threading=plan.threading + [0, 1]),
        replace(plan, laying=plan.laying - [0, 1]),
        replace(plan, waste_knives=plan.waste_knives + 1e-5),
        replace(plan, course_cuts=plan.course_cuts[::-1]),
    ]
    passed = []
    for number, mutant in enumerate(mutants):
        try:
            check(mutant, lengths, angles)
        except AssertionError:
            continue
        passed.append(number)
    assert passed == []
    moved = replace(plan, stations=plan.stations + [0.0, 0.0, 1e-3])
    with pytest.raises(AssertionError):
        prove_smallest(moved, lengths, angles, 0.25e-3)


COURSES = st.lists(
    st.tuples(
        st.floats(0.02, 2.0),
        st.one_of(st.sampled_from(ANGLES), st.floats(15.0, 165.0)),
        st.one_of(st.sampled_from(ANGLES), st.floats(15.0, 165.0)),
    ),
    min_size=1,
    max_size=6,
)


@given(COURSES)
@settings(max_examples=150, deadline=None)
def test_a_mirrored_ply_has_the_same_stations(courses: list[tuple[float, float, float]]) -> None:
    lengths, angles = [c[0] for c in courses], [(c[1], c[2]) for c in courses]
    mirrored = [(180.0 - a, 180.0 - b) for a, b in angles]
    try:
        plan = ply(HEAD, lengths, angles)
    except CutsCross as refusal:
        with pytest.raises(CutsCross) as other:
            ply(HEAD, lengths, mirrored)
        assert other.value.courses == refusal.courses
        return
    check(plan, lengths, angles)
    other_hand = ply(HEAD, lengths, mirrored)
    assert other_hand.stations == pytest.approx(plan.stations, abs=NEAR)
    assert len(other_hand.cuts) == len(plan.cuts)


@given(COURSES)
@settings(max_examples=100, deadline=None)
def test_later_courses_change_no_earlier_station(courses: list[tuple[float, float, float]]) -> None:
    lengths, angles = [c[0] for c in courses], [(c[1], c[2]) for c in courses]
    try:
        plan = ply(HEAD, lengths, angles)
    except CutsCross:
        return
    for count in range(1, len(lengths)):
        assert ply(HEAD, lengths[:count], angles[:count]).stations.tolist() == plan.stations[:count].tolist()


def test_a_ply_of_many_courses_on_many_rolls() -> None:
    rng = np.random.default_rng(3)
    lengths = rng.uniform(0.5, 5.0, 3000).tolist()
    angles = [(angle, angle) for angle in rng.choice([45.0, 90.0, 135.0], 3000).tolist()]
    plan = ply(replace(HEAD, tape_width=0.075), lengths, angles)
    strokes = replay(plan)
    assert len(strokes) == len(plan.cuts) and plan.rolls[-1] > 50
    walk(plan)


@pytest.mark.parametrize("width", [0.075, 0.15, 0.3])
@pytest.mark.parametrize("name", ["boss_panel_20", "cylinder_panel_15", "flat_panel_00", "wing_skin_45"])
def test_plies_of_the_examples(name: str, width: float) -> None:
    lengths: list[float] = []
    last = 0.0
    for line in (EXAMPLES / f"{name}.txt").read_text().splitlines():
        words = line.split()
        if len(words) == 7:
            last = float(words[6]) * 1e-3
        elif words[0] == "end":
            lengths.append(last)
    for angle, nip in itertools.product((20.0, 45.0, 90.0, 110.0, 160.0), (0.2, 0.8)):
        head, angles = replace(HEAD, tape_width=width, knife_to_nip=nip), [(angle, angle)] * len(lengths)
        plan = ply(head, lengths, angles)
        check(plan, lengths, angles)
        prove = min(4, len(lengths))
        prove_smallest(plan, lengths[:prove], angles[:prove], 1e-3)


def test_flat_cuts_are_refused_by_course() -> None:
    with pytest.raises(CutAngleTooSmall) as refused:
        ply(HEAD, [1.0, 1.0, 1.0], [(90.0, 90.0), (14.0, 90.0), (10.0, 166.0)])
    assert refused.value.courses == (2, 3)
    assert str(refused.value) == (
        "course 2: its start cut is at 14 deg, less than minimum_cut_angle_deg = 15 from the tape's edge; "
        "give it a steeper cut\n"
        "course 3: its start and end cuts are at 10 and 166 deg, less than minimum_cut_angle_deg = 15 from the tape's "
        "edge; give it a steeper cut"
    )
    ply(HEAD, [3.0], [(15.0, 165.0)])
    with pytest.raises(CutAngleTooSmall):
        ply(HEAD, [1.0], [(math.nan, 90.0)])


def test_many_refused_courses_are_counted() -> None:
    with pytest.raises(CutAngleTooSmall) as refused:
        ply(HEAD, [1.0] * 23, [(10.0, 90.0)] * 23)
    lines = str(refused.value).splitlines()
    assert len(lines) == 21 and lines[-1] == "and 3 more courses"


def test_crossing_cuts_are_refused_with_the_length_that_would_do() -> None:
    with pytest.raises(CutsCross) as refused:
        ply(HEAD, [0.8, 1.0], [(20.0, 160.0), (45.0, 45.0)])
    assert str(refused.value) == (
        "course 1: its cuts at 20 and 160 deg cross inside the 300 mm tape, as it is 800.000 mm long; "
        "it must be longer than 824.243 mm"
    )
    least = 0.15 * 2.0 * cot(20.0)
    check(ply(HEAD, [least + 1e-6], [(20.0, 160.0)]), [least + 1e-6], [(20.0, 160.0)])
    for length in (least - 1e-9, math.nan):
        with pytest.raises(CutsCross):
            ply(HEAD, [length], [(20.0, 160.0)])


def test_a_course_longer_than_a_roll_is_refused() -> None:
    with pytest.raises(CourseLongerThanRoll) as refused:
        ply(HEAD, [1.0, 149.7, 2.0], [(90.0, 90.0)] * 3)
    assert str(refused.value) == (
        "course 2: 149700.000 mm long, it needs 150.155 m of tape with the waste before it and what lies between "
        "knives and nip, but a roll holds 150 m; split it"
    )


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"2 courses do not fit \(1,\) lengths"):
        plan_tape(HEAD, [1, 2], np.ones(1), np.ones((2, 2)), np.zeros((2, 2)))


def test_a_plan_cannot_be_changed() -> None:
    plan = ply(HEAD, [1.0], [(45.0, 45.0)])
    for rows in (plan.stations, plan.cuts.u, plan.moves.u, plan.steps.poses):
        with pytest.raises(ValueError, match="read-only"):
            rows[0] = 0.0
