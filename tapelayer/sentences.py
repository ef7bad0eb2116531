"""Sentences: the user's messages in another language, by catalogues of the English ones as the source has them."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import islice
from pathlib import Path
from typing import Self

from tapelayer.language import Language, asked

CATALOGUES = Path(__file__).parent / "languages"
# Letters that an encoding has if it has those of the language.
LETTERS: dict[Language, str] = {"en": "a", "zh": "道次"}

# Place of a value: {1}; in a translation {1*} where the value is translated too, and {1|、} where it is a list, whose
# items are translated and joined by this.
PLACE = re.compile(r"\{(\d+)(?:(\*)|\|([^}]+))?\}")
_BETWEEN = re.compile(r", | and | or ")
# Names and places that may precede a sentence.
MOST_PLACES = 8
_INNER = "(.*?)"
# A name at an end of a sentence does not reach over what precedes the sentence, `panel.txt:7: `, unless it is quoted.
_OUTER = r"((?:(?!: ).)*?|['\"].*)"


@dataclass(frozen=True)
class Template:
    """An English sentence with places, and what it is in another language.

    Attributes:
        other: the translation, with the same places in any order.
        pattern: matches each sentence that the template makes, with a group a place.
        longest: the longest piece of the sentence between its places.
        letters: how many the pieces have.
    """

    other: str
    pattern: re.Pattern[str]
    longest: str
    letters: int

    @classmethod
    def of(cls, english: str, other: str) -> Self:
        """Return the template of an entry of a catalogue.

        Examples:
            >>> Template.of("tape of {1} mm", "{1} mm 的带").pattern.fullmatch("tape of 75 mm").groups()
            ('75',)
        """
        pieces = PLACE.split(english)[:: PLACE.groups + 1]
        names = {int(place[1]) for place in PLACE.finditer(other) if not (place[2] or place[3])}
        ends = {number for number, piece in ((1, pieces[0]), (len(pieces) - 1, pieces[-1])) if not piece}
        pattern = re.escape(pieces[0])
        for number, piece in enumerate(pieces[1:], 1):
            pattern += (_OUTER if number in names & ends else _INNER) + re.escape(piece)
        return cls(other, re.compile(pattern), max(pieces, key=len), sum(map(len, pieces)))


def translated(text: str, language: Language) -> str:
    """Return the text of an error, note or failure in a language, line by line.

    What no template of the catalogue fits stays as it is, so do names, numbers and the words of other programs.

    Examples:
        >>> translated("panel.txt:7: the file is empty; export the courses again", "zh")
        'panel.txt:7: 文件为空；请重新导出道次'
        >>> translated("the file is empty; export the courses again", "en")
        'the file is empty; export the courses again'
    """
    return text if language == "en" else "\n".join(_line(line, language)[1] for line in text.split("\n"))


def said(text: str) -> str:
    """Return the text in the language that the user of the terminal asks for, in English where it cannot be shown."""
    language = asked()
    return translated(text, language) if _can_be_shown(LETTERS[language]) else text


def catalogue(language: Language) -> dict[str, str]:
    """Return the translations by their English sentences, from all files of a language.

    Raises:
        ValueError: two files have an entry in common.
    """
    entries: dict[str, str] = {}
    for path in sorted((CATALOGUES / language).glob("*.toml")):
        table: Mapping[str, str] = tomllib.loads(path.read_text("utf-8"))
        if twice := entries.keys() & table.keys():
            raise ValueError(f"{path.name} has entries of another file: {sorted(twice)}")
        entries |= table
    return entries


def _can_be_shown(letters: str) -> bool:
    """Return whether the encodings of the terminal have these letters."""
    try:
        for stream in (sys.stdout, sys.stderr):
            letters.encode(stream.encoding or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


@cache
def _templates(language: Language) -> tuple[Template, ...]:
    """Return the sentences of a language."""
    return tuple(Template.of(*entry) for entry in catalogue(language).items())


@lru_cache(maxsize=4096)
def _line(line: str, language: Language) -> tuple[int, str]:
    """Return a line in a language, and how many of its letters are those of templates, of all ways the most.

    A sentence may follow names or places, with `: ` after each.
    """
    best = (0, line)
    starts = [0, *(mark.end() for mark in islice(re.finditer(": ", line), MOST_PLACES))][::-1]
    for template in _templates(language):
        if template.longest in line:
            for start in starts:
                if found := template.pattern.fullmatch(line, start):
                    best = max(best, _told(line[:start], template, found, language), key=lambda told: told[0])
    return best


def _told(places: str, template: Template, found: re.Match[str], language: Language) -> tuple[int, str]:
    """Return a sentence that a template fits, and the places before it, with the number of letters of templates."""
    place = places.removesuffix(": ")
    # A single word before a sentence is a name.
    known, before = _line(place, language) if " " in place else (0, place)
    count = known + template.letters

    def value(at: re.Match[str]) -> str:
        nonlocal count
        held = found[int(at[1])]
        if not (at[2] or at[3]):
            return held
        readings = [_line(held, language)]
        if at[3]:
            items = [_line(item, language) for item in _BETWEEN.split(held)]
            # A phrase that is known as a whole may have the signs of a list in it.
            readings.insert(0, (sum(letters for letters, _ in items), at[3].join(text for _, text in items)))
        letters, told = max(readings, key=lambda reading: reading[0])
        count += letters
        return told

    text = PLACE.sub(value, template.other)
    return count, before + places[len(place) :] + text
