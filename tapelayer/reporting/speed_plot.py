"""Speed plot: the speed that a program asks for beside the one that its control reaches, over the program's time."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.reporting.drawing import Panel, PlotCurve, element, heading_of, range_of, svg
from tapelayer.reporting.words import Say
from tapelayer.units import MM


def speed_plot(parts: Ints, lengths: Floats, times: Floats, asked: Floats, set_speed: float, say: Say) -> list[Element]:
    """Return the plot of asked and reached speed.

    Args:
        parts: (n,) index of the course or unbroken pass of each sample.
        lengths: (n,) metres along it.
        times: (n,) seconds on the control.
        asked: (n,) seconds by the program's words.
        set_speed: of the setup, m/s.
        say: the language.
    """
    within = np.append(np.diff(parts) == 0, False)
    steps = np.append(np.diff(lengths), 0.0)
    if not np.any(within) or not np.all(np.isfinite(times)):
        return [element("p", say("Nothing was measured along the paths.", "沿路径没有测量数据。"), class_="note")]
    curves = [
        PlotCurve(style, np.repeat(times, 2)[1:-1], np.repeat(_speeds(steps, seconds, within)[:-1], 2) / MM)
        for style, seconds in (("second", asked), ("first", times))
    ]
    top = set_speed / MM
    panel = Panel(66, 18, 929, 150, (float(times[0]), float(times[-1])), (0.0, range_of(curves, [0.0, top])[1]))
    heading = heading_of(
        (say("reached on the control ", "数控系统实际速度 "), "first"),
        (say("asked for ", "指令速度 "), "second"),
        ("mm/s", ""),
    )
    note = say(
        "Over time in s. Dashed: the set speed. Where the line of the reached speed lies below that of the asked one, "
        "the control is in a ramp or cannot hold the speed.",
        "横轴：时间 s。虚线：设定速度。实际速度低于指令速度处，数控系统处于加减速或无法保持该速度。",
    )
    label = say("Speed asked for and reached, over time", "指令速度与实际速度随时间的变化")
    drawn = panel.drawn(heading, curves, [top])
    return [element("p", note, class_="note"), element("figure", svg(1016, 186, *drawn, label=label))]


def _speeds(steps: Floats, times: Floats, within: Mask) -> Floats:
    """Return the speed (n,) from each sample to the next, m/s; NaN from part to part and where no time passes."""
    spans = np.append(np.diff(times), 0.0)
    speeds: Floats = np.divide(steps, spans, out=np.full(len(steps), math.nan), where=within & (spans > 0.0))
    return speeds
