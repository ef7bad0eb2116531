"""Kinds: the registry of the kinds of machine, so that no other code compares their names."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Literal, NamedTuple, get_args

from tapelayer.jobs.kind import JobKind

KindName = Literal["lay", "spray"]
NAMES: tuple[KindName, ...] = get_args(KindName)


class _Entry(NamedTuple):
    """The module that describes a kind, and the suffix of its sources, if they have their own."""

    module: str
    suffix: str


_ENTRIES: dict[KindName, _Entry] = {
    "lay": _Entry("tapelayer.laying.kind", ""),
    "spray": _Entry("tapelayer.spraying.kind", ".stl"),
}


@cache
def kind_of(name: KindName) -> JobKind:
    """Return the kind of a name; its package is imported when it is first asked for.

    Examples:
        >>> kind_of("spray").machine.title
        'five-axis spray robot'
    """
    kind: JobKind = import_module(_ENTRIES[name].module).KIND
    return kind


def kinds() -> tuple[JobKind, ...]:
    """Return all kinds, in the order of their names.

    Examples:
        >>> [kind.parts for kind in kinds()]
        ['courses', 'passes']
    """
    return tuple(kind_of(name) for name in NAMES)


def name_of_source(file: str) -> KindName:
    """Return the name of the kind that makes programs from a file, by its suffix.

    >>> name_of_source("hood.STL"), name_of_source("courses.txt")
    ('spray', 'lay')
    """
    return next(
        (name for name, entry in _ENTRIES.items() if entry.suffix and file.lower().endswith(entry.suffix)), NAMES[0]
    )
