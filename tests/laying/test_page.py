"""The page says what the report says, and nothing from a file becomes a part of it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.laying.evidence import Samples
from tapelayer.laying.settings import Setup
from tapelayer.verification.failures import Failure
from tests.helpers.judged import axes, evidence, ledger, samples, trajectory
from tests.helpers.pages import Elements, figures, page


def test_page_is_one_file_of_matching_tags_and_asks_no_network() -> None:
    for found in (evidence(), evidence(failures=(Failure(3, 1, "position_error_mm", 0.06, 0.05, 9),))):
        text = page(found)
        assert text.startswith("<!DOCTYPE html>")
        elements = Elements(text)
        assert not re.search(r"https?:|//|url\(|@import|javascript", text, re.I)
        tags = {tag for tag, _, _ in elements.found}
        assert not tags & {"script", "link", "img", "iframe", "object", "image", "use"}
        attributes = {name for _, own, _ in elements.found for name in own}
        assert not {name for name in attributes if name.startswith("on") or name in ("src", "style")}
        assert all((own["href"] or "").startswith("#") for _, own, _ in elements.found if "href" in own)
        assert "prefers-color-scheme: dark" in text and "@media print" in text
        assert elements.of("p", "verdict")[0][1].startswith("PASSED" if found.passed else "FAILED")
        sections = [
            "Largest errors",
            "Axes",
            "Subject",
            "Plan view",
            "Tape",
            "Laying speed",
            "Errors along the courses",
            "Axis positions and speeds",
            "What the quantities mean",
        ]
        assert [words for _, words in elements.of("h2")] == ([] if found.passed else ["Failures"]) + sections
        values = [words for _, words in elements.of("dd")]
        assert values.index("75.0 %") + 1 == values.index("18.8 %") == values.index("6.2 %") - 1
        assert "knife conflicts" in text


HOSTILE = "</title><script>alert(1)</script><img src=x onerror=alert(2)> & \"'.nc"


def test_a_hostile_name_stays_text() -> None:
    axis = replace(axes()[0], name='x"><script>alert(3)</script>')
    moves = trajectory()
    moves = replace(moves, axes=(axis.name, "c"))
    failure = Failure(3, 1, f"axis_{axis.name}_mm", 9.0, 1.0)
    text = page(evidence(axes=(axis, axes()[1]), failures=(failure,)), HOSTILE, moves)
    elements = Elements(text)
    assert not elements.of("script") and not elements.of("img")
    assert elements.of("title")[0][1] == f"Verification of {HOSTILE}"
    assert elements.of("span", "name")[0][1] == HOSTILE
    assert any(words == HOSTILE for _, words in elements.of("td"))
    assert any(words == axis.name for _, words in elements.of("td"))


@pytest.mark.parametrize(
    ("name", "shown"), [("panel_\udcff.nc", "panel_\\xff.nc"), ("panel_\ud800.nc", "panel_\\ud800.nc")]
)
def test_a_name_that_is_no_text_is_shown_as_escapes(name: str, shown: str) -> None:
    assert Elements(page(evidence(), name)).of("span", "name")[0][1] == shown


def test_published_form_says_loudly_what_is_not_judged() -> None:
    published = Setup().with_values("process", kinematics="published")
    verdict = Elements(page(evidence(), setup=published)).of("p", "verdict unjudged")
    assert "NOT JUDGED: roller tilt 30.0000 deg, heading error 2.0000 deg" in verdict[0][1]
    judged = published.with_values("verification", max_roller_tilt_deg=45.0)
    verdict = Elements(page(evidence(), setup=judged)).of("p", "verdict unjudged")
    assert "NOT JUDGED: heading error 2.0000 deg" in verdict[0][1]
    assert not Elements(page(evidence())).of("p", "unjudged")


def test_failures_are_listed_with_their_places() -> None:
    many = tuple(Failure(i, 7, "lay_speed_mm_per_s", 260.0 + i, 250.0, 100 + i) for i in range(1, 251))
    text = page(evidence(failures=many))
    cells = [words for _, words in Elements(text).of("td")]
    first = cells.index("lay speed")
    assert cells[first - 3 : first + 3] == ["1", "7", "101", "lay speed", "261 mm/s", "250 mm/s"]
    assert "and 50 more" in text
    assert "FAILED: 250 failures, the first: course 1 point 7 lay speed is 261 mm/s, limit 250 mm/s" in text


def test_page_of_a_million_samples_is_below_three_megabytes() -> None:
    random = np.random.default_rng(5)
    n, count = 1_000_000, 200
    courses = np.repeat(np.arange(count), n // count)
    arcs = np.tile(np.linspace(0, 1.9, n // count), count)
    noise = [5e-6 * random.standard_normal(n) for _ in range(8)]
    nips = np.column_stack([0.006 * courses + 0.02 * np.sin(9 * arcs), arcs, 0 * arcs])
    times = np.arange(n) * 1e-3
    found = Samples(courses, arcs, times, times, 0.25 + 0.0 * times, nips, *noise, np.arange(n) % 4 == 0)
    blocks = n // 4
    moves = trajectory(blocks)
    moves = replace(moves, positions=np.cumsum(random.standard_normal((blocks, 2)), axis=0) * 1e-3)
    text = page(evidence(samples=found, tape=ledger(*range(1, count + 1))), moves=moves)
    assert 100_000 < len(text.encode()) < 3_000_000


def test_page_of_a_program_that_lays_nothing() -> None:
    nothing = Samples.joined([])
    still = replace(trajectory(), durations=np.zeros(5))
    text = page(evidence(samples=nothing), moves=still)
    Elements(text)
    assert "FAILED" in text and "Nothing was measured along the courses" in text
    assert "time is not known" in text


def test_places_that_are_not_known_are_told_and_not_hidden() -> None:
    arcs = samples().arc_lengths.copy()
    nips = samples().nips.copy()
    arcs[1] = np.nan
    nips[1] = np.nan
    found = evidence(samples=replace(samples(), arc_lengths=arcs, nips=nips))
    text = page(found)
    assert "1 of 3 samples were not measured and are not drawn" in text
    assert Elements(figures(text, "Plan view")).of("path", "line over")
