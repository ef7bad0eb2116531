"""Strokes put every word on a block boundary of its own and leave the way as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tapelayer.motion.planned_blocks import PlannedBlocks
from tapelayer.motion.stroke import SAME_TIME, Pass, Stroke, Word, stroke_blocks
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import ON_THE_FLY, Event, Kind

LIMITS = Limits.speeds(np.array([0.5, 2.0]))
EVENTS = st.sampled_from([event for event in Event if event != Event.NONE])
# Halves and quarters make words fall on nodes and on each other; a delay may reach before the beginning.
NUMBERS = st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0]) | st.floats(-3.0, 3.0)
DELAYS = st.sampled_from([0.0, 0.25, 0.5, 1.0]) | st.floats(0.0, 20.0)


@dataclass(frozen=True)
class Case:
    nodes: np.ndarray
    least: np.ndarray
    passed: np.ndarray
    words: list[tuple[int, float, Event]]

    @property
    def stroke(self) -> Stroke:
        first = Stroke(self.nodes[:3], self.least[:3], np.arange(3.0)[: len(self.nodes)], self.passed[:3])
        stroke = Stroke.begun(self.nodes[0]).then(first)
        for node in range(3, len(self.nodes)):
            stroke = stroke.to(self.nodes[node], self.least[node], float(node))
        stroke = replace(stroke, passed=self.passed)
        for node, delay, event in self.words:
            stroke = stroke.switching(event, delay, node)
        return stroke


@st.composite
def cases(draw: st.DrawFn) -> Case:
    count = draw(st.integers(1, 8))
    nodes = [[draw(NUMBERS), draw(NUMBERS)]]
    for _ in range(count - 1):
        nodes.append(draw(st.just(nodes[-1]) | st.tuples(NUMBERS, NUMBERS).map(list)))
    least = [draw(st.sampled_from([0.0, 0.0, 0.5, 3.0])) for _ in range(count)]
    words = draw(st.lists(st.tuples(st.integers(0, count - 1), DELAYS, EVENTS), max_size=8))
    passed = draw(st.lists(st.sampled_from(Pass), min_size=count, max_size=count))
    return Case(np.array(nodes), np.array(least), np.array(passed, np.uint8), words)


def node_times(case: Case) -> list[float]:
    """Seconds at the nodes, one after the other."""
    times = [0.0]
    for before, after, least in zip(case.nodes, case.nodes[1:], case.least[1:], strict=False):
        ways = [abs(b - a) / speed for a, b, speed in zip(before, after, LIMITS.speed, strict=True)]
        times.append(times[-1] + max(*ways, float(least)))
    return times


@settings(deadline=None, max_examples=300)
@given(cases())
def test_nodes_are_reached_as_fast_as_the_axes_go(case: Case) -> None:
    assert case.stroke.times(LIMITS).tolist() == pytest.approx(node_times(case), abs=1e-12)
    assert len(case.stroke) == len(case.nodes)
    assert case.stroke.end.tolist() == case.nodes[-1].tolist()


@settings(deadline=None, max_examples=500)
@given(cases())
def test_rows_are_the_way_with_every_word_in_its_place(case: Case) -> None:
    times = node_times(case)
    rows = stroke_blocks(case.stroke, np.array(times))
    ends = np.cumsum(rows.durations)
    wait = max([0.0, *(delay - times[node] for node, delay, _ in case.words)])
    wait = wait if wait > SAME_TIME else 0.0
    assert np.sum(rows.durations) == pytest.approx(times[-1] + wait, abs=2 * SAME_TIME)

    # Every word once, its effect when the node is reached, words that fall together in their nominal order.
    nominal = sorted(case.words, key=lambda word: word[0])
    spoken = sorted(nominal, key=lambda word: times[word[0]] - word[1])
    switches = np.flatnonzero(rows.kinds == Kind.SWITCH)
    said = [Event(event) for event in rows.events[switches]]
    if min_gap([times[node] - delay for node, delay, _ in case.words]) > 2 * SAME_TIME:
        assert said == [event for _, _, event in spoken]
    assert sorted(said) == sorted(event for _, _, event in case.words)
    stands = sorted(times[node] - delay + wait for node, delay, _ in case.words)
    assert ends[switches].tolist() == pytest.approx(stands, abs=3 * SAME_TIME)
    assert np.all(rows.durations[switches] == 0.0)
    assert np.all(rows.events[rows.kinds != Kind.SWITCH] == Event.NONE)

    # The head is where the nodes' straight ways say at every block's end, and waits before.
    for end, joints, arc in zip(ends, rows.joints, rows.arcs, strict=True):
        assert joints.tolist() == pytest.approx(where(case, times, end - wait), abs=1e-6)
        assert 0.0 <= arc <= len(case.nodes) - 1

    # A block moves and takes time, or waits, or switches.
    begins = np.vstack([case.nodes[:1], rows.joints[:-1]]) if len(rows.joints) else np.zeros((0, 2))
    moves = np.any(rows.joints != begins, axis=1)
    assert np.all(rows.durations[rows.kinds != Kind.SWITCH] > SAME_TIME / 2)
    assert np.array_equal(rows.kinds == Kind.LINEAR, moves)
    if len(rows.joints):
        assert rows.joints[-1].tolist() == pytest.approx(case.nodes[-1].tolist(), abs=1e-6)


@settings(deadline=None, max_examples=500)
@given(cases())
def test_a_block_ends_as_the_node_there_is_passed(case: Case) -> None:
    times = node_times(case)
    said_at = [times[node] - delay for node, delay, _ in case.words]
    assume(min_gap([*times, *said_at]) > 4 * SAME_TIME)
    rows = stroke_blocks(case.stroke, np.array(times), 0.5)
    wait = max([0.0, *(-at for at in said_at)])
    wait = wait if wait > SAME_TIME else 0.0
    for end, kind, tolerance in zip(np.cumsum(rows.durations), rows.kinds, rows.tolerances, strict=True):
        passed = passed_at(case, times, end - wait)
        if kind == Kind.SWITCH:
            assert tolerance == (0.0 if passed == Pass.WAIT else ON_THE_FLY)
        else:
            spoken = any(abs(at - (end - wait)) < 2 * SAME_TIME for at in said_at)
            assert tolerance == (0.5 if passed == Pass.ON or (passed == Pass.WAIT and spoken) else 0.0)


def passed_at(case: Case, times: list[float], time: float) -> int:
    """How the stroke passes a time: as its last node there, or on between two."""
    # Nodes at the same time are one, passed as the last of them; a stroke begins, and waits, as its first node says.
    passed = {round(at / SAME_TIME): int(how) for at, how in zip(times, case.passed, strict=True)}
    first = min([0.0, *(times[node] - delay for node, delay, _ in case.words)])
    passed |= {round(at / SAME_TIME): int(case.passed[0]) for at in (0.0, first)}
    there = [how for at, how in passed.items() if abs(at * SAME_TIME - time) < 2 * SAME_TIME]
    return there[0] if there else Pass.ON


def min_gap(values: list[float]) -> float:
    """Least distance between values that are not equal."""
    return min((b - a for a, b in zip(sorted(values), sorted(values)[1:], strict=False) if b > a), default=1.0)


def where(case: Case, times: list[float], time: float) -> list[float]:
    """Joint values at a time, by the nodes' straight ways."""
    for (begin, end), (before, after) in zip(
        zip(times, times[1:], strict=False), zip(case.nodes, case.nodes[1:], strict=False), strict=True
    ):
        if begin <= time <= end and end > begin:
            return list(before + (time - begin) / (end - begin) * (after - before))
    return list(case.nodes[0] if time <= 0.0 else case.nodes[-1])


def said(rows: PlannedBlocks) -> list[str]:
    """Blocks in a few signs: the way they go to, a wait, or a word."""
    texts = []
    for kind, joints, duration, event in zip(rows.kinds, rows.joints, rows.durations, rows.events, strict=True):
        what = {Kind.LINEAR: f"to {joints[0]:g}", Kind.DWELL: "wait"}.get(Kind(kind))
        texts.append(f"{what} {duration:g}" if what else Event(event).name)
    return texts


def there_and_back() -> Stroke:
    """Half a metre out in a second, a rest of a second, and back."""
    stroke = Stroke.begun(np.array([0.0, 0.0]))
    for place, least in ((0.5, 0.0), (0.5, 1.0), (0.0, 0.0)):
        stroke = stroke.to(np.array([place, 0.0]), least)
    return stroke


def test_words_stand_at_their_nodes_in_the_order_in_which_they_were_given() -> None:
    stroke = there_and_back()
    stroke = stroke.switching(Event.KNIFE_1_DOWN, 0.0, 1)
    stroke = stroke.switching(Event.KNIFE_1_UP, 0.0, 2)
    stroke = stroke.switching(Event.KNIFE_2_DOWN, 0.0, 1)
    stroke = stroke.switching(Event.SHOE_UP, 0.0)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == [
        "to 0.5 1",
        "KNIFE_1_DOWN",
        "KNIFE_2_DOWN",
        "wait 1",
        "KNIFE_1_UP",
        "to 0 1",
        "SHOE_UP",
    ]


def test_a_word_stands_ahead_of_its_effect_and_splits_the_block() -> None:
    stroke = there_and_back()
    stroke = stroke.switching(Event.SHOE_UP, 0.25)
    stroke = stroke.switching(Event.HEATER_OFF, 1.5)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == [
        "to 0.5 1",
        "wait 0.5",
        "HEATER_OFF",
        "wait 0.5",
        "to 0.125 0.75",
        "SHOE_UP",
        "to 0 0.25",
    ]


def test_the_head_waits_for_a_word_that_has_to_stand_before_it_sets_out() -> None:
    stroke = there_and_back()
    stroke = stroke.switching(Event.KNIFE_1_DOWN, 0.5, 0)
    stroke = stroke.switching(Event.SHOE_DOWN, 1.75, 1)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == [
        "SHOE_DOWN",
        "wait 0.25",
        "KNIFE_1_DOWN",
        "wait 0.5",
        "to 0.5 1",
        "wait 1",
        "to 0 1",
    ]


def test_nodes_in_one_place_at_one_time_are_one() -> None:
    stroke = Stroke.begun(np.array([0.0, 0.0]))
    for place in (0.0, 0.5, 0.5):
        stroke = stroke.to(np.array([place, 0.0]), 0.0)
        stroke = stroke.switching(Event.ROLLER_DOWN, 0.0)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == [
        "ROLLER_DOWN",
        "to 0.5 1",
        "ROLLER_DOWN",
        "ROLLER_DOWN",
    ]


def test_a_word_a_hair_from_a_node_stands_on_it() -> None:
    stroke = there_and_back()
    stroke = stroke.switching(Event.KNIFE_1_DOWN, 1.0 + SAME_TIME / 2, 2)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == ["to 0.5 1", "KNIFE_1_DOWN", "wait 1", "to 0 1"]


def test_no_block_is_too_short_to_have_a_speed() -> None:
    """Words that rounding sets apart, and a node a hair farther on, are one boundary."""
    stroke = there_and_back()
    stroke = stroke.to(np.array([1e-16, 0.0]), 0.0)
    stroke = stroke.switching(Event.KNIFE_1_UP, 0.1 + 0.2, 3)
    stroke = stroke.switching(Event.SHOE_UP, 0.3, 3)
    rows = stroke_blocks(stroke, stroke.times(LIMITS))
    assert said(rows) == ["to 0.5 1", "wait 1", "to 0.15 0.7", "KNIFE_1_UP", "SHOE_UP", "to 1e-16 0.3"]


def test_a_stroke_that_goes_nowhere_only_says_its_words() -> None:
    stroke = Stroke.begun(np.array([1.0, 2.0]))
    stroke = stroke.switching(Event.STOP, 0.0)
    assert said(stroke_blocks(stroke, stroke.times(LIMITS))) == ["STOP"]


def test_a_stroke_goes_on_with_another_and_its_words() -> None:
    begun = there_and_back().switching(Event.SHOE_UP, 0.25)
    joined = begun.then(there_and_back().switching(Event.SHOE_DOWN, 0.0, 0).switching(Event.STOP, 0.5, 2))
    assert joined.joints[:, 0].tolist() == [0.0, 0.5, 0.5, 0.0, 0.5, 0.5, 0.0]
    assert joined.least.tolist() == [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]
    assert joined.words == (Word(3, 0.25, Event.SHOE_UP), Word(3, 0.0, Event.SHOE_DOWN), Word(5, 0.5, Event.STOP))
    assert begun.words == (Word(3, 0.25, Event.SHOE_UP),) and len(begun) == 4


def test_a_strokes_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        there_and_back().end[0] = 1.0
