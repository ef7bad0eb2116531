"""Source: the bytes of a program without its comments, and its faults by line and column."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from post.controllers import Controller
from tapelayer.errors import InputFault, ProgramRefused
from tapelayer.text import plain_text

Bytes = NDArray[np.uint8]

FIRST_LETTER = ord("A")
NEWLINE = ord("\n")


@dataclass(frozen=True)
class Comment:
    """A comment of a program: its line, from 1, and its text without the signs around it."""

    line: int
    text: str


class Source:
    """The text without its comments, and its faults.

    Attributes:
        name: name of the file.
        plain: the text with comments and blocks without effect blanked, lines ended by one byte each.
        comments: the comments, in order.
    """

    def __init__(self, text: bytes, controller: Controller, name: str) -> None:
        self.name = name
        self.comments: list[Comment] = []
        self._faults: list[tuple[int, int, str]] = []
        text = plain_text(text, name, ProgramRefused)
        if b"\0" in text:
            raise ProgramRefused(name, [InputFault(0, "is a binary file, no NC program")])
        self.plain = bytearray(text + b"\n")
        self._take_comments(controller.blocks.comment)
        for block in (controller.blocks.first_line, controller.blocks.last_line, *controller.codes.no_effect):
            if block and not re.fullmatch(r"[A-Z]|G[\d.]+", block):
                self._take_block(block)
        if not self.plain.isascii():
            for at in re.finditer(rb"[^\x00-\x7f]+", self.plain):
                self.fault_at(at.start(), f"expected ASCII outside comments, got {at[0].decode('utf-8', 'replace')}")
            self.refuse()

    def _take_comments(self, style: str) -> None:
        """Replace the comments of the text by blanks, and record them."""
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
                self.fault_at(begin, "the comment is not closed; end it with )")
                closed = line_end
            inside = text[begin + 1 : closed]
            if text[begin] == ord("(") and b"(" in inside:
                self.fault_at(begin, "a comment begins within this comment; close it before")
            end = min(closed + 1, line_end)
            text[begin:end] = b" " * (end - begin)
            self.comments.append(Comment(line + 1, inside.decode("utf-8", "replace").strip()))

    def _take_block(self, block: str) -> None:
        """Blank the lines that consist of a block, ignoring spaces, case and a block number."""
        wanted = block.upper().replace(" ", "").encode("ascii")
        # Search for its rarest character, which few other lines contain.
        sign = next((wanted[i : i + 1] for i in range(len(wanted)) if not wanted[i : i + 1].isalnum()), wanted[:1])
        at = self.plain.find(sign)
        while at >= 0:
            begin, end = self.plain.rfind(b"\n", 0, at) + 1, self.plain.index(b"\n", at)
            line = self.plain[begin:end].upper().translate(None, b" \t")
            if re.sub(rb"^N\d+", b"", line) == wanted:
                self.plain[begin:end] = b" " * (end - begin)
            at = self.plain.find(sign, end)

    def fault_at(self, byte: int, sentence: str) -> None:
        """Note a fault at a byte of the text."""
        line_begin = self.plain.rfind(b"\n", 0, byte) + 1
        self._faults.append((self.plain.count(b"\n", 0, byte) + 1, byte - line_begin + 1, sentence))

    def fault(self, line: int, word: int, sentence: str) -> None:
        """Note a fault of a word (from 0) in a line (from 0), or of the whole line (-1)."""
        self._faults.append((line + 1, -1 - word, sentence))

    def refuse(self) -> None:
        """Raise the faults noted so far, if any.

        Raises:
            ProgramRefused: all faults, in the order of the text.
        """
        if not self._faults:
            return
        ends = np.flatnonzero(np.frombuffer(self.plain, dtype=np.uint8) == NEWLINE)
        begins = np.concatenate([[0], ends[:-1] + 1])
        faults = []
        for line, column, sentence in self._faults:
            if column < 0:
                text = np.frombuffer(self.plain[begins[line - 1] : ends[line - 1]], dtype=np.uint8)
                column = int(np.flatnonzero(text >= FIRST_LETTER)[-1 - column]) + 1
            faults.append(InputFault(line, sentence, column))
        raise ProgramRefused(self.name, sorted(dict.fromkeys(faults), key=lambda fault: (fault.line, fault.column)))
