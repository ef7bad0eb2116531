"""Kinds: the registry of the kinds of job, so that no other code compares their names."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Literal, get_args

from tapelayer.jobs.kind import JobKind, MachineKind

# Kinds that make programs, and all kinds, in the order in which they are told.
MachineKindName = Literal["lay", "spray"]
KindName = Literal["lay", "spray", "plan"]
MACHINE_NAMES: tuple[MachineKindName, ...] = get_args(MachineKindName)
NAMES: tuple[KindName, ...] = get_args(KindName)


# The module that describes each of them.
_MODULES: dict[KindName, str] = {
    "lay": "tapelayer.laying.kind",
    "spray": "tapelayer.spraying.kind",
    "plan": "tapelayer.plies.kind",
}


@cache
def kind_of(name: KindName) -> JobKind:
    """Return the kind of a name; its package is imported when it is first asked for.

    Examples:
        >>> kind_of("lay").product.file
        'program.nc'
    """
    kind: JobKind = import_module(_MODULES[name]).KIND
    return kind


def machine_kind_of(name: MachineKindName) -> MachineKind:
    """Return the kind of machine of a name.

    Examples:
        >>> machine_kind_of("spray").machine.title
        'five-axis spray robot'
    """
    kind = kind_of(name)
    assert isinstance(kind, MachineKind)
    return kind


def kinds() -> tuple[JobKind, ...]:
    """Return all kinds, in the order of their names.

    Examples:
        >>> [kind.product.name for kind in kinds()]
        ['program', 'program', 'courses']
    """
    return tuple(kind_of(name) for name in NAMES)


def machine_kinds() -> tuple[MachineKind, ...]:
    """Return the kinds that make programs, in the order of their names.

    Examples:
        >>> [kind.parts for kind in machine_kinds()]
        ['courses', 'passes']
    """
    return tuple(machine_kind_of(name) for name in MACHINE_NAMES)


def suppliers(kind: JobKind) -> list[KindName]:
    """Return the names of the kinds whose product a kind takes as its source.

    Examples:
        >>> suppliers(kind_of("lay"))
        ['plan']
    """
    return [name for name in NAMES if kind_of(name).product.form is kind.source.form]
