"""What every test module may ask for."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from tests.helpers.paths import SHARED

# LinuxCNC's own Python runs these.
collect_ignore = ["post/linuxcnc"]

# A slow machine is no fault of the code: no example has to be done in a given time.
settings.register_profile("project", deadline=None)
settings.load_profile("project")


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the shared course files and geometry beside the project."""
    if not SHARED.is_dir():
        pytest.skip("the shared data folder is not beside the project")
    return SHARED
