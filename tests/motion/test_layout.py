"""Blocks are as even as their load, end where they must, and are short enough."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.motion.layout import even_blocks

KNOTS = np.linspace(0.0, 1.0, 201)
EVEN = np.ones(200)


def sagittas(curvature: float, allowed: float) -> Callable[[Floats], Floats]:
    """The excess of chords of a circle: their sagitta by what is allowed."""
    return lambda ends: curvature * np.diff(ends) ** 2 / 8.0 / allowed


def test_what_is_straight_is_one_block() -> None:
    layout = even_blocks(KNOTS, 0.0 * EVEN, np.array([0.0, 1.0]), lambda ends: np.zeros(len(ends) - 1))
    assert layout.ends.tolist() == [0.0, 1.0] and layout.faulty is None


def test_a_circle_has_as_few_blocks_as_its_tolerance_asks_all_of_one_length() -> None:
    curvature, allowed = 2.0, 2e-5
    layout = even_blocks(KNOTS, 0.0 * EVEN, np.array([0.0, 1.0]), sagittas(curvature, allowed))
    longest = np.sqrt(8.0 * allowed / curvature)
    steps = np.diff(layout.ends)
    assert len(steps) <= np.ceil(1.05 / longest)
    assert np.all(steps <= longest) and np.ptp(steps) < 1e-9


@given(st.lists(st.floats(0.01, 0.99), max_size=6), st.integers(0, 2**32 - 1))
def test_given_ends_are_kept_and_every_block_is_allowed(given_ends: list[float], seed: int) -> None:
    stops = np.unique([0.0, *np.round(given_ends, 6).tolist(), 1.0])
    rng = np.random.default_rng(seed)
    load = rng.uniform(0.0, 40.0, 200)
    curvature = 10.0 ** rng.uniform(-2.0, 1.0)

    def excess(ends: Floats) -> Floats:
        over: Floats = curvature * np.diff(ends) ** 2 / 8.0 / 2e-5
        return over

    layout = even_blocks(KNOTS, load, stops, excess)
    assert layout.faulty is None
    assert np.all(np.diff(layout.ends) > 0.0)
    assert np.all(np.isin(stops, layout.ends))
    assert np.all(excess(layout.ends) <= 1.0)


def test_a_load_is_shared_evenly() -> None:
    """Twice as many blocks where the load is twice as high."""
    load = np.where(KNOTS[:-1] < 0.5, 20.0, 40.0)
    layout = even_blocks(KNOTS, load, np.array([0.0, 1.0]), lambda ends: np.zeros(len(ends) - 1))
    assert np.sum(layout.ends < 0.5 - 1e-9) == 10 and len(layout.ends) == 31


def test_what_no_block_can_keep_is_said_with_its_place() -> None:
    def excess(ends: Floats) -> Floats:
        """A step of the path at 0.3 that no chord can follow."""
        over: Floats = np.where((ends[:-1] < 0.3) & (ends[1:] > 0.3), np.inf, 0.0)
        return over

    layout = even_blocks(KNOTS, EVEN, np.array([0.0, 1.0]), excess)
    assert layout.faulty == pytest.approx(0.3, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_where_need_and_load_differ_few_blocks_give_way_and_few_are_judged_again(seed: int) -> None:
    """Blocks whose ends are balanced, so that the excess of each depends on its neighbours' lengths too."""
    chance = np.random.default_rng(seed)
    knots = np.linspace(0.0, 1.0, 2001)
    bends = chance.uniform(0.5, 1.0, len(knots))
    judged = []

    def excess(ends: Floats) -> Floats:
        judged.append(len(ends) - 1)
        sags = np.interp((ends[1:] + ends[:-1]) / 2.0, knots, bends) * (1000.0 * np.diff(ends)) ** 2
        out = np.concatenate([[0.0], (sags[1:] + sags[:-1]) / 4.0, [0.0]])
        return np.maximum(np.maximum(out[1:], out[:-1]), sags - (out[1:] + out[:-1]) / 2.0) * 1.9

    load = np.full(2000, 1000.0 * np.sqrt(0.75))
    layout = even_blocks(knots, load, np.array([0.0, 0.3, 1.0]), excess)
    rounds = list(judged)
    assert layout.faulty is None and 0.3 in layout.ends
    assert np.all(excess(layout.ends) <= 1.0)
    # As many blocks as the sharpest bend asks for all along would be 1000, and more where they are laid out in turns.
    assert len(layout.ends) - 1 <= 1000
    steps = np.diff(layout.ends)
    assert np.max(steps[1:] / steps[:-1]) < 2.0 and np.max(steps[:-1] / steps[1:]) < 2.0
    assert sum(rounds) < 7 * len(steps)
