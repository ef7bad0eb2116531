"""Language: the one that the user asks for, by the locale of the process."""

from __future__ import annotations

import os
from typing import Literal

Language = Literal["en", "zh"]
# The languages into which the English sentences are translated.
OTHERS: tuple[Language, ...] = ("zh",)


def asked() -> Language:
    """Return the language of messages: the first of LC_ALL, LC_MESSAGES and LANG that is set decides."""
    locales = (os.environ.get(name, "") for name in ("LC_ALL", "LC_MESSAGES", "LANG"))
    return "zh" if next(filter(None, locales), "").lower().startswith("zh") else "en"
