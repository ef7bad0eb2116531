"""Every row of a report can be explained at the terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from tapelayer.jobs.kinds import NAMES, KindName, kind_of
from tapelayer.reporting.quantity import quantities
from tapelayer.reporting.summary import explained


@pytest.mark.parametrize("name", NAMES)
def test_every_quantity_is_explained(name: KindName) -> None:
    kind = kind_of(name)
    shown = io.StringIO()
    Console(file=shown, width=400).print(explained(kind.rows, kind.limits(kind.first_setup())))
    for row in quantities(kind.rows):
        (line,) = [line for line in shown.getvalue().splitlines() if line.startswith(f"│ {row.key} ")]
        assert row.words.en in line and row.about.en[:60] in line
