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
    printable,
    quantities_table,
    signatures,
    verdict,
)
from tapelayer.reporting.words import shown


def html(evidence: Evidence, trajectory: Trajectory, report: dict[str, Any], setup: Setup, title: str) -> str:
    """Return the report as one HTML page with plots, for light, dark and print.

    Args:
        evidence: the measurements of verification.
        trajectory: the program that was judged.
        report: its report as plain values.
        setup: the job's values.
        title: title of the report, the program's name.
    """
    limits, shares = evidence.limits, report["time_shares"]
    more = [
        ("time " + ", ".join(shares), ", ".join(shown(share, "%", "z.1f") for share in shares.values())),
        ("kinematics", setup.process.kinematics),
        ("controller", printable(setup.output.controller)),
    ]
    sections = [
        facts(ROWS, report, more),
        *failures_table(report["failures"]),
        element("h2", "Largest errors"),
        quantities_table(ROWS, report, limits),
        element("h2", "Axes"),
        axes_table(evidence.axes, report),
        signatures(),
        element("h2", "Plan view"),
        *plan_view(evidence),
        element("h2", "Tape"),
        *tape_view(evidence, report),
        element("h2", "Errors along the courses"),
        *course_plots(evidence),
        element("h2", "Axis positions and speeds"),
        *axis_plots(evidence.axes, trajectory),
    ]
    return document(title, verdict(ROWS, report, limits, "courses"), sections)
