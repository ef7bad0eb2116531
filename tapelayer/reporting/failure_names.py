"""Failure names: what a program fails of as text for people, in both languages."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tapelayer.reporting.quantity import Measured, Row, quantities
from tapelayer.reporting.words import Say
from tapelayer.sentences import translated

# What is wrong with an axis; the sentences of failures tell its value.
OF_AXES = {"_speed": "超速", "_acceleration": "加速度超限", "_jerk": "加加速度超限", None: "超出行程"}
UNITS = {
    "_mm_per_s3": "mm/s3",
    "_deg_per_s3": "deg/s3",
    "_mm_per_s2": "mm/s2",
    "_deg_per_s2": "deg/s2",
    "_mm_per_s": "mm/s",
    "_deg_per_s": "deg/s",
    "_mm": "mm",
    "_percent": "%",
    "_deg": "deg",
    "_ms": "ms",
    "_m": "m",
    "_s": "s",
}


def worded(what: str) -> tuple[str, str]:
    """Return the English words and the unit of a key.

    >>> worded("axis_c_speed_deg_per_s")
    ('axis c speed', 'deg/s')
    """
    stem, unit = _split(what)
    return stem.replace("_", " "), unit


def failure_name(what: str, rows: Sequence[Row[Measured]], say: Say) -> tuple[str, str]:
    """Return the name and the unit of a failure.

    Args:
        what: key of the failure.
        rows: of the kind of machine, which know their own names.
        say: the language.

    Examples:
        >>> failure_name("axis_c_deg", (), Say("zh")), failure_name("knife_1_left_on", (), Say("en"))
        (('c 轴超出行程', 'deg'), ('knife 1 left on', ''))
        >>> failure_name("axis_x_acceleration_mm_per_s2", (), Say("zh"))
        ('x 轴加速度超限', 'mm/s2')
    """
    stem, unit = _split(what)
    return say(stem.replace("_", " "), _chinese(stem, what, rows)), unit


def _split(what: str) -> tuple[str, str]:
    ending = next((ending for ending in UNITS if what.endswith(ending)), "")
    return what.removesuffix(ending), UNITS.get(ending, "")


def _chinese(stem: str, what: str, rows: Sequence[Row[Measured]]) -> str:
    measured = next((row.words.zh for row in quantities(rows) if row.failure == what), None)
    if measured:
        return measured
    if axis := re.fullmatch(r"axis_(.+?)(_speed|_acceleration|_jerk)?", stem):
        return f"{axis[1]} 轴{OF_AXES[axis[2]]}"
    told = translated(what, "zh")
    # The unit stands beside the name, as in English.
    return told.partition("（")[0] if told != what else stem.replace("_", " ")
