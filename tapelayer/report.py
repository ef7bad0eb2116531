"""Report: the evidence as numbers (JSON), as a page to print and sign (HTML with plots), and as a table.

The page is one file that asks the network for nothing. It is built as an element tree, so that every name from a file
is escaped by the serialiser and not by hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
from rich.table import Table
from rich.text import Text

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.evidence import AxisUse, Evidence, Samples
from tapelayer.setup import DEG, MM, Setup
from tapelayer.trajectory import Kind, Trajectory

# Failures in the page, and courses with plots of their own; beyond them the page gives a count.
SHOWN_FAILURES = 200
SHOWN_COURSES = 40
# Cells of the plan view that are coloured by their largest error; a cell is never smaller than this, in pixels.
PLAN_CELLS = 40_000
LEAST_CELL = 3.0
PLAN_WIDTH, PLAN_HEIGHT = 760.0, 560.0
COLOURS = 10

# Quantities of the report in the order of the page: key, words, unit, format.
QUANTITIES = (
    ("max_position_error_mm", "position error", "mm", "z.4f"),
    ("max_chord_error_mm", "chord error", "mm", "z.4f"),
    ("max_tape_error_mm", "tape error", "mm", "z.4f"),
    ("max_roller_tilt_deg", "roller tilt", "deg", "z.4f"),
    ("max_edge_lift_mm", "edge lift", "mm", "z.4f"),
    ("max_heading_error_deg", "heading error", "deg", "z.4f"),
    ("max_pitch_deg", "pitch on the roller", "deg", "z.3f"),
    ("max_wrap_mm", "wrap in a course", "mm", "z.3f"),
    ("max_roller_offset_mm", "roller offset", "mm", "z.4f"),
    ("taken_back_mm", "tape taken back", "mm", "z.3f"),
    ("least_link_clearance_mm", "link clearance", "mm", "z.2f"),
    ("max_forward_disagreement_m", "forward disagreement", "m", ".1e"),
)
FACTS = (
    ("courses", "courses", "", ",d"),
    ("points", "points", "", ",d"),
    ("blocks", "blocks", "", ",d"),
    ("laid_length_m", "laid length", "m", "z,.3f"),
    ("duration_s", "duration", "s", "z,.1f"),
)
# What has no limit of its own is not drawn beside one.
LIMITED = ("max_position_error_mm", "max_tape_error_mm", "max_roller_tilt_deg", "max_heading_error_deg")


def numbers(evidence: Evidence, program_sha256: str) -> dict[str, Any]:
    """The report as plain values for JSON, millimetres and degrees; docs/report.md describes every key.

    What was not measured (no samples, or a value that is no finite number) is None, and the report is not passed.

    Args:
        evidence: what verification measured.
        program_sha256: SHA-256 of the program's bytes, hexadecimal.
    """
    samples = evidence.samples
    positions = samples.position_errors
    tilt = _largest(samples.tilts)
    measured = {
        "laid_length_m": evidence.laid_length,
        "duration_s": evidence.duration,
        "max_position_error_mm": _largest(positions) / MM,
        "max_chord_error_mm": _largest(positions[~samples.block_ends]) / MM,
        "max_roller_tilt_deg": tilt / DEG,
        "max_edge_lift_mm": evidence.tape_width / 2 * math.sin(tilt) / MM,
        "max_heading_error_deg": _largest(samples.heading_errors) / DEG,
        "max_pitch_deg": _largest(samples.pitches) / DEG,
        "max_wrap_mm": evidence.roller_radius * _largest_spread(samples.wraps, samples.courses) / MM,
        "max_roller_offset_mm": _largest(samples.offsets) / MM,
        "max_tape_error_mm": _largest(samples.tape_errors) / MM,
        "taken_back_mm": evidence.tape_taken_back / MM,
        "least_link_clearance_mm": evidence.least_link_clearance / MM,
        "max_forward_disagreement_m": evidence.forward_disagreement,
    }
    failures = [
        {
            "course": failure.course,
            "point": failure.point,
            "what": failure.what,
            "value": _number(failure.value),
            "limit": _number(failure.limit),
            **({"line": failure.line} if failure.line else {}),
        }
        for failure in evidence.failures
    ]
    told = {failure.what for failure in evidence.failures}
    # A failure's name has no "max" or "least": a value that verification refused already is not refused twice.
    lost = [
        key.removeprefix("max_").removeprefix("least_")
        for key, value in measured.items()
        if not math.isfinite(value) and not _no_link(key, value)
    ]
    lost += [what for axis in evidence.axes for what in _unmeasured(axis)]
    failures += [
        {"course": 0, "point": 0, "what": what, "value": None, "limit": None} for what in lost if what not in told
    ]
    return {
        "version": version("tapelayer"),
        "courses": evidence.courses,
        "points": evidence.points,
        "blocks": evidence.blocks,
        **{key: _number(value) for key, value in measured.items()},
        "program_sha256": program_sha256,
        "axes": {axis.name: _axis(axis) for axis in evidence.axes},
        "passed": not failures,
        "failures": failures,
    }


def summary(report: dict[str, Any]) -> Table:
    """Table for a terminal of what `numbers` gives."""
    title = Text("passed", "bold green") if report["passed"] else Text("FAILED", "bold red")
    table = Table(title=Text("Verification: ").append_text(title), title_justify="left", title_style="")
    table.add_column("quantity")
    for heading in ("value", "limit", "top speed /s"):
        table.add_column(heading, justify="right")
    for key, words, unit, form in FACTS:
        table.add_row(words, _shown(report[key], unit, form))
    table.add_section()
    for key, words, unit, form in QUANTITIES:
        table.add_row(words, _shown(report[key], unit, form, _absent(key)))
    table.add_section()
    for name, axis in report["axes"].items():
        table.add_row(
            Text(f"axis {name}, {axis['unit']}"),
            f"{_shown(axis['min'], '', 'z.2f')} to {_shown(axis['max'], '', 'z.2f')}",
            f"{_plain(axis['lower'])} to {_plain(axis['upper'])}",
            f"{_shown(axis['max_speed'], '', 'z.1f')} of {_plain(axis['speed_limit'])}",
        )
    if report["failures"]:
        table.add_section()
        table.add_row("failures", Text(f"{len(report['failures']):,}", "bold red"), "0")
    return table


def html(evidence: Evidence, trajectory: Trajectory, report: dict[str, Any], setup: Setup, title: str) -> str:
    """The report as one HTML page with plots, light and dark, to be printed.

    Args:
        evidence: what verification measured.
        trajectory: the program that was judged.
        report: `numbers` of the evidence.
        setup: the job's values, for the limits.
        title: of the report, as the program is called.
    """
    # A file name may hold bytes that are no text; they are shown as escapes.
    name = title.encode(errors="backslashreplace").decode()
    body = [
        _node("header", _node("h1", "Verification of ", _node("span", name, class_="name")), _verdict(report, setup)),
        _facts(report, setup),
        *_failures(report["failures"]),
        _node("h2", "Largest errors"),
        _quantities(report, setup),
        _node("h2", "Axes"),
        _axes_table(evidence.axes, report),
        _signatures(),
        _node("h2", "Plan view"),
        *_plan_view(evidence, setup),
        _node("h2", "Errors along the courses"),
        *_course_plots(evidence, setup),
        _node("h2", "Axis positions and speeds"),
        *_axis_plots(evidence.axes, trajectory),
    ]
    page = _node(
        "html",
        _node(
            "head",
            _node("meta", charset="utf-8"),
            _node(
                "meta",
                http_equiv="Content-Security-Policy",
                content="default-src 'none'; style-src 'unsafe-inline'",
            ),
            _node("meta", name="viewport", content="width=device-width, initial-scale=1"),
            _node("title", f"Verification of {name}"),
            _node("style", STYLE),
        ),
        _node("body", *body),
        lang="en",
    )
    return "<!DOCTYPE html>\n" + tostring(page, encoding="unicode", method="html") + "\n"


def extremes(x: Floats, y: Floats, columns: int) -> Ints:
    """Indices (m,) of the rows that a plot `columns` pixels wide cannot do without.

    In each pixel column the first, the last, the least and the greatest value are kept, and the first that is not
    finite: the line through them covers the same pixels as the line through all (M4, Jugel et al., VLDB 2014).

    Args:
        x: (n,) finite; rows that follow each other in one column are one group.
        y: (n,) any unit.
        columns: pixel columns over the range of x.
    """
    if not len(x):
        return np.zeros(0, np.int64)
    low, high = float(np.min(x)), float(np.max(x))
    place = (x - low) / (high - low) * columns if high > low else np.zeros(len(x))
    column = np.minimum(place.astype(np.int64), columns - 1)
    firsts = np.flatnonzero(np.append(True, column[1:] != column[:-1]))
    group = np.cumsum(np.append(False, column[1:] != column[:-1]))
    values = np.where(np.isfinite(y), y, np.nan)
    kept = [firsts, np.append(firsts[1:], len(x)) - 1]
    for mask in (
        values == np.fmin.reduceat(values, firsts)[group],
        values == np.fmax.reduceat(values, firsts)[group],
        np.isnan(values),
    ):
        found = np.flatnonzero(mask)
        kept.append(found[np.append(True, np.diff(group[found]) > 0)[: len(found)]])
    return np.unique(np.concatenate(kept))


def _largest(values: Floats) -> float:
    """Largest magnitude; NaN where there is no value or one of them is not finite."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest if len(values) and math.isfinite(largest) else math.nan


def _largest_spread(values: Floats, courses: Ints) -> float:
    """Largest difference of two values (n,) within one course; NaN where there is none or one is NaN."""
    if not len(values):
        return math.nan
    starts = _starts(courses)
    return float(np.max(np.maximum.reduceat(values, starts) - np.minimum.reduceat(values, starts)))


def _starts(courses: Ints) -> Ints:
    """First row of each course."""
    return np.flatnonzero(np.append(True, np.diff(courses) != 0))[: len(courses)]


def _number(value: float) -> float | None:
    """The value for JSON, which has no NaN and no infinity."""
    # Adding 0 takes the sign off a zero.
    return float(value) + 0.0 if math.isfinite(value) else None


def _no_link(key: str, value: float) -> bool:
    """Whether the head never goes from course to course, so that there is no clearance to measure."""
    return key == "least_link_clearance_mm" and value == math.inf


def _unit(axis: AxisUse) -> tuple[float, str]:
    return (1 / DEG, "deg") if axis.revolute else (1 / MM, "mm")


def _axis(axis: AxisUse) -> dict[str, Any]:
    scale, unit = _unit(axis)
    values = {
        "min": axis.least,
        "max": axis.greatest,
        "lower": axis.lower,
        "upper": axis.upper,
        "margin": axis.margin,
        "max_speed": axis.top_speed,
        "speed_limit": axis.speed_limit,
    }
    return {"unit": unit, **{key: _number(value * scale) for key, value in values.items()}}


def _axis_failures(axis: AxisUse) -> tuple[str, str]:
    """How failures of an axis's travel and of its speed are called."""
    unit = _unit(axis)[1]
    return f"axis_{axis.name}_{unit}", f"axis_{axis.name}_speed_{unit}_per_s"


def _unmeasured(axis: AxisUse) -> list[str]:
    travel, speed = _axis_failures(axis)
    found = [] if math.isfinite(axis.least) and math.isfinite(axis.greatest) else [travel]
    return found + ([] if math.isfinite(axis.top_speed) else [speed])


def _shown(value: float | None, unit: str, form: str, absent: str = "not measured") -> str:
    return absent if value is None else f"{value:{form}} {unit}".rstrip()


def _absent(key: str) -> str:
    return "no link" if key == "least_link_clearance_mm" else "not measured"


def _plain(value: float) -> str:
    """A limit or a tick in the fewest digits, thousands apart."""
    return f"{value:z,.7g}"


def _worded(what: str) -> tuple[str, str]:
    """Words and unit of a quantity's key."""
    for ending, unit in (
        ("_mm_per_s", "mm/s"),
        ("_deg_per_s", "deg/s"),
        ("_mm", "mm"),
        ("_deg", "deg"),
        ("_m", "m"),
        ("_s", "s"),
    ):
        if what.endswith(ending):
            return what.removesuffix(ending).replace("_", " "), unit
    return what.replace("_", " "), ""


def _limits(setup: Setup) -> dict[str, tuple[float, bool]]:
    """Limit of each limited quantity, and whether it is judged: the published form's pose only where the setup says."""
    limits = setup.verification
    published = setup.process.kinematics == "published"
    free = {"max_roller_tilt_deg", "max_heading_error_deg"} - limits.model_fields_set if published else set()
    return {key: (getattr(limits, key), key not in free) for key in LIMITED}


def _node(tag: str, *content: Element | str, **attributes: object) -> Element:
    """An element; an attribute's underscores are hyphens, and one at its end keeps it off Python's words."""
    node = Element(tag, {name.rstrip("_").replace("_", "-"): str(value) for name, value in attributes.items()})
    for part in content:
        if isinstance(part, Element):
            node.append(part)
        elif len(node):
            node[-1].tail = (node[-1].tail or "") + part
        else:
            node.text = (node.text or "") + part
    return node


def _verdict(report: dict[str, Any], setup: Setup) -> Element:
    """The verdict in one line; what is not judged and beyond its limit is said in it."""
    failures = report["failures"]
    if failures:
        words = f"FAILED: {len(failures):,} failure{'s' if len(failures) > 1 else ''}, the first: {_told(failures[0])}"
        return _node("p", words, class_="verdict failed")
    limits = _limits(setup)
    kept = "every limit" if all(judged for _, judged in limits.values()) else "every limit that is judged"
    words = f"PASSED: {report['blocks']:,} blocks over {report['courses']:,} courses keep {kept}"
    words += f"; position error {_shown(report['max_position_error_mm'], 'mm', 'z.4f')}"
    beyond = [
        f"{name} {_shown(report[key], unit, form)}"
        for key, name, unit, form in QUANTITIES
        if key in limits and not limits[key][1] and not report[key] <= limits[key][0]
    ]
    if not beyond:
        return _node("p", words, class_="verdict passed")
    return _node("p", f"{words}. NOT JUDGED: {', '.join(beyond)}", class_="verdict unjudged")


def _told(failure: dict[str, Any]) -> str:
    words, unit = _worded(failure["what"])
    place = "".join(f"{key} {failure[key]} " for key in ("course", "point") if failure[key])
    if failure["value"] is None:
        return f"{place}{words} has no finite value"
    limit = "" if failure["limit"] is None else f", limit {failure['limit']:.6g} {unit}"
    return f"{place}{words} is {failure['value']:.6g} {unit}".rstrip() + limit.rstrip()


def _table(headings: Sequence[str], rows: Iterable[Sequence[Element | str]], **attributes: object) -> Element:
    return _node(
        "table",
        _node("thead", _node("tr", *(_node("th", heading, scope="col") for heading in headings))),
        _node("tbody", *(_node("tr", *(_node("td", cell) for cell in row)) for row in rows)),
        **attributes,
    )


def _facts(report: dict[str, Any], setup: Setup) -> Element:
    facts = [(words, _shown(report[key], unit, form)) for key, words, unit, form in FACTS]
    facts += [
        ("kinematics", setup.process.kinematics),
        ("controller", setup.output.controller.encode(errors="backslashreplace").decode()),
        ("tapelayer", report["version"]),
        ("SHA-256 of the program", report["program_sha256"]),
    ]
    return _node("dl", *(_node("div", _node("dt", words), _node("dd", value)) for words, value in facts))


def _failures(failures: Sequence[dict[str, Any]]) -> list[Element]:
    if not failures:
        return []
    rows = []
    for failure in failures[:SHOWN_FAILURES]:
        words, unit = _worded(failure["what"])
        places = [str(failure.get(key) or "") for key in ("course", "point", "line")]
        limit = "" if failure["limit"] is None else f"{failure['limit']:.6g} {unit}"
        rows.append([*places, words, _shown(failure["value"], unit, ".6g", "no finite value"), limit])
    nodes = [
        _node("h2", "Failures"),
        _table(("course", "point", "line", "what", "found", "limit"), rows, class_="failures"),
    ]
    more = len(failures) - SHOWN_FAILURES
    if more > 0:
        nodes.append(_node("p", f"and {more:,} more failure{'s' if more > 1 else ''}", class_="note"))
    return nodes


def _quantities(report: dict[str, Any], setup: Setup) -> Element:
    limits = _limits(setup)
    rows: list[list[Element | str]] = []
    for key, words, unit, form in QUANTITIES:
        value = report[key]
        row: list[Element | str] = [words, _shown(value, "", form, _absent(key)), unit]
        if key in limits:
            limit, judged = limits[key]
            share = "" if value is None else f"{value / limit:,.0%}"
            bar = _bar(0.0, value, 0.0, limit, value is None or value > limit)
            row += [_plain(limit), share if judged else f"{share}, not judged", bar]
        else:
            row += ["at least 0" if key == "least_link_clearance_mm" else "", "", ""]
        rows.append(row)
    return _table(("quantity", "found", "", "limit", "of limit", ""), rows, class_="numbers")


def _axes_table(axes: Sequence[AxisUse], report: dict[str, Any]) -> Element:
    # A speed may exceed its limit by the last digit of a feed word: what is red is verification's to say.
    failed = {failure["what"] for failure in report["failures"]}
    rows: list[list[Element | str]] = []
    for axis in axes:
        found = report["axes"][axis.name]
        travel, speed = _axis_failures(axis)
        rows.append(
            [
                axis.name,
                found["unit"],
                *(_shown(found[key], "", "z,.2f") for key in ("min", "max")),
                f"{_plain(found['lower'])} to {_plain(found['upper'])}",
                _shown(found["margin"], "", "z,.2f"),
                _bar(found["min"], found["max"], found["lower"], found["upper"], travel in failed),
                _shown(found["max_speed"], "", "z,.2f"),
                _plain(found["speed_limit"]),
                _bar(0.0, found["max_speed"], 0.0, found["speed_limit"], speed in failed),
            ]
        )
    headings = ("axis", "", "least", "greatest", "travel", "margin", "", "top speed /s", "limit /s", "")
    return _table(headings, rows, class_="axes")


def _bar(begin: float | None, end: float | None, low: float, high: float, failed: bool) -> Element:
    """A range within its bounds as a small bar, red where it failed."""
    width = 90.0
    svg = _svg(width, 9, _node("rect", class_="track", x=0, y=1.5, width=width, height=6))
    if begin is not None and end is not None:
        left, right = (min(max((value - low) / (high - low), 0.0), 1.0) * width for value in (begin, end))
        left = min(left, width - 1)
        style = "used beyond" if failed else "used"
        svg.append(_node("rect", class_=style, x=_px(left), y=1.5, width=_px(max(right - left, 1.0)), height=6))
    svg.set("class", "bar")
    return svg


def _signatures() -> Element:
    fields = (_node("div", words) for words in ("Prepared by", "Checked by", "Released by", "Date"))
    return _node("footer", *fields)


@dataclass(frozen=True, eq=False)
class _Curve:
    """A line of a plot.

    Attributes:
        style: CSS class.
        x: (n,) finite, in the plot's unit.
        y: (n,) in the plot's unit; a value that is not finite is a gap.
    """

    style: str
    x: Floats
    y: Floats


@dataclass(frozen=True)
class _Panel:
    """The place and ranges of one plot in its figure, pixels and the plot's units.

    Attributes:
        left: of the plot's area.
        top: of the plot's area.
        width: of the plot's area.
        height: of the plot's area.
        x: lowest and highest.
        y: lowest and highest.
    """

    left: float
    top: float
    width: int
    height: int
    x: tuple[float, float]
    y: tuple[float, float]

    def across(self, x: Floats | float) -> Any:
        """Pixels from the figure's left edge."""
        return self.left + (x - self.x[0]) * (self.width / (self.x[1] - self.x[0]))

    def down(self, y: Floats | float) -> Any:
        """Pixels from the figure's top edge."""
        return self.top + (self.y[1] - y) * (self.height / (self.y[1] - self.y[0]))

    def drawn(
        self, heading: Element, curves: Sequence[_Curve], limits: Sequence[float], judged: bool = True
    ) -> list[Element]:
        """Elements of the plot: frame, ticks, limits with their values, lines."""
        right, bottom = self.left + self.width, self.top + self.height
        heading.attrib.update(x=_px(self.left), y=_px(self.top - 5))
        nodes = [heading]
        for tick in _ticks(*self.x, max(2, self.width // 56)):
            at = _px(self.across(tick))
            nodes.append(_node("path", d=f"M{at} {_px(bottom)}v3", class_="axis"))
            nodes.append(_node("text", _plain(tick), x=at, y=_px(bottom + 14), class_="tick middle"))
        taken = [self.down(limit) for limit in limits]
        for tick in _ticks(*self.y, min(max(3, self.height // 26), 10)):
            at = self.down(tick)
            nodes.append(_node("path", d=f"M{_px(self.left)} {_px(at)}h{self.width}", class_="grid"))
            if all(abs(at - other) > 11 for other in taken):
                nodes.append(_node("text", _plain(tick), x=_px(self.left - 4), y=_px(at + 4), class_="tick end"))
        nodes.append(
            _node("rect", x=_px(self.left), y=_px(self.top), width=self.width, height=self.height, class_="frame")
        )
        last = -math.inf
        for limit, at in sorted(zip(limits, taken, strict=True), reverse=True):
            style = "limit" if judged else "limit free"
            nodes.append(_node("path", d=f"M{_px(self.left)} {_px(at)}H{_px(right)}", class_=style))
            if at - last > 11:
                style = "tick end bound" if judged else "tick end"
                nodes.append(_node("text", _plain(limit), x=_px(self.left - 4), y=_px(at + 4), class_=style))
                last = at
        for curve in curves:
            kept = extremes(curve.x, curve.y, self.width)
            line = _line(self.across(curve.x[kept]), self.down(curve.y[kept]))
            nodes.append(_node("path", d=line, transform="scale(.1)", class_=f"line {curve.style}"))
        return nodes


def _range(curves: Sequence[_Curve], limits: Sequence[float]) -> tuple[float, float]:
    """Lowest and highest y of the curves and the limits, with room to see a limit that is not touched."""
    values = [*limits]
    for curve in curves:
        finite = curve.y[np.isfinite(curve.y)]
        values += [float(np.min(finite)), float(np.max(finite))] if len(finite) else []
    low, high = min(values), max(values)
    room = 0.08 * (high - low) or 1.0
    return low - room, high + room


def _span(values: Floats) -> tuple[float, float]:
    """Lowest and highest of finite values (n,), never equal."""
    if not len(values):
        return 0.0, 1.0
    low, high = float(np.min(values)), float(np.max(values))
    return low, high if high > low else low + 1.0


def _ticks(low: float, high: float, count: int) -> list[float]:
    """Round values of step 1, 2 or 5 times a power of ten, at most about `count` of them."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= rough * (1 - 1e-9))
    return [i * step for i in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def _px(value: float) -> str:
    """A pixel coordinate to a tenth."""
    return f"{value:.1f}".removesuffix(".0")


def _line(across: Floats, down: Floats) -> str:
    """Path in tenths of a pixel through points (n,), (n,); a point that is not finite is a gap."""
    seen = np.isfinite(across) & np.isfinite(down)
    points = np.column_stack([across, down])[seen]
    tenths = np.rint(10 * points).astype(np.int64)
    first = np.flatnonzero(np.append(True, np.diff(np.flatnonzero(seen)) > 1)[: len(tenths)])
    parts = []
    for run in np.split(tenths, first[1:]) if len(tenths) else []:
        steps = np.diff(run, axis=0)
        steps = steps[np.any(steps != 0, axis=1)]
        # A lone point is a dot: a line of no length has round caps.
        steps = steps if len(steps) else np.zeros((1, 2), np.int64)
        parts.append(f"M{run[0, 0]} {run[0, 1]}l" + " ".join(map(str, steps.ravel().tolist())).replace(" -", "-"))
    return "".join(parts)


def _svg(width: float, height: float, *content: Element, label: str = "") -> Element:
    attributes = {"role": "img", "aria_label": label} if label else {"aria_hidden": "true"}
    return _node("svg", *content, viewBox=f"0 0 {_px(width)} {_px(height)}", width=_px(width), **attributes)


def _heading(*parts: tuple[str, str]) -> Element:
    """A plot's heading: words, each in the colour of its line."""
    return _node("text", *(_node("tspan", words, class_=style) for words, style in parts), class_="heading")


def _course_plots(evidence: Evidence, setup: Setup) -> list[Element]:
    """Errors along the courses; where they are many, the ones that come nearest to a limit."""
    samples = evidence.samples
    if not len(samples.courses):
        return [_node("p", "Nothing was measured along the courses.", class_="note")]
    limits = _limits(setup)
    signed = {
        "max_position_error_mm": samples.position_errors / MM,
        "max_roller_tilt_deg": samples.tilts / DEG,
        "max_heading_error_deg": samples.heading_errors / DEG,
        "max_tape_error_mm": samples.tape_errors / MM,
    }
    starts = _starts(samples.courses)
    shares = np.max(
        [np.maximum.reduceat(np.abs(values), starts) / limits[key][0] for key, values in signed.items()], axis=0
    )
    shares = np.where(np.isfinite(shares), shares, np.inf)
    order = np.argsort(-shares, kind="stable")
    shown = np.sort(order[:SHOWN_COURSES])
    curves = _errors(samples)
    ranges = [_range([curve for curve in panel], [-limits[key][0], limits[key][0]]) for key, panel in curves.items()]
    ends = np.append(starts[1:], len(samples.courses))
    nodes = [
        _node(
            "p",
            "Over arc length in mm; the scale of errors is one for all courses. Dashed: limits of the setup"
            + ("" if all(judged for _, judged in limits.values()) else " (grey: not judged)")
            + "; the one of position holds for normal and lateral together.",
            class_="note",
        )
    ]
    for row in shown:
        part = slice(int(starts[row]), int(ends[row]))
        nodes.append(_course_figure(evidence, part, curves, ranges, limits))
    rest = order[SHOWN_COURSES:]
    if len(rest):
        most = float(shares[rest[0]])
        nodes.append(
            _node(
                "p",
                f"Shown are the {len(shown)} courses that come nearest to a limit; of the other {len(rest):,} "
                + (f"none reaches more than {most:.1%} of one." if math.isfinite(most) else "some were not measured."),
                class_="note",
            )
        )
    return nodes


def _errors(samples: Samples) -> dict[str, list[_Curve]]:
    """Lines of the four plots of errors over arc length, millimetres and degrees."""
    arcs = samples.arc_lengths / MM
    return {
        "max_position_error_mm": [
            _Curve("first", arcs, samples.normal_errors / MM),
            _Curve("second", arcs, samples.lateral_errors / MM),
        ],
        "max_roller_tilt_deg": [_Curve("first", arcs, samples.tilts / DEG)],
        "max_heading_error_deg": [_Curve("first", arcs, samples.heading_errors / DEG)],
        "max_tape_error_mm": [_Curve("first", arcs, samples.tape_errors / MM)],
    }


def _course_figure(
    evidence: Evidence,
    part: slice,
    curves: dict[str, list[_Curve]],
    ranges: Sequence[tuple[float, float]],
    limits: dict[str, tuple[float, bool]],
) -> Element:
    """One course's errors: four plots in a row under its number and its worst place."""
    samples = evidence.samples
    number = evidence.tape.rows[int(samples.courses[part.start])].course
    arcs = samples.arc_lengths[part] / MM
    placed = np.isfinite(arcs)
    headings = {
        "max_position_error_mm": _heading(("normal ", "first"), ("lateral ", "second"), ("mm", "")),
        "max_roller_tilt_deg": _heading(("tilt ", "first"), ("deg", "")),
        "max_heading_error_deg": _heading(("heading ", "first"), ("deg", "")),
        "max_tape_error_mm": _heading(("tape ", "first"), ("mm", "")),
    }
    nodes: list[Element] = []
    for column, (key, heading) in enumerate(headings.items()):
        limit, judged = limits[key]
        panel = _Panel(48 + 252 * column, 18, 194, 70, _span(arcs[placed]), ranges[column])
        lines = [_Curve(curve.style, arcs[placed], curve.y[part][placed]) for curve in curves[key]]
        nodes += panel.drawn(heading, lines, [-limit, limit], judged)
    measured = placed & np.all(
        [np.isfinite(curve.y[part]) for panel_curves in curves.values() for curve in panel_curves], axis=0
    )
    if np.all(measured):
        errors = samples.position_errors[part] / MM
        worst = int(np.argmax(errors))
        told = (
            f"{arcs[-1]:,.1f} mm; largest position error {errors[worst]:.4f} mm at {arcs[worst]:,.1f} mm, "
            f"x {samples.nips[part][worst, 0] / MM:,.1f}  y {samples.nips[part][worst, 1] / MM:,.1f} mm"
        )
    else:
        told = f"{np.sum(~measured):,} of {len(arcs):,} samples were not measured and are not drawn"
    caption = _node("figcaption", _node("b", f"Course {number}"), f"  {told}")
    return _node("figure", caption, _svg(1016, 106, *nodes, label=f"Errors along course {number}"))


def _axis_plots(axes: Sequence[AxisUse], trajectory: Trajectory) -> list[Element]:
    """Position and speed of every axis over the program's time."""
    moves = np.flatnonzero(trajectory.durations > 0.0)
    if not 0.0 < trajectory.duration < math.inf:
        return [_node("p", "The program's time is not known.", class_="note")]
    ends = trajectory.times[moves]
    begins = ends - trajectory.durations[moves]
    rapid = trajectory.kinds[moves] == Kind.RAPID
    span = (0.0, trajectory.duration)
    steps = np.abs(trajectory.positions[moves] - trajectory.begins(moves)) / trajectory.durations[moves, None]
    steps[rapid] = np.nan
    corners = np.column_stack([begins, ends]).ravel()
    nodes = [
        _node(
            "p",
            "Over time in s. Dashed: travel and speed limits of the machine. Grey: rapids, which run at the control's "
            "own speed; the speeds are those of the feed blocks.",
            class_="note",
        )
    ]
    for axis in axes:
        scale, unit = _unit(axis)
        column = trajectory.column(axis.name)
        position = _Curve(
            "first",
            np.append(0.0, trajectory.times),
            np.append(trajectory.start[column], trajectory.positions[:, column]) * scale,
        )
        speed = _Curve("first", corners, np.repeat(steps[:, column], 2) * scale)
        travel, top = [axis.lower * scale, axis.upper * scale], [axis.speed_limit * scale]
        left = _Panel(66, 18, 424, 84, span, _range([position], travel))
        right = _Panel(571, 18, 424, 84, span, (0.0, _range([speed], [0.0, *top])[1]))
        drawn = [_bands(panel, begins[rapid], ends[rapid]) for panel in (left, right)]
        drawn += left.drawn(_heading((axis.name, "first"), (f" {unit}", "")), [position], travel)
        drawn += right.drawn(_heading((axis.name, "first"), (f" speed {unit}/s", "")), [speed], top)
        nodes.append(_node("figure", _svg(1016, 120, *drawn, label=f"Axis {axis.name}: position and speed over time")))
    return nodes


def _bands(panel: _Panel, begins: Floats, ends: Floats) -> Element:
    """Shade from (m,) to (m,) in the panel's x, pixel column by pixel column."""
    first = np.floor(panel.across(begins)).astype(np.int64)
    last = np.ceil(panel.across(ends)).astype(np.int64)
    parts = []
    reach = -1
    for left, right in zip(first.tolist(), last.tolist(), strict=True):
        left = max(left, reach)
        if right > left:
            parts.append(f"M{left} {_px(panel.top)}H{right}v{panel.height}H{left}z")
            reach = right
    return _node("path", d="".join(parts), class_="band")


@dataclass(frozen=True, eq=False)
class _Strip:
    """A course in the plan view.

    Attributes:
        number: in its file.
        points: (m, 2) pixels.
        classes: (m - 1,) colour of each piece, `COLOURS` where it is beyond the limit.
    """

    number: int
    points: Floats
    classes: Ints


def _plan_view(evidence: Evidence, setup: Setup) -> list[Element]:
    """The courses from above to scale, in `machine` axes, coloured by position error."""
    samples = evidence.samples
    seen = np.all(np.isfinite(samples.nips), axis=1)
    if not np.any(seen):
        return [_node("p", "Nothing was measured along the courses.", class_="note")]
    plan = samples.nips[seen][:, :2] / MM
    # A place that is not known shows as an error without a number in the samples beside it.
    beside = ~seen | np.append(~seen[1:], False) | np.append(False, ~seen[:-1])
    errors = np.where(beside, np.nan, samples.position_errors / MM)[seen]
    courses = samples.courses[seen]
    limit = setup.verification.max_position_error_mm
    finite = errors[np.isfinite(errors)]
    top = min(limit, _round_up(float(np.max(finite, initial=0.0))))

    room = evidence.tape_width / MM / 2
    low, high = np.min(plan, axis=0) - room, np.max(plan, axis=0) + room
    scale = float(min(PLAN_WIDTH / (high[0] - low[0]), PLAN_HEIGHT / (high[1] - low[1])))
    width, height = (high - low) * scale
    panel = _Panel(
        64, 18, round(width), round(height), (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
    )
    pixels = np.column_stack([panel.across(plan[:, 0]), panel.down(plan[:, 1])])
    strips = _strips([row.course for row in evidence.tape.rows], courses, pixels, _classes(errors, top, limit))

    nodes = panel.drawn(_heading(("y over x, mm", "")), [], [])
    band = "".join(_outline(strip.points) for strip in strips)
    nodes.append(
        _node(
            "path",
            d=band,
            class_="tape",
            transform="scale(.1)",
            stroke_width=_px(evidence.tape_width / MM * scale * 10),
        )
    )
    for colour in range(COLOURS + 1):
        pieces = "".join(_pieces(strip, colour) for strip in strips)
        if pieces:
            style = f"line course e{colour}" if colour < COLOURS else "line course over"
            nodes.append(_node("path", d=pieces, transform="scale(.1)", class_=style))
    nodes += _arrows(strips)
    nodes += _labels(strips)
    nodes += _worst_place(pixels, errors)
    nodes.append(_scale_bar(panel, scale))
    nodes += _colour_bar(panel.left + panel.width + 24, panel.top, top, limit, float(np.max(finite, initial=0.0)))
    words = f"x and y of the machine in mm, to scale. Bands: the tape, {_plain(evidence.tape_width / MM)} mm wide. "
    words += "Arrows: travel. Ring: the largest position error."
    figure = _svg(panel.left + width + 150, panel.top + height + 24, *nodes, label="Plan view of the courses")
    return [_node("figure", figure), _node("p", words, class_="note")]


def _round_up(value: float) -> float:
    """The next of 1, 2 or 5 times a power of ten; for no error at all a micrometre in millimetres."""
    if not value > 1e-3:
        return 1e-3
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1 - 1e-9))


def _classes(errors: Floats, top: float, limit: float) -> Ints:
    """Colour (n,) of each error: 0 to COLOURS - 1 up to `top`, COLOURS beyond the limit or where there is no number."""
    inside: Mask = errors <= limit
    scaled = np.floor(np.where(inside, errors, 0.0) / top * COLOURS).astype(np.int64)
    return np.where(inside, np.minimum(scaled, COLOURS - 1), COLOURS)


def _strips(numbers: Sequence[int], courses: Ints, pixels: Floats, classes: Ints) -> list[_Strip]:
    """Courses cut into cells of a few pixels, each with its worst colour, so that thinning hides no error."""
    starts = _starts(courses)
    steps = np.hypot(*np.diff(pixels, axis=0, prepend=pixels[:1]).T)
    steps[starts] = 0.0
    travelled = np.cumsum(steps)
    cell = max(LEAST_CELL, float(travelled[-1]) / PLAN_CELLS)
    strips = []
    for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(courses)], strict=True):
        cells = ((travelled[start:end] - travelled[start]) / cell).astype(np.int64)
        firsts = np.flatnonzero(np.append(True, np.diff(cells) > 0))
        colours = np.maximum.reduceat(classes[start:end], firsts)
        points = np.vstack([pixels[start:end][firsts], pixels[end - 1 : end]])
        strips.append(_Strip(numbers[int(courses[start])], points, colours))
    return strips


def _outline(points: Floats) -> str:
    return _line(points[:, 0], points[:, 1])


def _pieces(strip: _Strip, colour: int) -> str:
    """Path of the pieces of one colour."""
    chosen = np.flatnonzero(strip.classes == colour)
    if not len(chosen):
        return ""
    runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
    return "".join(_outline(strip.points[run[0] : run[-1] + 2]) for run in runs)


def _direction(begin: Floats, end: Floats) -> Floats:
    """Unit vector (2,) from one point (2,) to another; up the page where they are one."""
    length = float(np.hypot(*(end - begin)))
    direction: Floats = (end - begin) / length if length > 0.0 else np.array([0.0, -1.0])
    return direction


def _arrows(strips: Sequence[_Strip]) -> list[Element]:
    """An arrowhead in the middle of each course; one that would lie on another is left out."""
    nodes = []
    places = _Places(10.0)
    for strip in strips:
        middle = len(strip.points) // 2
        begin, end = strip.points[middle - 1], strip.points[middle]
        ahead = _direction(begin, end)
        left = np.array([ahead[1], -ahead[0]])
        tip = (begin + end) / 2 + 5 * ahead
        if places.take((begin + end) / 2, 5.0):
            corners = (tip, tip - 10 * ahead + 4 * left, tip - 10 * ahead - 4 * left)
            path = "M" + "L".join(f"{_px(x)} {_px(y)}" for x, y in corners) + "z"
            nodes.append(_node("path", d=path, class_="arrow"))
    return nodes


def _labels(strips: Sequence[_Strip]) -> list[Element]:
    """Course numbers before the courses' starts; one that would lie on another is left out."""
    nodes = []
    places = _Places(11.0)
    for strip in strips:
        across, down = strip.points[0] - 9 * _direction(strip.points[0], strip.points[1])
        if places.take(np.array([across, down]), 3.5 * len(str(strip.number)) + 3):
            nodes.append(_node("text", str(strip.number), x=_px(across), y=_px(down + 4), class_="number middle"))
    return nodes


class _Places:
    """Places on the page that are taken by marks of one height.

    Args:
        height: of a mark, pixels.
    """

    def __init__(self, height: float) -> None:
        self._height = height
        self._taken = np.zeros((0, 3))

    def take(self, centre: Floats, half_width: float) -> bool:
        """Take the place round a centre (2,) in pixels, unless it is taken."""
        away = np.abs(self._taken[:, :2] - centre)
        if np.any((away[:, 0] < self._taken[:, 2] + half_width) & (away[:, 1] < self._height)):
            return False
        self._taken = np.vstack([self._taken, [*centre, half_width]])
        return True


def _worst_place(pixels: Floats, errors: Floats) -> list[Element]:
    """A ring round the largest error, or round the first place that has none."""
    worst = int(np.argmax(np.where(np.isfinite(errors), errors, np.inf)))
    across, down = pixels[worst]
    return [_node("circle", cx=_px(across), cy=_px(down), r=8, class_="ring")]


def _scale_bar(panel: _Panel, scale: float) -> Element:
    """A bar of a round length, to the right of the plan at its foot."""
    length = _ticks(0.0, 90.0 / scale, 3)[-1]
    left, down = panel.left + panel.width + 24, panel.top + panel.height
    bar = _node("path", d=f"M{_px(left)} {_px(down - 4)}v4h{_px(length * scale)}v-4", class_="scale")
    return _node("g", bar, _node("text", f"{_plain(length)} mm", x=_px(left), y=_px(down - 8), class_="tick"))


def _colour_bar(left: float, top: float, highest: float, limit: float, largest: float) -> list[Element]:
    """Colours of the position errors with their values."""
    size = 14.0
    nodes = [_node("text", "position error", x=_px(left), y=_px(top + 8), class_="tick")]
    nodes.append(_node("text", "mm", x=_px(left), y=_px(top + 20), class_="tick"))
    top += 30
    if largest > limit:
        nodes.append(_node("rect", x=_px(left), y=_px(top), width=16, height=size, class_="fill over"))
        nodes.append(_node("text", "beyond the limit", x=_px(left + 21), y=_px(top + 10), class_="tick bound"))
        top += size + 6
    for colour in range(COLOURS):
        down = top + size * (COLOURS - 1 - colour)
        nodes.append(_node("rect", x=_px(left), y=_px(down), width=16, height=size, class_=f"fill e{colour}"))
    for i in range(0, COLOURS + 1, 2):
        value = highest * i / COLOURS
        at = top + size * (COLOURS - i)
        style = "tick bound" if i == COLOURS and highest == limit else "tick"
        nodes.append(_node("text", _plain(value), x=_px(left + 21), y=_px(at + 4), class_=style))
    return nodes


# Plasma (van der Walt and Smith, matplotlib), its brightest tenth left out on white and its darkest third on black.
STYLE = """
:root { color-scheme: light dark;
  --paper: #fff; --ink: #1b1f24; --soft: #5b6570; --rule: #d5dae0; --faint: #eef0f3; --band: #e3e7ec; --tape: #dfe7f1;
  --unjudged: #9a5b00;
  --first: #1f5fa8; --second: #b35900; --limit: #c0182b; --passed: #12703a; --failed: #b3132b; --over: #e00000;
  --e0: #41049d; --e1: #5c01a6; --e2: #7701a8; --e3: #900da4; --e4: #a72197;
  --e5: #ba3388; --e6: #cc4778; --e7: #db5c68; --e8: #e97158; --e9: #f58c46; }
@media screen and (prefers-color-scheme: dark) { :root {
  --paper: #14181d; --ink: #e6e9ed; --soft: #9aa5b1; --rule: #3a424c; --faint: #20262d; --band: #2a313a;
  --tape: #26303c; --unjudged: #a86600;
  --first: #6cb0ff; --second: #f0a04b; --limit: #ff6b78; --passed: #1c8a4c; --failed: #cf2d45; --over: #ff3030;
  --e0: #8f0da4; --e1: #a51f99; --e2: #b83289; --e3: #ca457a; --e4: #d9586a;
  --e5: #e66c5c; --e6: #f1824c; --e7: #f99a3e; --e8: #fdb52e; --e9: #fad824; } }
* { box-sizing: border-box; }
body { max-width: 1040px; margin: 0 auto; padding: 28px 20px; background: var(--paper); color: var(--ink);
  font: 14px/1.45 system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; }
h1 { font-size: 22px; font-weight: 600; margin: 0 0 12px; overflow-wrap: anywhere; }
h2 { font-size: 16px; font-weight: 600; margin: 30px 0 8px; padding-bottom: 4px; border-bottom: 1px solid var(--rule); }
.verdict { margin: 0; padding: 9px 14px; border-radius: 4px; color: #fff; font-weight: 600; }
.passed { background: var(--passed); } .failed { background: var(--failed); }
.unjudged { background: var(--unjudged); }
dl { display: flex; flex-wrap: wrap; gap: 10px 34px; margin: 16px 0 0; }
dt { color: var(--soft); font-size: 12px; }
dd { margin: 0; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { text-align: right; color: var(--soft); font-size: 12px; font-weight: 600; }
th, td { padding: 3px 8px; border-bottom: 1px solid var(--faint); white-space: nowrap; }
thead th { border-bottom: 1px solid var(--rule); }
td { text-align: right; }
.numbers :is(th, td):is(:nth-child(1), :nth-child(3)), .axes :is(th, td):nth-child(-n+2),
.failures :is(th, td):nth-child(4) { text-align: left; }
.axes td:first-child { font-weight: 600; }
.bar { display: inline-block; width: 90px; vertical-align: middle; }
.track { fill: var(--band); } .used { fill: var(--first); } .beyond { fill: var(--limit); }
.note { color: var(--soft); font-size: 12.5px; margin: 4px 0 8px; }
figure { margin: 0 0 6px; break-inside: avoid; overflow-x: auto; }
figcaption { font-size: 12.5px; font-variant-numeric: tabular-nums; white-space: pre-wrap; }
figure svg { display: block; max-width: 100%; height: auto; }
text { fill: var(--ink); font-size: 11.5px; font-variant-numeric: tabular-nums; }
.heading { font-size: 12px; } .heading .first { fill: var(--first); font-weight: 600; }
.heading .second { fill: var(--second); font-weight: 600; }
.tick { fill: var(--soft); } .middle { text-anchor: middle; } .end { text-anchor: end; }
.bound { fill: var(--limit); }
.number { font-size: 12px; font-weight: 600; paint-order: stroke; stroke: var(--paper); stroke-width: 3px; }
.frame { fill: none; stroke: var(--rule); } .axis { fill: none; stroke: var(--soft); } .grid { stroke: var(--faint); }
.limit { fill: none; stroke: var(--limit); stroke-dasharray: 5 3; } .limit.free { stroke: var(--soft); }
.line { fill: none; stroke-width: 1.2px; stroke-linejoin: round; stroke-linecap: round;
  vector-effect: non-scaling-stroke; }
.line.first { stroke: var(--first); } .line.second { stroke: var(--second); opacity: 0.8; }
.band { fill: var(--band); }
.tape { fill: none; stroke: var(--tape); stroke-linejoin: round; }
.line.course { stroke-width: 2.6px; } .line.over { stroke: var(--over); stroke-width: 4px; }
.fill.over { fill: var(--over); }
.arrow { fill: var(--ink); } .ring { fill: none; stroke: var(--ink); stroke-width: 1.5px; }
.scale { fill: none; stroke: var(--ink); stroke-width: 1.5px; }
footer { display: flex; gap: 28px; margin-top: 64px; break-inside: avoid; }
footer div { flex: 1; border-top: 1px solid var(--ink); padding-top: 4px; color: var(--soft); font-size: 12px; }
@page { size: A4; margin: 12mm; }
@media print { body { max-width: none; padding: 0; font-size: 11pt; } h2 { break-after: avoid; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
""" + "".join(f".line.e{i} {{ stroke: var(--e{i}); }} .fill.e{i} {{ fill: var(--e{i}); }}\n" for i in range(COLOURS))
