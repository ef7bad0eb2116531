"""Settings of any kind: the engine words their faults by the model's own names and raises its own error."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import Field

from tapelayer.errors import ControllerRefused
from tapelayer.laying.settings import Setup
from tapelayer.setups.forms import changes, text_of
from tapelayer.setups.sections import Positive, Section, Settings, parse_setup, read_setup, whole_text
from tapelayer.spraying.settings import SpraySetup


class LampSettings(Section, title="Lamp"):
    """A lamp."""

    power_w: Annotated[Positive, Field(description="power")]
    shade: Annotated[str, Field(description="none, or a file")] = "none"
    places: Annotated[list[list[float]], Field(description="places")] = []


class Lighting(Settings):
    """Settings without a machine."""

    CALLED = "the lighting"
    REFUSED = ControllerRefused
    FILES = (("lamp", "shade"),)
    NO_FILES = frozenset({"none"})

    lamp: Annotated[LampSettings, Field(description="the lamp")]


def test_faults_are_the_models_own() -> None:
    with pytest.raises(ControllerRefused) as caught:
        parse_setup(b"[lamp]\nzzzz = 1\n", "light.toml", Lighting)
    assert str(caught.value).splitlines() == [
        "light.toml:1: [lamp] power_w is missing",
        "light.toml:2: unknown key zzzz in [lamp]; there are power_w, shade, places",
    ]
    with pytest.raises(ControllerRefused, match=r"light\.toml: cannot be read"):
        read_setup("light.toml", Lighting)
    with pytest.raises(
        ControllerRefused, match=r"^lighting: \[lamp\] power_w: input should be greater than 0, got -1$"
    ):
        parse_setup(b"[lamp]\npower_w = 1\n", "light.toml", Lighting).with_values("lamp", power_w=-1)


def test_a_word_in_place_of_a_file_is_no_path() -> None:
    def shade(text: str) -> str:
        return parse_setup(f"[lamp]\npower_w = 1\nshade = {text}\n".encode(), "room/light.toml", Lighting).lamp.shade

    assert (shade('"none"'), shade('"paper.txt"'), shade('""')) == ("none", "room/paper.txt", "")


def test_long_lists_are_broken_into_lines_and_read_back() -> None:
    places = [[float(x), 0.125, 1 / 3] for x in range(300)]
    lighting = parse_setup(b"[lamp]\npower_w = 1\n", "light.toml", Lighting).with_values("lamp", places=places)
    for text in (whole_text(lighting, "Light"), text_of(lighting)):
        assert parse_setup(text.encode(), "light.toml", Lighting) == lighting
    # The key behind a list keeps its line and section.
    broken = f"{text_of(lighting)}shadow = 1\n"
    with pytest.raises(
        ControllerRefused, match=rf"light\.toml:{len(broken.splitlines())}: unknown key shadow in \[lamp"
    ):
        parse_setup(broken.encode(), "light.toml", Lighting)


@pytest.mark.parametrize("setup", [Setup(), SpraySetup.model_validate({})])
def test_nothing_differs_from_the_defaults_where_nothing_is_set(setup: Setup | SpraySetup) -> None:
    assert changes(setup) == []
