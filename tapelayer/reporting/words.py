"""Words: values, limits and keys as text for people, in both languages."""

from __future__ import annotations

from typing import NamedTuple

from tapelayer.language import Language


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


NOT_MEASURED = Words("not measured", "未测得")
NONE = Words("none", "无")


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


def worded(what: str) -> tuple[str, str]:
    """Return the words and the unit of a quantity's key.

    >>> worded("axis_c_speed_deg_per_s")
    ('axis c speed', 'deg/s')
    """
    for ending, unit in (
        ("_mm_per_s", "mm/s"),
        ("_deg_per_s", "deg/s"),
        ("_mm", "mm"),
        ("_percent", "%"),
        ("_deg", "deg"),
        ("_m", "m"),
        ("_s", "s"),
    ):
        if what.endswith(ending):
            return what.removesuffix(ending).replace("_", " "), unit
    return what.replace("_", " "), ""
