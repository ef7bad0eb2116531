"""Page: the HTML report of a spraying program."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from tapelayer.motion.trajectory import Trajectory
from tapelayer.reporting.axis_plots import axis_plots
from tapelayer.reporting.drawing import element, table
from tapelayer.reporting.page import (
    Cells,
    axes_table,
    document,
    facts,
    failures_table,
    listing,
    meanings,
    quantities_table,
    signatures,
    verdict,
)
from tapelayer.reporting.quantity import open_words
from tapelayer.reporting.speed_plot import speed_plot
from tapelayer.reporting.subject import subject_tables
from tapelayer.reporting.words import ENGLISH, Say, Words
from tapelayer.spraying.plan_view import coat_plots, plan_view
from tapelayer.spraying.quantities import ROWS, Judged
from tapelayer.spraying.settings import SpraySetup

# The paths of the passes are drawn thin, over the coat's colours.
PATHS = ".line.way { stroke: var(--ink); stroke-width: 0.6px; opacity: 0.55; }\n"
PASSES = ("passes", Words("passes", "喷涂道次"))
REASONS = {
    "facing": Words("facing", "朝向"),
    "hidden": Words("hidden", "遮挡"),
    "travel": Words("travel", "行程"),
    "crease": Words("crease", "折痕"),
}
MENDED = {
    "bytes_ignored": "忽略的字节",
    "degenerate_facets": "退化三角面",
    "dissolved_facets": "并入的三角面",
    "duplicate_facets": "重复三角面",
    "flipped_facets": "翻转的三角面",
    "open_edges": "开放边",
    "nonmanifold_edges": "非流形边",
    "seam_edges": "接缝边",
}


def html(
    judged: Judged,
    trajectory: Trajectory,
    report: dict[str, Any],
    setup: SpraySetup,
    not_judged: tuple[Words, ...],
    say: Say = ENGLISH,
) -> str:
    """Return the report as one HTML page with plots, for light, dark and print.

    Args:
        judged: the evidence on the program, and its coat.
        trajectory: the program.
        report: its report as plain values, with its subject.
        setup: the job's values.
        not_judged: what no verdict covers.
        say: the language.
    """
    samples = judged.samples
    limits, coat = judged.evidence.limits, judged.coat
    more = [(say("process", "工艺"), "; ".join(setup.process.notes()).removeprefix("process "))]
    heading = verdict(ROWS, report, limits, PASSES, open_words(ROWS, limits, not_judged), say)
    places = (say("pass", "喷涂道次"), "x mm", "y mm", "z mm")
    splits, slow = report["splits"], report["slowdowns"]
    sections = [
        facts(ROWS, report, more, say),
        *failures_table(ROWS, report["failures"], say),
        element("h2", say("Plan view", "俯视图")),
        *plan_view(judged.plan, coat, say),
        *([] if coat is None else [element("h2", say("Thickness of the coat", "涂层厚度"))]),
        *([] if coat is None else coat_plots(judged.plan, coat, say)),
        element("h2", say("Largest errors", "最大误差")),
        quantities_table(ROWS, report, limits, say),
        element("h2", say("Axes", "各轴")),
        axes_table(judged.evidence.axes, report, say),
        *_surface(report, say),
        *listing(
            say("Splits", "断开处"),
            splits,
            lambda split: _split(split, say),
            (*places, say("reason", "原因")),
            say,
        ),
        *listing(
            say("Slow places", "减速处"), slow, _slow, (*places, say("axis", "轴"), say("gun mm/s", "喷枪 mm/s")), say
        ),
        element("h2", say("Gun speed", "喷枪速度")),
        *speed_plot(samples.pieces, samples.arc_lengths, samples.times, samples.asked, judged.speed, say),
        element("h2", say("Axis positions and speeds", "各轴位置与速度")),
        *axis_plots(judged.evidence.axes, trajectory, say),
        *meanings(ROWS, say),
        *subject_tables(report["subject"], say),
        signatures(say),
    ]
    return document(report, heading, sections, say, PATHS)


def surface_facts(report: dict[str, Any], say: Say = ENGLISH) -> list[tuple[str, str]]:
    """Return the mended faults of the model and the areas out of reach, each as words and a value."""
    pairs = [
        (
            say("out of reach: {reason}", "不可达：{reason}", reason=say.words(REASONS[area["reason"]])),
            f"{area['area_m2']:.4f} m2",
        )
        for area in report["unreachable"]
    ]
    pairs.append((say("splits", "断开处"), str(len(report["splits"]))))
    mended = report["mesh"]["mended"]
    return [
        *pairs,
        *((say(key.replace("_", " "), MENDED[key]), f"{count:,}") for key, count in mended.items() if count),
    ]


def _surface(report: dict[str, Any], say: Say) -> list[Element]:
    rows: list[Cells] = [[say("facets", "三角面"), f"{report['mesh']['facets']:,}"]]
    rows += [[words, value] for words, value in surface_facts(report, say)]
    headings = (say("of the model", "模型"), say("found", "实测"))
    return [element("h2", say("Surface", "曲面")), table(headings, rows, class_="numbers")]


def _split(split: dict[str, Any], say: Say) -> Cells:
    reason = say.words(REASONS[split["reason"]]) if split["reason"] else say("not planned", "非计划")
    return [str(split["pass"]), *_place(split), reason]


def _slow(slow: dict[str, Any]) -> Cells:
    return [str(slow["pass"]), *_place(slow), slow["axis"], f"{slow['speed_mm_per_s']:.1f}"]


def _place(place: dict[str, Any]) -> list[str]:
    return [f"{place[f'{axis}_mm']:.1f}" for axis in "xyz"]
