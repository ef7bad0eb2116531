"""Laying: courses and a setup become the blocks of a program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tapelayer import gantry
from tapelayer.arrays import Floats
from tapelayer.course import Course
from tapelayer.errors import AxisBeyondTravel, TapeRunsBack
from tapelayer.linearisation import CourseMotion, Poses, block_ends
from tapelayer.machine import Axis, Machine
from tapelayer.setup import DEG, MM, Setup
from tapelayer.toolpath import Toolpath, placed
from tapelayer.trajectory import Event, Kind, Trajectory

# Two times closer than this are one block boundary.
SAME_TIME = 1e-9


def place(courses: Sequence[Course], setup: Setup) -> list[Toolpath]:
    """Courses in `machine` axes, where the setup places the part and on the plies already laid."""
    origin = (setup.part.l1_mm * MM, setup.part.l2_mm * MM, -setup.part.l3_mm * MM)
    return [placed(c, setup.part.rotation_rad(), origin, setup.part.laid_thickness_mm * MM) for c in courses]


def plan(courses: Sequence[Course], setup: Setup, machine: Machine) -> Trajectory:
    """Trajectory of a ply: every course approached, laid and left, the tape one continuous coordinate.

    Args:
        courses: in the part's frame, laid in this order.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.

    Raises:
        AxisBeyondTravel: a course needs an axis beyond its travel.
        PoseUndefined: a point has no roller pose.
        TapeRunsBack: the tape would have to run back under the shoe.
    """
    paths = place(courses, setup)
    program = _Program(setup, machine, max(float(np.max(path.points[:, 2])) for path in paths))
    station = 0.0
    for path in paths:
        program.add_course(path, station)
        station += path.length
    return program.trajectory()


@dataclass(frozen=True, eq=False)
class _Stroke:
    """What the head does in one go from the approach to the retract: straight joint blocks through nodes.

    Attributes:
        joints: (n, k) joint values at the nodes.
        times: (n,) seconds at the nodes.
        arcs: (n,) arc length on the course at the nodes, metres.
    """

    joints: Floats
    times: Floats
    arcs: Floats

    def with_events(self, events: Sequence[tuple[float, Event]]) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Rows after the first node, events standing on block boundaries of their own.

        Args:
            events: (time in seconds, event), in their nominal order; for one before the first node the head waits.

        Returns:
            (m, k) joints, (m,) kinds, (m,) durations, (m,) events, (m,) arc lengths.
        """
        at = np.array([time for time, _ in events])
        moving = np.append(True, np.diff(self.times) > 0.0)
        times, nodes = self.times[moving], np.column_stack([self.joints, self.arcs])[moving]
        if np.min(at) < times[0] - SAME_TIME:
            times, nodes = np.append(np.min(at), times), np.vstack([nodes[:1], nodes])
        nearest = times[np.argmin(np.abs(times[:, None] - at), axis=0)]
        at = np.where(np.abs(nearest - at) <= SAME_TIME, nearest, at)
        # A stable sort keeps the nominal order of events that fall together.
        order = np.argsort(at, kind="stable")
        ends = np.union1d(times, at)
        after = np.clip(np.searchsorted(times, ends), 1, len(times) - 1)
        share = (ends - times[after - 1]) / np.diff(times)[after - 1]
        rows = nodes[after - 1] + share[:, None] * np.diff(nodes, axis=0)[after - 1]
        rows[np.isin(ends, times)] = nodes
        places = np.searchsorted(ends, at[order])
        still = np.all(np.diff(rows, axis=0) == 0.0, axis=1)
        kinds = np.insert(np.where(still, Kind.DWELL, Kind.LINEAR), places, Kind.SWITCH)
        durations = np.insert(np.diff(ends), places, 0.0)
        words = np.insert(np.zeros(len(ends) - 1), places, [int(events[i][1]) for i in order])
        rows = np.insert(rows[1:], places, rows[places], axis=0)
        return rows[:, :-1], kinds, durations, words, rows[:, -1]


class _Program:
    """Blocks of a program as they are added, course by course."""

    def __init__(self, setup: Setup, machine: Machine, highest: float) -> None:
        self.setup, self.machine = setup, machine
        self.lengths = gantry.lengths(machine)
        self.speeds = np.array([axis.speed for axis in machine.axes])
        self.columns = {axis.name: i for i, axis in enumerate(machine.axes)}
        self.pose_columns = [self.columns[name] for name in gantry.POSE]
        self.lay_speed = setup.process.lay_speed_mm_per_s * MM
        self.radius = self.lengths.radius if setup.head.wrap_compensation else 0.0
        clearance = setup.process.link_clearance_mm
        above = highest + (setup.process.approach_mm if clearance is None else clearance) * MM
        self.link_height = max(-above - self.lengths.l4 - self.lengths.l6, machine.axis("z").lower)
        self.at = np.zeros(len(machine.axes))
        parked = (setup.tape.width_mm / 2 + setup.head.knife_clearance_mm) * MM
        self.at[self.columns["v"]], self.at[self.columns["q"]] = parked, -parked
        self.paths: list[Toolpath] = []
        self.rows: list[tuple[Floats, ...]] = []

    def add_course(self, path: Toolpath, station: float) -> None:
        """Add the blocks of one course whose leading edge is at `station` on the tape (metres)."""
        self.paths.append(path)
        head, process = self.setup.head, self.setup.process
        motion = CourseMotion(path, self.lengths, process.kinematics, self.radius)
        length, lag = motion.curve.length, head.aux_roller_lag_mm * MM
        run_out = lag if head.run_out == "tangent" else 0.0
        roller_down = min(lag, length + run_out)
        breaks = np.unique([0.0, min(roller_down, length), length])
        laid = block_ends(motion, breaks, process.tolerance_mm * MM, process.tolerance_deg * DEG)
        joints = self._joints(laid, station)
        self._check_feed(joints, motion, laid)

        lift = process.approach_mm * MM
        approach = self._moved(joints[0], gantry.normals(joints[:1, self.pose_columns])[0], lift)
        leave = self._moved(joints[-1], motion.curve.at(laid.arc_lengths[-1:])[2][0], run_out)
        retract = self._moved(leave, gantry.normals(leave[None, self.pose_columns])[0], lift)
        self._add_link(approach)

        nodes = np.vstack([approach, joints, leave, retract])
        travel = np.concatenate([[-lift], laid.arc_lengths, [length + run_out, length + run_out + lift]])
        axis_times = np.max(np.abs(np.diff(nodes, axis=0)) / self.speeds, axis=1)
        times = np.append(0.0, np.cumsum(np.maximum(axis_times, np.diff(travel) / self.lay_speed)))
        delays = head.delays_ms
        events = [
            (time - delay_ms * 1e-3, event)
            for time, delay_ms, event in (
                (times[1], delays.shoe, Event.SHOE_DOWN),
                (times[1], delays.heater, Event.HEATER_ON),
                (float(np.interp(roller_down, travel, times)), delays.roller, Event.ROLLER_DOWN),
                (times[-3], delays.heater, Event.HEATER_OFF),
                (times[-3], delays.shoe, Event.SHOE_UP),
                (times[-2], delays.roller, Event.ROLLER_UP),
            )
        ]
        self._add_stroke(_Stroke(nodes, times, np.clip(travel, 0.0, length)), events)

    def _joints(self, laid: Poses, station: float) -> Floats:
        """All axes (n, k) along a course: the pose with c by whole turns, the tape fed, the knives as they are."""
        joints = np.tile(self.at, (len(laid.arc_lengths), 1))
        joints[:, self.pose_columns] = laid.joints
        c = self.columns["c"]
        joints[:, c] += _whole_turns(laid.joints[:, 3], self.at[c], self.machine.axis("c"))
        fed = station + laid.arc_lengths + self.setup.head.knife_to_nip_mm * MM
        joints[:, self.columns["u"]] = fed - self.radius * laid.wrap
        return joints

    def _check_feed(self, joints: Floats, motion: CourseMotion, laid: Poses) -> None:
        back = np.flatnonzero(~(np.diff(joints[:, self.columns["u"]]) >= 0.0))
        if len(back):
            point = motion.point(float(laid.arc_lengths[back[0]]))
            raise TapeRunsBack(
                f"course {motion.toolpath.number} point {point}: the tape would run back under the shoe, "
                "because the surface is hollow and tighter than the roller; set [head] wrap_compensation = false"
            )

    def _moved(self, joints: Floats, direction: Floats, distance: float) -> Floats:
        """Joint values (k,) with the head moved along a direction (3,) in `machine` axes by metres."""
        moved = joints.copy()
        moved[self.pose_columns[:3]] += gantry.slides(direction) * distance
        return moved

    def _add_link(self, approach: Floats) -> None:
        """Rapids from wherever the head is to the approach point, then the tape threaded there."""
        first = not self.rows
        z, u = self.columns["z"], self.columns["u"]
        at = np.full(len(self.at), np.nan) if first else self.at
        up, over, down = at.copy(), approach.copy(), approach.copy()
        up[z] = over[z] = self.link_height
        over[u] = down[u] = self.at[u]
        rapids = np.vstack([up, over, down])
        steps = np.abs(rapids - np.vstack([at, up, over])) / self.speeds
        # From where nothing is stated the time is not known: it counts as none.
        times = np.max(np.nan_to_num(steps), axis=1)
        every_axis = (1 << len(approach)) - 1
        self._add(rapids, [Kind.RAPID] * 3, times, stated=[1 << z, every_axis, 0])
        if first:
            self._add(down[None], [Kind.SWITCH], np.zeros(1), events=[Event.SUPPLY_MODE])
        fed = abs(float(approach[u] - self.at[u]))
        if fed > 0.0:
            speed = min(self.setup.process.thread_speed_mm_per_s * MM, float(self.speeds[u]))
            self._add(approach[None], [Kind.LINEAR], np.array([fed / speed]))

    def _add_stroke(self, stroke: _Stroke, events: Sequence[tuple[float, Event]]) -> None:
        rows, kinds, durations, words, arcs = stroke.with_events(events)
        self._add(rows, kinds, durations, events=words, arcs=arcs)

    def _add(
        self,
        joints: Floats,
        kinds: Sequence[int] | Floats,
        durations: Floats,
        events: Sequence[int] | Floats = (),
        stated: Sequence[int] = (),
        arcs: Floats | None = None,
    ) -> None:
        n = len(joints)
        course = np.full(n, len(self.paths) - 1)
        columns = (
            kinds,
            durations,
            events if len(events) else np.zeros(n),
            course,
            stated if len(stated) else np.zeros(n),
        )
        self.rows.append((joints, *map(np.asarray, columns), np.zeros(n) if arcs is None else arcs))
        self.at = joints[-1]

    def trajectory(self) -> Trajectory:
        """The blocks so far.

        Raises:
            AxisBeyondTravel: an axis leaves its travel.
        """
        joints, kinds, durations, events, courses, stated, arcs = map(np.concatenate, zip(*self.rows, strict=True))
        self._check_travel(joints, courses, arcs)
        return Trajectory(
            axes=self.machine.names,
            start=np.full(len(self.machine.axes), np.nan),
            positions=joints,
            kinds=kinds.astype(np.uint8),
            durations=durations,
            events=events.astype(np.uint8),
            courses=courses.astype(np.int32),
            stated=stated.astype(np.uint16),
            lines=np.zeros(len(joints), np.int32),
        )

    def _check_travel(self, joints: Floats, courses: Floats, arcs: Floats) -> None:
        """Refuse the worst place of every axis that leaves its travel, all axes at once."""
        found = []
        for column, axis in enumerate(self.machine.axes):
            values = joints[1:, column]
            if np.all((values >= axis.lower) & (values <= axis.upper)):
                continue
            row = int(np.argmax(np.nan_to_num(np.maximum(axis.lower - values, values - axis.upper), nan=np.inf))) + 1
            path = self.paths[int(courses[row])]
            point = int(np.argmin(np.abs(path.arc_lengths - path.arc_lengths[0] - arcs[row]))) + 1
            found.append((path.number, point, axis, float(joints[row, column])))
        if found:
            raise AxisBeyondTravel(found, _advice({axis.name for _, _, axis, _ in found}))


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
