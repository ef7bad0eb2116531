"""Tape view: the tape with its courses, waste and cuts, drawn and in tables for the report's page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.laying.evidence import CutMade, Evidence, TapeLedger
from tapelayer.reporting.drawing import element, px, svg, table, ticks
from tapelayer.reporting.words import ENGLISH, NOT_MEASURED, Say, Words, plain, shown
from tapelayer.units import DEG, MM
from tapelayer.verification.limits import Limits

# A strip of tape in pixels. A tape that needs more than `STRIPS` strips of this height is drawn smaller, down to the
# least height; if it still needs more than `MOST_STRIPS`, the page says up to where it is drawn.
WIDTH, MARGIN = 968.0, 24.0
HEIGHT, LEAST_HEIGHT, MOST_HEIGHT = 48.0, 12.0, 64.0
STRIPS, MOST_STRIPS = 12, 60
# Distance between two lines of the hatch, in pixels.
HATCH = 6.0
# Most rows of each table; the page counts the others.
SHOWN_ROWS = 200

WASTES = {
    "waste_mm": Words("waste before mm", "此前废料 mm"),
    "waste_roll_mm": Words("for a new roll", "换卷"),
    "waste_formula_mm": Words("by the angles", "角度与余量"),
    "waste_knives_mm": Words("for a free knife", "等待切刀"),
}
CUT, BLADE = "max_cut_error_mm", "max_blade_error_deg"
LEGEND = {
    "roll": Words("A roll begins", "新卷起点"),
    "first": Words("Knife 1", "切刀 1"),
    "second": Words("Knife 2", "切刀 2"),
    "over": Words("Beyond a limit, or not cut", "超出限值，或未切"),
}


def tape_view(evidence: Evidence, report: dict[str, Any], say: Say = ENGLISH) -> list[Element]:
    """Return the tape to scale, then its ledger by course, then its cuts.

    Args:
        evidence: the measurements of verification.
        report: its report as plain values.
        say: the language.
    """
    tape, limits = evidence.tape, evidence.limits
    if not (tape.rows and all(math.isfinite(row.station) for row in tape.rows)):
        return [element("p", say("Nothing was measured on the tape.", "料带没有测量数据。"), class_="note")]
    return [
        *_drawing(tape, evidence.tape_width / MM, limits, say),
        element("h3", say("By course", "按道次")),
        _ledger(report, say),
        *_rest(len(tape.rows), Words("course", "个道次"), say),
        element("h3", say("Cuts in the order of the tape", "沿带料顺序的切割")),
        _cuts(tape.cuts, limits, say),
        *_rest(len(tape.cuts), Words("cut", "次切割"), say),
    ]


def _rest(count: int, what: Words, say: Say) -> list[Element]:
    """Return a note on the number of rows that a table leaves out, if any."""
    more = count - SHOWN_ROWS
    if more <= 0:
        return []
    english = f"{what.en}{'s' if more > 1 else ''}"
    words = say("and {more:,} more {what}", "另有 {more:,} {what}", more=more, what=say(english, what.zh))
    return [element("p", words, class_="note")]


def _ledger(report: dict[str, Any], say: Say) -> Element:
    """Return the table of the tape by course, with totals."""
    courses = report["tape"]
    rows: list[list[Element | str]] = [
        [
            str(row["course"]),
            *(shown(row[key], "", "z,.2f", say.words(NOT_MEASURED)) for key in ("station_mm", "laid_mm", *WASTES)),
            str(row["laying_stops"]),
        ]
        for row in courses[:SHOWN_ROWS]
    ]
    totals = [f"{sum(row[key] or 0.0 for row in courses):z,.2f}" for key in ("laid_mm", *WASTES)]
    rows.append([element("b", cell) for cell in (say("all", "合计"), "", *totals, f"{report['laying_stops']:,}")])
    headings = (
        say("course", "道次"),
        say("starts at mm", "起点带长 mm"),
        say("laid mm", "铺放 mm"),
        *(say.words(words) for words in WASTES.values()),
        say("stops while laying", "铺放中停顿"),
    )
    return table(headings, rows)


def _cuts(cuts: Sequence[CutMade], limits: Limits, say: Say) -> Element:
    """Return the table of the cuts in order along the tape; values beyond their limit are red."""
    rows: list[list[Element | str]] = [
        [
            f"{cut.station / MM:z,.2f}",
            f"{cut.angle / DEG:z.3f}",
            str(cut.ending or ""),
            str(cut.starting or ""),
            element("span", str(cut.knife), class_=f"key {_colour(cut)}"),
            str(cut.block),
            str(cut.line or ""),
            _judged(cut.error / MM, limits[CUT].value, say),
            _judged(cut.blade_error / DEG, limits[BLADE].value, say),
        ]
        for cut in cuts[:SHOWN_ROWS]
    ]
    headings = (
        say("cut at mm", "切割位置 mm"),
        say("angle deg", "角度 deg"),
        say("ends course", "结束道次"),
        say("starts course", "开始道次"),
        say("knife", "切刀"),
        say("block", "程序段"),
        say("line", "行"),
        say("error mm, limit {limit}", "误差 mm，限值 {limit}", limit=plain(limits[CUT].value)),
        say("blade deg, limit {limit}", "刀片 deg，限值 {limit}", limit=plain(limits[BLADE].value)),
    )
    return table(headings, rows)


def _judged(value: float, limit: float, say: Say) -> Element | str:
    words = f"{value:z.4f}" if math.isfinite(value) else say.words(NOT_MEASURED)
    return words if value <= limit else element("span", words, class_="bad")


def _colour(cut: CutMade) -> str:
    return "first" if cut.knife == 1 else "second"


def _drawing(tape: TapeLedger, width: float, limits: Limits, say: Say) -> list[Element]:
    """Return the tape of a width in millimetres to scale, broken into strips, under a legend of its colours."""
    laid, uncut = _courses(tape)
    waste, rolls = _waste(laid, np.array([row.waste_roll for row in tape.rows]) / MM)
    lines = {"roll": rolls, **_cut_lines(tape.cuts, uncut, limits)}
    numbers = [str(row.course) for row in tape.rows]
    slants = np.abs(laid[:, 1::2]) * width / 2
    # Leave space for the thickness of the lines at both ends.
    low = min(0.0, float(np.min(laid[:, 0] - slants[:, 0]))) - width / 20
    high = float(np.max(laid[:, 2] + slants[:, 1])) + width / 20
    full = (high - low) * HEIGHT / width / WIDTH
    count = max(1, min(round(full), STRIPS), round(full * LEAST_HEIGHT / HEIGHT))
    height = min(HEIGHT * count / full, MOST_HEIGHT)

    words = say(
        "To scale, {width} mm wide; stations in mm. Courses are laid from left to right, and left of the travel is up. "
        "Hatched: waste. ",
        "按比例，带宽 {width} mm；带长位置单位 mm。道次从左向右铺放，行进方向左侧朝上。剖面线：废料。",
        width=plain(width),
    )
    keys = [
        element("span", say.words(words), class_=f"key {style}") for style, words in LEGEND.items() if len(lines[style])
    ]
    nodes = [element("p", words, *(part for key in keys for part in (key, say(". ", "。"))), class_="note")]
    for number in range(min(count, MOST_STRIPS)):
        begin, end = (low + (high - low) * place / count for place in (number, number + 1))
        strip = _TapeStrip(begin, end, height / width, height)
        paths = {"laid": strip.outlines(laid), "hatch": strip.hatch(waste)}
        paths |= {f"line cut {style}": strip.across(own) for style, own in lines.items()}
        drawn = [element("path", d=path, class_=style) for style, path in paths.items() if path]
        nodes.append(element("figure", strip.figure(drawn + strip.labels(laid, numbers), say)))
    if count > MOST_STRIPS:
        words = say(
            "Drawn up to {end:,.0f} mm of {all:,.0f} mm.",
            "绘至 {end:,.0f} mm，共 {all:,.0f} mm。",
            end=strip.end,
            all=high,
        )
        nodes.append(element("p", words, class_="note"))
    return nodes


def _courses(tape: TapeLedger) -> tuple[Floats, Floats]:
    """Return the pairs of lines (n, 4) between which the courses lie, and the lines (k, 2) not cut, drawn square here.

    A line across the tape is given by its station in millimetres and its slope, along over across.
    """
    slopes = {(cut.starting, 0): 1 / math.tan(cut.angle) for cut in tape.cuts}
    slopes |= {(cut.ending, 1): 1 / math.tan(cut.angle) for cut in tape.cuts}
    stations = np.array([[row.station, row.station + row.length] for row in tape.rows]) / MM
    made = np.array([[slopes.get((row.course, end), math.nan) for end in (0, 1)] for row in tape.rows])
    lines = np.stack([stations, np.nan_to_num(made)], axis=2)
    return lines.reshape(-1, 4), lines[np.isnan(made)]


def _waste(laid: Floats, rolls: Floats) -> tuple[Floats, Floats]:
    """Return the pairs of lines (m, 4) between which the tape is waste, and the lines (k, 2) at which a roll begins.

    Args:
        laid: (n, 4) as from `_courses`.
        rolls: (n,) millimetres of tape wasted for a new roll before each course.
    """
    before = np.vstack([np.zeros((1, 2)), laid[:-1, 2:]])
    fresh = rolls > 0.0
    edges = np.where(fresh[:, None], np.column_stack([before[:, 0] + rolls, np.zeros_like(rolls)]), before)
    waste = np.vstack([np.hstack([before, edges])[fresh], np.hstack([edges, laid[:, :2]])])
    return waste, np.vstack([np.zeros((1, 2)), edges[fresh]])


def _cut_lines(cuts: Sequence[CutMade], uncut: Floats, limits: Limits) -> dict[str, Floats]:
    """Return the lines (k, 2) of the cuts by style; `over` are those beyond a limit and the `uncut` ones (j, 2)."""
    lines = np.array([[cut.station / MM, 1 / math.tan(cut.angle)] for cut in cuts]).reshape(-1, 2)
    errors = np.array([[cut.error / MM, cut.blade_error / DEG] for cut in cuts]).reshape(-1, 2)
    kept = np.all(errors <= [limits[CUT].value, limits[BLADE].value], axis=1)
    first = np.array([cut.knife == 1 for cut in cuts], np.bool_)
    return {
        "first": lines[kept & first],
        "second": lines[kept & ~first],
        "over": np.vstack([lines[~kept], uncut]),
    }


@dataclass(frozen=True)
class _TapeStrip:
    """A strip of the tape; its pixels count from its left end, and from the tape's left edge downwards.

    Attributes:
        begin: station of its left end, millimetres.
        end: station of its right end, millimetres.
        scale: pixels per millimetre.
        height: the tape's width in pixels.
    """

    begin: float
    end: float
    scale: float
    height: float

    def figure(self, drawn: Sequence[Element], say: Say) -> Element:
        """Return the strip with its stations below."""
        length = (self.end - self.begin) * self.scale
        tape = element("svg", *drawn, x=px(MARGIN), y=4, width=px(length), height=px(self.height))
        bottom = 4 + self.height
        nodes = [tape, element("rect", x=px(MARGIN), y=4, width=px(length), height=px(self.height), class_="frame")]
        for tick in ticks(self.begin, self.end, max(1, int(length / 80))):
            at = px(MARGIN + (tick - self.begin) * self.scale)
            nodes.append(element("path", d=f"M{at} {px(bottom)}v3", class_="axis"))
            nodes.append(element("text", plain(tick), x=at, y=px(bottom + 14), class_="tick middle"))
        label = say(
            "Tape from {begin:,.0f} to {end:,.0f} mm",
            "带料 {begin:,.0f} 至 {end:,.0f} mm",
            begin=self.begin,
            end=self.end,
        )
        return svg(WIDTH + 2 * MARGIN, bottom + 20, *nodes, label=label)

    def _corners(self, lines: Floats) -> Floats:
        """Return the pixels (n, 2) along the strip where lines (n, 2) meet the tape's left and right edges."""
        middle = (lines[:, :1] - self.begin) * self.scale
        corners: Floats = middle + lines[:, 1:] * self.height / 2 * np.array([1.0, -1.0])
        return corners

    def across(self, lines: Floats) -> str:
        """Return the SVG path of lines (n, 2)."""
        corners = self._corners(lines)
        seen = (np.max(corners, axis=1) >= -4) & (np.min(corners, axis=1) <= WIDTH + 4)
        return "".join(f"M{px(left)} 0L{px(right)} {px(self.height)}" for left, right in corners[seen].tolist())

    def _pieces(self, pieces: Floats) -> Floats:
        """Return the corners (m, 4) of those pieces (n, 4), each between two lines, that show in the strip."""
        corners = np.hstack([self._corners(pieces[:, :2]), self._corners(pieces[:, 2:])])
        seen: Floats = corners[(np.max(corners, axis=1) >= 0) & (np.min(corners, axis=1) <= WIDTH)]
        return seen

    def outlines(self, pieces: Floats) -> str:
        """Return the SVG path round pieces (n, 4) of tape."""
        down = px(self.height)
        return "".join(
            f"M{px(a)} 0L{px(b)} {down}L{px(d)} {down}L{px(c)} 0z" for a, b, c, d in self._pieces(pieces).tolist()
        )

    def hatch(self, pieces: Floats) -> str:
        """Return the SVG path of the lines x + y = c, `HATCH` pixels apart, clipped to pieces (n, 4) of tape."""
        parts = []
        for a, b, c, d in self._pieces(pieces).tolist():
            least, most = max(min(a, b), 0.0), min(max(c, d), WIDTH) + self.height
            sums = np.arange(math.ceil(least / HATCH), math.floor(most / HATCH) + 1) * HATCH
            top, bottom = np.zeros_like(sums), np.full_like(sums, self.height)
            # At y the piece runs from a + (b - a) y / height to c + (d - c) y / height; inside it, slack + rate y >= 0.
            for slack, rate in ((sums - a, -1 - (b - a) / self.height), (c - sums, 1 + (d - c) / self.height)):
                if rate > 0.0:
                    top = np.maximum(top, -slack / rate)
                elif rate < 0.0:
                    bottom = np.minimum(bottom, -slack / rate)
                else:
                    bottom = np.where(slack >= 0.0, bottom, -1.0)
            inside = top < bottom
            ends = np.column_stack([sums - top, top, sums - bottom, bottom])[inside]
            parts += [f"M{px(x)} {px(y)}L{px(u)} {px(v)}" for x, y, u, v in ends.tolist()]
        return "".join(parts)

    def labels(self, laid: Floats, numbers: Sequence[str]) -> list[Element]:
        """Return the course numbers, in the middle of the visible part of each course that has space for its number."""
        lefts = np.maximum((laid[:, 0] - self.begin) * self.scale, 0.0)
        rights = np.minimum((laid[:, 2] - self.begin) * self.scale, (self.end - self.begin) * self.scale)
        space = rights - lefts - [7 * len(number) + 6 for number in numbers]
        return [
            element(
                "text", numbers[i], x=px((lefts[i] + rights[i]) / 2), y=px(self.height / 2 + 4), class_="number middle"
            )
            for i in np.flatnonzero(space > 0.0).tolist()
        ]
