"""Tape: the stations of the courses on the tape and the knives' work over them; it knows lengths, never seconds.

A station is a length along the tape from its first leading edge towards the supply roll, u the station at knife 1;
knife 2 stands `knife_pitch` upstream, at station u + `knife_pitch`. Across the tape, left of travel is positive.
A cut at angle alpha is the line sigma(w) = sigma_0 + w cot(alpha), and while the tape feeds by du the knife crosses
by du tan(alpha): everything the knives do is a piecewise linear function of u, with the tape at rest where it jumps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints, Mask, frozen
from tapelayer.errors import BladesMeet, CourseLongerThanRoll, CutAngleTooSmall, CutsCross, TapeWiderThanTravel

# Two lines that part by no more than this over the width and both clearances are one line.
SAME_LINE = 1e-5
# A raised move with no more feed than this to make it in is made with the tape at rest.
LEAST_FEED = 1e-5
# A raised move takes the last metre of feed before its sweep: at 1 m/s a slide has a second for its travel.
MOVE_FEED = 1.0
# Rounding of u over kilometres of tape: what ends and what begins nearer than this touch.
TOUCH = 1e-9
ANGLE_ROUNDING = 1e-9
LEFT, RIGHT, EITHER = 1, -1, 0

T = TypeVar("T")


class Step(IntEnum):
    """What a step of the head does.

    FEED: the tape feeds up to the step's u, slides and blades move with it in proportion. MOVE: the tape rests, a
    raised knife goes to its next sweep's start. CUT: the tape rests, a lowered knife crosses it. DOWN, UP: the tape
    rests, a knife goes down or up.
    """

    FEED = 0
    MOVE = 1
    CUT = 2
    DOWN = 3
    UP = 4


@dataclass(frozen=True)
class Head:
    """The tape head's measures, in metres and radians.

    Attributes:
        tape_width: width of the tape.
        knife_to_nip: tape path from knife 1 to the nip on a level surface.
        knife_pitch: knife 2 stands upstream of knife 1 by this.
        knife_clearance: a sweep's run beyond both edges of the tape.
        scrap_margin: least waste between two cuts that are not one.
        blade_length: least distance between the two blades.
        travel_v: lower and upper end of knife 1's slide, left positive.
        travel_q: lower and upper end of knife 2's slide, left positive.
        minimum_cut_angle: least angle between a cut and the tape's edge.
        roll_length: tape on one roll.
    """

    tape_width: float
    knife_to_nip: float
    knife_pitch: float
    knife_clearance: float
    scrap_margin: float
    blade_length: float
    travel_v: tuple[float, float]
    travel_q: tuple[float, float]
    minimum_cut_angle: float
    roll_length: float

    @property
    def reach(self) -> float:
        """Distance from the centre line to a sweep's start and end, in metres."""
        return self.tape_width / 2.0 + self.knife_clearance


class _Rows:
    """Arrays that nobody changes after they are made."""

    def __post_init__(self) -> None:
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, frozen(value))


@dataclass(frozen=True, eq=False)
class Cuts(_Rows):
    """Cuts in the order of their stations, one row each; a shared cut is one row.

    Attributes:
        stations: (c,) metres, where the line meets the centre line.
        angles: (c,) radians from travel towards the left, in (0, pi).
        square: (c,) True where the tape rests during the sweep.
        ending: (c,) index of the course whose end the cut is, -1 for none.
        starting: (c,) index of the course whose start the cut is, -1 for none.
        knives: (c,) the knife that makes it, 1 or 2.
        u: (c, 2) metres, u at the sweep's start and end.
        slides: (c, 2) metres, the slide (v or q) at the sweep's start and end.
        blades: (c,) radians, the blade (d or e) during the sweep.
    """

    stations: Floats
    angles: Floats
    square: Mask
    ending: Ints
    starting: Ints
    knives: Ints
    u: Floats
    slides: Floats
    blades: Floats

    def __len__(self) -> int:
        """Number of cuts."""
        return len(self.stations)


@dataclass(frozen=True, eq=False)
class Moves(_Rows):
    """Moves of a raised knife from where a sweep left it to its next sweep's start, in the order of the cuts.

    Attributes:
        knives: (r,) 1 or 2.
        cuts: (r,) index of the cut that the knife goes to.
        u: (r, 2) metres, where the move begins and ends; equal where the tape waits for it.
        slides: (r, 2) metres, the slide at both.
        blades: (r, 2) radians, the blade at both.
    """

    knives: Ints
    cuts: Ints
    u: Floats
    slides: Floats
    blades: Floats

    def __len__(self) -> int:
        """Number of moves."""
        return len(self.knives)


@dataclass(frozen=True, eq=False)
class Steps(_Rows):
    """What the head does in order of u, each row once, the first time the tape gets there.

    Row 0 is how the head stands at u = 0. The first row at every u is a FEED, so everything is linear between rows.

    Attributes:
        u: (s,) metres, never falling.
        kinds: (s,) `Step` of each row.
        knives: (s,) the knife that moves or switches, 0 for a FEED.
        poses: (s, 4) v, d, q, e after the row, in metres and radians.
        raised: (k,) rising numbers of rows after which no knife is down; the first is 0, the last is s.
    """

    u: Floats
    kinds: NDArray[np.uint8]
    knives: Ints
    poses: Floats
    raised: Ints

    def __len__(self) -> int:
        """Number of steps."""
        return len(self.u)

    def before(self, u: float) -> int:
        """Number of rows that are done when the tape has only just come to `u` (metres)."""
        return int(np.searchsorted(self.u, u - TOUCH, side="left"))

    def through(self, u: float) -> int:
        """Number of rows that are done when everything at `u` (metres) is done."""
        return int(np.searchsorted(self.u, u + TOUCH, side="right"))

    def settled(self, done: int) -> int:
        """Least number of rows, from `done` on, after which no knife is down: the sweeps in progress are finished."""
        return int(self.raised[np.searchsorted(self.raised, done)])

    def rests(self, first: int, last: int) -> int:
        """Number of places where the rows from `first` up to, not with, `last` make the tape wait."""
        kinds = self.kinds[first:last]
        return len(np.unique(self.u[first:last][(kinds == Step.MOVE) | (kinds == Step.CUT)]))

    def at(self, u: Floats, done: Ints) -> Floats:
        """Slides and blades (n, 4) at `u` with the first `done` rows done; tape taken back leaves them where they are.

        Args:
            u: (n,) metres.
            done: (n,) number of rows done, from 1.
        """
        last, following = done - 1, np.minimum(done, len(self) - 1)
        span = self.u[following] - self.u[last]
        share = np.clip((u - self.u[last]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
        # A row at rest is an act of its own: the knives stand still until it is done.
        share = np.where(span > 0.0, share, 0.0)[:, None]
        poses: Floats = self.poses[last] + share * (self.poses[following] - self.poses[last])
        return poses


@dataclass(frozen=True, eq=False)
class TapePlan(_Rows):
    """A ply on the tape: where its courses lie, what is wasted before each, and who cuts it when.

    The head's way through it, course by course: rows `changing` (only before a new roll: feed to the roll's u, change
    it), rows `threading`, back or on to u = `begins`, shoe down, rows `laying` up to u = `ends`, shoe up. Rows after
    the last course's are done with the head in the air.

    Attributes:
        head: the measures it was made for.
        lengths: (n,) metres, laid length of each course.
        stations: (n,) metres, station of each course's start.
        rolls: (n,) number of each course's roll, from 0.
        roll_u: (m,) metres, u at which each roll's leading edge stands at knife 1.
        waste_roll: (n,) metres of tape before the course left between knife and nip for a roll change.
        waste_formula: (n,) metres of tape before the course that the angles and the scrap margin ask for.
        waste_knives: (n,) metres of tape before the course until every sweep finds a free knife.
        course_cuts: (n, 2) index of the cut at each course's start and end.
        cuts: the cuts.
        moves: the raised moves between them.
        steps: cuts and moves in order of u.
        begins: (n,) metres, u with each course's first point under the nip.
        ends: (n,) metres, u with each course's last point under the nip.
        changing: (n, 2) first row and row after the last, done before the roll is changed for the course.
        threading: (n, 2) the same, done while the course's tape is fed to the nip, before the shoe is down.
        laying: (n, 2) the same, done while the course is laid.
        threaded: (n,) metres, highest u of the threading; beyond `begins` where a sweep has to be finished first.
        taken_back: (n,) metres of tape taken back before the course.
    """

    head: Head
    lengths: Floats
    stations: Floats
    rolls: Ints
    roll_u: Floats
    waste_roll: Floats
    waste_formula: Floats
    waste_knives: Floats
    course_cuts: Ints
    cuts: Cuts
    moves: Moves
    steps: Steps
    begins: Floats
    ends: Floats
    changing: Ints
    threading: Ints
    laying: Ints
    threaded: Floats
    taken_back: Floats

    def __len__(self) -> int:
        """Number of courses."""
        return len(self.stations)

    @property
    def waste(self) -> Floats:
        """Tape (n,) in metres that is wasted before each course."""
        return self.waste_roll + self.waste_formula + self.waste_knives

    @property
    def used(self) -> float:
        """Tape from the first leading edge to the last course's end, laid or wasted, in metres."""
        return float(self.stations[-1] + self.lengths[-1])

    @property
    def waste_percent(self) -> float:
        """Wasted part of the tape used, in percent."""
        return 100.0 * float(np.sum(self.waste)) / self.used

    @property
    def laying_stops(self) -> Ints:
        """Number (n,) of places where the tape waits while each course is laid."""
        return np.array([self.steps.rests(first, last) for first, last in self.laying], dtype=np.int64)


def plan_tape(
    head: Head,
    numbers: Sequence[int],
    lengths: Floats,
    cut_angles: Floats,
    wraps: Floats,
    turning_at_rest: frozenset[int] = frozenset(),
) -> TapePlan:
    """Put the courses of a ply on the tape and share their cuts out to the two knives.

    A trailing cut and the next leading cut at one angle are one cut where a knife is free for what follows. Otherwise
    each course starts at the smallest station, not below the formula's, at which both its sweeps find a free knife. Of
    all ways to hand out the sweeps that reach these stations, the one with the fewest waits is taken, then the one with
    the most feed to make raised moves in, then the one with the fewest crossings. A roll's leading edge counts as a
    square cut that is never shared, and no sweep on it begins before it stands at knife 1.

    Args:
        head: the head's measures.
        numbers: the n courses' numbers in their file, for the messages.
        lengths: (n,) metres.
        cut_angles: (n, 2) radians at the start and end, from travel towards the left.
        wraps: (n, 2) metres by which the tape path from knife to nip is shorter than on a level surface (R beta, as
            the nip has moved round the roller) at each course's start and end.
        turning_at_rest: knives whose blade turns only while everything else stands still.

    Raises:
        TapeWiderThanTravel: a slide cannot reach the start and end of its sweeps.
        BladesMeet: the knives cannot pass each other.
        CutAngleTooSmall: a cut lies flatter to the tape than allowed.
        CutsCross: a course's own two cut lines cross inside the tape.
        CourseLongerThanRoll: a course needs more tape than a new roll holds.
    """
    count = len(numbers)
    if not count or lengths.shape != (count,) or cut_angles.shape != (count, 2) or wraps.shape != (count, 2):
        raise ValueError(
            f"{count} courses do not fit {lengths.shape} lengths, {cut_angles.shape} cut angles, {wraps.shape} wraps"
        )
    _check_head(head)
    cots = _cots(head, numbers, lengths, cut_angles)
    placed = _placed(head, numbers, lengths, cut_angles, cots, wraps)
    cuts, moves = _work(head, placed)
    steps = _steps(head, cuts, moves, turning_at_rest)
    begins = placed.stations + head.knife_to_nip - wraps[:, 0]
    ends = placed.stations + lengths + head.knife_to_nip - wraps[:, 1]
    passes = _passes(steps, begins, ends, placed.rolls, placed.roll_u)
    return TapePlan(
        head=head,
        lengths=lengths,
        stations=placed.stations,
        rolls=placed.rolls,
        roll_u=placed.roll_u,
        waste_roll=placed.waste[:, 0],
        waste_formula=placed.waste[:, 1],
        waste_knives=placed.waste[:, 2],
        course_cuts=placed.course_cuts,
        cuts=cuts,
        moves=moves,
        steps=steps,
        begins=begins,
        ends=ends,
        changing=passes.changing,
        threading=passes.threading,
        laying=passes.laying,
        threaded=passes.threaded,
        taken_back=passes.taken_back,
    )


def _check_head(head: Head) -> None:
    for axis, knife, (lower, upper) in (("v", 1, head.travel_v), ("q", 2, head.travel_q)):
        if not (lower <= -head.reach and head.reach <= upper):
            widest = max(0.0, 2e3 * (min(-lower, upper) - head.knife_clearance))
            raise TapeWiderThanTravel(
                f"tape of {head.tape_width * 1e3:g} mm needs knife {knife} (axis {axis}) from {-head.reach * 1e3:g} to "
                f"{head.reach * 1e3:g} mm, {head.knife_clearance * 1e3:g} mm beyond both edges, but it travels from "
                f"{lower * 1e3:g} to {upper * 1e3:g} mm; the widest tape is {widest:g} mm"
            )
    if not head.blade_length <= head.knife_pitch:
        raise BladesMeet(
            f"blades of {head.blade_length * 1e3:g} mm would meet, as the knives pass each other at "
            f"{head.knife_pitch * 1e3:g} mm; blade_length_mm must not be more"
        )


def _cots(head: Head, numbers: Sequence[int], lengths: Floats, cut_angles: Floats) -> Floats:
    """Cotangents (n, 2) of the cut angles; refuses what cannot be cut."""
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
    """A cut before a knife is found for it: cot(alpha), half its run in u (0 if square), where it starts, the blade."""

    cot: float
    half: float
    start: int
    blade: float


class _Course(NamedTuple):
    """A course before it has a station: its length, that with the tape from its end to the nip, its two sweeps."""

    length: float
    fed: float
    lead: _Sweep
    trail: _Sweep


class _Roll(NamedTuple):
    """A roll: u at its leading edge and the highest u it can be fed to; knife 2 stands by `pitch` further up."""

    floor: float
    limit: float
    pitch: float


class _Made(NamedTuple):
    """A sweep that a knife (0 or 1) makes from u = begin to end, how it stood before, and the sweep before that."""

    knife: int
    begin: float
    end: float
    start: int
    blade: float
    left_u: float
    left_side: int
    left_blade: float
    earlier: _Made | None


class _State(NamedTuple):
    """How the two knives stand after some sweeps.

    Attributes:
        free: u from which each knife is free.
        sides: where each stands.
        blades: how each blade stands; NaN before the first sweep, which finds it as it needs it.
        cost: waits, metres of feed that raised moves are short of, raised crossings, sweeps of knife 2.
        made: the last sweep.
    """

    free: tuple[float, float]
    sides: tuple[int, int]
    blades: tuple[float, float]
    cost: tuple[int, float, int, int]
    made: _Made | None


class _Lie(NamedTuple):
    """Where a course comes to lie, and every way the knives can do it: none where the roll does not hold it."""

    station: float
    shared: bool
    formula: float
    states: Sequence[_State]


class _Placed(NamedTuple):
    stations: Floats
    rolls: Ints
    roll_u: Floats
    waste: Floats
    course_cuts: Ints
    cut_stations: Floats
    cut_angles: Floats
    square: Mask
    made: list[_Made]


_AT_FIRST = _State((0.0, 0.0), (LEFT, RIGHT), (math.nan, math.nan), (0, 0.0, 0, 0), None)


def _placed(
    head: Head, numbers: Sequence[int], lengths: Floats, cut_angles: Floats, cots: Floats, wraps: Floats
) -> _Placed:
    """Stations, course by course, with every way to hand out the sweeps kept that reaches the smallest one."""
    courses = [
        _Course(
            float(length),
            float(length + head.knife_to_nip - wrap),
            *(_sweep(head, float(angle), float(cot)) for angle, cot in zip(*ends, strict=True)),
        )
        for length, wrap, *ends in zip(lengths, wraps[:, 1], cut_angles, cots, strict=True)
    ]
    # Whatever a knife did before this much tape, it has all the feed it needs for every sweep to come.
    past = float(np.max(np.abs(cots))) * head.reach + head.knife_pitch + MOVE_FEED
    states: Sequence[_State] = [_AT_FIRST]
    stations: list[float] = []
    rolls: list[int] = []
    roll_u: list[float] = []
    waste: list[tuple[float, float, float]] = []
    course_cuts: list[tuple[int, int]] = []
    cut_stations: list[float] = []
    cut_owners: list[tuple[int, int]] = []
    end = laid = 0.0
    # No roll is set yet: it holds nothing, so the first course starts one.
    roll, before = _Roll(0.0, -math.inf, head.knife_pitch), courses[0].lead
    for k, course in enumerate(courses):
        edge = end
        lie = _following(head, states, course, before, end, roll)
        if not lie.states:
            # Every sweep of the old roll is finished, and its tape lies up to the nip, when a new one is set.
            edge = max(laid, min(max(state.free) for state in states))
            roll = _Roll(edge, edge + head.roll_length - head.knife_pitch, head.knife_pitch)
            roll_u.append(edge)
            lie = _leading(head, [state for state in states if max(state.free) <= edge], course, roll)
            if not lie.states:
                raise _longer_than_roll(head, numbers, courses)
        states = _distinct(lie.states, lie.station + course.length - past)
        stations.append(lie.station)
        rolls.append(len(roll_u) - 1)
        # The formula's share is exact; what is beyond it can miss zero by rounding.
        waste.append((edge - end, lie.formula, max(0.0, lie.station - edge - lie.formula)))
        if not lie.shared:
            cut_stations.append(lie.station)
            cut_owners.append((k, 0))
        end = lie.station + course.length
        laid = max(laid, lie.station + course.fed)
        before = course.trail
        course_cuts.append((len(cut_stations) - 1, len(cut_stations)))
        cut_stations.append(end)
        cut_owners.append((k, 1))

    made: list[_Made] = []
    last = min(states, key=lambda state: state.cost).made
    while last is not None:
        made.append(last)
        last = last.earlier
    owners = tuple(np.array(cut_owners).T)
    return _Placed(
        np.array(stations),
        np.array(rolls),
        np.array(roll_u),
        np.array(waste),
        np.array(course_cuts),
        np.array(cut_stations),
        cut_angles[owners],
        2.0 * head.reach * np.abs(cots[owners]) <= SAME_LINE,
        made[::-1],
    )


def _sweep(head: Head, angle: float, cot: float) -> _Sweep:
    half, blade = head.reach * abs(cot), angle - math.pi / 2.0
    if 2.0 * half <= SAME_LINE:
        return _Sweep(cot, 0.0, EITHER, blade)
    return _Sweep(cot, half, RIGHT if cot > 0.0 else LEFT, blade)


def _following(head: Head, states: Sequence[_State], course: _Course, before: _Sweep, end: float, roll: _Roll) -> _Lie:
    """A course after the one that ends at station `end` with the cut `before`, on the same roll."""
    apart = abs(before.cot - course.lead.cot)
    one_line = 2.0 * head.reach * apart <= SAME_LINE
    if one_line and end + course.fed <= roll.limit:
        reached = _swept(states, end + course.length, course.trail, roll)
        if reached:
            return _Lie(end, True, 0.0, reached)
    formula = head.tape_width / 2.0 * apart + head.scrap_margin
    station = max(end + formula, _lowest(states, course, roll))
    # Cuts at one angle need no waste of their own: all of it is the knives'.
    return _Lie(station, False, 0.0 if one_line else formula, _cut(states, station, course, roll))


def _leading(head: Head, states: Sequence[_State], course: _Course, roll: _Roll) -> _Lie:
    """A roll's first course: the roll's leading edge is a square cut that it does not share."""
    formula = head.tape_width / 2.0 * abs(course.lead.cot) + head.scrap_margin
    station = max(roll.floor + formula, _lowest(states, course, roll))
    return _Lie(station, False, formula, _cut(states, station, course, roll))


def _cut(states: Sequence[_State], station: float, course: _Course, roll: _Roll) -> Sequence[_State]:
    """States after both sweeps of a course at `station`."""
    if not station + course.fed <= roll.limit:
        return ()
    return _swept(_swept(states, station, course.lead, roll), station + course.length, course.trail, roll)


def _swept(states: Sequence[_State], station: float, sweep: _Sweep, roll: _Roll) -> Sequence[_State]:
    """States after a sweep over the line through `station`, by either knife that is free for it."""
    after = []
    for state in states:
        for knife in (0, 1):
            begin, free = station - sweep.half - roll.pitch * knife, state.free[knife]
            end = begin + 2.0 * sweep.half
            # By rounding, a knife can be free a hair after its sweep begins.
            if begin < max(free, roll.floor) - TOUCH or end > roll.limit:
                continue
            begin = max(begin, free, roll.floor)
            side, blade = state.sides[knife], state.blades[knife]
            start = sweep.start or side
            if math.isnan(blade):
                blade = sweep.blade
            crosses = start != side
            feed = begin - free if crosses or blade != sweep.blade else MOVE_FEED
            cost = (
                state.cost[0] + (feed <= LEAST_FEED),
                state.cost[1] + max(0.0, MOVE_FEED - feed),
                state.cost[2] + crosses,
                state.cost[3] + knife,
            )
            made = _Made(knife, begin, end, start, sweep.blade, free, side, blade, state.made)
            after.append(
                _State(
                    _with(state.free, knife, end),
                    _with(state.sides, knife, -start),
                    _with(state.blades, knife, sweep.blade),
                    cost,
                    made,
                )
            )
    return after


def _with(pair: tuple[T, T], knife: int, value: T) -> tuple[T, T]:
    return (value, pair[1]) if knife == 0 else (pair[0], value)


def _lowest(states: Sequence[_State], course: _Course, roll: _Roll) -> float:
    """Smallest station at which a course's leading and trailing sweep both find a free knife."""
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
    """The cheapest of the states that differ in nothing that sweeps from u = `past` on can tell."""
    cheapest: dict[tuple[object, ...], _State] = {}
    for state in states:
        known = tuple(
            (side, free, blade) if free > past else (side,)
            for side, free, blade in zip(state.sides, state.free, state.blades, strict=True)
        )
        if known not in cheapest or state.cost < cheapest[known].cost:
            cheapest[known] = state
    return list(cheapest.values())


def _longer_than_roll(head: Head, numbers: Sequence[int], courses: Sequence[_Course]) -> CourseLongerThanRoll:
    """Every course that a new roll cannot feed up to its last point and its last cut."""
    endless = _Roll(0.0, math.inf, head.knife_pitch)
    refused, sentences = [], []
    for number, course in zip(numbers, courses, strict=True):
        lie = _leading(head, [_AT_FIRST], course, endless)
        cut = min(max(state.free) for state in lie.states)
        needed = max(cut, lie.station + course.fed) + head.knife_pitch
        if not needed <= head.roll_length:
            refused.append(number)
            sentences.append(
                f"course {number}: {course.length * 1e3:.3f} mm long, it needs {needed:.3f} m of tape with the waste "
                f"before it and what lies between knives and nip, but a roll holds {head.roll_length:g} m; split it"
            )
    return CourseLongerThanRoll(refused, sentences)


def _work(head: Head, placed: _Placed) -> tuple[Cuts, Moves]:
    """The cuts with the sweeps that make them, and the raised moves between the sweeps."""
    count = len(placed.made)
    ending, starting = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    starting[placed.course_cuts[:, 0]] = np.arange(len(placed.stations))
    ending[placed.course_cuts[:, 1]] = np.arange(len(placed.stations))
    side = np.array([made.start for made in placed.made])
    cuts = Cuts(
        stations=placed.cut_stations,
        angles=placed.cut_angles,
        square=placed.square,
        ending=ending,
        starting=starting,
        knives=np.array([made.knife + 1 for made in placed.made]),
        u=np.array([(made.begin, made.end) for made in placed.made]),
        slides=head.reach * np.column_stack([side, -side]),
        blades=np.array([made.blade for made in placed.made]),
    )
    moved = [
        cut for cut, made in enumerate(placed.made) if (made.left_side, made.left_blade) != (made.start, made.blade)
    ]
    left = np.array([(made.left_u, made.left_side, made.left_blade) for made in placed.made])[moved]
    begin = cuts.u[moved, 0]
    waits = begin - left[:, 0] <= LEAST_FEED
    moves = Moves(
        knives=cuts.knives[moved],
        cuts=np.array(moved, dtype=np.int64),
        u=np.column_stack([np.where(waits, begin, np.maximum(left[:, 0], begin - MOVE_FEED)), begin]),
        slides=np.column_stack([head.reach * left[:, 1], cuts.slides[moved, 0]]),
        blades=np.column_stack([left[:, 2], cuts.blades[moved]]),
    )
    return cuts, moves


class _Node(NamedTuple):
    """A knife (0 or 1) at a place of its way: u, slide and blade there, and how it got there."""

    u: float
    kind: Step
    slide: float
    blade: float


def _nodes(head: Head, cuts: Cuts, moves: Moves, knife: int, turns_at_rest: bool) -> list[_Node]:
    """A knife's way through the ply, in order; a blade that turns at rest does so at the end of its slide's move."""
    own = np.flatnonzero(cuts.knives == knife + 1)
    move_to = dict(zip(moves.cuts.tolist(), range(len(moves)), strict=True))
    side, blade = (LEFT, RIGHT)[knife] * head.reach, float(cuts.blades[own[0]]) if len(own) else 0.0
    nodes = [_Node(0.0, Step.FEED, side, blade)]
    for cut in own.tolist():
        move = move_to.get(cut)
        (begin, end), (start, stop), blade = cuts.u[cut], cuts.slides[cut], float(cuts.blades[cut])
        if move is not None:
            moved_from = float(moves.slides[move, 0]), float(moves.blades[move, 0])
            nodes.append(_Node(float(moves.u[move, 0]), Step.FEED, *moved_from))
            waits = moves.u[move, 0] == moves.u[move, 1]
            way = Step.MOVE if waits else Step.FEED
            if turns_at_rest and blade != moved_from[1]:
                nodes.append(_Node(begin, way, start, moved_from[1]))
                way = Step.MOVE
            nodes.append(_Node(begin, way, start, blade))
        nodes.append(_Node(begin, Step.DOWN, start, blade))
        nodes.append(_Node(end, Step.CUT if cuts.square[cut] else Step.FEED, stop, blade))
        nodes.append(_Node(end, Step.UP, stop, blade))
    return nodes


def _steps(head: Head, cuts: Cuts, moves: Moves, turning_at_rest: frozenset[int]) -> Steps:
    """Both knives' ways as one, in order of u."""
    ways = [_nodes(head, cuts, moves, knife, knife + 1 in turning_at_rest) for knife in (0, 1)]
    nodes = [node for way in ways for node in way]
    exact = np.array([node.u for node in nodes])
    order = np.argsort(exact, kind="stable")
    parted = np.diff(exact[order], prepend=-math.inf) > TOUCH
    places = exact[order][parted]
    count = len(places)
    place = np.empty(len(exact), dtype=np.int64)
    place[order] = np.cumsum(parted) - 1
    kind = np.array([node.kind for node in nodes], dtype=np.uint8)
    knife = np.repeat([1, 2], [len(way) for way in ways])

    # First how the knives stand on arrival at every place, then what is done there.
    poses = np.empty((count, 4))
    for column, number in ((0, 1), (2, 2)):
        own = knife == number
        way = np.array([(node.slide, node.blade) for node in ways[number - 1]])
        poses[:, column : column + 2] = _on_arrival(places, place[own], way)
    acts = np.flatnonzero(kind != Step.FEED)
    # A knife that has come to its sweep's end goes up before anything else is done there.
    later = ~((kind[acts] == Step.UP) & (kind[acts - 1] == Step.FEED))
    rank = np.concatenate([np.full(count, -1), later])
    order = np.lexsort([np.concatenate([np.zeros(count), acts]), rank, np.concatenate([np.arange(count), place[acts]])])
    kinds = np.concatenate([np.zeros(count, dtype=np.uint8), kind[acts]])[order]
    knives = np.concatenate([np.zeros(count, dtype=np.int64), knife[acts]])[order]
    acted = np.array([(node.slide, node.blade) * 2 for node in nodes])[acts]
    poses = np.vstack([poses, acted])[order]
    for column, number in ((0, 1), (2, 2)):
        stated = np.where((knives == 0) | (knives == number), np.arange(len(knives)), 0)
        poses[:, column : column + 2] = poses[np.maximum.accumulate(stated), column : column + 2]
    lowered = np.cumsum(kinds == Step.DOWN) - np.cumsum(kinds == Step.UP)
    return Steps(
        u=np.concatenate([places, places[place[acts]]])[order],
        kinds=kinds,
        knives=knives,
        poses=poses,
        raised=np.concatenate([[0], np.flatnonzero(lowered == 0) + 1]),
    )


def _on_arrival(places: Floats, at: Ints, way: Floats) -> Floats:
    """Slide and blade (p, 2) on arrival at (p,) places, of a knife with the poses `way` (n, 2) at places[at]."""
    index = np.arange(len(places))
    following = np.minimum(np.searchsorted(at, index), len(at) - 1)
    last = np.maximum(following - 1, 0)
    span = places[at[following]] - places[at[last]]
    share = np.clip((places - places[at[last]]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)[:, None]
    poses: Floats = np.where(
        (at[following] <= index)[:, None], way[following], way[last] + share * (way[following] - way[last])
    )
    return poses


class _Passes(NamedTuple):
    changing: Ints
    threading: Ints
    laying: Ints
    threaded: Floats
    taken_back: Floats


def _passes(steps: Steps, begins: Floats, ends: Floats, rolls: Ints, roll_u: Floats) -> _Passes:
    """Rows done before a roll change, while threading and while laying, and how far the tape goes out and back."""
    count = len(begins)
    changing, threading, laying = (np.zeros((count, 2), dtype=np.int64) for _ in range(3))
    threaded, taken_back = np.array(begins), np.zeros(count)
    done, u, roll = 1, 0.0, 0
    for k in range(count):
        first = done
        if rolls[k] != roll:
            roll = int(rolls[k])
            u = float(roll_u[roll])
            done = max(done, steps.settled(steps.before(u)))
        changing[k] = first, done
        first = done
        if begins[k] < u - TOUCH:
            done = steps.settled(done)
            threaded[k] = max(u, float(steps.u[done - 1])) if done > first else u
            taken_back[k] = threaded[k] - begins[k]
        else:
            done = max(done, steps.through(float(begins[k])))
        threading[k] = first, done
        first = done
        u = float(ends[k])
        done = max(done, steps.before(u))
        laying[k] = first, done
    return _Passes(changing, threading, laying, threaded, taken_back)
