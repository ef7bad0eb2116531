"""The file of the gun's poses against the pieces that it is made of."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from tapelayer.provenance import Provenance
from tapelayer.spraying.pose_file import trajectory_text
from tests.helpers.panels import sheet
from tests.helpers.sprayed import roof, sprayed

MADE_FROM = Provenance("wave.stl", "a" * 64, "b" * 64, "1.2.3")
WAVE = sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y)
STAY = (np.eye(3), np.zeros(3))


@pytest.mark.parametrize("degrees", [0.0, 90.0, -137.0])
def test_rows_turned_and_moved_back_are_the_joints(degrees: float) -> None:
    spraying, plan = sprayed(WAVE)
    turn, origin = math.radians(degrees), np.array([1.25, 0.9, 0.03])
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    text = trajectory_text(plan.passes, spraying.pieces, (rotation, origin), MADE_FROM).decode("ascii")
    rows = np.loadtxt(text.splitlines())
    joints = np.concatenate([piece.joints for piece in spraying.pieces])
    assert rows.shape == (len(joints), 5)
    np.testing.assert_allclose(rows[:, :3] / 1e3 @ rotation.T + origin, joints[:, :3], rtol=0, atol=1e-7)
    np.testing.assert_allclose(rows[:, 3] + degrees, np.degrees(joints[:, 3]), rtol=0, atol=5.1e-5)
    np.testing.assert_allclose(rows[:, 4], np.degrees(joints[:, 4]), rtol=0, atol=5.1e-5)


def test_passes_are_headed_and_followed_by_a_blank_line() -> None:
    spraying, plan = sprayed(WAVE)
    text = trajectory_text(plan.passes, spraying.pieces, STAY, MADE_FROM).decode("ascii")
    head, *rest = text.split("# pass ")
    assert head.splitlines() == [
        "# tapelayer 1.2.3",
        "# source: wave.stl",
        f"# source sha256: {'a' * 64}",
        f"# setup sha256: {'b' * 64}",
        "# columns: x y z theta phi, mm and deg, frame of the source",
    ]
    assert len(rest) == len(plan.passes)
    for block, found in zip(rest, plan.passes, strict=True):
        assert block.endswith("\n\n")
        first, *rows = block.splitlines()[:-1]
        assert first == f"{found.path.number} plane {found.plane} curve {found.curve} layer {found.layer}"
        assert all(re.fullmatch(r"-?\d+\.\d{4}( -?\d+\.\d{4}){4}", row) for row in rows)
    assert not re.search(r"-0\.0000\b", text)


def test_a_split_is_said_inside_its_pass() -> None:
    limits = "[machine]\nlimits_deg = {phi = [-90, 90]}\n[spray]\npitch_mm = 80"
    spraying, plan = sprayed(roof(120), limits)
    lines = trajectory_text(plan.passes, spraying.pieces, STAY, MADE_FROM).decode().splitlines()
    assert lines.count("# split") == len(spraying.splits) >= 1
    assert sum(line.startswith("# pass ") for line in lines) == len(plan.passes)


def test_a_name_in_any_script_is_written_in_ascii_on_its_line() -> None:
    spraying, plan = sprayed(WAVE)
    name = replace(MADE_FROM, source="钣金 \n# pass 9 é.stl")
    text = trajectory_text(plan.passes, spraying.pieces, STAY, name)
    assert text.decode("ascii").splitlines()[1] == "# source: __ _# pass 9 _.stl"
