"""Table: the contents of a controller's TOML file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tapelayer.errors import ControllerRefused, InputFault
from tapelayer.motion.corners import Corner, Rule
from tapelayer.motion.trajectory import Event

# What a text must look like, and the words for it. The digits and letters are those of ASCII, as in every program.
EXPECTED = {
    r"^[ -~]*$": "printable ASCII signs",
    r"^[ -~]*[!-~][ -~]*$": "printable ASCII signs, and not blanks alone",
    r"^[^\p{C}]*$": "one line of printable signs",
    r"^[A-Z]([0-9]*=)?$": "a capital letter, or one with a number and an equals sign such as Q1=",
    r"^[A-Z]$": "a capital letter",
    r"^[A-Z]?$": "a capital letter, or nothing",
    r"^G[0-9]{1,3}(\.[0-9])?$": "a G word such as G1 or G92.1",
    r"^(G[0-9]{1,3}(\.[0-9])?)?$": "a G word such as G92, or nothing",
    r"^M[0-9]{1,3}$": "an M word such as M30",
    r"^M[0-9]{1,3}( [A-Z][0-9]{1,3})?$": "an M word such as M20 or M62 P3",
    r"^(M[0-9]{1,3}( [A-Z][0-9]{1,3})?)?$": "an M word such as M29 or M68 E0, or nothing",
    r"^([A-Z]|G[0-9]{1,3}(\.[0-9])?( [A-Z][0-9]+(\.[0-9]+)?)?|[ -~]*[!-*,/:-@\[-`{-~][ -~]*)$": (
        "a letter, a G word such as G40 or G64 P0.01, or a block with a sign that no word has such as FGROUP(X,Y)"
    ),
}
_LINE, _BLOCK, _TITLE, _ADDRESS, _LETTER, _ANY_LETTER, _G, _ANY_G, _M, _EVENT, _AXIS_WORD, _NO_EFFECT = EXPECTED

Joint = Annotated[str, Field(min_length=1)]
Line = Annotated[str, Field(pattern=_LINE)]
Block = Annotated[str, Field(pattern=_BLOCK)]
Address = Annotated[str, Field(pattern=_ADDRESS)]
Letter = Annotated[str, Field(pattern=_LETTER)]
GCode = Annotated[str, Field(pattern=_G)]
MCode = Annotated[str, Field(pattern=_M)]
EventWords = Annotated[str, Field(pattern=_EVENT)]
NoEffect = Annotated[str, Field(pattern=_NO_EFFECT)]
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
    word: Annotated[str, Field(pattern=_AXIS_WORD)] = ""
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
    first_line: Line
    last_line: Line
    preamble: Annotated[tuple[Block, ...], Field(strict=False)]
    restated: Annotated[tuple[Block, ...], Field(strict=False)]
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
    set_position: Annotated[str, Field(pattern=_ANY_G)]
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
    exact: Annotated[str, Field(pattern=_ANY_G)] = ""
    blended: Annotated[str, Field(pattern=_ANY_G)] = ""
    tolerance_address: Annotated[str, Field(pattern=_ANY_LETTER)] = ""
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
        """Return the words of a mode: an exact stop for a tolerance of 0 metres, else blending within it.

        A tolerance whose digits, as they are written, are all 0 is an exact stop; one without bound has no letter.
        """
        if not self.tolerance_address:
            return self.blended if tolerance > 0.0 else self.exact
        if math.isinf(tolerance):
            return self.blended
        stated = f"{tolerance * 1e3:.4f}".rstrip("0").rstrip(".")
        return self.exact if stated == "0" else f"{self.blended} {self.tolerance_address}{stated}"


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
    title: Annotated[str, Field(pattern=_TITLE)]
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

    def check_units(self, turning: Mapping[str, bool]) -> None:
        """Refuse an axis that turns in millimetres, or one that slides in degrees.

        Args:
            turning: whether each joint of the machine turns.

        Raises:
            ControllerRefused: as said; all such axes at once.
        """
        faults = [
            InputFault(
                0, f"axes: {axis.address} counts joint {joint} in {axis.unit}, but it {does}; give unit = {unit}"
            )
            for axis in self.axes
            for joint in axis.joints
            for does, unit in [("turns", '"deg"') if turning.get(joint) else ("slides", '"mm"')]
            if joint in turning and unit.strip('"') != axis.unit
        ]
        if faults:
            raise ControllerRefused(f"controller {self.name}", faults)

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
    return first[0], float(first[1:]), f"{second[0]}{float(second[1:]):g}" if second else ""
