"""Course blocks: the blocks in which the head links to a course, threads the tape, lays and cuts it, and leaves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints
from tapelayer.laying.cut_assignment import TOUCH
from tapelayer.laying.driven_course import DrivenCourse
from tapelayer.laying.linearisation import Poses
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_plan import KnifeSteps, Step, TapePlan
from tapelayer.machines import gantry
from tapelayer.machines.machine import Axis, Machine
from tapelayer.motion.corners import Rule
from tapelayer.motion.planned_blocks import PlannedBlocks, rapid_blocks
from tapelayer.motion.stroke import Control, Pass, Stroke
from tapelayer.motion.time_law import Limits, at_speed
from tapelayer.motion.trajectory import Event
from tapelayer.units import MM

KNIVES = ("v", "d", "q", "e")
# A move of more than this, in metres or radians, shows in the written digits of every control.
WRITTEN_MOVE = 1e-4
KNIFE_EVENTS = {
    (1, Step.DOWN): Event.KNIFE_1_DOWN,
    (1, Step.UP): Event.KNIFE_1_UP,
    (2, Step.DOWN): Event.KNIFE_2_DOWN,
    (2, Step.UP): Event.KNIFE_2_UP,
}


@dataclass(frozen=True, eq=False)
class LayingTask:
    """Everything that the courses of a program share.

    Attributes:
        setup: the job's values.
        machine: the gantry.
        tape: the stations of the courses on the tape, and the knives' steps.
        link_height: value of axis z while linking from course to course, metres.
        rule: how the control turns blocks into motion.
    """

    setup: Setup
    machine: Machine
    tape: TapePlan
    link_height: float
    rule: Rule

    @cached_property
    def limits(self) -> Limits:
        """Return the limits of all axes."""
        return Limits.of(self.machine.axes)

    @cached_property
    def pose(self) -> list[int]:
        """Return the columns of the axes that pose the head."""
        return [self.machine.column(name) for name in gantry.POSE]

    @cached_property
    def knives(self) -> list[int]:
        """Return the columns of the knives' slides and blades."""
        return [self.machine.column(name) for name in KNIVES]

    @cached_property
    def u(self) -> int:
        """Return the column of the axis that feeds the tape."""
        return self.machine.column("u")

    @property
    def lay_speed(self) -> float:
        """Return the speed of the nip, m/s."""
        return self.setup.process.lay_speed_mm_per_s * MM

    @property
    def thread_speed(self) -> float:
        """Return the speed of the tape while the head is in the air, m/s."""
        return self.setup.process.thread_speed_mm_per_s * MM

    @cached_property
    def control(self) -> Control:
        """Return the control, which may round off the block ends of a course within the process' tolerance."""
        rounding = self.rule.rounding(self.setup.process.tolerance_mm * MM)
        return Control(self.machine.names, self.limits, self.rule, rounding)

    @property
    def lift(self) -> float:
        """Return the distance in metres along the head's normal from the surface to where a plunge begins."""
        return self.setup.process.approach_mm * MM

    @cached_property
    def delays(self) -> dict[Event, float]:
        """Return the seconds from a word to its effect, for the events that have a delay."""
        given = self.setup.head.delays_ms
        shoe, roller, knife, heater = (ms * 1e-3 for ms in (given.shoe, given.roller, given.knife, given.heater))
        return {
            **{Event.SHOE_DOWN: shoe, Event.SHOE_UP: shoe, Event.ROLLER_DOWN: roller, Event.ROLLER_UP: roller},
            **{Event.HEATER_ON: heater, Event.HEATER_OFF: heater, **dict.fromkeys(KNIFE_EVENTS.values(), knife)},
        }

    def switching(self, stroke: Stroke, event: Event, node: int | None = None) -> Stroke:
        """Return the stroke with an event at a node (the last one by default), its word earlier by its delay."""
        return stroke.switching(event, self.delays.get(event, 0.0), node)

    def knife_event(self, row: int) -> Event | None:
        """Return the event that a step of the tape's plan switches, if any."""
        return KNIFE_EVENTS.get((int(self.tape.steps.knives[row]), Step(self.tape.steps.kinds[row])))

    def sweeping(self, course: int) -> bool:
        """Return whether a knife is down while the head links to a course."""
        done = int(self.tape.laying[course - 1, 1]) if course else 0
        return self.tape.steps.settled(done) > done

    @property
    def every_axis(self) -> int:
        """Return the bit mask of all axes, for a block that states every one."""
        return (1 << len(self.machine.axes)) - 1

    def moved(self, joints: Floats, direction: Floats, distance: float) -> Floats:
        """Return joint values (k,) with the head moved by metres along a direction (3,) in `machine` axes."""
        moved = joints.copy()
        moved[self.pose[:3]] += gantry.slides(direction) * distance
        return moved

    def lifted(self, joints: Floats) -> Floats:
        """Return joint values (k,) with the head retracted along its normal."""
        return self.moved(joints, gantry.normals(joints[None, self.pose])[0], self.lift)


def start_of(task: LayingTask) -> Floats:
    """Return the joint values (k,) before the first course: the knives as planned, all else 0."""
    joints = np.zeros(len(task.machine.axes))
    joints[task.knives] = task.tape.steps.poses[0]
    return joints


def course_blocks(task: LayingTask, course: int, driven: DrivenCourse, begin: Floats) -> PlannedBlocks:
    """Return the blocks of one course.

    Args:
        task: everything that the courses share.
        course: index of the course.
        driven: the course as the gantry drives it.
        begin: (k,) joint values after the previous course; those of `start_of` for the first course.
    """
    tape, parts = task.tape, []
    laid = driven.laid(task.setup, _required(task, course, driven))
    joints = _joints(task, course, driven, laid, begin)
    approach = task.lifted(joints[0])
    approach[task.u], approach[task.knives] = begin[task.u], begin[task.knives]
    # Before the first course no block has stated the axes' positions.
    at = begin if course else np.full_like(begin, np.nan)
    link = _link(task, at, approach)
    sweeping = task.sweeping(course)
    if sweeping:
        stroke = Stroke.through(np.vstack([at, link]))
    else:
        rapids = rapid_blocks(at, link, task.limits)
        parts.append(rapids.stating(0, 1 << task.machine.column("z")).stating(1, task.every_axis))
        stroke = Stroke.begun(approach)
    if course == 0:
        stroke = task.switching(stroke, Event.SUPPLY_MODE)
    elif tape.rolls[course] != tape.rolls[course - 1]:
        stroke = _fed(task, stroke, tape.changing[course], float(tape.roll_u[tape.rolls[course]]))
        stroke = task.switching(stroke, Event.STOP)
        # The control stops for as long as it takes: no word for what follows may come before the stop.
        parts.append(task.control.blocks(stroke))
        stroke = Stroke.begun(parts[-1].joints[-1])
    threading = tape.threading[course]
    stroke = _fed(task, stroke, threading, float(tape.threaded[course]))
    stroke = _fed(task, stroke, threading[1:].repeat(2), float(tape.begins[course]))
    parts.append(_laid(task, course, driven, laid.arc_lengths, joints, stroke))
    if sweeping:
        # Without rapids, the first block that moves by a written digit states every axis.
        moves = np.max(np.abs(np.diff(parts[0].joints, axis=0, prepend=begin[None])), axis=1) > WRITTEN_MOVE
        parts[0] = parts[0].stating(int(np.argmax(moves)), task.every_axis)
    return PlannedBlocks.joined(parts)


def _required(task: LayingTask, course: int, driven: DrivenCourse) -> Floats:
    """Return the arc lengths (n,) in metres at which a block must end: where knives or auxiliary roller switch."""
    steps, rows = task.tape.steps, slice(*task.tape.laying[course])
    done = steps.u[rows][steps.kinds[rows] != Step.FEED]
    places = driven.places(np.unique(done) - float(task.tape.stations[course]) - task.tape.head.knife_to_nip)
    lag = task.setup.head.aux_roller_lag_mm * MM
    return np.append(places, lag) if lag < driven.length else places


def _joints(task: LayingTask, course: int, driven: DrivenCourse, laid: Poses, begin: Floats) -> Floats:
    """Return all axes (n, k) at the block ends of a course: pose with c by whole turns, tape fed, knives at 0."""
    c = task.machine.column("c")
    joints = np.zeros((len(laid.arc_lengths), len(begin)))
    joints[:, task.pose] = laid.joints
    joints[:, c] += _whole_turns(laid.joints[:, 3], begin[c], task.machine.axis("c"))
    fed = float(task.tape.stations[course]) + laid.arc_lengths + task.tape.head.knife_to_nip
    joints[:, task.u] = fed - driven.shortened(laid)
    return joints


def _whole_turns(angles: Floats, near: float, axis: Axis) -> float:
    """Return the whole turns, in radians, that put angles (n,) into an axis's travel, the first nearest to `near`."""
    turn = 2 * math.pi
    low, high = float(np.min(angles)), float(np.max(angles))
    nearest = round((near - float(angles[0])) / turn)
    fits = np.arange(math.ceil((axis.lower - low) / turn - 1e-12), math.floor((axis.upper - high) / turn + 1e-12) + 1)
    # If no turn fits, keep the nearest: the travel check then names the axis.
    return turn * (float(fits[np.argmin(np.abs(fits - nearest))]) if len(fits) else nearest)


def _link(task: LayingTask, at: Floats, approach: Floats) -> Floats:
    """Return the joint values (3, k) of the link to a course: up, over, and down to the approach point."""
    z = task.machine.column("z")
    up, over = at.copy(), approach.copy()
    up[z] = over[z] = task.link_height
    return np.vstack([up, over, approach])


def _fed(task: LayingTask, stroke: Stroke, rows: Ints, target: float) -> Stroke:
    """Feed the tape with the head in the air to `target` (metres), with the steps of rows (2,) done meanwhile."""
    steps, u = task.tape.steps, task.u
    for row in range(*rows):
        if event := task.knife_event(row):
            stroke = task.switching(stroke, event)
            continue
        joints = stroke.end.copy()
        joints[task.knives] = steps.poses[row]
        joints[u] = max(joints[u], steps.u[row])
        stroke = stroke.to(joints, at_speed(abs(float(joints[u] - stroke.end[u])), task.thread_speed))
    joints = stroke.end.copy()
    joints[task.knives] = steps.at(np.array([target]), rows[1:])[0]
    joints[u] = target
    return stroke.to(joints, at_speed(abs(float(joints[u] - stroke.end[u])), task.thread_speed))


def _laid(
    task: LayingTask, course: int, driven: DrivenCourse, arcs: Floats, joints: Floats, stroke: Stroke
) -> PlannedBlocks:
    """Return the blocks of a stroke that has threaded the tape and goes down, along the course, off its end and up.

    Args:
        task: everything that the courses share.
        course: index of the course.
        driven: the course as the gantry drives it.
        arcs: (n,) metres along the course at its block ends.
        joints: (n, k) joint values at its block ends, knives not yet set.
        stroke: the stroke up to the approach point.
    """
    head, tape, length = task.setup.head, task.tape, driven.length
    lag = head.aux_roller_lag_mm * MM
    run_out = lag if head.run_out == "tangent" else 0.0
    roller_down = min(lag, length + run_out)
    laying = _laying(task, course, joints, arcs, roller_down)
    touch = stroke.end.copy()
    touch[task.pose], touch[task.knives] = joints[0, task.pose], laying.joints[0, task.knives]
    stroke = stroke.to(touch, at_speed(task.lift, task.lay_speed))
    stroke = task.switching(task.switching(stroke, Event.SHOE_DOWN), Event.HEATER_ON)
    first = len(stroke) - 1
    stroke = stroke.then(laying)
    last = len(stroke) - 1
    stroke = task.switching(task.switching(stroke, Event.HEATER_OFF), Event.SHOE_UP)
    leave = stroke.end
    for distance in sorted({max(roller_down - length, 0.0), run_out} - {0.0}):
        stroke = stroke.to(task.moved(leave, driven.out, distance), at_speed(distance, task.lay_speed), length)
    if lag > length and run_out:
        stroke = task.switching(stroke, Event.ROLLER_DOWN, len(stroke) - 2)
    stroke = task.switching(stroke, Event.ROLLER_UP)
    stroke = stroke.to(task.lifted(stroke.end), at_speed(task.lift, task.lay_speed), length)
    if course == len(tape) - 1:
        stroke = _fed(task, stroke, np.array([tape.laying[-1, 1], len(tape.steps)]), float(stroke.end[task.u]))
    return task.control.blocks(_heated(task, stroke, first, last))


def _laying(task: LayingTask, course: int, joints: Floats, arcs: Floats, roller_down: float) -> Stroke:
    """Return the stroke along a course: block ends, the tape's steps at their exact u, auxiliary roller lowered.

    Args:
        task: everything that the courses share.
        course: index of the course.
        joints: (n, k) joint values at its block ends, knives not yet set.
        arcs: (n,) metres along the course at its block ends.
        roller_down: metres along the course where the auxiliary roller is lowered; beyond its end, not in this stroke.
    """
    steps, fed = task.tape.steps, joints[:, task.u]
    rows = np.arange(*task.tape.laying[course])
    kinds, ends = steps.kinds[rows], np.arange(len(arcs), dtype=np.float64)
    # Nodes are numbered in block ends passed; a step that falls on a block end is done there.
    passed = np.interp(steps.u[rows], fed, ends)
    near = np.rint(passed)
    passed = np.where(np.abs(fed[near.astype(np.int64)] - steps.u[rows]) <= TOUCH, near, passed)
    rests = (kinds == Step.MOVE) | (kinds == Step.CUT)
    lowered = np.interp([roller_down], arcs, ends) if roller_down <= arcs[-1] else np.zeros(0)
    ends = np.unique(np.append(ends, lowered))
    nodes = np.concatenate([ends, passed[rests]])
    doing = np.concatenate([np.full(len(ends), -1), rows[rests]])
    order = np.lexsort([doing, nodes])
    nodes, doing = nodes[order], doing[order]

    before = np.minimum(nodes.astype(np.int64), len(arcs) - 2)
    share = nodes - before
    values = joints[before] + share[:, None] * (joints[before + 1] - joints[before])
    travelled = arcs[before] + share * (arcs[before + 1] - arcs[before])
    done = int(task.tape.laying[course, 0]) + np.searchsorted(passed, nodes)
    values[:, task.knives] = np.where((doing >= 0)[:, None], steps.poses[doing], steps.at(values[:, task.u], done))
    # The speed of the tape while a knife sweeps in passing: from the node of its word down to that of its word up.
    swept = np.full(len(nodes), task.lay_speed)
    for down, up, speed in _swept(steps, rows, passed):
        within = (nodes > down) & (nodes <= up) if speed else np.zeros(len(nodes), np.bool_)
        swept[within] = np.minimum(swept[within], speed)
    least = _seconds(task, values, travelled, swept)
    stroke = Stroke(values, least, travelled, _passed(task, nodes, travelled, rows, passed))
    for row, place in zip(rows, passed, strict=True):
        if event := task.knife_event(row):
            done_before = (nodes < place) | ((nodes == place) & (doing <= row))
            stroke = task.switching(stroke, event, int(np.sum(done_before)) - 1)
    for node in np.searchsorted(nodes, lowered).tolist():
        stroke = task.switching(stroke, Event.ROLLER_DOWN, node)
    return stroke


def _swept(steps: KnifeSteps, rows: Ints, places: Floats) -> list[tuple[float, float, float]]:
    """Return where knives go down and up among (r,) rows of the plan, at their places (r,), and the tape's speed.

    A knife that is down when the rows begin is so from place -1, one that stays down to a place beyond all.
    """
    swept = []
    for knife in (1, 2):
        own = np.flatnonzero((steps.knives[rows] == knife) & np.isin(steps.kinds[rows], (Step.DOWN, Step.UP)))
        kinds, at, speeds = steps.kinds[rows[own]], places[own], steps.speeds[rows[own]]
        if len(own) and kinds[0] == Step.UP:
            swept.append((-1.0, float(at[0]), float(speeds[0])))
        for index in np.flatnonzero(kinds == Step.DOWN).tolist():
            up = float(at[index + 1]) if index + 1 < len(at) else math.inf
            swept.append((float(at[index]), up, float(speeds[index])))
    return swept


def _passed(task: LayingTask, nodes: Floats, arcs: Floats, rows: Ints, places: Floats) -> NDArray[np.uint8]:
    """Return how the control passes each node (n,) of a course.

    It goes on where the tape does. It stops for the ends of a sweep that has no run-up, and where the tape rests.

    Args:
        task: everything that the courses share.
        nodes: (n,) places of the nodes, in block ends passed.
        arcs: (n,) metres along the course at the nodes.
        rows: (r,) rows of the plan that are done on the course.
        places: (r,) their places.
    """
    going = np.diff(arcs) > 0.0
    passed = np.zeros(len(nodes), np.uint8)
    passed[1:-1][going[:-1] & going[1:]] = Pass.ON
    steps = task.tape.steps
    stop = task.control.stop
    switching = np.isin(steps.kinds[rows], (Step.DOWN, Step.UP)) & (steps.speeds[rows] == 0.0)
    at = places[switching]
    begins = places[switching & (steps.kinds[rows] == Step.DOWN)]
    inner = passed == Pass.ON
    passed[inner & np.isin(nodes, at)] = Pass.STOP
    # Where the tape rests for a sweep, the first node there is the one that it arrives at.
    arriving = np.append(False, going) & ~np.append(going, False)
    passed[(inner | arriving) & np.isin(nodes, begins)] = stop
    passed[-1] = stop
    return passed


def _seconds(task: LayingTask, joints: Floats, arcs: Floats, fastest: Floats) -> Floats:
    """Return the least seconds (n,) of the motion to each node: at laying speed, or as fast as the control holds it.

    Args:
        task: everything that the courses share.
        joints: (n, k) at the nodes.
        arcs: (n,) metres along the course.
        fastest: (n,) m/s, greatest speed on the way to each node.
    """
    steps, lengths = np.diff(joints, axis=0), np.diff(arcs)
    slides = np.linalg.norm(steps[:, task.pose[:3]], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        accelerations = slides / np.max(np.abs(steps) / task.limits.acceleration, axis=1)
        held = task.rule.held(slides, accelerations) * lengths / slides
    speeds = np.fmin(fastest[1:], np.where(lengths > 0.0, held, np.inf))
    return np.append(0.0, lengths / speeds)


def _heated(task: LayingTask, stroke: Stroke, first: int, last: int) -> Stroke:
    """Return the stroke with the heater off during long stops of its laying, from node `first` to `last`."""
    resting = np.diff(stroke.joints[first : last + 1, task.u]) == 0.0
    if not np.any(resting):
        return stroke
    times = task.control.times(stroke)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(np.int8), [0]])))
    for begin, end in (first + edges.reshape(-1, 2)).tolist():
        if times[end] - times[begin] > task.setup.head.heater_stop_s:
            stroke = task.switching(task.switching(stroke, Event.HEATER_OFF, begin), Event.HEATER_ON, end)
    return stroke
