"""Capacity: words and lines of a program that are beyond what its control takes, by the control's table."""

from __future__ import annotations

import re

import numpy as np

from post.blocks import Blocks
from post.controllers import Controller
from post.scan import Words
from post.source import NEWLINE, Source
from tapelayer.arrays import Ints
from tapelayer.motion.trajectory import Kind

# A number followed at once by E and a whole number, and what shows that words follow each other without blanks anyway.
_EXPONENT = re.compile(rb"[A-Z][0-9]*=?[+-]?[0-9]*\.?[0-9]*[0-9.]E[+-]?[0-9]+(?![0-9.=])")
_GLUED = re.compile(rb"[0-9.][A-DF-Z]")


def check_exponents(source: Source) -> None:
    """Refuse numbers with exponents, which no control has: the first with its place, the others counted.

    A line whose words follow each other without blanks may mean an axis E, and is left alone.

    Raises:
        ProgramRefused: as said, with the faults noted before.
    """
    text = np.frombuffer(source.plain, dtype=np.uint8)
    places = np.flatnonzero((text | 0x20) == ord("e"))
    before = text[places - 1]
    places = places[(places > 0) & (((before >= ord("0")) & (before <= ord("9"))) | (before == ord(".")))]
    if not len(places):
        return
    ends = np.flatnonzero(text == NEWLINE)
    found: list[tuple[int, str]] = []
    for line in np.unique(np.searchsorted(ends, places)).tolist():
        words = bytes(source.plain[ends[line - 1] + 1 if line else 0 : ends[line]]).upper()
        if not _GLUED.search(words):
            found += [(line, match[0].decode("ascii")) for match in _EXPONENT.finditer(words)]
    if found:
        (line, word), more = found[0], len(found) - 1
        letters = re.match(r"[A-Z][0-9]*=|[A-Z]", word)
        number = f"{float(word[letters.end() :]):f}".rstrip("0").rstrip(".") if letters else ""
        others = f"; {more} more such word{'s' if more > 1 else ''}" if more else ""
        place = source.plain.upper().index(word.encode("ascii"), int(ends[line - 1]) if line else 0)
        sentence = (
            f"{word} is a number with an exponent, which this control does not have; write {number}, or a blank before "
            f"E where that is a word of its own{others}"
        )
        source.fault_at(place, sentence)
        source.refuse()


def check_capacity(blocks: Blocks, controller: Controller) -> None:
    """Note faults of lines, block numbers and axis words beyond what the control's table says that it takes."""
    words = blocks.words
    source = words.source
    ends = np.flatnonzero(np.frombuffer(source.plain, dtype=np.uint8) == NEWLINE)
    longest = controller.blocks.max_line
    lengths = np.diff(ends, prepend=-1) - 1
    for line in np.flatnonzero(lengths > longest).tolist():
        source.fault(line, -1, f"the line has {lengths[line]} characters, expected at most {longest} of this control")
    numbers, most = words.of(ord("N"), "N"), controller.blocks.number_maximum
    values = words.values[numbers]
    for word in numbers[~((values >= 0) & (values <= most) & (values == np.rint(values)))].tolist():
        words.fault(word, f"block number {words.values[word]:.15g}, expected a whole number from 0 to {most}")
    for axis in controller.axes:
        of_axis = blocks.axes[axis.address]
        largest = f"{controller.max_word:.{axis.decimals}f}"
        for word in of_axis[~(np.abs(words.values[of_axis]) <= controller.max_word)].tolist():
            sentence = f"{axis.address}{words.values[word]:.15g} is beyond the largest word of this control, {largest}"
            words.fault(word, sentence)
        _check_decimals(words, of_axis, axis.address, axis.decimals)
    dwelling = np.zeros(words.line_count, dtype=bool)
    dwelling[blocks.rows[blocks.kinds == Kind.DWELL]] = True
    times = np.flatnonzero(words.letters == ord(controller.codes.dwell_address))
    times = times[dwelling[words.lines[times]]]
    _check_decimals(words, times, controller.codes.dwell_address, controller.codes.dwell_decimals)


def _check_decimals(words: Words, indices: Ints, address: str, most: int) -> None:
    """Note faults of words with more digits after the point than the control takes."""
    for word in indices[words.decimals[indices] > most].tolist():
        digits = words.decimals[word]
        words.fault(word, f"{address} has {digits} digits after the point, expected at most {most} of this control")
