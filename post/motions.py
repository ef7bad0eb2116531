"""Motions: positions, distances and feeds of a program's axes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from post.blocks import Blocks
from post.controllers import Controller
from post.controllers.table import AxisWord
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.motion.trajectory import Kind

# Joints of each plane's axes: a counterclockwise block turns from the first to the second.
_PAIRS = (("x", "y"), ("z", "x"), ("y", "z"))
# The two ends of an arc may differ this much in their distance from the centre, as controls allow for rounding.
RADIUS_TOLERANCE_MM = 0.005


@dataclass(frozen=True, eq=False)
class AxisPath:
    """How one axis moves, in the unit it is written in.

    Attributes:
        blocks: (m,) blocks that contain its word.
        positions: (m,) at the end of each of them.
        steps: (m,) change within each of them, NaN in the first.
    """

    blocks: Ints
    positions: Floats
    steps: Floats

    def step(self, block: int) -> float:
        """Return the change within a block."""
        place = int(np.searchsorted(self.blocks, block))
        return float(self.steps[place]) if place < len(self.blocks) and self.blocks[place] == block else 0.0

    def steps_in(self, blocks: Ints) -> Floats:
        """Return the change within each of the blocks (m,), 0 in those without the axis's word."""
        place = np.searchsorted(self.blocks, blocks)
        here = np.append(self.blocks, -1)[place] == blocks
        return np.where(here, np.append(self.steps, 0.0)[place], 0.0)

    def before(self, block: int) -> float:
        """Return the position at a block's beginning."""
        return float(self.positions[int(np.searchsorted(self.blocks, block)) - 1])


def from_mm(millimetres: Floats) -> Floats:
    """Return metres for millimetres; any shape."""
    return millimetres / 1e3


def axis_path(blocks: Blocks, axis: AxisWord) -> AxisPath:
    """Return the motion of an axis from its absolute and incremental words, and words that set its position."""
    words, address = blocks.words, axis.address
    lines, values = words.lines[blocks.axes[address]], words.values[blocks.axes[address]]
    # A number that belongs to an M word is never an increment.
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
    return AxisPath(places, positions, steps)


def _absolute(blocks: Blocks, address: str, lines: NDArray[np.int32], values: Floats) -> Floats:
    """Return absolute positions (m,) at an axis's words, some of them incremental or setting its position (NaN)."""
    positions = np.full(len(lines), np.nan)
    sets = np.flatnonzero(blocks.sets[lines])
    position, offset = np.nan, 0.0
    for begin, end in zip([0, *(sets + 1)], [*sets, len(lines)], strict=True):
        incremental = blocks.incremental[lines[begin:end]]
        part = values[begin:end]
        if len(part):
            sums = np.cumsum(np.where(incremental, part, 0.0))
            last = np.maximum.accumulate(np.where(incremental, -1, np.arange(len(part))))
            anchors = np.where(last < 0, position, part[last] + offset - sums[last])
            positions[begin:end] = np.where(incremental, anchors + sums, part + offset)
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


def feeds_of(blocks: Blocks, moved: Mask) -> Floats:
    """Return the feed (n,) in effect in each block, per minute or inverse time; NaN where there is none."""
    line_numbers = np.arange(len(blocks.feeds))
    last = np.maximum.accumulate(np.where(np.isnan(blocks.feeds), -1, line_numbers))
    changed = np.maximum.accumulate(np.where(blocks.mode_changes, line_numbers, -1))
    rows = blocks.rows
    feeds = np.where((last >= 0) & (last >= changed), blocks.feeds[last], np.nan)[rows]
    # An inverse-time feed holds for its own block only.
    feeds = np.where(blocks.inverse, blocks.feeds[rows], feeds)
    missing = blocks.feeding & moved & np.isnan(feeds)
    # Where a feed per minute is missing in consecutive blocks, only the first of them is reported.
    modal = missing & ~blocks.inverse
    for row in np.flatnonzero(missing & ~(modal & np.concatenate([[False], modal[:-1]]))).tolist():
        blocks.words.source.fault(int(rows[row]), 0, "a feed motion without a feed word; give it one")
    return feeds


@dataclass(frozen=True, eq=False)
class Circles:
    """The geometry of circular blocks.

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


def circles_of(blocks: Blocks, paths: Mapping[str, AxisPath], controller: Controller) -> Circles:
    """Return centres and arc lengths of circular blocks, noting faults of malformed ones."""
    circular = np.flatnonzero(np.isin(blocks.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    if not len(circular):
        return Circles(False, np.empty((0, 3)), circular, (), np.empty(0))
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
                centres[block, "xyz".index(joint)] = from_mm(paths[address].before(block) + offset)
    return Circles(True, centres, circular, chords, lengths)


def where_moved(count: int, paths: Iterable[AxisPath]) -> Mask:
    """Return the blocks (n,) in which any of the axes moves."""
    moved = np.zeros(count, dtype=bool)
    for path in paths:
        moved[path.blocks[np.abs(path.steps) > 0.0]] = True
    return moved


def lengths_of(paths: Mapping[str, AxisPath], moved: Mask, circles: Circles, controller: Controller) -> Floats:
    """Return the length (n,) of each block to which its feed refers, in written units, by the control's rule."""
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


def _norms(paths: Sequence[AxisPath], count: int) -> Floats:
    """Return the root (n,) of the summed squares of some axes' changes within each block."""
    squares = np.zeros(count)
    for path in paths:
        squares[path.blocks] += path.steps * path.steps
    return np.sqrt(squares)
