"""Words: values, limits and keys as text for people, in both languages."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from tapelayer.language import LANGUAGES, Language


class Words(NamedTuple):
    """A text in every language of the reports and the page.

    Attributes:
        en: English.
        zh: Chinese.
    """

    en: str
    zh: str

    def in_language(self, language: Language) -> str:
        """Return the text in a language.

        >>> Words("duration", "时长").in_language("zh")
        '时长'
        """
        return self.zh if language == "zh" else self.en


@dataclass(frozen=True)
class Say:
    """A language in which a report is written.

    Attributes:
        language: the language.
    """

    language: Language

    def __call__(self, en: str, zh: str, **values: object) -> str:
        """Return one of two texts, with values put where the text names them.

        >>> Say("zh")("{n:,} more", "另有 {n:,} 项", n=1200)
        '另有 1,200 项'
        """
        text = zh if self.language == "zh" else en
        return text.format(**values) if values else text

    def words(self, words: Words) -> str:
        """Return a text that is known in every language.

        >>> Say("zh").words(Words("duration", "时长"))
        '时长'
        """
        return words.in_language(self.language)


ENGLISH = Say("en")


def language_accepted(header: str) -> Language:
    """Return the language that an Accept-Language header likes best; English where it names none of ours.

    >>> language_accepted("zh-CN,zh;q=0.9,en;q=0.8"), language_accepted("en-GB, zh;q=0.5"), language_accepted("de")
    ('zh', 'en', 'en')
    """
    liked = [_liking(part) for part in header.split(",")]
    ours = [(quality, language) for quality, tag in liked for language in LANGUAGES if tag == language and quality > 0]
    return max(ours, key=lambda one: one[0])[1] if ours else "en"


def _liking(part: str) -> tuple[float, str]:
    """Return the quality and the language of a part of the header; an unreadable quality is none."""
    tag, _, quality = part.partition(";q=")
    try:
        return float(quality or 1.0), tag.strip().lower().partition("-")[0]
    except ValueError:
        return 0.0, ""


NOT_MEASURED = Words("not measured", "未测得")
NONE = Words("none", "无")
NOT_FINITE = Words("no finite value", "无有限值")
NOT_JUDGED = Words("not judged", "未作判定")
# From so many seconds on, a time is told in minutes.
LONG = 60.0


def shown(value: float | None, unit: str, form: str, absent: str = NOT_MEASURED.en) -> str:
    """Return a value with its unit in a format, or why there is none.

    >>> shown(1234.5, "mm", "z,.1f"), shown(None, "mm", "z,.1f")
    ('1,234.5 mm', 'not measured')
    """
    return absent if value is None else f"{value:{form}} {unit}".rstrip()


def plain(value: float) -> str:
    """Return a limit or a tick in the fewest digits, with separated thousands.

    >>> plain(1500.0), plain(0.05)
    ('1,500', '0.05')
    """
    return f"{value:z,.7g}"


def duration(seconds: float) -> str:
    """Return a time as it is read: in seconds up to a minute, then in whole hours, minutes and seconds.

    >>> duration(9.24), duration(83.0), duration(9229.2), duration(3599.7)
    ('9.2 s', '1 min 23 s', '2 h 33 min 49 s', '1 h 0 min 0 s')
    """
    if not LONG <= seconds < math.inf:
        return f"{seconds:z,.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{f'{hours:,} h ' if hours else ''}{minutes} min {rest} s"
