"""Pages of reports, and what is drawn on them read back in pixels."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.laying.evidence import Evidence
from tapelayer.laying.limits import limits_of
from tapelayer.laying.page import html
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Trajectory
from tapelayer.provenance import NamedFile
from tapelayer.reporting.not_judged import unjudged
from tapelayer.reporting.subject import Subject
from tapelayer.reporting.words import ENGLISH, Say
from tests.helpers.judged import SHA256, numbers_of, trajectory

VOID = {"meta", "link", "br", "hr", "img", "input"}


def subject(title: str = "panel.nc") -> Subject:
    """A made-up subject of a report."""
    return Subject(
        sources=(NamedFile("panel.txt", "1" * 64),),
        setup=NamedFile("job.toml", "2" * 64),
        changed=({"section": "tape", "key": "width_mm", "value": 50.0, "default": 75.0},),
        machine="tapelayer",
        urdf=NamedFile("tapelayer.urdf", "3" * 64),
        controller=NamedFile("jb3208", "4" * 64),
        program=NamedFile(title, SHA256),
        version="0.1.0",
        judged_at="2026-01-01T00:00:00Z",
    )


def page(
    found: Evidence,
    title: str = "panel.nc",
    moves: Trajectory | None = None,
    setup: Setup | None = None,
    say: Say = ENGLISH,
) -> str:
    judged = found if setup is None else replace(found, limits=limits_of(setup))
    report = {"version": "0", "subject": subject(title).values(), **numbers_of(judged)}
    return html(judged, moves or trajectory(), report, setup or Setup(), unjudged(timed=True), say)


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


def figures(text: str, label: str) -> str:
    (found,) = (part for part in re.findall(r"<figure>.*?</figure>", text, re.S) if f'aria-label="{label}' in part)
    return str(found)


def pixels(figure: str) -> tuple[list[Floats], dict[str, float]]:
    """Curves of a figure's lines in pixels, and the heights at which its limits are drawn, by their value as text."""
    elements = Elements(figure)
    lines = [piece for attributes, _ in elements.of("path", "line") for piece in drawn(attributes["d"] or "")]
    limits = {words: float(attributes["y"] or "") - 4 for attributes, words in elements.of("text", "bound")}
    return lines, limits
