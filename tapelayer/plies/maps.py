"""Maps: what was measured on the courses of a ply, in plan over its mould, for the report's page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from tapelayer.arrays import Floats, Ints
from tapelayer.plies.evidence import PlyEvidence
from tapelayer.plies.failures import place_words
from tapelayer.plies.ribbons import PlanRibbon, ribbons_of
from tapelayer.reporting.drawing import Panel, element, polyline, px, svg
from tapelayer.reporting.map_marks import COLOURS, arrows, colour_bar, foot, number_labels, plan_panel, scale_bar
from tapelayer.reporting.words import ENGLISH, Say, plain
from tapelayer.units import DEG, MM

STYLE = """
.maps { display: flex; flex-wrap: wrap; gap: 8px 4px; }
.maps figure { flex: 0 0 492px; }
.rim { fill: none; stroke: var(--rule); stroke-width: 1px; }
.ply { fill: none; stroke: var(--ink); stroke-width: 1.3px; }
.casing { fill: none; stroke: var(--paper); stroke-width: 3px; }
.strip { fill: var(--tape); stroke: var(--soft); stroke-width: 0.5px; }
.fill.hang { fill: var(--second); } .fill.lap { fill: var(--first); } .fill.bare { stroke: none; }
.outlined { stroke-width: 1px; } .outlined.hang { stroke: none; } .outlined.over { stroke: var(--over); }
.outlined.lap { stroke: var(--first); } .gap { stroke-width: 3.2px; }
"""
# Pixels to the left of a map, right of it for its colours, and below it.
LEFT, RIGHT, BELOW = 12.0, 140.0, 24.0
# Largest sizes of the map of the courses, and of the others, which stand two by two.
LARGE, SMALL = (760.0, 620.0), (492.0 - LEFT - RIGHT, 340.0)
# Values along a ribbon are drawn in cells of this length, pixels, each with its largest one.
CELL = 1.0
# Free room around the tapes, as a share of the larger side.
ROOM = 0.05
# The class of values that are not known, and of those beyond the limit.
OVER, UNKNOWN = COLOURS, COLOURS + 1
STYLES = (*(f"e{colour}" for colour in range(COLOURS)), "over", "bare")


@dataclass(frozen=True, eq=False)
class _Canvas:
    """A plan to draw on.

    Attributes:
        evidence: what is drawn.
        panel: its place.
        scale: pixels per millimetre.
        say: the language.
    """

    evidence: PlyEvidence
    panel: Panel
    scale: float
    say: Say

    @staticmethod
    def of(evidence: PlyEvidence, largest: tuple[float, float], say: Say) -> _Canvas:
        """Return a plan that holds the ply and all tapes, no larger than a width and a height in pixels."""
        bounds = shapely.total_bounds([evidence.plan.region.outline, *evidence.ledger.tapes]).reshape(2, 2)
        room = ROOM * float(np.max(bounds[1] - bounds[0]))
        panel, scale = plan_panel((bounds[0] - room) / MM, (bounds[1] + room) / MM, LEFT, largest)
        return _Canvas(evidence, panel, scale, say)

    def pixels(self, plan: Floats) -> Floats:
        """Return the pixels (n, 2) of points (n, 2) in plan, metres."""
        return np.column_stack([self.panel.across(plan[:, 0] / MM), self.panel.down(plan[:, 1] / MM)])

    def line(self, plan: Floats) -> str:
        """Return the path in tenths of a pixel through points (n, 2) in plan."""
        return polyline(*self.pixels(plan).T)

    def shape(self, shape: BaseGeometry) -> str:
        """Return the path in tenths of a pixel around the polygons of a shape in plan."""
        rings = [
            ring
            for part in shapely.get_parts(shapely.get_parts(shape))
            if part.geom_type == "Polygon"
            for ring in (part.exterior, *part.interiors)
        ]
        return "".join(f"{self.line(shapely.get_coordinates(ring))}z" for ring in rings)

    def path(self, line: str, style: str) -> list[Element]:
        """Return the element of a path in tenths of a pixel; nothing where there is none."""
        if not line:
            return []
        return [element("path", d=line, class_=style, transform="scale(.1)", vector_effect="non-scaling-stroke")]

    def figure(self, title: str, nodes: Iterable[Element], marks: Iterable[Element], caption: str) -> Element:
        """Return a figure: what is drawn in the frame, mould and ply around it, marks beside it, and a caption."""
        panel, outline = self.panel, self.evidence.plan.region.outline
        frame = {"x": px(panel.left), "y": px(panel.top), "width": panel.width, "height": panel.height}
        # A nested drawing shows nothing beyond its frame.
        inner = element(
            "svg",
            *self.path(self._rim(), "rim"),
            *nodes,
            *self.path(self.shape(outline), "casing"),
            *self.path(self.shape(outline), "ply"),
            viewBox=f"{frame['x']} {frame['y']} {panel.width} {panel.height}",
            **frame,
        )
        drawn = [
            element("text", title, x=px(panel.left), y=px(panel.top - 6), class_="heading"),
            inner,
            element("rect", class_="frame", **frame),
            *marks,
            *self._axes(),
            scale_bar(panel, self.scale),
        ]
        drawing = svg(panel.left + panel.width + RIGHT, foot(panel) + BELOW, *drawn, label=title)
        return element("figure", drawing, element("figcaption", caption))

    def ring(self, plan: Floats) -> Element:
        """Return a ring round a point (2,) in plan."""
        across, down = self.pixels(plan[None])[0]
        return element("circle", cx=px(across), cy=px(down), r=8, class_="ring")

    def legend(self, words: tuple[str, str], span: tuple[float, float], beyond: Mapping[str, str]) -> list[Element]:
        """Return the colours with their values, up to a limit."""
        return colour_bar(
            self.panel.left + self.panel.width + 24, self.panel.top, words, span, beyond=beyond, bound=True
        )

    def _rim(self) -> str:
        """Return the path along the mould's edge: the edges that one facet alone has."""
        region = self.evidence.plan.region
        facets = region.mould.facets[region.facets]
        edges = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        lone, counts = np.unique(edges, axis=0, return_counts=True)
        ends = self.pixels(region.plane.into(region.mould.vertices)[:, :2])[lone[counts == 1]]
        low, high = np.array([self.panel.left, self.panel.top]), np.array([self.panel.width, self.panel.height])
        seen = np.all((ends.max(axis=1) >= low) & (ends.min(axis=1) <= low + high), axis=1)
        points = np.insert(ends[seen].reshape(-1, 2), np.arange(2, 2 * np.sum(seen), 2), np.nan, axis=0)
        return polyline(*points.T)

    def _axes(self) -> Iterator[Element]:
        """Yield the mould's axes as they lie in plan."""
        axes = self.evidence.plan.region.plane.turned_into(np.eye(3))
        left, down = self.panel.left + self.panel.width + 46, foot(self.panel) - 52
        for name, (x, y, _) in zip("xyz", axes, strict=True):
            if np.hypot(x, y) > 0.3:
                tip = left + 20 * x, down - 20 * y
                yield element("path", d=f"M{px(left)} {px(down)}L{px(tip[0])} {px(tip[1])}", class_="scale")
                yield element("text", name, x=px(left + 28 * x), y=px(down - 28 * y + 4), class_="tick middle")


def maps(evidence: PlyEvidence, say: Say = ENGLISH) -> list[Element]:
    """Return the maps of a ply: its courses, and what was measured on them."""
    if not evidence.plan.pieces:
        return [element("p", say("There are no courses.", "没有道次。"), class_="note")]
    ribbons = ribbons_of(evidence)
    small = _Canvas.of(evidence, SMALL, say)
    note = say(
        "Seen from outside, square to the ply's plane, to scale; x, y and z are the mould's. Grey: the mould's edge. "
        "Black: the ply. Rings: the largest values. The colours end at the limits.",
        "自外侧垂直于铺层平面所见，按比例；x、y、z 为模具坐标。灰线：模具边缘。黑线：铺层边界。圆圈：最大值处。"
        "色标止于限值。",
    )
    figures = [_gap_map(small), *_measured(small, ribbons), _residual_map(small), _area_map(small)]
    return [
        _course_map(_Canvas.of(evidence, LARGE, say), ribbons),
        element("p", note, class_="note"),
        element("div", *figures, class_="maps"),
    ]


def _course_map(canvas: _Canvas, ribbons: Sequence[PlanRibbon]) -> Element:
    """Return the map of the courses with their numbers and directions."""
    say, plan = canvas.say, canvas.evidence.plan
    nodes = canvas.path("".join(canvas.shape(tape) for tape in canvas.evidence.ledger.tapes), "strip")
    paths = []
    for ribbon in ribbons:
        centre = plan.family.strips[ribbon.piece.strip].at(ribbon.arcs)
        paths.append(canvas.pixels(centre[::-1] if ribbon.piece.backwards else centre))
    marks = [*arrows(paths), *number_labels([ribbon.number for ribbon in ribbons], paths)]
    seed = canvas.pixels(plan.region.seed[None])[0]
    marks.append(element("circle", cx=px(seed[0]), cy=px(seed[1]), r=3.5, class_="arrow"))
    caption = say(
        "{count} courses, {length:.1f} m of tape {width:g} mm wide. Arrows: travel. Dot: the seed.",
        "共 {count} 道，带料 {length:.1f} m，宽 {width:g} mm。箭头：行进方向。圆点：种子点。",
        count=len(ribbons),
        length=canvas.evidence.laid_length,
        width=plan.ply.tape.width_mm,
    )
    return canvas.figure(say("courses", "道次"), nodes, marks, caption)


def _measured(canvas: _Canvas, ribbons: Sequence[PlanRibbon]) -> Iterator[Element]:
    """Yield the maps of strain, lift and angle."""
    say, limits = canvas.say, canvas.evidence.limits
    shown: tuple[tuple[str, str, str, Callable[[PlanRibbon], Floats]], ...] = (
        ("max_strain_percent", say("strain", "应变"), "%", lambda ribbon: 100.0 * ribbon.strains),
        ("max_lift_mm", say("lift", "压辊离面"), "mm", lambda ribbon: ribbon.lifts / MM),
        ("max_angle_deviation_deg", say("off the angle", "角度偏差"), "deg", lambda ribbon: ribbon.angles / DEG),
    )
    for key, words, unit, values in shown:
        yield _ribbon_map(
            canvas, ribbons, [np.abs(values(ribbon)) for ribbon in ribbons], words, unit, limits[key].value
        )


def _ribbon_map(
    canvas: _Canvas, ribbons: Sequence[PlanRibbon], values: Sequence[Floats], words: str, unit: str, limit: float
) -> Element:
    """Return the map of values (n,) of each ribbon, not negative, up to a limit."""
    say, parts = canvas.say, [""] * len(STYLES)
    for ribbon, of_ribbon in zip(ribbons, values, strict=True):
        cells = np.unique(np.floor((ribbon.arcs - ribbon.arcs[0]) / MM * canvas.scale / CELL), return_index=True)[1]
        rows = np.unique(np.append(cells, len(ribbon.arcs) - 1))
        # A cell has the largest value of its two ends and of all between.
        worst_of = np.fmax(np.fmax.reduceat(of_ribbon, rows[:-1]), of_ribbon[rows[1:]])
        classes = _classes(worst_of, 0.0, limit)
        for run in np.split(np.arange(len(classes)), np.flatnonzero(np.diff(classes)) + 1):
            if len(run):
                drawn = rows[run[0] : run[-1] + 2]
                around = np.vstack([ribbon.right[drawn], ribbon.left[drawn][::-1]])
                parts[classes[run[0]]] += f"{canvas.line(around)}z"
    nodes = [node for part, style in zip(parts, STYLES, strict=True) for node in canvas.path(part, f"fill {style}")]
    largest = [float(np.nanmax(each, initial=0.0)) for each in values]
    worst = int(np.argmax(largest))
    sample = int(np.nanargmax(np.append(values[worst], 0.0))) % len(values[worst])
    spot = (ribbons[worst].left[sample] + ribbons[worst].right[sample]) / 2.0
    beyond = {"over": say("beyond the limit", "超出限值")} if largest[worst] > limit else {}
    if parts[UNKNOWN]:
        beyond["bare"] = say("not in the ply", "铺层之外")
    caption = say(
        "{words}: at most {value:.4g} {unit}, course {course}, at {at}; limit {limit:g}",
        "{words}：最大 {value:.4g} {unit}，道次 {course}，位于 {at}；限值 {limit:g}",
        words=words,
        value=largest[worst],
        unit=unit,
        course=ribbons[worst].number,
        at=place_words(canvas.evidence.at(spot)),
        limit=limit,
    )
    marks = [canvas.ring(spot), *canvas.legend((words, unit), (0.0, limit), beyond)]
    return canvas.figure(f"{words}, {unit}", nodes, marks, caption)


def _gap_map(canvas: _Canvas) -> Element:
    """Return the map of gaps and overlaps between neighbours."""
    say, gaps, limits = canvas.say, canvas.evidence.gaps, canvas.evidence.limits
    title = say("gap between neighbours", "相邻道次间隙")
    tapes = canvas.path("".join(canvas.shape(tape) for tape in canvas.evidence.ledger.tapes), "strip")
    low, high = -limits["max_overlap_mm"].value, limits["max_gap_mm"].value
    # Limits that leave nothing between them still have colours.
    low, high = (low, high) if high > low else (high - 1.0, high)
    if not len(gaps.widths):
        return canvas.figure(title, tapes, [], say("no neighbours", "无相邻道次"))
    widths = gaps.widths / MM
    classes = _classes(widths, low, high)
    under = len(STYLES)
    classes[widths < low - 0.001] = under
    pairs = np.column_stack([gaps.rights, gaps.lefts])
    breaks = np.flatnonzero(np.any(np.diff(pairs, axis=0) != 0, axis=1) | (np.diff(classes) != 0)) + 1
    same = np.append(np.all(np.diff(pairs, axis=0) == 0, axis=1), False)
    parts = [""] * (under + 1)
    for run in np.split(np.arange(len(classes)), breaks):
        # A run goes on to the first sample of the next one of the same pair.
        last = run[-1] + 2 if same[run[-1]] else run[-1] + 1
        parts[classes[run[0]]] += canvas.line(gaps.plan[run[0] : last])
    styles = (*STYLES, "under")
    nodes = [*tapes]
    for part, style in zip(parts, styles, strict=True):
        nodes += canvas.path(part, f"line gap {style}")
    widest, tightest = int(np.argmax(widths)), int(np.argmin(widths))
    beyond = {}
    if parts[OVER]:
        beyond["over"] = say("beyond the limit", "超出限值")
    if parts[under]:
        beyond["under"] = say("overlap beyond it", "重叠超限")
    caption = say(
        "gaps from {least:.3f} mm at {narrow} to {most:.3f} mm at {wide}; allowed {low:g} to {high:g}",
        "间隙自 {least:.3f} mm（{narrow}）至 {most:.3f} mm（{wide}）；允许 {low:g} 至 {high:g}",
        least=float(widths[tightest]),
        narrow=place_words(canvas.evidence.at(gaps.plan[tightest])),
        most=float(widths[widest]),
        wide=place_words(canvas.evidence.at(gaps.plan[widest])),
        low=-limits["max_overlap_mm"].value,
        high=high,
    )
    marks = [canvas.ring(gaps.plan[widest]), *canvas.legend((say("gap", "间隙"), "mm"), (low, high), beyond)]
    return canvas.figure(f"{title}, mm", nodes, marks, caption)


def _residual_map(canvas: _Canvas) -> Element:
    """Return the map of the smooth surface off the corners of the mould's facets, in cells with the worst of each."""
    say, mould = canvas.say, canvas.evidence.plan.mould
    limit = canvas.evidence.limits["surface_residual_mm"].value
    residuals, plan = np.abs(mould.residuals[mould.inside]) / MM, mould.corners[mould.inside][:, :2]
    title = say("surface residual", "曲面残差")
    if not len(residuals):
        return canvas.figure(title, [], [], say("no corner of a facet lies in the ply", "铺层内没有三角面的顶点"))
    # Cells about as large as the corners are apart.
    size = max(3.0, 1.3 * float(np.sqrt(canvas.panel.width * canvas.panel.height / len(residuals))))
    size = min(size, 14.0)
    cells = np.floor(canvas.pixels(plan) / size).astype(np.int64)
    places, groups = np.unique(cells, axis=0, return_inverse=True)
    worst = np.zeros(len(places))
    np.maximum.at(worst, groups.ravel(), residuals)
    classes = _classes(worst, 0.0, limit)
    nodes = []
    for colour, style in enumerate(STYLES):
        chosen = places[classes == colour] * size
        squares = "".join(
            f"M{px(10 * x)} {px(10 * y)}h{px(10 * size)}v{px(10 * size)}h-{px(10 * size)}z" for x, y in chosen
        )
        nodes += canvas.path(squares, f"fill {style}")
    spot = plan[int(np.argmax(residuals))]
    caption = say(
        "{words}: at most {value:.4f} mm at {at}; limit {limit:g}. Squares: corners of facets.",
        "{words}：最大 {value:.4f} mm，位于 {at}；限值 {limit:g}。方块：三角面顶点。",
        words=title,
        value=float(np.max(residuals)),
        at=place_words(canvas.evidence.at(spot)),
        limit=limit,
    )
    marks = [canvas.ring(spot), *canvas.legend((say("residual", "残差"), "mm"), (0.0, limit), {})]
    return canvas.figure(f"{title}, mm", nodes, marks, caption)


def _area_map(canvas: _Canvas) -> Element:
    """Return the map of what is open, doubled or beyond the boundary."""
    say, ledger = canvas.say, canvas.evidence.ledger
    shown = (
        ("hang", say("outside", "铺层之外"), [ledger.overhangs]),
        ("over", say("open", "未覆盖"), [ledger.gaps]),
        ("lap", say("doubled", "重叠"), list(ledger.overlaps)),
    )
    nodes = canvas.path("".join(canvas.shape(tape) for tape in ledger.tapes), "strip")
    marks, left, down = [], canvas.panel.left + canvas.panel.width + 24, canvas.panel.top
    for style, words, shapes in shown:
        nodes += canvas.path("".join(canvas.shape(shape) for shape in shapes), f"fill outlined {style}")
        marks.append(element("rect", x=px(left), y=px(down), width=16, height=14, class_=f"fill {style}"))
        marks.append(element("text", words, x=px(left + 21), y=px(down + 10), class_="tick"))
        down += 20
    caption = say(
        "outside the ply {hang} cm2, open {gap} cm2, doubled {lap} cm2",
        "铺层之外 {hang} cm2，未覆盖 {gap} cm2，重叠 {lap} cm2",
        hang=plain(round(ledger.overhang * 1e4, 1)),
        gap=plain(round(ledger.gap * 1e4, 1)),
        lap=plain(round(ledger.overlap * 1e4, 1)),
    )
    return canvas.figure(say("overhang, gaps and overlaps", "超出、间隙与重叠"), nodes, marks, caption)


def _classes(values: Floats, low: float, high: float) -> Ints:
    """Return the colour (n,) of each value from low to high, `OVER` above and `UNKNOWN` for NaN.

    Examples:
        >>> _classes(np.array([-1.0, 0.0, 0.95, 1.0, 1.1, np.nan]), 0.0, 1.0).tolist()
        [0, 0, 9, 9, 10, 11]
    """
    shares = np.nan_to_num((values - low) / (high - low), nan=0.0)
    colours = np.clip(np.floor(shares * COLOURS).astype(np.int64), 0, COLOURS - 1)
    # What keeps a limit but for rounding keeps it.
    colours = np.where(shares > 1.0 + 1e-6, OVER, colours)
    classes: Ints = np.where(np.isnan(values), UNKNOWN, colours)
    return classes
