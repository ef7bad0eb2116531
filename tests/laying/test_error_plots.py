"""Plots are to scale, and their limits are on them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.laying.evidence import Samples
from tapelayer.laying.settings import Setup
from tests.helpers.judged import evidence, ledger, trajectory
from tests.helpers.pages import Elements, figures, page, pixels


def test_limits_are_drawn_within_the_plots_and_to_scale() -> None:
    """Data heights are read back from the drawn lines by the limits' own heights."""
    n = 1001
    moves = trajectory(n)
    positions = moves.positions.copy()
    positions[700, 0] = 2.4
    lines, limits = pixels(figures(page(evidence(), moves=replace(moves, positions=positions)), "Axis x"))
    assert set(limits) == {"0", "2,500", "1,000"}
    # The frame of a plot is 84 pixels high from pixel 18 on: a limit that is drawn elsewhere is off the plot.
    assert all(18 < at < 18 + 84 for at in limits.values())
    scale = 2500 / (limits["0"] - limits["2,500"])
    heights = np.concatenate(lines[:1])[:, 1]
    drawn_x = (limits["0"] - heights) * scale
    assert np.max(drawn_x) == pytest.approx(2400, abs=0.1 * scale)
    assert np.min(drawn_x) == pytest.approx(300, abs=0.1 * scale)
    assert drawn_x[0] == pytest.approx(300, abs=0.1 * scale) and drawn_x[-1] == pytest.approx(400, abs=0.1 * scale)


def test_speeds_beyond_the_limit_are_within_the_plot() -> None:
    """A jump of 1 m in one block of 4 ms is 250 m/s; the range follows it and the limit stays on the plot."""
    moves = trajectory(1000)
    positions = moves.positions.copy()
    positions[501:, 0] += 1.0
    lines, limits = pixels(figures(page(evidence(), moves=replace(moves, positions=positions)), "Axis x"))
    tops = [float(np.min(line[:, 1])) for line in lines]
    assert all(18 <= top for top in tops)
    assert 18 < limits["1,000"] < 18 + 84
    speed_height = 18 + 84 - min(top for line, top in zip(lines, tops, strict=True) if line[0, 0] > 540)
    limit_height = 18 + 84 - limits["1,000"]
    assert speed_height / limit_height == pytest.approx(250.025 / 1.0, rel=0.1 / limit_height)


def test_rapids_are_shaded_and_their_speed_is_not_drawn() -> None:
    moves = trajectory(10)
    figure = figures(page(evidence(), moves=moves), "Axis x")
    band = Elements(figure).of("path", "band")[1][0]["d"] or ""
    shaded = [(float(a), float(b)) for a, b in re.findall(r"M([\d.]+) [\d.]+H([\d.]+)", band)]
    # Blocks 1 and 6 of 10 are rapids: 0 to 0.4 s and 2 to 2.4 s of 4 s over 424 pixels from pixel 571.
    assert shaded == [(571, 614), (783, 826)]
    lines, _ = pixels(figure)
    speeds = [line for line in lines if line[0, 0] > 540]
    assert len(speeds) == 2
    assert [round(float(line[0, 0])) for line in speeds] == [round(571 + 42.4), round(571 + 424 * 0.6)]


def test_errors_along_a_course_with_the_setups_limits() -> None:
    setup = Setup().with_values("verification", max_position_error_mm=0.08, max_roller_tilt_deg=40.0)
    text = page(evidence(), setup=setup)
    lines, limits = pixels(figures(text, "Errors along course 3"))
    assert set(limits) >= {"0.08", "-0.08", "40", "-40"}
    scale = 0.16 / (limits["-0.08"] - limits["0.08"])
    middle = (limits["-0.08"] + limits["0.08"]) / 2
    normal, lateral = lines[0], lines[1]
    assert (middle - normal[:, 1]) * scale == pytest.approx([0, 0.01, -0.03], abs=0.05 * scale + 1e-9)
    assert (middle - lateral[[0, -1], 1]) * scale == pytest.approx([0, 0.04], abs=0.05 * scale + 1e-9)
    assert "Errors along course 17" in text
    caption = Elements(figures(text, "Errors along course 3")).of("figcaption")[0][1]
    assert "largest position error 0.0500 mm at 500.0 mm" in caption


def test_of_many_courses_those_nearest_to_a_limit_are_drawn() -> None:
    count = 60
    each = 4
    courses = np.repeat(np.arange(count), each)
    errors = 1e-6 * courses.astype(float)
    errors[courses == 5] = -4.9e-5
    zeros = np.zeros(len(courses))
    arcs = np.tile(np.linspace(0, 1, each), count)
    found = Samples(
        courses,
        *(arcs for _ in range(4)),
        np.column_stack([0.01 * courses, arcs, zeros]),
        zeros,
        zeros,
        errors,
        *(zeros for _ in range(5)),
        np.tile([True, False], len(courses) // 2),
    )
    text = page(evidence(samples=found, tape=ledger(*range(101, 161))))
    shown = [int(number) for number in re.findall(r'aria-label="Errors along course (\d+)"', text)]
    # 5 stands out, then 59 down to 21; the next is 20, whose 0.020 mm are 40 % of the limit.
    assert shown == [106, *range(122, 161)]
    assert "of the other 20 none reaches more than 40.0% of one" in text
