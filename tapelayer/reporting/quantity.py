"""Quantities: one row per figure of a report, over which JSON, tables, page, plots, docs and HTTP iterate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from tapelayer.reporting.not_judged import english
from tapelayer.reporting.words import ENGLISH, NOT_MEASURED, Say, Words, duration, shown
from tapelayer.units import json_number
from tapelayer.verification.failures import Failure, Outcome
from tapelayer.verification.limits import Limits

Measured = TypeVar("Measured")


class Group(Enum):
    """Where a quantity stands in tables: what the program is, or how well it keeps to what was asked."""

    FACT = "fact"
    ERROR = "error"


class Style(Enum):
    """How a quantity is written."""

    COUNT = "count"
    FIXED = "fixed"
    POWER = "power"


@dataclass(frozen=True)
class Quantity(Generic[Measured]):
    """A number of the report.

    Attributes:
        key: in the JSON report, with the unit at its end.
        words: its name.
        about: its meaning, as a sentence without its full stop.
        unit: unit in which it is written.
        digits: decimals, unless it is a count.
        measure: takes it from the measurements, in its unit; None where there is none, NaN where it was not measured.
        group: its group in tables.
        style: its format.
        absent: why it may have no value.
        required: whether a program fails if it cannot be measured.
        headline: whether it is shown beside the verdict.
        optional: whether it is judged only where the setup sets a limit.
        samples: field of the samples of which it is the largest magnitude, where there are plots along the courses.
        curves: fields of the samples to plot, with their names.
    """

    key: str
    words: Words
    about: Words
    unit: str
    digits: int
    measure: Callable[[Measured], float | None]
    group: Group = Group.ERROR
    style: Style = Style.FIXED
    absent: Words = NOT_MEASURED
    required: bool = False
    headline: bool = False
    optional: bool = False
    samples: str = ""
    curves: tuple[tuple[Words, str], ...] = ()

    @property
    def failure(self) -> str:
        """Name of a failure of the quantity.

        >>> Quantity("max_pitch_deg", Words("", ""), Words("", ""), "deg", 3, lambda _: 0.0).failure
        'pitch_deg'
        """
        return self.key.removeprefix("max_").removeprefix("least_")

    @property
    def form(self) -> str:
        """Format in which it is written, as a Python format specification."""
        return {Style.COUNT: ",d", Style.FIXED: f"z,.{self.digits}f", Style.POWER: ".1e"}[self.style]

    def lost(self, value: float | None) -> bool:
        """Return whether the value is required, and could not be measured.

        Examples:
            >>> row = Quantity("waste_mm", Words("", ""), Words("", ""), "mm", 1, lambda _: 0.0, required=True)
            >>> [row.lost(value) for value in (0.0, float("nan"), None)]
            [False, True, False]
        """
        return self.required and value is not None and not math.isfinite(value)

    @staticmethod
    def plain(value: float | None) -> float | None:
        """Return the value for JSON; None where there is none.

        Examples:
            >>> [Quantity.plain(value) for value in (7, -0.0, float("inf"), None)]
            [7, 0.0, None, None]
        """
        return value if value is None or isinstance(value, int) else json_number(value)

    def shown(self, value: float | None, with_unit: bool = True, say: Say = ENGLISH) -> str:
        """Return a value as it is written, or why there is none.

        Examples:
            >>> row = Quantity("waste_mm", Words("", ""), Words("", ""), "mm", 1, lambda _: 0.0)
            >>> row.shown(1234.56), row.shown(1234.56, with_unit=False), row.shown(None)
            ('1,234.6 mm', '1,234.6', 'not measured')
        """
        if self.unit == "s" and with_unit and value is not None:
            return duration(value)
        return shown(value, self.unit if with_unit else "", self.form, say.words(self.absent))


@dataclass(frozen=True)
class Listing(Generic[Measured]):
    """A part of the report that is not a single number.

    Attributes:
        key: in the JSON report.
        measure: takes it from the measurements, as plain values for JSON.
        required: whether a program fails if a value in it could not be measured.
    """

    key: str
    measure: Callable[[Measured], Any]
    required: bool = False

    def lost(self, value: Any) -> bool:
        """Return whether it is required, and a value in it could not be measured.

        Examples:
            >>> Listing("tape", list, required=True).lost([{"laid_mm": 900.0, "cuts": [{"error_mm": None}]}])
            True
        """
        return self.required and any(leaf is None for leaf in _leaves(value))

    @staticmethod
    def plain(value: Any) -> Any:
        """Return the value for JSON."""
        return value


Row = Quantity[Measured] | Listing[Measured]


def count(
    key: str, words: Words, about: Words, measure: Callable[[Measured], float | None], *, headline: bool = False
) -> Quantity[Measured]:
    """Return the row of a fact that is counted.

    Examples:
        >>> count("cuts", Words("cuts", "切割次数"), Words("cuts made", "完成的切割"), len).shown(1500)
        '1,500'
    """
    return Quantity(key, words, about, "", 0, measure, Group.FACT, Style.COUNT, headline=headline)


def quantities(rows: Sequence[Row[Measured]], group: Group | None = None) -> list[Quantity[Measured]]:
    """Return the rows that are numbers, of one group or of all."""
    return [row for row in rows if isinstance(row, Quantity) and group in (None, row.group)]


def free(rows: Sequence[Row[Measured]], limits: Limits) -> list[Quantity[Measured]]:
    """Return the rows that would be judged if the setup set a limit."""
    return [row for row in quantities(rows) if row.optional and row.key not in limits]


def beyond_limits(rows: Sequence[Row[Measured]], measured: Measured, findings: Outcome) -> tuple[Failure, ...]:
    """Return a failure for each row that breaks a limit which a setup may set or leave out.

    Args:
        rows: of the kind of machine.
        measured: measurements from which the rows take their values; a row without a value breaks nothing.
        findings: with the limits of the setup.
    """
    failures = []
    for row in quantities(rows):
        limit = findings.limits.get(row.key)
        value = row.measure(measured) if row.optional and limit is not None else None
        if limit is not None and value is not None and not limit.kept(value):
            failures.append(Failure(0, 0, row.failure, value, limit.value, of=findings.PART))
    return tuple(failures)


def open_words(rows: Sequence[Row[Measured]], limits: Limits, not_judged: tuple[Words, ...] = ()) -> tuple[Words, ...]:
    """Return all that a verdict does not cover: what none covers, and what this setup sets no limit for."""
    return (*not_judged, *(row.words for row in free(rows, limits)))


def numbers(
    rows: Sequence[Row[Measured]], measured: Measured, findings: Outcome, not_judged: tuple[Words, ...] = ()
) -> dict[str, Any]:
    """Return the verdict and all that was measured as plain values for JSON, millimetres and degrees.

    Values not measured are None, and fail the report where their row is required.

    Args:
        rows: of the kind of machine.
        measured: measurements from which the rows take their values.
        findings: verdict on the same.
        not_judged: what no verdict covers.
    """
    values = {row.key: row.measure(measured) for row in rows}
    failures = [failure.values() for failure in findings.failures]
    known = {failure.what for failure in findings.failures}
    lost = [row.failure for row in quantities(rows) if row.lost(values[row.key])]
    if any(row.required for row in rows):
        lost += findings.unmeasured()
    lost += [row.key for row in rows if isinstance(row, Listing) and row.lost(values[row.key])]
    failures += [
        # Failures that verification reported already are not repeated.
        {**dict.fromkeys(findings.places, 0), "what": what, "value": None, "limit": None}
        for what in lost
        if what not in known
    ]
    return {
        **{row.key: row.plain(values[row.key]) for row in rows},
        **findings.values(),
        "passed": not failures,
        "not_judged": list(english(open_words(rows, findings.limits, not_judged))),
        "failures": failures,
    }


def _leaves(value: Any) -> Iterator[Any]:
    """Yield all values within objects and lists."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            yield from _leaves(part)
    else:
        yield value
