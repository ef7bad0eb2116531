"""The coat and the speed are judged where the setup sets a limit, and named as not judged where it sets none."""

from __future__ import annotations

import pytest

from tapelayer.errors import SetupRefused
from tapelayer.reporting.subject import Occasion
from tapelayer.spraying.job import SprayJob, SprayResult
from tapelayer.spraying.quantities import limited
from tests.helpers.kinds import source, sprayed_wave
from tests.helpers.pages import Elements
from tests.helpers.panels import stl_bytes
from tests.helpers.setups import spray_setup_of
from tests.helpers.sprayed import roof

# Key of the setup, of the report and of a failure, a limit that nothing keeps, and one that everything does.
LIMITS = [
    ("max_thickness_deviation_percent", "cv_percent", "cv_percent", 0.001, 1000.0),
    ("min_coverage_percent", "coverage_percent", "coverage_percent", 100.0, 0.001),
    ("min_speed_share", "speed_share", "speed_share", 1.0, 1e-6),
]


@pytest.mark.parametrize(("key", "row", "what", "tight", "loose"), LIMITS)
def test_a_limit_that_is_set_is_judged(key: str, row: str, what: str, tight: float, loose: float) -> None:
    kept = SprayJob.of(source("spray"), "wave.stl", spray_setup_of(f"[verification]\n{key} = {loose}\n")).make("a.nc")
    assert kept.failure is None
    before = sprayed_wave().report()
    words = {"cv_percent": "thickness deviation", "coverage_percent": "coverage", "speed_share": "share at set speed"}
    assert words[row] in before["not_judged"] and words[row] not in kept.report()["not_judged"]
    value = before[row]
    broken = SprayJob.of(source("spray"), "wave.stl", spray_setup_of(f"[verification]\n{key} = {tight}\n")).make("a.nc")
    if value in (tight, 100.0):
        assert broken.failure is None
        return
    assert broken.failure is not None
    assert [(one["what"], one["value"], one["limit"]) for one in broken.report()["failures"]] == [(what, value, tight)]


def test_the_gun_beside_creases_is_judged_where_a_limit_is_set() -> None:
    def made(text: str) -> SprayResult:
        setup = spray_setup_of(f"[spray]\npitch_mm = 80\n{text}")
        return SprayJob.of(stl_bytes(roof(120)), "roof.stl", setup).make("roof.nc")

    value = made("").report()["max_crease_deviation_deg"]
    assert value > 15.0 and made("[verification]\nmax_crease_deviation_deg = 89.9\n").failure is None
    failures = made("[verification]\nmax_crease_deviation_deg = 15\n").report()["failures"]
    assert [(one["what"], one["value"], one["limit"]) for one in failures] == [("crease_deviation_deg", value, 15.0)]


def test_without_limits_the_verdict_stays_and_the_page_names_what_is_open() -> None:
    assert limited(sprayed_wave().judged).failures == ()
    assert len(Elements(sprayed_wave().page(Occasion("wave.nc"))).of("span", "open")) == 4


@pytest.mark.parametrize("key", ["max_thickness_deviation_percent", "min_coverage_percent"])
def test_plating_has_no_coat_to_limit(key: str) -> None:
    text = f'[process]\nkind = "plating"\n[spray]\npitch_mm = 20\n[verification]\n{key} = 5\n'
    with pytest.raises(SetupRefused, match="no coat to judge"):
        spray_setup_of(text)
