"""Reader: NC text to a trajectory; written on its own, it shares no formatting or rounding with the writer.

The text is taken as one array of bytes: words are found by their letters, numbers are made from eight bytes at a time,
and every state of the control is carried forward over all lines at once.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from post.controllers import AxisWord, Controller, code
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import Fault, ProgramRefused
from tapelayer.motion.trajectory import Event, Kind, Trajectory

Bytes = NDArray[np.uint8]
Eights = NDArray[np.uint64]

# Numbers made at once: what they pass through stays in the cache.
CHUNK = 1 << 15
# Digits that two times eight bytes hold, and the mantissa up to which a double is exact.
LONGEST = 16
EXACT = 2**53

_FIRST_LETTER = ord("A")
_NEWLINE = ord("\n")
# Extended addresses (`Q1=`) are taken as one byte each from here on.
_EXTENDED = 0x80
_POWERS = 10.0 ** np.arange(LONGEST + 1)
_HEADER = re.compile(r"(tapelayer|source sha256:|setup sha256:|source:|controller:) *(.*)")
_COURSE = re.compile(r"course +(\d{1,9})\b", re.IGNORECASE)

# What G words say, and which of them exclude each other in a block: an action, a distance mode, a feed mode, a plane.
_RAPID, _LINEAR, _CLOCKWISE, _COUNTERCLOCKWISE, _DWELL, _SET = range(1, 7)
_ABSOLUTE, _INCREMENTAL, _PER_MINUTE, _INVERSE_TIME, _XY, _ZX, _YZ, _NO_EFFECT = range(7, 15)
_GROUPS = np.array([0, 1, 1, 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 4, 0], dtype=np.uint8)
_ACTION, _DISTANCE, _FEED_MODE, _PLANE = 1, 2, 3, 4
_MODES = (_RAPID, _LINEAR, _CLOCKWISE, _COUNTERCLOCKWISE)
_KINDS = np.array([Kind.SWITCH, Kind.RAPID, Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE], dtype=np.uint8)
_PLANES = {"xy": _XY, "zx": _ZX, "yz": _YZ}
# Joints of a plane's axes, from the first of which a counterclockwise block turns to the second.
_PAIRS = (("x", "y"), ("z", "x"), ("y", "z"))
# Begin and end of an arc may differ this much in their distance from the centre: rounding, as controls allow.
RADIUS_TOLERANCE_MM = 0.005


@dataclass(frozen=True)
class Comment:
    """A comment of a program: its line, from 1, and its text without the signs around it."""

    line: int
    text: str


@dataclass(frozen=True, eq=False)
class Program:
    """A program that was read.

    Attributes:
        name: as the user named it.
        trajectory: its blocks; an axis is NaN until a rapid states it.
        comments: its comments, in order.
        source: base name of what it was made from, as its header says; empty where it says nothing, as below.
        source_sha256: SHA-256 of that.
        setup_sha256: SHA-256 of the effective setup.
        version: version of what wrote it.
        controller: name of the controller table it was written with.
    """

    name: str
    trajectory: Trajectory
    comments: tuple[Comment, ...]
    source: str
    source_sha256: str
    setup_sha256: str
    version: str
    controller: str


def read(
    text: bytes, controller: Controller, machine_axes: Sequence[str], speeds: Mapping[str, float], name: str
) -> Program:
    """Read a program.

    A control begins in absolute positions and feed per minute. A straight block takes the time that the control's feed
    rule gives it; a rapid that of its slowest axis, not counting axes that nothing had stated before. Courses are
    those of the program's own comments (`course 3`); where it has none they are counted: a course begins with the
    first rapid between an end of laying (shoe up, arc off) and the next beginning (shoe down, arc on), or at that
    beginning where no rapid stands between.

    Args:
        text: bytes of the program.
        controller: the control's table.
        machine_axes: joints of the machine, the columns of the trajectory.
        speeds: speed of a rapid for every joint, in m/s or rad/s.
        name: name of the file, for messages.

    Raises:
        ProgramRefused: a word is unknown, malformed or contradicts another, an axis moves before a rapid has stated
            it, a feed is missing, or the program does not end; each with line and column, all at once: first those of
            the words, and where there are none, those of the motions.
        ControllerRefused: the control has no address for one of the machine's axes.
    """
    axes = controller.addressed(machine_axes)
    source = _Source(text, controller, name)
    words = _tokens(source, controller)
    blocks = _blocks(source, words, controller)
    paths = {axis.address: _path(blocks, axis) for axis, _ in axes}
    plain = {axis.address: paths[axis.address] for axis, _ in axes if not axis.word}
    moved = _where_moved(len(blocks.rows), plain.values())
    source.refuse()
    circles = _circles(blocks, paths, controller)
    feeds = _feeds(blocks, moved)
    source.refuse()
    positions = np.empty((len(blocks.rows), len(machine_axes)))
    stated = np.zeros(len(blocks.rows), dtype=np.uint16)
    durations = np.where(blocks.kinds == Kind.DWELL, blocks.pauses, 0.0)
    for axis, index in axes:
        path = paths[axis.address]
        scale = np.deg2rad if axis.unit == "deg" else _metres
        first = path.blocks[0] if len(path.blocks) else len(positions)
        positions[:first, index] = np.nan
        positions[first:, index] = np.repeat(scale(path.positions), np.diff(path.blocks, append=len(positions)))
        stated[path.blocks] |= np.uint16(1 << index)
        # A step from where nothing was stated is NaN, which fmax passes over.
        rapid = np.flatnonzero((blocks.kinds[path.blocks] == Kind.RAPID) & ~blocks.outputs[path.blocks])
        times = np.abs(scale(path.steps[rapid])) / speeds[machine_axes[index]]
        durations[path.blocks[rapid]] = np.fmax(durations[path.blocks[rapid]], times)
    straight = np.flatnonzero(blocks.feeding & moved)
    lengths = _lengths(plain, moved, circles, controller)
    durations[straight] = 60.0 * np.where(blocks.inverse, 1.0, lengths)[straight] / feeds[straight]
    # What the control does not interpolate moves in the dwell that follows its word at once, and is one block with it.
    outputs = [path for address, path in paths.items() if address not in plain]
    turned = _where_moved(len(blocks.rows), outputs)
    turns = np.flatnonzero(blocks.outputs & turned)
    waiting = turns[blocks.kinds[np.minimum(turns + 1, len(blocks.kinds) - 1)] == Kind.DWELL]
    kinds = blocks.kinds.copy()
    kinds[turns] = Kind.LINEAR
    durations[waiting] = blocks.pauses[waiting + 1]
    kept = np.ones(len(kinds), dtype=bool)
    kept[waiting + 1] = False
    # Where it is only stated again, that belongs to the next block.
    again = blocks.outputs & ~turned
    for path in outputs:
        again[path.blocks[:1]] = False
    restated = np.flatnonzero(again)
    kept[restated] = False
    following = np.flatnonzero(kept)
    place = np.searchsorted(following, restated)
    np.bitwise_or.at(stated, following[place[place < len(following)]], stated[restated[place < len(following)]])
    rows = slice(None) if kept.all() else following
    trajectory = Trajectory(
        axes=tuple(machine_axes),
        start=np.full(len(machine_axes), np.nan),
        positions=positions[rows],
        kinds=kinds[rows],
        durations=durations[rows],
        events=blocks.events[rows],
        courses=_courses(source.comments, blocks)[rows],
        stated=stated[rows],
        lines=(blocks.rows[rows] + 1).astype(np.int32),
        centres=circles.centres[rows] if circles.any else None,
        planes=blocks.planes[rows] if circles.any else None,
    )
    said: dict[str, str] = {}
    for comment in source.comments:
        if found := _HEADER.match(comment.text):
            said.setdefault(found[1], found[2])
    return Program(
        name=name,
        trajectory=trajectory,
        comments=tuple(source.comments),
        source=said.get("source:", ""),
        source_sha256=said.get("source sha256:", ""),
        setup_sha256=said.get("setup sha256:", ""),
        version=said.get("tapelayer", ""),
        controller=said.get("controller:", ""),
    )


class _Source:
    """The text without its comments, and the faults that were found in it.

    Attributes:
        name: name of the file.
        plain: the text with comments and blocks without effect blanked, lines ended by one byte.
        comments: the comments, in order.
    """

    def __init__(self, text: bytes, controller: Controller, name: str) -> None:
        self.name = name
        self.comments: list[Comment] = []
        self._faults: list[tuple[int, int, str]] = []
        if b"\0" in text:
            raise ProgramRefused(name, [Fault(0, "is a binary file, no NC program")])
        if b"\r" in text:
            text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self.plain = bytearray(text.removeprefix(b"\xef\xbb\xbf") + b"\n")
        self._take_comments(controller.blocks.comment)
        for block in (controller.blocks.first_line, controller.blocks.last_line, *controller.codes.no_effect):
            if block and not re.fullmatch(r"[A-Z]|G[\d.]+", block):
                self._take_block(block)
        if not self.plain.isascii():
            for at in re.finditer(rb"[^\x00-\x7f]+", self.plain):
                self._fault_at(at.start(), f"expected ASCII outside comments, got {at[0].decode('utf-8', 'replace')}")
            self.refuse()

    def _take_comments(self, style: str) -> None:
        """Take the comments out of the text, blanks in their place."""
        text = self.plain
        end = line = counted = 0
        begins = [np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord(sign)) for sign in style]
        for begin in np.sort(np.concatenate(begins)).tolist():
            if begin < end:
                continue
            line += text.count(b"\n", counted, begin)
            counted = begin
            line_end = text.index(b"\n", begin)
            closed = text.find(b")", begin, line_end) if text[begin] == ord("(") else line_end
            if closed < 0:
                self._fault_at(begin, "the comment is not closed; end it with )")
                closed = line_end
            inside = text[begin + 1 : closed]
            if text[begin] == ord("(") and b"(" in inside:
                self._fault_at(begin, "a comment begins within this comment; close it before")
            end = min(closed + 1, line_end)
            text[begin:end] = b" " * (end - begin)
            self.comments.append(Comment(line + 1, inside.decode("utf-8", "replace").strip()))

    def _take_block(self, block: str) -> None:
        """Blank the lines that consist of a block, but for spaces, case and a block number."""
        wanted = block.upper().replace(" ", "").encode("ascii")
        # Its rarest sign leads to the few lines that can be it.
        sign = next((wanted[i : i + 1] for i in range(len(wanted)) if not wanted[i : i + 1].isalnum()), wanted[:1])
        at = self.plain.find(sign)
        while at >= 0:
            begin, end = self.plain.rfind(b"\n", 0, at) + 1, self.plain.index(b"\n", at)
            line = self.plain[begin:end].upper().translate(None, b" \t")
            if re.sub(rb"^N\d+", b"", line) == wanted:
                self.plain[begin:end] = b" " * (end - begin)
            at = self.plain.find(sign, end)

    def _fault_at(self, byte: int, sentence: str) -> None:
        line_begin = self.plain.rfind(b"\n", 0, byte) + 1
        self._faults.append((self.plain.count(b"\n", 0, byte) + 1, byte - line_begin + 1, sentence))

    def fault(self, line: int, word: int, sentence: str) -> None:
        """Note a fault of a line (from 0): of its word of that number (from 0), or of the whole line (-1)."""
        self._faults.append((line + 1, -1 - word, sentence))

    def refuse(self) -> None:
        """Raise what was found, if anything was.

        Raises:
            ProgramRefused: all faults, in the order of the text.
        """
        if not self._faults:
            return
        ends = np.flatnonzero(np.frombuffer(self.plain, dtype=np.uint8) == _NEWLINE)
        begins = np.concatenate([[0], ends[:-1] + 1])
        faults = []
        for line, column, sentence in self._faults:
            if column < 0:
                text = np.frombuffer(self.plain[begins[line - 1] : ends[line - 1]], dtype=np.uint8)
                column = int(np.flatnonzero(text >= _FIRST_LETTER)[-1 - column]) + 1
            faults.append(Fault(line, sentence, column))
        raise ProgramRefused(self.name, sorted(dict.fromkeys(faults), key=lambda fault: (fault.line, fault.column)))


@dataclass(frozen=True, eq=False)
class _Words:
    """The words of the text.

    Attributes:
        source: the text they are from.
        letters: (m,) address of each word: its letter, or a code from _EXTENDED on.
        values: (m,) the number after it.
        lines: (m,) line of each word, from 0.
        firsts: (lines + 1,) index of each line's first word.
    """

    source: _Source
    letters: Bytes
    values: Floats
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

    def once(self, found: Ints, what: str) -> None:
        """Note a fault where two of the words with these indices stand in one line."""
        for second in (np.flatnonzero(np.diff(self.lines[found]) == 0) + 1).tolist():
            self.fault(int(found[second]), f"a second {what} in one block; write it in a block of its own")

    def of(self, letter: int, shown: str) -> Ints:
        """Indices of the words with an address, of which a line has one at most."""
        found = np.flatnonzero(self.letters == letter)
        self.once(found, f"{shown} word")
        return found

    def by_line(self, letter: int, shown: str) -> Floats:
        """Number (lines,) after an address in each line, NaN where it does not stand."""
        found = self.of(letter, shown)
        values = np.full(self.line_count, np.nan)
        values[self.lines[found]] = self.values[found]
        return values

    def fault_in(self, line: int, letter: int, sentence: str) -> None:
        """Note a fault of the word with an address in a line, or of the line where it has none."""
        place = np.flatnonzero(self.letters[self.firsts[line] : self.firsts[line + 1]] == letter)
        self.source.fault(line, int(place[0]) if len(place) else -1, sentence)


def _tokens(source: _Source, controller: Controller) -> _Words:
    """Words of the text: letters and numbers with any spaces between them."""
    text = bytes(source.plain.translate(bytes(range(256)).upper(), b" \t"))
    extended = _extended(controller)
    for number, address in enumerate(extended):
        text = text.replace(address.encode("ascii"), bytes([_EXTENDED + number]))
    # Numbers are taken eight bytes back from their ends, so something must stand in front.
    padded = b"\0" * LONGEST + text
    data = np.frombuffer(padded, dtype=np.uint8)[LONGEST:]
    begins = np.flatnonzero(data >= _FIRST_LETTER)
    newlines = np.flatnonzero(data == _NEWLINE)
    firsts = np.concatenate([[0], np.searchsorted(begins, newlines)])
    counts = np.diff(firsts)
    lines = np.repeat(np.arange(len(newlines), dtype=np.int32), counts)
    ends = np.empty_like(begins)
    ends[:-1] = begins[1:]
    ends[firsts[1:][counts > 0] - 1] = newlines[counts > 0]
    letters = data[begins]
    values = np.empty(len(begins))
    malformed: list[int] = []
    for first in range(0, len(begins), CHUNK):
        page = slice(first, first + CHUNK)
        values[page], good = _numbers(padded, begins[page] + 1, ends[page])
        malformed += (np.flatnonzero(~good) + first).tolist()
    words = _Words(source, letters, values, lines, firsts)
    for word in malformed:
        address = _shown(int(letters[word]), extended)
        digits = text[begins[word] + 1 : ends[word]].decode("ascii", "replace")
        words.fault(word, f"expected a number after {address}, got {digits or 'nothing'}")
    starts = np.concatenate([[0], newlines[:-1] + 1])
    for line in np.flatnonzero((data[starts] < _FIRST_LETTER) & (data[starts] != _NEWLINE)).tolist():
        source.fault(line, -1, f"expected a word (a letter and a number), got {chr(data[starts[line]])}")
    return words


def _shown(letter: int, extended: Sequence[str]) -> str:
    return extended[letter - _EXTENDED] if letter >= _EXTENDED else chr(letter)


def _eight(byte: int) -> np.uint64:
    return np.uint64(byte * 0x0101010101010101)


def _numbers(padded: bytes, begins: Ints, ends: Ints) -> tuple[Floats, Mask]:
    """Numbers between two places each, and whether they are well formed: sign, digits and a point, one digit at least.

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
        # The few that are too long for a mantissa that a double holds are left to Python.
        for at in longer[(length[longer] > LONGEST) | (mantissa >= EXACT)].tolist():
            text = padded[LONGEST + begins[at] : LONGEST + ends[at]]
            good[at] = re.fullmatch(rb"[+-]?(\d+\.?\d*|\.\d+)", text) is not None
            values[at], decimals[at] = (abs(float(text)) if good[at] else 0.0), 0
    good &= length > points
    values /= _POWERS[decimals]
    return np.where(negative, -values, values), good


def _digits(eights: Eights, length: Ints) -> tuple[Eights, Ints, Mask]:
    """Last bytes of each eight as digits 0 to 9, its point's place from the right (-1: none), and whether that is all.

    The point keeps its place with the value 0x1E; bytes before the last `length` (1 to 8) are zero.
    """
    mask = np.uint64(2**64 - 1) << ((8 - length).astype(np.uint64) << np.uint64(3))
    digits = (eights ^ _eight(0x30)) & mask
    difference = digits ^ _eight(0x1E)
    zero = (difference - _eight(0x01)) & ~difference & _eight(0x80)
    # One bit at the point's byte; the product's top byte is then the byte of the factor with that place.
    place = ((zero >> np.uint64(7)) * np.uint64(0x0706050403020100)) >> np.uint64(56)
    point = np.where(zero == 0, -1, np.minimum(place, np.uint64(7)).astype(np.int64))
    without = np.where(zero == 0, digits, digits & ~((zero << np.uint64(1)) - (zero >> np.uint64(7))))
    single = (zero & (zero - np.uint64(1))) == 0
    good = single & ((((without + _eight(0x76)) | without) & _eight(0x80)) == 0)
    return digits, point, good


def _closed(digits: Eights, point: Ints, carried: Eights | np.uint64) -> Eights:
    """Digits without their point: those before it move up by one byte, and `carried` takes the freed place."""
    place = (np.maximum(7 - point, 0).astype(np.uint64)) << np.uint64(3)
    before = (np.uint64(1) << np.minimum(place, np.uint64(56))) - np.uint64(1)
    after = ~((before << np.uint64(8)) | np.uint64(0xFF))
    return np.where(point < 0, digits, ((digits & before) << np.uint64(8)) | (digits & after) | carried)


def _eight_digits(digits: Eights) -> Eights:
    """Number (below 1e8) of eight digit values, the first in the lowest byte: pairs, fours, eights."""
    pairs = (digits * np.uint64(10) + (digits >> np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    fours = (pairs * np.uint64(100) + (pairs >> np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    return (fours * np.uint64(10000) + (fours >> np.uint64(32))) & np.uint64(0xFFFFFFFF)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """What the lines do.

    Attributes:
        words: the words of the text.
        rows: (n,) lines (from 0) that are blocks of the trajectory.
        of_line: (lines,) block of each line that is one.
        kinds: (n,) `Kind` of each.
        events: (n,) `Event` of each.
        pauses: (n,) seconds of each dwell, NaN elsewhere.
        outputs: (n,) blocks that consist of axis words which the control does not interpolate.
        inverse: (n,) whether feeds are inverse time.
        feeds: (lines,) feed word of each line, NaN without.
        mode_changes: (lines,) where a feed mode is stated.
        incremental: (lines,) whether axis words are increments.
        sets: (lines,) whether axis words set the present position.
        planes: (n,) plane of circular blocks: 0 XY, 1 ZX, 2 YZ.
        offsets: centre of each circular block from its begin along x, y, z: (n,) each, NaN where not written.
        axes: indices of the words of each axis address.
        letters: one byte for each axis address, as in the words.
    """

    words: _Words
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
    axes: Mapping[str, Ints]
    letters: Mapping[str, int]

    @cached_property
    def feeding(self) -> Mask:
        """Blocks (n,) whose time comes from a feed word."""
        return np.isin(self.kinds, (Kind.LINEAR, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE))

    def fault(self, line: int, address: str, sentence: str) -> None:
        """Note a fault of an axis word in a line, or of the line where it has none."""
        self.words.fault_in(line, self.letters[address], sentence)


def _blocks(source: _Source, words: _Words, controller: Controller) -> _Blocks:
    """Meaning of every line, modal state carried forward."""
    codes = controller.codes
    letters = {axis.address: _letter(axis.address, controller) for axis in controller.axes}
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
    events, ends, takes = _switching(words, controller, arguments, used)
    used[codes.dwell_address] |= dwells
    used[controller.feed.address] |= ~dwells
    for letter in set(controller.arcs.offsets) & set(used):
        used[letter] |= circular
    _check_letters(words, controller, arguments, used, letters.values())
    for line in np.flatnonzero(moves & (mode == 0)).tolist():
        source.fault(line, 0, f"axis words before any {codes.rapid} or {codes.linear}; state one of them")
    for line in np.flatnonzero((events > 0) & (moves | dwells | sets)).tolist():
        words.fault_in(line, ord("M"), "a switching word stands in a block with a motion or dwell; give it its own")
    for axis in controller.axes:
        missing = ~takes[words.lines[axes[axis.address]]] & bool(axis.word)
        for word in axes[axis.address][missing].tolist():
            words.fault(word, f"expected {axis.word} in a block with {axis.address.rstrip('=')}")
    alone = any(axis.alone for axis in controller.axes)
    for line in np.flatnonzero(takes & (~has_output | dwells | sets | (alone & has_axis))).tolist():
        words.fault_in(line, ord("M"), "expected the axis words that this word takes, and no others that it does not")
    pauses = arguments[codes.dwell_address]
    for line in np.flatnonzero(dwells & (has_axis | has_output | ~(pauses >= 0.0))).tolist():
        sentence = f"expected {codes.dwell} {codes.dwell_address} and the seconds, nothing else"
        words.fault_in(line, ord("G"), sentence)
    feeds = np.where(dwells, np.nan, arguments[controller.feed.address])
    for line in np.flatnonzero(feeds <= 0.0).tolist():
        words.fault_in(line, ord(controller.feed.address), "expected a feed above 0")
    _check_end(words, controller, ends)
    outputs = takes & has_output & ~has_axis
    blocks = moves | dwells | outputs | (events > 0)
    kinds = np.where(moves, _KINDS[mode], np.where(dwells, Kind.DWELL, np.where(outputs, Kind.RAPID, Kind.SWITCH)))
    source.refuse()
    rows = np.flatnonzero(blocks)
    if not len(rows):
        raise ProgramRefused(source.name, [Fault(0, "the program has no blocks")])
    distance, feed_mode, plane = groups[_DISTANCE], groups[_FEED_MODE], groups[_PLANE]
    offsets = [arguments.get(letter, np.full(words.line_count, np.nan))[rows] for letter in controller.arcs.offsets]
    return _Blocks(
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
        axes=axes,
        letters=letters,
    )


def _letter(address: str, controller: Controller) -> int:
    """Byte that stands for an address."""
    extended = _extended(controller)
    return _EXTENDED + extended.index(address) if address in extended else ord(address)


def _extended(controller: Controller) -> list[str]:
    return [axis.address for axis in controller.axes if len(axis.address) > 1]


def _arguments(controller: Controller) -> list[str]:
    """Letters of further words: feed, dwell time, arc centres, and what stands behind G and M words."""
    codes = controller.codes
    spoken = [*controller.events.values(), *controller.events_at_rest.values(), *codes.no_effect]
    spoken += [axis.word for axis in controller.axes]
    with_argument = (re.fullmatch(r"[GM][\d.]+ ([A-Z])[\d.]+", word) for word in spoken)
    letters = {codes.dwell_address, controller.feed.address, *(found[1] for found in with_argument if found)}
    if controller.arcs.planes:
        letters |= set(controller.arcs.offsets)
    return sorted(letters)


def _check_letters(
    words: _Words,
    controller: Controller,
    arguments: Mapping[str, Floats],
    used: Mapping[str, Mask],
    axes: Collection[int],
) -> None:
    """Note words that the control does not know, or that have no meaning where they stand."""
    for letter, belongs in used.items():
        for line in np.flatnonzero(~np.isnan(arguments[letter]) & ~belongs).tolist():
            words.fault_in(line, ord(letter), f"the {letter} word has no meaning in this block; remove it")
    ignored = {word for word in controller.codes.no_effect if len(word) == 1}
    known = np.zeros(256, dtype=bool)
    known[[ord(letter) for letter in {"N", "G", "M"} | set(arguments) | ignored] + list(axes)] = True
    for word in np.flatnonzero(~known[words.letters]).tolist():
        shown = _shown(int(words.letters[word]), _extended(controller))
        words.fault(word, f"{shown} is no word of controller {controller.name}")


def _check_end(words: _Words, controller: Controller, ends: Mask) -> None:
    """Note that the program does not end, or goes on after its end."""
    last = int(np.argmax(ends)) if ends.any() else words.line_count
    if last == words.line_count:
        sentence = f"the program does not end with {' or '.join(controller.blocks.end)}; it may be cut off"
        words.source.fault(max(words.line_count - 2, 0), -1, sentence)
    for line in (np.flatnonzero(np.diff(words.firsts)[last + 1 :]) + last + 1)[:1].tolist():
        words.source.fault(line, 0, f"stands after the end of the program in line {last + 1}")


def _preparatory(
    words: _Words, controller: Controller, arguments: Mapping[str, Floats], used: Mapping[str, Mask]
) -> dict[int, Bytes]:
    """Meaning (lines,) of each line's G word of each group, 0 without; their arguments are marked as used."""
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
    meanings.pop("", None)
    meanings |= {word: _PLANES[plane] for plane, word in codes.planes.items()}
    meanings |= {word: _NO_EFFECT for word in codes.no_effect if re.fullmatch(r"G[\d.]+( [A-Z][\d.]+)?", word)}
    # G words go to tenths (G92.1); what is none of them stays 0.
    tenths = np.zeros(10001, dtype=np.uint8)
    for word, meaning in meanings.items():
        tenths[round(code(word)[1] * 10)] = meaning
    found = np.flatnonzero(words.letters == ord("G"))
    scaled = words.values[found] * 10.0
    whole = np.rint(scaled)
    exact = (np.abs(scaled - whole) < 1e-6) & (whole >= 0) & (whole < len(tenths))
    here = np.where(exact, tenths[np.where(exact, whole, 0).astype(np.int64)], 0)
    for word in found[here == 0].tolist():
        words.fault(word, f"G{words.values[word]:g} is no word of controller {controller.name}")
    for word in codes.no_effect:
        if argued := re.fullmatch(r"(G[\d.]+) ([A-Z])([\d.]+)", word):
            lines = words.lines[found[words.values[found] == code(argued[1])[1]]]
            used[argued[2]][lines[arguments[argued[2]][lines] == float(argued[3])]] = True
    groups = {}
    for group, what in (
        (_ACTION, "motion, dwell or position word"),
        (_DISTANCE, "distance mode"),
        (_FEED_MODE, "feed mode"),
        (_PLANE, "plane"),
    ):
        members = np.flatnonzero(_GROUPS[here] == group)
        words.once(found[members], what)
        by_line = np.zeros(words.line_count, dtype=np.uint8)
        by_line[words.lines[found[members]]] = here[members]
        groups[group] = by_line
    return groups


def _switching(
    words: _Words, controller: Controller, arguments: Mapping[str, Floats], used: Mapping[str, Mask]
) -> tuple[NDArray[np.uint8], Mask, Mask]:
    """Event (lines,) of each line, where the program ends, and where the word stands that takes axes.

    The arguments of those words are marked as used.
    """
    found = np.flatnonzero(words.letters == ord("M"))
    words.once(found, "M word")
    lines, numbers = words.lines[found], words.values[found]

    def standing(text: str) -> Mask:
        """Which of the M words say this."""
        _, number, argument = code(text)
        here: Mask = numbers == number
        if argument:
            here &= arguments[argument[0]][lines] == float(argument[1:])
            used[argument[0]][lines[here]] = True
        return here

    known = np.isin(numbers, [code(word)[1] for word in controller.blocks.end])
    ends, takes = np.zeros(words.line_count, dtype=bool), np.zeros(words.line_count, dtype=bool)
    ends[lines[known]] = True
    events = np.zeros(words.line_count, dtype=np.uint8)
    for resting in (False, True):
        for event, text in controller.event_words(resting).items():
            here = standing(text)
            events[lines[here]] = event
            known |= here
    for text in {axis.word for axis in controller.axes} - {""}:
        here = standing(text)
        takes[lines[here]] = True
        known |= here
    for word in found[~known].tolist():
        words.fault(word, f"M{words.values[word]:g} is no word of controller {controller.name}")
    return events, ends, takes


def _held(values: NDArray[np.uint8], given: Mask, initial: int) -> NDArray[np.uint8]:
    """Values carried forward from where they are given, `initial` before the first."""
    last = np.maximum.accumulate(np.where(given, np.arange(len(values)), -1))
    return np.where(last >= 0, values[last], np.uint8(initial))


@dataclass(frozen=True, eq=False)
class _Path:
    """How one axis moves, in the unit it is written in.

    Attributes:
        blocks: (m,) blocks in which its word stands.
        positions: (m,) at the end of each.
        steps: (m,) change within each, NaN in the first.
    """

    blocks: Ints
    positions: Floats
    steps: Floats

    def step(self, block: int) -> float:
        """Change within a block."""
        place = int(np.searchsorted(self.blocks, block))
        return float(self.steps[place]) if place < len(self.blocks) and self.blocks[place] == block else 0.0

    def before(self, block: int) -> float:
        """Position at a block's begin."""
        return float(self.positions[int(np.searchsorted(self.blocks, block)) - 1])


def _path(blocks: _Blocks, axis: AxisWord) -> _Path:
    """Motion of an axis: absolute and incremental words, and words that set its position."""
    words, address = blocks.words, axis.address
    lines, values = words.lines[blocks.axes[address]], words.values[blocks.axes[address]]
    # An M word that takes the number knows no increments.
    incremental, sets = blocks.incremental[lines] & (not axis.word), blocks.sets[lines]
    if np.any(incremental | sets):
        positions = _absolute(blocks, address, lines, values)
        lines, values, incremental, positions = lines[~sets], values[~sets], incremental[~sets], positions[~sets]
    else:
        positions = values
    steps = np.diff(positions, prepend=np.nan)
    steps[incremental] = values[incremental]
    places = blocks.of_line[lines]
    straight = np.flatnonzero(blocks.feeding)[:1]
    if len(straight) and (not len(places) or straight[0] <= places[0]):
        sentence = f"a feed motion before a rapid has stated axis {address.rstrip('=')}; state every axis first"
        words.source.fault(int(blocks.rows[straight[0]]), 0, sentence)
    return _Path(places, positions, steps)


def _absolute(blocks: _Blocks, address: str, lines: NDArray[np.int32], values: Floats) -> Floats:
    """Absolute positions (m,) at an axis's words, of which some are incremental or set its position (NaN there)."""
    positions = np.full(len(lines), np.nan)
    sets = np.flatnonzero(blocks.sets[lines])
    position, offset = np.nan, 0.0
    for begin, end in zip([0, *(sets + 1)], [*sets, len(lines)], strict=True):
        incremental = blocks.incremental[lines[begin:end]]
        stretch = values[begin:end]
        if len(stretch):
            sums = np.cumsum(np.where(incremental, stretch, 0.0))
            last = np.maximum.accumulate(np.where(incremental, -1, np.arange(len(stretch))))
            anchors = np.where(last < 0, position, stretch[last] + offset - sums[last])
            positions[begin:end] = np.where(incremental, anchors + sums, stretch + offset)
            lost = np.flatnonzero(np.isnan(positions[begin:end]))
            if len(lost):
                sentence = f"an increment of {address.rstrip('=')} before a rapid has stated it"
                blocks.fault(int(lines[begin + lost[0]]), address, sentence)
            position = float(positions[end - 1])
        if end < len(lines):
            if np.isnan(position):
                blocks.fault(int(lines[end]), address, f"sets {address.rstrip('=')} before a rapid has stated it")
            offset = position - float(values[end])
    return positions


def _feeds(blocks: _Blocks, moved: Mask) -> Floats:
    """Feed (n,) that holds in each block, per minute or inverse time; NaN where none does."""
    line_numbers = np.arange(len(blocks.feeds))
    last = np.maximum.accumulate(np.where(np.isnan(blocks.feeds), -1, line_numbers))
    changed = np.maximum.accumulate(np.where(blocks.mode_changes, line_numbers, -1))
    rows = blocks.rows
    feeds = np.where((last >= 0) & (last >= changed), blocks.feeds[last], np.nan)[rows]
    # One over the minutes of one block says nothing of the next.
    feeds = np.where(blocks.inverse, blocks.feeds[rows], feeds)
    missing = blocks.feeding & moved & np.isnan(feeds)
    # Where a feed per minute is missing, only the first of the blocks that miss it is named.
    modal = missing & ~blocks.inverse
    for row in np.flatnonzero(missing & ~(modal & np.concatenate([[False], modal[:-1]]))).tolist():
        blocks.words.source.fault(int(rows[row]), 0, "a feed motion without a feed word; give it one")
    return feeds


@dataclass(frozen=True, eq=False)
class _Circles:
    """Geometry of the circular blocks.

    Attributes:
        any: whether there are any.
        centres: (n, 3) metres along x, y, z, NaN where there is none.
        blocks: (m,) blocks that are circular.
        chords: addresses (first, second) of the plane's axes of each.
        lengths: (m,) of the arcs in millimetres.
    """

    any: bool
    centres: Floats
    blocks: Ints
    chords: Sequence[tuple[str, str]]
    lengths: Floats


def _circles(blocks: _Blocks, paths: Mapping[str, _Path], controller: Controller) -> _Circles:
    """Centres and arc lengths of circular blocks; notes those that are none."""
    circular = np.flatnonzero(np.isin(blocks.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    if not len(circular):
        return _Circles(False, np.empty((0, 3)), circular, (), np.empty(0))
    of_joint = {joint: axis.address for axis in controller.axes for joint in axis.joints if axis.address in paths}
    centres = np.full((len(blocks.rows), 3), np.nan)
    lengths = np.zeros(len(circular))
    chords: list[tuple[str, str]] = []
    for number, block in enumerate(circular.tolist()):
        pair = _PAIRS[int(blocks.planes[block])]
        line = int(blocks.rows[block])
        offsets = [float(offset[block]) for offset in blocks.offsets]
        chords.append((of_joint.get(pair[0], ""), of_joint.get(pair[1], "")))
        letters = [controller.arcs.offsets["xyz".index(joint)] for joint in pair]
        (third,) = {"x", "y", "z"} - set(pair)
        if "" in chords[-1]:
            blocks.words.source.fault(line, 0, f"a circular block, but the machine has no {' and '.join(pair)}")
        elif not np.isnan(offsets["xyz".index(third)]):
            letter = controller.arcs.offsets["xyz".index(third)]
            blocks.words.fault_in(line, ord(letter), f"{letter} lies outside the plane of this circular block")
        elif all(np.isnan(offsets["xyz".index(joint)]) for joint in pair):
            blocks.words.source.fault(line, 0, f"a circular block without its centre; give {' or '.join(letters)}")
        else:
            steps = np.array([paths[address].step(block) for address in chords[-1]])
            centre = np.nan_to_num([offsets["xyz".index(joint)] for joint in pair])
            radii = np.hypot(*centre), np.hypot(*(steps - centre))
            if not abs(radii[1] - radii[0]) <= RADIUS_TOLERANCE_MM or not np.any(np.abs(steps) > 0.0):
                sentence = (
                    f"begin and end of a circular block lie {radii[0]:.3f} and {radii[1]:.3f} mm from its centre; "
                    "expected equal distances and an end apart from the begin"
                )
                blocks.words.source.fault(line, 0, sentence)
            cross = -centre[0] * (steps - centre)[1] + centre[1] * (steps - centre)[0]
            sweep = float(np.arctan2(cross, -centre @ (steps - centre)))
            turn = 2.0 * np.pi if blocks.kinds[block] == Kind.COUNTERCLOCKWISE else -2.0 * np.pi
            lengths[number] = abs(sweep if sweep * turn > 0.0 else sweep + turn) * (radii[0] + radii[1]) / 2.0
            for joint, address, offset in zip(pair, chords[-1], centre, strict=True):
                centres[block, "xyz".index(joint)] = _metres(paths[address].before(block) + offset)
    return _Circles(True, centres, circular, chords, lengths)


def _where_moved(count: int, paths: Iterable[_Path]) -> Mask:
    """Blocks (n,) in which one of the axes moves."""
    moved = np.zeros(count, dtype=bool)
    for path in paths:
        moved[path.blocks[np.abs(path.steps) > 0.0]] = True
    return moved


def _lengths(paths: Mapping[str, _Path], moved: Mask, circles: _Circles, controller: Controller) -> Floats:
    """Length (n,) of each block that its feed is along, in written units, by the control's rule."""
    lengths = np.zeros(len(moved))
    for group in controller.feed.path:
        norms = _norms([paths[address] for address in group if address in paths], len(moved))
        for block, chord, arc in zip(circles.blocks.tolist(), circles.chords, circles.lengths.tolist(), strict=True):
            if set(chord) <= set(group):
                steps = [paths[address].step(block) for address in group if address in paths and address not in chord]
                norms[block] = np.hypot(arc, np.linalg.norm(steps))
        lengths = np.where(lengths > 0.0, lengths, norms)
    rest = moved & ~(lengths > 0.0)
    if controller.feed.otherwise == "norm":
        return np.where(rest, _norms(list(paths.values()), len(moved)), lengths)
    for path in paths.values():
        here = np.flatnonzero(rest[path.blocks])
        lengths[path.blocks[here]] = np.fmax(lengths[path.blocks[here]], np.abs(path.steps[here]))
    return lengths


def _norms(paths: Sequence[_Path], count: int) -> Floats:
    """Root (n,) of the summed squares of some axes' changes within each block."""
    squares = np.zeros(count)
    for path in paths:
        squares[path.blocks] += path.steps * path.steps
    return np.sqrt(squares)


def _courses(comments: Sequence[Comment], blocks: _Blocks) -> NDArray[np.int32]:
    """Index (n,) of the course that each block serves, -1 before the first."""
    found = [(comment.line - 1, int(number[1])) for comment in comments if (number := _COURSE.match(comment.text))]
    if found:
        lines, numbers = np.array(found).T
        return np.concatenate([[-1], numbers - 1])[np.searchsorted(lines, blocks.rows, "right")].astype(np.int32)
    begins = np.flatnonzero(np.isin(blocks.events, (Event.SHOE_DOWN, Event.ARC_ON)))
    ends = np.flatnonzero(np.isin(blocks.events, (Event.SHOE_UP, Event.ARC_OFF)))
    rapids = np.flatnonzero(blocks.kinds == Kind.RAPID)
    starts = []
    for previous, begin in zip([-1, *begins[:-1].tolist()][: len(begins)], begins.tolist(), strict=True):
        ended = ends[np.searchsorted(ends, previous) : np.searchsorted(ends, begin)]
        link = rapids[np.searchsorted(rapids, ended[0] if len(ended) else previous) :][:1] if previous >= 0 else [0]
        starts.append(int(link[0]) if len(link) and link[0] < begin else begin)
    return (np.searchsorted(starts, np.arange(len(blocks.rows)), "right") - 1).astype(np.int32)


def _metres(millimetres: Floats) -> Floats:
    return millimetres / 1e3
