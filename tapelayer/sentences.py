"""Sentences: the user's messages in another language, by catalogues of the English ones as the source has them."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
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
    """

    other: str
    pattern: re.Pattern[str]
    longest: str

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
        return cls(other, re.compile(pattern), max(pieces, key=len))


def translated(text: str, language: Language) -> str:
    """Return the text of an error, note or failure in a language, line by line.

    What no template of the catalogue fits stays as it is, so do names, numbers and the words of other programs.

    Examples:
        >>> translated("panel.txt:7: the file is empty; export the courses again", "zh")
        'panel.txt:7: 文件为空；请重新导出道次'
        >>> translated("the file is empty; export the courses again", "en")
        'the file is empty; export the courses again'
    """
    return text if language == "en" else "\n".join(_line(line, language) for line in text.split("\n"))


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
def _fixed(language: Language) -> dict[str, str]:
    """Return the sentences without a place."""
    return {english: other for english, other in catalogue(language).items() if not PLACE.search(english)}


@cache
def _templates(language: Language) -> tuple[Template, ...]:
    """Return the sentences with places, those with the most letters of their own first."""
    entries = [(english, other) for english, other in catalogue(language).items() if PLACE.search(english)]
    entries.sort(key=lambda entry: -len(PLACE.sub("", entry[0])))
    return tuple(Template.of(*entry) for entry in entries)


def _line(line: str, language: Language) -> str:
    """Return a line in a language; where it is no sentence, each of what `: ` separates, but not single words."""
    if fixed := _fixed(language).get(line):
        return fixed
    for template in _templates(language):
        if template.longest in line and (found := template.pattern.fullmatch(line)):
            return PLACE.sub(lambda place: _value(found.group(int(place[1])), place, language), template.other)
    before, colon, after = line.partition(": ")
    if not colon:
        return line
    return f"{_line(before, language) if ' ' in before else before}: {_line(after, language)}"


def _value(value: str, place: re.Match[str], language: Language) -> str:
    """Return a value in the language, as far as its place asks for it."""
    if place[2]:
        return _line(value, language)
    return place[3].join(_line(item, language) for item in _BETWEEN.split(value)) if place[3] else value
