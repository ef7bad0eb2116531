"""The plan view is to scale and hides no error."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.laying.evidence import Samples
from tests.helpers.judged import evidence, samples
from tests.helpers.pages import Elements, drawn, figures, page


def test_plan_view_is_to_scale_and_coloured_by_the_worst_error() -> None:
    """One bad sample among many in the same pixel still colours its cell; x and y have one scale."""
    n = 20_001
    arcs = np.linspace(0.0, 1.0, n)
    errors = np.full(n, 1e-6)
    errors[n // 3] = 9e-5
    zeros = np.zeros(n)
    found = Samples(
        np.zeros(n, np.int64),
        *(arcs for _ in range(4)),
        np.column_stack([0.2 + 0.3 * arcs, 0.5 - 0.4 * arcs, zeros]),
        errors,
        *(zeros for _ in range(7)),
        np.arange(n) % 4 == 0,
    )
    figure = figures(page(evidence(samples=found)), "Plan view")
    elements = Elements(figure)
    over = [piece for attributes, _ in elements.of("path", "line over") for piece in drawn(attributes["d"] or "")]
    whole = drawn(elements.of("path", "tape")[0][0]["d"] or "")[0]
    across, down = whole[-1] - whole[0]
    assert down / across == pytest.approx(4 / 3, rel=1e-3)
    assert len(over) == 1
    ends = (over[0][[0, -1]] - whole[0]) @ (whole[-1] - whole[0]) / np.sum((whole[-1] - whole[0]) ** 2)
    assert ends[0] <= 1 / 3 <= ends[1] and ends[1] - ends[0] < 0.01
    width = float(elements.of("path", "tape")[0][0]["stroke-width"] or "") / 10
    assert width / np.hypot(across, down) == pytest.approx(0.075 / 0.5, rel=1e-2)
    ring = elements.of("circle", "ring")[0][0]
    assert np.hypot(*(whole[0] + (whole[-1] - whole[0]) / 3 - [float(ring["cx"] or ""), float(ring["cy"] or "")])) < 0.2
    assert [words for _, words in elements.of("text", "number")] == ["3"]


def test_arrows_point_along_the_travel() -> None:
    backwards = replace(samples(), nips=samples().nips * [1, -1, 1])
    for found, sign in ((samples(), -1), (backwards, 1)):
        figure = Elements(figures(page(evidence(samples=found)), "Plan view"))
        arrows = figure.of("path", "arrow")
        assert len(arrows) == 2
        for attributes, _ in arrows:
            tip, left, right = np.array(re.findall(r"-?[\d.]+", attributes["d"] or ""), float).reshape(3, 2)
            ahead = tip - (left + right) / 2
            # Down the page is positive, and y of the machine goes up it.
            assert ahead[1] * sign > 9 and abs(ahead[0]) < 0.2
