"""Tape plan: the stations of the courses on the tape and the steps of the knives, in lengths, never in seconds.

A station is a length along the tape from its first leading edge towards the supply roll, u the station at knife 1;
knife 2 stands `knife_pitch` upstream, at station u + `knife_pitch`. Across the tape, left of travel is positive.
A cut at angle alpha is the line sigma(w) = sigma_0 + w cot(alpha), and while the tape feeds by du the knife crosses
by du tan(alpha): the knives' positions are piecewise linear functions of u, with the tape at rest where they jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.laying.cut_assignment import LEAST_FEED, LEFT, MOVE_FEED, RIGHT, TOUCH, Assignment, assign_stations
from tapelayer.laying.head import Head


class Step(IntEnum):
    """Kind of a step of the head.

    FEED: the tape feeds up to the step's u, and slides and blades move in proportion. MOVE: the tape rests while a
    raised knife goes to its next sweep's start. CUT: the tape rests while a lowered knife crosses it. DOWN, UP: the
    tape rests while a knife goes down or up.
    """

    FEED = 0
    MOVE = 1
    CUT = 2
    DOWN = 3
    UP = 4


@dataclass(frozen=True, eq=False)
class Cuts(Frozen):
    """Cuts in the order of their stations, one row each; a shared cut is one row.

    Attributes:
        stations: (c,) metres, where the line meets the centre line.
        angles: (c,) radians from travel towards the left, in (0, pi).
        square: (c,) True where the tape rests during the sweep.
        ending: (c,) index of the course whose end the cut is, -1 for none.
        starting: (c,) index of the course whose start the cut is, -1 for none.
        knives: (c,) the knife that makes the cut, 1 or 2.
        u: (c, 2) metres, u at the sweep's start and end.
        slides: (c, 2) metres, the slide (v or q) at the sweep's start and end.
        blades: (c,) radians, the blade (d or e) during the sweep.
        speeds: (c,) m/s of the tape at which the sweep is made in passing, 0 where the tape stops for its ends.
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
    speeds: Floats

    def __len__(self) -> int:
        """Return the number of cuts."""
        return len(self.stations)


@dataclass(frozen=True, eq=False)
class Moves(Frozen):
    """Moves of raised knives from the end of one sweep to the start of the next, in the order of the cuts.

    Attributes:
        knives: (r,) 1 or 2.
        cuts: (r,) index of the cut that the knife goes to.
        u: (r, 2) metres, u at the move's start and end; equal if the tape waits for it.
        slides: (r, 2) metres, the slide at both.
        blades: (r, 2) radians, the blade at both.
    """

    knives: Ints
    cuts: Ints
    u: Floats
    slides: Floats
    blades: Floats

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.knives)


@dataclass(frozen=True, eq=False)
class KnifeSteps(Frozen):
    """Steps of the head in order of u, each done once, the first time the tape gets there.

    Row 0 is the state of the head at u = 0. The first row at every u is a FEED, so everything is linear between rows.

    Attributes:
        u: (s,) metres, not decreasing.
        kinds: (s,) `Step` of each row.
        knives: (s,) the knife that moves or switches, 0 for a FEED.
        poses: (s, 4) v, d, q, e after the row, in metres and radians.
        speeds: (s,) m/s of the tape at which the sweep that the row begins or ends is made in passing; 0 for none.
        raised: (k,) increasing numbers of rows after which no knife is down; the first is 0, the last is s.
    """

    u: Floats
    kinds: NDArray[np.uint8]
    knives: Ints
    poses: Floats
    speeds: Floats
    raised: Ints

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.u)

    def before(self, u: float) -> int:
        """Return the number of rows done when the tape has only just reached `u` (metres)."""
        return int(np.searchsorted(self.u, u - TOUCH, side="left"))

    def through(self, u: float) -> int:
        """Return the number of rows done when everything at `u` (metres) is done."""
        return int(np.searchsorted(self.u, u + TOUCH, side="right"))

    def settled(self, done: int) -> int:
        """Return the least number of rows, at least `done`, after which all sweeps in progress are finished."""
        return int(self.raised[np.searchsorted(self.raised, done)])

    def rests(self, first: int, last: int) -> int:
        """Return the number of places where the rows from `first` to before `last` make the tape wait."""
        kinds = self.kinds[first:last]
        return len(np.unique(self.u[first:last][(kinds == Step.MOVE) | (kinds == Step.CUT)]))

    def at(self, u: Floats, done: Ints) -> Floats:
        """Return slides and blades (n, 4) at `u` with the first `done` rows done; taking tape back does not move them.

        Args:
            u: (n,) metres.
            done: (n,) number of rows done, from 1.
        """
        last, following = done - 1, np.minimum(done, len(self) - 1)
        span = self.u[following] - self.u[last]
        share = np.clip((u - self.u[last]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
        # A step at rest is atomic: the knives stand still until it is done.
        share = np.where(span > 0.0, share, 0.0)[:, None]
        poses: Floats = self.poses[last] + share * (self.poses[following] - self.poses[last])
        return poses


@dataclass(frozen=True, eq=False)
class TapePlan(Frozen):
    """A ply on the tape: the stations of its courses, the waste before each, and the cuts by knife and u.

    For each course the head does the rows `changing` (only before a new roll: feed to the roll's u, change it), does
    the rows `threading`, feeds back or on to u = `begins`, lowers the shoe, does the rows `laying` up to u = `ends` and
    raises the shoe. Rows after those of the last course are done with the head in the air.

    Attributes:
        head: the dimensions it was made for.
        lengths: (n,) metres, laid length of each course.
        stations: (n,) metres, station of each course's start.
        rolls: (n,) number of each course's roll, from 0.
        roll_u: (m,) metres, u at which each roll's leading edge stands at knife 1.
        waste_roll: (n,) metres wasted before the course between knife and nip, for a roll change.
        waste_formula: (n,) metres wasted before the course for the angles and the scrap margin.
        waste_knives: (n,) metres wasted before the course until a knife is free for every sweep.
        course_cuts: (n, 2) index of the cut at each course's start and end.
        cuts: the cuts.
        moves: the raised moves between them.
        steps: cuts and moves in order of u.
        begins: (n,) metres, u with each course's first point under the nip.
        ends: (n,) metres, u with each course's last point under the nip.
        changing: (n, 2) first row and row after the last of those done before the roll is changed for the course.
        threading: (n, 2) the same for rows done while the course's tape is fed to the nip, before the shoe is down.
        laying: (n, 2) the same for rows done while the course is laid.
        threaded: (n,) metres, highest u of the threading; beyond `begins` if a sweep has to be finished first.
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
    steps: KnifeSteps
    begins: Floats
    ends: Floats
    changing: Ints
    threading: Ints
    laying: Ints
    threaded: Floats
    taken_back: Floats

    def __len__(self) -> int:
        """Return the number of courses."""
        return len(self.stations)

    @property
    def waste(self) -> Floats:
        """Return the tape (n,) in metres that is wasted before each course."""
        return self.waste_roll + self.waste_formula + self.waste_knives

    @property
    def used(self) -> float:
        """Return the tape from the first leading edge to the last course's end, laid or wasted, in metres."""
        return float(self.stations[-1] + self.lengths[-1])

    @property
    def waste_percent(self) -> float:
        """Return the wasted part of the tape used, in percent."""
        return 100.0 * float(np.sum(self.waste)) / self.used

    @property
    def laying_stops(self) -> Ints:
        """Return the number (n,) of places where the tape waits while each course is laid."""
        return np.array([self.steps.rests(first, last) for first, last in self.laying], dtype=np.int64)


def plan_tape(
    head: Head,
    numbers: Sequence[int],
    lengths: Floats,
    cut_angles: Floats,
    wraps: Floats,
    turning_at_rest: frozenset[int] = frozenset(),
) -> TapePlan:
    """Put the courses of a ply on the tape and assign their cuts to the two knives.

    A trailing cut and the next leading cut at the same angle are one cut if a knife is free for the next sweep.
    Otherwise each course starts at the smallest station, not below the formula's, at which a knife is free for both its
    sweeps. Of all assignments that reach these stations, the one with the fewest waits is chosen, then the one with the
    most feed for raised moves, then the one with the fewest crossings. A roll's leading edge counts as a square cut
    that is never shared, and no sweep on the roll begins before the edge is at knife 1.

    Args:
        head: the head's dimensions.
        numbers: the n courses' numbers in their file, for messages.
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
    assignment = assign_stations(head, numbers, lengths, cut_angles, wraps)
    cuts, moves = _work(assignment)
    steps = _steps(head, cuts, moves, turning_at_rest)
    begins = assignment.stations + head.knife_to_nip - wraps[:, 0]
    ends = assignment.stations + lengths + head.knife_to_nip - wraps[:, 1]
    passes = _passes(steps, begins, ends, assignment.rolls, assignment.roll_u)
    return TapePlan(
        head=head,
        lengths=lengths,
        stations=assignment.stations,
        rolls=assignment.rolls,
        roll_u=assignment.roll_u,
        waste_roll=assignment.waste[:, 0],
        waste_formula=assignment.waste[:, 1],
        waste_knives=assignment.waste[:, 2],
        course_cuts=assignment.course_cuts,
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


def _work(assignment: Assignment) -> tuple[Cuts, Moves]:
    """Return the cuts with the sweeps that make them, and the raised moves between the sweeps."""
    count = len(assignment.made)
    ending, starting = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    starting[assignment.course_cuts[:, 0]] = np.arange(len(assignment.stations))
    ending[assignment.course_cuts[:, 1]] = np.arange(len(assignment.stations))
    side = np.array([made.start * made.reach for made in assignment.made])
    cuts = Cuts(
        stations=assignment.cut_stations,
        angles=assignment.cut_angles,
        square=assignment.square,
        ending=ending,
        starting=starting,
        knives=np.array([made.knife + 1 for made in assignment.made]),
        u=np.array([(made.begin, made.end) for made in assignment.made]),
        slides=np.column_stack([side, -side]),
        blades=np.array([made.blade for made in assignment.made]),
        speeds=np.array([made.speed for made in assignment.made]),
    )
    moved = [
        cut
        for cut, made in enumerate(assignment.made)
        if (made.left_side, made.left_reach, made.left_blade) != (made.start, made.reach, made.blade)
    ]
    left = np.array([(made.left_u, made.left_side * made.left_reach, made.left_blade) for made in assignment.made])[
        moved
    ]
    begin = cuts.u[moved, 0]
    waits = begin - left[:, 0] <= LEAST_FEED
    moves = Moves(
        knives=cuts.knives[moved],
        cuts=np.array(moved, dtype=np.int64),
        u=np.column_stack([np.where(waits, begin, np.maximum(left[:, 0], begin - MOVE_FEED)), begin]),
        slides=np.column_stack([left[:, 1], cuts.slides[moved, 0]]),
        blades=np.column_stack([left[:, 2], cuts.blades[moved]]),
    )
    return cuts, moves


class _Node(NamedTuple):
    """A node of a knife's path: u, slide and blade there, and the step that leads there."""

    u: float
    kind: Step
    slide: float
    blade: float
    speed: float = 0.0


def _nodes(head: Head, cuts: Cuts, moves: Moves, knife: int, turns_at_rest: bool) -> list[_Node]:
    """Return a knife's path through the ply, in order; a blade that turns at rest does so after its slide's move."""
    own = np.flatnonzero(cuts.knives == knife + 1)
    move_to = dict(zip(moves.cuts.tolist(), range(len(moves)), strict=True))
    side, blade = (LEFT, RIGHT)[knife] * head.half_sweep, 0.0
    if len(own):
        side, blade = (LEFT, RIGHT)[knife] * abs(float(cuts.slides[own[0], 0])), float(cuts.blades[own[0]])
    nodes = [_Node(0.0, Step.FEED, side, blade)]
    for cut in own.tolist():
        move = move_to.get(cut)
        (begin, end), (start, stop), blade = cuts.u[cut], cuts.slides[cut], float(cuts.blades[cut])
        if move is not None:
            moved_from = float(moves.slides[move, 0]), float(moves.blades[move, 0])
            nodes.append(_Node(float(moves.u[move, 0]), Step.FEED, *moved_from))
            waits = moves.u[move, 0] == moves.u[move, 1]
            step = Step.MOVE if waits else Step.FEED
            if turns_at_rest and blade != moved_from[1]:
                nodes.append(_Node(begin, step, start, moved_from[1]))
                step = Step.MOVE
            nodes.append(_Node(begin, step, start, blade))
        speed = float(cuts.speeds[cut])
        nodes.append(_Node(begin, Step.DOWN, start, blade, speed))
        nodes.append(_Node(end, Step.CUT if cuts.square[cut] else Step.FEED, stop, blade))
        nodes.append(_Node(end, Step.UP, stop, blade, speed))
    return nodes


def _steps(head: Head, cuts: Cuts, moves: Moves, turning_at_rest: frozenset[int]) -> KnifeSteps:
    """Return the paths of both knives merged, in order of u."""
    paths = [_nodes(head, cuts, moves, knife, knife + 1 in turning_at_rest) for knife in (0, 1)]
    nodes = [node for path in paths for node in path]
    exact = np.array([node.u for node in nodes])
    order = np.argsort(exact, kind="stable")
    parted = np.diff(exact[order], prepend=-math.inf) > TOUCH
    places = exact[order][parted]
    count = len(places)
    place = np.empty(len(exact), dtype=np.int64)
    place[order] = np.cumsum(parted) - 1
    kind = np.array([node.kind for node in nodes], dtype=np.uint8)
    knife = np.repeat([1, 2], [len(path) for path in paths])

    # First the poses of the knives on arrival at every place, then the steps done there.
    poses = np.empty((count, 4))
    for column, number in ((0, 1), (2, 2)):
        own = knife == number
        path = np.array([(node.slide, node.blade) for node in paths[number - 1]])
        poses[:, column : column + 2] = _on_arrival(places, place[own], path)
    acts = np.flatnonzero(kind != Step.FEED)
    # A knife at its sweep's end goes up before anything else is done there.
    later = ~((kind[acts] == Step.UP) & (kind[acts - 1] == Step.FEED))
    rank = np.concatenate([np.full(count, -1), later])
    order = np.lexsort([np.concatenate([np.zeros(count), acts]), rank, np.concatenate([np.arange(count), place[acts]])])
    kinds = np.concatenate([np.zeros(count, dtype=np.uint8), kind[acts]])[order]
    knives = np.concatenate([np.zeros(count, dtype=np.int64), knife[acts]])[order]
    acted = np.array([(node.slide, node.blade) * 2 for node in nodes])[acts]
    speeds = np.append(np.zeros(count), np.array([node.speed for node in nodes])[acts])[order]
    poses = np.vstack([poses, acted])[order]
    for column, number in ((0, 1), (2, 2)):
        stated = np.where((knives == 0) | (knives == number), np.arange(len(knives)), 0)
        poses[:, column : column + 2] = poses[np.maximum.accumulate(stated), column : column + 2]
    lowered = np.cumsum(kinds == Step.DOWN) - np.cumsum(kinds == Step.UP)
    return KnifeSteps(
        u=np.concatenate([places, places[place[acts]]])[order],
        kinds=kinds,
        knives=knives,
        poses=poses,
        speeds=speeds,
        raised=np.concatenate([[0], np.flatnonzero(lowered == 0) + 1]),
    )


def _on_arrival(places: Floats, at: Ints, poses: Floats) -> Floats:
    """Return slide and blade (p, 2) on arrival at places (p,), of a knife with `poses` (n, 2) at places[at]."""
    index = np.arange(len(places))
    following = np.minimum(np.searchsorted(at, index), len(at) - 1)
    last = np.maximum(following - 1, 0)
    span = places[at[following]] - places[at[last]]
    share = np.clip((places - places[at[last]]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)[:, None]
    arrived: Floats = np.where(
        (at[following] <= index)[:, None], poses[following], poses[last] + share * (poses[following] - poses[last])
    )
    return arrived


class _Passes(NamedTuple):
    changing: Ints
    threading: Ints
    laying: Ints
    threaded: Floats
    taken_back: Floats


def _passes(steps: KnifeSteps, begins: Floats, ends: Floats, rolls: Ints, roll_u: Floats) -> _Passes:
    """Return the rows done before a roll change, while threading and while laying, and how far the tape is threaded."""
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
