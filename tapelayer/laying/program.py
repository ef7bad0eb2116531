"""Laying: courses and a setup become the blocks of a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.courses.course import Course
from tapelayer.errors import AxisBeyondTravel, PartTooHigh, TapeRunsBack
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.laying.cut_assignment import TOUCH
from tapelayer.laying.head import head_of
from tapelayer.laying.linearisation import Poses, block_ends, course_motion, nearest_point
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_plan import Step, TapePlan, plan_tape
from tapelayer.machines import gantry
from tapelayer.machines.machine import Axis, Machine
from tapelayer.motion.stroke import Stroke, StrokeBlocks
from tapelayer.motion.time_law import Limits, at_speed, rapids
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.units import DEG, MM

KNIVES = ("v", "d", "q", "e")
# A move of more than this, in metres or radians, is one in the digits of every control.
WRITTEN_MOVE = 1e-4
KNIFE_WORDS = {
    (1, Step.DOWN): Event.KNIFE_1_DOWN,
    (1, Step.UP): Event.KNIFE_1_UP,
    (2, Step.DOWN): Event.KNIFE_2_DOWN,
    (2, Step.UP): Event.KNIFE_2_UP,
}


def plan(
    courses: Sequence[Course],
    setup: Setup,
    machine: Machine,
    alone: frozenset[str] = frozenset(),
    tick: Tick = silent,
) -> Trajectory:
    """Trajectory of a ply: every course approached, laid and left, its cuts made where they pass the knives.

    Args:
        courses: in the part's frame, laid in this order.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        alone: blade axes (d, e) that the control turns only in blocks of their own.
        tick: called for every course that is done.

    Raises:
        AxisBeyondTravel: a course needs an axis beyond its travel.
        PartTooHigh: the head cannot go from course to course over the part.
        PoseUndefined: a point has no roller pose.
        TapeRunsBack: the tape would have to run back under the shoe.
        TapelayerError: the tape cannot be cut that way; see `plan_tape`.
    """
    lengths = gantry.lengths(machine)
    radius = lengths.radius if setup.head.wrap_compensation else 0.0
    ways = []
    for path in courses_in_machine(courses, setup):
        ways.append(driven_course(path, setup, lengths, radius))
        tick()
    tape = plan_tape(
        head_of(setup, machine),
        [course.number for course in courses],
        np.array([way.laid.arc_lengths[-1] for way in ways]),
        np.array([course.cut_angles for course in courses]),
        radius * np.array([way.laid.wrap[[0, -1]] for way in ways]),
        frozenset(number for number, blade in ((1, "d"), (2, "e")) if blade in alone),
    )
    program = _Program(setup, machine, tape, _least_link(ways, setup, machine))
    for course, way in enumerate(ways):
        program.add_course(course, way)
    return program.trajectory(ways)


@dataclass(frozen=True, eq=False)
class DrivenCourse:
    """A course as the gantry goes along it: poses at its block ends and the direction in which it leaves.

    Attributes:
        path: in `machine` axes.
        laid: poses at the block ends.
        shortened: (n,) metres by which the tape path to the nip is shorter than on a level surface.
        out: (3,) unit tangent at the end, `machine` axes.
    """

    path: Toolpath
    laid: Poses
    shortened: Floats
    out: Floats


def driven_course(path: Toolpath, setup: Setup, lengths: gantry.Lengths, radius: float) -> DrivenCourse:
    """Return a course as the gantry goes along it.

    Args:
        path: in `machine` axes.
        setup: the job's values.
        lengths: of the head, metres.
        radius: of the roller that the tape is wrapped round, metres; 0 where the wrap is not compensated.

    Raises:
        PoseUndefined: a point has no roller pose.
        TapeRunsBack: the tape would have to run back under the shoe.
    """
    process = setup.process
    motion = course_motion(path, lengths, process.kinematics, radius)
    laid = block_ends(motion, process.tolerance_mm * MM, process.tolerance_deg * DEG)
    way = DrivenCourse(path, laid, radius * laid.wrap, motion.curve.at(laid.arc_lengths[-1:])[2][0])
    back = np.flatnonzero(~(np.diff(laid.arc_lengths - way.shortened) >= 0.0))
    if len(back):
        point = nearest_point(path, float(laid.arc_lengths[back[0]]))
        raise TapeRunsBack(
            f"course {path.number} point {point}: the tape would run back under the shoe, because the surface is "
            "hollow and tighter than the roller; set [head] wrap_compensation = false"
        )
    return way


class _Program:
    """Blocks of a program as they are added, course by course."""

    def __init__(self, setup: Setup, machine: Machine, tape: TapePlan, least_link: float) -> None:
        self.setup, self.machine, self.tape, self.least_link = setup, machine, tape, least_link
        clearance = setup.process.link_clearance_mm
        clearance = setup.process.approach_mm if clearance is None else clearance
        self.link_height = max(least_link - clearance * MM, machine.axis("z").lower)
        self.limits = Limits.of(machine.axes)
        self.columns = {axis.name: i for i, axis in enumerate(machine.axes)}
        self.pose = [self.columns[name] for name in gantry.POSE]
        self.knives = [self.columns[name] for name in KNIVES]
        self.lay_speed = setup.process.lay_speed_mm_per_s * MM
        self.thread_speed = setup.process.thread_speed_mm_per_s * MM
        self.lift = setup.process.approach_mm * MM
        self.every_axis = (1 << len(machine.axes)) - 1
        delays = setup.head.delays_ms
        self.shoe_delay, self.roller_delay = delays.shoe * 1e-3, delays.roller * 1e-3
        self.knife_delay, self.heater_delay = delays.knife * 1e-3, delays.heater * 1e-3
        self.at = np.zeros(len(machine.axes))
        self.at[self.knives] = tape.steps.poses[0]
        self.parts: list[tuple[StrokeBlocks, int, Sequence[int]]] = []

    def add_course(self, course: int, way: DrivenCourse) -> None:
        """Add the blocks of one course."""
        head, tape = self.setup.head, self.tape
        lag = head.aux_roller_lag_mm * MM
        run_out = lag if head.run_out == "tangent" else 0.0
        length = float(way.laid.arc_lengths[-1])
        joints = self._joints(course, way)
        approach = self._lifted(joints[0])
        approach[self.columns["u"]] = self.at[self.columns["u"]]
        approach[self.knives] = self.at[self.knives]
        stroke = self._linked(course, approach)
        if course == 0:
            stroke.switch(Event.SUPPLY_MODE, 0.0)
        changing, threading = tape.changing[course], tape.threading[course]
        if course and tape.rolls[course] != tape.rolls[course - 1]:
            self._feed(stroke, changing, float(tape.roll_u[tape.rolls[course]]))
            stroke.switch(Event.STOP, 0.0)
            # The control stops for as long as it takes: no word for what follows may stand before.
            self._add(stroke, course, 0, 0)
            stroke = Stroke.begun(self.at)
        self._feed(stroke, threading, float(tape.threaded[course]))
        self._feed(stroke, threading[1:].repeat(2), float(tape.begins[course]))

        touch = stroke.at.copy()
        touch[self.pose] = joints[0, self.pose]
        stroke.step(touch, at_speed(self.lift, self.lay_speed))
        stroke.switch(Event.SHOE_DOWN, self.shoe_delay)
        stroke.switch(Event.HEATER_ON, self.heater_delay)
        first = len(stroke) - 1
        self._lay(stroke, course, joints, way.laid.arc_lengths, min(lag, length + run_out))
        last = len(stroke) - 1
        stroke.switch(Event.HEATER_OFF, self.heater_delay)
        stroke.switch(Event.SHOE_UP, self.shoe_delay)
        leave = stroke.at.copy()
        for distance in sorted({max(min(lag, length + run_out) - length, 0.0), run_out}):
            stroke.step(self._moved(leave, way.out, distance), at_speed(distance, self.lay_speed), length)
        if lag > length and run_out:
            stroke.switch(Event.ROLLER_DOWN, self.roller_delay, len(stroke) - 2)
        stroke.switch(Event.ROLLER_UP, self.roller_delay)
        stroke.step(self._lifted(stroke.at), at_speed(self.lift, self.lay_speed), length)
        if course == len(tape) - 1:
            self._feed(stroke, np.array([tape.laying[-1, 1], len(tape.steps)]), float(stroke.at[self.columns["u"]]))
        self._add(stroke, course, first, last)

    def _joints(self, course: int, way: DrivenCourse) -> Floats:
        """All axes (n, k) at the block ends of a course: the pose with c by whole turns, the tape fed, knives zero."""
        laid = way.laid
        joints = np.zeros((len(laid.arc_lengths), len(self.at)))
        joints[:, self.pose] = laid.joints
        c = self.columns["c"]
        joints[:, c] += _whole_turns(laid.joints[:, 3], self.at[c], self.machine.axis("c"))
        fed = float(self.tape.stations[course]) + laid.arc_lengths + self.tape.head.knife_to_nip
        joints[:, self.columns["u"]] = fed - way.shortened
        return joints

    def _moved(self, joints: Floats, direction: Floats, distance: float) -> Floats:
        """Joint values (k,) with the head moved along a direction (3,) in `machine` axes by metres."""
        moved = joints.copy()
        moved[self.pose[:3]] += gantry.slides(direction) * distance
        return moved

    def _lifted(self, joints: Floats) -> Floats:
        """Joint values (k,) with the head drawn off along its normal."""
        return self._moved(joints, gantry.normals(joints[None, self.pose])[0], self.lift)

    def _linked(self, course: int, approach: Floats) -> Stroke:
        """The course's stroke, with the head at the approach point: it has gone up, over and down there.

        It goes by rapids, which are no part of the stroke; where a sweep is in progress, by feed.
        """
        z = self.columns["z"]
        at = self.at if self.parts else np.full(len(self.at), np.nan)
        up, over = at.copy(), approach.copy()
        up[z] = over[z] = self.link_height
        ways = np.vstack([up, over, approach])
        if self._sweeping(course):
            stroke = Stroke.begun(at)
            for way in ways:
                stroke.step(way, 0.0)
            return stroke
        rows = StrokeBlocks(
            joints=ways,
            kinds=np.full(3, Kind.RAPID, np.uint8),
            durations=rapids(ways - np.vstack([at, up, over]), self.limits),
            events=np.zeros(3, np.uint8),
            arcs=np.zeros(3),
        )
        self.parts.append((rows, course, (1 << z, self.every_axis, 0)))
        return Stroke.begun(approach)

    def _sweeping(self, course: int) -> bool:
        """Whether a knife is down as the head goes to a course."""
        done = int(self.tape.laying[course - 1, 1]) if course else 0
        return self.tape.steps.settled(done) > done

    def _feed(self, stroke: Stroke, rows: Ints, target: float) -> None:
        """Feed the tape with the head in the air to `target` (metres), doing the steps of rows (2,) on the way."""
        steps, u = self.tape.steps, self.columns["u"]
        for row in range(*rows):
            word = KNIFE_WORDS.get((int(steps.knives[row]), Step(steps.kinds[row])))
            if word:
                stroke.switch(word, self.knife_delay)
                continue
            joints = stroke.at.copy()
            joints[self.knives] = steps.poses[row]
            joints[u] = max(joints[u], steps.u[row])
            stroke.step(joints, at_speed(abs(float(joints[u] - stroke.at[u])), self.thread_speed))
        joints = stroke.at.copy()
        joints[self.knives] = steps.at(np.array([target]), rows[1:])[0]
        joints[u] = target
        stroke.step(joints, at_speed(abs(float(joints[u] - stroke.at[u])), self.thread_speed))

    def _lay(self, stroke: Stroke, course: int, joints: Floats, arcs: Floats, roller_down: float) -> None:
        """Lay a course: its block ends, the tape's steps at their exact u, and the auxiliary roller set down.

        Args:
            stroke: at the course's first block end.
            course: its index.
            joints: (n, k) joint values at its block ends but for the knives.
            arcs: (n,) metres along the course at its block ends.
            roller_down: metres along the course where the auxiliary roller goes down.
        """
        steps, fed = self.tape.steps, joints[:, self.columns["u"]]
        rows = np.arange(*self.tape.laying[course])
        kinds, count = steps.kinds[rows], np.arange(len(arcs), dtype=np.float64)
        # Every place is a number of block ends passed; a step that falls on a block end is done there.
        places = np.interp(steps.u[rows], fed, count)
        near = np.rint(places)
        places = np.where(np.abs(fed[near.astype(np.int64)] - steps.u[rows]) <= TOUCH, near, places)
        rests = (kinds == Step.MOVE) | (kinds == Step.CUT)
        moving = rests | ((kinds == Step.FEED) & (places != np.rint(places)))
        lag = float(np.interp(roller_down, arcs, count, right=np.nan))
        ends = np.unique(np.append(count, lag)) if lag == lag else count
        nodes = np.concatenate([ends, places[moving]])
        doing = np.concatenate([np.full(len(ends), -1), rows[moving]])
        order = np.lexsort([doing, nodes])
        nodes, doing = nodes[order], doing[order]

        before = np.minimum(nodes.astype(np.int64), len(arcs) - 2)
        share = nodes - before
        way = joints[before] + share[:, None] * (joints[before + 1] - joints[before])
        travelled = arcs[before] + share * (arcs[before + 1] - arcs[before])
        done = int(self.tape.laying[course, 0]) + np.searchsorted(places, nodes)
        way[:, self.knives] = np.where(
            (doing >= 0)[:, None], steps.poses[doing], steps.at(way[:, self.columns["u"]], done)
        )
        start = len(stroke) - 1
        stroke.joints[-1][-1, self.knives] = way[0, self.knives]
        stroke.go(way[1:], at_speed(np.diff(travelled), self.lay_speed), travelled[1:])
        for row, place in zip(rows, places, strict=True):
            word = KNIFE_WORDS.get((int(steps.knives[row]), Step(steps.kinds[row])))
            if word:
                done_before = (nodes < place) | ((nodes == place) & (doing <= row))
                stroke.switch(word, self.knife_delay, start + int(np.sum(done_before)) - 1)
        if lag == lag:
            stroke.switch(Event.ROLLER_DOWN, self.roller_delay, start + int(np.flatnonzero(nodes == lag)[0]))

    def _add(self, stroke: Stroke, course: int, first: int, last: int) -> None:
        """Add a stroke's blocks; where its laying from node `first` to `last` stops for long, the heater goes off."""
        times = stroke.times(self.limits)
        fed = np.vstack(stroke.joints)[:, self.columns["u"]]
        resting = np.diff(fed[first : last + 1]) == 0.0
        edges = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(np.int8), [0]])))
        for begin, end in first + edges.reshape(-1, 2):
            if times[end] - times[begin] > self.setup.head.heater_stop_s:
                stroke.switch(Event.HEATER_OFF, self.heater_delay, int(begin))
                stroke.switch(Event.HEATER_ON, self.heater_delay, int(end))
        rows = stroke.rows(times)
        stated = np.zeros(len(rows.kinds), np.int64)
        if self.parts[-1][1] != course:
            # Without rapids the first block that moves by a written digit states every axis.
            moves = np.max(np.abs(np.diff(rows.joints, axis=0, prepend=self.at[None])), axis=1) > WRITTEN_MOVE
            stated[np.argmax(moves)] = self.every_axis
        self.parts.append((rows, course, stated.tolist()))
        self.at = rows.joints[-1]

    def trajectory(self, ways: Sequence[DrivenCourse]) -> Trajectory:
        """The blocks so far.

        Raises:
            AxisBeyondTravel: an axis leaves its travel.
            PartTooHigh: the head cannot go from course to course over the part.
        """
        rows = [part[0] for part in self.parts]
        joints = np.concatenate([row.joints for row in rows])
        courses = np.repeat([course for _, course, _ in self.parts], [len(row.kinds) for row in rows])
        self._check_travel(joints, courses, np.concatenate([row.arcs for row in rows]), ways)
        if not self.link_height <= self.least_link:
            raise PartTooHigh(
                "the head cannot go from course to course over the part: with axis z at the end of its travel, "
                f"{self.link_height / MM:g} mm, the edge of the rolled head is "
                f"{(self.link_height - self.least_link) / MM:.3f} mm below the highest course point; lower the part "
                "with [part] l3_mm"
            )
        return Trajectory(
            axes=self.machine.names,
            start=np.full(len(self.machine.axes), np.nan),
            positions=joints,
            kinds=np.concatenate([row.kinds for row in rows]),
            durations=np.concatenate([row.durations for row in rows]),
            events=np.concatenate([row.events for row in rows]),
            courses=courses.astype(np.int32),
            stated=np.concatenate([stated for _, _, stated in self.parts]).astype(np.uint16),
            lines=np.zeros(len(joints), np.int32),
        )

    def _check_travel(self, joints: Floats, courses: Ints, arcs: Floats, ways: Sequence[DrivenCourse]) -> None:
        """Refuse the worst place of every axis that leaves its travel, all axes at once."""
        found = []
        for column, axis in enumerate(self.machine.axes):
            values = joints[1:, column]
            if np.all((values >= axis.lower) & (values <= axis.upper)):
                continue
            row = int(np.argmax(np.nan_to_num(np.maximum(axis.lower - values, values - axis.upper), nan=np.inf))) + 1
            path = ways[int(courses[row])].path
            found.append((path.number, nearest_point(path, float(arcs[row])), axis, float(joints[row, column])))
        if found:
            raise AxisBeyondTravel(found, _advice({axis.name for _, _, axis, _ in found}))


def _least_link(ways: Sequence[DrivenCourse], setup: Setup, machine: Machine) -> float:
    """Axis z, in metres, at which the head goes from course to course only just over the part."""
    highest = max(float(np.max(way.path.points[:, 2])) for way in ways)
    lengths = gantry.lengths(machine)
    # A rolled head stands on the edge of its roller: lower by half the width, higher by the way to the axis of roll.
    half, arm = setup.tape.width_mm / 2 * MM, lengths.l6 - lengths.radius
    starts, ends = np.array([way.laid.joints[[0, -1], 4] for way in ways]).T
    rolls = np.array([np.append(starts[0], ends[:-1]), starts])
    least = np.where(np.prod(rolls, axis=0) > 0.0, np.min(np.abs(rolls), axis=0), 0.0)
    rolled = np.clip(math.atan2(half, arm), least, np.max(np.abs(rolls), axis=0))
    lowest = float(np.min(arm * (1.0 - np.cos(rolled)) - half * np.sin(rolled)))
    return -highest + lowest - lengths.l4 - lengths.l6


def _whole_turns(angles: Floats, near: float, axis: Axis) -> float:
    """Whole turns, in radians, that bring angles (n,) into an axis's travel with their start nearest to `near`."""
    turn = 2 * math.pi
    low, high = float(np.min(angles)), float(np.max(angles))
    nearest = round((near - float(angles[0])) / turn)
    fits = np.arange(math.ceil((axis.lower - low) / turn - 1e-12), math.floor((axis.upper - high) / turn + 1e-12) + 1)
    # Where none fits, the nearest stays and the travel check names the axis.
    return turn * (float(fits[np.argmin(np.abs(fits - nearest))]) if len(fits) else nearest)


def _advice(axes: set[str]) -> str:
    if axes & {"c", "a"}:
        return (
            "Table 1 of the paper gives C +-30 and A +-180 degrees, which look swapped (C is the heading, A the roll): "
            "if the machine allows it, set [machine] limits_deg = {c = [-180, 180], a = [-30, 30]}"
        )
    if "u" in axes:
        return "lay the ply in several programs"
    return "move the part with [part] l1_mm, l2_mm, l3_mm, or lower [process] approach_mm"
