"""Blocks: the meaning of the words of every line for the control."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from post.controllers import Controller
from post.controllers.table import code
from post.scan import Words, extended_addresses, letter_of, shown_letter
from post.source import Bytes, Source
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import InputFault, ProgramRefused
from tapelayer.motion.trajectory import ON_THE_FLY, Kind

# Meanings of G words, and their groups of which a block has one word each: action, distance, feed mode, plane, corners.
_RAPID, _LINEAR, _CLOCKWISE, _COUNTERCLOCKWISE, _DWELL, _SET = range(1, 7)
_ABSOLUTE, _INCREMENTAL, _PER_MINUTE, _INVERSE_TIME, _XY, _ZX, _YZ, _NO_EFFECT, _EXACT, _BLENDED = range(7, 17)
_GROUPS = np.array([0, 1, 1, 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 4, 0, 5, 5], dtype=np.uint8)
_ACTION, _DISTANCE, _FEED_MODE, _PLANE, _CORNERS = 1, 2, 3, 4, 5
_MODES = (_RAPID, _LINEAR, _CLOCKWISE, _COUNTERCLOCKWISE)
_KINDS = np.array([Kind.SWITCH, Kind.RAPID, Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE], dtype=np.uint8)
_PLANES = {"xy": _XY, "zx": _ZX, "yz": _YZ}


@dataclass(frozen=True, eq=False)
class Blocks:
    """The actions of the lines.

    Attributes:
        words: the words of the text.
        rows: (n,) lines (from 0) that are blocks of the trajectory.
        of_line: (lines,) block of each line that makes one.
        kinds: (n,) `Kind` of each.
        events: (n,) `Event` of each.
        pauses: (n,) seconds of each dwell, NaN elsewhere.
        outputs: (n,) blocks that consist only of axis words that the control does not interpolate.
        inverse: (n,) whether feeds are inverse time.
        feeds: (lines,) feed word of each line, NaN without one.
        mode_changes: (lines,) where a feed mode is stated.
        incremental: (lines,) whether axis words are increments.
        sets: (lines,) whether axis words set the present position.
        planes: (n,) plane of circular blocks: 0 XY, 1 ZX, 2 YZ.
        offsets: centre of each circular block from its beginning along x, y, z: (n,) each, NaN where not written.
        tolerances: (n,) metres by which the control may round off the block's end, 0 where it stops there exactly; of a
            switching word as in a trajectory.
        axes: indices of the words of each axis address.
        letters: one byte for each axis address, as in the words.
    """

    words: Words
    rows: Ints
    of_line: Ints
    kinds: NDArray[np.uint8]
    events: NDArray[np.uint8]
    pauses: Floats
    outputs: Mask
    inverse: Mask
    feeds: Floats
    mode_changes: Mask
    incremental: Mask
    sets: Mask
    planes: NDArray[np.uint8]
    offsets: Sequence[Floats]
    tolerances: Floats
    axes: Mapping[str, Ints]
    letters: Mapping[str, int]

    @cached_property
    def feeding(self) -> Mask:
        """Blocks (n,) whose time comes from a feed word."""
        return np.isin(self.kinds, (Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE))

    def fault(self, line: int, address: str, sentence: str) -> None:
        """Note a fault of an axis word in a line, or of the line where it has none."""
        self.words.fault_in(line, self.letters[address], sentence)


def blocks_of(source: Source, words: Words, controller: Controller) -> Blocks:
    """Return the meaning of every line, carrying modal states forward."""
    codes = controller.codes
    letters = {axis.address: letter_of(axis.address, controller) for axis in controller.axes}
    axes = {address: words.of(letter, address.rstrip("=")) for address, letter in letters.items()}
    has_axis, has_output = np.zeros(words.line_count, dtype=bool), np.zeros(words.line_count, dtype=bool)
    for axis in controller.axes:
        (has_output if axis.word else has_axis)[words.lines[axes[axis.address]]] = True
    arguments = {letter: words.by_line(ord(letter), letter) for letter in _arguments(controller)}
    used = {letter: np.zeros(words.line_count, dtype=bool) for letter in arguments}
    groups = _preparatory(words, controller, arguments, used)
    action = groups[_ACTION]
    dwells, sets = action == _DWELL, action == _SET
    mode = _held(action, np.isin(action, _MODES), 0)
    moves = has_axis & ~dwells & ~sets
    circular = moves & (mode >= _CLOCKWISE) & (mode <= _COUNTERCLOCKWISE)
    events, flying, ends, axis_output = _switching(words, controller, arguments, used)
    used[codes.dwell_address] |= dwells
    used[controller.feed.address] |= ~dwells
    if controller.time.tolerance_address:
        used[controller.time.tolerance_address] |= groups[_CORNERS] == _BLENDED
    for letter in set(controller.arcs.offsets) & set(used):
        used[letter] |= circular
    _check_letters(words, controller, arguments, used, letters.values())
    for line in np.flatnonzero(moves & (mode == 0)).tolist():
        source.fault(line, 0, f"axis words before any {codes.rapid} or {codes.linear}; state one of them")
    for line in np.flatnonzero((events > 0) & (moves | dwells | sets)).tolist():
        words.fault_in(line, ord("M"), "a switching word stands in a block with a motion or dwell; give it its own")
    for axis in controller.axes:
        missing = ~axis_output[words.lines[axes[axis.address]]] & bool(axis.word)
        for word in axes[axis.address][missing].tolist():
            words.fault(word, f"expected {axis.word} in a block with {axis.address.rstrip('=')}")
    exclusive = any(axis.alone for axis in controller.axes)
    for line in np.flatnonzero(axis_output & (~has_output | dwells | sets | (exclusive & has_axis))).tolist():
        words.fault_in(line, ord("M"), "expected the axis words that this word takes, and no others that it does not")
    pauses = arguments[codes.dwell_address]
    for line in np.flatnonzero(dwells & (has_axis | has_output | ~(pauses >= 0.0))).tolist():
        sentence = f"expected {codes.dwell} {codes.dwell_address} and the seconds, nothing else"
        words.fault_in(line, ord("G"), sentence)
    feeds = np.where(dwells, np.nan, arguments[controller.feed.address])
    for line in np.flatnonzero(feeds <= 0.0).tolist():
        words.fault_in(line, ord(controller.feed.address), "expected a feed above 0")
    _check_end(words, controller, ends)
    outputs = axis_output & has_output & ~has_axis
    blocks = moves | dwells | outputs | (events > 0)
    kinds = np.where(moves, _KINDS[mode], np.where(dwells, Kind.DWELL, np.where(outputs, Kind.RAPID, Kind.SWITCH)))
    source.refuse()
    rows = np.flatnonzero(blocks)
    if not len(rows):
        raise ProgramRefused(source.name, [InputFault(0, "the program has no blocks")])
    distance, feed_mode, plane = groups[_DISTANCE], groups[_FEED_MODE], groups[_PLANE]
    offsets = [arguments.get(letter, np.full(words.line_count, np.nan))[rows] for letter in controller.arcs.offsets]
    return Blocks(
        words=words,
        rows=rows,
        of_line=np.cumsum(blocks) - 1,
        kinds=kinds[rows].astype(np.uint8),
        events=events[rows],
        pauses=pauses[rows],
        outputs=outputs[rows],
        inverse=_held(feed_mode, feed_mode > 0, _PER_MINUTE)[rows] == _INVERSE_TIME,
        feeds=feeds,
        mode_changes=feed_mode > 0,
        incremental=_held(distance, distance > 0, _ABSOLUTE) == _INCREMENTAL,
        sets=sets,
        planes=_held(plane, plane > 0, _XY)[rows] - np.uint8(_XY),
        offsets=offsets,
        tolerances=np.where(
            kinds == Kind.SWITCH,
            np.where(flying, ON_THE_FLY, 0.0),
            _tolerances(words, controller, groups[_CORNERS], arguments),
        )[rows],
        axes=axes,
        letters=letters,
    )


def _arguments(controller: Controller) -> list[str]:
    """Return the letters of further words: feed, dwell time, arc centres, and arguments of G and M words."""
    codes = controller.codes
    known_words = [*controller.events.values(), *controller.events_at_rest.values(), *codes.no_effect]
    known_words += [axis.word for axis in controller.axes]
    with_argument = (re.fullmatch(r"[GM][\d.]+ ([A-Z])[\d.]+", word) for word in known_words)
    letters = {codes.dwell_address, controller.feed.address, *(match[1] for match in with_argument if match)}
    letters |= {controller.time.tolerance_address} - {""}
    if controller.arcs.planes:
        letters |= set(controller.arcs.offsets)
    return sorted(letters)


def _check_letters(
    words: Words,
    controller: Controller,
    arguments: Mapping[str, Floats],
    used: Mapping[str, Mask],
    axes: Collection[int],
) -> None:
    """Note faults of words that the control does not know, or that have no meaning in their block."""
    for letter, belongs in used.items():
        for line in np.flatnonzero(~np.isnan(arguments[letter]) & ~belongs).tolist():
            words.fault_in(line, ord(letter), f"the {letter} word has no meaning in this block; remove it")
    ignored = {word for word in controller.codes.no_effect if len(word) == 1}
    known = np.zeros(256, dtype=bool)
    known[[ord(letter) for letter in {"N", "G", "M"} | set(arguments) | ignored] + list(axes)] = True
    for word in np.flatnonzero(~known[words.letters]).tolist():
        shown = shown_letter(int(words.letters[word]), extended_addresses(controller))
        words.fault(word, f"{shown} is no word of controller {controller.name}")


def _check_end(words: Words, controller: Controller, ends: Mask) -> None:
    """Note a fault where the program does not end, or continues after its end."""
    last = int(np.argmax(ends)) if ends.any() else words.line_count
    if last == words.line_count:
        sentence = f"the program does not end with {' or '.join(controller.blocks.end)}; it may be cut off"
        words.source.fault(max(words.line_count - 2, 0), -1, sentence)
    for line in (np.flatnonzero(np.diff(words.firsts)[last + 1 :]) + last + 1)[:1].tolist():
        words.source.fault(line, 0, f"stands after the end of the program in line {last + 1}")


def _preparatory(
    words: Words, controller: Controller, arguments: Mapping[str, Floats], used: Mapping[str, Mask]
) -> dict[int, Bytes]:
    """Return the meaning (lines,) of each line's G word of each group, 0 without one, marking arguments as used."""
    codes = controller.codes
    meanings = {
        codes.rapid: _RAPID,
        codes.linear: _LINEAR,
        codes.dwell: _DWELL,
        codes.set_position: _SET,
        codes.absolute: _ABSOLUTE,
        codes.incremental: _INCREMENTAL,
        codes.per_minute: _PER_MINUTE,
        codes.inverse_time: _INVERSE_TIME,
    }
    if controller.arcs.planes:
        meanings |= {codes.clockwise: _CLOCKWISE, codes.counterclockwise: _COUNTERCLOCKWISE}
    meanings |= {controller.time.exact: _EXACT, controller.time.blended: _BLENDED}
    meanings.pop("", None)
    meanings |= {word: _PLANES[plane] for plane, word in codes.planes.items()}
    meanings |= {word: _NO_EFFECT for word in codes.no_effect if re.fullmatch(r"G[\d.]+( [A-Z][\d.]+)?", word)}
    # G words have up to one decimal (G92.1); those without a meaning stay 0.
    tenths = np.zeros(10001, dtype=np.uint8)
    for word, meaning in meanings.items():
        tenths[round(code(word)[1] * 10)] = meaning
    g_words = np.flatnonzero(words.letters == ord("G"))
    scaled = words.values[g_words] * 10.0
    whole = np.rint(scaled)
    exact = (np.abs(scaled - whole) < 1e-6) & (whole >= 0) & (whole < len(tenths))
    here = np.where(exact, tenths[np.where(exact, whole, 0).astype(np.int64)], 0)
    for word in g_words[here == 0].tolist():
        words.fault(word, f"G{words.values[word]:g} is no word of controller {controller.name}")
    for word in codes.no_effect:
        if argued := re.fullmatch(r"(G[\d.]+) ([A-Z])([\d.]+)", word):
            lines = words.lines[g_words[words.values[g_words] == code(argued[1])[1]]]
            used[argued[2]][lines[arguments[argued[2]][lines] == float(argued[3])]] = True
    groups = {}
    for group, what in (
        (_ACTION, "motion, dwell or position word"),
        (_DISTANCE, "distance mode"),
        (_FEED_MODE, "feed mode"),
        (_PLANE, "plane"),
        (_CORNERS, "exact stop or blending"),
    ):
        members = np.flatnonzero(_GROUPS[here] == group)
        words.once(g_words[members], what)
        by_line = np.zeros(words.line_count, dtype=np.uint8)
        by_line[words.lines[g_words[members]]] = here[members]
        groups[group] = by_line
    return groups


def _tolerances(
    words: Words, controller: Controller, corners: NDArray[np.uint8], arguments: Mapping[str, Floats]
) -> Floats:
    """Return the metres (lines,) by which the end of each line's block may be rounded off, 0 for an exact stop."""
    timing = controller.time
    blended = corners == _BLENDED
    # Without its letter a blend has no bound, where the control has one at all.
    unbounded = math.inf if timing.tolerance_address else timing.tolerance
    stated = np.full(words.line_count, unbounded)
    if letter := timing.tolerance_address:
        given = blended & ~np.isnan(arguments[letter])
        stated[given] = arguments[letter][given] / 1e3
        for line in np.flatnonzero(given & ~(stated > 0.0)).tolist():
            words.fault_in(line, ord(letter), "expected a tolerance above 0")
    initial = unbounded if timing.initial == "blended" else 0.0
    last = np.maximum.accumulate(np.where(corners > 0, np.arange(len(corners)), -1))
    tolerances: Floats = np.where(last >= 0, np.where(blended, stated, 0.0)[last], initial)
    return tolerances


def _switching(
    words: Words, controller: Controller, arguments: Mapping[str, Floats], used: Mapping[str, Mask]
) -> tuple[NDArray[np.uint8], Mask, Mask, Mask]:
    """Return each line's event (lines,), where it lets motion go on, where the program ends, and where it outputs axes.

    The arguments of those words are marked as used.
    """
    m_words = np.flatnonzero(words.letters == ord("M"))
    words.once(m_words, "M word")
    lines, numbers = words.lines[m_words], words.values[m_words]

    def standing(text: str) -> Mask:
        """Return which of the M words are this one, marking its argument as used."""
        _, number, argument = code(text)
        here: Mask = numbers == number
        if argument:
            here &= arguments[argument[0]][lines] == float(argument[1:])
            used[argument[0]][lines[here]] = True
        return here

    known = np.isin(numbers, [code(word)[1] for word in controller.blocks.end])
    ends, axis_output = np.zeros(words.line_count, dtype=bool), np.zeros(words.line_count, dtype=bool)
    ends[lines[known]] = True
    events = np.zeros(words.line_count, dtype=np.uint8)
    flying = np.zeros(words.line_count, dtype=bool)
    for resting in (False, True):
        for event, text in controller.event_words(resting).items():
            here = standing(text)
            events[lines[here]] = event
            flying[lines[here]] |= not resting
            known |= here
    for text in {axis.word for axis in controller.axes} - {""}:
        here = standing(text)
        axis_output[lines[here]] = True
        known |= here
    for word in m_words[~known].tolist():
        words.fault(word, f"M{words.values[word]:g} is no word of controller {controller.name}")
    return events, flying, ends, axis_output


def _held(values: NDArray[np.uint8], given: Mask, initial: int) -> NDArray[np.uint8]:
    """Carry values forward from where they are given, with `initial` before the first."""
    last = np.maximum.accumulate(np.where(given, np.arange(len(values)), -1))
    return np.where(last >= 0, values[last], np.uint8(initial))
