"""Numbers of a text, to the last bit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.courses import fast_numbers, table
from tapelayer.courses.fast_numbers import NeedsCare

WORDS = st.text("0123456789+-.e", min_size=1, max_size=24) | st.from_regex(
    re.compile(table.NUMBER.pattern.decode().replace("eE", "e")), fullmatch=True
)
WORDS |= st.floats(allow_nan=False, allow_infinity=False).map(repr) | st.floats(-1e4, 1e4).map(repr)
WORDS |= st.integers(2**53, 2**64).map(str) | st.tuples(st.integers(-(2**60), 2**60), st.integers(0, 18)).map(
    lambda parts: (
        f"{'-' if parts[0] < 0 else ''}{abs(parts[0]) // 10 ** parts[1]}.{abs(parts[0]) % 10 ** parts[1]:0{parts[1]}d}"
    )
)


@given(st.lists(WORDS, min_size=1, max_size=14))
def test_numbers_are_those_of_python_or_none(words: list[str]) -> None:
    text = "".join(word + "\n" for word in words).encode()
    stops = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate([[0], stops[:-1] + 1])
    if all(table.NUMBER.fullmatch(word.encode()) for word in words):
        values = fast_numbers.values_of_words(text, starts, stops)
        assert values.tobytes() == np.array([float(word) for word in words]).tobytes()
    else:
        with pytest.raises(NeedsCare):
            fast_numbers.values_of_words(text, starts, stops)


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 4, 5])
def test_numbers_halfway_between_doubles_round_to_even(exponent: int) -> None:
    """Decimals of 16 to 18 digits exactly between two doubles, and one unit of their last place beside."""
    words = []
    for i in range(2**53 + 1, 2**53 + 200, 2):
        tie = i * 5**exponent  # i / 2**exponent, written with `exponent` decimals
        for digits in (tie - 1, tie, tie + 1):
            whole, part = divmod(digits, 10**exponent)
            words.append(f"-{whole}.{part:0{exponent}d}" if exponent else str(whole))
    text = "".join(word + "\n" for word in words).encode()
    stops = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate([[0], stops[:-1] + 1])
    values = fast_numbers.values_of_words(text, starts, stops)
    assert values.tobytes() == np.array([float(word) for word in words]).tobytes()
