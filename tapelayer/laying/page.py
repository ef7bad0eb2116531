"""Page: the HTML report of a tape-laying program."""

from __future__ import annotations

from typing import Any

from tapelayer.laying.error_plots import course_plots
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.plan_view import plan_view
from tapelayer.laying.quantities import ROWS
from tapelayer.laying.settings import Setup
from tapelayer.laying.tape_view import tape_view
from tapelayer.motion.trajectory import Trajectory
from tapelayer.reporting.axis_plots import axis_plots
from tapelayer.reporting.drawing import element
from tapelayer.reporting.page import (
    axes_table,
    document,
    facts,
    failures_table,
    meanings,
    quantities_table,
    signatures,
    verdict,
)
from tapelayer.reporting.quantity import open_words
from tapelayer.reporting.speed_plot import speed_plot
from tapelayer.reporting.subject import subject_tables
from tapelayer.reporting.words import ENGLISH, NOT_MEASURED, Say, Words, shown

SHARES = {
    "laying": Words("time laying", "铺放时间占比"),
    "threading": Words("time threading", "送带时间占比"),
    "linking": Words("time linking", "过渡时间占比"),
}

COURSES = ("courses", Words("courses", "道次"))


def html(
    evidence: Evidence,
    trajectory: Trajectory,
    report: dict[str, Any],
    setup: Setup,
    not_judged: tuple[Words, ...],
    say: Say = ENGLISH,
) -> str:
    """Return the report as one HTML page with plots, for light, dark and print.

    Args:
        evidence: the measurements of verification.
        trajectory: the program that was judged.
        report: its report as plain values, with its subject.
        setup: the job's values.
        not_judged: what no verdict covers.
        say: the language.
    """
    limits, absent, samples = evidence.limits, say.words(NOT_MEASURED), evidence.samples
    more = [
        *((say.words(SHARES[key]), shown(share, "%", "z.1f", absent)) for key, share in report["time_shares"].items()),
        (say("kinematics", "运动学"), setup.process.kinematics),
    ]
    judged = verdict(ROWS, report, limits, COURSES, open_words(ROWS, limits, not_judged), say)
    sections = [
        facts(ROWS, report, more, say),
        *failures_table(ROWS, report["failures"], say),
        element("h2", say("Largest errors", "最大误差")),
        quantities_table(ROWS, report, limits, say),
        element("h2", say("Axes", "各轴")),
        axes_table(evidence.axes, report, say),
        *subject_tables(report["subject"], say),
        signatures(say),
        element("h2", say("Plan view", "俯视图")),
        *plan_view(evidence, say),
        element("h2", say("Tape", "带料")),
        *tape_view(evidence, report, say),
        element("h2", say("Laying speed", "铺放速度")),
        *speed_plot(samples.courses, samples.arc_lengths, samples.times, samples.asked, evidence.lay_speed, say),
        element("h2", say("Errors along the courses", "沿道次的误差")),
        *course_plots(evidence, say),
        element("h2", say("Axis positions and speeds", "各轴位置与速度")),
        *axis_plots(evidence.axes, trajectory, say),
        *meanings(ROWS, say),
    ]
    return document(report, judged, sections, say)
