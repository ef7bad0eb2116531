"""Sections: settings as typed tables of values, read from TOML, with every fault in words.

The field descriptions of sections are the only description of each parameter: default file, help and docs come from
them. Fields are in the units of their names (mm, deg); code that computes converts with `MM` and `DEG`.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from tapelayer.errors import InputFault, InputRefused, SetupRefused
from tapelayer.toml_files import read_toml, toml_key, toml_list, toml_value
from tapelayer.units import DEG, MM

# More faults than this are no slips: wording each takes time, so the rest are only counted.
MOST_FAULTS = 100

# Keys of the machine that came later than the hash of setups.
RAMP_KEYS = {"accelerations_mm_per_s2", "accelerations_deg_per_s2", "jerks_mm_per_s3", "jerks_deg_per_s3"}

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]


def _ordered(bounds: list[float]) -> list[float]:
    if not bounds[0] < bounds[1]:
        raise ValueError(f"expected [lower, upper] with lower below upper, got {bounds}")
    return bounds


Range = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(_ordered)]


class Section(BaseModel):
    """A table of a settings file: frozen, and no key that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


# Keys of one limit for linear and for rotary axes.
UNIT_PAIRS = (
    ("limits_mm", "limits_deg"),
    ("speeds_mm_per_s", "speeds_deg_per_s"),
    ("accelerations_mm_per_s2", "accelerations_deg_per_s2"),
    ("jerks_mm_per_s3", "jerks_deg_per_s3"),
)


class MachineSettings(Section, title="Machine"):
    """The machine, where it differs from its URDF."""

    urdf: Annotated[
        str | None, Field(description="the machine's URDF file; without it the built-in model", min_length=1)
    ] = None
    limits_mm: Annotated[
        dict[str, Range], Field(description="travel of linear axes in place of the URDF's, e.g. {x = [0, 2500]}")
    ] = {}
    limits_deg: Annotated[
        dict[str, Range], Field(description="travel of rotary axes in place of the URDF's, e.g. {c = [-180, 180]}")
    ] = {}
    speeds_mm_per_s: Annotated[
        dict[str, Positive], Field(description="speed limits of linear axes in place of the URDF's, e.g. {x = 500}")
    ] = {}
    speeds_deg_per_s: Annotated[
        dict[str, Positive], Field(description="speed limits of rotary axes in place of the URDF's, e.g. {c = 30}")
    ] = {}

    accelerations_mm_per_s2: Annotated[
        dict[str, Positive], Field(description="accelerations of linear axes in place of the URDF's, e.g. {x = 1500}")
    ] = {}
    accelerations_deg_per_s2: Annotated[
        dict[str, Positive], Field(description="accelerations of rotary axes in place of the URDF's, e.g. {c = 300}")
    ] = {}
    jerks_mm_per_s3: Annotated[
        dict[str, Positive], Field(description="jerks of linear axes in place of the URDF's, e.g. {x = 30000}")
    ] = {}
    jerks_deg_per_s3: Annotated[
        dict[str, Positive], Field(description="jerks of rotary axes in place of the URDF's, e.g. {c = 6000}")
    ] = {}

    def travel(self) -> dict[str, tuple[float, float]]:
        """Return the overridden travel by axis, in metres and radians.

        Examples:
            >>> MachineSettings(limits_mm={"x": [0, 2500]}).travel()
            {'x': (0.0, 2.5)}
        """
        linear = {axis: (low * MM, high * MM) for axis, (low, high) in self.limits_mm.items()}
        return linear | {axis: (low * DEG, high * DEG) for axis, (low, high) in self.limits_deg.items()}

    def speeds(self) -> dict[str, float]:
        """Return the overridden speed limits by axis, in metres and radians per second.

        Examples:
            >>> MachineSettings(speeds_mm_per_s={"x": 500}).speeds()
            {'x': 0.5}
        """
        return _in_si(self.speeds_mm_per_s, self.speeds_deg_per_s)

    def accelerations(self) -> dict[str, float]:
        """Return the overridden accelerations by axis, in metres and radians per second squared."""
        return _in_si(self.accelerations_mm_per_s2, self.accelerations_deg_per_s2)

    def jerks(self) -> dict[str, float]:
        """Return the overridden jerks by axis, in metres and radians per second cubed."""
        return _in_si(self.jerks_mm_per_s3, self.jerks_deg_per_s3)

    @model_validator(mode="after")
    def _one_unit_an_axis(self) -> Self:
        for linear, rotary in UNIT_PAIRS:
            for axis in getattr(self, linear).keys() & getattr(self, rotary).keys():
                raise ValueError(f"axis {axis} stands in both {linear} and {rotary}; keep the one of its unit")
        return self


def _in_si(linear: Mapping[str, float], rotary: Mapping[str, float]) -> dict[str, float]:
    """Return values by axis in metres and radians, from those in mm and in degrees."""
    return {axis: value * MM for axis, value in linear.items()} | {axis: value * DEG for axis, value in rotary.items()}


class OutputSettings(Section, title="Output"):
    """What comes out."""

    controller: Annotated[str, Field(description="name of a controller table, or the path of one", min_length=1)]


class Settings(Section):
    """The values of one TOML file: a table for each thing it speaks of."""

    # The file in a sentence.
    CALLED: ClassVar[str] = "the setup"
    # Raised for a file with faults.
    REFUSED: ClassVar[type[InputRefused]] = SetupRefused
    # The advice for a key that resembles none; the keys of the section where there is none.
    UNLIKE: ClassVar[str] = ""
    # Section and key of the values that name files, and what such a value may be instead.
    FILES: ClassVar[tuple[tuple[str, str], ...]] = ()
    NO_FILES: ClassVar[frozenset[str]] = frozenset()
    # Section and key of the values that mean more where a file itself sets them.
    MEANT_WHERE_SET: ClassVar[frozenset[tuple[str, str]]] = frozenset()

    def files(self) -> dict[tuple[str, str], str]:
        """Return the values that name files, by section and key.

        Examples:
            >>> from tapelayer.laying.settings import Setup
            >>> Setup().with_values("machine", urdf="mine.urdf").files()
            {('machine', 'urdf'): 'mine.urdf'}
        """
        values = {(section, key): getattr(getattr(self, section), key) for section, key in self.FILES}
        named = {place: value for place, value in values.items() if isinstance(value, str)}
        return {place: value for place, value in named.items() if value not in self.NO_FILES}

    def with_values(self, section: str, **values: object) -> Self:
        """Return settings with some values of one section replaced, and validate them again.

        Raises:
            InputRefused: `REFUSED`, where a value does not fit.

        Examples:
            >>> from tapelayer.laying.settings import Setup
            >>> Setup().with_values("tape", width_mm=50.0).tape.width_mm
            50.0
            >>> Setup().with_values("tape", width_mm=-1.0)
            Traceback (most recent call last):
                ...
            tapelayer.errors.SetupRefused: setup: [tape] width_mm: input should be greater than 0, got -1.0
        """
        table = self.model_dump(exclude_unset=True)
        table[section] = table.get(section, {}) | values
        return parse_table(type(self), table, self.CALLED.removeprefix("the "))

    def digest(self, files: Mapping[tuple[str, str], bytes]) -> str:
        """Return the SHA-256 of the effective values, hexadecimal.

        Args:
            files: bytes of the files that values name, by section and key: their content counts, not their paths.

        Examples:
            >>> from tapelayer.laying.settings import Setup
            >>> Setup().digest({}) == Setup().with_values("tape", width_mm=75.0).digest({})
            True
        """
        values = self.effective()
        for (section, key), data in files.items():
            values[section][key] = hashlib.sha256(data).hexdigest()
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()

    def effective(self) -> dict[str, dict[str, Any]]:
        """Return the values that enter the digest, by section and key."""
        return self.model_dump()


class JobSetup(Settings):
    """The setup of a job on a machine."""

    if TYPE_CHECKING:
        # Every setup has these sections; each setup decides their order among the others.
        machine: MachineSettings
        output: OutputSettings

    UNLIKE = "the setup command prints every key there is"
    FILES: ClassVar[tuple[tuple[str, str], ...]] = (("machine", "urdf"),)

    def effective(self) -> dict[str, dict[str, Any]]:
        """Return the same as `Settings.effective`; what is not set changes nothing and does not enter."""
        # So that a new key leaves the hash of old setups.
        values = self.model_dump()
        limits, machine = values.get("verification", {}), values["machine"]
        values["verification"] = {key: limit for key, limit in limits.items() if limit is not None}
        values["machine"] = {key: value for key, value in machine.items() if value or key not in RAMP_KEYS}
        return values


SettingsModel = TypeVar("SettingsModel", bound=Settings)


def read_setup(path: Path | str, model: type[SettingsModel]) -> SettingsModel:
    """Read settings from a TOML file.

    Raises:
        InputRefused: the model's `REFUSED`: the file is missing, not TOML, or has unknown keys or values out of range;
            all faults at once.
    """
    name = str(path)
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise model.REFUSED.unreadable(name, error) from None
    return parse_setup(data, name, model)


def parse_setup(
    data: bytes,
    name: str,
    model: type[SettingsModel],
    given: Mapping[tuple[str, str], object] = MappingProxyType({}),
) -> SettingsModel:
    r"""Return the settings in the bytes of a TOML file; relative paths start from the file's folder.

    Args:
        data: the file's bytes.
        name: the file as the user named it.
        model: of the settings.
        given: values in place of the file's own, by section and key.

    Raises:
        InputRefused: as `read_setup`.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> parse_setup(b"[tape]\nwidth_mm = 50", "job.toml", Setup).tape.width_mm
        50.0
        >>> parse_setup(b"[tape]\nwidht_mm = 50", "job.toml", Setup)
        Traceback (most recent call last):
            ...
        tapelayer.errors.SetupRefused: job.toml:2: unknown key widht_mm in [tape]; did you mean ...
    """
    table, text = read_toml(data, name, model.REFUSED)
    for section, key in model.FILES:
        values = table.get(section)
        if isinstance(values, dict) and isinstance(file := values.get(key), str) and file not in ("", *model.NO_FILES):
            values[key] = str(Path(name).parent / file)
    for (section, key), value in given.items():
        keys = table.setdefault(section, {})
        if isinstance(keys, dict):
            keys[key] = value
    return parse_table(model, table, name, text)


def parse_table(model: type[SettingsModel], table: dict[str, Any], name: str, text: str = "") -> SettingsModel:
    """Return the validated model of a TOML table, or refuse it with faults worded for people.

    Raises:
        InputRefused: the model's `REFUSED`: unknown keys (with the nearest known one) or values out of range; all
            faults at once.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> parse_table(Setup, {"tape": {"width_mm": 50}}, "job.toml").tape.width_mm
        50.0
    """
    try:
        return model.model_validate(table)
    except ValidationError as error:
        lines, faults = _lines_of_keys(text), []
        for detail in error.errors()[:MOST_FAULTS]:
            place = tuple(str(part) for part in detail["loc"])
            sentence = _sentence(model, place, detail["type"], detail["msg"], detail["input"])
            faults.append(InputFault(_line_of(lines, place), sentence, place=place))
        faults = sorted(dict.fromkeys(faults), key=lambda fault: fault.line)
        if error.error_count() > MOST_FAULTS:
            faults.insert(0, InputFault(0, f"has {error.error_count()} faults; is it the right file?"))
        raise model.REFUSED(name, faults) from None


def whole_text(setup: Settings, title: str) -> str:
    """Return settings as a commented TOML file that reads back as the same: every key with value and description.

    Examples:
        >>> from tapelayer.laying.settings import Setup
        >>> text = whole_text(Setup().with_values("tape", width_mm=50.0), "Setup of a tape-laying job")
        >>> text.splitlines()[0], [line[:13] for line in text.splitlines() if line.startswith("width_mm")]
        ('# Setup of a tape-laying job', ['width_mm = 50'])
    """
    lines = [
        f"# {title}",
        "# Units are in the names. A key left out has its default. A key behind # has no value, or is not set: set it",
        "# by taking the # away.",
    ]
    for name, field in type(setup).model_fields.items():
        lines += ["", f"# {field.description}", f"[{name}]"]
        section = getattr(setup, name)
        for key, about in section_model(field).model_fields.items():
            value = getattr(section, key)
            setting = f"{key} =" if value is None else f"{key} = {_toml(value)}"
            unset = (name, key) in setup.MEANT_WHERE_SET and key not in section.model_fields_set
            free = "# " if value is None or unset else ""
            lines.append(f"{free + setting:<32} # {about.description}")
    return "\n".join(lines) + "\n"


def section_model(field: FieldInfo) -> type[Section]:
    """Return the model of a section."""
    annotation = field.annotation
    assert isinstance(annotation, type) and issubclass(annotation, Section)
    return annotation


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return toml_value(value)
    if isinstance(value, Section):
        value = value.model_dump()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_key(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return toml_list([_toml(item) for item in value])
    assert isinstance(value, int | float)
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _keys(model: type[Section]) -> Iterator[tuple[str, str]]:
    for name, field in model.model_fields.items():
        for key in section_model(field).model_fields:
            yield key, name


def _sentence(model: type[Settings], place: tuple[str, ...], kind: str, message: str, value: object) -> str:
    where = f"[{place[0]}] {'.'.join(place[1:])}".strip() if place else model.CALLED
    if kind == "extra_forbidden":
        return _unknown(model, place)
    if kind == "missing":
        return f"{where} is missing"
    if kind == "value_error":
        return f"{where}: {message.removeprefix('Value error, ')}"
    shown = repr(value)
    return f"{where}: {message[0].lower()}{message[1:]}, got {shown if len(shown) <= 40 else shown[:37] + '...'}"


def _unknown(model: type[Settings], place: tuple[str, ...]) -> str:
    key = place[-1]
    if len(place) == 1:
        near = difflib.get_close_matches(key, model.model_fields, 1, 0.4)
        known = f"did you mean [{near[0]}]?" if near else f"there are {', '.join(f'[{n}]' for n in model.model_fields)}"
        return f"unknown section [{key}]; {known}"
    sections = dict(_keys(model)) if len(place) == 2 else {}
    names = list(sections) or list(_model_at(model, place[:-1]).model_fields)
    near = difflib.get_close_matches(key, names, 1, 0.4)
    if not near:
        known = model.UNLIKE or f"there are {', '.join(_model_at(model, place[:-1]).model_fields)}"
        return f"unknown key {key} in [{place[0]}]; {known}"
    other = sections.get(near[0], place[0])
    return f"unknown key {key} in [{place[0]}]; did you mean {near[0]}{'' if other == place[0] else f' in [{other}]'}?"


def _model_at(model: type[Section], place: tuple[str, ...]) -> type[Section]:
    """Return the model of the table at a place of a file."""
    for key in place:
        model = section_model(model.model_fields[key])
    return model


def _lines_of_keys(text: str) -> dict[tuple[str, ...], int]:
    """Return the first line (from 1) of each section and key in TOML text; keys outside sections have section ""."""
    section = ""
    lines: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        # A list over several lines has items in brackets, too, and commas in or behind them.
        if header := re.match(r"\s*\[\s*([^\],]+?)\s*\]\s*(?:#|\Z)", line):
            section = header[1]
            lines.setdefault((section,), number)
        elif key := re.match(r"""\s*["']?([\w-]+)["']?\s*(\.|=)""", line):
            lines.setdefault((section, key[1]), number)
    return lines


def _line_of(lines: Mapping[tuple[str, ...], int], place: tuple[str, ...]) -> int:
    """Return the line of a key, or of its section; 0 where neither is known."""
    known = (place[:2], ("", *place[:1]), place[:1])
    return next((lines[key] for key in known if key in lines), 0)
