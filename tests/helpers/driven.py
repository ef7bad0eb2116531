"""A program on a real control beside what the time law says of it, block by block and cycle by cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from post.controllers import load
from post.reader import read
from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.machines.machine import Machine
from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import Rule
from tapelayer.motion.time_law import Limits, timed
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tests.helpers.linuxcnc import CYCLE_S, ROTARY, Run, run

# The machine's joints on X Y Z A B C U V W.
LAYING = ("x", "y", "z", "a", "d", "c", "u", "v", "q")
SPRAYING = ("x", "y", "z", "phi", "", "theta", "", "", "")
# A stop is reached within this much of a path, a passed corner within a sample's last digit.
AT_A_STOP, IN_PASSING = 1e-6, 1e-8
ENDS = {Event.SHOE_DOWN: Event.SHOE_UP, Event.ARC_ON: Event.ARC_OFF}


@dataclass(frozen=True, eq=False)
class Driven(Frozen):
    """What a control made of a program; times in seconds from its first motion, which starts with every joint at 0.

    Attributes:
        trajectory: the program as read, with the law's clock.
        rule: of the control.
        joints: (n, k) sampled joints, a servo cycle apart, metres and radians, columns as in the trajectory; an output
            that turns an axis is not sampled.
        lines: (n,) line of the program in progress.
        sampled: columns of the sampled joints.
        run: all that the control did, from when it was switched on.
    """

    trajectory: Trajectory
    rule: Rule
    joints: Floats
    lines: Ints
    sampled: Ints
    run: Run

    @property
    def clock(self) -> Clock:
        assert self.trajectory.clock is not None
        return self.trajectory.clock

    @property
    def times(self) -> Floats:
        """Seconds (n,) of the samples."""
        return CYCLE_S * np.arange(len(self.joints))

    @cached_property
    def moving(self) -> Ints:
        """Blocks (m,) in which sampled joints move."""
        steps = self.trajectory.positions - self.trajectory.begins(np.arange(len(self.trajectory)))
        return np.flatnonzero(np.any(steps[:, self.sampled] != 0.0, axis=1))

    @cached_property
    def predicted_ends(self) -> Floats:
        """Seconds (m,) at which the moving blocks end by the law."""
        return self.clock.ends[self.moving + 1] - self.clock.moments[0]

    @cached_property
    def real_ends(self) -> Floats:
        """Seconds (m,) at which the moving blocks ended.

        A block ends where the control reaches its end and stops; where it runs into the next one, the lengths driven
        along both add up to the block's own as the control crosses the plane between them.
        """
        blocks, at, ends = self.moving, 0, []
        directions = self.trajectory.directions(blocks, np.ones(len(blocks)))[:, self.sampled]
        starts = self.trajectory.directions(blocks, np.zeros(len(blocks)))[:, self.sampled]
        for i, block in enumerate(blocks.tolist()):
            off = self.joints[at:, self.sampled] - self.trajectory.positions[block, self.sampled]
            if self.clock.stands[block]:
                reached, within = off @ directions[i] / (directions[i] @ directions[i]), AT_A_STOP
            else:
                both = np.linalg.pinv(np.column_stack([directions[i], starts[i + 1]]))
                reached, within = np.sum(off @ both.T, axis=1), IN_PASSING
            hits = np.flatnonzero(reached >= -within)
            assert len(hits), f"block {block}, line {self.trajectory.lines[block]}, was not reached"
            hit, at = int(hits[0]), at + int(hits[0])
            share = 0.0
            if hit > 0 and not self.clock.stands[block]:
                share = reached[hit] / (reached[hit] - reached[hit - 1])
            ends.append((at - share) * CYCLE_S)
        return np.array(ends)

    @property
    def first_feed(self) -> int:
        """The row of `moving` after which the first feed comes."""
        return int(np.argmax(self.trajectory.kinds[self.moving] != Kind.RAPID)) - 1

    @property
    def reported_s(self) -> float:
        """Seconds by the law from the first feed to the end."""
        return float(self.predicted_ends[-1] - self.predicted_ends[self.first_feed])

    @property
    def real_s(self) -> float:
        """Seconds on the control from the first feed to the end."""
        return float(self.real_ends[-1] - self.real_ends[self.first_feed])

    @property
    def held_up_s(self) -> float:
        """Seconds for which the control stood still longer than the law says, at words that wait or dwell."""
        moved = np.any(np.diff(self.joints[:, self.sampled], axis=0) != 0.0, axis=1)
        rest = np.setdiff1d(np.arange(len(self.trajectory)), self.moving)
        inner = rest[(rest > self.moving[0]) & (rest < self.moving[-1])]
        still = np.sum(~moved[: np.flatnonzero(moved)[-1]]) * CYCLE_S
        return float(still - np.sum(self.clock.durations[inner]))

    def predicted_joints(self) -> Floats:
        """Joints (n, k) by the law at the times of the samples."""
        times = self.times + self.clock.moments[0]
        blocks = np.clip(np.searchsorted(self.clock.ends, times, side="right") - 1, 0, len(self.trajectory) - 1)
        return self.trajectory.rounded(blocks, self.trajectory.fractions(blocks, times))

    def at_work(self) -> Mask:
        """Where (n,) the shoe is down or the arc on and the control moves or rests between, by real ends of blocks."""
        work = np.zeros(len(self.joints), np.bool_)
        ends = np.searchsorted(self.times, self.real_ends)
        for on, off in ENDS.items():
            downs, ups = (np.flatnonzero(self.trajectory.events == event) for event in (on, off))
            for down, up in zip(downs.tolist(), ups.tolist(), strict=True):
                before, last = np.searchsorted(self.moving, [down, up]) - 1
                work[self._motion_after(before, ends) : ends[last]] = True
        return work

    def _motion_after(self, index: int, ends: Ints) -> int:
        """The cycle in which the control leaves the end of a moving block, where it may have waited for a word."""
        if index < 0:
            return 0
        first, last = ends[index : index + 2]
        away = self.joints[first:last, self.sampled] - self.trajectory.positions[self.moving[index], self.sampled]
        left = np.any(np.abs(away) > AT_A_STOP, axis=1)
        return int(first) + int(np.argmax(left))


def driven(folder: Path, text: bytes, machine: Machine, axes: tuple[str, ...], longest_s: float = 60.0) -> Driven:
    """A program driven on LinuxCNC with a machine's axes."""
    nine = LAYING if "u" in axes else SPRAYING
    controller = load("linuxcnc")
    limits, rule = Limits.of([machine.axis(axis) for axis in axes]), controller.rule(axes)
    program = read(text, controller, axes, limits, "program.ngc").trajectory
    # The control starts with every joint at 0, and an axis that nothing has stated yet stays there.
    program = replace(
        program,
        start=np.zeros(len(axes)),
        positions=np.nan_to_num(program.positions),
        durations=program.requested,
        asked=None,
        clock=None,
    )
    found = run(folder, text, machine, nine, longest_s)
    assert not found.messages, found.messages
    joints = np.zeros((len(found.times), len(axes)))
    for index, joint in enumerate(nine):
        if joint:
            joints[:, axes.index(joint)] = found.joints[:, index] * (DEG if index in ROTARY else MM)
    changed = np.flatnonzero(np.any(found.joints != found.joints[0], axis=1))
    rows = slice(int(changed[0]) - 1, None)
    sampled = np.array([axes.index(joint) for joint in nine if joint])
    return Driven(timed(program, limits, rule), rule, joints[rows], found.lines[rows], sampled, found)
