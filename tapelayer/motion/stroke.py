"""Stroke: an uninterrupted motion of the head, as nodes joined by straight joint blocks, and timed switching words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Frozen, Ints, Mask
from tapelayer.motion.clock import Clock
from tapelayer.motion.corners import Rule
from tapelayer.motion.planned_blocks import PlannedBlocks
from tapelayer.motion.time_law import Limits, clock_of, feeds
from tapelayer.motion.trajectory import ON_THE_FLY, Event, Kind

# Words are placed this often, or until they move by no more than this, in seconds.
PLACINGS, SETTLED = 60, 3e-6
# Where a word would be farther astray than this, in seconds, the control stops for it.
ASTRAY = 2e-4
# A bracket no wider than this share of the time in it has closed.
CLOSED = 1e-9
# From a stop a way grows with the square of its time, at speed with the time itself.
POWERS = (0.3, 3.0)
# Times no farther apart than this, in seconds, share a block boundary: shorter blocks have no exact speed.
SAME_TIME = 1e-7


class Pass(IntEnum):
    """How the control passes a node.

    STOP: exactly, with a full stop. ON: without a stop, its corner rounded off. WAIT: with a full stop that switching
    words there bring about, in the midst of motion without stops; where no word stands, as STOP.
    """

    STOP = 0
    ON = 1
    WAIT = 2


class Word(NamedTuple):
    """A switching word.

    Attributes:
        node: where its event takes effect.
        delay: seconds by which the word precedes the effect.
        event: what it switches.
    """

    node: int
    delay: float
    event: Event


@dataclass(frozen=True, eq=False)
class Stroke(Frozen):
    """Nodes joined by straight joint blocks, and the switching words between them.

    Attributes:
        joints: (m, k) joint values at the nodes; the first is where the stroke begins.
        least: (m,) least seconds for the motion to each node, 0 for the first.
        arcs: (m,) metres along the course at the nodes.
        passed: (m,) `Pass`.
        words: switching words, in their nominal order at a node.
    """

    joints: Floats
    least: Floats
    arcs: Floats
    passed: NDArray[np.uint8]
    words: tuple[Word, ...] = ()

    @staticmethod
    def begun(joints: Floats) -> Stroke:
        """Return a stroke that begins at joint values (k,) and has not moved yet."""
        return Stroke.through(joints[None])

    @staticmethod
    def through(joints: Floats) -> Stroke:
        """Return a stroke through joint values (m, k), as fast as the axes allow, with a stop at each."""
        return Stroke(joints, np.zeros(len(joints)), np.zeros(len(joints)), np.zeros(len(joints), np.uint8))

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self.joints)

    @property
    def end(self) -> Floats:
        """Joint values (k,) at the last node."""
        end: Floats = self.joints[-1]
        return end

    def then(self, other: Stroke) -> Stroke:
        """Return this stroke followed by another, which begins at its last node."""
        shift = len(self) - 1
        return Stroke(
            joints=np.concatenate([self.joints, other.joints[1:]]),
            least=np.concatenate([self.least, other.least[1:]]),
            arcs=np.concatenate([self.arcs, other.arcs[1:]]),
            passed=np.concatenate([self.passed, other.passed[1:]]),
            words=(*self.words, *(word._replace(node=word.node + shift) for word in other.words)),
        )

    def to(self, joints: Floats, least: float, arc: float = 0.0) -> Stroke:
        """Return this stroke with one more node (k,), `least` seconds away or more, `arc` metres along the course."""
        nodes = Stroke.through(np.stack([self.end, joints]))
        return self.then(replace(nodes, least=np.array([0.0, least]), arcs=np.array([0.0, arc])))

    def switching(self, event: Event, delay: float, node: int | None = None) -> Stroke:
        """Return this stroke with a word, whose event takes effect at a node: the last one where none is given."""
        return replace(self, words=(*self.words, Word(len(self) - 1 if node is None else node, delay, event)))

    def times(self, limits: Limits) -> Floats:
        """Return the seconds (m,) at the nodes, with no axis beyond its limits and no motion under its least time."""
        return np.append(0.0, np.cumsum(feeds(np.diff(self.joints, axis=0), limits, self.least[1:])))


@dataclass(frozen=True, eq=False)
class Control(Frozen):
    """The control that carries out a stroke.

    Attributes:
        axes: names of the joints.
        limits: of these.
        rule: how the control turns blocks into motion.
        tolerance: metres by which it may round off the nodes that it passes without a stop.
    """

    axes: tuple[str, ...]
    limits: Limits
    rule: Rule
    tolerance: float = 0.0

    def clock(self, stroke: Stroke, blocks: PlannedBlocks) -> tuple[Clock, Floats]:
        """Return the clock of a stroke's blocks, and the seconds (n + 1,) that words ask for up to their ends."""
        trajectory = blocks.trajectory(self.axes, np.zeros(len(blocks), np.int64))
        start, positions = self.rule.written(stroke.joints[:1])[0], self.rule.written(trajectory.positions)
        trajectory = replace(trajectory, start=start, positions=positions)
        return clock_of(trajectory, self.limits, self.rule), np.append(0.0, np.cumsum(blocks.durations))

    def times(self, stroke: Stroke) -> Floats:
        """Return the seconds (m,) at a stroke's nodes on the control, its words at their nodes."""
        asked = stroke.times(self.limits)
        words = tuple(word._replace(delay=0.0) for word in stroke.words)
        clock, until = self.clock(stroke, stroke_blocks(replace(stroke, words=words), asked, self.tolerance))
        return _taken(clock, until, asked)

    @property
    def stop(self) -> Pass:
        """Return how the control stops at a node with a switching word.

        LinuxCNC gives a block before an exact stop its whole acceleration, and the one before that only half, so that
        the two together would go too fast: there a word is the better stop.
        """
        return Pass.WAIT if self.rule.corner == "linuxcnc" else Pass.STOP

    def blocks(self, stroke: Stroke) -> PlannedBlocks:
        """Return the blocks of a stroke, with every word its delay ahead of its node on the control.

        A block that is split by a word in the midst of a slow motion may have a direction by its last written digits
        only, so that no split gives the word its delay: there the control stops for the word.
        """
        words = sorted(stroke.words, key=lambda word: word.node)
        stops = np.zeros(len(words), np.bool_)
        best, off = self._placed(stroke, words, stops)
        astray, least = off > ASTRAY, float(np.max(off, initial=0.0))
        while np.any(astray & ~stops):
            stops |= astray
            blocks, off = self._placed(stroke, words, stops)
            if np.max(off) < least:
                best, least = blocks, float(np.max(off))
            astray = off > ASTRAY
        return best

    def _placed(self, stroke: Stroke, words: Sequence[Word], stops: Mask) -> tuple[PlannedBlocks, Floats]:
        """Return the blocks with words placed as well as they can be, and the seconds (w,) by which these are off.

        A word splits a block, and a split block takes another time: the words are placed again until they stay.

        Args:
            stroke: the stroke.
            words: its words by rising node.
            stops: (w,) whether the control stops for a word.
        """
        asked = stroke.times(self.limits)
        delays = np.array([word.delay for word in words])
        at = asked[[word.node for word in words]]
        early = delays > 0.0
        stopped = np.where(stops, self.stop, Pass.ON)
        # Seconds of the words' own time by which each word is ahead of its node.
        ahead = delays.copy()
        search = _Search(delays[early])
        best, off = stroke_blocks(stroke, asked, self.tolerance, at - ahead, stopped), np.zeros(len(words))
        least = np.inf
        for _ in range(PLACINGS if np.any(early) else 0):
            blocks = stroke_blocks(stroke, asked, self.tolerance, at - ahead, stopped)
            clock, until = self.clock(stroke, blocks)
            # Blocks before the stroke's first node are waits for words that precede it.
            began = max(float(np.max(ahead - at)), 0.0)
            said = np.empty(len(words))
            said[np.argsort(at - ahead, kind="stable")] = clock.ends[1:][blocks.kinds == Kind.SWITCH]
            taken = _taken(clock, until, at + began) - said
            tried = np.where(early, np.abs(taken - delays), 0.0)
            if np.max(tried) < least:
                best, off, least = blocks, tried, float(np.max(tried))
            if least <= SETTLED:
                break
            ahead[early] = search.next(ahead[early], taken[early])
        return best, off


class _Search:
    """The search for the seconds that words are placed ahead, each by itself: a secant of logarithms in a bracket.

    The seconds taken grow with those placed ahead, at a node with a stop as steeply as a root.
    """

    def __init__(self, wanted: Floats) -> None:
        """Begin the search for seconds (w,) to be taken."""
        self.wanted = wanted
        self.low, self.high = np.zeros(len(wanted)), np.full(len(wanted), np.inf)
        self.powers = np.ones(len(wanted))
        self.tried: tuple[Floats, Floats] | None = None

    def next(self, ahead: Floats, taken: Floats) -> Floats:
        """Return the seconds (w,) to place ahead after those that were tried (w,) and were taken for them (w,)."""
        off = taken - self.wanted
        self.low, self.high = np.where(off < 0.0, ahead, self.low), np.where(off > 0.0, ahead, self.high)
        # Words move each other: a bracket that has closed without an answer is opened again.
        lost = (self.high - self.low <= ahead * CLOSED) & (np.abs(off) > SETTLED)
        self.low, self.high = np.where(lost, 0.0, self.low), np.where(lost, np.inf, self.high)
        logs = np.log(ahead), np.log(np.maximum(taken, SAME_TIME))
        slow = np.zeros(len(off), np.bool_)
        if self.tried is not None:
            steps = logs[0] - self.tried[0], logs[1] - self.tried[1]
            known = np.abs(steps[1]) > SAME_TIME
            self.powers = np.clip(np.divide(steps[0], steps[1], out=self.powers, where=known), *POWERS)
            slow = np.abs(off) > 0.5 * np.abs(np.exp(self.tried[1]) - self.wanted)
        self.tried = logs
        asked = ahead * np.exp(self.powers * (np.log(self.wanted) - logs[1]))
        halved = slow | (asked <= self.low) | (asked >= self.high)
        placed: Floats = np.where(halved & np.isfinite(self.high), 0.5 * (self.low + self.high), asked)
        return placed


def _taken(clock: Clock, until: Floats, asked: Floats) -> Floats:
    """Return the seconds (w,) on the control at which words would have taken (w,) seconds.

    Args:
        clock: of n blocks.
        until: (n + 1,) seconds that words ask for up to the blocks' ends.
        asked: (w,) seconds.
    """
    return clock.times(*_shares(until, asked))


def _shares(until: Floats, asked: Floats) -> tuple[Ints, Floats]:
    """Return the block (w,) in which words have taken (w,) seconds, and the share (w,) of it; arguments as above."""
    block = np.clip(np.searchsorted(until, asked, side="left") - 1, 0, len(until) - 2)
    spans = until[block + 1] - until[block]
    return block, np.clip((asked - until[block]) / np.where(spans > 0.0, spans, 1.0), 0.0, 1.0)


def stroke_blocks(
    stroke: Stroke,
    times: Floats,
    tolerance: float = 0.0,
    placed: Floats | None = None,
    stopped: NDArray[np.uint8] | None = None,
) -> PlannedBlocks:
    """Return the blocks after a stroke's first node, with a block boundary at every word.

    A word that must precede the stroke's beginning makes the head wait there.

    Args:
        stroke: the stroke.
        times: (m,) seconds at its nodes.
        tolerance: metres by which the control may round off the nodes that it passes without a stop.
        placed: (w,) seconds of the words by rising node; without them each is its delay ahead of its node.
        stopped: (w,) how the control passes the place of each word between nodes; without them without a stop.
    """
    nodes = np.column_stack([stroke.joints, stroke.passed, stroke.arcs])
    words = sorted(stroke.words, key=lambda word: word.node)
    at = np.array([times[node] - delay for node, delay, _ in words]) if placed is None else placed
    # Nodes at the same time are merged, with the words of both; so are words at the same time.
    kept = np.append(np.diff(times) > SAME_TIME, True)
    start, times, nodes = nodes[:1], times[kept], nodes[kept]
    nodes[:1] = start
    if np.min(at, initial=0.0) < times[0] - SAME_TIME:
        times, nodes = np.append(np.min(at), times), np.vstack([nodes[:1], nodes])
    sorted_at = np.sort(at)
    firsts = sorted_at[np.diff(sorted_at, prepend=-np.inf) > SAME_TIME]
    at = firsts[np.searchsorted(firsts, at, side="right") - 1]
    nearest = times[_nearest(times, at)]
    at = np.where(np.abs(nearest - at) <= SAME_TIME, nearest, at)
    if len(new := np.unique(at[at != nearest])):
        after = np.searchsorted(times, new)
        share = (new - times[after - 1]) / (times[after] - times[after - 1])
        between = nodes[after - 1] + share[:, None] * (nodes[after] - nodes[after - 1])
        # A block that is split goes on over the new boundary, unless a word asks for a stop.
        between[:, -2] = Pass.ON
        if stopped is not None:
            for stop in np.flatnonzero(stopped != Pass.ON):
                between[new == at[stop], -2] = stopped[stop]
        times, nodes = np.insert(times, after, new), np.insert(nodes, after, between, axis=0)
    # Blocks are ordered by the node that ends them, and every word follows the block that ends at its time; stable
    # sorts keep the nominal order of words at the same time.
    by_time = np.argsort(at, kind="stable")
    ends = np.concatenate([np.arange(1, len(times)), np.searchsorted(times, at[by_time])])
    order = np.argsort(ends, kind="stable")
    switching = np.zeros(len(times), np.bool_)
    switching[np.searchsorted(times, at)] = True
    waits = nodes[:, -2] == Pass.WAIT
    nodes[waits & ~switching, -2] = Pass.STOP
    blocks = nodes[ends[order]]
    still = np.all(nodes[1:, :-2] == nodes[:-1, :-2], axis=1)
    switches = np.full(len(words), Kind.SWITCH)
    kinds = np.append(np.where(still, Kind.DWELL, Kind.LINEAR), switches).astype(np.uint8)[order]
    rounded = np.where(blocks[:, -2] > Pass.STOP, tolerance, 0.0)
    return PlannedBlocks(
        joints=blocks[:, :-2],
        kinds=kinds,
        durations=np.append(np.diff(times), np.zeros(len(words)))[order],
        events=np.append(np.zeros(len(still), np.uint8), [words[i].event for i in by_time]).astype(np.uint8)[order],
        stated=np.zeros(len(blocks), np.uint16),
        arcs=blocks[:, -1],
        tolerances=np.where(kinds == Kind.SWITCH, np.where(blocks[:, -2] == Pass.WAIT, 0.0, ON_THE_FLY), rounded),
    )


def _nearest(times: Floats, at: Floats) -> Ints:
    """Return the index (w,) of the time nearest to each of (w,) times."""
    after = np.clip(np.searchsorted(times, at), 1, max(len(times) - 1, 1)) if len(times) > 1 else np.zeros(len(at), int)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(times[before] - at) <= np.abs(times[after] - at), before, after)
