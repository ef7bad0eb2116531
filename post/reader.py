"""Reader: NC text to a trajectory; written independently, it shares no formatting or rounding with the writer.

It has five steps, each over all lines at once: `source` takes the comments out, `scan` reads letters and numbers,
`blocks` carries the control's modes forward and interprets every line, `capacity` judges what the control can take, and
`motions` computes positions and distances.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from post.blocks import Blocks, blocks_of
from post.capacity import check_capacity, check_exponents
from post.controllers import Controller
from post.controllers.table import AxisWord
from post.motions import AxisPath, axis_path, circles_of, feeds_of, from_mm, lengths_of, where_moved
from post.scan import words_of
from post.source import Comment, Source
from tapelayer.arrays import Floats, Mask
from tapelayer.motion.time_law import Limits, by_feed_word, rapids, timed
from tapelayer.motion.trajectory import Event, Kind, Trajectory

_HEADER = re.compile(r"(tapelayer|source sha256:|setup sha256:|source:|controller:) *(.*)")
_MARK = re.compile(r"(?:course|pass) +([0-9]{1,9})\b(?:, *([0-9]{1,9}) +of\b)?", re.IGNORECASE)


@dataclass(frozen=True)
class Mark:
    """A comment that begins a course or pass.

    Attributes:
        line: of the comment, from 1.
        number: that it gives.
        place: in the program, from 1, that it gives beside; 0 where it gives none.
    """

    line: int
    number: int
    place: int


@dataclass(frozen=True, eq=False)
class Program:
    """A program read from text.

    Attributes:
        name: as the user named it.
        trajectory: its blocks; an axis is NaN until a rapid states it.
        comments: its comments, in order.
        marks: those of them that begin a course or pass.
        source: base name of its source, from its header; like the next four empty where the header lacks it.
        source_sha256: SHA-256 of the source.
        setup_sha256: SHA-256 of the effective setup.
        version: version of the package that wrote it.
        controller: name of the controller table used to write it.
    """

    name: str
    trajectory: Trajectory
    comments: tuple[Comment, ...]
    marks: tuple[Mark, ...]
    source: str
    source_sha256: str
    setup_sha256: str
    version: str
    controller: str


def read(text: bytes, controller: Controller, machine_axes: Sequence[str], limits: Limits, name: str) -> Program:
    """Read a program.

    A control begins in absolute positions and feed per minute. A straight block asks for the time given by the
    control's feed rule, a rapid for that of its slowest axis, ignoring axes not stated before; both take what the
    control needs by its rule and the axes' accelerations. Courses come from the program's own comments (`course 3`,
    `pass 3`); without comments they are counted: a course begins with the first rapid between an end of laying (shoe
    up, arc off) and the next beginning (shoe down, arc on), or there without a rapid.

    Args:
        text: bytes of the program.
        controller: the control's table.
        machine_axes: joints of the machine, the columns of the trajectory.
        limits: of these joints.
        name: name of the file, for messages.

    Raises:
        ProgramRefused: a word is unknown, malformed, beyond what the control takes or contradicts another, an axis
            moves or an output turns one before rapids have stated it, a feed is missing, or the program does not end;
            each with line and column, all at once: faults of the words or, without any, those of the motions.
        ControllerRefused: the control has no address for one of the machine's axes.
    """
    axes = controller.addressed(machine_axes)
    source = Source(text, controller, name)
    check_exponents(source)
    words = words_of(source, controller)
    blocks = blocks_of(source, words, controller)
    check_capacity(blocks, controller)
    paths = {axis.address: axis_path(blocks, axis) for axis, _ in axes}
    plain = {axis.address: paths[axis.address] for axis, _ in axes if not axis.word}
    moved = where_moved(len(blocks.rows), plain.values())
    source.refuse()
    circles = circles_of(blocks, paths, controller)
    feeds = feeds_of(blocks, moved)
    source.refuse()
    positions, stated = _positions(blocks, paths, axes)
    durations = np.where(blocks.kinds == Kind.DWELL, blocks.pauses, 0.0)
    rapid = np.flatnonzero((blocks.kinds == Kind.RAPID) & ~blocks.outputs)
    steps = np.zeros((len(rapid), len(axes)))
    for axis, index in axes:
        steps[:, index] = _in_si(axis, paths[axis.address].steps_in(rapid))
    durations[rapid] = rapids(steps, limits)
    straight = np.flatnonzero(blocks.feeding & moved)
    lengths = lengths_of(plain, moved, circles, controller)
    durations[straight] = by_feed_word(lengths[straight], feeds[straight], blocks.inverse[straight])
    kinds = blocks.kinds.copy()
    outputs = [path for address, path in paths.items() if address not in plain]
    _check_outputs(blocks, outputs, positions)
    source.refuse()
    kept = _turn_outputs(blocks, outputs, kinds, durations, stated)
    rows = slice(None) if kept.all() else np.flatnonzero(kept)
    marks = _marks(source.comments)
    trajectory = Trajectory(
        axes=tuple(machine_axes),
        start=np.full(len(machine_axes), np.nan),
        positions=positions[rows],
        kinds=kinds[rows],
        durations=durations[rows],
        events=blocks.events[rows],
        courses=_courses(marks, blocks)[rows],
        stated=stated[rows],
        lines=(blocks.rows[rows] + 1).astype(np.int32),
        centres=circles.centres[rows] if circles.any else None,
        planes=blocks.planes[rows] if circles.any else None,
        tolerances=blocks.tolerances[rows],
    )
    trajectory = timed(trajectory, limits, controller.rule(machine_axes))
    header: dict[str, str] = {}
    for comment in source.comments:
        if match := _HEADER.match(comment.text):
            header.setdefault(match[1], match[2])
    return Program(
        name=name,
        trajectory=trajectory,
        comments=tuple(source.comments),
        marks=marks,
        source=header.get("source:", ""),
        source_sha256=header.get("source sha256:", ""),
        setup_sha256=header.get("setup sha256:", ""),
        version=header.get("tapelayer", ""),
        controller=header.get("controller:", ""),
    )


def _in_si(axis: AxisWord, values: Floats) -> Floats:
    """Return metres or radians for values of an axis in its written unit; any shape."""
    return np.deg2rad(values) if axis.unit == "deg" else from_mm(values)


def _positions(
    blocks: Blocks, paths: Mapping[str, AxisPath], axes: Sequence[tuple[AxisWord, int]]
) -> tuple[Floats, NDArray[np.uint16]]:
    """Return joint values (n, k) at each block's end, NaN before the first word, and bits (n,) of stated axes."""
    positions = np.empty((len(blocks.rows), len(axes)))
    stated = np.zeros(len(blocks.rows), dtype=np.uint16)
    for axis, index in axes:
        path = paths[axis.address]
        first = path.blocks[0] if len(path.blocks) else len(positions)
        positions[:first, index] = np.nan
        values = _in_si(axis, path.positions)
        positions[first:, index] = np.repeat(values, np.diff(path.blocks, append=len(positions)))
        stated[path.blocks] |= np.uint16(1 << index)
    return positions, stated


def _check_outputs(blocks: Blocks, paths: Sequence[AxisPath], positions: Floats) -> None:
    """Note a fault of the first output that turns an axis while the position (n, k) of any axis is unknown."""
    turns = blocks.outputs & where_moved(len(blocks.rows), paths) & np.any(np.isnan(positions), axis=1)
    for row in np.flatnonzero(turns)[:1].tolist():
        sentence = "an output turns an axis before rapids have stated every axis; state every axis first"
        blocks.words.source.fault(int(blocks.rows[row]), 0, sentence)


def _turn_outputs(
    blocks: Blocks,
    paths: Sequence[AxisPath],
    kinds: NDArray[np.uint8],
    durations: Floats,
    stated: NDArray[np.uint16],
) -> Mask:
    """Merge each output that turns an axis with the dwell directly after it into one block, in which the axis moves.

    Args:
        blocks: of the program.
        paths: of the axes that the control does not interpolate.
        kinds: (n,) changed in place, like the next two.
        durations: (n,) seconds.
        stated: (n,) bits of the axes that a block states.

    Returns:
        (n,) the blocks to keep.
    """
    turned = where_moved(len(blocks.rows), paths)
    turns = np.flatnonzero(blocks.outputs & turned)
    waiting = turns[blocks.kinds[np.minimum(turns + 1, len(blocks.kinds) - 1)] == Kind.DWELL]
    kinds[turns] = Kind.LINEAR
    durations[waiting] = blocks.pauses[waiting + 1]
    kept = np.ones(len(kinds), dtype=bool)
    kept[waiting + 1] = False
    # An output that only restates an axis belongs to the next block.
    again = blocks.outputs & ~turned
    for path in paths:
        again[path.blocks[:1]] = False
    restated = np.flatnonzero(again)
    kept[restated] = False
    following = np.flatnonzero(kept)
    place = np.searchsorted(following, restated)
    np.bitwise_or.at(stated, following[place[place < len(following)]], stated[restated[place < len(following)]])
    return kept


def _marks(comments: Sequence[Comment]) -> tuple[Mark, ...]:
    """Return the comments that begin a course or pass."""
    found = ((comment.line, _MARK.match(comment.text)) for comment in comments)
    return tuple(Mark(line, int(match[1]), int(match[2] or 0)) for line, match in found if match)


def _courses(marks: Sequence[Mark], blocks: Blocks) -> NDArray[np.int32]:
    """Return the index (n,) of the course that each block serves, -1 before the first."""
    if marks:
        places = [-1, *((mark.place or mark.number) - 1 for mark in marks)]
        return np.array(places, dtype=np.int32)[
            np.searchsorted([mark.line - 1 for mark in marks], blocks.rows, "right")
        ]
    begins = np.flatnonzero(np.isin(blocks.events, (Event.SHOE_DOWN, Event.ARC_ON)))
    ends = np.flatnonzero(np.isin(blocks.events, (Event.SHOE_UP, Event.ARC_OFF)))
    rapids = np.flatnonzero(blocks.kinds == Kind.RAPID)
    starts = []
    for previous, begin in zip([-1, *begins[:-1].tolist()][: len(begins)], begins.tolist(), strict=True):
        ended = ends[np.searchsorted(ends, previous) : np.searchsorted(ends, begin)]
        link = rapids[np.searchsorted(rapids, ended[0] if len(ended) else previous) :][:1] if previous >= 0 else [0]
        starts.append(int(link[0]) if len(link) and link[0] < begin else begin)
    return (np.searchsorted(starts, np.arange(len(blocks.rows)), "right") - 1).astype(np.int32)
