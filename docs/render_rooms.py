"""Draw docs/rooms.svg: the packages in import order, and the data of one course from package to package.

python docs/render_rooms.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, indent, tostring

from tapelayer.reporting.drawing import element, svg

# Packages in import order, each with what it holds.
ROOMS = {
    "urdf": "the machines",
    "tapelayer": "the ground: errors, units, arrays",
    "geometry": "curves, paths, meshes",
    "machines": "forward and inverse kinematics",
    "motion": "distance into seconds",
    "setups": "values of a job",
    "courses": "courses and their file format",
    "verification": "failures, and what was verified",
    "reporting": "quantities, drawing, wording",
    "post": "NC text, written and read",
    "jobs": "a job on any kind of machine",
    "laying · spraying · plies": "both machines, and plans of courses",
    "workbench": "jobs over HTTP",
    "cli": "the commands",
}


class Datum(NamedTuple):
    """Something that a step makes: what it is called, the package that defines it, where it stands, what makes it."""

    name: str
    room: str
    across: int
    by: str


DATA = (
    Datum("course file", "cli", 268, ""),
    Datum("Course", "courses", 340, "read_courses"),
    Datum("Toolpath", "geometry", 424, "courses_in_machine"),
    Datum("joint values", "machines", 510, "block_ends"),
    Datum("Stroke", "motion", 600, "course_blocks"),
    Datum("Trajectory", "motion", 742, "stroke_blocks"),
    Datum("Verified", "verification", 820, "Inspector"),
    Datum("NC text", "post", 900, "write"),
    Datum("Program", "post", 1016, "read"),
    Datum("Evidence", "laying · spraying · plies", 1090, "Inspector"),
    Datum("report", "reporting", 1160, "numbers"),
)
LEFT, TOP, LANE, ROOM, DATUM = 10, 44, 44, 206, 94
WIDTH, HEIGHT = 1230, TOP + LANE * len(ROOMS) + 10
STYLE = """
svg { --paper: #fff; --ink: #1b1f24; --soft: #5b6570; --rule: #d5dae0; --box: #eef0f3; --datum: #dbe8f7;
  --line: #1f5fa8; font-family: system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; }
@media (prefers-color-scheme: dark) { svg { --paper: #14181d; --ink: #e6e9ed; --soft: #9aa5b1; --rule: #3a424c;
  --box: #20262d; --datum: #1d3550; --line: #6cb0ff; } }
.paper { fill: var(--paper); } .box { fill: var(--box); stroke: var(--rule); } .lane { stroke: var(--rule); }
.datum { fill: var(--datum); stroke: var(--line); } .arrow { fill: none; stroke: var(--line); stroke-width: 1.5; }
.tip { fill: var(--line); } text { fill: var(--ink); font-size: 14px; } .soft { fill: var(--soft); font-size: 12px; }
.name { font-weight: 600; } .middle { text-anchor: middle; }
.by { paint-order: stroke; stroke: var(--paper); stroke-width: 4px; }
"""


def drawn() -> str:
    """Return the drawing as SVG text."""
    tip = element("path", d="M0 0 8 4 0 8z", class_="tip")
    marker = element("marker", tip, id="tip", viewBox="0 0 8 8", refX=7, refY=4, markerWidth=7, markerHeight=7)
    marker.set("orient", "auto")
    parts = [element("style", STYLE), element("defs", marker)]
    parts.append(element("rect", width=WIDTH, height=HEIGHT, class_="paper"))
    parts += _heading(LEFT, "Imports go upwards")
    parts += _heading(
        LEFT + ROOM + 14, "One course, from left to right; an arrow is named by what makes the next thing"
    )
    parts += [*_rooms(), *_arrows(), *_data()]
    drawing = svg(WIDTH, HEIGHT, *parts, label="The packages in import order, and the data of one course between them")
    drawing.set("xmlns", "http://www.w3.org/2000/svg")
    indent(drawing)
    return tostring(drawing, encoding="unicode") + "\n"


def _heading(left: float, words: str) -> list[Element]:
    return [element("text", words, x=left, y=26, class_="name")]


def _middle(room: str) -> float:
    """Height of the middle of a package's lane."""
    return TOP + LANE * (list(ROOMS).index(room) + 0.5)


def _rooms() -> Iterator[Element]:
    for room, holds in ROOMS.items():
        at = _middle(room)
        yield element("path", d=f"M{LEFT} {at}H{WIDTH - LEFT}", class_="lane")
        yield element("rect", x=LEFT, y=at - 18, width=ROOM, height=36, rx=4, class_="box")
        yield element("text", room, x=LEFT + 10, y=at - 2, class_="name")
        yield element("text", holds, x=LEFT + 10, y=at + 12, class_="soft")


def _data() -> Iterator[Element]:
    for datum in DATA:
        at = _middle(datum.room)
        yield element("rect", x=datum.across - DATUM / 2, y=at - 14, width=DATUM, height=28, rx=14, class_="datum")
        yield element("text", datum.name, x=datum.across, y=at + 5, class_="middle")


def _arrows() -> Iterator[Element]:
    for before, after in zip(DATA, DATA[1:], strict=False):
        begin, end = _middle(before.room), _middle(after.room)
        left = before.across + DATUM // 2
        if begin == end:
            path = f"M{left} {end}H{after.across - DATUM / 2}"
            label = element("text", after.by, x=(before.across + after.across) / 2, y=end + 28, class_="soft by middle")
        else:
            down = 1 if end > begin else -1
            path = f"M{left} {begin}H{after.across - 8}q8 0 8 {8 * down}V{end - 14 * down}"
            place = (begin + end) / 2 + (4 if abs(end - begin) > LANE else 0)
            label = element("text", after.by, x=after.across + 6, y=place, class_="soft by")
        yield element("path", d=path, class_="arrow", marker_end="url(#tip)")
        yield label


if __name__ == "__main__":
    (Path(__file__).parent / "rooms.svg").write_text(drawn(), encoding="utf-8")
