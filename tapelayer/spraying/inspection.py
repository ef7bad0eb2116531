"""Inspection: a spraying trajectory against its passes and the facets, through Pinocchio on the URDF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.facets import distances_to
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plan_coverage import PlanCoverage
from tapelayer.geometry.polyline import along
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import at_reach
from tapelayer.motion.trajectory import MOTIONS, Event, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.spraying.arc_runs import ArcRun, RunSamples, arc_on, arc_runs_of, lengths_of, stops_of
from tapelayer.spraying.evidence import MeasuredSplit, SprayEvidence, SpraySamples
from tapelayer.spraying.limits import limits_of
from tapelayer.spraying.passes import NO_FACET, Pass, Split
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM
from tapelayer.vectors import dot
from tapelayer.verification.axis_use import FEED_DIGITS
from tapelayer.verification.breach import Breach
from tapelayer.verification.failures import Failure
from tapelayer.verification.inspection import Judge
from tapelayer.verification.stated_axes import unknown_blocks
from tapelayer.verification.switching import Switch, interrupted, still_on, unpaired

AIR, ARC = Switch("air", Event.AIR_ON, Event.AIR_OFF), Switch("arc", Event.ARC_ON, Event.ARC_OFF)
# A point this close to the end of a facet, in metres, is on the next facet as well.
AT_EDGE = 2e-6
# Rounded digits change the length of a block, and with it the speed that is held, by no more than this share.
HELD_DOUBT = 0.01
# A split this close to a planned one, in metres, is the planned one.
SAME_SPLIT = 1e-3


class SprayInspector(Judge[SprayEvidence]):
    """Judge of trajectories for the passes of a job and the surface under them.

    Args:
        passes: the passes to be sprayed, in `machine`.
        splits: where the plan switches the arc off inside a pass; only their reasons are used.
        mesh: the surface in `machine`.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
        rule: how the control turns blocks into motion; without it every speed is reached at once.
    """

    OF, FRAMES, ROUNDED = "pass", ("P", "gun"), 2.0

    def __init__(
        self,
        passes: Sequence[Pass],
        splits: Sequence[Split],
        mesh: Mesh,
        setup: SpraySetup,
        machine: Machine,
        rule: Rule | None = None,
    ) -> None:
        axes, numbers = [machine.axis(name) for name in AXES], [one.path.number for one in passes]
        super().__init__(machine, axes, numbers, limits_of(setup), rule or Rule())
        self.passes, self.splits, self.mesh, self.setup = passes, splits, mesh, setup
        self.normals, self.triangles = mesh.upward_normals, mesh.vertices[mesh.facets]
        self.outline = PlanCoverage(mesh)
        self.slack = setup.verification.max_position_error_mm * MM

    def judge(self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent) -> SprayEvidence:
        """Return the evidence on a trajectory, failures included; arguments as `verify`."""
        digits, unknown = self._digits(resolution), unknown_blocks(trajectory)
        failures = [self._at_line(trajectory, breach) for breach in unknown]
        failures += [self._at_block(trajectory, breach) for breach in self._switching(trajectory)]
        # Nothing can be measured on a program that does not state its position and time.
        runs = [] if unknown else arc_runs_of(trajectory)
        failures += self._astray(trajectory)
        measured: list[SpraySamples] = []
        splits: list[MeasuredSplit] = []
        before: ArcRun | None = None
        by_pass: dict[int, list[ArcRun]] = {}
        for run in runs:
            by_pass.setdefault(run.index, []).append(run)
        for index, one in enumerate(self.passes):
            samples, failed = self._pass(trajectory, index, by_pass.get(index, []), len(measured), before)
            measured += samples
            failures += failed
            before = by_pass[index][-1] if index in by_pass else None
            for part in samples[1:]:
                x, y, z = part.points[0].tolist()
                number = one.path.number
                splits.append(MeasuredSplit(number, (x, y, z), self._reason(number, part.points[0])))
            tick()
        joined = SpraySamples.joined(measured)
        distance, misplaced = self._arc_beside_part(joined)
        spraying = np.concatenate([run.blocks for run in runs]) if runs else np.zeros(0, np.int64)
        last = [*self._speeds(trajectory, spraying, digits), *misplaced]
        motions = np.isin(trajectory.kinds, MOTIONS)
        return SprayEvidence(
            passes=len(self.passes),
            points=sum(len(one.path.points) for one in self.passes),
            layers=max((one.layer for one in self.passes), default=0),
            sprayed_length=float(np.sum(lengths_of(trajectory, spraying))),
            arc_time=float(np.sum(trajectory.durations[spraying])),
            stops=stops_of(trajectory),
            splits=tuple(splits),
            crease_length=float(sum(np.sum(one.exempt[:, 1] - one.exempt[:, 0]) for one in self.passes)),
            greatest_arc_distance=distance,
            samples=joined,
            **vars(self._findings(trajectory, digits, failures, last, motions)),
        )

    def _pass(
        self,
        trajectory: Trajectory,
        index: int,
        runs: Sequence[ArcRun],
        first_piece: int,
        before: ArcRun | None,
    ) -> tuple[list[SpraySamples], list[Failure]]:
        """Return the samples of one pass, a table for each arc run, and its failures."""
        planned = self.passes[index]
        number, length = planned.path.number, float(planned.path.arc_lengths[-1])
        if not runs:
            return [], [self._failure(number, 0, "sprayed_length_mm", 0.0, length / MM)]
        parts, failures = [], []
        sprayed = 0.0
        for row, run in enumerate(runs):
            samples, blocks = self._arc_run(trajectory, run, first_piece + row, before if row == 0 else None)
            parts.append(samples)
            failures += self._judged(trajectory, planned, samples, blocks)
            line = int(trajectory.lines[run.blocks[0]])
            begin, end = float(samples.arc_lengths[0]), float(samples.arc_lengths[-1])
            if run.linked and row == 0:
                begin = max(begin, 0.0)
            # If no pose serves two consecutive points, a split leaves the path between them unsprayed.
            permitted = self.setup.spray.max_point_spacing_mm * MM if row else 0.0
            if not -self.slack <= begin - sprayed <= permitted + self.slack:
                failures.append(
                    self._failure(number, 0, "not_sprayed_mm", (begin - sprayed) / MM, permitted / MM, line)
                )
            sprayed = end
        if not abs(length - sprayed) <= self.slack:
            line = int(trajectory.lines[runs[-1].blocks[-1]])
            failures.append(self._failure(number, 0, "not_sprayed_mm", (length - sprayed) / MM, 0.0, line))
        return parts, failures

    def _arc_run(
        self, trajectory: Trajectory, run: ArcRun, piece: int, before: ArcRun | None
    ) -> tuple[SpraySamples, Ints]:
        """Return the samples of an arc run, and the block (n,) of each."""
        planned = self.passes[run.index]
        sampled = RunSamples.of(trajectory, run.blocks)
        points, axes = self._gun(sampled.joints)
        places, path = planned.path.arc_lengths, planned.path.points
        if run.linked and before is not None and before.index == run.index - 1:
            start = self.passes[before.index].path.points[-1]
            away = float(np.linalg.norm(path[0] - start))
            if away > 0.0:
                places, path = np.append(-away, places), np.vstack([start, path])
        arcs, errors = along(path, places, points)
        facets = np.stack([_facets_at(planned, arcs - AT_EDGE), _facets_at(planned, arcs + AT_EDGE)])
        deviations, distances = np.full((2, len(arcs)), np.nan), np.full((2, len(arcs)), np.nan)
        for side in range(2):
            on = np.flatnonzero(facets[side] != NO_FACET)
            under = facets[side, on]
            cosine = dot(axes[on], self.normals[under])
            sine = np.linalg.norm(np.cross(axes[on], self.normals[under]), axis=1)
            deviations[side, on] = np.arctan2(sine, cosine)
            distances[side, on] = distances_to(self.triangles[under], points[on])
        low, high = planned.exempt.T
        exempt = np.searchsorted(low, arcs + AT_EDGE, "right") > np.searchsorted(high, arcs - AT_EDGE)
        samples = SpraySamples(
            passes=np.full(len(arcs), run.index),
            pieces=np.full(len(arcs), piece),
            arc_lengths=arcs,
            times=sampled.times,
            asked=sampled.asked,
            speeds=sampled.speeds,
            points=points,
            axes=axes,
            position_errors=errors,
            surface_distances=np.fmin(*distances),
            deviations=np.fmax(*deviations),
            exempt=exempt,
        )
        return samples, sampled.blocks

    def _gun(self, joints: Floats) -> tuple[Floats, Floats]:
        """Return P (n, 3) in metres and the gun's axis (n, 3), by the model, for values (n, 5) of `AXES`."""
        pose = self.machine.columns(self._configurations(joints), "P")
        points = np.stack(np.broadcast_arrays(*pose.translation), axis=1)
        axes = np.stack(np.broadcast_arrays(*(row[2] for row in pose.rotation), joints[:, 0])[:3], axis=1)
        return points, axes

    def _configurations(self, joints: Floats) -> Floats:
        """Return the values (n, k) of all axes of the machine, including the standoff."""
        values = np.zeros((len(joints), len(self.machine.axes)))
        values[:, [self.machine.column(name) for name in AXES]] = joints
        values[:, self.machine.column("standoff")] = self.setup.standoff
        return values

    def _judged(self, trajectory: Trajectory, planned: Pass, samples: SpraySamples, blocks: Ints) -> list[Failure]:
        """Return the worst place of an arc run for each limit exceeded; NaN exceeds a limit wherever it is judged."""
        chord = self.setup.spray.chord_tolerance_mm
        limit = self.setup.spray.max_deviation_deg
        deviations = np.where(samples.exempt, np.nan, samples.deviations)
        backwards = np.maximum.accumulate(samples.arc_lengths) - samples.arc_lengths
        errors = samples.position_errors
        judged = (
            ("position_error_mm", errors / MM, self.slack / MM, np.ones(len(errors), np.bool_)),
            (
                "surface_distance_mm",
                samples.surface_distances / MM,
                chord + self.slack / MM,
                ~np.isnan(samples.surface_distances),
            ),
            ("deviation_deg", deviations / DEG, limit, ~np.isnan(deviations)),
            ("run_back_mm", backwards / MM, self.slack / MM, np.ones(len(errors), np.bool_)),
        )
        failures = []
        for what, values, most, counted in judged:
            kept = ~counted | (values <= most)
            if not np.all(kept):
                worst = int(np.argmax(np.where(kept, -np.inf, np.nan_to_num(values, nan=np.inf))))
                point = int(np.argmin(np.abs(planned.path.arc_lengths - samples.arc_lengths[worst]))) + 1
                line = int(trajectory.lines[blocks[worst]])
                failures.append(self._failure(planned.path.number, point, what, float(values[worst]), most, line))
        return failures

    def _arc_beside_part(self, samples: SpraySamples) -> tuple[float, list[Failure]]:
        """Return the largest distance of the lit arc from the part in plan, and a failure where it is too large."""
        limit = (self.setup.spray.overrun_mm + self.setup.spray.max_gap_mm / 2) * MM + self.slack
        off = np.flatnonzero(np.isnan(samples.deviations))
        if not len(off):
            return 0.0, []
        distances = self.outline.distances(samples.points[off, :2], limit)
        worst = int(np.argmax(np.nan_to_num(distances, nan=np.inf)))
        if distances[worst] <= limit:
            return float(distances[worst]), []
        number = self.passes[int(samples.passes[off[worst]])].path.number
        failure = self._failure(number, 0, "arc_beside_part_mm", float(distances[worst]) / MM, limit / MM)
        return float(distances[worst]), [failure]

    def _reason(self, number: int, point: Floats) -> str:
        """Return why the plan splits a pass at a point (3,); empty if it does not."""
        for split in self.splits:
            if split.number == number and np.linalg.norm(point - split.point) <= SAME_SPLIT:
                return str(split.reason)
        return ""

    def _switching(self, trajectory: Trajectory) -> list[Breach]:
        """Return unpaired words, interruptions with the arc on, and an arc without air or too soon after it."""
        breaches = [*unpaired(trajectory, AIR), *unpaired(trajectory, ARC)]
        breaches += interrupted(trajectory, ARC, ("rapid", "pause", "stop"))
        airless = np.flatnonzero(still_on(trajectory, ARC) & ~still_on(trajectory, AIR))
        breaches += [Breach(row, "arc_on_without_air", 1, 0) for row in airless[:1].tolist()]
        lead = self.setup.process.air_lead_s
        for row in np.flatnonzero(trajectory.events == Event.ARC_ON).tolist():
            air = np.flatnonzero(trajectory.events[:row] == Event.AIR_ON)
            since = trajectory.times[row] - trajectory.times[air[-1]] if len(air) else 0.0
            if not since >= lead - 1e-6:
                breaches.append(Breach(row, "air_lead_s", since, lead))
        return breaches

    def _astray(self, trajectory: Trajectory) -> list[Failure]:
        """Return the first motion with the arc on that is in no pass of the part, or in a pass out of order."""
        spraying = np.flatnonzero(arc_on(trajectory))
        passes = trajectory.courses[spraying]
        wrong = (passes < 0) | (passes >= len(self.passes)) | (np.diff(passes, prepend=passes[:1]) < 0)
        if not np.any(wrong):
            return []
        row = int(np.argmax(wrong))
        return [self._at_block(trajectory, Breach(int(spraying[row]), "pass", int(passes[row]) + 1, len(self.passes)))]

    def _speeds(self, trajectory: Trajectory, spraying: Ints, digits: Floats) -> list[Failure]:
        """Return blocks whose words ask for too much, for less than axes and control can do, or turn theta too far."""
        begins, ends = trajectory.begins(spraying), trajectory.positions[spraying]
        steps, spans = np.abs(ends - begins), trajectory.requested[spraying]
        lengths, speed = lengths_of(trajectory, spraying), self.setup.speed
        digit = 2 * float(np.max(digits[:3]))
        limits = np.array([axis.speed for axis in self.axes])
        with np.errstate(divide="ignore", invalid="ignore"):
            accelerations = lengths / np.max(steps / np.array([axis.acceleration for axis in self.axes]), axis=1)
            held = np.nan_to_num(lengths / self.rule.held(lengths, accelerations))
        needed = np.maximum(lengths / speed, np.max(steps / limits, axis=1, initial=0.0))
        # A block too short to be written adds its time to the next one.
        slack = 2 * digit / speed + np.max(2 * digits / limits) + needed * FEED_DIGITS
        asked = np.full(len(trajectory), np.inf)
        asked[spraying] = needed
        reached = at_reach(trajectory, asked, self._axis_limits, self.rule)[spraying]
        slowest = np.maximum(needed, np.maximum(held, np.where(reached > needed, reached, 0.0)) * (1.0 + HELD_DOUBT))
        theta = steps[:, AXES.index("theta")] / DEG
        failures = []
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = lengths / spans / MM
        for what, wrong, values, limit in (
            ("gun_speed_mm_per_s", ~(spans >= needed - slack) & (lengths > digit), speeds, speed / MM),
            ("slow_gun_speed_mm_per_s", ~(spans <= slowest + slack), speeds, speed / MM),
            ("theta_step_deg", ~(theta <= self.setup.verification.max_theta_step_deg), theta,
             self.setup.verification.max_theta_step_deg),
        ):  # fmt: skip
            if np.any(wrong):
                row = int(np.argmax(wrong))
                failures.append(self._at_block(trajectory, Breach(int(spraying[row]), what, float(values[row]), limit)))
        return failures


def _facets_at(planned: Pass, arcs: Floats) -> Ints:
    """Return the facet (n,) under a pass at arc lengths (n,), `NO_FACET` beyond its ends and on the link to it."""
    row = np.searchsorted(planned.bounds, arcs, "right") - 1
    inside = (row >= 0) & (row < len(planned.facets))
    return np.where(inside, planned.facets[np.clip(row, 0, len(planned.facets) - 1)], NO_FACET)
