"""The report says what was measured, and never that something holds which was not."""

from __future__ import annotations

import io
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from rich.console import Console

from tapelayer import report
from tapelayer.arrays import Floats
from tapelayer.evidence import AxisUse, Evidence, Failure, LedgerRow, Samples, TapeLedger
from tapelayer.gantry import lengths
from tapelayer.laying import plan
from tapelayer.machine import Machine
from tapelayer.setup import MM, Setup
from tapelayer.trajectory import Kind, Trajectory
from tapelayer.verification import verify
from tests.surfaces import helix_course, setup_of

SHA256 = "0123456789abcdef" * 4
KEYS = {
    "version": "",
    "courses": 2,
    "points": 44,
    "blocks": 5,
    "laid_length_m": 1.5,
    "duration_s": 4.0,
    "max_position_error_mm": 0.05,
    "max_chord_error_mm": 0.03,
    "max_roller_tilt_deg": 30.0,
    "max_edge_lift_mm": 18.75,
    "max_heading_error_deg": 2.0,
    "max_pitch_deg": 4.0,
    "max_wrap_mm": 2.0,
    "max_roller_offset_mm": 0.6,
    "max_tape_error_mm": 0.07,
    "taken_back_mm": 3.0,
    "least_link_clearance_mm": 48.0,
    "max_forward_disagreement_m": 2e-16,
    "program_sha256": SHA256,
    "axes": {},
    "passed": True,
    "failures": [],
}
VOID = {"meta", "link", "br", "hr", "img", "input"}


def samples() -> Samples:
    """Two courses of three samples; the largest of every quantity is a round value and often a negative one."""
    course = np.array([0, 0, 0, 1, 1, 1])
    arcs = np.array([0.0, 0.25, 0.5, 0.0, 0.5, 1.0])
    degrees = np.radians
    return Samples(
        courses=course,
        arc_lengths=arcs,
        times=np.array([0.0, 1.0, 2.0, 2.5, 3.0, 4.0]),
        nips=np.column_stack([0.3 + 0.1 * course, arcs - 1.5, 0 * arcs]),
        normal_errors=np.array([0.0, 1e-5, -3e-5, 0.0, -3e-5, 0.0]),
        lateral_errors=np.array([0.0, 0.0, 4e-5, 0.0, 0.0, 2e-5]),
        tape_errors=np.array([0.0, -7e-5, 0.0, 0.0, 0.0, 1e-5]),
        tilts=degrees(np.array([0.0, 1.0, 0.0, 0.0, -30.0, 0.0])),
        heading_errors=degrees(np.array([0.0, 0.0, -2.0, 0.0, 1.0, 0.0])),
        pitches=degrees(np.array([0.0, 0.0, -4.0, 0.0, 1.0, 0.0])),
        wraps=np.array([0.10, 0.12, 0.15, -0.03, 0.0, 0.01]),
        offsets=np.array([0.0, 0.0, 0.0006, 0.0, 0.0, 0.0]),
        block_ends=np.array([True, False, True, True, False, True]),
    )


def axes() -> tuple[AxisUse, ...]:
    return (
        AxisUse("x", False, 0.3, 0.4, 0.0, 2.5, 0.25, 1.0),
        AxisUse("c", True, math.radians(-10), math.radians(29), math.radians(-30), math.radians(30), 0.5, 1.0),
    )


def ledger(*numbers: int) -> TapeLedger:
    """Tape of the courses with these numbers."""
    rows = (LedgerRow(number, 0.75, 0.75 * i, 0.0, 0.0, 0.0, 0, ()) for i, number in enumerate(numbers))
    return TapeLedger(tuple(rows), (), 1.5, 3.0, 0.5, 0.5)


def evidence(**changes: object) -> Evidence:
    found = Evidence(
        courses=2,
        points=44,
        blocks=5,
        laid_length=1.5,
        duration=4.0,
        tape_taken_back=0.003,
        least_link_clearance=0.048,
        forward_disagreement=2e-16,
        axes=axes(),
        samples=samples(),
        tape_width=0.075,
        roller_radius=0.04,
        tape=ledger(3, 17),
        failures=(),
    )
    return replace(found, **changes)  # type: ignore[arg-type]


def trajectory(n: int = 5) -> Trajectory:
    """Every fifth block a rapid, one second each but for switching at once."""
    kinds = np.full(n, Kind.LINEAR, np.uint8)
    kinds[::5] = Kind.RAPID
    positions = np.column_stack([np.linspace(0.3, 0.4, n), np.linspace(-0.1, 0.5, n)])
    return Trajectory(
        axes=("x", "c"),
        start=np.full(2, np.nan),
        positions=positions,
        kinds=kinds,
        durations=np.full(n, 4.0 / n),
        events=np.zeros(n, np.uint8),
        courses=np.zeros(n, np.int32),
        stated=np.zeros(n, np.uint16),
        lines=np.zeros(n, np.int32),
    )


def page(found: Evidence, title: str = "panel.nc", moves: Trajectory | None = None, setup: Setup | None = None) -> str:
    numbers = report.numbers(found, SHA256)
    return report.html(found, moves or trajectory(), numbers, setup or Setup(), title)


class Elements(HTMLParser):
    """Every element with its attributes and its own text; refuses tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), []))
        if tag not in VOID:
            self._open.append(self.found[-1])

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        if self._open:
            self._open[-1][2].append(data)

    def of(self, tag: str, style: str = "") -> list[tuple[dict[str, str | None], str]]:
        wanted = set(style.split())
        return [
            (attributes, "".join(words))
            for name, attributes, words in self.found
            if name == tag and wanted <= set((attributes.get("class") or "").split())
        ]


def drawn(path: str) -> list[Floats]:
    """Points of a path in pixels, one array for each piece between gaps."""
    pieces = []
    for piece in path.split("M")[1:]:
        first, steps = piece.split("l")
        moves = np.array(re.findall(r"-?\d+", steps), float).reshape(-1, 2)
        pieces.append(np.vstack([np.array(first.split(), float), moves]).cumsum(axis=0) / 10)
    return pieces


def test_keys_and_values() -> None:
    numbers = report.numbers(evidence(), SHA256)
    assert list(numbers) == list(KEYS)
    for key, value in KEYS.items():
        if isinstance(value, float):
            assert numbers[key] == pytest.approx(value, rel=1e-12), key
        elif key not in ("version", "axes"):
            assert numbers[key] == value, key
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", numbers["version"])
    assert list(numbers["axes"]) == ["x", "c"]
    x, c = numbers["axes"]["x"], numbers["axes"]["c"]
    assert list(x) == ["unit", "min", "max", "lower", "upper", "margin", "max_speed", "speed_limit"]
    assert list(x.values()) == ["mm", *(pytest.approx(v) for v in (300, 400, 0, 2500, 300, 250, 1000))]
    speeds = math.degrees(0.5), math.degrees(1.0)
    assert list(c.values()) == ["deg", *(pytest.approx(v) for v in (-10, 29, -30, 30, 1, *speeds))]


def test_values_are_plain_and_come_back_from_json() -> None:
    failure = Failure(3, 2, "axis_x_speed_mm_per_s", np.float64("inf"), np.float64(1000), 12)
    numbers = report.numbers(evidence(failures=(failure,), tape_taken_back=np.float64(-0.0)), SHA256)
    text = json.dumps(numbers, allow_nan=False)
    assert json.loads(text) == numbers
    assert "-0.0" not in text
    assert all(type(value) in (int, float, str, bool, dict, list) for value in numbers.values())


def test_failures_with_their_places() -> None:
    read = Failure(3, 12, "position_error_mm", 0.06, 0.05, 88)
    planned = Failure(0, 0, "courses_laid", 1, 2)
    numbers = report.numbers(evidence(failures=(read, planned)), SHA256)
    assert not numbers["passed"]
    assert numbers["failures"] == [
        {"course": 3, "point": 12, "what": "position_error_mm", "value": 0.06, "limit": 0.05, "line": 88},
        {"course": 0, "point": 0, "what": "courses_laid", "value": 1.0, "limit": 2.0},
    ]


def test_nothing_measured_is_neither_nought_nor_passed() -> None:
    nothing = replace(samples(), **{name: getattr(samples(), name)[:0] for name in Samples.__dataclass_fields__})
    numbers = report.numbers(evidence(samples=nothing), SHA256)
    lost = {key for key in KEYS if key.startswith("max_") and key != "max_forward_disagreement_m"}
    assert {key for key, value in numbers.items() if value is None} == lost
    assert not numbers["passed"]
    assert {failure["what"] for failure in numbers["failures"]} == {key.removeprefix("max_") for key in lost}
    assert all(failure["value"] is None for failure in numbers["failures"])


MEASURED = {
    "normal_errors": {"max_position_error_mm", "max_chord_error_mm"},
    "lateral_errors": {"max_position_error_mm", "max_chord_error_mm"},
    "tape_errors": {"max_tape_error_mm"},
    "tilts": {"max_roller_tilt_deg", "max_edge_lift_mm"},
    "heading_errors": {"max_heading_error_deg"},
    "pitches": {"max_pitch_deg"},
    "wraps": {"max_wrap_mm"},
    "offsets": {"max_roller_offset_mm"},
}


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("row", [1, 4])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_value_that_is_not_finite_is_not_passed(name: str, row: int, bad: float) -> None:
    values = getattr(samples(), name).copy()
    values[row] = bad
    found = evidence(samples=replace(samples(), **{name: values}))
    numbers = report.numbers(found, SHA256)
    assert {key for key, value in numbers.items() if value is None} == MEASURED[name]
    assert {failure["what"] for failure in numbers["failures"]} == {key[4:] for key in MEASURED[name]}
    assert not numbers["passed"]
    text = page(found)
    assert "FAILED" in text
    assert not re.search(r"\b(nan|inf)\b", re.sub(r"<style>.*</style>", "", text, flags=re.S), re.I)


@pytest.mark.parametrize("name", ["least", "greatest", "top_speed"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_an_axis_without_values_is_not_passed(name: str, bad: float) -> None:
    x, c = axes()
    found = evidence(axes=(x, replace(c, **{name: bad})))
    numbers = report.numbers(found, SHA256)
    what = "axis_c_speed_deg_per_s" if name == "top_speed" else "axis_c_deg"
    assert [failure["what"] for failure in numbers["failures"]] == [what]
    assert json.dumps(numbers, allow_nan=False)
    assert "no finite value" in page(found)


def test_what_verification_refused_is_not_refused_twice() -> None:
    values = samples().tape_errors.copy()
    values[0] = np.nan
    refused = Failure(3, 1, "tape_error_mm", math.nan, 0.05)
    found = evidence(samples=replace(samples(), tape_errors=values), failures=(refused,))
    numbers = report.numbers(found, SHA256)
    assert numbers["failures"] == [
        {"course": 3, "point": 1, "what": "tape_error_mm", "value": None, "limit": 0.05},
    ]


def test_a_single_course_has_no_link_and_passes() -> None:
    numbers = report.numbers(evidence(least_link_clearance=math.inf), SHA256)
    assert numbers["least_link_clearance_mm"] is None
    assert numbers["passed"]
    unknown = report.numbers(evidence(least_link_clearance=math.nan), SHA256)
    assert unknown["least_link_clearance_mm"] is None
    assert [failure["what"] for failure in unknown["failures"]] == ["link_clearance_mm"]


def test_wrap_is_the_spread_within_one_course() -> None:
    """Two courses apart from each other by much have no wrap where each is even in itself."""
    wraps = np.array([0.5, 0.5, 0.5, -0.5, -0.5, -0.5])
    numbers = report.numbers(evidence(samples=replace(samples(), wraps=wraps)), SHA256)
    assert numbers["max_wrap_mm"] == 0.0


def test_wrap_is_told_although_the_program_leaves_it_out() -> None:
    """On an arch of radius r the head stays upright: the nip turns by length / r round the roller in any case."""
    machine = Machine.load()
    told = []
    for compensated in ("true", "false"):
        setup = setup_of(f"[head]\nwrap_compensation = {compensated}")
        courses = (helix_course(heading=0.0, radius=1.5, length=0.6),)
        evidence = verify(plan(courses, setup, machine), courses, setup, machine).evidence
        told.append(report.numbers(evidence, SHA256)["max_wrap_mm"])
    assert told == pytest.approx([lengths(machine).radius / MM * 0.6 / 1.5] * 2, rel=1e-4)


def test_every_key_is_documented() -> None:
    numbers = report.numbers(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0, 1),)), SHA256)
    text = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
    for key in [*numbers, *numbers["axes"]["x"], *numbers["failures"][0]]:
        assert f"`{key}`" in text, key


def told(numbers: dict[str, object]) -> str:
    text = io.StringIO()
    Console(file=text, width=80).print(report.summary(numbers))
    return text.getvalue()


def test_summary_fits_a_terminal_and_says_all() -> None:
    text = told(report.numbers(evidence(), SHA256))
    assert "Verification: passed" in text and "FAILED" not in text
    for words in ("0.0500 mm", "30.0000 deg", "300.00 to 400.00", "0 to 2,500", "250.0 of 1,000", "48.00 mm"):
        assert words in text
    assert "…" not in text
    failed = told(report.numbers(evidence(failures=(Failure(1, 1, "a_mm", 1.0, 0.0),)), SHA256))
    assert "Verification: FAILED" in failed and "passed" not in failed
    assert "no link" in told(report.numbers(evidence(least_link_clearance=math.inf), SHA256))


rows = arrays.arrays(np.float64, st.integers(1, 80), elements=st.floats(-1e3, 1e3) | st.just(np.nan) | st.just(np.inf))


@given(rows, st.data(), st.integers(1, 12))
def test_thinning_keeps_what_each_column_shows(y: Floats, data: st.DataObject, columns: int) -> None:
    steps = data.draw(arrays.arrays(np.float64, len(y), elements=st.floats(0, 5)))
    x = np.cumsum(steps)
    kept = report.extremes(x, y, columns)
    assert np.all(np.diff(kept) > 0) and kept[0] == 0 and kept[-1] == len(y) - 1
    edges = np.linspace(x[0], x[-1], columns + 1)
    column = np.clip(np.searchsorted(edges[1:-1], x, side="right"), 0, columns - 1)
    per_column = np.bincount(column[kept], minlength=columns)
    # Rounding may put a row that lies on an edge into the column beside it.
    on_edge = np.min(np.abs(x[:, None] - edges), axis=1) < 1e-9 * max(1.0, float(x[-1]))
    for i in range(columns):
        of_column = column == i
        if np.any(on_edge & of_column):
            continue
        assert per_column[i] <= 5
        inner, kept_inner = y[of_column], y[np.intersect1d(np.flatnonzero(of_column), kept)]
        finite, kept_finite = inner[np.isfinite(inner)], kept_inner[np.isfinite(kept_inner)]
        assert np.any(~np.isfinite(inner)) == np.any(~np.isfinite(kept_inner))
        assert len(finite) == 0 or (np.min(finite), np.max(finite)) == (np.min(kept_finite), np.max(kept_finite))


@given(st.integers(0, 99_999), st.integers(1, 5000))
def test_a_single_spike_survives_thinning(row: int, columns: int) -> None:
    y = np.zeros(100_000)
    y[row] = 1.0
    kept = report.extremes(np.arange(100_000.0), y, columns)
    assert row in kept
    assert len(kept) <= 5 * columns


def test_nothing_to_thin() -> None:
    assert len(report.extremes(np.zeros(0), np.zeros(0), 10)) == 0
    assert list(report.extremes(np.ones(3), np.array([1.0, 2.0, 1.5]), 10)) == [0, 1, 2]


def test_page_is_one_file_of_matching_tags_and_asks_no_network() -> None:
    for found in (evidence(), evidence(failures=(Failure(3, 1, "position_error_mm", 0.06, 0.05, 9),))):
        text = page(found)
        assert text.startswith("<!DOCTYPE html>")
        elements = Elements(text)
        assert not re.search(r"https?:|//|url\(|@import|javascript", text, re.I)
        tags = {tag for tag, _, _ in elements.found}
        assert not tags & {"script", "link", "img", "iframe", "object", "image", "use"}
        attributes = {name for _, own, _ in elements.found for name in own}
        assert not {name for name in attributes if name.startswith("on") or name in ("src", "href", "style")}
        assert "prefers-color-scheme: dark" in text and "@media print" in text
        assert elements.of("p", "verdict")[0][1].startswith("PASSED" if found.passed else "FAILED")


HOSTILE = "</title><script>alert(1)</script><img src=x onerror=alert(2)> & \"'.nc"


def test_a_hostile_name_stays_text() -> None:
    axis = replace(axes()[0], name='x"><script>alert(3)</script>')
    moves = trajectory()
    moves = replace(moves, axes=(axis.name, "c"))
    setup = Setup().with_values("output", controller=HOSTILE)
    failure = Failure(3, 1, f"axis_{axis.name}_mm", 9.0, 1.0)
    text = page(evidence(axes=(axis, axes()[1]), failures=(failure,)), HOSTILE, moves, setup)
    elements = Elements(text)
    assert not elements.of("script") and not elements.of("img")
    assert elements.of("title")[0][1] == f"Verification of {HOSTILE}"
    assert elements.of("span", "name")[0][1] == HOSTILE
    assert any(words == HOSTILE for _, words in elements.of("dd"))
    assert any(words == axis.name for _, words in elements.of("td"))


def test_a_name_that_is_no_text_is_shown_as_escapes() -> None:
    assert Elements(page(evidence(), "panel_\udcff.nc")).of("span", "name")[0][1] == "panel_\\udcff.nc"


def pixels(figure: str) -> tuple[list[Floats], dict[str, float]]:
    """Curves of a figure's lines in pixels, and the heights at which its limits are drawn, by their value as text."""
    elements = Elements(figure)
    lines = [piece for attributes, _ in elements.of("path", "line") for piece in drawn(attributes["d"] or "")]
    limits = {words: float(attributes["y"] or "") - 4 for attributes, words in elements.of("text", "bound")}
    return lines, limits


def figures(text: str, label: str) -> str:
    (found,) = (part for part in re.findall(r"<figure>.*?</figure>", text, re.S) if f'aria-label="{label}' in part)
    return str(found)


def test_limits_are_drawn_within_the_plots_and_to_scale() -> None:
    """Data heights are read back from the drawn lines by the limits' own heights."""
    n = 1001
    moves = trajectory(n)
    positions = moves.positions.copy()
    positions[700, 0] = 2.4
    lines, limits = pixels(figures(page(evidence(), moves=replace(moves, positions=positions)), "Axis x"))
    assert set(limits) == {"0", "2,500", "1,000"}
    # The frame of a plot is 84 pixels high from pixel 18 on: a limit that is drawn elsewhere is off the plot.
    assert all(18 < at < 18 + 84 for at in limits.values())
    scale = 2500 / (limits["0"] - limits["2,500"])
    heights = np.concatenate(lines[:1])[:, 1]
    drawn_x = (limits["0"] - heights) * scale
    assert np.max(drawn_x) == pytest.approx(2400, abs=0.1 * scale)
    assert np.min(drawn_x) == pytest.approx(300, abs=0.1 * scale)
    assert drawn_x[0] == pytest.approx(300, abs=0.1 * scale) and drawn_x[-1] == pytest.approx(400, abs=0.1 * scale)


def test_speeds_beyond_the_limit_are_within_the_plot() -> None:
    """A jump of 1 m in one block of 4 ms is 250 m/s; the range follows it and the limit stays on the plot."""
    moves = trajectory(1000)
    positions = moves.positions.copy()
    positions[501:, 0] += 1.0
    lines, limits = pixels(figures(page(evidence(), moves=replace(moves, positions=positions)), "Axis x"))
    tops = [float(np.min(line[:, 1])) for line in lines]
    assert all(18 <= top for top in tops)
    assert 18 < limits["1,000"] < 18 + 84
    speed_height = 18 + 84 - min(top for line, top in zip(lines, tops, strict=True) if line[0, 0] > 540)
    limit_height = 18 + 84 - limits["1,000"]
    assert speed_height / limit_height == pytest.approx(250.025 / 1.0, rel=0.1 / limit_height)


def test_rapids_are_shaded_and_their_speed_is_not_drawn() -> None:
    moves = trajectory(10)
    figure = figures(page(evidence(), moves=moves), "Axis x")
    band = Elements(figure).of("path", "band")[1][0]["d"] or ""
    shaded = [(float(a), float(b)) for a, b in re.findall(r"M([\d.]+) [\d.]+H([\d.]+)", band)]
    # Blocks 1 and 6 of 10 are rapids: 0 to 0.4 s and 2 to 2.4 s of 4 s over 424 pixels from pixel 571.
    assert shaded == [(571, 614), (783, 826)]
    lines, _ = pixels(figure)
    speeds = [line for line in lines if line[0, 0] > 540]
    assert len(speeds) == 2
    assert [round(float(line[0, 0])) for line in speeds] == [round(571 + 42.4), round(571 + 424 * 0.6)]


def test_errors_along_a_course_with_the_setups_limits() -> None:
    setup = Setup().with_values("verification", max_position_error_mm=0.08, max_roller_tilt_deg=40.0)
    text = page(evidence(), setup=setup)
    lines, limits = pixels(figures(text, "Errors along course 3"))
    assert set(limits) >= {"0.08", "-0.08", "40", "-40"}
    scale = 0.16 / (limits["-0.08"] - limits["0.08"])
    middle = (limits["-0.08"] + limits["0.08"]) / 2
    normal, lateral = lines[0], lines[1]
    assert (middle - normal[:, 1]) * scale == pytest.approx([0, 0.01, -0.03], abs=0.05 * scale + 1e-9)
    assert (middle - lateral[[0, -1], 1]) * scale == pytest.approx([0, 0.04], abs=0.05 * scale + 1e-9)
    assert "Errors along course 17" in text
    caption = Elements(figures(text, "Errors along course 3")).of("figcaption")[0][1]
    assert "largest position error 0.0500 mm at 500.0 mm" in caption


def test_published_form_says_loudly_what_is_not_judged() -> None:
    published = Setup().with_values("process", kinematics="published")
    verdict = Elements(page(evidence(), setup=published)).of("p", "verdict unjudged")
    assert "NOT JUDGED: roller tilt 30.0000 deg, heading error 2.0000 deg" in verdict[0][1]
    judged = published.with_values("verification", max_roller_tilt_deg=45.0)
    verdict = Elements(page(evidence(), setup=judged)).of("p", "verdict unjudged")
    assert "NOT JUDGED: heading error 2.0000 deg" in verdict[0][1]
    assert not Elements(page(evidence())).of("p", "unjudged")


def test_failures_are_listed_with_their_places() -> None:
    many = tuple(Failure(i, 7, "lay_speed_mm_per_s", 260.0 + i, 250.0, 100 + i) for i in range(1, 251))
    text = page(evidence(failures=many))
    cells = [words for _, words in Elements(text).of("td")]
    first = cells.index("lay speed")
    assert cells[first - 3 : first + 3] == ["1", "7", "101", "lay speed", "261 mm/s", "250 mm/s"]
    assert "and 50 more failures" in text
    assert "FAILED: 250 failures, the first: course 1 point 7 lay speed is 261 mm/s, limit 250 mm/s" in text


def test_plan_view_is_to_scale_and_coloured_by_the_worst_error() -> None:
    """One bad sample among many in the same pixel still colours its cell; x and y have one scale."""
    n = 20_001
    arcs = np.linspace(0.0, 1.0, n)
    errors = np.full(n, 1e-6)
    errors[n // 3] = 9e-5
    zeros = np.zeros(n)
    found = Samples(
        np.zeros(n, np.int64),
        arcs,
        arcs,
        np.column_stack([0.2 + 0.3 * arcs, 0.5 - 0.4 * arcs, zeros]),
        errors,
        *(zeros for _ in range(7)),
        np.arange(n) % 4 == 0,
    )
    figure = figures(page(evidence(samples=found)), "Plan view")
    elements = Elements(figure)
    over = [piece for attributes, _ in elements.of("path", "line over") for piece in drawn(attributes["d"] or "")]
    whole = drawn(elements.of("path", "tape")[0][0]["d"] or "")[0]
    across, down = whole[-1] - whole[0]
    assert down / across == pytest.approx(4 / 3, rel=1e-3)
    assert len(over) == 1
    ends = (over[0][[0, -1]] - whole[0]) @ (whole[-1] - whole[0]) / np.sum((whole[-1] - whole[0]) ** 2)
    assert ends[0] <= 1 / 3 <= ends[1] and ends[1] - ends[0] < 0.01
    width = float(elements.of("path", "tape")[0][0]["stroke-width"] or "") / 10
    assert width / np.hypot(across, down) == pytest.approx(0.075 / 0.5, rel=1e-2)
    ring = elements.of("circle", "ring")[0][0]
    assert np.hypot(*(whole[0] + (whole[-1] - whole[0]) / 3 - [float(ring["cx"] or ""), float(ring["cy"] or "")])) < 0.2
    assert [words for _, words in elements.of("text", "number")] == ["3"]


def test_arrows_point_along_the_travel() -> None:
    backwards = replace(samples(), nips=samples().nips * [1, -1, 1])
    for found, sign in ((samples(), -1), (backwards, 1)):
        figure = Elements(figures(page(evidence(samples=found)), "Plan view"))
        arrows = figure.of("path", "arrow")
        assert len(arrows) == 2
        for attributes, _ in arrows:
            tip, left, right = np.array(re.findall(r"-?[\d.]+", attributes["d"] or ""), float).reshape(3, 2)
            ahead = tip - (left + right) / 2
            # Down the page is positive, and y of the machine goes up it.
            assert ahead[1] * sign > 9 and abs(ahead[0]) < 0.2


def test_of_many_courses_those_nearest_to_a_limit_are_drawn() -> None:
    count = 60
    each = 4
    courses = np.repeat(np.arange(count), each)
    errors = 1e-6 * courses.astype(float)
    errors[courses == 5] = -4.9e-5
    zeros = np.zeros(len(courses))
    arcs = np.tile(np.linspace(0, 1, each), count)
    found = Samples(
        courses,
        arcs,
        arcs,
        np.column_stack([0.01 * courses, arcs, zeros]),
        zeros,
        zeros,
        errors,
        *(zeros for _ in range(5)),
        np.tile([True, False], len(courses) // 2),
    )
    text = page(evidence(samples=found, tape=ledger(*range(101, 161))))
    shown = [int(number) for number in re.findall(r'aria-label="Errors along course (\d+)"', text)]
    # 5 stands out, then 59 down to 21; the next is 20, whose 0.020 mm are 40 % of the limit.
    assert shown == [106, *range(122, 161)]
    assert "of the other 20 none reaches more than 40.0% of one" in text


def test_page_of_a_million_samples_is_below_three_megabytes() -> None:
    random = np.random.default_rng(5)
    n, count = 1_000_000, 200
    courses = np.repeat(np.arange(count), n // count)
    arcs = np.tile(np.linspace(0, 1.9, n // count), count)
    noise = [5e-6 * random.standard_normal(n) for _ in range(8)]
    nips = np.column_stack([0.006 * courses + 0.02 * np.sin(9 * arcs), arcs, 0 * arcs])
    found = Samples(courses, arcs, np.arange(n) * 1e-3, nips, *noise, np.arange(n) % 4 == 0)
    blocks = n // 4
    moves = trajectory(blocks)
    moves = replace(moves, positions=np.cumsum(random.standard_normal((blocks, 2)), axis=0) * 1e-3)
    text = page(evidence(samples=found, tape=ledger(*range(1, count + 1))), moves=moves)
    assert 100_000 < len(text.encode()) < 3_000_000


def test_page_of_a_program_that_lays_nothing() -> None:
    nothing = replace(samples(), **{name: getattr(samples(), name)[:0] for name in Samples.__dataclass_fields__})
    still = replace(trajectory(), durations=np.zeros(5))
    text = page(evidence(samples=nothing), moves=still)
    Elements(text)
    assert "FAILED" in text and "Nothing was measured along the courses" in text
    assert "time is not known" in text


def test_places_that_are_not_known_are_told_and_not_hidden() -> None:
    arcs = samples().arc_lengths.copy()
    nips = samples().nips.copy()
    arcs[1] = np.nan
    nips[1] = np.nan
    found = evidence(samples=replace(samples(), arc_lengths=arcs, nips=nips))
    text = page(found)
    assert "1 of 3 samples were not measured and are not drawn" in text
    assert Elements(figures(text, "Plan view")).of("path", "line over")
