"""Inspection: a tape-laying trajectory against its courses, through Pinocchio on the URDF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.courses.course import Course
from tapelayer.laying.course_splines import CourseSpline, CourseSplines
from tapelayer.laying.cut_check import judge_cuts
from tapelayer.laying.evidence import Evidence, Samples, TapeLedger
from tapelayer.laying.heat_check import MOMENTS, heated_too_long
from tapelayer.laying.laid import Case, Laid
from tapelayer.laying.limits import limits_of
from tapelayer.laying.link_check import judge_sequence
from tapelayer.laying.placing import courses_in_machine
from tapelayer.laying.sampling import LAID_SAMPLE_STEP, Laying, SamplePlaces, layings_of
from tapelayer.laying.settings import DelaySettings, Setup
from tapelayer.machines import gantry
from tapelayer.machines.machine import CHUNK, Machine
from tapelayer.motion.corners import Rule
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.units import DEG, MM
from tapelayer.vectors import dot, unit
from tapelayer.verification.breach import Breach
from tapelayer.verification.failures import Failure
from tapelayer.verification.inspection import Judge
from tapelayer.verification.sampling import LEAST_SAMPLES
from tapelayer.verification.stated_axes import unknown_blocks
from tapelayer.verification.switching import Switch, held, interrupted, unpaired
from tapelayer.verification.verified import Verified

# Within a block that is straight in joint space, the nip's speed varies by less than this share.
NIP_SPEED_MARGIN = 0.01
# Rounded feeds shift a switch against the motion by microseconds: tape that runs back no farther counts as at rest.
RUN_BACK = 1e-6
# Shorter steps of the tape, in metres, tell nothing of how the nip moves over the surface with it.
LEAST_STEP = 1e-6
_NO_TAPE = TapeLedger((), (), (), 0.0, 0.0, 0.0, 0.0)


def verify(
    trajectory: Trajectory,
    courses: Sequence[Course],
    setup: Setup,
    machine: Machine,
    resolution: Floats | None = None,
) -> Verified[Evidence]:
    """Return the verified trajectory, or raise its failures.

    Args:
        trajectory: planned, or read back from a program.
        courses: the courses to be laid, in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        resolution: (k,) last written digit of each axis in metres and radians, for a program read back; its feeds are
            computed from rounded end points, so a speed may exceed its limit by one digit per block.

    Raises:
        VerificationFailed: there are failures; the exception holds the evidence.
    """
    return Inspector(courses, setup, machine).verify(trajectory, resolution)


class Inspector(Judge[Evidence]):
    """Judge of trajectories for the courses of a job.

    The courses' curves are B-splines here, so that the planner's piecewise polynomials do not judge themselves.

    Args:
        courses: in the part's frame.
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        rule: how the control turns blocks into motion; without it every speed is reached at once.
    """

    OF, FRAMES, ROUNDED = "course", ("roller",), 1.0

    def __init__(self, courses: Sequence[Course], setup: Setup, machine: Machine, rule: Rule | None = None) -> None:
        self.setup, self.courses = setup, courses
        self.curves = [CourseSpline(path) for path in courses_in_machine(courses, setup)]
        numbers = [curve.path.number for curve in self.curves]
        super().__init__(machine, machine.axes, numbers, limits_of(setup), rule or Rule())
        self.highest = max(float(np.max(curve.path.points[:, 2])) for curve in self.curves)
        self.roller_radius = gantry.lengths(machine).radius
        self.wrap_radius = self.roller_radius if setup.head.wrap_compensation else 0.0
        self._slides = [machine.column(name) for name in "xyz"]
        self.published = setup.process.kinematics == "published"

    def judge(self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent) -> Evidence:
        """Return the evidence on a trajectory, failures included; arguments as `verify`."""
        digits = self._digits(resolution)
        layings = layings_of(trajectory, self.setup)
        unknown = unknown_blocks(trajectory)
        breaches = [*(_first_motion(trajectory) or unknown)]
        for switch in _switches(self.setup.head.delays_ms).values():
            breaches += [*unpaired(trajectory, switch), *interrupted(trajectory, switch, ("rapid", "stop"))]
        failures = [self._at_line(trajectory, breach) for breach in breaches]
        failures += self._number_of_courses(trajectory, layings)
        if unknown:
            # Nothing can be measured on a program that does not state its position and time.
            layings = []
        taken_back, feeding = self._feeding(trajectory, layings)
        samples, blocks, laid = self._measured(trajectory, layings[: len(self.curves)], tick)
        failures += self._judged(trajectory, samples, blocks, digits, self._heated(trajectory, layings)[blocks])
        tape, clearance = _NO_TAPE, np.inf
        if laid:
            case = Case(trajectory, laid, samples, self.highest, self.setup, self.machine, digits)
            tape, cutting = judge_cuts(case)
            clearance, sequence = judge_sequence(case)
            failures += [*cutting, *sequence]
        return Evidence(
            courses=len(self.curves),
            points=sum(len(curve.path.points) for curve in self.curves),
            laid_length=sum(curve.length for curve in self.curves),
            tape_taken_back=taken_back,
            least_link_clearance=clearance,
            samples=samples,
            lay_speed=self.setup.process.lay_speed_mm_per_s * MM,
            tape_width=self.setup.tape.width_mm * MM,
            roller_radius=self.roller_radius,
            tape=tape,
            **vars(self._findings(trajectory, digits, failures, feeding)),
        )

    def _number_of_courses(self, trajectory: Trajectory, layings: Sequence[Laying]) -> list[Failure]:
        if len(layings) == len(self.curves):
            return []
        block = layings[len(self.curves)].first if len(layings) > len(self.curves) else -1
        line = int(trajectory.lines[block])
        return [Failure(0, 0, "courses_laid", len(layings), len(self.curves), line)]

    def _measured(
        self, trajectory: Trajectory, layings: Sequence[Laying], tick: Tick
    ) -> tuple[Samples, Ints, list[Laid]]:
        """Return the samples along the courses laid, the block (n,) of each, and the courses' places on the tape."""
        parts, blocks, laid = [], [np.zeros(0, np.int64)], []
        for batch in self._batches(layings):
            places = SamplePlaces.along(trajectory, layings, batch)
            fed = places.joints[:, trajectory.column("u")]
            samples = self._samples(places, fed)
            parts.append(samples)
            blocks.append(places.blocks)
            stations = fed + self.wrap_radius * samples.wraps - self.setup.head.knife_to_nip_mm * MM
            for index in batch.tolist():
                laid.append(self._laid(index, layings[index], float(stations[places.rows(index).start])))
                tick()
        return Samples.joined(parts), np.concatenate(blocks), laid

    def _batches(self, layings: Sequence[Laying]) -> list[Ints]:
        """Return the indices of the courses in each batch, small enough for its arrays to stay in the cache."""
        sizes = [
            LEAST_SAMPLES * (laying.last - laying.first) + curve.length / LAID_SAMPLE_STEP
            for laying, curve in zip(layings, self.curves, strict=False)
        ]
        borders = np.flatnonzero(np.diff(np.cumsum(sizes) // CHUNK)) + 1
        return np.split(np.arange(len(sizes)), borders) if sizes else []

    def _laid(self, index: int, laying: Laying, station: float) -> Laid:
        curve = self.curves[index]
        return Laid(
            number=curve.path.number,
            points=len(curve.knots),
            cut_angles=self.courses[index].cut_angles,
            length=curve.length,
            station=station,
            begin=laying.begin,
            end=laying.end,
            out=unit(curve.slopes(curve.knots[-1:]))[0],
        )

    def _samples(self, places: SamplePlaces, fed: Floats) -> Samples:
        """Return the samples of some courses at places (n,), with the tape fed (n,) there in metres."""
        pose = self.machine.columns(places.joints, "roller")
        centre = np.stack(np.broadcast_arrays(*pose.translation), axis=1)
        heading, left, normal = (
            np.stack(np.broadcast_arrays(*(row[i] for row in pose.rotation)), axis=1) for i in range(3)
        )
        axis = -left
        curves = CourseSplines(
            [(self.curves[index], places.rows(index)) for index in np.unique(places.courses).tolist()]
        )
        arc_lengths, wraps = curves.under_nip(fed, normal, heading, self.wrap_radius)
        points, normals, tangents = curves.at(arc_lengths)

        square = unit(np.cross(tangents, normals))
        ahead = np.cross(normals, square)
        exact = points + self.roller_radius * normals
        offset = centre - exact
        error = centre - self.roller_radius * normal - points if self.published else offset
        return Samples(
            courses=places.courses,
            arc_lengths=arc_lengths,
            times=places.times,
            asked=places.asked,
            speeds=places.feeds * _ratios(arc_lengths, fed, places.courses),
            nips=points,
            normal_errors=dot(error, normals),
            lateral_errors=dot(error, square),
            tape_errors=dot(error, tangents),
            tilts=np.arcsin(np.clip(dot(axis, normals), -1.0, 1.0)),
            heading_errors=np.arctan2(dot(axis, ahead), dot(axis, square)),
            pitches=np.arctan2(dot(normals, heading), dot(normals, normal)),
            wraps=wraps,
            offsets=np.sqrt(dot(offset, offset)),
            block_ends=places.ends,
        )

    @property
    def _longest_heated(self) -> float:
        """Seconds by which tape may be heated longer than it must be."""
        return self.setup.head.heater_stop_s + MOMENTS

    def _heated(self, trajectory: Trajectory, layings: Sequence[Laying]) -> Floats:
        """Return the seconds (n,) by which the tape up to each block's end is heated longer than it must be."""
        heater = _switches(self.setup.head.delays_ms)["heater"]
        speed = self.setup.process.lay_speed_mm_per_s * MM
        return heated_too_long(trajectory, layings, heater, speed, self._axis_limits, self.rule, self._longest_heated)

    def _judged(
        self, trajectory: Trajectory, samples: Samples, blocks: Ints, digits: Floats, heated: Floats
    ) -> list[Failure]:
        """Return the failures of the samples, course by course.

        Args:
            trajectory: as `judge`.
            samples: along the courses.
            blocks: (n,) block of each sample.
            digits: (k,) last written digit of each axis, metres and radians.
            heated: (n,) seconds by which the tape is heated too long, at each sample.
        """
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
        # The tape fed gives the nip's position only to within the tolerance that blocks are laid out for.
        doubt = 2 * float(np.max(digits[self._slides])) + self.setup.process.tolerance_mm * MM
        speeds = self._lay_speeds(trajectory, samples, blocks, doubt)
        lay_speed = self.setup.process.lay_speed_mm_per_s * (1 + NIP_SPEED_MARGIN)
        judged.append(("lay_speed_mm_per_s", speeds / MM, lay_speed))
        judged.append(("heater_time_s", heated, self._longest_heated))
        worst = []
        for what, values, limit in judged:
            for row in _worst(samples.courses, values, limit).tolist():
                worst.append((row, what, float(values[row]), limit))
        for row in np.append(np.flatnonzero(np.diff(samples.courses)), len(blocks) - 1).tolist():
            end, length = float(samples.arc_lengths[row]), self.curves[samples.courses[row]].length
            if not abs(end - length) / MM <= limits.max_tape_error_mm:
                worst.append((row, "laid_length_mm", end / MM, length / MM))
        failures = []
        for row, what, value, limit in sorted(worst, key=lambda failure: int(samples.courses[failure[0]])):
            curve = self.curves[samples.courses[row]]
            point = curve.point(float(samples.arc_lengths[row]))
            failures.append(Failure(curve.path.number, point, what, value, limit, int(trajectory.lines[blocks[row]])))
        return failures

    @staticmethod
    def _lay_speeds(trajectory: Trajectory, samples: Samples, blocks: Ints, doubt: float) -> Floats:
        """Return the speed (n,) in m/s that words ask of the nip in each block, less `doubt` metres, at its end."""
        ends = np.flatnonzero(samples.block_ends)
        rows, u = blocks[ends], trajectory.column("u")
        shares = trajectory.fractions(rows, samples.times[ends])
        # Words ask for the way between programmed ends, not for what is left of it where both are rounded off.
        rounded = (trajectory.within(rows, shares) - trajectory.rounded(rows, shares))[:, u]
        distances, spans = np.diff(samples.arc_lengths[ends] + rounded), np.diff(samples.asked[ends])
        going = (np.diff(samples.courses[ends]) == 0) & (distances > 0.0)
        speeds = np.zeros(len(samples.times))
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds[ends[1:]] = np.where(going, (distances - doubt) / spans, 0.0)
        return speeds

    def _feeding(self, trajectory: Trajectory, layings: Sequence[Laying]) -> tuple[float, list[Failure]]:
        """Return the longest backward run of the tape in metres, and failures of how it runs back or is fed.

        It must not run back under a shoe or knife, nor between courses farther than to the start of the next one, nor
        be fed along a course with the shoe up.
        """
        u = trajectory.column("u")
        rows = np.arange(len(trajectory))
        steps = np.nan_to_num(trajectory.positions[:, u] - trajectory.begins(rows)[:, u])
        breaches = []
        switches = _switches(self.setup.head.delays_ms)
        back = steps * np.max([held(trajectory, switches[name]) for name in ("shoe", "knife_1", "knife_2")], axis=0)
        row = int(np.argmin(back))
        if not back[row] >= -RUN_BACK:
            breaches.append(Breach(row, "tape_run_back_mm", -back[row] / MM, 0.0))
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
                    breaches.append(Breach(lowest, "tape_taken_back_too_far_mm", short / MM, slack / MM))
        moving = np.any(trajectory.positions[:, self._slides] != trajectory.begins(rows)[:, self._slides], axis=1) & (
            steps > slack
        )
        astray = free & moving & (trajectory.kinds == Kind.LINEAR)
        if np.any(astray):
            row = int(np.argmax(astray))
            breaches.append(Breach(row, "laid_with_shoe_up_mm", steps[row] / MM, 0.0))
        supply = np.flatnonzero(trajectory.events == Event.SUPPLY_MODE)
        first_feed = int(np.argmax(steps != 0.0)) if np.any(steps != 0.0) else len(trajectory)
        if len(supply) != 1 or supply[0] > first_feed:
            row = int(supply[-1]) if len(supply) else min(first_feed, len(trajectory) - 1)
            breaches.append(Breach(row, "supply_mode_before_feed", len(supply[supply < first_feed]), 1))
        return float(np.max(-steps, initial=0.0)), [self._at_block(trajectory, breach) for breach in breaches]


def _worst(courses: Ints, values: Floats, limit: float) -> Ints:
    """Return the row of the worst value (n,) of each course, by rising course indices (n,), that exceeds a limit.

    NaN exceeds every limit and is the worst.
    """
    off = np.flatnonzero(~(values <= limit))
    worst = np.where(np.isnan(values[off]), np.inf, values[off])
    order = np.lexsort([-worst, courses[off]])
    return off[order][np.diff(courses[off][order], prepend=-1) > 0]


def _first_motion(trajectory: Trajectory) -> list[Breach]:
    """Return a breach if the first motion states more axes than z."""
    known = ~np.isnan(trajectory.positions)
    first = int(np.argmax(np.any(known, axis=1)))
    stated = int(known[first].sum())
    return [Breach(first, "first_motion_axes", stated, 1)] if stated > known[first, trajectory.column("z")] else []


def _switches(delays: DelaySettings) -> dict[str, Switch]:
    """Return the switches of the head by name."""
    switches = (
        Switch("shoe", Event.SHOE_DOWN, Event.SHOE_UP, delays.shoe),
        Switch("auxiliary_roller", Event.ROLLER_DOWN, Event.ROLLER_UP, delays.roller),
        Switch("heater", Event.HEATER_ON, Event.HEATER_OFF, delays.heater),
        Switch("knife_1", Event.KNIFE_1_DOWN, Event.KNIFE_1_UP, delays.knife),
        Switch("knife_2", Event.KNIFE_2_DOWN, Event.KNIFE_2_UP, delays.knife),
    )
    return {switch.name: switch for switch in switches}


def _ratios(arc_lengths: Floats, fed: Floats, courses: Ints) -> Floats:
    """Return how far (n,) the nip moves over the surface per tape fed: where the surface bends, it moves on the roller.

    Args:
        arc_lengths: (n,) metres along the course.
        fed: (n,) tape, metres.
        courses: (n,) index of the course.
    """
    steps = np.diff(fed)
    fine = (np.diff(courses) == 0) & (steps > LEAST_STEP)
    ratios = np.divide(np.diff(arc_lengths), steps, out=np.zeros(len(steps)), where=fine)
    sums = np.append(ratios, 0.0) + np.append(0.0, ratios)
    counts = np.append(fine, False).astype(np.float64) + np.append(False, fine)
    return np.where(counts > 0.0, sums / np.maximum(counts, 1.0), 1.0)
