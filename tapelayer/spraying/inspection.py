"""Verification of spraying: a trajectory against its passes and the facets, through Pinocchio on the URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.geometry.facets import distances_to
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.plan_coverage import PlanCoverage
from tapelayer.geometry.polyline import along
from tapelayer.machines.machine import Machine
from tapelayer.machines.wrist import AXES
from tapelayer.motion.trajectory import MOTIONS, Event, Kind, Trajectory
from tapelayer.progress import Tick, silent
from tapelayer.spraying.arc_runs import ArcRun, arc_on, arc_runs_of, sampled, ways_of
from tapelayer.spraying.evidence import SplitFound, SprayEvidence, SprayFailure, SpraySamples
from tapelayer.spraying.limits import limits_of
from tapelayer.spraying.passes import NO_FACET, Pass, Split
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM
from tapelayer.verification.axis_use import FEED_DIGITS, axes_used
from tapelayer.verification.verified import Verified

# Pinocchio itself evaluates this many block ends; of a longer program an even selection.
PINOCCHIO_BLOCKS = 20_000
PINOCCHIO_AGREEMENT = 1e-9
# A place this near to the end of a facet is on the next as well, metres.
AT_EDGE = 2e-6
# A split is one that the plan has if it is this near to it, metres.
SAME_SPLIT = 1e-3


class SprayInspector:
    """The passes of a job and the surface under them, made ready to judge trajectories by.

    Args:
        passes: what has to be sprayed, in `machine`.
        splits: where the plan lets the arc go off inside a pass: for their reasons only.
        mesh: the surface in `machine`.
        setup: the job's values.
        machine: the robot, with the setup's limits already in it.
    """

    def __init__(
        self, passes: Sequence[Pass], splits: Sequence[Split], mesh: Mesh, setup: SpraySetup, machine: Machine
    ) -> None:
        self.passes, self.splits, self.mesh, self.setup, self.machine = passes, splits, mesh, setup, machine
        self.normals, self.triangles = mesh.upward_normals, mesh.vertices[mesh.facets]
        self.outline = PlanCoverage(mesh)
        self.axes = [machine.axis(name) for name in AXES]
        self.slack = setup.verification.max_position_error_mm * MM

    def verify(
        self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent
    ) -> Verified[SprayEvidence]:
        """Verified trajectory, or the reasons why it is none.

        Args:
            trajectory: planned, or read back from a program; its axes are `spraying.AXES`.
            resolution: (5,) last written digit of each axis in metres and radians, for a program read back.
            tick: called for every pass that is done.

        Raises:
            VerificationFailed: something does not hold; its evidence tells all.
        """
        return Verified(trajectory, self.examine(trajectory, resolution, tick))

    def examine(self, trajectory: Trajectory, resolution: Floats | None = None, tick: Tick = silent) -> SprayEvidence:
        """Evidence on a trajectory, failures included; arguments as `verify`."""
        digits = np.zeros(len(AXES)) if resolution is None else resolution
        failures = [*_unstated(trajectory), *self._switching(trajectory)]
        stretches: list[ArcRun] = []
        if not any(failure.what == "unstated_axes" for failure in failures):
            # Nothing can be measured on a program that does not say where it is.
            stretches = arc_runs_of(trajectory)
        failures += self._astray(trajectory)
        measured: list[SpraySamples] = []
        splits: list[SplitFound] = []
        before: ArcRun | None = None
        by_pass: dict[int, list[ArcRun]] = {}
        for stretch in stretches:
            by_pass.setdefault(stretch.index, []).append(stretch)
        for index, found in enumerate(self.passes):
            samples, wrong = self._pass(trajectory, index, by_pass.get(index, []), len(measured), before)
            measured += samples
            failures += wrong
            before = by_pass[index][-1] if index in by_pass else None
            for part in samples[1:]:
                x, y, z = part.points[0].tolist()
                splits.append(SplitFound(found.path.number, (x, y, z), self._reason(found.path.number, part.points[0])))
            tick()
        joined = SpraySamples.joined(measured)
        distance, misplaced = self._placed(joined)
        axes, beyond = axes_used(trajectory, self.axes, digits, 2 * digits)
        disagreement = self._pinocchio(trajectory)
        if not disagreement <= PINOCCHIO_AGREEMENT:
            failures.append(SprayFailure(0, 0, "forward_disagreement_m", disagreement, PINOCCHIO_AGREEMENT))
        spraying = np.concatenate([stretch.blocks for stretch in stretches]) if stretches else np.zeros(0, np.int64)
        failures += self._speeds(trajectory, spraying, digits)
        return SprayEvidence(
            passes=len(self.passes),
            points=sum(len(found.path.points) for found in self.passes),
            layers=max((found.layer for found in self.passes), default=0),
            blocks=len(trajectory),
            sprayed_length=float(np.sum(ways_of(trajectory, spraying))),
            arc_time=float(np.sum(trajectory.durations[spraying])),
            duration=trajectory.duration,
            splits=tuple(splits),
            crease_length=float(sum(np.sum(found.exempt[:, 1] - found.exempt[:, 0]) for found in self.passes)),
            greatest_arc_distance=distance,
            forward_disagreement=disagreement,
            axes=axes,
            limits=limits_of(self.setup),
            samples=joined,
            failures=(
                *failures,
                *misplaced,
                *(self._at_block(trajectory, *astuple(found)) for found in beyond),
            ),
        )

    def _pass(
        self,
        trajectory: Trajectory,
        index: int,
        stretches: Sequence[ArcRun],
        first_piece: int,
        before: ArcRun | None,
    ) -> tuple[list[SpraySamples], list[SprayFailure]]:
        """Samples of one pass, a part for each stretch, and what is wrong with it."""
        found = self.passes[index]
        number, length = found.path.number, float(found.path.arc_lengths[-1])
        if not stretches:
            return [], [SprayFailure(number, 0, "sprayed_length_mm", 0.0, length / MM)]
        parts, failures = [], []
        reached = 0.0
        for row, stretch in enumerate(stretches):
            samples, blocks = self._stretch(trajectory, stretch, first_piece + row, before if row == 0 else None)
            parts.append(samples)
            failures += self._judged(trajectory, found, samples, blocks)
            line = int(trajectory.lines[stretch.blocks[0]])
            begin, end = float(samples.arc_lengths[0]), float(samples.arc_lengths[-1])
            if stretch.linked and row == 0:
                begin = max(begin, 0.0)
            # Where no pose serves two points, a split leaves out what is between them.
            permitted = self.setup.spray.max_point_spacing_mm * MM if row else 0.0
            if not -self.slack <= begin - reached <= permitted + self.slack:
                failures.append(SprayFailure(number, 0, "not_sprayed_mm", (begin - reached) / MM, permitted / MM, line))
            reached = end
        if not abs(length - reached) <= self.slack:
            line = int(trajectory.lines[stretches[-1].blocks[-1]])
            failures.append(SprayFailure(number, 0, "not_sprayed_mm", (length - reached) / MM, 0.0, line))
        return parts, failures

    def _stretch(
        self, trajectory: Trajectory, stretch: ArcRun, piece: int, before: ArcRun | None
    ) -> tuple[SpraySamples, Ints]:
        """Samples of a stretch, and the block (n,) of each."""
        found = self.passes[stretch.index]
        joints, times, blocks = sampled(trajectory, stretch.blocks)
        points, axes = self._gun(joints)
        places, path = found.path.arc_lengths, found.path.points
        if stretch.linked and before is not None and before.index == stretch.index - 1:
            start = self.passes[before.index].path.points[-1]
            away = float(np.linalg.norm(path[0] - start))
            if away > 0.0:
                places, path = np.append(-away, places), np.vstack([start, path])
        arcs, errors = along(path, places, points)
        facets = np.stack([_facets_at(found, arcs - AT_EDGE), _facets_at(found, arcs + AT_EDGE)])
        deviations, distances = np.full((2, len(arcs)), np.nan), np.full((2, len(arcs)), np.nan)
        for side in range(2):
            on = np.flatnonzero(facets[side] != NO_FACET)
            under = facets[side, on]
            cosine = np.einsum("ij,ij->i", axes[on], self.normals[under])
            sine = np.linalg.norm(np.cross(axes[on], self.normals[under]), axis=1)
            deviations[side, on] = np.arctan2(sine, cosine)
            distances[side, on] = distances_to(self.triangles[under], points[on])
        low, high = found.exempt.T
        exempt = np.searchsorted(low, arcs + AT_EDGE, "right") > np.searchsorted(high, arcs - AT_EDGE)
        samples = SpraySamples(
            passes=np.full(len(arcs), stretch.index),
            pieces=np.full(len(arcs), piece),
            arc_lengths=arcs,
            times=times,
            points=points,
            axes=axes,
            position_errors=errors,
            surface_distances=np.fmin(*distances),
            deviations=np.fmax(*deviations),
            exempt=exempt,
        )
        return samples, blocks

    def _gun(self, joints: Floats) -> tuple[Floats, Floats]:
        """P (n, 3) in metres and the gun's axis (n, 3), by the model, for the values (n, 5) of `AXES`."""
        pose = self.machine.columns(self._configurations(joints), "P")
        points = np.stack(np.broadcast_arrays(*pose.translation), axis=1)
        axes = np.stack(np.broadcast_arrays(*(row[2] for row in pose.rotation), joints[:, 0])[:3], axis=1)
        return points, axes

    def _configurations(self, joints: Floats) -> Floats:
        """Values (n, k) of all the machine's axes, the standoff among them."""
        values = np.zeros((len(joints), len(self.machine.axes)))
        values[:, [self.machine.column(name) for name in AXES]] = joints
        values[:, self.machine.column("standoff")] = self.setup.standoff
        return values

    def _judged(self, trajectory: Trajectory, found: Pass, samples: SpraySamples, blocks: Ints) -> list[SprayFailure]:
        """The worst place of a stretch for each limit that is not kept; NaN keeps none but where nothing is judged."""
        chord = self.setup.spray.chord_tolerance_mm
        limit = self.setup.spray.max_deviation_deg
        deviations = np.where(samples.exempt, np.nan, samples.deviations)
        backwards = np.maximum.accumulate(samples.arc_lengths) - samples.arc_lengths
        places = samples.position_errors
        judged = (
            ("position_error_mm", places / MM, self.slack / MM, np.ones(len(places), np.bool_)),
            (
                "surface_distance_mm",
                samples.surface_distances / MM,
                chord + self.slack / MM,
                ~np.isnan(samples.surface_distances),
            ),
            ("deviation_deg", deviations / DEG, limit, ~np.isnan(deviations)),
            ("run_back_mm", backwards / MM, self.slack / MM, np.ones(len(places), np.bool_)),
        )
        failures = []
        for what, values, most, counted in judged:
            kept = ~counted | (values <= most)
            if not np.all(kept):
                worst = int(np.argmax(np.where(kept, -np.inf, np.nan_to_num(values, nan=np.inf))))
                point = int(np.argmin(np.abs(found.path.arc_lengths - samples.arc_lengths[worst]))) + 1
                line = int(trajectory.lines[blocks[worst]])
                failures.append(SprayFailure(found.path.number, point, what, float(values[worst]), most, line))
        return failures

    def _placed(self, samples: SpraySamples) -> tuple[float, list[SprayFailure]]:
        """Greatest distance of the lit arc from the part in plan, and where it is too far."""
        limit = (self.setup.spray.overrun_mm + self.setup.spray.max_gap_mm / 2) * MM + self.slack
        off = np.flatnonzero(np.isnan(samples.deviations))
        if not len(off):
            return 0.0, []
        distances = self.outline.distances(samples.points[off, :2], limit)
        worst = int(np.argmax(np.nan_to_num(distances, nan=np.inf)))
        if distances[worst] <= limit:
            return float(distances[worst]), []
        number = self.passes[int(samples.passes[off[worst]])].path.number
        failure = SprayFailure(number, 0, "arc_beside_part_mm", float(distances[worst]) / MM, limit / MM)
        return float(distances[worst]), [failure]

    def _reason(self, number: int, point: Floats) -> str:
        """Why the plan splits a pass at a point (3,); empty where it does not."""
        for split in self.splits:
            if split.number == number and np.linalg.norm(point - split.point) <= SAME_SPLIT:
                return str(split.reason)
        return ""

    def _switching(self, trajectory: Trajectory) -> list[SprayFailure]:
        """Words that do not pair, rapids and pauses with the arc on, and an arc without air."""
        failures = []
        on = {}
        for name, begin, end in (("air", Event.AIR_ON, Event.AIR_OFF), ("arc", Event.ARC_ON, Event.ARC_OFF)):
            rows = np.flatnonzero((trajectory.events == begin) | (trajectory.events == end))
            states = np.where(trajectory.events[rows] == begin, 1, 0)
            wrong = np.flatnonzero(states != (np.arange(len(rows)) + 1) % 2)
            if len(wrong):
                failures.append(self._at_block(trajectory, int(rows[wrong[0]]), f"{name}_switched_again", 1, 0))
            elif len(rows) % 2:
                failures.append(self._at_block(trajectory, int(rows[-1]), f"{name}_left_on", 1, 0))
            changes = np.zeros(len(trajectory), np.int64)
            changes[rows] = np.where(states == 1, 1, -1)
            on[name] = np.cumsum(changes) > 0
        arc = on["arc"]
        for what, found in (
            ("rapid_with_arc_on", arc & (trajectory.kinds == Kind.RAPID)),
            ("pause_with_arc_on", arc & (trajectory.kinds == Kind.DWELL)),
            ("stop_with_arc_on", arc & (trajectory.events == Event.STOP)),
            ("arc_on_without_air", arc & ~on["air"]),
        ):
            if np.any(found):
                failures.append(self._at_block(trajectory, int(np.argmax(found)), what, 1, 0))
        lead = self.setup.process.air_lead_s
        for row in np.flatnonzero(trajectory.events == Event.ARC_ON).tolist():
            air = np.flatnonzero(trajectory.events[:row] == Event.AIR_ON)
            since = trajectory.times[row] - trajectory.times[air[-1]] if len(air) else 0.0
            if not since >= lead - 1e-6:
                failures.append(self._at_block(trajectory, row, "air_lead_s", since, lead))
        return failures

    def _astray(self, trajectory: Trajectory) -> list[SprayFailure]:
        """Motion with the arc on in no pass, or in a pass that the part does not have; and passes out of order."""
        spraying = np.flatnonzero(arc_on(trajectory))
        passes = trajectory.courses[spraying]
        wrong = (passes < 0) | (passes >= len(self.passes)) | (np.diff(passes, prepend=passes[:1]) < 0)
        if not np.any(wrong):
            return []
        row = int(np.argmax(wrong))
        return [self._at_block(trajectory, int(spraying[row]), "pass", int(passes[row]) + 1, len(self.passes))]

    def _speeds(self, trajectory: Trajectory, spraying: Ints, digits: Floats) -> list[SprayFailure]:
        """Blocks in which the gun is too fast, too slow although no axis is at its limit, or theta leaps."""
        begins, ends = trajectory.begins(spraying), trajectory.positions[spraying]
        steps, spans = np.abs(ends - begins), trajectory.durations[spraying]
        lengths, speed = ways_of(trajectory, spraying), self.setup.speed
        digit = 2 * float(np.max(digits[:3]))
        limits = np.array([axis.speed for axis in self.axes])
        needed = np.maximum(lengths / speed, np.max(steps / limits, axis=1, initial=0.0))
        # A block too short to be written leaves its time to the next one.
        slack = 2 * digit / speed + np.max(2 * digits / limits) + needed * FEED_DIGITS
        theta = steps[:, AXES.index("theta")] / DEG
        failures = []
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = lengths / spans / MM
        for what, wrong, values, limit in (
            ("gun_speed_mm_per_s", ~(spans >= needed - slack) & (lengths > digit), speeds, speed / MM),
            ("slow_gun_speed_mm_per_s", ~(spans <= needed + slack), speeds, speed / MM),
            ("theta_step_deg", ~(theta <= self.setup.verification.max_theta_step_deg), theta,
             self.setup.verification.max_theta_step_deg),
        ):  # fmt: skip
            if np.any(wrong):
                row = int(np.argmax(wrong))
                failures.append(self._at_block(trajectory, int(spraying[row]), what, float(values[row]), limit))
        return failures

    def _at_block(self, trajectory: Trajectory, row: int, what: str, value: float, limit: float) -> SprayFailure:
        index = int(trajectory.courses[row])
        number = self.passes[index].path.number if 0 <= index < len(self.passes) else 0
        return SprayFailure(number, 0, what, float(value), float(limit), int(trajectory.lines[row]))

    def _pinocchio(self, trajectory: Trajectory) -> float:
        """Largest difference of Pinocchio's own poses of the gun from those of the batch evaluator, metres."""
        stated = np.flatnonzero(np.isin(trajectory.kinds, MOTIONS) & ~np.any(np.isnan(trajectory.positions), axis=1))
        if not len(stated):
            return 0.0
        chosen = stated[np.linspace(0, len(stated) - 1, min(len(stated), PINOCCHIO_BLOCKS)).astype(np.int64)]
        values = self._configurations(trajectory.positions[chosen])
        return max(
            float(np.max(np.abs(self.machine.forward(values, frame) - self.machine.forward_pinocchio(values, frame))))
            for frame in ("P", "gun")
        )


def _unstated(trajectory: Trajectory) -> list[SprayFailure]:
    """Blocks that move by feed before every axis has been stated."""
    lost = np.any(np.isnan(trajectory.positions), axis=1) & (trajectory.kinds != Kind.RAPID)
    if not np.any(lost):
        return []
    row = int(np.argmax(lost))
    count = int(np.sum(np.isnan(trajectory.positions[row])))
    return [SprayFailure(0, 0, "unstated_axes", count, 0, int(trajectory.lines[row]))]


def _facets_at(found: Pass, arcs: Floats) -> Ints:
    """Facet (n,) of a pass at arc lengths (n,), `NO_FACET` beyond its ends and on the way to it."""
    row = np.searchsorted(found.bounds, arcs, "right") - 1
    inside = (row >= 0) & (row < len(found.facets))
    return np.where(inside, found.facets[np.clip(row, 0, len(found.facets) - 1)], NO_FACET)
