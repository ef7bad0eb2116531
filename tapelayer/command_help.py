"""Command help: commands whose help pages name no type of Python's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from typer.core import TyperCommand, TyperGroup


class Command(TyperCommand):
    """A command that shows an option's values by the name that its help gives them, or not at all."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the arguments and options, each without the name of its type."""
        return _untyped(super().get_params(ctx))


class Group(TyperGroup):
    """A group of commands, as `Command`."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, each without the name of its type."""
        return _untyped(super().get_params(ctx))


def _untyped(parameters: Sequence[Any]) -> list[Any]:
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
        if parameter.param_type_name == "argument":
            parameter.display_type_rich = _no_type
    return list(parameters)


def _no_type(ctx: Any) -> None:
    """Return no name of a type."""
