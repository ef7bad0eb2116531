"""Cut assignment: the station of each course of a ply on the tape, and the knife that makes each cut.

A station is a length along the tape from its first leading edge towards the supply roll (see `tape_plan`).
Course by course, the search keeps every assignment of sweeps to the two knives that reaches the smallest station.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import CourseLongerThanRoll, CutAngleTooSmall, CutsCross
from tapelayer.laying.head import Head, check_head

# Two lines that diverge by no more than this over the width and both clearances are one line.
SAME_LINE = 1e-5
# A raised move that has no more feed than this is made with the tape at rest.
LEAST_FEED = 1e-5
# A raised move takes the last metre of feed before its sweep: at 1 m/s a slide has a second for its travel.
MOVE_FEED = 1.0
# Rounding of u over kilometres of tape: an end and a start closer together than this touch.
TOUCH = 1e-9
ANGLE_ROUNDING = 1e-9
LEFT, RIGHT, EITHER = 1, -1, 0

T = TypeVar("T")


def _cots(head: Head, numbers: Sequence[int], lengths: Floats, cut_angles: Floats) -> Floats:
    """Return the cotangents (n, 2) of the cut angles, and refuse what cannot be cut."""
    flat = np.minimum(cut_angles, math.pi - cut_angles)
    faulty = ~(flat >= head.minimum_cut_angle - ANGLE_ROUNDING)
    rows = np.flatnonzero(faulty.any(axis=1)).tolist()
    if rows:
        sentences = []
        for row in rows:
            ends = "start and end cuts are" if faulty[row].all() else f"{'end' if faulty[row, 1] else 'start'} cut is"
            degrees = " and ".join(f"{math.degrees(angle):g}" for angle in cut_angles[row][faulty[row]])
            sentences.append(
                f"course {numbers[row]}: its {ends} at {degrees} deg, less than minimum_cut_angle_deg = "
                f"{math.degrees(head.minimum_cut_angle):g} from the tape's edge; give it a steeper cut"
            )
        raise CutAngleTooSmall([numbers[row] for row in rows], sentences)
    cots: Floats = np.cos(cut_angles) / np.sin(cut_angles)
    shortest = head.tape_width / 2.0 * np.abs(cots[:, 0] - cots[:, 1])
    rows = np.flatnonzero(~(lengths > shortest)).tolist()
    if rows:
        sentences = [
            f"course {numbers[row]}: its cuts at {math.degrees(cut_angles[row, 0]):g} and "
            f"{math.degrees(cut_angles[row, 1]):g} deg cross inside the {head.tape_width * 1e3:g} mm tape, as it is "
            f"{lengths[row] * 1e3:.3f} mm long; it must be longer than {shortest[row] * 1e3:.3f} mm"
            for row in rows
        ]
        raise CutsCross([numbers[row] for row in rows], sentences)
    return cots


class _Sweep(NamedTuple):
    """A cut before a knife is assigned.

    Attributes:
        cot: cotangent of its angle.
        reach: how far from the centre line the sweep starts and ends.
        half: half its run in u, 0 if square.
        start: its starting side.
        blade: angle of the blade.
        speed: of the tape at which it is swept in passing; 0 where the tape stops for its ends.
    """

    cot: float
    reach: float
    half: float
    start: int
    blade: float
    speed: float


class _Course(NamedTuple):
    """A course before it has a station: its length, that plus the tape from its end to the nip, and its two sweeps."""

    length: float
    fed: float
    lead: _Sweep
    trail: _Sweep


class _Roll(NamedTuple):
    """A roll: u at its leading edge and the highest u it can be fed to; knife 2 stands `pitch` upstream."""

    floor: float
    limit: float
    pitch: float


class AssignedCut(NamedTuple):
    """A sweep by a knife (0 or 1) from u = begin to end, where the knife's last one left it, and the previous sweep."""

    knife: int
    begin: float
    end: float
    start: int
    reach: float
    blade: float
    speed: float
    left_u: float
    left_side: int
    left_reach: float
    left_blade: float
    earlier: AssignedCut | None


class _State(NamedTuple):
    """State of the two knives after some sweeps.

    Attributes:
        free: u from which each knife is free.
        sides: side of the tape on which each stands.
        reaches: how far from the centre line each stands; NaN before the first sweep, which it waits for in its place.
        blades: angle of each blade; NaN before the first sweep, for which the blade is set up as needed.
        cost: waits, metres of feed that raised moves lack, raised crossings, sweeps by knife 2.
        made: the last sweep.
    """

    free: tuple[float, float]
    sides: tuple[int, int]
    reaches: tuple[float, float]
    blades: tuple[float, float]
    cost: tuple[int, float, int, int]
    made: AssignedCut | None


class _Placement(NamedTuple):
    """A course's place on the tape, and every state of the knives after it: none if the roll does not hold it."""

    station: float
    shared: bool
    formula: float
    states: Sequence[_State]


class Assignment(NamedTuple):
    """The courses and cuts on the tape, and the sweep that makes each cut.

    Attributes:
        stations: (n,) metres, station of each course's start.
        rolls: (n,) number of each course's roll, from 0.
        roll_u: (m,) metres, u at which each roll's leading edge stands at knife 1.
        waste: (n, 3) metres wasted before each course: for a new roll, by the formula, for the knives.
        course_cuts: (n, 2) index of the cut at each course's start and end.
        cut_stations: (c,) metres, where each cut meets the centre line.
        cut_angles: (c,) radians.
        square: (c,) True where the tape rests during the sweep.
        made: the sweeps in the order of the cuts.
    """

    stations: Floats
    rolls: Ints
    roll_u: Floats
    waste: Floats
    course_cuts: Ints
    cut_stations: Floats
    cut_angles: Floats
    square: Mask
    made: list[AssignedCut]


_INITIAL = _State((0.0, 0.0), (LEFT, RIGHT), (math.nan, math.nan), (math.nan, math.nan), (0, 0.0, 0, 0), None)


def assign_stations(
    head: Head, numbers: Sequence[int], lengths: Floats, cut_angles: Floats, wraps: Floats
) -> Assignment:
    """Return the stations and sweeps of a ply; arguments and errors as in `tapelayer.laying.tape_plan.plan_tape`."""
    check_head(head)
    cots = _cots(head, numbers, lengths, cut_angles)
    courses = [
        _Course(
            float(length),
            float(length + head.knife_to_nip - wrap),
            *(_sweep(head, float(angle), float(cot)) for angle, cot in zip(*ends, strict=True)),
        )
        for length, wrap, *ends in zip(lengths, wraps[:, 1], cut_angles, cots, strict=True)
    ]
    # A knife that finished its sweep this much tape ago has all the feed it needs for any sweep to come.
    halves = [sweep.half for course in courses for sweep in (course.lead, course.trail)]
    past = max(halves) + head.knife_pitch + MOVE_FEED
    states: Sequence[_State] = [_INITIAL]
    stations: list[float] = []
    rolls: list[int] = []
    roll_u: list[float] = []
    waste: list[tuple[float, float, float]] = []
    course_cuts: list[tuple[int, int]] = []
    cut_stations: list[float] = []
    cut_owners: list[tuple[int, int]] = []
    end = laid = 0.0
    # There is no roll yet: an empty one makes the first course start a roll.
    roll, before = _Roll(0.0, -math.inf, head.knife_pitch), courses[0].lead
    for k, course in enumerate(courses):
        edge = end
        place = _following(head, states, course, before, end, roll)
        if not place.states:
            # A new roll comes when every sweep of the old one is finished and its tape is laid up to the nip.
            edge = max(laid, min(max(state.free) for state in states))
            roll = _Roll(edge, edge + head.roll_length - head.knife_pitch, head.knife_pitch)
            roll_u.append(edge)
            place = _leading(head, [state for state in states if max(state.free) <= edge], course, roll)
            if not place.states:
                raise _longer_than_roll(head, numbers, courses)
        states = _distinct(place.states, place.station + course.length - past)
        stations.append(place.station)
        rolls.append(len(roll_u) - 1)
        # The formula's share is exact; the rest can fall below zero by rounding.
        waste.append((edge - end, place.formula, max(0.0, place.station - edge - place.formula)))
        if not place.shared:
            cut_stations.append(place.station)
            cut_owners.append((k, 0))
        end = place.station + course.length
        laid = max(laid, place.station + course.fed)
        before = course.trail
        course_cuts.append((len(cut_stations) - 1, len(cut_stations)))
        cut_stations.append(end)
        cut_owners.append((k, 1))

    made: list[AssignedCut] = []
    last = min(states, key=lambda state: state.cost).made
    while last is not None:
        made.append(last)
        last = last.earlier
    owners = tuple(np.array(cut_owners).T)
    return Assignment(
        np.array(stations),
        np.array(rolls),
        np.array(roll_u),
        np.array(waste),
        np.array(course_cuts),
        np.array(cut_stations),
        cut_angles[owners],
        2.0 * head.half_sweep * np.abs(cots[owners]) <= SAME_LINE,
        made[::-1],
    )


def _sweep(head: Head, angle: float, cot: float) -> _Sweep:
    reach, blade = head.reach(cot), angle - math.pi / 2.0
    if 2.0 * head.half_sweep * abs(cot) <= SAME_LINE:
        return _Sweep(cot, head.half_sweep, 0.0, EITHER, blade, 0.0)
    return _Sweep(cot, reach, reach * abs(cot), RIGHT if cot > 0.0 else LEFT, blade, head.sweep_speed(cot))


def _following(
    head: Head, states: Sequence[_State], course: _Course, before: _Sweep, end: float, roll: _Roll
) -> _Placement:
    """Place a course on the same roll after the one that ends at station `end` with the cut `before`."""
    apart = abs(before.cot - course.lead.cot)
    one_line = 2.0 * head.half_sweep * apart <= SAME_LINE
    if one_line and end + course.fed <= roll.limit:
        reached = _swept(states, end + course.length, course.trail, roll)
        if reached:
            return _Placement(end, True, 0.0, reached)
    formula = head.tape_width / 2.0 * apart + head.scrap_margin
    station = max(end + formula, _lowest(states, course, roll))
    # Cuts at one angle need no waste by the formula: all of it is for the knives.
    return _Placement(station, False, 0.0 if one_line else formula, _cut(states, station, course, roll))


def _leading(head: Head, states: Sequence[_State], course: _Course, roll: _Roll) -> _Placement:
    """Place the first course of a roll, whose leading edge is a square cut that is not shared."""
    formula = head.tape_width / 2.0 * abs(course.lead.cot) + head.scrap_margin
    station = max(roll.floor + formula, _lowest(states, course, roll))
    return _Placement(station, False, formula, _cut(states, station, course, roll))


def _cut(states: Sequence[_State], station: float, course: _Course, roll: _Roll) -> Sequence[_State]:
    """Return the states after both sweeps of a course at `station`."""
    if not station + course.fed <= roll.limit:
        return ()
    return _swept(_swept(states, station, course.lead, roll), station + course.length, course.trail, roll)


def _swept(states: Sequence[_State], station: float, sweep: _Sweep, roll: _Roll) -> Sequence[_State]:
    """Return the states after a sweep along the line through `station`, by either knife that is free."""
    after = []
    for state in states:
        for knife in (0, 1):
            begin, free = station - sweep.half - roll.pitch * knife, state.free[knife]
            end = begin + 2.0 * sweep.half
            # By rounding, a knife can become free a hair after its sweep begins.
            if begin < max(free, roll.floor) - TOUCH or end > roll.limit:
                continue
            begin = max(begin, free, roll.floor)
            side, reach, blade = state.sides[knife], state.reaches[knife], state.blades[knife]
            start = sweep.start or side
            if math.isnan(blade):
                reach, blade = sweep.reach, sweep.blade
            crosses = start != side
            moves = crosses or blade != sweep.blade or reach != sweep.reach
            feed = begin - free if moves else MOVE_FEED
            cost = (
                state.cost[0] + (feed <= LEAST_FEED),
                state.cost[1] + max(0.0, MOVE_FEED - feed),
                state.cost[2] + crosses,
                state.cost[3] + knife,
            )
            made = AssignedCut(
                knife, begin, end, start, sweep.reach, sweep.blade, sweep.speed, free, side, reach, blade, state.made
            )
            after.append(
                _State(
                    _with(state.free, knife, end),
                    _with(state.sides, knife, -start),
                    _with(state.reaches, knife, sweep.reach),
                    _with(state.blades, knife, sweep.blade),
                    cost,
                    made,
                )
            )
    return after


def _with(pair: tuple[T, T], knife: int, value: T) -> tuple[T, T]:
    return (value, pair[1]) if knife == 0 else (pair[0], value)


def _lowest(states: Sequence[_State], course: _Course, roll: _Roll) -> float:
    """Return the smallest station at which a knife is free for a course's leading and trailing sweep."""
    lowest = math.inf
    for state in states:
        for knife in (0, 1):
            station = max(state.free[knife], roll.floor) + course.lead.half + roll.pitch * knife
            if course.length < course.lead.half + course.trail.half:
                other = 1 - knife
                trails = max(state.free[other], roll.floor) + course.trail.half + roll.pitch * other
                station = max(station, trails - course.length)
            lowest = min(lowest, station)
    return lowest


def _distinct(states: Sequence[_State], past: float) -> Sequence[_State]:
    """Return the cheapest state of each group that no sweep from u = `past` on can tell apart."""
    cheapest: dict[tuple[object, ...], _State] = {}
    for state in states:
        known = tuple(
            (side, free, reach, blade) if free > past else (side,)
            for side, free, reach, blade in zip(state.sides, state.free, state.reaches, state.blades, strict=True)
        )
        if known not in cheapest or state.cost < cheapest[known].cost:
            cheapest[known] = state
    return list(cheapest.values())


def _longer_than_roll(head: Head, numbers: Sequence[int], courses: Sequence[_Course]) -> CourseLongerThanRoll:
    """Return the refusal of every course that a new roll cannot feed up to its last point and its last cut."""
    endless = _Roll(0.0, math.inf, head.knife_pitch)
    refused, sentences = [], []
    for number, course in zip(numbers, courses, strict=True):
        place = _leading(head, [_INITIAL], course, endless)
        cut = min(max(state.free) for state in place.states)
        needed = max(cut, place.station + course.fed) + head.knife_pitch
        if not needed <= head.roll_length:
            refused.append(number)
            sentences.append(
                f"course {number}: {course.length * 1e3:.3f} mm long, it needs {needed:.3f} m of tape with the waste "
                f"before it and what lies between knives and nip, but a roll holds {head.roll_length:g} m; split it"
            )
    return CourseLongerThanRoll(refused, sentences)
