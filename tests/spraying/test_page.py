"""The page on a spraying program: one file that asks the network for nothing and says what the report says."""

from __future__ import annotations

import re

import pytest

from tapelayer.reporting.subject import Occasion
from tapelayer.spraying.job import SprayJob
from tests.helpers.kinds import sprayed_wave
from tests.helpers.pages import Elements
from tests.helpers.panels import stl_bytes
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import roof

HOSTILE = "</title><script>alert(1)</script><img src=x onerror=alert(2)> & \"'.nc"


def test_the_page_is_one_file_of_matching_tags_and_asks_no_network() -> None:
    text = sprayed_wave().page(Occasion("wave.nc"))
    elements = Elements(text)
    assert not re.search(r"src=|href=\"[^#]|url\(|@import|https?://", text)
    assert not elements.of("script") and not elements.of("img")
    assert elements.of("meta")[1][0]["content"] == "default-src 'none'; style-src 'unsafe-inline'"


@pytest.mark.parametrize(("name", "shown"), [(HOSTILE, HOSTILE), ("wave_\udcff.nc", "wave_\\xff.nc")])
def test_any_name_stays_text(name: str, shown: str) -> None:
    elements = Elements(sprayed_wave().page(Occasion(name)))
    assert not elements.of("script") and not elements.of("img")
    assert elements.of("title")[0][1] == f"Verification of {shown}"
    assert elements.of("span", "name")[0][1] == shown


def test_the_verdict_and_the_facts_are_those_of_the_report() -> None:
    report, elements = sprayed_wave().report(), Elements(sprayed_wave().page(Occasion("wave.nc")))
    ((_, verdict),) = elements.of("p", "verdict passed")
    kept = f"PASSED: {report['blocks']:,} blocks over {report['passes']:,} passes keep every limit"
    assert verdict == f"{kept}; position error {report['max_position_error_mm']:.4f} mm; "
    assert elements.of("span", "free")[0][1] == f"not judged: {', '.join(report['not_judged'])}"
    facts = dict(zip((words for _, words in elements.of("dt")), (words for _, words in elements.of("dd")), strict=True))
    assert report["program_sha256"] in [words for _, words in elements.of("td")]
    assert facts["passes"] == str(report["passes"])
    assert facts["sprayed area"] == f"{report['sprayed_area_m2']:.4f} m2"


def test_a_program_that_fails_is_headed_by_its_first_failure() -> None:
    found = sprayed_wave()
    text = found.text.decode()
    without_arc = re.sub(r" M03\b", " M09", text, count=1) if " M09" in text else text.replace(" M05\n", " M08\n", 1)
    judged = found.job.judge(without_arc.encode(), "program.nc", force=True)
    failures = judged.report()["failures"]
    assert failures
    elements = Elements(judged.page(Occasion("program.nc")))
    ((_, verdict),) = elements.of("p", "verdict failed")
    assert verdict.startswith(f"FAILED: {len(failures):,} failure")
    assert not elements.of("p", "passed")


def test_splits_have_rows_of_their_own() -> None:
    setup = spray_setup_of("[machine]\nlimits_deg = {phi = [-90, 90]}\n[spray]\npitch_mm = 80\n")
    found = SprayJob.of(stl_bytes(roof(120)), "roof.stl", setup).make("roof.nc")
    elements = Elements(found.page(Occasion("roof.nc")))
    assert "Splits" in [words for _, words in elements.of("h2")]
    cells = [words for _, words in elements.of("td")]
    assert cells.count("crease") == len(found.report()["splits"])
    assert "Splits" not in [words for _, words in Elements(sprayed_wave().page(Occasion("wave.nc"))).of("h2")]
