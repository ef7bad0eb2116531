"""Linearisation: the few blocks, straight in joint space, that follow a course within the tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, SampleTable
from tapelayer.errors import PoseUndefined
from tapelayer.geometry.curves import Curve
from tapelayer.geometry.toolpath import Toolpath
from tapelayer.machines import gantry
from tapelayer.motion.layout import even_blocks

# A block is compared with the course at these fractions: its ends lie as far outside the curve as its middle inside.
TRIED = np.arange(6) / 6.0
# Blocks are laid out for part of the tolerance, so that few have to be laid out again.
LAYOUT_SHARE = 0.95


@dataclass(frozen=True, eq=False)
class Poses(SampleTable):
    """Poses of the gantry along a course.

    Attributes:
        arc_lengths: (n,) metres along the course.
        joints: (n, 5) x y z c a in metres and radians, c unwrapped.
        wrap: (n,) angle of the nip round the roller, radians, positive climbing.
    """

    arc_lengths: Floats
    joints: Floats
    wrap: Floats


@dataclass(frozen=True, eq=False)
class CourseMotion:
    """A course as the gantry moves along it.

    Attributes:
        toolpath: the course in `machine` axes.
        curve: curve through the course.
        lengths: of the head.
        form: the closed form in use.
        exact: whether the form guides the roller's centre and holds its axis; the paper's form guides its nose.
        wrap_radius: of the roller that the tape wraps round, metres; 0 if the wrap is not compensated.
        at_points: poses at the file's points.
    """

    toolpath: Toolpath
    curve: Curve
    lengths: gantry.Lengths
    form: gantry.ClosedForm
    exact: bool
    wrap_radius: float
    at_points: Poses

    @property
    def lift(self) -> float:
        """Return the distance in metres from the surface to the tool point that the closed form guides."""
        return self.lengths.radius if self.exact else 0.0

    def poses(self, arc_lengths: Floats) -> Poses:
        """Return the poses at (n,) increasing arc lengths in metres.

        Raises:
            PoseUndefined: a point has no roller pose.
        """
        joints, wrap = _solved(self.form, self.toolpath, arc_lengths, *self.curve.at(arc_lengths))
        # Every sample takes the turn of the file's points around it.
        near = np.interp(arc_lengths, self.curve.knots, self.at_points.joints[:, 3])
        joints[:, 3] += np.round((near - joints[:, 3]) / (2 * np.pi)) * (2 * np.pi)
        return Poses(arc_lengths, joints, wrap)

    def deviations(self, joints: Floats, arc_lengths: Floats) -> tuple[Floats, Floats, Floats]:
        """Return how far joint values (n, 5) are off the course at (n,) arc lengths.

        Returns:
            Tool point (n,), metres; roller axis (n,), radians; wrap angles (n,) at these joint values, radians.
        """
        points, normals, tangents = self.curve.at(arc_lengths)
        shift = gantry.tool_points(self.lengths, self.lengths.l6 - self.lift, joints) - points - self.lift * normals
        wraps = gantry.wrap(joints, tangents)
        if not self.exact:
            return _norms(shift), np.zeros(len(joints)), wraps
        square = np.cross(tangents, normals)
        turn = gantry.roller_axes(joints) - square / _norms(square)[:, None]
        return _norms(shift), _norms(turn), wraps

    def effects(self, joints: Floats, changes: Floats) -> tuple[Floats, Floats]:
        """Return how far small changes (n, 5) of joint values (n, 5) move the tool point (n,) and roller axis (n,)."""
        shift, turn = gantry.tool_effects(self.lengths, self.lengths.l6 - self.lift, joints, changes)
        return _norms(shift), _norms(turn) if self.exact else np.zeros(len(joints))


def course_motion(
    toolpath: Toolpath, lengths: gantry.Lengths, kinematics: gantry.Kinematics, wrap_radius: float
) -> CourseMotion:
    """Return a course as the gantry moves along it.

    Args:
        toolpath: the course in `machine` axes.
        lengths: of the head.
        kinematics: the closed form in use.
        wrap_radius: of the roller that the tape wraps round, metres; 0 if the wrap is not compensated.

    Raises:
        PoseUndefined: a point has no roller pose.
    """
    curve = Curve(toolpath)
    form = gantry.closed_form(lengths, kinematics, toolpath.points[0], toolpath.points[-1])
    joints, wrap = _solved(form, toolpath, curve.knots, *curve.at_knots())
    joints[:, 3] = np.unwrap(joints[:, 3])
    at_points = Poses(curve.knots, joints, wrap)
    return CourseMotion(toolpath, curve, lengths, form, kinematics == "roller", wrap_radius, at_points)


def nearest_point(toolpath: Toolpath, arc_length: float) -> int:
    """Return the number (from 1) of the file's point nearest to an arc length in metres from the first point."""
    return int(np.argmin(np.abs(toolpath.arc_lengths - toolpath.arc_lengths[0] - arc_length))) + 1


def _solved(
    form: gantry.ClosedForm, toolpath: Toolpath, arc_lengths: Floats, points: Floats, normals: Floats, tangents: Floats
) -> tuple[Floats, Floats]:
    """Return joint values (n, 5) and wrap angles (n,) at arc lengths (n,) with points, normals and tangents (n, 3)."""
    joints = form.joints(points, normals, tangents)
    lost = np.flatnonzero(~np.all(np.isfinite(joints), axis=1))
    if len(lost):
        point = nearest_point(toolpath, float(arc_lengths[lost[0]]))
        raise PoseUndefined(
            f"course {toolpath.number} point {point}: the roller has no pose here, because the path runs along the "
            "normal or the roller axis would be vertical; expected a path that lies on the surface"
        )
    return joints, gantry.wrap(joints, tangents)


def block_ends(
    motion: CourseMotion, tolerance: float, axis_tolerance: float, required: Floats | tuple[()] = ()
) -> Poses:
    """Return the poses at the block ends of a course, from its start to its end.

    Between required ends the blocks are as long and as equal as the tolerances allow, wherever that puts their ends:
    each other end stands outside the curve by as much as the middles of the blocks beside it stand inside.

    Args:
        motion: the course.
        tolerance: largest deviation of the contact from the course, metres.
        axis_tolerance: largest deviation of the roller axis from its direction, radians.
        required: arc lengths in metres at which a block must end.

    Raises:
        PoseUndefined: a point has no roller pose, or the tolerances cannot be kept by any block.
    """
    stops = np.unique(np.concatenate([[0.0], np.asarray(required, dtype=np.float64), [motion.curve.length]]))

    def excess(ends: Floats) -> Floats:
        return _excess(motion, _balanced(motion, ends, stops), tolerance, axis_tolerance)

    load = _chord_load(motion, 2.0 * LAYOUT_SHARE * tolerance, 2.0 * LAYOUT_SHARE * axis_tolerance)
    layout = even_blocks(motion.curve.knots, load, stops, excess)
    if layout.faulty is not None:
        worst = nearest_point(motion.toolpath, layout.faulty)
        raise PoseUndefined(
            f"course {motion.toolpath.number} point {worst}: no block is short enough to keep the "
            "tolerances here; the path or its normals have a kink"
        )
    return _balanced(motion, layout.ends, stops)


def usual_block(motion: CourseMotion, tolerance: float, axis_tolerance: float) -> float:
    """Return the median length in metres of the blocks that keep the tolerances along a course; arguments as above."""
    load = _chord_load(motion, 2.0 * LAYOUT_SHARE * tolerance, 2.0 * LAYOUT_SHARE * axis_tolerance)
    return 1.0 / max(float(np.median(load)), 1e-9)


def _balanced(motion: CourseMotion, ends: Floats, stops: Floats) -> Poses:
    """Return the poses at block ends (n,), moved out until the blocks' middles are off the curve no more than they.

    At the required ends (m,) the tape fed stays exact.
    """
    if len(ends) < 3:
        return motion.poses(ends)
    # One call for ends and middles in turns: on a short course the calls take the time.
    places = np.insert(ends, np.arange(1, len(ends)), (ends[1:] + ends[:-1]) / 2.0)
    both = motion.poses(places)
    # A block between two required ends cannot be made shorter: where it is the longer one its ends are moved for it.
    given_ends = np.isin(ends, stops)
    whole = given_ends[:-1] & given_ends[1:]
    joints, wrap, free = both.joints[::2].copy(), both.wrap[::2].copy(), ~given_ends[1:-1]
    for values, inner, moved in ((joints, both.joints[1::2], True), (wrap, both.wrap[1::2], free)):
        sags = inner - (values[1:] + values[:-1]) / 2.0
        before, after = sags[:-1], sags[1:]
        longer = np.where(np.abs(before) > np.abs(after), before, after)
        given = np.where((np.abs(before) > np.abs(after)).T, whole[:-1], whole[1:]).T
        out = np.where(given & (before * after > 0.0), longer / 2.0, (before + after) / 4.0)
        values[1:-1] += np.where(moved, out, 0.0)
    return Poses(ends, joints, wrap)


def _chord_load(motion: CourseMotion, tolerance: float, axis_tolerance: float) -> Floats:
    """Return the blocks needed per metre in each interval (n - 1,) between the file's points."""
    knots = motion.curve.knots
    if len(knots) < 3:
        return np.zeros(len(knots) - 1)
    poses, steps = motion.at_points, np.diff(knots)
    between_middles = (steps[1:] + steps[:-1]) / 2
    bends = np.diff(np.diff(poses.joints, axis=0) / steps[:, None], axis=0) / between_middles[:, None]
    shift, turn = motion.effects(poses.joints[1:-1], bends)
    feed = motion.wrap_radius * np.abs(np.diff(np.diff(poses.wrap) / steps) / between_middles)
    load: Floats = np.sqrt(np.maximum(np.maximum(shift, feed) / tolerance, turn / axis_tolerance) / 8)
    either: Floats = np.maximum(np.append(load[0], load), np.append(load, load[-1]))
    return either


def _excess(motion: CourseMotion, poses: Poses, tolerance: float, axis_tolerance: float) -> Floats:
    """Return the largest deviation of each block (n - 1,) as a share of the tolerances."""
    begin, end = poses.arc_lengths[:-1, None], poses.arc_lengths[1:, None]
    arc_lengths = (begin + TRIED * (end - begin)).ravel()
    joints = _between(poses.joints)
    shift, turn, wraps = motion.deviations(joints, arc_lengths)
    feed = motion.wrap_radius * np.abs(_between(poses.wrap[:, None])[:, 0] - wraps)
    excess = np.maximum(np.maximum(shift, feed) / tolerance, turn / axis_tolerance)
    worst: Floats = np.max(excess.reshape(-1, len(TRIED)), axis=1)
    return worst


def _between(rows: Floats) -> Floats:
    """Return rows (m, k) on the straight lines between consecutive rows (n, k), at the fractions `TRIED`."""
    inner = rows[:-1, None, :] + TRIED[None, :, None] * np.diff(rows, axis=0)[:, None, :]
    return inner.reshape(-1, rows.shape[1])


def _norms(vectors: Floats) -> Floats:
    lengths: Floats = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return lengths
