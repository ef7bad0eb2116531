"""Arrays of samples: one row per sample, read-only once made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view of `array`, which itself stays as it is.

    Args:
        array: any shape, any unit.

    Examples:
        >>> joints = frozen(np.zeros(3))
        >>> joints[0] = 1.0
        Traceback (most recent call last):
            ...
        ValueError: assignment destination is read-only
    """
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Frozen:
    """A frozen dataclass whose array fields are read-only."""

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        # What a new table holds are its fields; to ask for them by `fields` is slow.
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray) and value.flags.writeable:
                object.__setattr__(self, name, frozen(value))


@dataclass(frozen=True, eq=False)
class SampleTable(Frozen):
    """A table of samples whose fields are columns with one row per sample."""

    # Empty columns for a table without rows, where a field does not hold one float per row.
    EMPTY: ClassVar[dict[str, NDArray[Any]]] = {}

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of several tables, one after the other; no rows for no tables.

        Examples:
            >>> @dataclass(frozen=True, eq=False)
            ... class Times(SampleTable):
            ...     seconds: Floats
            >>> Times.joined([Times(np.array([0.0, 0.5])), Times(np.array([1.0]))]).seconds.tolist()
            [0.0, 0.5, 1.0]
        """
        return cls(
            **{
                field.name: np.concatenate([getattr(part, field.name) for part in parts])
                if parts
                else cls.EMPTY.get(field.name, np.zeros(0))
                for field in fields(cls)
            }
        )
