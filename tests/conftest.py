"""What every test module may ask for."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

from tests.helpers.panels import write_stl
from tests.helpers.parts import PARTS, triangles_of
from tests.helpers.paths import SHARED

# LinuxCNC's own Python runs these.
collect_ignore = ["post/linuxcnc"]

# Every program that the tests start judges at this moment and speaks English, so that its reports are the same bytes.
os.environ |= {"SOURCE_DATE_EPOCH": "1767225600", "LC_ALL": "C.UTF-8"}

# A slow machine is no fault of the code: no example has to be done in a given time.
settings.register_profile("project", deadline=None)
settings.load_profile("project")
# What a command says depends on the locale.
os.environ["LC_ALL"] = "C.UTF-8"


@pytest.fixture(scope="session")
def part(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The STL file of a part by its name: of one that is made up, or of a real one beside the project."""
    folder = tmp_path_factory.mktemp("parts")

    @cache
    def path_of(name: str) -> Path:
        if name in PARTS:
            return write_stl(folder / f"{name}.stl", triangles_of(name))
        return SHARED / "geometry" / f"{name}.stl"

    return path_of
