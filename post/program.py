"""Program: a verified trajectory as NC text for one control; a pure function of its arguments."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from post import arcs
from post.columns import Column, columns_of, moving
from post.controllers import Controller
from post.rows import Layout, TextRows, body, comment, comment_marks, head
from post.words import rounded
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import NotWritable
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.provenance import Provenance, sealed
from tapelayer.verification.verified import Verdict, Verified

# The joint that feeds the tape, which some controls reset to zero at each course.
TAPE = "u"
# A feed so small that these decimals leave it fewer than six digits belongs to a motion that is in effect a dwell.
FEED_DECIMALS = 9
# A motion without words shorter than this, in seconds, is not written as a dwell: the next motion takes its time.
BRIEF = 5e-4
PLANE_NAMES: tuple[Literal["xy", "zx", "yz"], ...] = ("xy", "zx", "yz")


def write(
    verified: Verified[Verdict],
    controller: Controller,
    provenance: Provenance,
    levels: Mapping[Event, float] = MappingProxyType({}),
    names: Sequence[str] = (),
) -> bytes:
    """Return the NC text of a verified trajectory.

    Axis words are written where their rounded text changes or where the trajectory states the axis, and for every axis
    at the first motion with a known value. The feed word is computed from the rounded end points. A motion in which no
    rounded word changes is written as a dwell of its duration; a brief one is dropped and its time is added to the next
    block if that is a straight motion, or else collected into one dwell. An axis that the control does not interpolate
    is written as its table states, and a block that moves no other is followed by a dwell of the block's duration. Runs
    of straight blocks on one circle are written as circular blocks where the control's table has planes for them.

    Args:
        verified: the verified trajectory; the joint values of an axis may be NaN until it is first stated.
        controller: the control's table.
        provenance: the program's sources, for the header.
        levels: values that events carry, in the unit of the control (the arc's current in A); ignored where the
            control's table has no letter for them.
        names: of the courses or passes by index, for the comments that begin them; by default they are counted.

    Raises:
        NotWritable: the control lacks a word for an event, a number is beyond what it takes, a line would be too long,
            or the blocks contradict themselves.
        ControllerRefused: the control has no address for one of the machine's axes.
    """
    return _text(verified.trajectory, controller, provenance, levels, names)


def withheld(
    trajectory: Trajectory,
    controller: Controller,
    provenance: Provenance,
    levels: Mapping[Event, float] = MappingProxyType({}),
    names: Sequence[str] = (),
) -> tuple[str, ...]:
    """Return the lines that `write` would give to a trajectory that failed: to be read, and no file to be run.

    Raises:
        NotWritable: as `write`.
        ControllerRefused: as `write`.
    """
    return tuple(_text(trajectory, controller, provenance, levels, names).decode("ascii").splitlines())


def _text(
    trajectory: Trajectory,
    controller: Controller,
    provenance: Provenance,
    levels: Mapping[Event, float],
    names: Sequence[str],
) -> bytes:
    """Return the NC text of a trajectory."""
    if not len(trajectory):
        raise NotWritable("the trajectory has no blocks, so there is no program to write")
    columns = columns_of(trajectory, moving(trajectory), controller.addressed(trajectory.axes))
    for column in columns:
        column.check(controller.max_word)
    _check_events(trajectory, controller)
    moves = _moves(trajectory, columns, controller)
    if controller.arcs.planes:
        merged, columns = arcs.merged(trajectory, columns, controller)
        moves = moves if merged is trajectory else _moves(merged, columns, controller)
        trajectory = merged
    circles = arcs.circles(trajectory, columns)
    durations, pauses = _times(trajectory, moves, 10**controller.codes.dwell_decimals)
    feeds = _feeds(moves.straight, durations, columns, circles, controller)
    starts = _starts(trajectory.courses)
    if controller.u_reset == "course":
        columns = [_reset(column, starts) if column.joint == TAPE else column for column in columns]
    layout = _layout(trajectory, moves, pauses, 10**controller.codes.dwell_decimals)
    rows = _rows(trajectory, columns, circles, layout, feeds, starts, controller, levels)
    last = f"{controller.blocks.last_line}\n" if controller.blocks.last_line else ""
    count = int(trajectory.courses.max(initial=-1)) + 1
    names = names or [f"course {place} of {count}" for place in range(1, count + 1)]
    courses = [comment(names[trajectory.courses[block]], controller) for block in starts.tolist()]
    text = body(rows, columns, circles, controller, courses)
    first = head(controller, provenance)
    before, after = comment_marks(controller)
    whole = b"".join([first, *text, last.encode("ascii")])
    return sealed(whole, len(first), f"{before}text sha256: ", after)


@dataclass(frozen=True, eq=False)
class _Moves:
    """The effects of the blocks' words.

    Attributes:
        wordless: (n,) motions without words.
        written: (n,) blocks with words of axes that the control interpolates.
        moved: (n,) blocks in which such an axis moves.
        straight: (n,) blocks that have a feed: the same without rapids.
        unsynchronised: (n,) blocks with words of axes that the control does not interpolate.
        turned: (n,) blocks in which such an axis moves.
        exclusive: whether those words need blocks of their own.
    """

    wordless: Mask
    written: Mask
    moved: Mask
    straight: Mask
    unsynchronised: Mask
    turned: Mask
    exclusive: bool


def _moves(trajectory: Trajectory, columns: Sequence[Column], controller: Controller) -> _Moves:
    """Return the effects of the blocks' words, and refuse those that one block cannot express."""
    plain = [column for column in columns if not column.axis.word]
    outputs = [column for column in columns if column.axis.word]
    exclusive = any(column.axis.alone for column in outputs)
    count = len(trajectory)
    written = _any(count, (column.written for column in plain))
    moved = _any(count, (column.moved for column in plain))
    unsynchronised = _any(count, (column.written for column in outputs))
    turned = _any(count, (column.moved for column in outputs))
    motions = moving(trajectory)
    feeding = motions & (trajectory.kinds != Kind.RAPID)
    still = feeding & ((written & ~moved) | (unsynchronised & ~turned & ~moved))
    if still.any():
        raise NotWritable(
            f"block {int(np.argmax(still))}: states axes without moving one; only a rapid can, at no feed"
        )
    if exclusive and np.any(moved & turned):
        block = int(np.argmax(moved & turned))
        joint = next(column.joint for column in outputs if column.moved[block])
        raise NotWritable(
            f"block {block}: axis {joint} moves together with others, but controller {controller.name} moves it in "
            "blocks of its own; take it apart first"
        )
    return _Moves(
        wordless=motions & ~written & ~unsynchronised,
        written=written,
        moved=moved,
        straight=feeding & moved,
        unsynchronised=unsynchronised,
        turned=turned,
        exclusive=exclusive,
    )


def _any(count: int, masks: Iterable[Mask]) -> Mask:
    """Return where any of the masks (n,) is set."""
    union = np.zeros(count, dtype=bool)
    for mask in masks:
        union |= mask
    return union


def _times(trajectory: Trajectory, moves: _Moves, units: int) -> tuple[Floats, Ints]:
    """Return durations (n,) of straight blocks in seconds, dropped blocks' time added, and dwells (n,) in units."""
    waits = moves.wordless | (trajectory.kinds == Kind.DWELL)
    pauses = np.zeros(len(trajectory), dtype=np.int64)
    pauses[waits] = rounded(trajectory.requested[waits] * units, 0)
    durations = trajectory.requested
    dropped = np.flatnonzero(moves.wordless & (durations < max(BRIEF, 0.5 / units)) & (durations > 0))
    if not len(dropped):
        return durations, pauses
    pauses[dropped] = 0
    # Consecutive dropped blocks are treated as one: a run ends where the next block is kept.
    ends = np.flatnonzero(np.append(np.diff(dropped) > 1, True))
    totals = np.diff(np.cumsum(durations[dropped])[ends], prepend=0.0)
    following = dropped[ends] + 1
    taken = (following < len(trajectory)) & moves.straight[np.minimum(following, len(trajectory) - 1)]
    durations = durations.copy()
    durations[following[taken]] += totals[taken]
    pauses[following[~taken] - 1] = rounded(totals[~taken] * units, 0)
    return durations, pauses


def _feeds(
    feeding: Mask, durations: Floats, columns: Sequence[Column], circles: arcs.Circles, controller: Controller
) -> Floats:
    """Return the feed (n,) of each block that has one, by the control's rule; 0 elsewhere."""
    straight = np.flatnonzero(feeding)
    minutes = durations[straight] / 60.0
    if not np.all(minutes > 0.0):
        raise NotWritable(f"block {straight[~(minutes > 0.0)][0]}: moves in no time, so it has no feed")
    feeds = np.zeros(len(durations))
    if controller.feed.mode == "inverse_time":
        feeds[straight] = 1.0 / minutes
        return feeds
    columns = [column for column in columns if not column.axis.word]
    lengths = np.zeros(len(straight))
    for group in controller.feed.path:
        rest = np.flatnonzero(lengths == 0.0)
        lengths[rest] = _norm([column for column in columns if column.axis.address in group], straight[rest], circles)
    rest = np.flatnonzero(lengths == 0.0)
    if controller.feed.otherwise == "largest":
        lengths[rest] = np.maximum.reduce([np.abs(column.steps(straight[rest])) for column in columns])
    else:
        lengths[rest] = _norm(columns, straight[rest], circles)
    feeds[straight] = lengths / minutes
    return feeds


def _norm(columns: Sequence[Column], blocks: Ints, circles: arcs.Circles) -> Floats:
    """Return the root (m,) of the summed squares of the axes' changes within blocks (m,), along arcs, not chords."""
    total = np.zeros(len(blocks))
    circle = circles.of_block[blocks]
    circular = np.flatnonzero(circle >= 0)
    for column in columns:
        steps = column.steps(blocks)
        if len(circular) and column.joint in ("x", "y", "z"):
            in_plane = np.any(circles.axes[circle[circular]] == "xyz".index(column.joint), axis=1)
            steps[circular[in_plane]] = 0.0
        total += steps * steps
    if len(circular) and {"x", "y", "z"} <= {column.joint for column in columns}:
        total[circular] += circles.lengths[circle[circular]] ** 2
    return np.sqrt(total)


def _check_events(trajectory: Trajectory, controller: Controller) -> None:
    """Refuse events that the control has no word for."""
    known = np.zeros(256, dtype=bool)
    known[list(controller.event_words())] = True
    missing = np.flatnonzero((trajectory.kinds == Kind.SWITCH) & ~known[trajectory.events])
    if len(missing):
        event = Event(int(trajectory.events[missing[0]])).name.lower()
        raise NotWritable(
            f"block {missing[0]}: controller {controller.name} has no word for {event}; add it to the table's events"
        )


def _starts(courses: np.ndarray) -> Ints:
    """Return the blocks at which a course begins."""
    before = np.concatenate([[-1], courses[:-1]])
    return np.flatnonzero((courses != before) & (courses >= 0))


def _reset(column: Column, starts: Ints) -> Column:
    """Return the tape axis's column with numbers counted from each course's start."""
    epochs = np.cumsum(np.bincount(starts + 1, minlength=len(column.numbers)))
    known = np.flatnonzero(column.written)[:1]
    zeros = np.where(starts > known, column.numbers[starts], 0)
    return replace(column, numbers=column.numbers - np.concatenate([[0], zeros])[epochs])


def _layout(trajectory: Trajectory, moves: _Moves, pauses: Ints, units: int) -> Layout:
    """Return the rows of the blocks: none for dropped blocks, several where an axis is not interpolated."""
    kept = moves.written | (pauses > 0) | (trajectory.kinds == Kind.SWITCH)
    if not moves.unsynchronised.any():
        blocks = np.flatnonzero(kept)
        return Layout(blocks, moves.written[blocks], np.zeros(len(blocks), dtype=bool), pauses[blocks])
    apart = moves.unsynchronised & (~moves.written | moves.exclusive)
    waits = np.flatnonzero(apart & moves.turned & ~moves.moved)
    # A block becomes its output, the wait for that, and the rest, in this order.
    parts = [np.flatnonzero(apart), waits, np.flatnonzero(kept)]
    blocks = np.concatenate(parts)
    part = np.repeat([0, 1, 2], [len(rows) for rows in parts])
    times = np.concatenate([np.zeros(len(parts[0]), np.int64), rounded(trajectory.requested[waits] * units, 0)])
    times = np.concatenate([times, pauses[parts[2]]])
    order = np.lexsort((part, blocks))
    order = order[(part[order] != 1) | (times[order] > 0)]
    blocks, part = blocks[order], part[order]
    return Layout(
        blocks=blocks,
        plain=moves.written[blocks] & (part == 2),
        outputs=moves.unsynchronised[blocks] & np.where(apart[blocks], part == 0, part == 2),
        pauses=times[order],
    )


def _rows(
    trajectory: Trajectory,
    columns: Sequence[Column],
    circles: arcs.Circles,
    layout: Layout,
    feeds: Floats,
    starts: Ints,
    controller: Controller,
    levels: Mapping[Event, float],
) -> TextRows:
    """Return the rows with modal G and feed words, and the fixed texts between them."""
    blocks = layout.blocks
    epochs = np.cumsum(np.bincount(starts, minlength=len(trajectory)))[blocks]
    texts = [""]

    def text(words: str) -> int:
        if words not in texts:
            texts.append(words)
        return texts.index(words)

    codes = controller.codes
    motions = np.flatnonzero(layout.plain)
    code = np.zeros(len(blocks), dtype=np.int64)
    code[motions] = np.where(trajectory.kinds[blocks[motions]] == Kind.RAPID, text(codes.rapid), text(codes.linear))
    circle = np.where(layout.plain, circles.of_block[blocks], -1)
    for plane, name in enumerate(PLANE_NAMES):
        for clockwise, word in ((True, codes.clockwise), (False, codes.counterclockwise)):
            chosen = np.append((circles.planes == plane) & (circles.clockwise == clockwise), False)
            if chosen.any():
                code[chosen[circle]] = text(f"{codes.planes[name]} {word}")
    code[motions[_same(epochs[motions], code[motions])]] = 0
    code[layout.pauses > 0] = text(codes.dwell)
    output_word = next((column.axis.word for column in columns if column.axis.word), "")
    code[layout.outputs & ~layout.plain] = text(output_word)
    switches = np.flatnonzero(trajectory.kinds[blocks] == Kind.SWITCH)
    at_rest = _at_rest(layout, trajectory.events[blocks], switches)
    at_rest |= trajectory.tolerances[blocks[switches]] == 0.0
    events = trajectory.events[blocks[switches]]
    for resting in (False, True):
        event_words = controller.event_words(resting)
        for event in map(Event, np.flatnonzero(np.bincount(events)).tolist()):
            here = (events == event) & (at_rest == resting)
            code[switches[here]] = text(event_words[event] + _level(event, controller, levels))
    feed, decimals = _feed_digits(np.where(layout.plain, feeds[blocks], 0.0), controller.feed.digits)
    if controller.feed.modal:
        feeding = np.flatnonzero(feed > 0)
        feed[feeding[_same(epochs[feeding], feed[feeding], decimals[feeding])]] = 0
    fixed = _fixed(trajectory, columns, layout, epochs, starts, controller)
    before = np.array([at for at, _ in fixed], dtype=np.int64)
    inserted = [text(words) for _, words in fixed]
    # A course's comment stands before what is restated there, after what the program begins with.
    rows = np.searchsorted(blocks, starts)
    comments = rows + np.searchsorted(before, rows)
    comments[rows == 0] += len(controller.blocks.preamble)
    return TextRows(
        layout=Layout(
            blocks=np.insert(blocks, before, -1),
            plain=np.insert(layout.plain, before, False),
            outputs=np.insert(layout.outputs, before, False),
            pauses=np.insert(layout.pauses, before, 0),
        ),
        codes=np.insert(code, before, inserted),
        texts=tuple(f" {words}".encode("ascii") if words else b"" for words in texts),
        feeds=np.insert(feed, before, 0),
        feed_decimals=np.insert(decimals, before, 0),
        comments=comments,
    )


def _fixed(
    trajectory: Trajectory,
    columns: Sequence[Column],
    layout: Layout,
    epochs: Ints,
    starts: Ints,
    controller: Controller,
) -> list[tuple[int, str]]:
    """Return the fixed texts and the row before which each stands, in order."""
    blocks = layout.blocks
    fixed = [(0, words) for words in controller.blocks.preamble]
    if len(starts) == 0 or starts[0] > 0:
        fixed += [(0, words) for words in controller.blocks.restated]
    tape = next((column for column in columns if column.joint == TAPE), None)
    for start in starts.tolist():
        at = int(np.searchsorted(blocks, start))
        fixed += [(at, words) for words in controller.blocks.restated]
        if controller.u_reset == "course" and tape is not None and tape.written[:start].any():
            fixed.append((at, f"{controller.codes.set_position} {tape.axis.address}0"))
    if controller.time.blends:
        motions = np.flatnonzero(layout.plain)
        different, inverse = np.unique(trajectory.tolerances[blocks[motions]], return_inverse=True)
        texts = np.array([controller.time.text(tolerance) for tolerance in different.tolist()])[inverse]
        changes = np.flatnonzero(~_same(epochs[motions], texts))
        fixed += [(int(motions[row]), str(texts[row])) for row in changes.tolist()]
    fixed += [(len(blocks), words) for words in controller.blocks.end[:1]]
    return sorted(fixed, key=lambda row: row[0])


def _level(event: Event, controller: Controller, levels: Mapping[Event, float]) -> str:
    """Return the value that an event carries as a word with its space; empty for none."""
    letters = {Event[name.upper()]: letter for name, letter in controller.levels.items()}
    if event not in levels or event not in letters:
        return ""
    whole, fraction = divmod(int(rounded(np.array([levels[event]]), 3)[0]), 1000)
    return f" {letters[event]}{whole}" + f".{fraction:03d}".rstrip("0").rstrip(".")


def _at_rest(layout: Layout, events: NDArray[np.uint8], switches: Ints) -> Mask:
    """Return which switching rows (m,) are not followed by a motion, ignoring other switching rows except a stop."""
    follows = np.ones(len(layout.blocks), dtype=bool)
    follows[switches] = events[switches] == Event.STOP
    candidates = np.flatnonzero(follows)
    place = np.searchsorted(candidates, switches, "right")
    moves = np.append(layout.plain[candidates], False)
    at_rest: Mask = ~moves[place]
    return at_rest


def _same(*keys: np.ndarray) -> Mask:
    """Return where all keys equal those of the row before."""
    same = np.zeros(len(keys[0]), dtype=bool)
    same[1:] = np.logical_and.reduce([key[1:] == key[:-1] for key in keys])
    return same


def _feed_digits(feeds: Floats, digits: int) -> tuple[Ints, Ints]:
    """Return feeds as integers and their decimals, so that each has at least `digits` significant digits."""
    written = feeds > 0.0
    magnitudes = np.floor(np.log10(feeds, where=written, out=np.zeros(len(feeds)))).astype(np.int64)
    decimals = np.where(written, np.maximum(digits - 1 - magnitudes, 0), 0)
    if decimals.max(initial=0) > FEED_DECIMALS:
        raise NotWritable(
            f"a block has a feed of {feeds[written].min():.3g} per minute; make its standing time a dwell of its own"
        )
    numbers = np.zeros(len(feeds), dtype=np.int64)
    for count in np.flatnonzero(np.bincount(decimals[written])).tolist():
        at = np.flatnonzero(written & (decimals == count))
        numbers[at] = rounded(feeds[at], count)
    return numbers, decimals
