"""Reads a program by LinuxCNC's own interpreter and prints its moves as JSON; runs under the system's Python.

Usage: interpret.py PROGRAM.ngc PARAMETERS.var
"""

from __future__ import annotations

import json
import sys
from typing import Any

import gcode  # type: ignore[import-not-found]
from rs274.interpret import ArcsToSegmentsMixin, Translated, empty_spindle_data  # type: ignore[import-not-found]

MILLIMETRES_PER_INCH = 25.4


class Canon(Translated, ArcsToSegmentsMixin):  # type: ignore[misc]
    """What the interpreter calls; every move is noted with its line, in millimetres and degrees."""

    def __init__(self, parameter_file: str) -> None:
        """Begin without moves."""
        self.parameter_file = parameter_file
        self.moves: list[tuple[str, int, list[float]]] = []
        self.line = 0

    def note(self, kind: str, position: tuple[float, ...]) -> None:
        """Note a move to a position, in inches and degrees."""
        scales = [MILLIMETRES_PER_INCH] * 3 + [1.0] * 3 + [MILLIMETRES_PER_INCH] * 3
        place = [value * scale for value, scale in zip(position, scales, strict=True)]
        self.moves.append((kind, self.line, place))

    def next_line(self, state: Any) -> None:
        """Note the line that is being read."""
        self.line = state.sequence_number

    def straight_traverse_translated(self, *position: float) -> None:
        """Note a G0."""
        self.note("rapid", position)

    def straight_feed_translated(self, *position: float) -> None:
        """Note a G1."""
        self.note("linear", position)

    def arc_feed(self, first: float, second: float, *rest: float) -> None:
        """Note a G2 or G3 by its end: two axes of the plane, then centre and turns, then the third axis and others."""
        centre_1, centre_2, turns, third, *others = rest
        order = {1: (first, second, third), 3: (second, third, first), 2: (third, first, second)}[self.plane]
        kind = "counterclockwise" if turns > 0 else "clockwise"
        self.note(kind, self.rotate_and_translate(*order, *others))

    def dwell(self, seconds: float) -> None:
        """Note a G4."""
        self.moves.append(("dwell", self.line, [seconds]))

    def set_feed_rate(self, rate: float) -> None:
        """Feed is judged elsewhere."""

    def set_feed_mode(self, spindle: int, mode: int) -> None:
        """Feed is judged elsewhere."""

    def comment(self, text: str) -> None:
        """Comments move nothing."""

    def message(self, text: str) -> None:
        """A comment must not turn into a message."""
        self.moves.append(("message", self.line, []))

    def check_abort(self) -> None:
        """Nobody aborts."""

    def change_tool(self, number: int) -> None:
        """A program of ours changes no tool."""
        self.moves.append(("tool", self.line, [number]))

    def tool_offset(self, *offset: float) -> None:
        """G49 sets it to zero."""

    def set_traverse_rate(self, rate: float) -> None:
        """Rapids are judged elsewhere."""

    def set_spindle_rate(self, spindle: int, rate: float) -> None:
        """There is no spindle."""

    def user_defined_function(self, number: int, p: float, q: float) -> None:
        """A program of ours has none."""
        self.moves.append(("user", self.line, [number]))

    def get_external_length_units(self) -> float:
        """Inches."""
        return 1.0

    def get_external_angular_units(self) -> float:
        """Degrees."""
        return 1.0

    def get_axis_mask(self) -> int:
        """All nine axes."""
        return 0x1FF

    def get_block_delete(self) -> bool:
        """No block is deleted."""
        return False

    def get_tool(self, number: int) -> tuple[float, ...]:
        """An empty spindle."""
        return empty_spindle_data  # type: ignore[no-any-return]


def main() -> int:
    """Print the moves, or the interpreter's error on stderr."""
    program, parameters = sys.argv[1:]
    canon = Canon(parameters)
    result, line = gcode.parse(program, canon, "G20", "")
    if result > gcode.MIN_ERROR:
        sys.stderr.write(f"line {line}: {gcode.strerror(result)}\n")
        return 1
    json.dump(canon.moves, sys.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main())
