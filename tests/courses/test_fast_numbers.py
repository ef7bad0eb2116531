"""Numbers of a text, to the last bit."""

from __future__ import annotations

import math
import re
from fractions import Fraction

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


@given(st.lists(st.tuples(st.integers(2**53 + 1, 10**18 - 1), st.integers(0, 21), st.booleans()), min_size=1))
def test_quotients_that_are_certain_are_those_of_fractions(parts: list[tuple[int, int, bool]]) -> None:
    integers = np.array([-whole if minus else whole for whole, _, minus in parts])
    powers = [power for _, power, _ in parts]
    found, certain = fast_numbers.quotients(integers, 10.0 ** np.array(powers))
    for value, sure, whole, power in zip(found.tolist(), certain.tolist(), integers.tolist(), powers, strict=True):
        exact = Fraction(whole, 10**power)
        if sure:
            assert value == whole / 10**power
        assert abs(Fraction(value) - exact) <= Fraction(math.ulp(value))


@pytest.mark.parametrize("integer", [10**18, -(10**18), 2**63 - 1, -(2**63)])
def test_no_quotient_of_19_digits_is_certain(integer: int) -> None:
    assert not fast_numbers.quotients(np.array([integer]), np.array([10.0]))[1][0]


@pytest.mark.parametrize(
    ("text", "kind", "values"),
    [(b"", np.int64, []), (b"1 -2\n+3\n", np.int64, [1, -2, 3]), (b"1e3 .5\n", np.float64, [1e3, 0.5])],
)
def test_scanned_numbers(text: bytes, kind: type[np.generic], values: list[float]) -> None:
    assert fast_numbers.scanned(text, kind, len(values)).tolist() == values


@pytest.mark.parametrize("text", [b"1 x\n", b"1 2 3\n", b"1\n", b"1 2,5\n"])
def test_too_few_too_many_and_no_numbers_need_care(text: bytes) -> None:
    with pytest.raises(NeedsCare):
        fast_numbers.scanned(text, np.int64, 2)


@pytest.mark.parametrize("word", ["1-2", "--1", "1.2.3", "+-1", "1+"])
def test_signs_and_points_out_of_place_need_care(word: str) -> None:
    with pytest.raises(NeedsCare):
        fast_numbers.short_values(f"{word}\n".encode(), np.array([0]), np.array([len(word)]))
