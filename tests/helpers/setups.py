"""Setups from TOML text."""

from __future__ import annotations

from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.settings import SpraySetup

# For courses whose heading leaves the printed travel of c, and for closed courses.
WIDE = "[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}\n"
CLOSED = """
[part]
l1_mm = 1200
l2_mm = -1000
[machine]
limits_deg = {c = [-330, 330], a = [-40, 40]}
[head]
run_out = "none"
wrap_compensation = false
"""


def setup_of(text: str = "") -> Setup:
    """Setup of the tape layer."""
    return parse_setup(text.encode(), "setup.toml", Setup)


def spray_setup_of(text: str = "") -> SpraySetup:
    """Setup of the sprayer."""
    return parse_setup(text.encode(), "job.toml", SpraySetup)
