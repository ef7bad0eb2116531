"""Verification: a trajectory against its courses, through Pinocchio on the URDF; the only door to an NC program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.courses.course import Course
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.laying.cut_check import judge_cuts
from tapelayer.laying.evidence import Evidence, Samples, TapeLedger
from tapelayer.laying.laid import Laid
from tapelayer.laying.limits import limits_of
from tapelayer.laying.link_check import judge_sequence
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.settings import Setup
from tapelayer.machines import gantry
from tapelayer.machines.machine import CHUNK, Machine
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.units import DEG, MM
from tapelayer.verification.axis_use import axes_used
from tapelayer.verification.failures import Failure
from tapelayer.verification.verified import Verified

# Between two block ends the path is looked at this often, and at least every so many metres.
LEAST_SAMPLES = 4
SAMPLE_STEP = 5e-3
# Pinocchio itself evaluates this many block ends; of a longer program an even selection.
PINOCCHIO_BLOCKS = 20_000
PINOCCHIO_AGREEMENT = 1e-9
# Inside a block that is straight in joint space the nip's speed varies by less than this share.
NIP_SPEED_MARGIN = 0.01
# Rounded feeds shift a switch against the motion by microseconds: tape that runs back no farther under it rests.
RUN_BACK = 1e-6
# A switch that is on for no more than this share of a block's time is not on in it.
HELD = 1e-3
# The nip's arc length is found from the tape fed to this accuracy, in metres.
STATION_ACCURACY = 1e-10


def verify(
    trajectory: Trajectory,
    courses: Sequence[Course],
    setup: Setup,
    machine: Machine,
    resolution: Floats | None = None,
) -> Verified[Evidence]:
    """Verified trajectory, or the reasons why it is none.

    Args:
        trajectory: planned, or read back from a program.
        courses: what it has to lay, in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        resolution: (k,) last written digit of each axis in metres and radians, for a program read back; its feed is
            made from rounded end points, so a speed may exceed its limit by one digit a block.

    Raises:
        VerificationFailed: something does not hold; its evidence tells all.
    """
    return Inspector(courses, setup, machine).verify(trajectory, resolution)


class Inspector:
    """The courses of a job, made ready to judge trajectories by.

    The courses' curves are B-splines here, so that the planner's piecewise polynomials are not their own judge.

    Args:
        courses: in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
    """

    def __init__(self, courses: Sequence[Course], setup: Setup, machine: Machine) -> None:
        self.setup, self.machine = setup, machine
        self.courses = courses
        self.curves = [_CourseSpline(path) for path in courses_in_machine(courses, setup)]
        self.highest = max(float(np.max(curve.path.points[:, 2])) for curve in self.curves)
        self.roller_radius = gantry.lengths(machine).radius
        self.wrap_radius = self.roller_radius if setup.head.wrap_compensation else 0.0
        self._slides = [machine.column(name) for name in "xyz"]
        self.published = setup.process.kinematics == "published"

    def verify(
        self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent
    ) -> Verified[Evidence]:
        """As the function `verify`; `tick` is called for every course that is done."""
        return Verified(trajectory, self.examine(trajectory, resolution, tick))

    def examine(self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent) -> Evidence:
        """Evidence on a trajectory, failures included; arguments as `verify`."""
        digits = np.zeros(len(trajectory.axes)) if resolution is None else resolution
        layings = _layings(trajectory, self.setup)
        failures = [
            *_unstated(trajectory),
            *_switching(trajectory, self.setup),
            *self._number_of_courses(trajectory, layings),
        ]
        if any(failure.what == "unstated_axes" for failure in failures):
            # Nothing can be measured on a program that does not say where it is.
            layings = []
        samples, blocks, laid = self._measured(trajectory, layings[: len(self.curves)], tick)
        failures += self._judged(trajectory, samples, blocks, digits)
        tape, clearance = _NO_TAPE, np.inf
        if laid:
            tape, cutting = judge_cuts(trajectory, laid, self.setup, self.machine)
            clearance, sequence = judge_sequence(
                trajectory, laid, samples, self.highest, self.setup, self.machine, digits
            )
            failures += [*cutting, *sequence]
        axes, beyond = axes_used(trajectory, self.machine.axes, digits, digits)
        taken_back, feeding = self._feeding(trajectory, layings)
        disagreement = self._pinocchio(trajectory)
        if not disagreement <= PINOCCHIO_AGREEMENT:
            failures.append(Failure(0, 0, "forward_disagreement_m", disagreement, PINOCCHIO_AGREEMENT))
        return Evidence(
            courses=len(self.curves),
            points=sum(len(curve.path.points) for curve in self.curves),
            blocks=len(trajectory),
            laid_length=sum(curve.length for curve in self.curves),
            duration=trajectory.duration,
            tape_taken_back=taken_back,
            least_link_clearance=clearance,
            forward_disagreement=disagreement,
            axes=axes,
            limits=limits_of(self.setup),
            samples=samples,
            tape_width=self.setup.tape.width_mm * MM,
            roller_radius=self.roller_radius,
            tape=tape,
            failures=(
                *failures,
                *feeding,
                *(self._at_block(trajectory, *astuple(found)) for found in beyond),
            ),
        )

    def _number_of_courses(self, trajectory: Trajectory, layings: Sequence[_Laying]) -> list[Failure]:
        if len(layings) == len(self.curves):
            return []
        block = layings[len(self.curves)].first if len(layings) > len(self.curves) else -1
        line = int(trajectory.lines[block])
        return [Failure(0, 0, "courses_laid", len(layings), len(self.curves), line)]

    def _measured(
        self, trajectory: Trajectory, layings: Sequence[_Laying], tick: Tick
    ) -> tuple[Samples, Ints, list[Laid]]:
        """Samples along the courses laid, the block (n,) of each, and how the courses lie on the tape."""
        parts, blocks, laid = [], [np.zeros(0, np.int64)], []
        for batch in self._batches(layings):
            places = _SamplePlaces.along(trajectory, layings, batch)
            fed = places.joints[:, trajectory.column("u")]
            samples = self._samples(places, fed)
            parts.append(samples)
            blocks.append(places.blocks)
            stations = fed + self.wrap_radius * samples.wraps - self.setup.head.knife_to_nip_mm * MM
            for index in batch.tolist():
                laid.append(self._laid(index, layings[index], float(stations[places.rows(index).start])))
                tick()
        return Samples.joined(parts), np.concatenate(blocks), laid

    def _batches(self, layings: Sequence[_Laying]) -> list[Ints]:
        """Indices of the courses that are measured together: what they pass through stays in the cache."""
        sizes = [
            LEAST_SAMPLES * (laying.last - laying.first) + curve.length / SAMPLE_STEP
            for laying, curve in zip(layings, self.curves, strict=False)
        ]
        borders = np.flatnonzero(np.diff(np.cumsum(sizes) // CHUNK)) + 1
        return np.split(np.arange(len(sizes)), borders) if sizes else []

    def _laid(self, index: int, laying: _Laying, station: float) -> Laid:
        curve = self.curves[index]
        return Laid(
            number=curve.path.number,
            points=len(curve.knots),
            cut_angles=self.courses[index].cut_angles,
            length=curve.length,
            station=station,
            begin=laying.begin,
            end=laying.end,
            out=_unit(curve.slopes(curve.knots[-1:]))[0],
        )

    def _samples(self, places: _SamplePlaces, fed: Floats) -> Samples:
        """Samples of some courses, at the places (n,) with the tape fed (n,) there, metres."""
        pose = self.machine.columns(places.joints, "roller")
        centre = np.stack(np.broadcast_arrays(*pose.translation), axis=1)
        heading, left, normal = (
            np.stack(np.broadcast_arrays(*(row[i] for row in pose.rotation)), axis=1) for i in range(3)
        )
        axis = -left
        curves = _CourseSplines(
            [(self.curves[index], places.rows(index)) for index in np.unique(places.courses).tolist()]
        )
        arc_lengths, wraps = curves.under_nip(fed, normal, heading, self.wrap_radius)
        points, normals, tangents = curves.at(arc_lengths)

        square = _unit(np.cross(tangents, normals))
        ahead = np.cross(normals, square)
        exact = points + self.roller_radius * normals
        offset = centre - exact
        error = centre - self.roller_radius * normal - points if self.published else offset
        return Samples(
            courses=places.courses,
            arc_lengths=arc_lengths,
            times=places.times,
            nips=points,
            normal_errors=_dot(error, normals),
            lateral_errors=_dot(error, square),
            tape_errors=_dot(error, tangents),
            tilts=np.arcsin(np.clip(_dot(axis, normals), -1.0, 1.0)),
            heading_errors=np.arctan2(_dot(axis, ahead), _dot(axis, square)),
            pitches=np.arctan2(_dot(normals, heading), _dot(normals, normal)),
            wraps=wraps,
            offsets=np.sqrt(_dot(offset, offset)),
            block_ends=places.ends,
        )

    def _judged(self, trajectory: Trajectory, samples: Samples, blocks: Ints, digits: Floats) -> list[Failure]:
        """What the samples, with the block (n,) of each, fail in, course by course."""
        if not len(blocks):
            return []
        limits = self.setup.verification
        chosen = limits.model_fields_set
        judged = [
            ("position_error_mm", samples.position_errors / MM, limits.max_position_error_mm),
            ("tape_error_mm", np.abs(samples.tape_errors) / MM, limits.max_tape_error_mm),
        ]
        if not self.published or "max_roller_tilt_deg" in chosen:
            judged.append(("roller_tilt_deg", np.abs(samples.tilts) / DEG, limits.max_roller_tilt_deg))
        if not self.published or "max_heading_error_deg" in chosen:
            judged.append(("heading_error_deg", np.abs(samples.heading_errors) / DEG, limits.max_heading_error_deg))
        # Where the nip is, is known from the tape fed to within the tolerance that blocks are laid out for.
        doubt = 2 * float(np.max(digits[self._slides])) + self.setup.process.tolerance_mm * MM
        speeds = self._lay_speeds(samples, doubt)
        lay_speed = self.setup.process.lay_speed_mm_per_s * (1 + NIP_SPEED_MARGIN)
        judged.append(("lay_speed_mm_per_s", speeds / MM, lay_speed))
        found = []
        for what, values, limit in judged:
            for row in _worst(samples.courses, values, limit).tolist():
                found.append((row, what, float(values[row]), limit))
        for row in np.append(np.flatnonzero(np.diff(samples.courses)), len(blocks) - 1).tolist():
            reach, length = float(samples.arc_lengths[row]), self.curves[samples.courses[row]].length
            if not abs(reach - length) / MM <= limits.max_tape_error_mm:
                found.append((row, "laid_length_mm", reach / MM, length / MM))
        failures = []
        for row, what, value, limit in sorted(found, key=lambda failure: int(samples.courses[failure[0]])):
            curve = self.curves[samples.courses[row]]
            point = curve.point(float(samples.arc_lengths[row]))
            failures.append(Failure(curve.path.number, point, what, value, limit, int(trajectory.lines[blocks[row]])))
        return failures

    @staticmethod
    def _lay_speeds(samples: Samples, doubt: float) -> Floats:
        """Speed (n,) of the nip over each block, at its end, m/s, the way shortened by `doubt` metres; 0 elsewhere."""
        ends = np.flatnonzero(samples.block_ends)
        ways, spans = np.diff(samples.arc_lengths[ends]), np.diff(samples.times[ends])
        going = (np.diff(samples.courses[ends]) == 0) & (ways > 0.0)
        speeds = np.zeros(len(samples.times))
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds[ends[1:]] = np.where(going, (ways - doubt) / spans, 0.0)
        return speeds

    def _at_block(self, trajectory: Trajectory, row: int, what: str, value: float, limit: float) -> Failure:
        index = int(trajectory.courses[row])
        number = self.curves[index].path.number if 0 <= index < len(self.curves) else 0
        return Failure(number, 0, what, float(value), float(limit), int(trajectory.lines[row]))

    def _feeding(self, trajectory: Trajectory, layings: Sequence[_Laying]) -> tuple[float, list[Failure]]:
        """Longest run of the tape backwards, and where it runs back or is fed as it may not.

        It never runs back under a shoe or knife, between courses no farther than to where the next one begins, and is
        never fed along a course with the shoe up.
        """
        u = trajectory.column("u")
        rows = np.arange(len(trajectory))
        steps = np.nan_to_num(trajectory.positions[:, u] - trajectory.begins(rows)[:, u])
        failures = []
        delays = self.setup.head.delays_ms
        held = [
            _held(trajectory, Event.SHOE_DOWN, Event.SHOE_UP, delays.shoe),
            _held(trajectory, Event.KNIFE_1_DOWN, Event.KNIFE_1_UP, delays.knife),
            _held(trajectory, Event.KNIFE_2_DOWN, Event.KNIFE_2_UP, delays.knife),
        ]
        back = steps * np.max(held, axis=0)
        row = int(np.argmin(back))
        if not back[row] >= -RUN_BACK:
            failures.append(self._at_block(trajectory, row, "tape_run_back_mm", -back[row] / MM, 0.0))
        slack = self.setup.verification.max_tape_error_mm * MM
        free = np.ones(len(trajectory), np.bool_)
        for laying, following in zip(layings, [*layings, None][1:], strict=False):
            free[laying.first : laying.last] = False
            until = following.first if following else len(trajectory)
            between = rows[laying.last : until]
            if following and len(between):
                lowest = int(between[np.argmin(trajectory.positions[between, u])])
                allowed = np.minimum(trajectory.positions[laying.last - 1, u], trajectory.positions[until - 1, u])
                short = float(allowed - trajectory.positions[lowest, u])
                if not short <= slack:
                    failures.append(
                        self._at_block(trajectory, lowest, "tape_taken_back_too_far_mm", short / MM, slack / MM)
                    )
        moving = np.any(trajectory.positions[:, self._slides] != trajectory.begins(rows)[:, self._slides], axis=1) & (
            steps > slack
        )
        astray = free & moving & (trajectory.kinds == Kind.LINEAR)
        if np.any(astray):
            row = int(np.argmax(astray))
            failures.append(self._at_block(trajectory, row, "laid_with_shoe_up_mm", steps[row] / MM, 0.0))
        supply = np.flatnonzero(trajectory.events == Event.SUPPLY_MODE)
        first_feed = int(np.argmax(steps != 0.0)) if np.any(steps != 0.0) else len(trajectory)
        if len(supply) != 1 or supply[0] > first_feed:
            row = int(supply[-1]) if len(supply) else min(first_feed, len(trajectory) - 1)
            failures.append(
                self._at_block(trajectory, row, "supply_mode_before_feed", len(supply[supply < first_feed]), 1)
            )
        return float(np.max(-steps, initial=0.0)), failures

    def _pinocchio(self, trajectory: Trajectory) -> float:
        """Largest difference, in metres, between Pinocchio itself and the batch evaluator at block ends."""
        rows = np.flatnonzero(~np.any(np.isnan(trajectory.positions), axis=1))
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), PINOCCHIO_BLOCKS)).astype(np.int64))]
        if not len(rows):
            return 0.0
        joints = trajectory.positions[rows]
        difference = self.machine.forward_pinocchio(joints, "roller") - self.machine.forward(joints, "roller")
        return float(np.max(np.abs(difference)))


@dataclass(frozen=True)
class _Laying:
    """From the shoe's touch to its lift: the time it begins and ends, in seconds from the program's start."""

    begin: float
    end: float
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class _SamplePlaces:
    """Where some courses are looked at while they are laid, rows in laying order.

    Attributes:
        courses: (n,) index of the course, rising.
        blocks: (n,) index of the block.
        times: (n,) seconds from the program's start.
        joints: (n, k) joint values, metres and radians.
        ends: (n,) True at block ends and at each course's begin.
    """

    courses: Ints
    blocks: Ints
    times: Floats
    joints: Floats
    ends: Mask

    @classmethod
    def along(cls, trajectory: Trajectory, layings: Sequence[_Laying], indices: Ints) -> _SamplePlaces:
        """Places along the layings of the courses with these (m,) rising indices."""
        chosen = [layings[index] for index in indices]
        rows = np.concatenate([np.arange(laying.first, laying.last) for laying in chosen])
        lengths = [laying.last - laying.first for laying in chosen]
        courses = np.repeat(indices, lengths)
        start = np.repeat([laying.begin for laying in chosen], lengths)
        stop = np.repeat([laying.end for laying in chosen], lengths)
        ends = trajectory.times[rows]
        begins = ends - trajectory.durations[rows]
        # A block shorter than the clock can tell is not on the way; a move in it fails for its speed.
        timed = (ends > begins) & (ends > start) & (begins < stop)
        rows, courses, begins, ends = rows[timed], courses[timed], begins[timed], ends[timed]
        from_, to = np.maximum(begins, start[timed]), np.minimum(ends, stop[timed])
        u = trajectory.column("u")
        distance = np.abs(trajectory.positions[rows, u] - trajectory.begins(rows)[:, u])
        steps = np.maximum(LEAST_SAMPLES, np.ceil(distance / SAMPLE_STEP).astype(np.int64))
        # Every block is looked at from behind its begin to its end, a course's first block at its begin, too.
        first = np.diff(courses, prepend=-1) > 0
        counts = steps + first
        block = np.repeat(np.arange(len(rows)), counts)
        step = np.arange(len(block)) - (np.cumsum(counts) - steps)[block] + 1
        times = np.where(step == steps[block], to[block], from_[block] + (to - from_)[block] * step / steps[block])
        shares = np.clip((times - begins[block]) / (ends - begins)[block], 0.0, 1.0)
        joints = trajectory.within(rows[block], shares)
        return cls(courses[block], rows[block], times, joints, (step == 0) | (step == steps[block]))

    def rows(self, course: int) -> slice:
        """Rows of the course with an index."""
        return slice(*np.searchsorted(self.courses, [course, course + 1]).tolist())


def _layings(trajectory: Trajectory, setup: Setup) -> list[_Laying]:
    """Every stretch with the shoe down, by when its words take effect."""
    delay = setup.head.delays_ms.shoe * 1e-3
    down = np.flatnonzero(trajectory.events == Event.SHOE_DOWN)
    up = np.flatnonzero(trajectory.events == Event.SHOE_UP)
    layings = []
    for start in down:
        later = up[up > start]
        if not len(later):
            break
        begin, end = trajectory.times[start] + delay, trajectory.times[later[0]] + delay
        first, last = np.searchsorted(trajectory.times, begin, side="right"), np.searchsorted(trajectory.times, end)
        if end > begin:
            layings.append(_Laying(float(begin), float(end), int(first), int(last) + 1))
    return layings


def _worst(courses: Ints, values: Floats, limit: float) -> Ints:
    """Row of the worst place of each course, by the courses' rising indices (n,), where the values (n,) leave a limit.

    NaN leaves every limit, and is worst.
    """
    off = np.flatnonzero(~(values <= limit))
    worst = np.where(np.isnan(values[off]), np.inf, values[off])
    order = np.lexsort([-worst, courses[off]])
    return off[order][np.diff(courses[off][order], prepend=-1) > 0]


def _unstated(trajectory: Trajectory) -> list[Failure]:
    """A first motion that is more than z, and blocks that move by feed before every axis has been stated."""
    known = ~np.isnan(trajectory.positions)
    first = int(np.argmax(np.any(known, axis=1)))
    if known[first].sum() > known[first, trajectory.column("z")]:
        return [Failure(0, 0, "first_motion_axes", int(known[first].sum()), 1, int(trajectory.lines[first]))]
    lost = np.any(np.isnan(trajectory.positions), axis=1) & (trajectory.kinds != Kind.RAPID)
    if not np.any(lost):
        return []
    row = int(np.argmax(lost))
    count = int(np.sum(np.isnan(trajectory.positions[row])))
    return [Failure(0, 0, "unstated_axes", count, 0, int(trajectory.lines[row]))]


def _switching(trajectory: Trajectory, setup: Setup) -> list[Failure]:
    """Switches that are put on twice, off twice or left on, and rapids and stops while one is on."""
    failures = []
    delays = setup.head.delays_ms
    for name, on, off, delay in (
        ("shoe", Event.SHOE_DOWN, Event.SHOE_UP, delays.shoe),
        ("auxiliary_roller", Event.ROLLER_DOWN, Event.ROLLER_UP, delays.roller),
        ("heater", Event.HEATER_ON, Event.HEATER_OFF, delays.heater),
        ("knife_1", Event.KNIFE_1_DOWN, Event.KNIFE_1_UP, delays.knife),
        ("knife_2", Event.KNIFE_2_DOWN, Event.KNIFE_2_UP, delays.knife),
    ):
        rows = np.flatnonzero((trajectory.events == on) | (trajectory.events == off))
        states = np.where(trajectory.events[rows] == on, 1, 0)
        wrong = np.flatnonzero(states != (np.arange(len(rows)) + 1) % 2)
        if len(wrong):
            row = int(rows[wrong[0]])
            failures.append(Failure(0, 0, f"{name}_switched_again", 1, 0, int(trajectory.lines[row])))
        elif len(rows) % 2:
            failures.append(Failure(0, 0, f"{name}_left_on", 1, 0, int(trajectory.lines[rows[-1]])))
        changes = np.zeros(len(trajectory), np.int64)
        changes[rows] = np.where(states == 1, 1, -1)
        # From the word that puts it on until the word that puts it off has taken effect.
        still_on = (np.cumsum(changes) > 0) | (_held(trajectory, on, off, delay) > HELD)
        for what, blocks in (("rapid", trajectory.kinds == Kind.RAPID), ("stop", trajectory.events == Event.STOP)):
            if np.any(still_on & blocks):
                row = int(np.argmax(still_on & blocks))
                failures.append(Failure(0, 0, f"{what}_with_{name}_on", 1, 0, int(trajectory.lines[row])))
    return failures


def _held(trajectory: Trajectory, on: Event, off: Event, delay: float) -> Floats:
    """Share (n,) of each block's time during which a switch is on, its words taking effect `delay` ms later."""
    times = np.sort(np.concatenate([trajectory.times[trajectory.events == event] for event in (on, off)]))
    # What is left on is on to the end.
    times = np.append(times, trajectory.duration)[: len(times) + len(times) % 2] + delay * 1e-3
    if not len(times):
        return np.zeros(len(trajectory))
    spent = np.cumsum(np.diff(times) * (np.arange(len(times) - 1) % 2 == 0))
    until = np.interp(trajectory.times, times, np.append(0.0, spent))
    shares: Floats = np.diff(until, prepend=0.0) / np.where(trajectory.durations > 0.0, trajectory.durations, 1.0)
    return shares


class _CourseSpline:
    """A course's curve as a B-spline: not-a-knot over arc length, 2 points a line, 3 a parabola.

    Before its start it is its start and beyond its end its end: a cubic has nothing to say out there.
    """

    def __init__(self, path: Toolpath) -> None:
        self.path = path
        self.knots = path.arc_lengths - path.arc_lengths[0]
        self.length = float(self.knots[-1])
        degree = min(3, len(self.knots) - 1)
        self._spline = make_interp_spline(self.knots, np.hstack([path.points, path.normals]), degree)
        self._slopes = BSpline(self._spline.t, self._spline.c[:, :3], degree).derivative()

    def at(self, arc_lengths: Floats) -> Floats:
        """Points and normals (n, 6), the latter of any length, at (n,) arc lengths in metres."""
        values: Floats = self._spline(np.clip(arc_lengths, 0.0, self.length))
        return values

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Tangents (n, 3) of about unit length at (n,) arc lengths in metres."""
        slopes: Floats = self._slopes(np.clip(arc_lengths, 0.0, self.length))
        return slopes

    def point(self, arc_length: float) -> int:
        """Number (from 1) of the file's point nearest to an arc length in metres; 0 for NaN."""
        return 0 if np.isnan(arc_length) else int(np.argmin(np.abs(self.knots - arc_length))) + 1


_NO_TAPE = TapeLedger((), (), 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class _CourseSplines:
    """Curves of several courses, each with the rows of the samples along it; one after the other they are all rows."""

    courses: Sequence[tuple[_CourseSpline, slice]]

    def at(self, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, unit normals and unit tangents, (n, 3) each, at (n,) arc lengths in metres."""
        values = np.concatenate([curve.at(arc_lengths[rows]) for curve, rows in self.courses])
        return values[:, :3], _unit(values[:, 3:]), _unit(self.slopes(arc_lengths))

    def slopes(self, arc_lengths: Floats) -> Floats:
        """Tangents (n, 3) of about unit length at (n,) arc lengths in metres."""
        return np.concatenate([curve.slopes(arc_lengths[rows]) for curve, rows in self.courses])

    def under_nip(self, u: Floats, normals: Floats, headings: Floats, radius: float) -> tuple[Floats, Floats]:
        """Arc length (n,) at the nip by the tape fed since the course's start, and the nip's angle (n,) on the roller.

        The tape fed is u = s - R beta(s) beside a constant, and beta is measured between the head and the course's
        tangent at s: solved for s by secants.

        Args:
            u: (n,) metres.
            normals: (n, 3) head normals, unit.
            headings: (n, 3) headings, unit.
            radius: of the roller that the tape is wrapped round, metres; 0 where the wrap is not compensated.
        """

        def wrap(arc_lengths: Floats) -> Floats:
            slopes = self.slopes(arc_lengths)
            angles: Floats = np.arctan2(_dot(slopes, normals), _dot(slopes, headings))
            return angles

        starts = np.repeat(
            [rows.start for _, rows in self.courses], [rows.stop - rows.start for _, rows in self.courses]
        )
        fed = u - u[starts]
        wraps = wrap(fed)
        if radius == 0.0:
            return fed, wraps
        # At its first sample a course is at its start, where no tape is fed.
        start = wraps[starts]
        before, residual_before = fed, radius * (start - wraps)
        arc_lengths = fed - residual_before
        for _ in range(50):
            wraps = wrap(arc_lengths)
            residual = arc_lengths - fed - radius * (wraps - start)
            if np.all(np.abs(residual) <= STATION_ACCURACY):
                return arc_lengths, wraps
            change = residual - residual_before
            slope = np.where(change != 0.0, (arc_lengths - before) / np.where(change != 0.0, change, 1.0), 1.0)
            before, residual_before = arc_lengths, residual
            arc_lengths = arc_lengths - residual * np.clip(slope, 0.1, 10.0)
        return np.where(np.abs(residual) <= STATION_ACCURACY, arc_lengths, np.nan), wraps


def _dot(left: Floats, right: Floats) -> Floats:
    products: Floats = np.einsum("ij,ij->i", left, right)
    return products


def _unit(vectors: Floats) -> Floats:
    return vectors / np.sqrt(_dot(vectors, vectors))[:, None]
