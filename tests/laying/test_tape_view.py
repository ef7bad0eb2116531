"""The tape is drawn to scale: what is read back from the drawing is the ledger."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from xml.etree.ElementTree import tostring

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.laying.evidence import LedgerRow, Samples, TapeLedger
from tapelayer.laying.limits import limits_of
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_view import tape_view
from tests.helpers.judged import cut, evidence, ledger, numbers_of, worn
from tests.helpers.pages import Elements, page

HATCH = 6.0


@dataclass(frozen=True)
class Strip:
    """A strip of the drawing: its lines by style in pixels, and how pixels are read as millimetres by its ticks."""

    paths: dict[str, list[Floats]]
    labels: list[str]
    width: float
    height: float
    scale: float
    begin: float

    def stations(self, style: str) -> list[tuple[float, ...]]:
        """Stations in mm of each piece's corners."""
        return [tuple(self.begin + x / self.scale for x in points[:, 0]) for points in self.paths.get(style, [])]


def drawn(tape: TapeLedger, setup: Setup | None = None) -> str:
    found = evidence(tape=tape)
    judged = replace(found, limits=limits_of(setup or Setup()))
    nodes = tape_view(judged, numbers_of(judged))
    return "".join(tostring(node, encoding="unicode", method="html") for node in nodes)


def strips(text: str) -> list[Strip]:
    found = []
    for figure in re.findall(r"<figure>.*?</figure>", text, re.S):
        if 'aria-label="Tape from' not in figure:
            continue
        elements = Elements(figure)
        inner = elements.of("svg")[1][0]
        ticks = [(float(own["x"] or ""), float(words.replace(",", ""))) for own, words in elements.of("text", "tick")]
        # Two ticks are enough for the scale; all of them are on it.
        (slope, offset), residuals, *_ = np.polyfit(*zip(*ticks, strict=True), 1, full=True)
        assert len(ticks) >= 2 and np.all(residuals < len(ticks) * (0.05 * slope) ** 2 + 1e-9)
        paths: dict[str, list[Floats]] = {}
        for own, _ in elements.of("path"):
            pieces = [np.array(re.findall(r"-?[\d.]+", piece), float) for piece in (own["d"] or "").split("M")[1:]]
            style = own["class"] or ""
            if style != "axis":
                paths[style] = [piece.reshape(-1, 2) for piece in pieces]
        left = float(inner["x"] or "")
        labels = [words for _, words in elements.of("text", "number")]
        width, height = float(inner["width"] or ""), float(inner["height"] or "")
        found.append(Strip(paths, labels, width, height, 1 / slope, offset + slope * left))
    return found


def test_courses_waste_cuts_and_rolls_stand_where_the_ledger_says() -> None:
    """Every line goes from sigma + w/2 cot on the tape's left to sigma - w/2 cot on its right."""
    (strip,) = strips(drawn(worn()))
    assert strip.height / strip.scale == pytest.approx(75.0, rel=2e-3)
    half = 37.5
    expected = {
        "line cut first": [(100.0, 45.0), (2000.0, 30.0)],
        "line cut second": [(600.0, 90.0), (1000.0, 135.0)],
        "line cut roll": [(0.0, 90.0), (850.0, 90.0)],
    }
    for style, lines in expected.items():
        read = sorted(strip.stations(style))
        told = sorted((s + half / math.tan(math.radians(a)), s - half / math.tan(math.radians(a))) for s, a in lines)
        assert np.array(read) == pytest.approx(np.array(told), abs=0.3), style
    assert "line cut over" not in strip.paths
    first, second = strip.stations("laid")
    assert first == pytest.approx((137.5, 62.5, 600.0, 600.0), abs=0.5)
    slant = half * math.sqrt(3.0)
    assert second == pytest.approx((962.5, 1037.5, 2000.0 - slant, 2000.0 + slant), abs=0.5)
    assert strip.labels == ["3", "17"]


def test_strips_follow_each_other_without_a_gap() -> None:
    found = strips(drawn(ledger(*range(1, 31))))
    assert len(found) == 12
    for before, after in zip(found, found[1:], strict=False):
        assert before.begin + before.width / before.scale == pytest.approx(after.begin, abs=1.0)
    cuts = [line for strip in found for style in ("first", "second") for line in strip.stations(f"line cut {style}")]
    middles = {round(sum(line) / 2 / 750) for line in cuts}
    assert middles == set(range(31))
    assert all(abs(sum(line) / 2 - 750 * round(sum(line) / 2 / 750)) < 1.0 for line in cuts)


@given(
    st.tuples(*[st.sampled_from([20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 135.0, 160.0]) | st.floats(15, 165)] * 4),
    st.floats(0.0, 0.5),
)
def test_the_hatch_fills_the_waste_and_nothing_else(angles: tuple[float, ...], margin: float) -> None:
    """On each line x + y = c the hatch covers the heights at which a dense sample of points is waste."""
    cots = [1 / math.tan(math.radians(angle)) for angle in angles]
    before = 0.0375 * abs(cots[0]) + margin
    between = 0.0375 * abs(cots[1] - cots[2]) + margin
    stations = before, before + 0.3, before + 0.3 + between
    rows = (
        LedgerRow(1, 0.3, stations[0], 0.0, before, 0.0, 0, ()),
        LedgerRow(2, 0.3, stations[2], 0.0, between, 0.0, 0, ()),
    )
    cuts = (
        cut(stations[0], angles[0], 1, starting=1),
        cut(stations[1], angles[1], 1, ending=1),
        cut(stations[2], angles[2], 1, starting=2),
        cut(stations[2] + 0.3, angles[3], 1, ending=2),
    )
    tape = TapeLedger(rows, cuts, (), stations[2] + 0.3, 1.0, 1.0, 1.0)
    strip = strips(drawn(tape))[0]
    y = (np.arange(400) + 0.5) / 400 * strip.height
    slants = (strip.height / 2 - y) / strip.scale

    def edge(station: float, cot: float) -> Floats:
        return np.asarray(1e3 * station + cot * slants)

    hatched: dict[int, float] = {}
    for (x0, y0), (x1, y1) in strip.paths.get("hatch", []):
        assert x0 + y0 == pytest.approx(x1 + y1, abs=0.21)
        line = round((x0 + y0) / HATCH)
        hatched[line] = hatched.get(line, 0.0) + y1 - y0
        assert x0 + y0 == pytest.approx(HATCH * line, abs=0.11)
    for line in range(math.ceil(strip.width / HATCH)):
        sigma = strip.begin + (HATCH * line - y) / strip.scale

        def waste(wider: float, sigma: Floats = sigma) -> float:
            """Length of the line in the waste, whose edges are moved out by so many pixels."""
            off = wider / strip.scale
            first = (sigma >= -off) & (sigma <= edge(stations[0], cots[0]) + off)
            second = (sigma >= edge(stations[1], cots[1]) - off) & (sigma <= edge(stations[2], cots[2]) + off)
            return float(np.sum(first | second)) / len(y) * strip.height

        # The drawing is rounded to a tenth of a pixel, and lines may run along an edge.
        assert waste(-0.3) - 0.5 <= hatched.get(line, 0.0) <= waste(0.3) + 0.5, line


def test_what_is_beyond_a_limit_or_not_cut_is_red() -> None:
    text = drawn(worn())
    assert "Beyond a limit" not in text and not Elements(text).of("span", "bad")
    tight = Setup().with_values("verification", max_cut_error_mm=0.015, max_blade_error_deg=0.005)
    text = drawn(worn(), tight)
    assert [words for _, words in Elements(text).of("span", "bad")] == ["0.0060", "0.0100", "0.0200", "0.0200"]
    red = {tuple(np.round(line, -1)) for strip in strips(text) for line in strip.stations("line cut over")}
    assert {round(sum(line) / 2, -2) for line in red} == {600.0, 1000.0, 2000.0}
    assert "Beyond a limit" in text
    tape = replace(worn(), cuts=worn().cuts[:3])
    lines = [line for strip in strips(drawn(tape)) for line in strip.stations("line cut over")]
    assert lines == [pytest.approx((2000.0, 2000.0), abs=0.5)]
    lost = replace(worn(), cuts=(replace(worn().cuts[0], error=math.nan), *worn().cuts[1:]))
    assert [words for _, words in Elements(drawn(lost)).of("span", "bad")] == ["not measured"]


def cells(text: str, after: str) -> list[list[str]]:
    """Rows of the first table after a heading."""
    body = re.search(rf"<h3>{after}.*?<tbody>(.*?)</tbody>", text, re.S)
    assert body
    rows = re.findall(r"<tr>(.*?)</tr>", body[1], re.S)
    return [[re.sub(r"<.*?>", "", cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.S)] for row in rows]


def test_tables_of_the_ledger_and_of_the_cuts() -> None:
    text = drawn(worn())
    assert cells(text, "By course") == [
        ["3", "100.00", "500.00", "100.00", "0.00", "62.50", "37.50", "1"],
        ["17", "1,000.00", "1,000.00", "400.00", "250.00", "125.00", "25.00", "2"],
        ["all", "", "1,500.00", "500.00", "250.00", "187.50", "62.50", "3"],
    ]
    assert cells(text, "Cuts in") == [
        ["100.00", "45.000", "", "3", "1", "1", "8", "0.0010", "0.0010"],
        ["600.00", "90.000", "3", "", "2", "6", "13", "0.0060", "0.0060"],
        ["1,000.00", "135.000", "", "17", "2", "10", "17", "0.0100", "0.0100"],
        ["2,000.00", "30.000", "17", "", "1", "20", "27", "0.0200", "0.0200"],
    ]
    assert "error mm, limit 0.05" in text and "blade deg, limit 0.05" in text


def test_a_long_tape_is_cut_off_with_a_word() -> None:
    text = drawn(ledger(*range(1, 1001)))
    found = strips(text)
    assert len(found) == 60
    end = found[-1].begin + found[-1].width / found[-1].scale
    told = re.search(r"Drawn up to ([\d,]+) mm of 750,041 mm", text)
    assert told and float(told[1].replace(",", "")) == pytest.approx(end, abs=20)
    rows = cells(text, "By course")
    assert len(rows) == 201 and rows[-1][:3] == ["all", "", "750,000.00"]
    assert "and 800 more courses" in text
    assert len(cells(text, "Cuts in")) == 200 and "and 801 more cuts" in text
    assert len(text.encode()) < 1_000_000


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_tape_that_was_not_measured_is_not_drawn(bad: float) -> None:
    rows = worn().rows
    nothing = Samples.joined([])
    for found in (
        evidence(tape=TapeLedger((), (), (), 0.0, 0.0, 0.0, 0.0), samples=nothing),
        evidence(tape=replace(worn(), rows=(rows[0], replace(rows[1], station=bad)))),
    ):
        text = page(found)
        assert "Nothing was measured on the tape" in text
        assert not strips(text)
