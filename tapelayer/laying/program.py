"""Program: the courses of a job become the blocks of a tape-laying program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tapelayer.arrays import Ints
from tapelayer.courses.course import Course
from tapelayer.errors import AxisBeyondTravel, PartTooHigh
from tapelayer.laying.course_blocks import LayingTask, course_blocks, start_of
from tapelayer.laying.driven_course import DrivenCourse, driven_course
from tapelayer.laying.head import head_of
from tapelayer.laying.linearisation import nearest_point
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_plan import plan_tape
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine
from tapelayer.motion.corners import Rule
from tapelayer.motion.planned_blocks import PlannedBlocks
from tapelayer.motion.time_law import timed, within_reach
from tapelayer.motion.trajectory import Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.units import MM

# A control that reaches every speed at once: for planning without one.
AT_ONCE = Rule()


def plan(
    courses: Sequence[Course],
    setup: Setup,
    machine: Machine,
    exclusive: frozenset[str] = frozenset(),
    tick: Tick = silent,
    rule: Rule = AT_ONCE,
) -> Trajectory:
    """Return the trajectory of a ply: every course approached, laid and left, its cuts made as they pass the knives.

    Args:
        courses: in the part's frame, laid in this order.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        exclusive: blade axes (d, e) that the control turns only in blocks of their own.
        tick: called after every course.
        rule: how the control turns blocks into motion.

    Raises:
        AxisBeyondTravel: a course needs an axis beyond its travel.
        PartTooHigh: the head cannot link from course to course over the part.
        PoseUndefined: a point has no roller pose.
        TapeRunsBack: the tape would have to run back under the shoe.
        TapelayerError: the tape cannot be cut as needed; see `plan_tape`.
    """
    lengths = gantry.lengths(machine)
    radius = lengths.radius if setup.head.wrap_compensation else 0.0
    driven = []
    for path in courses_in_machine(courses, setup):
        driven.append(driven_course(path, setup, lengths, radius))
        tick()
    tape = plan_tape(
        head_of(setup, machine, rule, float(np.median([one.usual_block(setup) for one in driven]))),
        [course.number for course in courses],
        np.array([one.length for one in driven]),
        np.array([course.cut_angles for course in courses]),
        radius * np.array([one.ends.wrap for one in driven]),
        frozenset(number for number, blade in ((1, "d"), (2, "e")) if blade in exclusive),
    )
    clearance = setup.process.link_clearance_mm
    clearance = setup.process.approach_mm if clearance is None else clearance
    least_link = _least_link(driven, setup, machine)
    link_height = max(least_link - clearance * MM, machine.axis("z").lower)
    task = LayingTask(setup, machine, tape, link_height, rule)
    at, parts = start_of(task), []
    for course, one in enumerate(driven):
        parts.append(course_blocks(task, course, one, at))
        at = parts[-1].joints[-1]
    blocks = PlannedBlocks.joined(parts)
    indices = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    _check_travel(blocks, indices, driven, machine)
    if not link_height <= least_link:
        raise PartTooHigh(
            "the head cannot go from course to course over the part: with axis z at the end of its travel, "
            f"{link_height / MM:g} mm, the edge of the rolled head is {(link_height - least_link) / MM:.3f} mm below "
            "the highest course point; lower the part with [part] l3_mm"
        )
    written = replace(blocks, joints=rule.written(blocks.joints))
    planned = timed(written.trajectory(machine.names, indices), task.limits, rule)
    return within_reach(planned, task.limits, rule)


def _least_link(driven: Sequence[DrivenCourse], setup: Setup, machine: Machine) -> float:
    """Return the axis z, in metres, at which the head only just clears the part while linking."""
    highest = max(float(np.max(one.path.points[:, 2])) for one in driven)
    lengths = gantry.lengths(machine)
    # Rolling the head lowers the edge of its roller by the half width, and raises it by the arm to the roll axis.
    half, arm = setup.tape.width_mm / 2 * MM, lengths.l6 - lengths.radius
    starts, ends = np.array([one.ends.joints[:, 4] for one in driven]).T
    rolls = np.array([np.append(starts[0], ends[:-1]), starts])
    least = np.where(np.prod(rolls, axis=0) > 0.0, np.min(np.abs(rolls), axis=0), 0.0)
    rolled = np.clip(math.atan2(half, arm), least, np.max(np.abs(rolls), axis=0))
    lowest = float(np.min(arm * (1.0 - np.cos(rolled)) - half * np.sin(rolled)))
    return -highest + lowest - lengths.l4 - lengths.l6


def _check_travel(blocks: PlannedBlocks, courses: Ints, driven: Sequence[DrivenCourse], machine: Machine) -> None:
    """Refuse a program with axes beyond their travel, naming the worst place of each."""
    beyond = []
    for column, axis in enumerate(machine.axes):
        values = blocks.joints[1:, column]
        if np.all((values >= axis.lower) & (values <= axis.upper)):
            continue
        row = int(np.argmax(np.nan_to_num(np.maximum(axis.lower - values, values - axis.upper), nan=np.inf))) + 1
        path = driven[int(courses[row])].path
        point = nearest_point(path, float(blocks.arcs[row]))
        beyond.append((path.number, point, axis, float(blocks.joints[row, column])))
    if beyond:
        raise AxisBeyondTravel(beyond, _advice({axis.name for _, _, axis, _ in beyond}))


def _advice(axes: set[str]) -> str:
    if axes & {"c", "a"}:
        return (
            "Table 1 of the paper gives C +-30 and A +-180 degrees, which look swapped (C is the heading, A the roll): "
            "if the machine allows it, set [machine] limits_deg = {c = [-180, 180], a = [-30, 30]}"
        )
    if "u" in axes:
        return "lay the ply in several programs"
    return "move the part with [part] l1_mm, l2_mm, l3_mm, or lower [process] approach_mm"
