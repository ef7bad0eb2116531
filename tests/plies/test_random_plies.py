"""Random plies on random smooth moulds: each is planned, judged and laid, or refused by a sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from tapelayer import Setup
from tapelayer.arrays import Floats
from tapelayer.errors import TapelayerError
from tapelayer.laying.job import Job
from tapelayer.plies.job import PlyJob
from tapelayer.plies.ply import Ply
from tests.helpers.panels import sheet, stl_bytes

PLIES, TOGETHER, LAID_EVERY = 500, 50, 10
HALF = 300.0
SETUP = (
    Setup()
    .with_values("part", l1_mm=1250.0, l2_mm=-1000.0, l3_mm=1400.0)
    .with_values("machine", limits_mm={"x": [-500, 3000], "y": [-500, 2500]}, limits_deg={"c": [-400, 400]})
)


Height = Callable[[Floats, Floats], Floats]


def shape(random: np.random.Generator) -> Height:
    """Heights in mm, by x and y, of a sheet with a bend and some waves."""
    bends = random.uniform(-1.0, 1.0, 3) * random.choice([0.0, 0.1, 0.4]) / 1000.0
    phases, pitches = random.uniform(0.0, 2.0 * math.pi, 2), random.uniform(600.0, 1500.0, 2)
    tall = random.choice([0.0, 2.0, 8.0, 25.0, 60.0])

    def height(x: Floats, y: Floats) -> Floats:
        bent = bends[0] * x**2 + bends[1] * x * y + bends[2] * y**2
        waved = np.sin(2 * math.pi * x / pitches[0] + phases[0]) * np.sin(2 * math.pi * y / pitches[1] + phases[1])
        return bent + tall * waved

    return height


def mould(random: np.random.Generator, height: Height) -> bytes:
    """A sheet of 600 x 600 mm."""
    edge = random.choice([15.0, 25.0])
    along = np.linspace(-HALF, HALF, round(2 * HALF / edge) + 1)
    return stl_bytes(sheet(along, along, height))


def ply(random: np.random.Generator, height: Height) -> Ply:
    """A ply with limits so wide that most moulds keep them, of any angle, order and outline."""
    values: dict[str, dict[str, object]] = {
        "mould": {"file": "mould.stl"},
        "ply": {"angle_deg": round(float(random.choice([0, 45, 90, -45, random.uniform(-180, 180)])), 3)},
        "tape": {"width_mm": round(float(random.uniform(30.0, 110.0)), 1)},
        "gap": {"least_mm": -1.0, "nominal_mm": 0.5, "largest_mm": 3.0},
        "courses": {
            "order": str(random.choice(["one_way", "there_and_back"])),
            "start_corner": str(random.choice(["left", "right"])),
            "reverse": bool(random.integers(2)),
            "stagger_mm": round(float(random.uniform(-40.0, 40.0)), 1),
        },
        "limits": {
            "max_strain_percent": 0.5,
            "max_lift_mm": 6.0,
            "max_angle_deviation_deg": 10.0,
            "max_off_mould_mm": 200,
        },
    }
    if random.integers(2):
        values["ply"]["inset_mm"] = 110.0
    else:
        # A star around the middle: concave as often as not.
        count = int(random.integers(3, 9))
        turns = np.sort(random.uniform(0.0, 2.0 * math.pi, count)) if random.integers(2) else None
        turns = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False) if turns is None else turns
        radii = random.uniform(80.0, 190.0, count)
        x, y = radii * np.cos(turns), radii * np.sin(turns)
        values["ply"]["boundary"] = np.column_stack([x, y, height(x, y)]).tolist()
        values["ply"]["margin_mm"] = float(random.choice([0.0, 5.0]))
    return Ply.model_validate(values)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, PLIES, TOGETHER))
def test_each_is_laid_or_refused_by_a_sentence(first: int) -> None:
    outcomes: Counter[str] = Counter()
    for number in range(first, first + TOGETHER):
        random = np.random.default_rng(number)
        height = shape(random)
        data, values = mould(random, height), ply(random, height)
        try:
            made = PlyJob.of(data, "mould.stl", values).make("courses.txt")
        except TapelayerError as error:
            assert str(error).strip(), number
            outcomes["refused"] += 1
            continue
        assert made.report()["passed"] == (made.failure is None), number
        if made.failure is not None:
            assert all(failure["sentence"] for failure in made.report()["failures"]), number
            outcomes["withheld"] += 1
            continue
        outcomes["planned"] += 1
        if number % LAID_EVERY == 0:
            setup = SETUP.with_values("tape", width_mm=values.tape.width_mm)
            assert Job.of(made.text, "courses.txt", setup).make("panel.nc").failure is None, number
            assert PlyJob.of(data, "mould.stl", values).make("courses.txt").text == made.text, number
            outcomes["laid"] += 1
    assert outcomes["planned"] > TOGETHER / 2 and outcomes["laid"] >= TOGETHER / LAID_EVERY / 3, outcomes
