"""Contradictions: what a control's table states that no program could carry out, or that only a control would notice.

Every text of a table goes into every program, and a reader ignores those that the table calls without effect. So each
must do what its place says and no more: a word that moves an axis, or a mode that the program was not written for, is
the table's fault and is named here, before a program is made.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from post.controllers.table import Controller, code

# The words of a block by what they are about: a block holds one word of each kind.
_KINDS = {
    **dict.fromkeys(("rapid", "linear", "clockwise", "counterclockwise", "dwell", "set_position"), "action"),
    **dict.fromkeys(("absolute", "incremental"), "distance"),
    **dict.fromkeys(("per_minute", "inverse_time"), "feed"),
    **dict.fromkeys(("plane xy", "plane zx", "plane yz"), "plane"),
    **dict.fromkeys(("exact stop", "blending"), "corners"),
}
_G_WORD = re.compile(r"G[0-9]+(\.[0-9])?")
_ARGUED = re.compile(r"G[0-9.]+ [A-Z][0-9.]+")
# A word in a text of any form: a letter that begins a name or stands alone, and a number after it.
_WORD = re.compile(r"(?<![A-Z0-9_])([A-Z][0-9]*=|[A-Z]) *[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(?![A-Z0-9_=])")
_FIXED = {"G": "begins a preparatory word", "M": "begins a switching word", "N": "numbers a block"}


def contradictions(controller: Controller) -> Iterator[str]:
    """Yield the contradictions of a table, each a sentence that begins with the key it is about and a colon."""
    yield from _axes(controller)
    yield from _letters(controller)
    yield from _codes(controller)
    yield from _switching(controller)
    yield from _texts(controller)
    yield from _modes(controller)
    yield from _timing(controller)
    missing = [plane for plane in controller.arcs.planes if plane not in controller.codes.planes]
    if missing:
        yield f"arcs.planes: {' and '.join(missing)} without a G word in codes.planes; give it"
    if controller.blocks.number_step > controller.blocks.number_maximum:
        yield "blocks: number_step is beyond number_maximum; lower it"


def _axes(controller: Controller) -> Iterator[str]:
    reserved = {letter: "is reserved by the control" for letter in controller.reserved}
    reserved |= {letter: "is the centre of arcs" for letter in controller.arcs.offsets if controller.arcs.planes}
    taken = {controller.codes.dwell_address: "is the time of a dwell", controller.feed.address: "is the feed"}
    taken |= _FIXED
    joints: set[str] = set()
    for axis in controller.axes:
        # An M word that takes the address defines its letter.
        clash = taken.get(axis.address) or ("" if axis.word else reserved.get(axis.address, ""))
        clash = clash or _FIXED.get(axis.address[0], "")
        if clash:
            yield f"axes: address {axis.address} {clash}; give {axis.joints[0]} another"
        if axis.alone and not axis.word:
            yield f"axes: address {axis.address} stands alone without a word; give the word that takes it"
        taken[axis.address] = "has an axis already"
        for joint in axis.joints:
            if joint in joints:
                yield f"axes: joint {joint} has two addresses; give it one"
            joints.add(joint)
    addresses = {axis.address for axis in controller.axes}
    for address in sorted({address for group in controller.feed.path for address in group} - addresses):
        yield f"feed.path: {address} is not the address of an axis"
    words = sorted({axis.word for axis in controller.axes} - {""})
    if len({(axis.word, axis.alone) for axis in controller.axes if axis.word}) > 1:
        yield f"axes: {' and '.join(words)} take axes; all such axes need one word and one value of alone"
    for taking in words:
        if any(code(text)[:2] == code(taking)[:2] for _, text in _all_events(controller)):
            yield f"axes: {taking} is the word of an event; give the axis another"
        if any(code(text)[:2] == code(taking)[:2] for text in controller.blocks.end):
            yield f"axes: {taking} ends the program; give the axis another"


def _letters(controller: Controller) -> Iterator[str]:
    """Yield the letters of further words that mean something else already."""
    codes, axes = controller.codes, {axis.address: "is the address of an axis" for axis in controller.axes}
    feed = {controller.feed.address: "is the feed"}
    for key, letter in (("codes.dwell_address", codes.dwell_address), ("feed.address", controller.feed.address)):
        if letter in _FIXED:
            yield f"{key}: {letter} {_FIXED[letter]}; give another letter"
    if controller.arcs.planes:
        seen = feed | _FIXED
        for letter in controller.arcs.offsets:
            if letter in seen:
                yield f"arcs.offsets: {letter} {seen[letter]}; give another letter"
            seen[letter] = "is the centre along another axis"
    arguments = [(f"events.{name}", text) for name, text in controller.events.items()]
    arguments += [(f"events_at_rest.{name}", text) for name, text in controller.events_at_rest.items()]
    arguments += [("axes", axis.word) for axis in controller.axes]
    arguments += [("codes.no_effect", text) for text in codes.no_effect if _ARGUED.fullmatch(text)]
    for key, text in arguments:
        letter = text.partition(" ")[2][:1]
        if clash := (axes | feed | _FIXED).get(letter):
            yield f"{key}: the argument {letter} of {text} needs a letter of its own, as {letter} {clash}"
    for letter in codes.no_effect:
        if clash := (axes | feed | _FIXED | {codes.dwell_address: "is the time of a dwell"}).get(letter):
            yield f"codes.no_effect: {letter} {clash}, so it has an effect; remove it"
    for event, letter in controller.levels.items():
        if event not in controller.events:
            yield f"levels: {event} is not in events; add it there"
        elif letter == controller.events[event].partition(" ")[2][:1]:
            yield f"levels: {letter} of {event} is the argument of {controller.events[event]} already; give another"
        if letter not in codes.no_effect:
            yield f"levels: {letter} of {event} is not in codes.no_effect, so no reader would know it"


def _codes(controller: Controller) -> Iterator[str]:
    words = _words(controller)
    yield from _repeated("codes", words.items(), {})
    meanings = {code(word)[1]: name for name, word in words.items()}
    for text in controller.codes.no_effect:
        if (_G_WORD.fullmatch(text) or _ARGUED.fullmatch(text)) and (name := meanings.get(code(text)[1])):
            yield f"codes.no_effect: {text} is the word of {name}, so it has an effect; remove it"
    if controller.u_reset == "course" and not controller.codes.set_position:
        yield "u_reset: needs codes.set_position, the G word that sets the tape's axis to zero; give it"


def _switching(controller: Controller) -> Iterator[str]:
    ends = {code(word): "end" for word in controller.blocks.end}
    yield from _repeated("events", controller.events.items(), dict(ends))
    for event, word in controller.events_at_rest.items():
        if event not in controller.events:
            yield f"events_at_rest: {event} is not in events; add it there"
        if code(word) in ends:
            yield f"events_at_rest: {word} of {event} ends the program; give the event one of its own"
        if any(other != event and code(text) == code(word) for other, text in _all_events(controller)):
            yield f"events_at_rest: {word} of {event} is the word of another event too; give it one of its own"
    bare = {code(text)[1]: text for _, text in _all_events(controller) if " " not in text}
    bare |= {code(text)[1]: text for text in controller.blocks.end}
    for name, text in controller.events.items():
        if " " in text and code(text)[1] in bare:
            yield f"events.{name}: {text} and {bare[code(text)[1]]} differ by an argument alone; give both one"


def _all_events(controller: Controller) -> Iterator[tuple[str, str]]:
    yield from controller.events.items()
    yield from controller.events_at_rest.items()


def _repeated(section: str, words: Iterable[tuple[str, str]], used: dict[tuple[str, float, str], str]) -> Iterator[str]:
    for name, word in words:
        other = used.setdefault(code(word), name)
        if other != name:
            yield f"{section}: {word} stands for both {other} and {name}; each needs a word of its own"


def _texts(controller: Controller) -> Iterator[str]:
    """Yield the texts that do more than their places allow, hold comments, or are longer than a line."""
    blocks, codes = controller.blocks, controller.codes
    names = {code(word)[1]: name for name, word in _words(controller).items()}
    known = names.keys() | {code(word)[1] for word in codes.no_effect if _G_WORD.fullmatch(word)}
    longest = blocks.max_line - (len(f"N{blocks.number_maximum} ") if blocks.number_step else 0)
    for key, texts in (("preamble", blocks.preamble), ("restated", blocks.restated)):
        for text in texts:
            if len(text) > longest:
                yield f"blocks.{key}: {text[:20]}... has {len(text)} characters, the line takes {longest}; break it"
            if text in codes.no_effect:
                continue
            kinds: dict[str, str] = {}
            for word in text.split():
                name = names.get(code(word)[1]) if _G_WORD.fullmatch(word) else None
                kind = _KINDS[name] if name else ""
                if not _G_WORD.fullmatch(word) or code(word)[1] not in known:
                    yield f"blocks.{key}: {word} is not in codes or codes.no_effect, so no reader would know it"
                elif kind == "action":
                    yield f"blocks.{key}: {word} is the word of {name}; a text states modes and moves nothing"
                elif kind and kind in kinds:
                    yield f"blocks.{key}: {word} and {kinds[kind]} stand in one block; give each its own"
                kinds[kind] = word
    whole = [("codes.no_effect", text) for text in codes.no_effect if re.search(r"[^A-Za-z0-9 .+-]", text)]
    for key, text in (("blocks.first_line", blocks.first_line), ("blocks.last_line", blocks.last_line), *whole):
        if len(text) > blocks.max_line:
            yield f"{key}: has {len(text)} characters, blocks.max_line is {blocks.max_line}; shorten it"
        yield from _acting(controller, key, text)


def _acting(controller: Controller, key: str, text: str) -> Iterator[str]:
    """Yield a fault where a line that readers ignore holds a comment, or a word that acts."""
    signs = controller.blocks.comment
    for sign in signs:
        at = text.find(sign)
        if at > 0 or (at == 0 and sign == "(" and text.find(")") != len(text) - 1):
            yield f"{key}: {text} holds {sign}, which begins a comment; leave the comment out"
            return
        if at == 0:
            return
    names = {code(word)[1]: name for name, word in _words(controller).items()}
    axes = {axis.address for axis in controller.axes}
    # What stands in brackets or quotes is the argument of a function.
    for match in _WORD.finditer(re.sub(r'\(.*\)|"[^"]*"', "", text.upper())):
        letter, number = match[1], float(match[2])
        if letter in axes:
            yield f"{key}: {match[0]} in {text} moves an axis; a text moves nothing"
        elif letter == "G" and number in names:
            yield f"{key}: {match[0]} in {text} is the word of {names[number]}; readers ignore it, controls do not"
        elif letter == "M":
            yield f"{key}: {match[0]} in {text} switches; readers ignore it, controls do not"
        else:
            continue
        return


def _words(controller: Controller) -> dict[str, str]:
    """Return every G word of a table by its purpose."""
    modes = {"exact stop": controller.time.exact, "blending": controller.time.blended}
    return controller.codes.words() | {name: word for name, word in modes.items() if word}


def _timing(controller: Controller) -> Iterator[str]:
    """Yield the words and parameters that the control's way of passing from block to block lacks, or has no use for."""
    time = controller.time
    words = {"exact": time.exact, "blended": time.blended, "tolerance_address": time.tolerance_address}
    if time.blends:
        missing = [name for name in ("exact", "blended") if not words[name]]
        if missing:
            yield f'time: corner {time.corner} without {" and ".join(missing)}; give the words, or corner = "stop"'
        if not time.tolerance_mm > 0:
            yield f"time: corner {time.corner} without tolerance_mm above 0; give how far corners are rounded off"
    elif given := [name for name, word in words.items() if word]:
        yield f"time: corner {time.corner} has no use for {' and '.join(given)}; leave them out"


def _modes(controller: Controller) -> Iterator[str]:
    """Yield the modes in which the fixed blocks leave the control, where the program is written in others."""
    codes, blocks, feed = controller.codes, controller.blocks, controller.feed
    state = {"feed": "per_minute", "distance": "absolute"}
    names = {code(word)[1]: name for name, word in _words(controller).items()}
    for text in (*blocks.preamble, *blocks.restated):
        for word in () if text in codes.no_effect else text.split():
            name = names.get(code(word)[1]) if _G_WORD.fullmatch(word) else None
            if name:
                state[_KINDS[name]] = name
    key = "blocks.restated" if blocks.restated else "blocks.preamble"
    if state["distance"] != "absolute":
        yield f"{key}: leaves the control in {codes.incremental}, increments; add {codes.absolute}"
    if state["feed"] != feed.mode:
        left, wanted = getattr(codes, state["feed"]), getattr(codes, feed.mode)
        yield f"{key}: leaves the control in {left}; add {wanted}, as feed.mode is {feed.mode}"
    if feed.mode == "inverse_time" and feed.modal:
        yield "feed.modal: is true, but an inverse time holds for its own block; make it false"
