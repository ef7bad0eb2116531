"""Job: a mould and a ply become a course file, read back and judged on the mould's own facets."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from tapelayer.arrays import Frozen
from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses
from tapelayer.errors import MeshRefused, PlyRefused, VerificationFailed, printable
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.models import parse_mesh
from tapelayer.jobs.result import UNTOLD, Result
from tapelayer.jobs.stages import JUDGING
from tapelayer.language import Language
from tapelayer.plies import page
from tapelayer.plies.drawing import Drawing
from tapelayer.plies.evidence import PlyEvidence
from tapelayer.plies.failures import evidence_of
from tapelayer.plies.judge import judge_courses
from tapelayer.plies.judgement import NOT_JUDGED
from tapelayer.plies.plan import plan_courses
from tapelayer.plies.ply import Ply
from tapelayer.plies.quantities import ROWS
from tapelayer.plies.ribbons import drawing_of
from tapelayer.progress import UNSEEN, Steps
from tapelayer.provenance import VERSION, NamedFile, sealed
from tapelayer.reporting.quantity import numbers
from tapelayer.reporting.subject import Occasion, told
from tapelayer.reporting.summary import summary
from tapelayer.reporting.words import Say
from tapelayer.setups.forms import changes
from tapelayer.units import MM, Unit
from tapelayer.verification.verified import failure_of

# What reading makes of normals of nine decimals differs by less than this.
NORMAL_ROUNDING = 1e-8
# A ply that is in no file.
UNNAMED = "ply"


@dataclass(frozen=True, eq=False)
class PlyJob(Frozen):
    """Everything that the courses of a ply are planned from.

    Attributes:
        ply: what is asked for.
        mould: its facets.
        name: of the ply's file as the user named it.
        sources: the mould's file, and the boundary's where it is in one.
        sha256: of the ply's values with these files, hexadecimal.
    """

    ply: Ply
    mould: Mesh
    name: str
    sources: tuple[NamedFile, ...]
    sha256: str

    @staticmethod
    def read(path: Path | str) -> PlyJob:
        """Return the job of a ply file.

        Raises:
            PlyRefused: the ply's file or its boundary's cannot be read; all faults of the file at once.
            MeshRefused: the mould's file cannot be read.
        """
        return PlyJob.of_ply(Ply.read(path), str(path))

    @staticmethod
    def of_ply(ply: Ply, name: str = UNNAMED) -> PlyJob:
        """Return the job of a ply, with the mould in the file that it names.

        Raises:
            PlyRefused: the boundary's file cannot be read.
            MeshRefused: the mould's file cannot be read.
        """
        try:
            data = Path(ply.mould.file).read_bytes()
        except OSError as error:
            raise MeshRefused.unreadable(ply.mould.file, error) from None
        return PlyJob.of(data, ply.mould.file, ply, ply_name=name)

    @staticmethod
    def of(data: bytes, name: str, ply: Ply, unit: Unit | None = None, ply_name: str = UNNAMED) -> PlyJob:
        """Return the job of the bytes of a mould.

        Args:
            data: the bytes of the mould's STL.
            name: of the mould's file, for messages.
            ply: what is asked for.
            unit: of the mould's numbers; None for the ply's.
            ply_name: of the ply's file as the user named it.

        Raises:
            MeshRefused: the bytes are no STL that can be used.
            PlyRefused: the boundary's file cannot be read.
        """
        if unit is not None and unit != ply.mould.unit:
            ply = ply.with_values("mould", unit=unit)
        mould = parse_mesh(data, name, ply.mould.unit)
        sources, boundary = [NamedFile(Path(name).name, hashlib.sha256(data).hexdigest())], None
        if file := ply.boundary_file:
            try:
                boundary = file.read_bytes()
            except OSError as error:
                raise PlyRefused.unreadable(str(file), error) from None
            sources.append(NamedFile(file.name, hashlib.sha256(boundary).hexdigest()))
        return PlyJob(ply, mould, ply_name, tuple(sources), ply.sha256(data, boundary))

    def subject(self, occasion: Occasion, sha256: str) -> dict[str, Any]:
        """Return what a report on courses of this ply is about, as plain values for JSON.

        Args:
            occasion: what the caller knows.
            sha256: of the course file, hexadecimal; empty where there is none.
        """
        setup = NamedFile("" if self.name == UNNAMED else Path(self.name).name, self.sha256)
        return {
            "sources": [told(source) for source in self.sources],
            "setup": {**told(setup), "changed": changes(self.ply)},
            "courses": told(NamedFile(occasion.program, sha256)),
            "version": VERSION,
            "judged_at": occasion.judged_at or None,
        }

    def make(self, name: str, steps: Steps = UNSEEN) -> PlyResult:
        """Plan courses, write them, read them back and judge them; `PlyResult.failure` is None if they may be used.

        Args:
            name: of the course file, for messages.
            steps: receiver of progress.

        Raises:
            PlyRefused: the ply does not fit its mould, or the mould is not smooth there; all faults at once.
            TapelayerError: no courses can be planned.
        """
        plan = plan_courses(self.ply, self.mould, steps, self.name)
        steps.begin(JUDGING.name)
        text = self.text(plan.courses)
        courses = parse_courses(text, name)
        assert _same(courses, plan.courses)
        return PlyResult(self, evidence_of(plan, judge_courses(courses, self.ply, plan.region)), text)

    def text(self, courses: Sequence[Course]) -> bytes:
        """Return the bytes of the course file, with lines that say what it was made from and their own hash."""
        ply = self.ply
        mould, *boundary = self.sources
        lines = [
            f"tapelayer {VERSION}: courses of a ply, x y z nx ny nz arc length in mm in the mould's frame",
            f"ply: {printable(Path(self.name).name)}, angle {ply.ply.angle_deg:g} deg, width {ply.tape.width_mm:g} mm, "
            f"{len(courses)} courses {ply.courses.order.replace('_', ' ')}",
            f"ply sha256: {self.sha256}",
            f"mould: {printable(mould.name)} in {ply.mould.unit}",
            f"mould sha256: {mould.sha256}",
            *(f"boundary: {printable(file.name)}" for file in boundary),
            *(f"boundary sha256: {file.sha256}" for file in boundary),
        ]
        head = "".join(f"# {line}\n" for line in lines).encode()
        return sealed(head + format_courses(courses), len(head), "# text sha256: ")


def _same(read: Sequence[Course], written: Sequence[Course]) -> bool:
    """Return whether courses are the same, number by number."""
    return len(read) == len(written) and all(
        one.number == other.number
        and one.cut_angles == other.cut_angles
        and np.array_equal(one.points, other.points)
        and np.array_equal(one.arc_lengths, other.arc_lengths)
        and np.allclose(one.normals, other.normals, rtol=0.0, atol=NORMAL_ROUNDING)
        for one, other in zip(read, written, strict=True)
    )


@dataclass(frozen=True, eq=False)
class PlyResult(Result):
    """The courses of a ply, and what was measured on them.

    Attributes:
        job: the job that was done.
        evidence: every measurement, and what is not kept.
        text: bytes of the course file.
        remarks: sentences to print beside the verdict.
    """

    job: PlyJob
    evidence: PlyEvidence
    text: bytes
    remarks: tuple[str, ...] = ()

    @property
    def failure(self) -> VerificationFailed | None:
        """Why the courses may not be used; None where every limit is kept."""
        return failure_of(self.evidence)

    @property
    def courses(self) -> tuple[Course, ...]:
        """The courses, in the mould's frame."""
        return self.evidence.plan.courses

    def drawing(self) -> Drawing:
        """Return what of the plan is drawn over its mould."""
        return drawing_of(self.evidence)

    def numbers(self) -> dict[str, Any]:
        """Return the verdict and all that was measured; docs/report.md describes every key."""
        return numbers(ROWS, self.evidence, self.evidence, NOT_JUDGED)

    def report(self, occasion: Occasion = UNTOLD) -> dict[str, Any]:
        """Return the report as plain values for JSON: the same for the same ply, mould and occasion."""
        subject = self.job.subject(occasion, hashlib.sha256(self.text).hexdigest())
        return {"version": VERSION, "subject": subject, **self.numbers()}

    def summary(self, language: Language = "en") -> Table:
        """Return the report as a table for a terminal."""
        return summary(ROWS, self.numbers(), self.evidence.limits, NOT_JUDGED, say=Say(language))

    def page(self, occasion: Occasion = UNTOLD, language: Language = "en") -> str:
        """Return the report as one HTML page with maps; its title is the course file's name."""
        return page.html(self.evidence, self.report(occasion), NOT_JUDGED, Say(language))

    def notes(self, language: Language = "en") -> tuple[str, ...]:
        """Return what was done beyond what was asked for, and what would be better."""
        say, evidence = Say(language), self.evidence
        notes = []
        if lengthened := evidence.lengthened:
            most = max(2.0 * piece.lengthened for piece in evidence.plan.pieces) / MM
            notes.append(
                say(
                    "{courses} lengthened by up to {most:.1f} mm, at both ends alike",
                    "{courses} 已加长，至多 {most:.1f} mm，两端均分",
                    courses=_listed(lengthened, say),
                    most=most,
                )
            )
        if crossed := evidence.laid_through:
            notes.append(
                say(
                    "{courses} laid through interruptions shorter than {hole:g} mm",
                    "{courses} 直接铺过短于 {hole:g} mm 的间断",
                    courses=_listed(crossed, say),
                    hole=self.job.ply.courses.minimum_hole_mm,
                )
            )
        if (stagger := evidence.better_stagger) is not None:
            notes.append(
                say(
                    "an outer course covers only {breadth:.1f} mm of the ply's breadth; [courses] stagger_mm = "
                    "{stagger:.1f} would leave no sliver",
                    "最外一道只覆盖铺层宽度的 {breadth:.1f} mm；[courses] stagger_mm = {stagger:.1f} 可避免窄条",
                    breadth=float(np.min(evidence.plan.family.breadths)) / MM,
                    stagger=stagger / MM,
                )
            )
        return tuple(notes)


def _listed(numbers: Sequence[int], say: Say) -> str:
    """Return courses in words.

    Examples:
        >>> _listed([3], Say("en")), _listed([1, 2, 9], Say("en")), _listed([1, 2], Say("zh"))
        ('course 3', 'courses 1, 2 and 9', '道次 1、2')
    """
    if len(numbers) == 1:
        return say("course {n}", "道次 {n}", n=numbers[0])
    first = say(", ", "、").join(map(str, numbers[:-1]))
    return say("courses {first} and {last}", "道次 {first}、{last}", first=first, last=numbers[-1])
