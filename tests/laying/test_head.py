"""The tape head's measures, and heads that cannot work."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.errors import BladesMeet, TapeWiderThanTravel
from tapelayer.laying.head import Head, RunUp, check_head, head_of
from tapelayer.motion.corners import Rule
from tests.helpers.heads import HEAD
from tests.helpers.machines import limited
from tests.helpers.setups import setup_of


def test_tape_wider_than_the_knives_travel_is_refused() -> None:
    with pytest.raises(TapeWiderThanTravel) as refused:
        check_head(replace(HEAD, tape_width=0.4))
    assert str(refused.value) == (
        "tape of 400 mm needs knife 1 (axis v) from -210 to 210 mm, 10 mm beyond both edges, but it travels from "
        "-200 to 200 mm; the widest tape is 380 mm"
    )
    check_head(replace(HEAD, tape_width=0.38))
    with pytest.raises(TapeWiderThanTravel, match="knife 2 .axis q."):
        check_head(replace(HEAD, travel_q=(-0.1, 0.2)))


def test_blades_longer_than_the_pitch_are_refused() -> None:
    with pytest.raises(BladesMeet) as refused:
        check_head(replace(HEAD, blade_length=0.11))
    assert str(refused.value) == (
        "blades of 110 mm would meet, as the knives pass each other at 100 mm; blade_length_mm must not be more"
    )
    check_head(replace(HEAD, blade_length=0.1))


@given(st.floats(1e-3, 0.5), st.floats(0.0, 0.1), st.floats(-0.5, 0.0), st.floats(0.0, 0.5), st.booleans())
def test_a_head_is_refused_exactly_where_a_sweep_leaves_a_slides_travel(
    width: float, clearance: float, lower: float, upper: float, first: bool
) -> None:
    travel = {"travel_v" if first else "travel_q": (lower, upper)}
    head = replace(
        HEAD, tape_width=width, knife_clearance=clearance, **{"travel_v": (-1.0, 1.0), "travel_q": (-1.0, 1.0)} | travel
    )
    assert head.half_sweep == width / 2 + clearance
    if lower <= -head.half_sweep and head.half_sweep <= upper:
        check_head(head)
    else:
        with pytest.raises(TapeWiderThanTravel, match=f"needs knife {1 if first else 2} "):
            check_head(head)


@pytest.mark.parametrize("name", ["blade_length", "knife_pitch", "tape_width", "knife_clearance"])
def test_measures_that_are_no_numbers_are_refused(name: str) -> None:
    with pytest.raises((TapeWiderThanTravel, BladesMeet)):
        check_head(replace(HEAD, **{name: math.nan}))


def test_the_head_of_a_setup_has_the_machines_knives() -> None:
    setup = setup_of("""
[machine]
limits_mm = {v = [-150, 180], q = [-170, 160]}
[tape]
width_mm = 120
roll_length_m = 90
[head]
knife_to_nip_mm = 420
knife_clearance_mm = 7
scrap_margin_mm = 3
blade_length_mm = 25
minimum_cut_angle_deg = 20
""")
    head = head_of(setup, limited(setup), Rule("stop"))
    assert head == Head(
        tape_width=pytest.approx(0.12),
        knife_to_nip=pytest.approx(0.42),
        knife_pitch=pytest.approx(0.1, abs=1e-12),
        knife_clearance=pytest.approx(0.007),
        scrap_margin=pytest.approx(0.003),
        blade_length=pytest.approx(0.025),
        travel_v=pytest.approx((-0.15, 0.18)),
        travel_q=pytest.approx((-0.17, 0.16)),
        minimum_cut_angle=pytest.approx(math.radians(20)),
        roll_length=90.0,
    )
    blending = Rule("look_ahead")
    run_up = RunUp(0.25, 1.0, 5.0, 2.0, 0.04, blending)
    assert head_of(setup, limited(setup), blending, 0.04) == replace(head, run_up=run_up)
