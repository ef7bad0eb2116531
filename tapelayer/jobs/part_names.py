"""Part names: what a program's comments call its courses or passes, and the parts that comments stand before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from post.reader import Program
from tapelayer.motion.trajectory import Trajectory


def part_names(word: str, numbers: Sequence[int]) -> tuple[str, ...]:
    """Return the names of a program's parts in order: by their number, and by their place where that is another.

    Examples:
        >>> part_names("course", [1, 2]), part_names("course", [20, 10])
        (('course 1 of 2', 'course 2 of 2'), ('course 20, 1 of 2', 'course 10, 2 of 2'))
    """
    count = len(numbers)
    if list(numbers) == list(range(1, count + 1)):
        return tuple(f"{word} {number} of {count}" for number in numbers)
    return tuple(f"{word} {number}, {place} of {count}" for place, number in enumerate(numbers, 1))


def placed(program: Program, word: str, numbers: Sequence[int]) -> tuple[Trajectory, tuple[str, ...]]:
    """Return a program's blocks with the index of the part that each serves, and a remark on wrong comments.

    Comments count where they name the parts in their order; otherwise only where they stand, as the judge compares the
    parts in the order of the program.

    Args:
        program: as read from text.
        word: what a part is called.
        numbers: of the parts, in order.
    """
    trajectory, marks = program.trajectory, program.marks
    if not marks:
        return trajectory, ()
    place_of = {number: place for place, number in enumerate(numbers)}
    places = [place_of.get(mark.number, -1) for mark in marks]
    named = min(places) >= 0 and places == sorted(places)
    named = named and all(mark.place in (0, place + 1) for mark, place in zip(marks, places, strict=True))
    changes = np.diff([mark.number for mark in marks], prepend=marks[0].number) != 0
    indices = np.array(places) if named else np.cumsum(changes)
    rows = np.searchsorted([mark.line for mark in marks], trajectory.lines, side="right")
    courses = np.concatenate([[-1], indices])[rows].astype(np.int32)
    if named:
        return replace(trajectory, courses=courses), ()
    wrong = [
        (mark, index)
        for mark, index in zip(marks, indices.tolist(), strict=True)
        if index >= len(numbers) or mark.number != numbers[index] or mark.place not in (0, index + 1)
    ]
    mark, index = wrong[0]
    said = f"{word} {mark.number}" + (f" as number {mark.place}" if mark.place else "")
    true = f"{word} {numbers[index]} follows" if index < len(numbers) else f"there are only {len(numbers)}"
    remark = f"{program.name}:{mark.line}: names {said}, but {true}"
    if more := len(wrong) - 1:
        remark = f"{remark}; {more} more such comment{'s' if more > 1 else ''}"
    return replace(trajectory, courses=courses), (remark,)
