from __future__ import annotations

import re
from decimal import ROUND_HALF_UP, Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from post.words import join, literals, rounded, words


def text_of(values: list[float], decimals: int, address: bytes = b"X") -> list[str]:
    numbers = rounded(np.array(values), decimals)
    text = join(len(values), [(None, words(address, numbers, decimals)), (None, literals([b"\n"]))])
    return text.decode("ascii").splitlines()


@pytest.mark.parametrize(
    ("value", "decimals", "word"),
    [
        (0.0, 3, "X0.000"),
        (-0.0, 3, "X0.000"),
        (-0.0004, 3, "X0.000"),
        (-0.0005, 3, "X-0.001"),
        (0.0005, 3, "X0.001"),
        (0.0625, 3, "X0.063"),
        (-0.0625, 3, "X-0.063"),
        (1.0005, 3, "X1.001"),
        (0.5, 0, "X1"),
        (-2.5, 0, "X-3"),
        (9999.9994, 3, "X9999.999"),
        (9999.9996, 3, "X10000.000"),
        (12345.7, 3, "X12345.700"),
        (-10000.0, 3, "X-10000.000"),
        (100020003.004, 3, "X100020003.004"),
        (2e9, 3, "X2000000000.000"),
        (-2e9, 3, "X-2000000000.000"),
        (1e-7, 3, "X0.000"),
        (1e-7, 9, "X0.000000100"),
        (1.000001, 6, "X1.000001"),
        (0.1234, 4, "X0.1234"),
        (0.00012, 5, "X0.00012"),
        (12.00000003, 8, "X12.00000003"),
    ],
)
def test_word(value: float, decimals: int, word: str) -> None:
    assert text_of([value], decimals) == [word]


def test_half_is_rounded_away_from_zero_and_just_below_half_is_not() -> None:
    below = np.nextafter(0.5, 0.0)
    assert rounded(np.array([0.5, -0.5, below, -below, 1.5, -1.5, 2.5]), 0).tolist() == [1, -1, 0, 0, 2, -2, 3]


@given(st.lists(st.floats(-2e9, 2e9), min_size=1, max_size=8), st.integers(0, 6))
def test_words_are_fixed_point_and_read_back_as_the_rounded_number(values: list[float], decimals: int) -> None:
    numbers = rounded(np.array(values), decimals)
    for word, value, number in zip(text_of(values, decimals), values, numbers.tolist(), strict=True):
        assert re.fullmatch(rf"X-?(0|[1-9]\d*)(\.\d{{{decimals}}})" if decimals else r"X-?(0|[1-9]\d*)", word)
        assert not re.fullmatch(r"X-0(\.0*)?", word)
        assert Decimal(word[1:]).scaleb(decimals) == number
        exact = Decimal(value).scaleb(decimals)
        # The product is rounded once before it is rounded to whole units: half an ulp of it may cross a tie.
        if abs(abs(exact % 1) - Decimal("0.5")) > abs(exact) * Decimal(2) ** -53:
            assert number == exact.to_integral_value(ROUND_HALF_UP)


@given(st.lists(st.integers(-(10**15), 10**15), min_size=1, max_size=8), st.integers(0, 9))
def test_integers_come_out_digit_by_digit(numbers: list[int], decimals: int) -> None:
    cells = words(b" Q1=", np.array(numbers), decimals)
    text = join(len(numbers), [(None, cells), (None, literals([b"\n"]))]).decode("ascii").splitlines()
    expected = [f" Q1={Decimal(number).scaleb(-decimals):.{decimals}f}" for number in numbers]
    assert text == expected


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e13, -1e300])
def test_what_has_no_fixed_point_word_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="has no fixed-point word with 3 decimals"):
        rounded(np.array([1.0, value]), 3)


def test_words_stand_only_in_their_rows() -> None:
    at = np.array([0, 2])
    columns = [
        (None, tuple(cell[[1, 0, 2]] for cell in literals([b"", b"G01", b"(long literal)"]))),
        (at, words(b" X", np.array([-1, 20000000]), 3)),
        (np.array([], dtype=np.int64), words(b" Y", np.array([], dtype=np.int64), 3)),
        (None, literals([b"\n"])),
    ]
    assert join(3, columns) == b"G01 X-0.001\n\n(long literal) X20000.000\n"
