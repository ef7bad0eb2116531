"""Switches pair, and nothing leaves its way while one is on."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.motion.trajectory import Event, Kind
from tapelayer.verification.breach import Breach
from tapelayer.verification.switching import Switch, held, interrupted, still_on, unpaired
from tests.helpers.by_hand import said

ON, OFF = Event.HEATER_ON, Event.HEATER_OFF
WORDS = Switch("heater", ON, OFF)
PROMPT, SLOW = Switch("heater", ON, OFF, 0.0), Switch("heater", ON, OFF, 500.0)
ALL = ("rapid", "pause", "stop")


@pytest.mark.parametrize("switch", [WORDS, PROMPT, SLOW])
@pytest.mark.parametrize(
    ("words", "breaches"),
    [
        ((1.0,), []),
        ((ON, 1.0, OFF), []),
        ((1.0, ON, OFF, 2.0, ON, 3.0, OFF), []),
        ((ON, 1.0, ON, OFF), [Breach(2, "heater_switched_again", 1, 0)]),
        ((1.0, OFF, ON, OFF), [Breach(1, "heater_switched_again", 1, 0)]),
        ((ON, OFF, OFF), [Breach(2, "heater_switched_again", 1, 0)]),
        ((ON, OFF, 1.0, ON, 1.0), [Breach(3, "heater_left_on", 1, 0)]),
        # Words of other switches do not count.
        ((ON, Event.SHOE_DOWN, Event.KNIFE_1_DOWN, OFF, Event.SHOE_UP), []),
    ],
)
def test_words_pair(switch: Switch, words: tuple[Event | float, ...], breaches: list[Breach]) -> None:
    assert unpaired(said(*words), switch) == breaches


def test_a_prompt_switch_is_on_from_word_to_word() -> None:
    trajectory = said(1.0, ON, 2.0, 3.0, OFF, 4.0)
    for switch in (WORDS, PROMPT):
        assert still_on(trajectory, switch).tolist() == [False, True, True, True, False, False]
        assert held(trajectory, switch).tolist() == [0, 0, 1, 1, 0, 0]


def test_a_slow_switch_is_on_from_its_word_until_it_has_let_go() -> None:
    trajectory = said(1.0, ON, 0.25, 2.0, OFF, 0.4, 0.5, 1.0)
    assert held(trajectory, SLOW) == pytest.approx([0, 0, 0, 0.875, 0, 1, 0.2, 0])
    assert still_on(trajectory, SLOW).tolist() == [False, True, True, True, False, True, True, False]


@pytest.mark.parametrize(("late", "on"), [(0.5e-3, False), (2e-3, True)])
def test_a_thousandth_of_a_block_is_rounding(late: float, on: bool) -> None:
    trajectory = said(ON, 1.0, OFF, 0.5 - late, 1.0)
    assert bool(still_on(trajectory, SLOW)[-1]) is on


def test_what_is_left_on_is_on_to_the_end() -> None:
    assert held(said(1.0, ON, 2.0, 3.0), SLOW) == pytest.approx([0, 0, 0.75, 1])
    assert held(said(1.0, 2.0), SLOW).tolist() == [0, 0]


def test_rapids_pauses_and_stops_are_seen_where_they_are_asked_for() -> None:
    trajectory = said((Kind.RAPID, 1.0), ON, 1.0, (Kind.RAPID, 1.0), (Kind.DWELL, 1.0), Event.STOP, OFF, Event.STOP)
    rapid, pause, stop = (Breach(row, f"{what}_with_heater_on", 1, 0) for row, what in zip((3, 4, 5), ALL, strict=True))
    assert interrupted(trajectory, WORDS, ALL) == [rapid, pause, stop]
    assert interrupted(trajectory, WORDS, ("rapid", "stop")) == [rapid, stop]
    assert interrupted(trajectory, Switch("shoe", Event.SHOE_DOWN, Event.SHOE_UP), ALL) == []


@pytest.mark.parametrize("what", ["rapid", "pause"])
def test_a_switch_that_has_not_let_go_yet_is_on(what: str) -> None:
    """The word stands before the motion, and half a second of it passes before the heater is off."""
    kind = Kind.RAPID if what == "rapid" else Kind.DWELL
    soon, later = said(ON, 1.0, OFF, (kind, 1.0)), said(ON, 1.0, OFF, 0.5, (kind, 1.0))
    assert [breach.block for breach in interrupted(soon, SLOW, ALL)] == [3]
    assert interrupted(later, SLOW, ALL) == interrupted(soon, WORDS, ALL) == interrupted(soon, PROMPT, ALL) == []


def test_without_its_first_word_a_switch_is_on_between_the_others_by_effect_only() -> None:
    trajectory = said(OFF, (Kind.RAPID, 1.0), ON, 1.0, OFF)
    assert not np.any(still_on(trajectory, WORDS))
    assert still_on(trajectory, PROMPT).tolist() == [False, True, False, False, False]
