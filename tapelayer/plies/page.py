"""Page: the HTML report of a ply's courses."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from tapelayer.plies.evidence import PlyEvidence
from tapelayer.plies.maps import STYLE, maps
from tapelayer.plies.quantities import ROWS
from tapelayer.reporting.drawing import element
from tapelayer.reporting.not_judged import sentence
from tapelayer.reporting.page import Cells, document, facts, listing, meanings, quantities_table, signatures
from tapelayer.reporting.quantity import open_words
from tapelayer.reporting.subject import subject_tables
from tapelayer.reporting.words import ENGLISH, Say, Words
from tapelayer.sentences import translated


def html(evidence: PlyEvidence, report: dict[str, Any], not_judged: tuple[Words, ...], say: Say = ENGLISH) -> str:
    """Return the report as one HTML page with maps, for light, dark and print.

    Args:
        evidence: what was measured.
        report: its report as plain values, with its subject.
        not_judged: what no verdict covers.
        say: the language.
    """
    limits = evidence.limits
    sections = [
        facts(ROWS, report, [(say("order", "铺放顺序"), _order(evidence, say))], say),
        *_failures(report["failures"], say),
        element("h2", say("Quantities and limits", "各量与限值")),
        quantities_table(ROWS, report, limits, say),
        element("h2", say("Maps", "分布图")),
        *maps(evidence, say),
        *_courses(report["course_list"], say),
        *subject_tables(report["subject"], say),
        signatures(say),
        *meanings(ROWS, say),
    ]
    return document(report, _verdict(report, open_words(ROWS, limits, not_judged), say), sections, say, STYLE)


def _order(evidence: PlyEvidence, say: Say) -> str:
    if evidence.plan.ply.courses.order == "one_way":
        return say("one way", "单向")
    return say("there and back", "往返")


def _verdict(report: dict[str, Any], free: tuple[Words, ...], say: Say) -> Element:
    """Return the verdict in one line."""
    failures = report["failures"]
    words = say(
        "PASSED: {courses:,} courses, {length:,.1f} m of tape, cover {cover:.2f} % of the ply and keep every limit",
        "合格：{courses:,} 道共 {length:,.1f} m 带料，覆盖铺层的 {cover:.2f} %，符合全部限值",
        courses=report["courses"],
        length=report["laid_length_m"] or 0.0,
        cover=report["coverage_percent"] or 0.0,
    )
    if failures:
        words = say(
            "FAILED: {count:,} failure{s}, the first: {first}",
            "不合格：{count:,} 项，第一项：{first}",
            count=len(failures),
            s="s" if len(failures) > 1 else "",
            first=_sentence(failures[0], say),
        )
    unjudged = (say("; ", "；"), element("span", sentence(free, say), class_="free")) if free else ()
    return element("p", words, *unjudged, class_=f"verdict {'failed' if failures else 'passed'}")


def _sentence(failure: dict[str, Any], say: Say) -> str:
    if "sentence" not in failure:
        return say("{what} could not be measured", "{what} 无法测量", what=failure["what"])
    return translated(failure["sentence"], say.language)


def _failures(failures: list[dict[str, Any]], say: Say) -> list[Element]:
    """Return the sentences of what is not kept; nothing where all is."""

    def cells(failure: dict[str, Any]) -> Cells:
        return [", ".join(map(str, failure.get("courses", []))), _sentence(failure, say)]

    headings = (say("courses", "道次"), say("what is not kept, and where", "不符合项及位置"))
    return listing(say("Failures", "不合格项"), failures, cells, headings, say, class_="subject")


def _courses(courses: list[dict[str, Any]], say: Say) -> list[Element]:
    """Return the table of the courses."""

    def number(value: float | None, form: str) -> str:
        return "" if value is None else f"{value:{form}}"

    def cells(course: dict[str, Any]) -> Cells:
        return [
            str(course["course"]),
            str(course["strip"]),
            number(course["length_mm"], ",.1f"),
            *(number(angle, ".1f") for angle in course["cut_angles_deg"]),
            number(course["lengthened_mm"], ".1f") if course["lengthened_mm"] else "",
            str(course["laid_through"] or ""),
            number(course["max_strain_percent"], ".4f"),
            number(course["max_lift_mm"], ".3f"),
            number(course["max_angle_deviation_deg"], ".2f"),
        ]

    headings = (
        say("course", "道次"),
        say("strip", "条带"),
        say("length mm", "长度 mm"),
        say("start cut deg", "始端切割角 deg"),
        say("end cut deg", "末端切割角 deg"),
        say("lengthened mm", "加长 mm"),
        say("laid through", "铺过间断"),
        say("strain %", "应变 %"),
        say("lift mm", "压辊离面 mm"),
        say("off the angle deg", "角度偏差 deg"),
    )
    return listing(say("Courses", "各道次"), courses, cells, headings, say)
