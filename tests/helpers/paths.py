"""Where things are."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
DATA = ROOT / "tests" / "data"
# Real parts and courses that may not be copied into the project: only helpers.parts knows of them, as extra examples.
SHARED = ROOT.parent / "shared" / "data"
