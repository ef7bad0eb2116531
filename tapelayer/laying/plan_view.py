"""Plan view of a page: the courses from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.settings import Setup
from tapelayer.reporting.drawing import Panel, element, heading_of, polyline, px, svg
from tapelayer.reporting.map_marks import MarkPlaces, heading, round_up, scale_bar
from tapelayer.reporting.words import plain
from tapelayer.units import MM

# Cells that are coloured by their largest error; a cell is never smaller than this, in pixels.
CELLS = 40_000
LEAST_CELL = 3.0
WIDTH, HEIGHT = 760.0, 560.0
COLOURS = 10


@dataclass(frozen=True, eq=False)
class _CourseStrip:
    """A course in the plan view.

    Attributes:
        number: in its file.
        points: (m, 2) pixels.
        classes: (m - 1,) colour of each piece, `COLOURS` where it is beyond the limit.
    """

    number: int
    points: Floats
    classes: Ints


def plan_view(evidence: Evidence, setup: Setup) -> list[Element]:
    """The courses from above to scale, in `machine` axes, coloured by position error."""
    samples = evidence.samples
    seen = np.all(np.isfinite(samples.nips), axis=1)
    if not np.any(seen):
        return [element("p", "Nothing was measured along the courses.", class_="note")]
    plan = samples.nips[seen][:, :2] / MM
    # A place that is not known shows as an error without a number in the samples beside it.
    beside = ~seen | np.append(~seen[1:], False) | np.append(False, ~seen[:-1])
    errors = np.where(beside, np.nan, samples.position_errors / MM)[seen]
    courses = samples.courses[seen]
    limit = setup.verification.max_position_error_mm
    finite = errors[np.isfinite(errors)]
    top = min(limit, round_up(float(np.max(finite, initial=0.0))))

    room = evidence.tape_width / MM / 2
    low, high = np.min(plan, axis=0) - room, np.max(plan, axis=0) + room
    scale = float(min(WIDTH / (high[0] - low[0]), HEIGHT / (high[1] - low[1])))
    width, height = (high - low) * scale
    panel = Panel(64, 18, round(width), round(height), (float(low[0]), float(high[0])), (float(low[1]), float(high[1])))
    pixels = np.column_stack([panel.across(plan[:, 0]), panel.down(plan[:, 1])])
    strips = _strips([row.course for row in evidence.tape.rows], courses, pixels, _classes(errors, top, limit))

    nodes = panel.drawn(heading_of(("y over x, mm", "")), [], [])
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
    nodes += _arrows(strips)
    nodes += _labels(strips)
    nodes += _worst_place(pixels, errors)
    nodes.append(scale_bar(panel, scale))
    nodes += _colour_bar(panel.left + panel.width + 24, panel.top, top, limit, float(np.max(finite, initial=0.0)))
    words = f"x and y of the machine in mm, to scale. Bands: the tape, {plain(evidence.tape_width / MM)} mm wide. "
    words += "Arrows: travel. Ring: the largest position error."
    figure = svg(panel.left + width + 150, panel.top + height + 24, *nodes, label="Plan view of the courses")
    return [element("figure", figure), element("p", words, class_="note")]


def _classes(errors: Floats, top: float, limit: float) -> Ints:
    """Colour (n,) of each error: 0 to COLOURS - 1 up to `top`, COLOURS beyond the limit or where there is no number."""
    inside: Mask = errors <= limit
    scaled = np.floor(np.where(inside, errors, 0.0) / top * COLOURS).astype(np.int64)
    return np.where(inside, np.minimum(scaled, COLOURS - 1), COLOURS)


def _strips(numbers: Sequence[int], courses: Ints, pixels: Floats, classes: Ints) -> list[_CourseStrip]:
    """Courses cut into cells of a few pixels, each with its worst colour, so that thinning hides no error."""
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
    """Path of the pieces of one colour."""
    chosen = np.flatnonzero(strip.classes == colour)
    if not len(chosen):
        return ""
    runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
    return "".join(_outline(strip.points[run[0] : run[-1] + 2]) for run in runs)


def _arrows(strips: Sequence[_CourseStrip]) -> list[Element]:
    """An arrowhead in the middle of each course; one that would lie on another is left out."""
    nodes = []
    places = MarkPlaces(10.0)
    for strip in strips:
        middle = len(strip.points) // 2
        begin, end = strip.points[middle - 1], strip.points[middle]
        ahead = heading(begin, end)
        left = np.array([ahead[1], -ahead[0]])
        tip = (begin + end) / 2 + 5 * ahead
        if places.take((begin + end) / 2, 5.0):
            corners = (tip, tip - 10 * ahead + 4 * left, tip - 10 * ahead - 4 * left)
            path = "M" + "L".join(f"{px(x)} {px(y)}" for x, y in corners) + "z"
            nodes.append(element("path", d=path, class_="arrow"))
    return nodes


def _labels(strips: Sequence[_CourseStrip]) -> list[Element]:
    """Course numbers before the courses' starts; one that would lie on another is left out."""
    nodes = []
    places = MarkPlaces(11.0)
    for strip in strips:
        across, down = strip.points[0] - 9 * heading(strip.points[0], strip.points[1])
        if places.take(np.array([across, down]), 3.5 * len(str(strip.number)) + 3):
            nodes.append(element("text", str(strip.number), x=px(across), y=px(down + 4), class_="number middle"))
    return nodes


def _worst_place(pixels: Floats, errors: Floats) -> list[Element]:
    """A ring round the largest error, or round the first place that has none."""
    worst = int(np.argmax(np.where(np.isfinite(errors), errors, np.inf)))
    across, down = pixels[worst]
    return [element("circle", cx=px(across), cy=px(down), r=8, class_="ring")]


def _colour_bar(left: float, top: float, highest: float, limit: float, largest: float) -> list[Element]:
    """Colours of the position errors with their values."""
    size = 14.0
    nodes = [element("text", "position error", x=px(left), y=px(top + 8), class_="tick")]
    nodes.append(element("text", "mm", x=px(left), y=px(top + 20), class_="tick"))
    top += 30
    if largest > limit:
        nodes.append(element("rect", x=px(left), y=px(top), width=16, height=size, class_="fill over"))
        nodes.append(element("text", "beyond the limit", x=px(left + 21), y=px(top + 10), class_="tick bound"))
        top += size + 6
    for colour in range(COLOURS):
        down = top + size * (COLOURS - 1 - colour)
        nodes.append(element("rect", x=px(left), y=px(down), width=16, height=size, class_=f"fill e{colour}"))
    for i in range(0, COLOURS + 1, 2):
        value = highest * i / COLOURS
        at = top + size * (COLOURS - i)
        style = "tick bound" if i == COLOURS and highest == limit else "tick"
        nodes.append(element("text", plain(value), x=px(left + 21), y=px(at + 4), class_=style))
    return nodes
