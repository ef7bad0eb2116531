"""Table: the contents of a controller's TOML file, and the checks for contradictions."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tapelayer.errors import ControllerRefused, InputFault
from tapelayer.motion.corners import Corner, Rule
from tapelayer.motion.trajectory import Event

Joint = Annotated[str, Field(min_length=1)]
Address = Annotated[str, Field(pattern=r"^[A-Z](\d*=)?$")]
Letter = Annotated[str, Field(pattern=r"^[A-Z]$")]
GCode = Annotated[str, Field(pattern=r"^G\d{1,3}(\.\d)?$")]
MCode = Annotated[str, Field(pattern=r"^M\d{1,3}$")]
EventWords = Annotated[str, Field(pattern=r"^M\d{1,3}( [A-Z]\d{1,3})?$")]
NoEffect = Annotated[str, Field(pattern=r"^([A-Z]|G\d{1,3}(\.\d)?( [A-Z]\d+(\.\d+)?)?|.*[^A-Za-z0-9 .+-].*)$")]
EventName = Literal[
    "shoe_down",
    "shoe_up",
    "roller_down",
    "roller_up",
    "knife_1_down",
    "knife_1_up",
    "knife_2_down",
    "knife_2_up",
    "supply_mode",
    "heater_on",
    "heater_off",
    "stop",
    "air_on",
    "air_off",
    "arc_on",
    "arc_off",
]
Plane = Literal["xy", "zx", "yz"]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class AxisWord(_Table):
    """The address and format of a joint.

    Attributes:
        address: the letter, or an extended address with its equals sign (`Q1=`).
        joints: joints that it may address; a machine has at most one of them.
        unit: unit of the number, mm or deg.
        decimals: digits after the point.
        word: the M word that takes the address if the control does not interpolate the axis. It is written in the same
            block; a block that moves nothing else becomes this word, the address, and a dwell for the block's time.
        alone: whether that word needs a block of its own even where other axes are stated.
    """

    address: Address
    joints: Annotated[tuple[Joint, ...], Field(min_length=1, strict=False)]
    unit: Literal["mm", "deg"]
    decimals: Annotated[int, Field(ge=0, le=6)] = 3
    word: Annotated[str, Field(pattern=r"^(M\d{1,3}( [A-Z]\d{1,3})?)?$")] = ""
    alone: bool = False


class Blocks(_Table):
    """The format of blocks, and the text around them.

    Attributes:
        number_step: step of the N words and the first of them; 0 writes none.
        number_maximum: the largest N, after which they start again.
        max_line: most characters that the control takes in a line, without the line end.
        comment: how a comment begins: `(` up to `)`, `;` up to the line's end, or either; the first is written.
        first_line: a line before everything, without N; empty for none.
        last_line: a line after everything, without N; empty for none.
        preamble: blocks written once, before the first motion.
        restated: blocks written before the first motion and at the start of every course.
        end: codes that end a program; the first is written.
    """

    number_step: Annotated[int, Field(ge=0)]
    number_maximum: Annotated[int, Field(ge=1, le=999999999)]
    max_line: Annotated[int, Field(ge=90)]
    comment: Literal["(", ";", "(;"]
    first_line: str
    last_line: str
    preamble: Annotated[tuple[str, ...], Field(strict=False)]
    restated: Annotated[tuple[str, ...], Field(strict=False)]
    end: Annotated[tuple[MCode, ...], Field(min_length=1, strict=False)]


class Codes(_Table):
    """The G words.

    Attributes:
        rapid: rapid positioning.
        linear: straight interpolation.
        clockwise: circular interpolation, clockwise seen against the plane's third axis.
        counterclockwise: circular interpolation, the other way round.
        dwell: pause.
        dwell_address: address of the pause in seconds.
        dwell_decimals: digits after its point; half a millisecond is an eighth of a millimetre of tape.
        absolute: axis words are positions from here on.
        incremental: axis words are increments from here on.
        per_minute: the feed word is a path speed per minute.
        inverse_time: the feed word is one over the block's minutes.
        set_position: the axis words of the block become the current position; empty where no G word does that.
        planes: the plane of circular blocks.
        no_effect: texts that are read and ignored: G words, with an argument (`G64 P0.01`) or without, letters of
            further words, and whole blocks that hold a character which no word has.
    """

    rapid: GCode
    linear: GCode
    clockwise: GCode
    counterclockwise: GCode
    dwell: GCode
    dwell_address: Letter
    dwell_decimals: Annotated[int, Field(ge=1, le=6)] = 6
    absolute: GCode
    incremental: GCode
    per_minute: GCode
    inverse_time: GCode
    set_position: Annotated[str, Field(pattern=r"^(G\d{1,3}(\.\d)?)?$")]
    planes: dict[Plane, GCode]
    no_effect: Annotated[tuple[NoEffect, ...], Field(strict=False)] = ()

    def words(self) -> dict[str, str]:
        """Return every G word by its purpose."""
        others = {"no_effect", "planes", "dwell_address", "dwell_decimals"}
        words = {name: value for name, value in self.model_dump(exclude=others).items() if value}
        return words | {f"plane {plane}": code for plane, code in self.planes.items()}


class Feed(_Table):
    """The meaning of the feed word.

    Attributes:
        address: its letter.
        mode: per minute along the path, or inverse time (1/min).
        path: groups of addresses, the first of which that moves in a block sets the path that F is along, as the
            square root of the summed squares in written units.
        otherwise: where no group moves: F is along the axis with the largest change in written units (ties: the first
            in word order), or along the root of the summed squares of all axes.
        modal: whether a feed word holds until the next one.
        digits: least number of significant digits.
    """

    address: Letter
    mode: Literal["per_minute", "inverse_time"]
    path: Annotated[tuple[Annotated[tuple[Address, ...], Field(min_length=1, strict=False)], ...], Field(strict=False)]
    otherwise: Literal["largest", "norm"]
    modal: bool
    digits: Annotated[int, Field(ge=6, le=9)] = 6


class ArcRule(_Table):
    """Circular blocks.

    Attributes:
        planes: planes in which the control interpolates circles while further axes move along; none writes no arcs.
        offsets: addresses of the centre, along x, y, z from the block's beginning.
        tolerance_mm: largest distance of the ends of the straight blocks from the arc that replaces them, and of
            another axis, in its own unit, from its proportion.
    """

    planes: Annotated[tuple[Plane, ...], Field(strict=False)]
    offsets: Annotated[tuple[Letter, Letter, Letter], Field(strict=False)] = ("I", "J", "K")
    tolerance_mm: Annotated[float, Field(gt=0, le=0.1)] = 0.005


class Timing(_Table):
    """How the control passes from block to block, and the words that choose it.

    Attributes:
        corner: `none`: every axis reaches its speed at once; `stop`: a full stop at every block's end; `linuxcnc`: its
            trajectory planner; `look_ahead`: over any number of blocks, corners rounded within the tolerance.
        exact: word for a full stop at the end of every block from here on.
        blended: word for going on without stops from here on.
        tolerance_address: letter that states how far corners may be rounded off, in mm; empty where the control's own
            parameters do.
        tolerance_mm: how far the control's parameters let corners be rounded off; where the letter states it, the least
            that is written.
        initial: which of the two holds before either word.
        switching: whether a switching word lets the motion go on, or stops it.
        cycle_ms: servo period.
        kink: share of an axis's acceleration that LinuxCNC spends on a corner that it passes without a stop.
        drain_ms: time for a word that lets the control finish all motion first.
    """

    corner: Corner = "stop"
    exact: Annotated[str, Field(pattern=r"^(G\d{1,3}(\.\d)?)?$")] = ""
    blended: Annotated[str, Field(pattern=r"^(G\d{1,3}(\.\d)?)?$")] = ""
    tolerance_address: Annotated[str, Field(pattern=r"^[A-Z]?$")] = ""
    tolerance_mm: Annotated[float, Field(ge=0, le=10, strict=False)] = 0.0
    initial: Literal["exact", "blended"] = "exact"
    switching: Literal["on_the_fly", "stops"] = "stops"
    cycle_ms: Annotated[float, Field(gt=0, le=100, strict=False)] = 1.0
    kink: Annotated[float, Field(gt=0, lt=1, strict=False)] = 0.1
    drain_ms: Annotated[float, Field(ge=0, le=1000, strict=False)] = 0.0

    @property
    def blends(self) -> bool:
        """Whether the control can go from block to block without a stop."""
        return self.corner in ("linuxcnc", "look_ahead")

    @property
    def tolerance(self) -> float:
        """How far corners are rounded off, in metres, where blocks go on without stops."""
        return self.tolerance_mm * 1e-3

    def text(self, tolerance: float) -> str:
        """Return the words of a mode: an exact stop for a tolerance of 0 metres, else blending within it."""
        if not tolerance > 0.0:
            return self.exact
        stated = f" {self.tolerance_address}{round(tolerance * 1e3, 4):g}" if self.tolerance_address else ""
        return self.blended + stated

    def faults(self) -> Iterator[str]:
        """Yield what contradicts itself."""
        if self.blends:
            missing = [name for name in ("exact", "blended") if not getattr(self, name)]
            if missing:
                yield f"time: corner {self.corner} without {' and '.join(missing)}; give the words, or corner = stop"
            if not self.tolerance_mm > 0:
                yield f"time: corner {self.corner} without tolerance_mm above 0; give how far corners are rounded off"
        elif self.exact or self.blended:
            yield f"time: corner {self.corner} has no words for exact and blended; leave them out"


class Controller(_Table):
    """A control, as its table describes it.

    Attributes:
        name: name of the table: built-in, or the file's without its ending.
        sha256: SHA-256 of the table's bytes, hexadecimal.
        title: one line for people.
        axes: axis words in their order in a block.
        max_word: largest magnitude of an axis word, in written units.
        u_reset: whether the tape's axis is set to zero at the start of each course.
        reserved: letters that mean something else to this control and cannot be axis addresses.
        blocks: block format.
        codes: G words.
        feed: feed rule.
        events: words of the switching events that the control knows.
        events_at_rest: different words of those events, where no motion follows directly.
        levels: letters of the values that some events carry, such as the arc's current.
        arcs: circular blocks.
        time: how the control passes from block to block; without it with a full stop at every block's end.
    """

    name: str
    sha256: str
    title: str
    axes: Annotated[tuple[AxisWord, ...], Field(min_length=1, strict=False)]
    max_word: Annotated[float, Field(gt=0, le=2e9, strict=False)]
    u_reset: Literal["never", "course"]
    reserved: Annotated[tuple[Letter, ...], Field(strict=False)]
    blocks: Blocks
    codes: Codes
    feed: Feed
    events: dict[EventName, EventWords]
    events_at_rest: dict[EventName, EventWords] = {}
    levels: dict[EventName, Letter] = {}
    arcs: ArcRule
    time: Timing = Timing()

    @model_validator(mode="after")
    def _lint(self) -> Self:
        faults = list(self._faults())
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _faults(self) -> Iterator[str]:
        reserved = {letter: "is reserved by the control" for letter in self.reserved}
        reserved |= {letter: "is the centre of arcs" for letter in self.arcs.offsets if self.arcs.planes}
        taken = {self.codes.dwell_address: "is the time of a dwell", self.feed.address: "is the feed"}
        taken |= {"G": "begins a preparatory word", "M": "begins a switching word", "N": "numbers a block"}
        joints: set[str] = set()
        for axis in self.axes:
            # An M word that takes the address defines its letter.
            clash = taken.get(axis.address) or ("" if axis.word else reserved.get(axis.address, ""))
            if clash:
                yield f"axes: address {axis.address} {clash}; give {axis.joints[0]} another"
            if axis.alone and not axis.word:
                yield f"axes: address {axis.address} stands alone without a word; give the word that takes it"
            taken[axis.address] = "has an axis already"
            for joint in axis.joints:
                if joint in joints:
                    yield f"axes: joint {joint} has two addresses; give it one"
                joints.add(joint)
        addresses = {axis.address for axis in self.axes}
        for address in sorted({address for group in self.feed.path for address in group} - addresses):
            yield f"feed.path: {address} is not the address of an axis"
        yield from self.time.faults()
        modes = {name: word for name in ("exact", "blended") if (word := getattr(self.time, name))}
        yield from self._repeated("codes", (self.codes.words() | modes).items(), {})
        words = sorted({axis.word for axis in self.axes} - {""})
        if len({(axis.word, axis.alone) for axis in self.axes if axis.word}) > 1:
            yield f"axes: {' and '.join(words)} take axes; all such axes need one word and one value of alone"
        for taking in words:
            if any(text.split()[0] == taking.split()[0] for _, text in self._all_events()):
                yield f"axes: {taking} is the word of an event; give the axis another"
        ends = {code(word): "end" for word in self.blocks.end}
        yield from self._repeated("events", self.events.items(), ends)
        for event, word in self.events_at_rest.items():
            if event not in self.events:
                yield f"events_at_rest: {event} is not in events; add it there"
            if any(other != event and code(text) == code(word) for other, text in self._all_events()):
                yield f"events_at_rest: {word} of {event} is the word of another event too; give it one of its own"
        for block in self.blocks.preamble:
            yield from self._unknown_words("blocks.preamble", block)
        for block in self.blocks.restated:
            yield from self._unknown_words("blocks.restated", block)
        if self.u_reset == "course" and not self.codes.set_position:
            yield "u_reset: needs codes.set_position, the G word that sets the tape's axis to zero; give it"
        for event, letter in self.levels.items():
            if event not in self.events:
                yield f"levels: {event} is not in events; add it there"
            if letter not in self.codes.no_effect:
                yield f"levels: {letter} of {event} is not in codes.no_effect, so no reader would know it"
        missing = [plane for plane in self.arcs.planes if plane not in self.codes.planes]
        if missing:
            yield f"arcs.planes: {' and '.join(missing)} without a G word in codes.planes; give it"
        if self.blocks.number_step > self.blocks.number_maximum:
            yield "blocks: number_step is beyond number_maximum; lower it"

    def _all_events(self) -> Iterator[tuple[str, str]]:
        yield from self.events.items()
        yield from self.events_at_rest.items()

    @staticmethod
    def _repeated(
        section: str, words: Iterable[tuple[str, str]], used: dict[tuple[str, float, str], str]
    ) -> Iterator[str]:
        for name, word in words:
            other = used.setdefault(code(word), name)
            if other != name:
                yield f"{section}: {word} stands for both {other} and {name}; each needs a word of its own"

    def _unknown_words(self, section: str, block: str) -> Iterator[str]:
        if block in self.codes.no_effect:
            return
        modes = [word for word in (self.time.exact, self.time.blended) if word]
        known = {code(word) for word in [*self.codes.words().values(), *modes]}
        known |= {code(word) for word in self.codes.no_effect if re.fullmatch(r"G\d+(\.\d)?", word)}
        for word in block.split():
            if not re.fullmatch(r"G\d+(\.\d)?", word) or code(word) not in known:
                yield f"{section}: {word} is not in codes or codes.no_effect, so no reader would know it"

    def addressed(self, joints: Sequence[str]) -> tuple[tuple[AxisWord, int], ...]:
        """Return the axis words of a machine's joints in word order, each with the joint's index in `joints`.

        Raises:
            ControllerRefused: a joint has no address, or two share one.
        """
        pairs = [(axis, index) for axis in self.axes for index in range(len(joints)) if joints[index] in axis.joints]
        written = {index for _, index in pairs}
        faults = [
            InputFault(0, f"has no address for axis {joint}; use a controller that has, or add it to the table's axes")
            for index, joint in enumerate(joints)
            if index not in written
        ]
        for axis in self.axes:
            sharing = [joints[index] for other, index in pairs if other is axis]
            if len(sharing) > 1:
                faults.append(
                    InputFault(0, f"axes {' and '.join(sharing)} share address {axis.address}; the machine has both")
                )
        if faults:
            raise ControllerRefused(f"controller {self.name}", faults)
        return tuple(pairs)

    def rule(self, joints: Sequence[str]) -> Rule:
        """Return how this control turns the blocks of a machine's joints into motion.

        Raises:
            ControllerRefused: a joint has no address, or two share one.
        """
        pairs = self.addressed(joints)
        columns = {axis.address: index for axis, index in pairs}
        paths = [tuple(columns[address] for address in group if address in columns) for group in self.feed.path]
        return Rule(
            corner=self.time.corner,
            paths=tuple(path for path in paths if path),
            digits=tuple(self.resolution(joint) for joint in joints),
            rotary=frozenset(index for axis, index in pairs if axis.unit == "deg"),
            outputs=frozenset(index for axis, index in pairs if axis.word),
            switching=self.time.switching,
            cycle=self.time.cycle_ms * 1e-3,
            kink=self.time.kink,
            drain=self.time.drain_ms * 1e-3,
            tolerance=self.time.tolerance if self.time.blends else 0.0,
            stated=bool(self.time.tolerance_address),
        )

    def resolution(self, joint: str) -> float:
        """Return the last written digit of a joint, in metres or radians.

        Raises:
            ControllerRefused: the joint has no address.
        """
        ((axis, _),) = self.addressed((joint,))
        return (1e-3 if axis.unit == "mm" else math.pi / 180.0) * 10.0**-axis.decimals

    def event_words(self, at_rest: bool = False) -> dict[Event, str]:
        """Return the words of each event that the control knows, with a motion after it or at rest."""
        words = {**self.events, **self.events_at_rest} if at_rest else self.events
        return {Event[name.upper()]: word for name, word in words.items()}


def code(words: str) -> tuple[str, float, str]:
    """Return letter, number and second word of a code, which are equal for equal codes however they are written."""
    first, _, second = words.partition(" ")
    return first[0], float(first[1:]), second
