"""The plan of cuts, replayed step by step on a tape by a checker that knows only the definitions."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.errors import (
    CourseLongerThanRoll,
    CoursesRefused,
    CutsCross,
)
from tapelayer.tape import Head, Step, TapePlan, plan_tape

HEAD = Head(
    tape_width=0.3,
    knife_to_nip=0.35,
    knife_pitch=0.1,
    knife_clearance=0.01,
    scrap_margin=0.005,
    blade_length=0.02,
    travel_v=(-0.2, 0.2),
    travel_q=(-0.2, 0.2),
    minimum_cut_angle=math.radians(15.0),
    roll_length=150.0,
)
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


def replay(plan: TapePlan) -> list[Stroke]:
    """Follow both knives through the steps; every conflict is an assertion."""
    head, steps = plan.head, plan.steps
    half = head.tape_width / 2.0
    reach = half + head.knife_clearance
    assert steps.u[0] == 0.0 and steps.kinds[0] == Step.FEED
    assert steps.poses[0, 0] == pytest.approx(reach) and steps.poses[0, 2] == pytest.approx(-reach)
    down: dict[int, Stroke] = {}
    strokes: list[Stroke] = []
    u, pose = 0.0, steps.poses[0]
    feeds = set()
    for row in range(1, len(steps)):
        new_u, new, kind, knife = float(steps.u[row]), steps.poses[row], steps.kinds[row], int(steps.knives[row])
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
            assert abs(pose[2 * knife - 2]) >= half
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
        assert sorted([stroke.w[0], stroke.w[-1]]) == pytest.approx([-reach, reach], abs=NEAR)
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
            assert cuts.stations[index] == pytest.approx(station, abs=NEAR)
            assert (cuts.starting, cuts.ending)[end][index] == k
            assert cuts.knives[index] == stroke.knife
            assert cuts.u[index] == pytest.approx([stroke.u[0], stroke.u[-1]], abs=NEAR)
            assert cuts.slides[index] == pytest.approx([stroke.w[0], stroke.w[-1]], abs=NEAR)
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
                assert plan.moves.slides[row] == pytest.approx([standing, stroke.w[0]], abs=NEAR)
                assert plan.moves.blades[row] == pytest.approx([blade, stroke.blades[0]], abs=0.0)
            standing, free, blade = stroke.w[-1], stroke.u[-1], stroke.blades[0]
        assert not moves

    # Rolls, and the tape before each course.
    begins = starts + head.knife_to_nip - wraps[:, 0]
    lasts = ends + head.knife_to_nip - wraps[:, 1]
    assert plan.begins == pytest.approx(begins) and plan.ends == pytest.approx(lasts)
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
        assert plan.waste_formula[k] == pytest.approx(formula, abs=NEAR)
        before = 0.0 if k == 0 else float(ends[k - 1])
        assert starts[k] - before == pytest.approx(float(plan.waste[k]), abs=NEAR)
        assert plan.waste_roll[k] == pytest.approx(edge - before if new else 0.0, abs=NEAR)
        assert min(plan.waste_roll[k], plan.waste_formula[k], plan.waste_knives[k]) >= 0.0
        if shared:
            assert plan.waste[k] == 0.0
        else:
            assert plan.waste_formula[k] + plan.waste_knives[k] >= head.scrap_margin - NEAR
    assert plan.used == pytest.approx(sum(lengths) + float(np.sum(plan.waste)))
    walk(plan)


def walk(plan: TapePlan) -> None:
    """Go through the plan as a program does: every step done once, at its u, tape never back with a knife down."""
    steps = plan.steps
    done, u, furthest = 1, 0.0, 0.0
    down = [0, 0]

    def carry_out(rows: tuple[int, int]) -> None:
        nonlocal done, u, furthest
        first, last = rows
        assert first == done
        for row in range(first, last):
            assert steps.u[row] >= furthest - 2e-9
            u = furthest = max(float(steps.u[row]), furthest)
            if steps.kinds[row] in (Step.DOWN, Step.UP):
                down[steps.knives[row] - 1] = int(steps.kinds[row] == Step.DOWN)
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
        assert plan.laying_stops[k] == len(
            {float(steps.u[row]) for row in range(first, last) if steps.kinds[row] in (Step.MOVE, Step.CUT)}
        )
        carry_out((int(first), int(last)))
        feed(float(plan.ends[k]))
    carry_out((done, len(steps)))
    assert down == [0, 0]


def colourable(begins: Floats, ends: Floats, pitch: float) -> np.ndarray:
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
    possible: np.ndarray = (~(twice | early)).any(axis=1)
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

        def possible(stations: Floats, shared: bool, k: int = k, length: float = length) -> np.ndarray:
            columns = [np.full((len(stations), 2), sweep) for sweep in sweeps]
            if not shared:
                columns.append(stations[:, None] + [-halves[k][0], halves[k][0]])
            columns.append(stations[:, None] + length + [-halves[k][1], halves[k][1]])
            table = np.stack(columns, axis=1)
            return colourable(table[:, :, 0], table[:, :, 1], head.knife_pitch)

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
    while done < 120:
        head, lengths, angles, _ = random_ply(rng)
        head = replace(head, roll_length=150.0)
        lengths, angles = lengths[:4], angles[:4]
        try:
            plan = ply(head, lengths, angles)
        except CutsCross:
            continue
        prove_smallest(plan, lengths, angles, 0.5e-3)
        done += 1
        grown += int(np.sum(plan.waste_knives[1:] > 1e-6))
        split += int(np.sum((plan.waste_formula[1:] == 0.0) & (plan.waste[1:] > 0.0)))
    assert grown > 50 and split > 20
