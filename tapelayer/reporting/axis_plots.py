"""Axis plots: position and speed of every axis over the program's time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.motion.trajectory import Kind, Trajectory
from tapelayer.reporting.drawing import Panel, PlotCurve, element, heading_of, px, range_of, svg
from tapelayer.reporting.words import ENGLISH, Say
from tapelayer.verification.axis_use import AxisUse


def axis_plots(axes: Sequence[AxisUse], trajectory: Trajectory, say: Say = ENGLISH) -> list[Element]:
    """Return plots of position and speed of every axis over the program's time."""
    moves = np.flatnonzero(trajectory.durations > 0.0)
    if not 0.0 < trajectory.duration < math.inf:
        return [element("p", say("The program's time is not known.", "程序用时未知。"), class_="note")]
    ends = trajectory.times[moves]
    begins = ends - trajectory.durations[moves]
    rapid = trajectory.kinds[moves] == Kind.RAPID
    span = (0.0, trajectory.duration)
    steps = np.abs(trajectory.positions[moves] - trajectory.begins(moves)) / trajectory.durations[moves, None]
    steps[rapid] = np.nan
    corners = np.column_stack([begins, ends]).ravel()
    nodes = [
        element(
            "p",
            say(
                "Over time in s. Dashed: travel and speed limits of the machine. Grey: rapids, which run at the "
                "control's own speed; the speeds are those of the feed blocks.",
                "横轴：时间 s。虚线：机床的行程与速度上限。灰色：快移，按数控系统自身速度运行；"
                "速度曲线只含进给程序段。",
            ),
            class_="note",
        )
    ]
    for axis in axes:
        scale, unit = axis.scale, axis.unit
        column = trajectory.column(axis.name)
        position = PlotCurve(
            "first",
            np.append(0.0, trajectory.times),
            np.append(trajectory.start[column], trajectory.positions[:, column]) * scale,
        )
        speed = PlotCurve("first", corners, np.repeat(steps[:, column], 2) * scale)
        travel, top = [axis.lower * scale, axis.upper * scale], [axis.speed_limit * scale]
        left = Panel(66, 18, 424, 84, span, range_of([position], travel))
        right = Panel(571, 18, 424, 84, span, (0.0, range_of([speed], [0.0, *top])[1]))
        drawn = [_bands(panel, begins[rapid], ends[rapid]) for panel in (left, right)]
        drawn += left.drawn(heading_of((axis.name, "first"), (f" {unit}", "")), [position], travel)
        drawn += right.drawn(heading_of((axis.name, "first"), (f" {say('speed', '速度')} {unit}/s", "")), [speed], top)
        label = say("Axis {name}: position and speed over time", "{name} 轴：位置与速度对时间", name=axis.name)
        nodes.append(element("figure", svg(1016, 120, *drawn, label=label)))
    return nodes


def _bands(panel: Panel, begins: Floats, ends: Floats) -> Element:
    """Return bands shaded from (m,) to (m,) in the panel's x, pixel column by pixel column."""
    first = np.floor(panel.across(begins)).astype(np.int64)
    last = np.ceil(panel.across(ends)).astype(np.int64)
    parts = []
    reach = -1
    for left, right in zip(first.tolist(), last.tolist(), strict=True):
        left = max(left, reach)
        if right > left:
            parts.append(f"M{left} {px(panel.top)}H{right}v{panel.height}H{left}z")
            reach = right
    return element("path", d="".join(parts), class_="band")
