"""Link check: the head's motion between courses, and its heater and auxiliary roller, against what the courses need.

The head links to each course over the part, plunges, lays, runs out and retracts; heater and auxiliary roller switch at
their places along the course.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.laying.laid import Case
from tapelayer.machines import gantry
from tapelayer.motion.trajectory import Event, Kind
from tapelayer.units import MM
from tapelayer.verification.axis_use import FEED_DIGITS
from tapelayer.verification.failures import Failure

# Tolerance in seconds for switching the heater.
HEATER_TIME = 1e-3
# Two moments this close together, in seconds, may be one, because all times before them are rounded.
CLOCK_DOUBT = 1e-3
# A straight move this close to its end, in metres, has reached it; blocks are written to a micrometre in each axis.
REACHED = 5e-6
# Fractions of a link's block at which it is sampled.
SAMPLED_AT = np.linspace(0.0, 1.0, 9)


def judge_sequence(case: Case) -> tuple[float, list[Failure]]:
    """Return the roller's least clearance over the part while linking, in metres, and the failures.

    Args:
        case: with at least one course.
    """
    judge = _SequenceJudge(case)
    judge.heater()
    for gap in judge.gaps():
        up, down = 0, len(gap.rows)
        if gap.behind >= 0:
            judge.auxiliary_roller(gap)
            up = judge.retract(gap, judge.run_out(gap))
        if gap.behind + 1 < len(case.courses):
            down = judge.plunge(gap)
        judge.link(gap, up, max(up, down))
        judge.threading(gap)
    return judge.least_clearance, judge.failures


@dataclass(frozen=True, eq=False)
class _Gap:
    """The blocks before, between or after the layings.

    Attributes:
        behind: index of the course before the gap, -1 for none.
        first: the first block; in the first gap, the first whose start is stated.
        rows: (m,) the blocks.
        times: (m + 1,) seconds at the gap's start and its blocks' ends.
        steps: (m, k) changes of the joints in each block, metres and radians.
        centres: (m + 1, 3) roller centres at the gap's start and its blocks' ends, `machine` axes, metres.
        normals: (m + 1, 3) head normals there.
        moves: (m,) True where the head moves.
        turns: (m,) True where the head turns.
        lowest: (m, 9) the roller's lowest point above the highest course point, metres, at samples of each block.
        top: (m, 9) True where the head is at the upper end of its travel.
    """

    behind: int
    first: int
    rows: Ints
    times: Floats
    steps: Floats
    centres: Floats
    normals: Floats
    moves: Mask
    turns: Mask
    lowest: Floats
    top: Mask

    def block(self, place: int) -> int:
        """Return the block at a place of the gap; a place beyond the gap gives a block next to it."""
        return int(self.first + place)


class _SequenceJudge:
    """Judge of the links of a case, which collects its failures."""

    def __init__(self, case: Case) -> None:
        self.trajectory, self.courses, self.samples = case.trajectory, case.courses, case.samples
        self.machine, self.digits, self.highest = case.machine, case.digits, case.highest
        setup, trajectory = case.setup, case.trajectory
        head, process, limits = setup.head, setup.process, setup.verification
        self.delays, self.heater_stop = head.delays_ms, head.heater_stop_s
        self.roller_words = {
            event: self._words(event, self.delays.roller) for event in (Event.ROLLER_DOWN, Event.ROLLER_UP)
        }
        self.sampled = trajectory.progress(case.samples.times)
        self.lag = head.aux_roller_lag_mm * MM
        self.run_out_length = self.lag if head.run_out == "tangent" else 0.0
        self.approach = process.approach_mm * MM
        wanted = process.approach_mm if process.link_clearance_mm is None else process.link_clearance_mm
        self.clearance = wanted * MM
        self.lay_speed, self.thread_speed = process.lay_speed_mm_per_s * MM, process.thread_speed_mm_per_s * MM
        self.roller_radius, self.half_width = gantry.lengths(case.machine).radius, setup.tape.width_mm / 2 * MM
        self.off, self.tape_off = limits.max_position_error_mm * MM, limits.max_tape_error_mm * MM
        self.pose = [trajectory.column(name) for name in "xyzca"]
        self.sideways = [trajectory.column(name) for name in "xyca"]
        self.u, self.z = trajectory.column("u"), trajectory.column("z")
        self.least_clearance = np.inf
        self.failures: list[Failure] = []

    def fail(self, course: int, what: str, value: float, limit: float, block: int) -> None:
        """Record a failure of a course, by its index, and the block where it occurs."""
        line = int(self.trajectory.lines[min(block, len(self.trajectory) - 1)])
        self.failures.append(Failure(self.courses[course].number, 0, what, float(value), float(limit), line))

    def heater(self) -> None:
        """Judge whether the heater is on from each course's start to its end, except during long stops."""
        begins, ends, sure = self._rests()
        allowed = ends - begins > self.heater_stop - HEATER_TIME
        needed = sure & (ends - begins > self.heater_stop + HEATER_TIME)
        for event, name, courses, rests in (
            (Event.HEATER_ON, "heater_on", [course.begin for course in self.courses], ends),
            (Event.HEATER_OFF, "heater_off", [course.end for course in self.courses], begins),
        ):
            words, effects = self._words(event, self.delays.heater)
            apart = _apart(effects, np.append(courses, rests[allowed]))
            for word in np.flatnonzero(~(apart <= HEATER_TIME)).tolist():
                course = self._course(effects[word])
                self.fail(course, f"{name}_astray_ms", apart[word] * 1e3, HEATER_TIME * 1e3, int(words[word]))
            places = np.append(courses, rests[needed])
            for place in places[~(_apart(places, effects) <= HEATER_TIME)].tolist():
                block = int(np.searchsorted(self.trajectory.times, place, side="right"))
                self.fail(self._course(place), f"{name}_words", 0, 1, block)

    def _words(self, event: Event, delay: float) -> tuple[Ints, Floats]:
        """Return the blocks (w,) of an event's words, and the seconds (w,) of their effects, `delay` ms later."""
        words = np.flatnonzero(self.trajectory.events == event)
        return words, self.trajectory.times[words] + delay * 1e-3

    def _course(self, time: float) -> int:
        """Return the index of the course being laid at a time, else of the next one, else of the last."""
        ends = [course.end for course in self.courses]
        return min(int(np.searchsorted(ends, time)), len(ends) - 1)

    def _rests(self) -> tuple[Floats, Floats, Mask]:
        """Return the seconds (r,) at which the tape stops and moves on within courses, and whether each rest is sure.

        Creeping tape can seem to rest because its words are rounded: a rest next to creeping is not sure.
        """
        trajectory, rests = self.trajectory, [np.zeros((3, 0))]
        for course in self.courses:
            first, last = np.searchsorted(trajectory.times, [course.begin, course.end], side="right")
            rows = np.arange(first, min(last + 1, len(trajectory)))
            fed = np.abs(trajectory.positions[rows, self.u] - trajectory.begins(rows)[:, self.u])
            creeps = (fed > 0.0) & (fed * HEATER_TIME < self.digits[self.u] * trajectory.durations[rows])
            creeps = np.concatenate([[False], creeps, [False]])
            edges = np.flatnonzero(np.diff(np.concatenate([[0], (fed == 0.0).astype(np.int8), [0]]))).reshape(-1, 2).T
            borders = np.minimum(np.append(course.begin, trajectory.times[rows]), course.end)
            rests.append(np.vstack([borders[edges], ~(creeps[edges[0]] | creeps[edges[1] + 1])]))
        begins, ends, sure = np.hstack(rests)
        return begins, ends, sure > 0.0

    def gaps(self) -> Iterable[_Gap]:
        """Yield the gaps before, between and after the layings."""
        trajectory, slack = self.trajectory, CLOCK_DOUBT if self.delays.shoe else 0.0
        # The first move that states every axis has no known start.
        known = int(np.argmin(np.any(np.isnan(trajectory.positions), axis=1))) + 1
        ends, begins = [course.end + slack for course in self.courses], [c.begin + slack for c in self.courses]
        firsts = np.append(known, np.searchsorted(trajectory.times, ends, side="right"))
        lasts = np.append(np.searchsorted(trajectory.times, begins, side="right"), len(trajectory))
        nodes = [
            np.arange(first - 1, max(first, last)) for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True)
        ]
        # Forward kinematics run once for all gaps: a call costs more than the few samples of a gap.
        borders = np.cumsum([len(places) for places in nodes])[:-1]
        pose = self.machine.columns(trajectory.positions[np.concatenate(nodes)], "roller")
        centres = np.split(np.stack(np.broadcast_arrays(*pose.translation), axis=1), borders)
        normals = np.split(np.stack(np.broadcast_arrays(*(row[2] for row in pose.rotation)), axis=1), borders)
        rows = np.concatenate([places[1:] for places in nodes])
        borders = np.cumsum([len(places) - 1 for places in nodes])[:-1]
        above, at_top = self._lowest(rows)
        lowest, top = np.split(above, borders), np.split(at_top, borders)
        for gap, places in enumerate(nodes):
            steps = np.diff(trajectory.positions[places], axis=0)
            yield _Gap(
                behind=gap - 1,
                first=int(firsts[gap]),
                rows=places[1:],
                times=trajectory.times[places],
                steps=steps,
                centres=centres[gap],
                normals=normals[gap],
                moves=np.any(steps[:, self.pose] != 0.0, axis=1),
                turns=np.any(steps[:, self.pose[3:]] != 0.0, axis=1),
                lowest=lowest[gap],
                top=top[gap],
            )

    def _lowest(self, rows: Ints) -> tuple[Floats, Mask]:
        """Return, at samples (m, 9) of blocks (m,), metres above the part and True at the upper end of the travel."""
        blocks, shares = np.repeat(rows, len(SAMPLED_AT)), np.tile(SAMPLED_AT, len(rows))
        joints = self.trajectory.within(blocks, shares)
        pose = self.machine.columns(joints, "roller")
        edge = self.half_width * np.abs(pose.rotation[2][1])
        lowest = np.broadcast_to(pose.translation[2] - self.roller_radius - edge - self.highest, len(joints))
        top = joints[:, self.z] <= self.machine.axes[self.z].lower + self.digits[self.z]
        return lowest.reshape(-1, len(SAMPLED_AT)), top.reshape(-1, len(SAMPLED_AT))

    def auxiliary_roller(self, gap: _Gap) -> None:
        """Judge whether the auxiliary roller goes down and up one lag after the course's start and end."""
        laid = self.courses[gap.behind]
        first, last = np.searchsorted(self.samples.courses, [gap.behind, gap.behind + 1])
        # Distance of the roller over time: along the course, then beyond its end.
        beyond = np.linalg.norm(gap.centres - gap.centres[0], axis=1)
        times = np.append(self.sampled[first:last], self.trajectory.progress(gap.times))
        path = np.append(self.samples.arc_lengths[first:last], self.samples.arc_lengths[last - 1] + beyond)
        following = self.courses[gap.behind + 1].begin if gap.behind + 1 < len(self.courses) else np.inf
        for event, name, place in (
            (Event.ROLLER_DOWN, "down", min(self.lag, laid.length + self.run_out_length)),
            (Event.ROLLER_UP, "up", laid.length + self.run_out_length),
        ):
            words, effects = self.roller_words[event]
            own = np.flatnonzero((effects > laid.begin - CLOCK_DOUBT) & (effects < following - CLOCK_DOUBT))
            if len(own) != 1:
                block = int(words[own[-1]]) if len(own) else gap.first
                self.fail(gap.behind, f"auxiliary_roller_{name}_words", len(own), 1, block)
                continue
            at = float(np.interp(self.trajectory.progress(effects[own[:1]]), times, path)[0])
            if not abs(at - place) <= self.tape_off:
                self.fail(gap.behind, f"auxiliary_roller_{name}_mm", at / MM, place / MM, int(words[own[0]]))

    def run_out(self, gap: _Gap) -> int:
        """Judge whether the head runs out along the tangent, and return the number of the gap's blocks that do so."""
        out = self.courses[gap.behind].out
        gone, count = self._straight(gap, gap.behind, range(len(gap.rows)), out, self.run_out_length)
        if not abs(gone - self.run_out_length) <= self.tape_off:
            self.fail(gap.behind, "run_out_mm", gone / MM, self.run_out_length / MM, gap.block(count))
        return count

    def retract(self, gap: _Gap, first: int) -> int:
        """Judge whether the head retracts along its normal from place `first` on, and return the place where it has."""
        places = range(first, len(gap.rows))
        gone, count = self._straight(gap, gap.behind, places, gap.normals[first], self.approach)
        if not gone >= self.approach - self.off:
            # The block that ends the retract too soon; where none begins it, the one that does something else.
            block = gap.block(first + count - (gone > 0.0))
            self.fail(gap.behind, "retract_mm", gone / MM, self.approach / MM, block)
        return first + count

    def plunge(self, gap: _Gap) -> int:
        """Judge whether the gap ends with a plunge along the normal, and return the number of blocks before it."""
        last, course = len(gap.rows), gap.behind + 1
        gone, count = self._straight(gap, course, range(last - 1, -1, -1), -gap.normals[last], self.approach)
        if not gone >= self.approach - self.off:
            self.fail(course, "plunge_mm", gone / MM, self.approach / MM, gap.block(last - 1 - count))
        return last - count

    def _straight(self, gap: _Gap, course: int, places: range, direction: Floats, length: float) -> tuple[float, int]:
        """Return how far the head moves by feed along a direction without turning, up to about `length`.

        Args:
            gap: the gap.
            course: index of the course that fails if the head is too fast.
            places: places of the gap's blocks, in the order of the search.
            direction: (3,) unit, `machine` axes.
            length: metres.

        Returns:
            Metres, and the number of blocks.
        """
        gone, count = 0.0, 0
        for place in places:
            if gone >= length - REACHED:
                break
            if gap.moves[place]:
                block = int(gap.rows[place])
                step = gap.centres[place + 1] - gap.centres[place]
                along = float(step @ direction)
                straight = along > 0.0 and float(np.linalg.norm(step - along * direction)) <= self.off
                if not straight or gap.turns[place] or self.trajectory.kinds[block] != Kind.LINEAR:
                    break
                least = (along - 2 * float(np.max(self.digits[self.pose[:3]]))) / (self.lay_speed * (1 + FEED_DIGITS))
                if not self.trajectory.requested[block] >= least:
                    speed = along / self.trajectory.requested[block]
                    self.fail(course, "approach_speed_mm_per_s", speed / MM, self.lay_speed / MM, block)
                gone += along
            count += 1
        return gone, count

    def link(self, gap: _Gap, first: int, last: int) -> None:
        """Judge whether from place `first` to `last` of a gap the head turns and moves sideways only above the part."""
        over = np.flatnonzero(np.any(gap.steps[first:last][:, self.sideways] != 0.0, axis=1)) + first
        blocks = np.repeat(gap.rows[over], len(SAMPLED_AT))
        lowest, top = gap.lowest[over].ravel(), gap.top[over].ravel()
        if len(over):
            self.least_clearance = min(self.least_clearance, float(np.min(lowest)))
        if gap.behind < 0 and len(gap.rows):
            # The first move that states every axis must end above the part.
            blocks = np.append(blocks, gap.rows[0] - 1)
            lowest, top = np.append(lowest, gap.lowest[0, 0]), np.append(top, gap.top[0, 0])
        if not len(blocks):
            return
        # At the upper end of its travel the head can go no higher.
        wanted = np.where(top, 0.0, self.clearance)
        worst = int(np.argmax(wanted - lowest))
        if not lowest[worst] >= wanted[worst] - REACHED:
            course = min(gap.behind + 1, len(self.courses) - 1)
            self.fail(course, "link_clearance_mm", lowest[worst] / MM, wanted[worst] / MM, int(blocks[worst]))

    def threading(self, gap: _Gap) -> None:
        """Judge whether in a gap tape and knives move by feed, and the tape no faster than the threading speed."""
        course = min(gap.behind + 1, len(self.courses) - 1)
        head = gap.steps.copy()
        head[:, self.pose] = 0.0
        rapid = np.any(head != 0.0, axis=1) & (self.trajectory.kinds[gap.rows] == Kind.RAPID)
        if np.any(rapid):
            self.fail(course, "head_moves_in_rapids", np.sum(rapid), 0, gap.block(int(np.argmax(rapid))))
        fed, limit = np.abs(gap.steps[:, self.u]) - self.digits[self.u], self.thread_speed * (1 + FEED_DIGITS)
        quick = np.flatnonzero(~(fed <= limit * self.trajectory.requested[gap.rows]) & ~rapid)
        if len(quick):
            block = gap.block(int(quick[0]))
            speed = fed[quick[0]] / self.trajectory.requested[block]
            self.fail(course, "thread_speed_mm_per_s", speed / MM, self.thread_speed / MM, block)


def _apart(values: Floats, places: Floats) -> Floats:
    """Return the distance (n,) of values (n,) from the nearest place; infinite without places."""
    ordered = np.concatenate([[-np.inf], np.sort(places), [np.inf]])
    after = np.searchsorted(ordered[1:-1], values) + 1
    distances: Floats = np.minimum(ordered[after] - values, values - ordered[after - 1])
    return distances
