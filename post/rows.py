"""Rows: the numbered lines of a program, in order, and their text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from anyascii import anyascii

from post import arcs
from post.columns import Column
from post.controllers import Controller
from post.words import Cells, join, literals, words
from tapelayer.arrays import Ints, Mask
from tapelayer.errors import NotWritable
from tapelayer.provenance import Provenance

# Rows turned into text at once, so that their cells stay in the cache.
CHUNK = 1 << 14

_COMMENT_MARK = b"\x01"
_NOT_IN_COMMENTS = re.compile(r"[^ -~]|[()%;]")


@dataclass(frozen=True, eq=False)
class Layout:
    """The rows that represent the blocks, in order.

    Attributes:
        blocks: (m,) block of each row.
        plain: (m,) whether it holds the words of axes that the control interpolates.
        outputs: (m,) whether it holds those of the other axes.
        pauses: (m,) dwell time in units of its last decimal, 0 where there is none.
    """

    blocks: Ints
    plain: Mask
    outputs: Mask
    pauses: Ints


@dataclass(frozen=True, eq=False)
class TextRows:
    """The numbered rows of a program, in order: those of the blocks, and fixed texts.

    Attributes:
        layout: contents of the rows; a fixed text has block -1.
        codes: (m,) index into `texts`.
        texts: G and M words and fixed texts, with their leading space; the first is empty.
        feeds: (m,) feed in units of its last decimal, 0 where none is written.
        feed_decimals: (m,) decimals of each feed.
        comments: rows preceded by a course's comment, in order.
    """

    layout: Layout
    codes: Ints
    texts: tuple[bytes, ...]
    feeds: Ints
    feed_decimals: Ints
    comments: Ints


def body(
    rows: TextRows, columns: Sequence[Column], circles: arcs.Circles, controller: Controller, comments: Sequence[bytes]
) -> Iterator[bytes]:
    """Yield the text of the rows with the courses' comments in their places, piece by piece."""
    remaining = iter(comments)
    for first in range(0, len(rows.codes), CHUNK):
        page = slice(first, min(first + CHUNK, len(rows.codes)))
        cells = _page(rows, page, columns, circles, controller)
        text = join(page.stop - page.start, cells)
        longest = controller.blocks.max_line
        # The cells bound the length of a line, so lines are measured only where the bound is too long.
        if 4 * sum(len(word) for _, word in cells) > longest:
            ends = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n"))
            length = int(np.diff(ends, prepend=-1).max()) - 1
            if length > longest:
                raise NotWritable(
                    f"a line would have {length} characters, controller {controller.name} takes {longest}; "
                    "write fewer decimals or no N words"
                )
        if not controller.blocks.number_step:
            text = text.replace(b"\n ", b"\n").replace(_COMMENT_MARK + b" ", _COMMENT_MARK).removeprefix(b" ")
        first_piece, *others = text.split(_COMMENT_MARK) if _COMMENT_MARK in text else [text]
        yield first_piece
        for piece in others:
            yield next(remaining)
            yield piece


def _page(
    rows: TextRows, page: slice, columns: Sequence[Column], circles: arcs.Circles, controller: Controller
) -> list[tuple[Ints | None, Cells]]:
    """Return the cells of a slice of the rows."""
    layout = rows.layout
    blocks, pauses = layout.blocks[page], layout.pauses[page]
    cells: list[tuple[Ints | None, Cells]] = []
    low, high = np.searchsorted(rows.comments, [page.start, page.stop])
    if low < high:
        cells.append((rows.comments[low:high] - page.start, literals([_COMMENT_MARK])))
    if step := controller.blocks.number_step:
        numbers = step * (1 + np.arange(page.start, page.stop) % (controller.blocks.number_maximum // step))
        cells.append((None, words(b"N", numbers, 0)))
    cells.append((None, tuple(cell[rows.codes[page]] for cell in literals(rows.texts))))
    for column in columns:
        carried = layout.outputs[page] if column.axis.word else layout.plain[page]
        at = np.flatnonzero(column.written[blocks] & carried)
        if len(at):
            address = f" {column.axis.address}".encode("ascii")
            cells.append((at, words(address, column.numbers[blocks[at] + 1], column.axis.decimals)))
    circle = np.where(layout.plain[page], circles.of_block[blocks], -1)
    if circle.max() >= 0:
        decimals = {column.joint: column.axis.decimals for column in columns}
        for index, letter in enumerate(controller.arcs.offsets):
            at = np.flatnonzero(circle >= 0)
            at = at[np.any(circles.axes[circle[at]] == index, axis=1)]
            address = f" {letter}".encode("ascii")
            cells.append((at, words(address, circles.offsets[circle[at], index], decimals["xyz"[index]])))
    at = np.flatnonzero(pauses)
    if len(at):
        address = f" {controller.codes.dwell_address}".encode("ascii")
        cells.append((at, words(address, pauses[at], controller.codes.dwell_decimals)))
    feeds, digits_of = rows.feeds[page], rows.feed_decimals[page]
    for digits in np.flatnonzero(np.bincount(digits_of[feeds > 0])).tolist():
        at = np.flatnonzero((feeds > 0) & (digits_of == digits))
        cells.append((at, words(f" {controller.feed.address}".encode("ascii"), feeds[at], digits)))
    for word in sorted({column.axis.word for column in columns} - {""}):
        cells.append(
            (np.flatnonzero(layout.outputs[page] & layout.plain[page]), literals([f" {word}".encode("ascii")]))
        )
    cells.append((None, literals([b"\n"])))
    return cells


def head(controller: Controller, provenance: Provenance) -> bytes:
    """Return the header before the first block: the program's sources and units."""
    per = "1/min" if controller.feed.mode == "inverse_time" else "mm/min"
    lines = [
        f"tapelayer {provenance.version}",
        f"source: {provenance.source}",
        f"source sha256: {provenance.source_sha256}",
        f"setup sha256: {provenance.setup_sha256}",
        f"controller: {controller.name}",
        f"units: mm, deg, s, feed in {per}",
        *(f"note: {note}" for note in provenance.notes),
        *([f"not judged: {', '.join(provenance.not_judged)}"] if provenance.not_judged else []),
    ]
    first = f"{controller.blocks.first_line}\n" if controller.blocks.first_line else ""
    return first.encode("ascii") + b"".join(comment(line, controller) for line in lines)


def comment(text: str, controller: Controller) -> bytes:
    """Return a comment line in ASCII letters that come nearest, with underscores for what could end it."""
    safe = _NOT_IN_COMMENTS.sub("_", "".join(anyascii(letter) or "_" for letter in text))
    before, after = comment_marks(controller)
    return f"{before}{safe[: controller.blocks.max_line - 2]}{after}\n".encode("ascii")


def comment_marks(controller: Controller) -> tuple[str, str]:
    """Return what opens and what closes a comment line."""
    return ("(", ")") if controller.blocks.comment[0] == "(" else ("; ", "")
