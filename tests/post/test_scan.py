"""Words by their letters, and numbers eight bytes at a time."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from post.controllers import load
from post.scan import EXTENDED, Words, extended_addresses, letter_of, shown_letter, words_of
from post.source import Source
from tapelayer.errors import ProgramRefused

LINUXCNC, SINUMERIK = load("linuxcnc"), load("sinumerik840d")


def scanned(text: str, controller: str = "linuxcnc") -> Words:
    table = load(controller)
    return words_of(Source(text.encode("ascii"), table, "p.nc"), table)


def test_words_know_their_letter_number_and_line() -> None:
    words = scanned("g1 x1.5Y-2\n\n N20 Z + 3 . 25\n")
    assert bytes(words.letters) == b"GXYNZ"
    assert words.values.tolist() == [1.0, 1.5, -2.0, 20.0, 3.25]
    assert words.lines.tolist() == [0, 0, 0, 2, 2]
    assert words.firsts.tolist()[:4] == [0, 3, 3, 5]
    assert words.by_line(ord("X"), "X")[:1].tolist() == [1.5]
    assert np.isnan(words.by_line(ord("X"), "X")[1:]).all()


@given(st.from_regex(r"[+-]?(\d{1,20}\.?\d{0,20}|\.\d{1,20})", fullmatch=True).filter(str.isascii))
@example("9007199254740993")
@example("00000000.00000001")
@example("12345678.")
@example("-0.5")
def test_numbers_are_the_nearest_doubles(text: str) -> None:
    words = scanned(f"X{text} Y1")
    assert words.values.tolist() == [float(text), 1.0]
    assert words.decimals.tolist() == [len(text.partition(".")[2]), 0]


@given(st.text(alphabet="0123456789.+-", max_size=18))
def test_numbers_are_well_formed_or_refused(text: str) -> None:
    words = scanned(f"X{text}")
    if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)", text):
        words.source.refuse()
    else:
        with pytest.raises(ProgramRefused, match=r"p\.nc:1:1: expected a number after X, got"):
            words.source.refuse()


def test_no_number_is_so_large_that_sums_overflow() -> None:
    assert scanned(f"X{'0' * 400}1{'0' * 50}").values.tolist() == [1e50]
    sentence = rf"p\.nc:1:1: expected a number after X, got {'9' * 40}\.\.\.$"
    for text in ("9" * 400, "9" * 101):
        with pytest.raises(ProgramRefused, match=sentence):
            scanned(f"X{text}").source.refuse()


def test_all_decimal_commas_get_one_sentence() -> None:
    with pytest.raises(ProgramRefused) as caught:
        scanned("G1 X1,5 Y-2,25\nX+3,0 Z4,\n").source.refuse()
    assert str(caught.value).splitlines() == [
        "p.nc:1:4: expected a number after X, got 1,5: numbers have decimal commas, 3 in this program; "
        "write decimal points",
        "p.nc:2:7: expected a number after Z, got 4,",
    ]


def test_a_line_begins_with_a_word() -> None:
    with pytest.raises(ProgramRefused, match=r"p\.nc:2: expected a word \(a letter and a number\), got 5"):
        scanned("X1\n5 X2\n").source.refuse()


def test_a_word_stands_once_in_a_line() -> None:
    words = scanned("X1 Y1\nX2 X3\n")
    assert words.of(ord("X"), "X").tolist() == [0, 2, 3]
    with pytest.raises(ProgramRefused, match=r"p\.nc:2:4: a second X word in one block"):
        words.source.refuse()


def test_extended_addresses_are_one_letter_each() -> None:
    extended = extended_addresses(SINUMERIK)
    assert extended and not extended_addresses(LINUXCNC)
    words = scanned(f"X1 {extended[0].lower()}2.5\n", "sinumerik840d")
    assert words.letters.tolist() == [ord("X"), EXTENDED] and words.values.tolist() == [1.0, 2.5]
    for letter in ("X", *extended):
        assert shown_letter(letter_of(letter, SINUMERIK), extended) == letter
