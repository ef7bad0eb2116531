"""Stroke: what the head does in one go, as nodes joined by straight joint blocks, with words that fall at times."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tapelayer.arrays import Floats, Ints
from tapelayer.motion.time_law import Limits, feeds
from tapelayer.motion.trajectory import Event, Kind

# Two times no farther apart, in seconds, are one block boundary: shorter blocks have no exact speed.
SAME_TIME = 1e-7


@dataclass(frozen=True, eq=False)
class StrokeBlocks:
    """Blocks of a stroke, ready to stand in a trajectory.

    Attributes:
        joints: (n, k) joint values at each block's end, metres and radians.
        kinds: (n,) `Kind`.
        durations: (n,) seconds.
        events: (n,) `Event`.
        arcs: (n,) metres along the course, for messages.
    """

    joints: Floats
    kinds: NDArray[np.uint8]
    durations: Floats
    events: NDArray[np.uint8]
    arcs: Floats


@dataclass
class Stroke:
    """A stroke while it is put together, from a pose on.

    Attributes:
        joints: (m, k) nodes so far, in parts; the first is where the stroke begins.
        arcs: (m,) metres along the course at the nodes, in parts.
        least: (m,) seconds that the way to each node takes at least, in parts.
        words: (node, delay in seconds, event) of every word, in their nominal order at a node.
    """

    joints: list[Floats]
    arcs: list[Floats]
    least: list[Floats]
    words: list[tuple[int, float, Event]] = field(default_factory=list)

    @staticmethod
    def begun(at: Floats) -> Stroke:
        """A stroke that begins at joint values (k,)."""
        return Stroke([at[None]], [np.zeros(1)], [np.zeros(1)])

    def __len__(self) -> int:
        """Number of nodes."""
        return sum(map(len, self.joints))

    @property
    def path(self) -> Floats:
        """Joint values (m, k) at all nodes."""
        if len(self.joints) > 1:
            self.joints = [np.concatenate(self.joints)]
        return self.joints[0]

    @property
    def at(self) -> Floats:
        """Joint values (k,) at the last node."""
        joints: Floats = self.joints[-1][-1]
        return joints

    def go(self, joints: Floats, least: Floats, arcs: Floats) -> None:
        """Go on through nodes (m, k), with the least time (m,) of the way to each and its place (m,) on the course."""
        if len(joints):
            self.joints.append(joints)
            self.least.append(least)
            self.arcs.append(arcs)

    def step(self, joints: Floats, least: float, arc: float = 0.0) -> None:
        """Go on to one node (k,)."""
        self.go(joints[None], np.array([least]), np.array([arc]))

    def switch(self, event: Event, delay: float, node: int | None = None) -> None:
        """Let an event take effect at a node, the last one where none is given; its word stands `delay` earlier."""
        self.words.append((len(self) - 1 if node is None else node, delay, event))

    def times(self, limits: Limits) -> Floats:
        """Seconds (m,) at the nodes, no axis beyond its limits and no way shorter than its least time."""
        ways = feeds(np.diff(self.path, axis=0), limits, np.concatenate(self.least)[1:])
        return np.append(0.0, np.cumsum(ways))

    def rows(self, times: Floats) -> StrokeBlocks:
        """Blocks after the first node, every word on a block boundary of its own.

        A word that has to stand before the stroke begins makes the head wait there.

        Args:
            times: (m,) seconds at the nodes.
        """
        nodes = np.column_stack([self.path, np.concatenate(self.arcs)])
        words = sorted(self.words, key=lambda word: word[0])
        at = np.array([times[node] - delay for node, delay, _ in words])
        # Nodes that no time lies between are one: words of both stand there. So are words that fall together.
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
            times, nodes = np.insert(times, after, new), np.insert(nodes, after, between, axis=0)
        # Every block by the node that ends it, every word behind the block that ends where it falls; stable sorts keep
        # the nominal order of words that fall together.
        spoken = np.argsort(at, kind="stable")
        ends = np.concatenate([np.arange(1, len(times)), np.searchsorted(times, at[spoken])])
        order = np.argsort(ends, kind="stable")
        blocks = nodes[ends[order]]
        still = np.all(nodes[1:, :-1] == nodes[:-1, :-1], axis=1)
        switches = np.full(len(words), Kind.SWITCH)
        return StrokeBlocks(
            joints=blocks[:, :-1],
            kinds=np.append(np.where(still, Kind.DWELL, Kind.LINEAR), switches).astype(np.uint8)[order],
            durations=np.append(np.diff(times), np.zeros(len(words)))[order],
            events=np.append(np.zeros(len(still), np.uint8), [words[i][2] for i in spoken]).astype(np.uint8)[order],
            arcs=blocks[:, -1],
        )


def _nearest(times: Floats, at: Floats) -> Ints:
    """Index (w,) of the time nearest to each of (w,) times."""
    after = np.clip(np.searchsorted(times, at), 1, max(len(times) - 1, 1)) if len(times) > 1 else np.zeros(len(at), int)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(times[before] - at) <= np.abs(times[after] - at), before, after)
