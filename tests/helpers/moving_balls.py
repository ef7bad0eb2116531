"""Balls on slides, whose clearance is known in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tapelayer.machines.machine import Machine
from tapelayer.motion.trajectory import Kind, Trajectory
from tests.helpers.trajectories import straight

RADIUS = 0.1
_SLIDE = """
  <joint name="{name}" type="prismatic">
    <parent link="{above}"/><child link="{below}"/><axis xyz="{axis}"/>
    <limit lower="-5" upper="5" velocity="1" effort="1"/>
  </joint>"""


def ball(path: Path) -> Machine:
    """The machine, its URDF in a folder."""
    slides = (("x", "machine", "along", "1 0 0"), ("y", "along", "across", "0 1 0"), ("z", "across", "ball", "0 0 1"))
    joints = "".join(_SLIDE.format(name=n, above=a, below=b, axis=axis) for n, a, b, axis in slides)
    links = "".join(f'<link name="{name}"/>' for name in ("machine", "along", "across"))
    shape = f'<collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>'
    file = path / "ball.urdf"
    file.write_text(f'<robot name="ball">{links}<link name="ball">{shape}</link>{joints}</robot>')
    return Machine.load(file)


def twins(path: Path) -> Machine:
    """Two balls on two slides along one line, its URDF in a folder; where both slides stand at zero, they coincide."""
    slides = "".join(_SLIDE.format(name=n, above="machine", below=f"ball_{n}", axis="1 0 0") for n in "ab")
    shape = f'<collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>'
    links = "".join(f'<link name="ball_{name}">{shape}</link>' for name in "ab")
    file = path / "twins.urdf"
    file.write_text(f'<robot name="twins"><link name="machine"/>{links}{slides}</robot>')
    return Machine.load(file)


def dipped(lowest: Sequence[float], highest: Sequence[float]) -> Trajectory:
    """A ball that goes straight down to each height of its centre, and up again to the other; metres."""
    heights = np.column_stack([lowest, highest]).ravel()
    ends = np.column_stack([np.zeros((len(heights), 2)), heights])
    return straight(("x", "y", "z"), ends, start=np.array([0.0, 0.0, highest[-1]]))


def lowered(lowest: float, by: float = 0.05) -> Trajectory:
    """A ball that comes down straight to a centre's height, and goes up again; metres."""
    ends = np.array([[0.0, 0.0, lowest], [1.0, 0.3, lowest + by]])
    return straight(("x", "y", "z"), ends, start=np.array([-1.0, 0.0, lowest + by]))


def swung(lowest: float, radius: float = 0.4) -> Trajectory:
    """A ball that swings down and up again on one arc in x and z, lowest between its ends; metres."""
    ends = np.array([[radius, 0.2, lowest + radius]])
    base = straight(("x", "y", "z"), ends, start=np.array([-radius, 0.0, lowest + radius]), kinds=Kind.CLOCKWISE)
    # In the plane ZX, counterclockwise turns from z to x: seen so, the way from -x over the bottom to x is clockwise.
    return replace(base, centres=np.array([[0.0, 0.0, lowest + radius]]), planes=np.array([1], np.uint8))
