"""Words: how values, limits and keys are written for people."""

from __future__ import annotations


def shown(value: float | None, unit: str, form: str, absent: str = "not measured") -> str:
    """A value with its unit in its quantity's format; where there is none, why.

    Examples:
        >>> shown(0.01234, "mm", ".3f"), shown(None, "mm", ".3f")
        ('0.012 mm', 'not measured')
    """
    return absent if value is None else f"{value:{form}} {unit}".rstrip()


def plain(value: float) -> str:
    """A limit or a tick in the fewest digits, thousands apart.

    Examples:
        >>> plain(1500.0), plain(0.05), plain(-0.0)
        ('1,500', '0.05', '0')
    """
    return f"{value:z,.7g}"


def worded(what: str) -> tuple[str, str]:
    """Words and unit of a quantity's key.

    Examples:
        >>> worded("max_position_error_mm"), worded("courses")
        (('max position error', 'mm'), ('courses', ''))
    """
    for ending, unit in (
        ("_mm_per_s", "mm/s"),
        ("_deg_per_s", "deg/s"),
        ("_mm", "mm"),
        ("_deg", "deg"),
        ("_m", "m"),
        ("_s", "s"),
    ):
        if what.endswith(ending):
            return what.removesuffix(ending).replace("_", " "), unit
    return what.replace("_", " "), ""
