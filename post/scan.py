"""Scan: the words of a program, located by their letters and read eight bytes at a time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from post.controllers import Controller
from post.source import FIRST_LETTER, NEWLINE, Bytes, Source
from tapelayer.arrays import Floats, Ints, Mask

Eights = NDArray[np.uint64]

# Numbers converted at once, so that their intermediate arrays stay in the cache.
CHUNK = 1 << 15
# Digits in twice eight bytes, and the mantissa up to which a double is exact.
LONGEST = 16
EXACT = 2**53
# No number of a program is as large as this, and sums and squares of those below it are finite.
BEYOND = 1e100
# Extended addresses (`Q1=`) are represented by one byte each from here on.
EXTENDED = 0x80
# Characters of a word's digits in a message.
SHOWN = 40
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_POWERS = 10.0 ** np.arange(LONGEST + 1)


@dataclass(frozen=True, eq=False)
class Words:
    """The words of a text.

    Attributes:
        source: the text that holds them.
        letters: (m,) address of each word: its letter, or a code from EXTENDED on.
        values: (m,) the number after it.
        decimals: (m,) digits of that number after the point.
        lines: (m,) line of each word, from 0.
        firsts: (lines + 1,) index of each line's first word.
    """

    source: Source
    letters: Bytes
    values: Floats
    decimals: NDArray[np.int16]
    lines: NDArray[np.int32]
    firsts: Ints

    @property
    def line_count(self) -> int:
        """Number of lines."""
        return len(self.firsts) - 1

    def fault(self, word: int, sentence: str) -> None:
        """Note a fault of a word."""
        line = int(self.lines[word])
        self.source.fault(line, word - int(self.firsts[line]), sentence)

    def once(self, indices: Ints, what: str) -> None:
        """Note a fault where two of the words with these indices are in one line."""
        for second in (np.flatnonzero(np.diff(self.lines[indices]) == 0) + 1).tolist():
            self.fault(int(indices[second]), f"a second {what} in one block; write it in a block of its own")

    def of(self, letter: int, shown: str) -> Ints:
        """Return the indices of the words with an address, noting faults where a line has several."""
        indices = np.flatnonzero(self.letters == letter)
        self.once(indices, f"{shown} word")
        return indices

    def by_line(self, letter: int, shown: str) -> Floats:
        """Return the number (lines,) after an address in each line, NaN in lines without it."""
        indices = self.of(letter, shown)
        values = np.full(self.line_count, np.nan)
        values[self.lines[indices]] = self.values[indices]
        return values

    def fault_in(self, line: int, letter: int, sentence: str) -> None:
        """Note a fault of the word with an address in a line, or of the line if there is none."""
        place = np.flatnonzero(self.letters[self.firsts[line] : self.firsts[line + 1]] == letter)
        self.source.fault(line, int(place[0]) if len(place) else -1, sentence)


def words_of(source: Source, controller: Controller) -> Words:
    """Return the words of the text: letters and numbers with any spaces between them."""
    text = bytes(source.plain.translate(bytes(range(256)).upper(), b" \t"))
    extended = extended_addresses(controller)
    for number, address in enumerate(extended):
        text = text.replace(address.encode("ascii"), bytes([EXTENDED + number]))
    # Numbers are read eight bytes back from their ends, so the text needs padding in front.
    padded = b"\0" * LONGEST + text
    data = np.frombuffer(padded, dtype=np.uint8)[LONGEST:]
    begins = np.flatnonzero(data >= FIRST_LETTER)
    newlines = np.flatnonzero(data == NEWLINE)
    firsts = np.concatenate([[0], np.searchsorted(begins, newlines)])
    counts = np.diff(firsts)
    lines = np.repeat(np.arange(len(newlines), dtype=np.int32), counts)
    ends = np.empty_like(begins)
    ends[:-1] = begins[1:]
    ends[firsts[1:][counts > 0] - 1] = newlines[counts > 0]
    letters = data[begins]
    values, decimals = np.empty(len(begins)), np.empty(len(begins), dtype=np.int16)
    malformed: list[int] = []
    for first in range(0, len(begins), CHUNK):
        page = slice(first, first + CHUNK)
        values[page], decimals[page], good = _numbers(padded, begins[page] + 1, ends[page])
        malformed += (np.flatnonzero(~good) + first).tolist()
    words = Words(source, letters, values, decimals, lines, firsts)
    _note_malformed(
        words, [(word, text[begins[word] + 1 : ends[word]].decode("ascii", "replace")) for word in malformed], extended
    )
    starts = np.concatenate([[0], newlines[:-1] + 1])
    for line in np.flatnonzero((data[starts] < FIRST_LETTER) & (data[starts] != NEWLINE)).tolist():
        source.fault(line, -1, f"expected a word (a letter and a number), got {chr(data[starts[line]])}")
    return words


def _note_malformed(words: Words, malformed: Sequence[tuple[int, str]], extended: Sequence[str]) -> None:
    """Note a fault for each word that is no number, given with its digits; one fault for all decimal commas."""
    commas = [word for word, digits in malformed if _DECIMAL_COMMA.fullmatch(digits)]
    told = set(commas[1:])
    for word, digits in malformed:
        if word in told:
            continue
        shown = digits if len(digits) <= SHOWN else f"{digits[:SHOWN]}..."
        sentence = (
            f"expected a number after {shown_letter(int(words.letters[word]), extended)}, got {shown or 'nothing'}"
        )
        if word in commas[:1]:
            sentence = f"{sentence}: numbers have decimal commas, {len(commas)} in this program; write decimal points"
        words.fault(word, sentence)


def extended_addresses(controller: Controller) -> list[str]:
    """Return the addresses of more than one letter, in the order of the table."""
    return [axis.address for axis in controller.axes if len(axis.address) > 1]


def letter_of(address: str, controller: Controller) -> int:
    """Return the byte that represents an address."""
    extended = extended_addresses(controller)
    return EXTENDED + extended.index(address) if address in extended else ord(address)


def shown_letter(letter: int, extended: Sequence[str]) -> str:
    """Return the address as the program writes it, for a letter that may represent an extended one."""
    return extended[letter - EXTENDED] if letter >= EXTENDED else chr(letter)


def _eight(byte: int) -> np.uint64:
    return np.uint64(byte * 0x0101010101010101)


def _numbers(padded: bytes, begins: Ints, ends: Ints) -> tuple[Floats, Ints, Mask]:
    """Return the numbers between two places each, their digits after the point, and whether each is well formed.

    A well-formed number has an optional sign, digits, and at most one point.

    Args:
        padded: the text after LONGEST bytes of anything.
        begins: (m,) first byte of each number in the text.
        ends: (m,) byte after its last.
    """
    data = np.frombuffer(padded, dtype=np.uint8)[LONGEST:]
    eights = np.ndarray((len(padded) - 7,), dtype="<u8", buffer=padded, strides=(1,))
    lead = data[begins]
    negative = lead == ord("-")
    length = ends - begins - (negative | (lead == ord("+")))
    low, low_point, good = _digits(eights[ends + (LONGEST - 8)], np.clip(length, 1, 8))
    points = low_point >= 0
    whole = _eight_digits(_closed(low, low_point, np.uint64(0)))
    values = whole.astype(np.float64)
    decimals = np.maximum(low_point, 0)
    written = decimals
    longer = np.flatnonzero(length > 8)
    if len(longer):
        high, high_point, well = _digits(eights[ends[longer]], np.minimum(length[longer] - 8, 8))
        below = _closed(low[longer], low_point[longer], high >> np.uint64(56))
        above = np.where(points[longer], high << np.uint64(8), _closed(high, high_point, np.uint64(0)))
        mantissa = _eight_digits(above) * np.uint64(10**8) + _eight_digits(below)
        values[longer] = mantissa
        decimals[longer] = np.where(high_point >= 0, high_point + 8, decimals[longer])
        good[longer] &= well & ~(points[longer] & (high_point >= 0))
        points[longer] |= high_point >= 0
        written = decimals.copy()
        # The few whose mantissa is too long for a double are left to Python.
        for at in longer[(length[longer] > LONGEST) | (mantissa >= EXACT)].tolist():
            text = padded[LONGEST + begins[at] : LONGEST + ends[at]]
            good[at] = re.fullmatch(rb"[+-]?(\d+\.?\d*|\.\d+)", text) is not None and abs(float(text)) < BEYOND
            values[at], decimals[at] = (abs(float(text)) if good[at] else 0.0), 0
            written[at] = len(text.partition(b".")[2])
    good &= length > points
    values /= _POWERS[decimals]
    return np.where(negative, -values, values), written, good


def _digits(eights: Eights, length: Ints) -> tuple[Eights, Ints, Mask]:
    """Return the last bytes of each eight as digits, its point's place from the right or -1, and whether it is valid.

    The point keeps its place with the value 0x1E; bytes before the last `length` (1 to 8) are zero.
    """
    mask = np.uint64(2**64 - 1) << ((8 - length).astype(np.uint64) << np.uint64(3))
    digits = (eights ^ _eight(0x30)) & mask
    difference = digits ^ _eight(0x1E)
    zero = (difference - _eight(0x01)) & ~difference & _eight(0x80)
    # With one bit set at the point's byte, the product's top byte is the byte of the factor at that place.
    place = ((zero >> np.uint64(7)) * np.uint64(0x0706050403020100)) >> np.uint64(56)
    point = np.where(zero == 0, -1, np.minimum(place, np.uint64(7)).astype(np.int64))
    without = np.where(zero == 0, digits, digits & ~((zero << np.uint64(1)) - (zero >> np.uint64(7))))
    single = (zero & (zero - np.uint64(1))) == 0
    good = single & ((((without + _eight(0x76)) | without) & _eight(0x80)) == 0)
    return digits, point, good


def _closed(digits: Eights, point: Ints, carried: Eights | np.uint64) -> Eights:
    """Remove the point from digits: those before it move up by one byte, and `carried` fills the freed place."""
    place = (np.maximum(7 - point, 0).astype(np.uint64)) << np.uint64(3)
    before = (np.uint64(1) << np.minimum(place, np.uint64(56))) - np.uint64(1)
    after = ~((before << np.uint64(8)) | np.uint64(0xFF))
    return np.where(point < 0, digits, ((digits & before) << np.uint64(8)) | (digits & after) | carried)


def _eight_digits(digits: Eights) -> Eights:
    """Return the number (below 1e8) of eight digit values, the first in the lowest byte, by pairs, fours and eights."""
    pairs = (digits * np.uint64(10) + (digits >> np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    fours = (pairs * np.uint64(100) + (pairs >> np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    return (fours * np.uint64(10000) + (fours >> np.uint64(32))) & np.uint64(0xFFFFFFFF)
