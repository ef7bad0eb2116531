"""Pinocchio itself is asked, at blocks from the first to the last."""

from __future__ import annotations

import numpy as np
import pytest

from tapelayer.arrays import Floats
from tapelayer.machines.machine import Machine
from tapelayer.verification import forward_check
from tapelayer.verification.forward_check import PINOCCHIO_AGREEMENT, forward_disagreement
from urdf import SPRAYER

FRAMES = {None: ("roller",), SPRAYER: ("P", "gun")}


@pytest.mark.parametrize("urdf", FRAMES)
def test_both_agree_on_every_machine(urdf: object) -> None:
    machine = Machine.load(urdf)  # type: ignore[arg-type]
    joints = np.random.default_rng(1).uniform(-1.0, 1.0, (300, len(machine.axes)))
    assert 0.0 < forward_disagreement(machine, joints, FRAMES[urdf]) < PINOCCHIO_AGREEMENT / 1e3
    assert forward_disagreement(machine, joints[:0], FRAMES[urdf]) == 0.0


def test_one_entry_of_one_frame_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    machine, honest = Machine.load(SPRAYER), Machine.forward_pinocchio

    def off(self: Machine, q: Floats, frame: str) -> Floats:
        poses = honest(self, q, frame)
        poses[7, 1, 2] += 1e-3 if frame == "gun" else 0.0
        return poses

    monkeypatch.setattr(Machine, "forward_pinocchio", off)
    joints = np.zeros((9, len(machine.axes)))
    assert forward_disagreement(machine, joints, ("P", "gun")) == pytest.approx(1e-3)
    assert forward_disagreement(machine, joints, ("P",)) < PINOCCHIO_AGREEMENT


@pytest.mark.parametrize(
    ("count", "asked"), [(1, [0]), (5, [0, 1, 2, 3, 4]), (6, [0, 1, 2, 3, 5]), (101, [0, 25, 50, 75, 100])]
)
def test_of_many_blocks_an_even_selection_is_asked(
    monkeypatch: pytest.MonkeyPatch, count: int, asked: list[int]
) -> None:
    monkeypatch.setattr(forward_check, "PINOCCHIO_BLOCKS", 5)
    machine, honest, seen = Machine.load(), Machine.forward_pinocchio, []

    def watched(self: Machine, q: Floats, frame: str) -> Floats:
        seen.extend(np.round(q[:, 0] * 1e3).astype(int).tolist())
        return honest(self, q, frame)

    monkeypatch.setattr(Machine, "forward_pinocchio", watched)
    joints = np.zeros((count, len(machine.axes)))
    joints[:, 0] = np.arange(count) / 1e3
    forward_disagreement(machine, joints, ("roller",))
    assert seen == asked
