"""A setup written whole tells every key, and reads back as the same job."""

from __future__ import annotations

import re

import pytest

from tapelayer.jobs.kinds import NAMES, KindName, kind_of
from tapelayer.laying.limits import limits_of
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup, whole_text

CHANGED = {
    "lay": '[machine]\nlimits_mm = {x = [0, 2500.0001], "a b" = [1, 2]}\n[tape]\nwidth_mm = 50.123456789\n'
    "[head]\nwrap_compensation = false\ndelays_ms = {shoe = 12.5}\n[output]\ncontroller = '铺 \"带\".toml'\n",
    "plan": "[mould]\nfile = 'hood.stl'\n[ply]\nangle_deg = 45.25\nboundary = [[0, 0, 1.5], [1, 0, 0], [1, 1, 0]]\n",
    "spray": "[spray]\npitch_mm = 23.4567891\n[footprint]\nrate_mm3_per_s = 100\n",
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("changed", [False, True])
def test_a_whole_setup_reads_back_as_itself(name: KindName, changed: bool) -> None:
    kind = kind_of(name)
    setup = parse_setup(CHANGED[name].encode(), "job.toml", kind.setup) if changed else kind.first_setup()
    text = whole_text(setup, kind.title)
    again = parse_setup(text.encode(), "job.toml", kind.setup)
    assert again.model_dump() == setup.model_dump()
    assert kind.limits(again) == kind.limits(setup)
    keys = re.findall(r"^(?:# )?(\w+) =", text, re.MULTILINE)
    assert len(keys) == sum(len(type(getattr(setup, section)).model_fields) for section in kind.setup.model_fields)
    assert "\n" * 3 not in text and len(keys) > 20


def test_what_is_judged_only_where_set_stays_so() -> None:
    """With the published form, a limit that is written out would be judged."""
    published = Setup().with_values("process", kinematics="published")
    for setup in (published, published.with_values("verification", max_roller_tilt_deg=0.05)):
        again = parse_setup(whole_text(setup, "Setup").encode(), "job.toml", Setup)
        assert limits_of(again) == limits_of(setup)
    assert not limits_of(published)["max_roller_tilt_deg"].judged
