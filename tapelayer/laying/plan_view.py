"""Plan view: the courses from above, drawn for the report's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.laying.evidence import Evidence
from tapelayer.reporting.drawing import element, heading_of, polyline, px, svg
from tapelayer.reporting.map_marks import COLOURS, arrows, colour_bar, foot, number_labels, plan_panel, scale_bar
from tapelayer.reporting.words import ENGLISH, Say, plain
from tapelayer.units import MM

# Most cells to be coloured by their largest error, and the smallest cell in pixels.
CELLS = 40_000
LEAST_CELL = 3.0


@dataclass(frozen=True, eq=False)
class _CourseStrip:
    """A course in the plan view.

    Attributes:
        number: its number in the file.
        points: (m, 2) pixels.
        classes: (m - 1,) colour of each piece, `COLOURS` beyond the limit.
    """

    number: int
    points: Floats
    classes: Ints


def plan_view(evidence: Evidence, say: Say = ENGLISH) -> list[Element]:
    """Return the courses from above to scale, in `machine` axes, coloured by position error."""
    samples = evidence.samples
    known = np.all(np.isfinite(samples.nips), axis=1)
    if not np.any(known):
        return [element("p", say("Nothing was measured along the courses.", "沿道次没有测量数据。"), class_="note")]
    plan = samples.nips[known][:, :2] / MM
    # A sample next to one without a position gets a NaN error, so that the gap shows.
    beside = ~known | np.append(~known[1:], False) | np.append(False, ~known[:-1])
    errors = np.where(beside, np.nan, samples.position_errors / MM)[known]
    courses = samples.courses[known]
    limit = evidence.limits["max_position_error_mm"].value
    finite = errors[np.isfinite(errors)]

    margin = evidence.tape_width / MM / 2
    low, high = np.min(plan, axis=0) - margin, np.max(plan, axis=0) + margin
    panel, scale = plan_panel(low, high)
    pixels = np.column_stack([panel.across(plan[:, 0]), panel.down(plan[:, 1])])
    strips = _strips([row.course for row in evidence.tape.rows], courses, pixels, _classes(errors, limit))

    nodes = panel.drawn(heading_of((say("y over x, mm", "y 对 x，mm"), "")), [], [])
    band = "".join(_outline(strip.points) for strip in strips)
    nodes.append(
        element(
            "path",
            d=band,
            class_="tape",
            transform="scale(.1)",
            stroke_width=px(evidence.tape_width / MM * scale * 10),
        )
    )
    for colour in range(COLOURS + 1):
        pieces = "".join(_pieces(strip, colour) for strip in strips)
        if pieces:
            style = f"line course e{colour}" if colour < COLOURS else "line course over"
            nodes.append(element("path", d=pieces, transform="scale(.1)", class_=style))
    paths = [strip.points for strip in strips]
    nodes += arrows(paths)
    nodes += number_labels([strip.number for strip in strips], paths)
    nodes += _worst_place(pixels, errors)
    nodes.append(scale_bar(panel, scale))
    bar = (panel.left + panel.width + 24, panel.top)
    over = float(np.max(finite, initial=0.0)) > limit
    beyond = {"over": say("beyond the limit", "超出限值")} if over else {}
    nodes += colour_bar(*bar, (say("position error", "位置误差"), "mm"), (0.0, limit), bound=True, beyond=beyond)
    words = say(
        "x and y of the machine in mm, to scale. Bands: the tape, {width} mm wide. Arrows: travel. Ring: the largest "
        "position error. The colours end at the limit.",
        "机床坐标 x 与 y，单位 mm，按比例。色带：带料，宽 {width} mm。箭头：行进方向。圆圈：位置误差最大处。"
        "色标止于限值。",
        width=plain(evidence.tape_width / MM),
    )
    label = say("Plan view of the courses", "各道次俯视图")
    figure = svg(panel.left + panel.width + 150, foot(panel) + 24, *nodes, label=label)
    return [element("figure", figure), element("p", words, class_="note")]


def _classes(errors: Floats, limit: float) -> Ints:
    """Return the colour (n,) of each error: 0 to COLOURS - 1 up to the limit, COLOURS beyond it or for NaN."""
    inside: Mask = errors <= limit
    scaled = np.floor(np.where(inside, errors, 0.0) / limit * COLOURS).astype(np.int64)
    return np.where(inside, np.minimum(scaled, COLOURS - 1), COLOURS)


def _strips(numbers: Sequence[int], courses: Ints, pixels: Floats, classes: Ints) -> list[_CourseStrip]:
    """Return the courses in cells of a few pixels, each with its worst colour, so that thinning hides no error."""
    starts = np.unique(courses, return_index=True)[1]
    steps = np.hypot(*np.diff(pixels, axis=0, prepend=pixels[:1]).T)
    steps[starts] = 0.0
    travelled = np.cumsum(steps)
    cell = max(LEAST_CELL, float(travelled[-1]) / CELLS)
    strips = []
    for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(courses)], strict=True):
        cells = ((travelled[start:end] - travelled[start]) / cell).astype(np.int64)
        firsts = np.flatnonzero(np.append(True, np.diff(cells) > 0))
        colours = np.maximum.reduceat(classes[start:end], firsts)
        points = np.vstack([pixels[start:end][firsts], pixels[end - 1 : end]])
        strips.append(_CourseStrip(numbers[int(courses[start])], points, colours))
    return strips


def _outline(points: Floats) -> str:
    return polyline(points[:, 0], points[:, 1])


def _pieces(strip: _CourseStrip, colour: int) -> str:
    """Return the SVG path of the pieces of one colour."""
    chosen = np.flatnonzero(strip.classes == colour)
    if not len(chosen):
        return ""
    runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
    return "".join(_outline(strip.points[run[0] : run[-1] + 2]) for run in runs)


def _worst_place(pixels: Floats, errors: Floats) -> list[Element]:
    """Return a ring round the largest error, or round the first place where it is unknown."""
    worst = int(np.argmax(np.where(np.isfinite(errors), errors, np.inf)))
    across, down = pixels[worst]
    return [element("circle", cx=px(across), cy=px(down), r=8, class_="ring")]
