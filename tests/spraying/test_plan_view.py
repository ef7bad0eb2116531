"""The passes and the coat from above, read back in pixels."""

from __future__ import annotations

import re

import numpy as np

from tapelayer.reporting.subject import Occasion
from tapelayer.spraying.plan_view import BINS, plan_view
from tapelayer.units import MM
from tests.helpers.kinds import sprayed_wave
from tests.helpers.pages import Elements, drawn, figures


def test_every_pass_is_drawn_to_scale_with_an_arrow_along_it() -> None:
    passes = sprayed_wave().job.pass_plan.passes
    elements = Elements(figures(sprayed_wave().page(Occasion("wave.nc")), "Plan view"))
    ways = [piece for attributes, _ in elements.of("path", "line way") for piece in drawn(attributes["d"] or "")]
    assert len(ways) == len(passes)
    ends = np.array([found.path.points[[0, -1], :2] for found in passes]).reshape(-1, 2) / MM
    there = np.array([way[[0, -1]] for way in ways]).reshape(-1, 2)
    spans = ends - ends[0], there - there[0]
    scale = np.linalg.norm(spans[1]) / np.linalg.norm(spans[0])
    # Down the page is positive, and y of the machine goes up it.
    np.testing.assert_allclose(spans[1], spans[0] * [scale, -scale], atol=0.25)
    (arrows,) = (attributes["d"] or "" for attributes, _ in elements.of("path", "arrow"))
    heads = np.array(re.findall(r"-?[\d.]+", arrows), float).reshape(-1, 3, 2)
    assert len(heads) == len(passes)
    for (tip, left, right), way in zip(heads, ways, strict=True):
        ahead, along = tip - (left + right) / 2, way[-1] - way[0]
        assert ahead @ along > 0.99 * np.linalg.norm(ahead) * np.linalg.norm(along)
        assert np.min(np.linalg.norm(way - tip, axis=1)) < 0.3 * np.linalg.norm(along)


def test_the_histogram_shows_all_of_the_area_and_its_mean() -> None:
    coat = sprayed_wave().judged.coat
    assert coat is not None
    elements = Elements(figures(sprayed_wave().page(Occasion("wave.nc")), "Histogram"))
    (bars,) = (attributes["d"] or "" for attributes, _ in elements.of("path", "used"))
    corners = [[float(value) for value in re.findall(r"-?[\d.]+", bar)] for bar in bars.split("M")[1:]]
    heights = np.array([foot - top for _, foot, top, _, _ in corners])
    widths = np.array([right - left for left, _, _, right, _ in corners])
    np.testing.assert_allclose(widths, widths[0], atol=0.2)
    extent = (min(0.0, float(coat.thickness.min())), float(coat.thickness.max()))
    shares, _ = np.histogram(coat.thickness, BINS, extent, weights=coat.surface.areas)
    shares = shares[shares > 0]
    assert len(shares) == len(heights)
    np.testing.assert_allclose(heights / heights.max(), shares / shares.max(), atol=0.02)


def test_sections_go_along_the_longest_pass_and_across_it() -> None:
    longest = max(sprayed_wave().job.pass_plan.passes, key=lambda found: found.path.length)
    page = sprayed_wave().page(Occasion("wave.nc"))
    for name in (f"along pass {longest.path.number}", "across the passes"):
        (line,) = Elements(figures(page, f"Thickness {name}")).of("path", "line first")
        assert len(drawn(line[0]["d"] or "")[0]) > 5


def test_plating_has_passes_and_no_coat() -> None:
    plan = sprayed_wave().job.pass_plan
    with_coat = plan_view(plan, sprayed_wave().judged.coat)
    without = plan_view(plan, None)
    assert "Colours" in "".join(with_coat[1].itertext()) and "Colours" not in "".join(without[1].itertext())
    assert len(plan.passes) == sum(
        (node.get("d") or "").count("M") for node in without[0].iter() if node.get("class") == "line way"
    )


def test_the_marks_beside_a_low_plan_do_not_lie_on_each_other() -> None:
    elements = Elements(figures(sprayed_wave().page(Occasion("wave.nc")), "Plan view"))
    rows = [(float(own["y"] or ""), words) for own, words in elements.of("text", "tick") if float(own["x"] or "") > 800]
    heights = sorted(height for height, _ in rows)
    assert {"above", "below", "no coat"} <= {words for _, words in rows}
    assert min(np.diff(heights)) > 9
    (box,) = (own["viewbox"] or "" for own, _ in elements.of("svg"))
    assert float(box.split()[3]) > heights[-1]
