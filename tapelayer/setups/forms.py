"""Setups as a form has them: values by section and key, and the TOML text that says the same."""

from __future__ import annotations

from typing import Any, Literal

from tapelayer.setups.sections import JobSetup, Setup, parse_setup, parse_table
from tapelayer.spraying.settings import SpraySetup
from tapelayer.toml_files import toml_text

JobKind = Literal["lay", "spray"]
# Values by section and key.
Values = dict[str, dict[str, Any]]

MODELS: dict[JobKind, type[JobSetup]] = {"lay": Setup, "spray": SpraySetup}
NAME = "setup.toml"


def values_of(data: bytes, kind: JobKind) -> Values:
    """Values that the bytes of a setup's TOML set.

    Raises:
        SetupRefused: as `parse_setup`.
    """
    return _values(parse_setup(data, NAME, MODELS[kind]))


def text_of_values(values: Values, kind: JobKind) -> str:
    """TOML text of values; a value that is None is left out.

    Raises:
        SetupRefused: unknown keys, or values out of range; all faults at once.
    """
    text = text_of(parse_table(MODELS[kind], values, NAME))
    # What no file may hold, such as half a character or a name of a thousand letters, shows itself in reading.
    parse_setup(text.encode(errors="surrogatepass"), NAME, MODELS[kind])
    return text


def text_of(setup: JobSetup) -> str:
    """TOML text of the values that a setup was given; those that it has by default are left out."""
    return toml_text(_values(setup))


def _values(setup: JobSetup) -> Values:
    return setup.model_dump(exclude_unset=True, exclude_none=True)
