"""Good programs, broken one word at a time: verification sees every one of them, and points at it."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from tapelayer.courses.course import Course
from tapelayer.errors import ProgramRefused
from tapelayer.laying.job import Job
from tests.helpers.plies import cut_at, exported, job_of
from tests.helpers.replay import WORD, faults_of_the_tape
from tests.helpers.setups import WIDE, setup_of
from tests.helpers.surfaces import flat_course, helix_course

AXES = "XYZACUVQDE"


def helices(count: int, *angles: float, length: float = 0.4, heading: float = 0.3) -> tuple[Course, ...]:
    """Courses beside each other on a cylinder; each end's cut angle in degrees, in turn."""
    courses = [
        helix_course(k + 1, length=length, n=1 + round(length * 1e3), heading=heading, start=(0.4 + 0.1 * k, -0.1))
        for k in range(count)
    ]
    return cut_at(tuple(courses), *angles)


PLIES = {
    "shared cuts at 45 degrees": (helices(3, 45), ""),
    "square cuts": (helices(3, 90), ""),
    "wide tape at 20 degrees": (helices(3, 20), "[tape]\nwidth_mm = 300"),
    "cuts at 160 degrees": (helices(3, 160, heading=-0.3), "[head]\nwrap_compensation = false"),
    "cuts that are not shared": (helices(3, 60, 110, 90, 35), '[head]\nrun_out = "none"'),
    "short courses, cut while the tape is threaded": (
        cut_at(
            tuple(flat_course(k, length=0.05 + 0.02 * k, n=5, x=0.3 + 0.1 * k) for k in range(1, 6)), 70, 110, 110, 50
        ),
        "",
    ),
    "a knife down from course to course": (helices(3, 20, length=0.3), "[head]\nknife_to_nip_mm = 400"),
    "a new roll": (helices(4, 45, 90), "[tape]\nroll_length_m = 1.6"),
    "long stops for a slow knife": (
        helices(2, 90, 45, length=0.7),
        "[machine]\nspeeds_mm_per_s = {v = 20, q = 20}\n[tape]\nwidth_mm = 150",
    ),
    "slow actuators": (helices(3, 45, 120), "[head]\ndelays_ms = {shoe = 150, roller = 90, knife = 60, heater = 240}"),
}


@cache
def good(name: str) -> tuple[Job, bytes]:
    """A job and its program."""
    courses, text = PLIES[name]
    job = job_of(courses, setup_of(WIDE + text if "[machine]" not in text else text))
    return job, exported(job)[0]


@dataclass(frozen=True)
class Line:
    """A line of a program as it is reached: the G word in force, the axes it moves, what is down.

    `reach` is how far across each side of the tape a sweep must go, in mm: half the tape's width and the clearance;
    `fed_meanwhile` the tape that is fed, in mm, while a knife answers to its word.
    """

    index: int
    text: str
    motion: str
    before: dict[str, float]
    after: dict[str, float]
    laying: bool
    knives: frozenset[str]
    reach: float
    fed_meanwhile: float

    @property
    def moved(self) -> set[str]:
        return {axis for axis in self.after if self.after[axis] != self.before.get(axis)}

    @property
    def mode(self) -> bool:
        """Whether it only says how blocks are passed."""
        return bool(re.fullmatch(r"N\d+ G6[14]", self.text))

    @property
    def event(self) -> str:
        return self.text.split()[-1] if re.fullmatch(r"N\d+ M\d\d", self.text) and "M30" not in self.text else ""

    def word(self, letter: str) -> str:
        found = re.search(rf"{letter}([-+.\d]+)", self.text)
        return found[1] if found else ""


def lines_of(text: bytes, job: Job) -> list[Line]:
    """The lines of a job's program for controller jb3208."""
    reach = job.setup.tape.width_mm / 2 + job.setup.head.knife_clearance_mm
    fed = job.setup.process.lay_speed_mm_per_s * job.setup.head.delays_ms.knife * 1e-3
    lines, motion, at, laying, knives = [], "", {}, False, set()
    for index, line in enumerate(text.decode().splitlines()):
        before = dict(at)
        if not line.startswith("("):
            motion = next((word for word in line.split() if re.fullmatch("G0[0-3]", word)), motion)
            at |= {letter: float(value) for letter, value in WORD.findall(line) if letter in AXES}
        lines.append(Line(index, line, motion, before, dict(at), laying, frozenset(knives), reach, fed))
        laying = (laying or line.endswith(" M20")) and not line.endswith(" M25")
        knives |= {word for word in ("M22", "M32") if line.endswith(word)}
        knives -= {{"M23": "M22", "M33": "M32"}.get(line[-3:], "")}
    return lines


# A mutant: the line (from 0) where it is broken, and its lines.
Mutant = tuple[int, list[str]]
Kind = Callable[[Sequence[Line]], Iterable[Mutant]]


def edited(lines: Sequence[Line], first: int, last: int, *texts: str) -> Mutant:
    """Lines with those from `first` up to, not with, `last` replaced."""
    all_texts = [line.text for line in lines]
    return first, [*all_texts[:first], *texts, *all_texts[last:]]


def changed(line: Line, letter: str, value: float) -> str:
    return re.sub(rf"{letter}[-+.\d]+", f"{letter}{value:.3f}", line.text, count=1)


def motions(lines: Sequence[Line]) -> list[Line]:
    return [line for line in lines if line.moved and line.index > 12]


def does_something(lines: Sequence[Line], line: Line, letter: str) -> bool:
    """Whether a word is more than a place on a raised knife's way: it stands as the knife is or goes down."""
    knife = {"V": "M22", "D": "M22", "Q": "M32", "E": "M32"}.get(letter)
    if knife is None or knife in line.knives:
        return True
    for following in lines[line.index + 1 :]:
        if following.event == knife or letter in following.moved:
            return following.event == knife
    return False


def off_by(letter: str, distance: float, where: Callable[[Line], bool]) -> Kind:
    """A word off by a distance, in mm or degrees, in one block."""

    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if letter in line.moved and where(line) and does_something(lines, line, letter):
                yield edited(lines, line.index, line.index + 1, changed(line, letter, line.after[letter] + distance))

    return mutants


def sign_flipped(letter: str) -> Kind:
    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if letter in line.moved and abs(line.after[letter]) > 1.0 and does_something(lines, line, letter):
                yield edited(lines, line.index, line.index + 1, changed(line, letter, -line.after[letter]))

    return mutants


def event_replaced(old: str, new: str) -> Kind:
    """A switching word replaced by another, or dropped."""

    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in lines:
            if line.event == old:
                yield edited(lines, line.index, line.index + 1, *([line.text.replace(old, new)] if new else []))

    return mutants


def event_moved(event: str, by: int) -> Kind:
    """A switching word moved before the motion behind it, or after the one ahead."""

    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in lines:
            step = -1 if by < 0 else 1
            other = line.index + step
            while line.event == event and 0 < other < len(lines) and (lines[other].event or lines[other].mode):
                other += step
            if line.event != event or not 0 < other < len(lines) or not lines[other].moved:
                continue
            first, last = min(line.index, other), max(line.index, other)
            texts = [between.text for between in lines[first : last + 1]]
            yield edited(lines, first, last + 1, *(texts[-1:] + texts[:-1] if by < 0 else texts[1:] + texts[:1]))

    return mutants


def word_moved(lines: Sequence[Line], line: Line, other: Line) -> Mutant:
    """A word moved behind another line, if that comes later, or in front of it."""
    texts = [between.text for between in lines]
    texts.insert(other.index, texts.pop(line.index))
    return other.index, texts


def dropped(where: Callable[[Line], bool]) -> Kind:
    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if where(line):
                yield edited(lines, line.index, line.index + 1)

    return mutants


def next_of(lines: Sequence[Line], line: Line) -> Line:
    """The next line that does something."""
    return next(later for later in lines[line.index + 1 :] if not later.mode)


def off_the_way(lines: Sequence[Line], line: Line, share: float) -> float:
    """How far, in mm, a block's end is off a share of the straight way past it."""
    ahead = next_of(lines, line)
    return math.hypot(*(line.before[a] + share * (ahead.after[a] - line.before[a]) - line.after[a] for a in "XYZ"))


def bends(lines: Sequence[Line], line: Line) -> bool:
    """Whether a block with the shoe down ends clearly off the way between its neighbours, or where a word stands."""
    ahead, behind = next_of(lines, line), lines[line.index - 1]
    if ahead.event or behind.event or not (behind.laying and ahead.moved):
        slide = {"M23": "V", "M33": "Q"}.get(ahead.event)
        # A knife that goes up a block earlier in its run-up has crossed all that it must.
        crossed = slide and abs(line.before[slide]) >= line.reach - 1.0 - run_on(lines, ahead, slide)
        return bool(ahead.event) and not crossed
    share = (line.after["U"] - line.before["U"]) / (ahead.after["U"] - line.before["U"])
    return off_the_way(lines, line, share) > 0.06


def matters_in_the_air(lines: Sequence[Line], line: Line) -> bool:
    """Whether a block in the air is more than a place on a straight way, or than the end of a lowered knife's run-up.

    With delays the shoe is down for a while after its word up: the way is curved there, but not by much in a block.
    """
    slides = [{"M22": "V", "M32": "Q"}[knife] for knife in line.knives]
    if slides and line.moved <= set("UVQDE"):
        return not all(
            min(side * line.before[slide], side * line.after[slide]) >= line.reach
            for slide in slides
            for side in [math.copysign(1.0, line.after[slide])]
        )
    ahead = next_of(lines, line)
    if not {"X", "Y", "Z", "U"} <= line.moved & ahead.moved:
        return True
    share = (line.after["U"] - line.before["U"]) / (ahead.after["U"] - line.before["U"])
    return off_the_way(lines, line, share) > 0.06


def lower(lines: Sequence[Line]) -> Iterator[Mutant]:
    """Z 0.2 mm down at the end of a block in the air, but for a plunge or retract in several blocks, along which it is.

    Upwards the head is only clearer of the part.
    """
    for line in motions(lines):
        ahead = next((later for later in lines[line.index + 1 :] if later.moved), None)
        if line.laying or "Z" not in line.moved:
            continue
        if ahead and line.motion == ahead.motion == "G01" and line.moved == ahead.moved <= set("XYZ"):
            share = (line.after["Z"] + 0.2 - line.before["Z"]) / (ahead.after["Z"] - line.before["Z"])
            place = [line.before[a] + share * (ahead.after[a] - line.before[a]) - line.after[a] for a in "XY"]
            if 0.0 < share < 1.0 and math.hypot(*place) < 0.04:
                continue
        yield edited(lines, line.index, line.index + 1, changed(line, "Z", line.after["Z"] + 0.2))


def block_in_the_air_dropped(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line in motions(lines):
        if not line.laying and line.motion == "G01" and matters_in_the_air(lines, line):
            yield edited(lines, line.index, line.index + 1)


def feed_doubled(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line in lines:
        if line.word("F") and line.moved:
            text = re.sub(r"F[\d.]+", f"F{2 * float(line.word('F')):.6g}", line.text)
            yield edited(lines, line.index, line.index + 1, text)


def feed_written(lines: Sequence[Line]) -> Iterator[Mutant]:
    """A feed of its own, twice that in force, where a block of plunge, run-out or retract had none."""
    feed = 0.0
    for line in lines:
        feed = float(line.word("F") or feed)
        if not line.word("F") and line.motion == "G01" and line.moved <= set("XYZ") and line.moved:
            yield edited(lines, line.index, line.index + 1, f"{line.text} F{2 * feed:.3f}")


def first_motion_dropped(lines: Sequence[Line]) -> Iterator[Mutant]:
    """Z first, alone: without it the head sets out for all axes at once, from wherever it is."""
    first = next(line for line in lines if line.motion)
    yield edited(lines, first.index, first.index + 1, first.text.split()[0] + " G00")


def word_replaced(old: str, new: str) -> Kind:
    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in lines:
            if re.search(rf"\b{old}\b", line.text) and not line.text.startswith("("):
                yield edited(lines, line.index, line.index + 1, re.sub(rf"\b{old}\b", new, line.text))

    return mutants


def point_lost(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line in motions(lines):
        for letter in sorted(line.moved):
            if abs(line.after[letter]) > 1.0 and does_something(lines, line, letter):
                text = re.sub(rf"({letter}-?\d+)\.", r"\1", line.text, count=1)
                yield edited(lines, line.index, line.index + 1, text)


def letters_swapped(one: str, other: str) -> Kind:
    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if {one, other} <= line.moved and any(does_something(lines, line, letter) for letter in (one, other)):
                text = line.text.translate(str.maketrans(one + other, other + one))
                yield edited(lines, line.index, line.index + 1, text)

    return mutants


def blocks_swapped(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line, ahead in zip(lines, lines[1:], strict=False):
        if line.laying and line.moved and ahead.moved:
            yield edited(lines, line.index, line.index + 2, ahead.text, line.text)


def course_spans(lines: Sequence[Line]) -> list[tuple[int, int]]:
    """Lines of each course, from its comment on."""
    begins = [line.index for line in lines if line.text.startswith("(course")]
    ends = [*begins[1:], next(line.index for line in lines if line.text.endswith("M30"))]
    return list(zip(begins, ends, strict=True))


def course_dropped(lines: Sequence[Line]) -> Iterator[Mutant]:
    for begin, end in course_spans(lines):
        yield edited(lines, begin, end)


def courses_swapped(lines: Sequence[Line]) -> Iterator[Mutant]:
    spans = course_spans(lines)
    for (begin, middle), (_, end) in zip(spans, spans[1:], strict=False):
        texts = [line.text for line in lines]
        yield edited(lines, begin, end, *texts[middle:end], *texts[begin:middle])


def sweeps(lines: Sequence[Line]) -> Iterator[tuple[Line, Line]]:
    """The lines that put a knife down and up."""
    for line in lines:
        if line.event in ("M22", "M32"):
            up = "M23" if line.event == "M22" else "M33"
            yield line, next(later for later in lines[line.index :] if later.event == up)


def cut_left_out(lines: Sequence[Line]) -> Iterator[Mutant]:
    for down, up in sweeps(lines):
        yield edited(lines, down.index, up.index + 1, *(line.text for line in lines[down.index + 1 : up.index]))


def cut_again(lines: Sequence[Line]) -> Iterator[Mutant]:
    for down, up in sweeps(lines):
        texts = [line.text for line in lines[down.index : up.index + 1]]
        yield edited(lines, up.index + 1, up.index + 1, *texts)


def run_on(lines: Sequence[Line], up: Line, slide: str) -> float:
    """How far, in mm, a slide goes on at full speed after the word that raises its knife, before it is up."""
    word = {"M23": "M22", "M33": "M32"}[up.event]
    down = next(line for line in lines[up.index :: -1] if line.event == word)
    fed = [
        abs((line.after[slide] - line.before[slide]) / (line.after["U"] - line.before["U"]))
        for line in lines[down.index : up.index]
        if {slide, "U"} <= line.moved
    ]
    return up.fed_meanwhile * max(fed, default=0.0)


def knife_up_early(lines: Sequence[Line]) -> Iterator[Mutant]:
    """A block of a sweep in two, the knife up between them, 5 mm before it has crossed all that it must."""
    for down, up in sweeps(lines):
        slide = "V" if down.event == "M22" else "Q"
        target = math.copysign(up.reach - 5.0 - run_on(lines, up, slide), up.after[slide])
        crossing = [
            line
            for line in lines[down.index : up.index]
            if slide in line.moved
            and min(line.before[slide], line.after[slide]) < target
            and target < max(line.before[slide], line.after[slide])
        ]
        if not crossing:
            continue
        last = crossing[-1]
        short = (target - last.before[slide]) / (last.after[slide] - last.before[slide])
        words = [f"{a}{last.before[a] + short * (last.after[a] - last.before[a]):.3f}" for a in sorted(last.moved)]
        feed = [f"F{last.word('F')}"] if last.word("F") else []
        rest = [line.text for line in lines[last.index : up.index]]
        yield edited(lines, last.index, up.index + 1, " ".join(["G01", *words, *feed]), up.text, *rest)


def knife_parked_inside(lines: Sequence[Line]) -> Iterator[Mutant]:
    for down, up in sweeps(lines):
        slide, last = "V" if down.event == "M22" else "Q", lines[up.index - 1]
        if slide in last.moved:
            yield edited(lines, last.index, last.index + 1, changed(last, slide, 0.0))


def stray_cut(lines: Sequence[Line]) -> Iterator[Mutant]:
    """A knife goes down and up around a motion that is no cut."""
    for line in motions(lines):
        if not line.knives and line.moved & set("UVQ"):
            knife = ("M32", "M33") if "Q" in line.moved else ("M22", "M23")
            yield edited(lines, line.index, line.index + 1, knife[0], line.text, knife[1])


def inserted(word: str, where: Callable[[Line], bool]) -> Kind:
    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if where(line):
                yield edited(lines, line.index, line.index, word)

    return mutants


def cut_off(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line in motions(lines):
        yield line.index, [before.text for before in lines[: line.index]]


def u_shifted(lines: Sequence[Line]) -> Iterator[Mutant]:
    """U a millimetre on from a block of a laying on."""
    for line in motions(lines):
        if line.laying and "U" in line.moved:
            texts = [
                changed(later, "U", float(later.word("U")) + 1.0) if later.word("U") else later.text
                for later in lines[line.index :]
            ]
            yield edited(lines, line.index, len(lines), *texts)


DEVICES = (("M20", "M25"), ("M21", "M26"), ("M27", "M28"), ("M22", "M23"), ("M32", "M33"), ("M24",), ("M00",))


def shows_at(lines: Sequence[Line], place: int) -> set[int]:
    """Lines (from 1) where a break at a place (from 0) can show: there, or at a device's next or last word."""
    found = {place + 1}
    for words in DEVICES:
        at = [line.index + 1 for line in lines if line.event in words]
        found |= {max((index for index in at if index <= place), default=place + 1)}
        found |= {min((index for index in at if index > place + 1), default=place + 1)}
    return found


def faults_of(job: Job, mutant: Mutant) -> list[tuple[int, str]]:
    """What the reader or verification says of a mutant, with the lines."""
    try:
        program = job.read_back(("\n".join(mutant[1]) + "\n").encode(), "mutant.nc")
    except ProgramRefused as refused:
        return [(fault.line, fault.sentence) for fault in refused.faults]
    failures = job.inspector(None).judge(program.trajectory, job.resolution).failures
    return [(failure.line, failure.sentence()) for failure in failures]


def laid(line: Line) -> bool:
    return line.laying


def in_the_air(line: Line) -> bool:
    return not line.laying


def sweeping(line: Line) -> bool:
    return bool(line.knives)


def inwards(letter: str) -> Kind:
    """A place of a sweep a millimetre nearer to the tape's middle; one in a run-up, a millimetre inside the sweep.

    Farther out it is as good, and so is a place of a run-up that stays beyond all that a sweep must cross.
    """

    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        for line in motions(lines):
            if letter in line.moved and line.after[letter] and does_something(lines, line, letter):
                inside = min(abs(line.after[letter]), line.reach) - 1.0
                value = math.copysign(inside, line.after[letter])
                yield edited(lines, line.index, line.index + 1, changed(line, letter, value))

    return mutants


def bent(lines: Sequence[Line]) -> Iterator[Mutant]:
    for line in lines:
        if line.laying and line.moved and bends(lines, line):
            yield edited(lines, line.index, line.index + 1)


def moved_over(event: str, by: int, axes: str) -> Kind:
    """A switching word moved over a block that moves one of some axes: over another it does the same.

    One that shortens a sweep goes on to where it does so: at the ends of a run-up the knife cuts nothing.
    """

    def mutants(lines: Sequence[Line]) -> Iterator[Mutant]:
        slide = {("M22", 1): "V", ("M23", -1): "V", ("M32", 1): "Q", ("M33", -1): "Q"}.get((event, by))
        if slide is None:
            for place, texts in event_moved(event, by)(lines):
                motion = next(line for line in lines[place:] if line.moved)
                if motion.moved & set(axes):
                    yield place, texts
            return
        for line in lines:
            if line.event != event:
                continue
            most = line.reach - 1.0 - (run_on(lines, line, slide) if by < 0 else 0.0)
            way = lines[line.index + 1 :] if by > 0 else lines[line.index - 1 :: -1]
            # Behind the word, the block's end counts, before it, its beginning.
            ends = [(other, other.after if by > 0 else other.before) for other in way if slide in other.moved]
            inside = next((other for other, end in ends if abs(end.get(slide, math.inf)) < most), None)
            if inside is not None:
                yield word_moved(lines, line, inside)

    return mutants


KINDS: dict[str, Kind] = {
    **{f"{axis} with the other sign": sign_flipped(axis) for axis in AXES},
    **{f"{axis} {off:+} mm while laying": off_by(axis, off, laid) for axis in "XYZ" for off in (0.2, -0.2)},
    **{f"{axis} {off:+} mm in the air": off_by(axis, off, in_the_air) for axis in "XY" for off in (0.2, -0.2)},
    "Z +0.2 mm in the air": lower,
    **{f"{axis} {off:+} deg": off_by(axis, off, lambda line: True) for axis in "AC" for off in (0.5, -0.5)},
    **{f"U {off:+} mm in one block": off_by("U", off, lambda line: True) for off in (1.0, -1.0)},
    "U +1 mm from a block on": u_shifted,
    **{f"{axis} 1 mm inwards": inwards(axis) for axis in "VQ"},
    **{f"{axis} {off:+} deg": off_by(axis, off, lambda line: True) for axis in "DE" for off in (0.5, -0.5)},
    **{
        f"{one} and {other} swapped": letters_swapped(one, other) for one, other in ("XY", "XZ", "AC", "VQ", "DE", "UV")
    },
    "a point lost": point_lost,
    "a laying block dropped": bent,
    "a block in the air dropped": block_in_the_air_dropped,
    "a rapid dropped": dropped(lambda line: line.motion == "G00"),
    "two blocks swapped": blocks_swapped,
    "F doubled": feed_doubled,
    "F doubled where it was not written": feed_written,
    "no Z before all axes": first_motion_dropped,
    "G00 for G01": word_replaced("G01", "G00"),
    "G91 for G90": word_replaced("G90", "G91"),
    "M30 in front": inserted("M30", laid),
    "the rest cut off": cut_off,
    "a course dropped": course_dropped,
    "two courses swapped": courses_swapped,
    "a cut left out": cut_left_out,
    "a cut made again": cut_again,
    "a knife up 5 mm early": knife_up_early,
    "a knife left inside the tape": knife_parked_inside,
    "a cut where none belongs": stray_cut,
    "a stop while laying": inserted("M00", laid),
    "a stop while a knife is down": inserted("M00", sweeping),
    **{f"{event} dropped": event_replaced(event, "") for words in DEVICES for event in words},
    **{
        f"{event} {'earlier' if by < 0 else 'later'}": moved_over(event, by, "U" if event in ("M24", "M00") else AXES)
        for words in DEVICES
        for event in words
        for by in (-1, 1)
        if (event, by) not in (("M24", -1), ("M00", -1))  # before anything is fed, and onto more waste
    },
}
EVENTS = [event for words in DEVICES for event in words]
SLOW = "slow actuators"


def sampled(
    kind: str, make: Kind, plies: Sequence[str], each: int
) -> Iterator[tuple[str, Job, Sequence[Line], Mutant]]:
    """Some mutants of a kind from each of some plies, always the same."""
    random = np.random.default_rng(sum(map(ord, kind)))
    for name in plies:
        job, text = good(name)
        lines = lines_of(text, job)
        mutants = list(make(lines))
        for chosen in random.permutation(len(mutants))[:each].tolist():
            yield name, job, lines, mutants[chosen]


def check(kind: str, name: str, job: Job, lines: Sequence[Line], mutant: Mutant) -> None:
    """A mutant is caught, and where it shows is named."""
    place, texts = mutant
    what = f"{kind}, {name}, line {place + 1}: {lines[place].text}"
    faults = faults_of(job, mutant)
    assert faults, f"not caught: {what}"
    if any(abs(line - near) <= 3 for line, _ in faults for near in shows_at(lines, place)):
        return
    # A cut that is not there shows where the tape goes by, a roll that is not changed where it runs out.
    assert any(re.search("cuts_made is 0|roll_used_m", sentence) for _, sentence in faults), f"{what}: {faults[:3]}"


@pytest.mark.parametrize("name", PLIES)
def test_the_programs_are_good_before_they_are_broken(name: str) -> None:
    job, text = good(name)
    evidence = job.inspector(None).judge(job.read_back(text, "good.nc").trajectory, job.resolution)
    assert evidence.passed, evidence.worst(5)
    if name != SLOW:
        assert faults_of_the_tape(text, job.courses, job.setup, job.machine) == []


@pytest.mark.parametrize("kind", KINDS)
def test_every_mutant_is_caught_where_it_shows(kind: str) -> None:
    # With delays a word is in force later than it stands: what a raised knife does before is not told apart here.
    raised = kind[0] in "VQDE" or "V" in kind
    turn = sum(map(ord, kind)) % len(PLIES)
    plies = [name for name in [*PLIES, *PLIES][turn : turn + len(PLIES)] if not (raised and name == SLOW)]
    mutants = list(itertools.islice(sampled(kind, KINDS[kind], plies, 1), 5))
    assert mutants
    for name, job, lines, mutant in mutants:
        check(kind, name, job, lines, mutant)


@pytest.mark.parametrize("event", EVENTS)
def test_every_switching_word_for_every_other_is_caught(event: str) -> None:
    for turn, other in enumerate(other for other in EVENTS if other != event):
        kind = f"{other} for {event}"
        plies = list(PLIES)[turn % 4 :: 4] + ["a new roll"]
        for name, job, lines, mutant in sampled(kind, event_replaced(event, other), plies, 1):
            check(kind, name, job, lines, mutant)


def test_no_wrong_byte_breaks_the_reader_or_verification() -> None:
    """A byte changed, dropped or doubled: refused, failed or passed, but never another exception."""
    random = np.random.default_rng(7)
    signs = b"0123456789.-+ GMNXYZACUVQDEFP()%\n"
    for name in list(PLIES)[:6]:
        job, text = good(name)
        for _ in range(25):
            at, sign = int(random.integers(len(text))), signs[int(random.integers(len(signs)))]
            wrong = [
                text[:at] + bytes([sign]) + text[at + 1 :],
                text[:at] + text[at + 1 :],
                text[:at] + text[at:][:1] + text[at:],
            ]
            mutant = wrong[int(random.integers(3))].decode().splitlines()
            faults_of(job, (0, mutant))
