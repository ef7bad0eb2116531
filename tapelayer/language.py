"""Language: the one that the user asks for, by the locale of the process."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Literal, get_args

Language = Literal["en", "zh"]
LANGUAGES: tuple[Language, ...] = get_args(Language)
# The languages into which the English sentences are translated.
OTHERS: tuple[Language, ...] = ("zh",)


def language_of(environment: Mapping[str, str]) -> Language:
    """Return the language of a locale, as the environment names it (POSIX: the first that is set counts).

    Examples:
        >>> language_of({"LANG": "zh_CN.UTF-8"}), language_of({"LANG": "zh_CN.UTF-8", "LC_ALL": "C"}), language_of({})
        ('zh', 'en', 'en')
    """
    locale = next((environment[key] for key in ("LC_ALL", "LC_MESSAGES", "LANG") if environment.get(key)), "")
    return "zh" if locale.lower().startswith("zh") else "en"


def asked() -> Language:
    """Return the language of messages on the terminal."""
    return language_of(os.environ)
