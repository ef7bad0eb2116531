"""Forms: settings as values by section and key, and as the equivalent TOML text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tapelayer.setups.sections import Settings, parse_setup, parse_table, section_model, whole_text
from tapelayer.toml_files import toml_text

# Values by section and key.
Values = dict[str, dict[str, Any]]

NAME = "setup.toml"


def values_of(data: bytes, model: type[Settings]) -> Values:
    r"""Return the values that the bytes of a setup's TOML set.

    Raises:
        InputRefused: as `parse_setup`.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> values_of(b"[tape]\nwidth_mm = 50", Setup)
        {'tape': {'width_mm': 50.0}}
    """
    return _values(parse_setup(data, NAME, model))


def text_of_values(values: Values, model: type[Settings]) -> str:
    r"""Return the TOML text of values, leaving out those that are None.

    Raises:
        InputRefused: the model's `REFUSED`: unknown keys, or values out of range; all faults at once.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> text_of_values({"tape": {"width_mm": 50}, "machine": {"urdf": None}}, Setup)
        '[machine]\n\n[tape]\nwidth_mm = 50.0\n'
    """
    text = text_of(parse_table(model, values, NAME))
    # Reading reveals what no file may hold, such as half a character or a name of a thousand letters.
    parse_setup(text.encode(errors="surrogatepass"), NAME, model)
    return text


def whole_text_of_values(values: Values, model: type[Settings], title: str) -> str:
    r"""Return values as a commented TOML file with every other key, too.

    Raises:
        InputRefused: as `text_of_values`.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> "roll_length_m = 150" in whole_text_of_values({"tape": {"width_mm": 50}}, Setup, "Setup")
        True
    """
    text = whole_text(parse_table(model, values, NAME), title)
    parse_setup(text.encode(errors="surrogatepass"), NAME, model)
    return text


def schema_of(model: type[Settings]) -> dict[str, Any]:
    """Return the JSON schema of a setup: every key with its unit in its name, default, limits and description.

    Sections are named by their titles, the terms of the setup file itself.
    """
    schema = model.model_json_schema()
    titles = {name: section["title"] for name, section in schema["$defs"].items()}
    text = json.dumps(schema)
    for name, title in titles.items():
        text = text.replace(f'"#/$defs/{name}"', f'"#/$defs/{title}"')
    named: dict[str, Any] = json.loads(text)
    named["$defs"] = {
        titles[name]: section for name, section in sorted(named["$defs"].items(), key=lambda one: titles[one[0]])
    }
    return named


def text_of(setup: Settings) -> str:
    r"""Return the TOML text of the values that a setup was given, leaving out defaults.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> text_of(Setup().with_values("tape", width_mm=50)), text_of(Setup())
        ('[tape]\nwidth_mm = 50.0\n', '')
    """
    return toml_text(_values(setup))


def changes(setup: Settings) -> list[dict[str, Any]]:
    """Return the values of a setup that differ from the defaults, each with its section, key, value and default.

    Files are named without their folders, so that the same setup is told alike wherever it lies.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> changes(Setup().with_values("tape", width_mm=50))
        [{'section': 'tape', 'key': 'width_mm', 'value': 50.0, 'default': 75.0}]
    """
    values, defaults = setup.model_dump(), _defaults(type(setup))
    named = (*setup.FILES, ("output", "controller"))
    return [
        {
            "section": section,
            "key": key,
            "value": Path(value).name if isinstance(value, str) and (section, key) in named else value,
            "default": defaults[section][key],
        }
        for section, keys in values.items()
        for key, value in keys.items()
        if value != defaults[section][key]
    ]


def _defaults(model: type[Settings]) -> Values:
    """Return the default of every key, by section and key; None where a file has to give one."""
    sections = {name: section_model(field) for name, field in model.model_fields.items()}
    return {
        name: section.model_construct().model_dump()
        | {key: None for key, field in section.model_fields.items() if field.is_required()}
        for name, section in sections.items()
    }


def _values(setup: Settings) -> Values:
    return setup.model_dump(exclude_unset=True, exclude_none=True)
