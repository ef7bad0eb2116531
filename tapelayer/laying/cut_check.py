"""Cut check: the cuts that a program makes, by forward kinematics, against the cuts that the courses need."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from tapelayer.arrays import Floats, Ints
from tapelayer.laying.evidence import CutMade, LayingStop, LedgerRow, TapeLedger
from tapelayer.laying.laid import Case, Laid
from tapelayer.laying.settings import Setup
from tapelayer.motion.trajectory import Event, Kind
from tapelayer.units import DEG, MM
from tapelayer.verification.failures import Failure

KNIVES = (("knife_1", Event.KNIFE_1_DOWN, Event.KNIFE_1_UP), ("knife_2", Event.KNIFE_2_DOWN, Event.KNIFE_2_UP))
# Two cuts that diverge by no more than this over the tape and both clearances are one line (docs: tape coordinates).
SAME_LINE = 1e-5
# Largest rounding of the tape drawn from a roll, from the last written digits of u.
ROLL_DIGIT = 2e-6
# Rounding of a knife's place across, in metres, where it crosses an edge.
EDGE = 1e-9
# Fractions of a block at which a lowered knife is looked at, beside where it crosses the edges of tape and sweep.
SAMPLED_AT = np.linspace(0.0, 1.0, 9)
# A sweep farther than this from every line that the courses need makes none of these cuts.
STRAY = 1e-3


@dataclass(frozen=True)
class _Line:
    """A line to be cut: sigma(w) = station + w cot(angle); courses by index, -1 for none."""

    station: float
    angle: float
    ending: int
    starting: int


@dataclass(frozen=True, eq=False)
class _Track:
    """A knife's path on the tape while it is down.

    Attributes:
        stations: (n,) metres along the tape.
        across: (n,) metres from the centre line.
        blades: (n, 2) directions of the blade.
    """

    stations: Floats
    across: Floats
    blades: Floats

    def over(self, half: float) -> _Track:
        """Return the part over a tape of half a width, metres; everything, if none is."""
        over = np.abs(self.across) <= half + EDGE
        return _Track(self.stations[over], self.across[over], self.blades[over]) if np.any(over) else self

    def off(self, line: _Line) -> float:
        """Return the largest distance in metres from a line."""
        away = self.stations - line.station - self.across / math.tan(line.angle)
        return float(np.max(np.abs(away))) * math.sin(line.angle)

    def turned(self, line: _Line) -> float:
        """Return the largest angle in radians between blade and line."""
        direction = np.array([-np.cos(line.angle), np.sin(line.angle)])
        across = self.blades[:, 0] * direction[1] - self.blades[:, 1] * direction[0]
        return float(np.max(np.abs(np.arctan2(across, self.blades @ direction))))


@dataclass(frozen=True, eq=False)
class _KnifePass:
    """What a knife does while it is down.

    Attributes:
        knife: 1 or 2.
        row: block of the word that lowers it.
        begin: seconds at which it is down.
        programmed: its path as its blocks state it, from where it goes down to where it goes up.
        rounded: its path as the control rounds it off.
        half: half the tape's width, metres.
        reach: half the width that a sweep must cross, clearances included, less the error of a cut, metres.
    """

    knife: int
    row: int
    begin: float
    programmed: _Track
    rounded: _Track
    half: float
    reach: float

    @cached_property
    def _cutting(self) -> tuple[_Track, _Track]:
        """Return what must keep to a line: the sweep as programmed, and as the control rounds it off over the tape."""
        return self.programmed.over(self.reach), self.rounded.over(self.half)

    @property
    def ends(self) -> Floats:
        """Return the distances (2,) in metres from the centre line to the sweep's ends, as programmed."""
        return np.abs(self.programmed.across[[0, -1]])

    def off(self, line: _Line) -> float:
        """Return the largest distance in metres from a line over the tape and both clearances."""
        return max(track.off(line) for track in self._cutting)

    def astray(self, line: _Line) -> float:
        """Return the largest distance in metres from a line, beside the tape too."""
        return max(self.off(line), self.programmed.off(line))

    def turned(self, line: _Line) -> float:
        """Return the largest angle in radians between blade and line."""
        return max(track.turned(line) for track in self._cutting)


def judge_cuts(case: Case) -> tuple[TapeLedger, list[Failure]]:
    """Return the tape's ledger as the program makes it, and the failures of its cuts."""
    courses, edges = case.courses, _roll_edges(case)
    fresh = [not index or edges[index + 1] > edges[index] for index in range(len(courses))]
    lines = _lines(case, fresh)
    made, failures = _matched(case, lines, _sweeps(case))
    stops = [_stops(case, course) for course in courses]
    rows, overlaps = _ledger(case, fresh, edges, lines, made, [len(own) for own in stops])
    failures += [*overlaps, *_rolls(case)]
    used = courses[-1].station + courses[-1].length - edges[0] if courses else 0.0
    return TapeLedger(tuple(rows), tuple(made), tuple(chain(*stops)), used, *_shares(case)), failures


def _roll_edges(case: Case) -> list[float]:
    """Return the station of the first roll's leading edge (the first u) and of each course's roll (u at its stop)."""
    trajectory, u = case.trajectory, case.fed
    stops = np.flatnonzero(trajectory.events == Event.STOP)
    edges = np.append(u[np.argmin(np.isnan(u))], u[stops + 1])
    before = np.searchsorted(trajectory.times[stops], [course.begin for course in case.courses], side="right")
    return [float(edge) for edge in edges[np.append(0, before)]]


def _sweep_width(setup: Setup) -> float:
    """Return how far across a knife sweeps, in metres: the tape's width and both clearances."""
    return (setup.tape.width_mm + 2 * setup.head.knife_clearance_mm) * MM


def _lines(case: Case, fresh: Sequence[bool]) -> list[_Line]:
    """Return the lines to be cut, in order along the tape; a cut that two courses share is one line."""
    sweep_width = _sweep_width(case.setup)
    lines: list[_Line] = []
    for index, course in enumerate(case.courses):
        start, end = course.cut_angles
        last = lines[-1] if lines else None
        if (
            last
            and not fresh[index]
            and abs(1 / np.tan(last.angle) - 1 / np.tan(start)) * sweep_width <= SAME_LINE
            and abs(last.station - course.station) <= case.setup.verification.max_cut_error_mm * MM
        ):
            lines[-1] = _Line(last.station, last.angle, last.ending, index)
        else:
            lines.append(_Line(course.station, start, -1, index))
        lines.append(_Line(course.station + course.length, end, index, -1))
    return lines


def _sweeps(case: Case) -> list[_KnifePass]:
    """Return the paths of the knives while they are down, in order of time."""
    trajectory, delay = case.trajectory, case.setup.head.delays_ms.knife * 1e-3
    half = case.setup.tape.width_mm / 2 * MM
    reach = _sweep_width(case.setup) / 2 - case.setup.verification.max_cut_error_mm * MM
    sweeps: list[_KnifePass] = []
    for knife, (frame, down, up) in enumerate(KNIVES, 1):
        before = len(sweeps)
        ups = np.flatnonzero(trajectory.events == up)
        spans = []
        for row in np.flatnonzero(trajectory.events == down):
            later = ups[ups > row]
            begin = float(trajectory.times[row]) + delay
            end = float(trajectory.times[later[0]]) + delay if len(later) else trajectory.duration
            first, last = np.searchsorted(trajectory.times, [begin, max(begin, end)], side="right")
            # From the moment the knife touches to the moment it lifts, at places in every block between.
            edges = np.concatenate([[begin], trajectory.times[first:last], [max(begin, end)]])
            blocks = np.minimum(np.arange(first, last + 1), len(trajectory) - 1)
            shares = np.stack([trajectory.fractions(blocks, edges[:-1]), trajectory.fractions(blocks, edges[1:])])
            spans.append((knife, int(row), begin, blocks, shares))
        if not spans:
            continue
        blocks = np.concatenate([blocks for *_, blocks, _ in spans])
        shares = np.concatenate([shares for *_, shares in spans], axis=1)
        sampled = _sampled(case, frame, blocks, shares, (half, reach))
        places, rows = sampled.ravel(), np.repeat(blocks, sampled.shape[1])
        tracks = [_on_tape(case, frame, joints(rows, places)) for joints in (trajectory.within, trajectory.rounded)]
        counts = [sampled.shape[1] * len(own) for *_, own, _ in spans]
        for (number, down_row, begin, *_), last in zip(spans, np.cumsum(counts).tolist(), strict=True):
            own = slice(last - counts[len(sweeps) - before], last)
            programmed, rounded = (_Track(*(values[own] for values in track)) for track in tracks)
            sweeps.append(_KnifePass(number, down_row, begin, programmed, rounded, half, reach))
    return sorted(sweeps, key=lambda sweep: sweep.begin)


def _sampled(case: Case, frame: str, blocks: Ints, shares: Floats, edges: tuple[float, ...]) -> Floats:
    """Return the fractions (b, s) of blocks (b,) at which a knife is looked at, from shares[0] to shares[1].

    Args:
        case: what is judged.
        frame: of the knife.
        blocks: (b,) while the knife is down.
        shares: (2, b) of the way along each block where the knife's part of it begins and ends.
        edges: distances from the centre line, metres; where the knife crosses one, it is looked at.
    """
    begins, ends = (_on_tape(case, frame, case.trajectory.within(blocks, share))[1] for share in shares)
    crossed = np.array([side * edge for edge in edges for side in (-1.0, 1.0)])
    across, nowhere = (ends - begins)[:, None], np.zeros((len(blocks), len(crossed)))
    crossings = np.divide(crossed - begins[:, None], across, out=nowhere, where=across != 0.0)
    even = np.tile(SAMPLED_AT, (len(blocks), 1))
    fractions = np.sort(np.hstack([even, np.clip(crossings, 0.0, 1.0)]), axis=1)
    sampled: Floats = shares[0][:, None] + fractions * (shares[1] - shares[0])[:, None]
    return sampled


def _on_tape(case: Case, frame: str, joints: Floats) -> tuple[Floats, Floats, Floats]:
    """Return stations (n,), places across (n,) in metres and blade directions (n, 2) of a knife at joints (n, k)."""
    poses = case.machine.forward_all(joints, ("tape", frame))
    tape, blade = poses["tape"], poses[frame]
    # The knife's origin and blade in the tape's axes: stations run against x, across along y.
    place = np.einsum("nji,nj->ni", tape[:, :3, :3], blade[:, :3, 3] - tape[:, :3, 3])
    turned = np.einsum("nji,nj->ni", tape[:, :3, :3], blade[:, :3, 1])[:, :2]
    return -place[:, 0], place[:, 1], turned


def _matched(case: Case, lines: Sequence[_Line], sweeps: Sequence[_KnifePass]) -> tuple[list[CutMade], list[Failure]]:
    """Return the cuts made, and failures: lines not cut, cut twice or badly cut, and sweeps that cut no line."""
    trajectory, courses = case.trajectory, case.courses
    limits, sweep_width = case.setup.verification, _sweep_width(case.setup)
    stations = np.array([line.station for line in lines])
    by_line: dict[int, list[_KnifePass]] = {}
    failures = []
    for sweep in sweeps:
        line_number = int(trajectory.lines[sweep.row])
        middle = float(np.mean(sweep.programmed.stations))
        near = np.argsort(np.abs(stations - middle))[:8]
        offs = [sweep.astray(lines[candidate]) for candidate in near]
        if not offs or not min(offs) <= STRAY:
            off = min(offs, default=np.inf) / MM
            failures.append(Failure(0, 0, f"knife_{sweep.knife}_off_every_cut_mm", off, STRAY / MM, line_number))
            continue
        by_line.setdefault(int(near[int(np.argmin(offs))]), []).append(sweep)
    fed = trajectory.positions[:, trajectory.column("u")]
    made = []
    for index, line in enumerate(lines):
        owner = line.ending if line.ending >= 0 else line.starting
        course, point = courses[owner].number, courses[owner].points if line.ending >= 0 else 1
        by = by_line.get(index, [])
        if len(by) != 1:
            # The block that cuts it again, or that feeds the tape past it uncut.
            block = by[1].row if by else int(np.argmax(fed >= line.station))
            failures.append(Failure(course, point, "cuts_made", len(by), 1, int(trajectory.lines[block])))
            continue
        sweep = by[0]
        row = int(trajectory.lines[sweep.row])
        error, turned = sweep.off(line), sweep.turned(line)
        if not error <= limits.max_cut_error_mm * MM:
            failures.append(Failure(course, point, "cut_error_mm", error / MM, limits.max_cut_error_mm, row))
        if not turned <= limits.max_blade_error_deg * DEG:
            failures.append(Failure(course, point, "blade_error_deg", turned / DEG, limits.max_blade_error_deg, row))
        across = np.append(sweep.rounded.across, sweep.programmed.across)
        side = float(min(-np.min(across), np.max(across), *sweep.ends))
        rounded = float(min(-np.min(sweep.rounded.across), np.max(sweep.rounded.across)))
        allowed = limits.max_cut_error_mm * MM
        if not (side >= sweep_width / 2 - allowed and rounded >= sweep.half - allowed):
            failures.append(Failure(course, point, "cut_width_mm", 2 * side / MM, sweep_width / MM, row))
        made.append(
            CutMade(
                station=line.station,
                angle=line.angle,
                ending=courses[line.ending].number if line.ending >= 0 else 0,
                starting=courses[line.starting].number if line.starting >= 0 else 0,
                knife=sweep.knife,
                block=sweep.row + 1,
                line=row,
                error=error,
                blade_error=turned,
            )
        )
    return made, failures


def _ledger(
    case: Case,
    fresh: Sequence[bool],
    edges: Sequence[float],
    lines: Sequence[_Line],
    made: Sequence[CutMade],
    stops: Sequence[int],
) -> tuple[list[LedgerRow], list[Failure]]:
    """Return the tape by course, and failures of courses whose cuts lie closer together than the angles allow."""
    trajectory, courses, setup = case.trajectory, case.courses, case.setup
    width, margin = setup.tape.width_mm * MM, setup.head.scrap_margin_mm * MM
    shared = {line.starting for line in lines if line.ending >= 0}
    rows, failures, before = [], [], edges[0]
    for index, course in enumerate(courses):
        left = edges[index + 1] - before if fresh[index] else 0.0
        gap = course.station - before - left
        cot = 1 / np.tan(course.cut_angles[0])
        turn = abs(cot) if fresh[index] else abs(1 / np.tan(courses[index - 1].cut_angles[1]) - cot)
        one_line = not fresh[index] and turn * _sweep_width(setup) <= SAME_LINE
        formula = 0.0 if one_line else width / 2 * turn + margin
        knives = 0.0 if index in shared else gap - formula
        if not knives >= -setup.verification.max_cut_error_mm * MM:
            block = min(int(np.searchsorted(trajectory.times, course.begin)), len(trajectory) - 1)
            line_number = int(trajectory.lines[block])
            failures.append(Failure(course.number, 1, "waste_before_mm", gap / MM, formula / MM, line_number))
        rows.append(
            LedgerRow(
                course=course.number,
                length=course.length,
                station=course.station,
                waste_roll=left,
                waste_formula=formula,
                # A rounding error below the formula is no negative waste.
                waste_knives=max(knives, 0.0),
                laying_stops=stops[index],
                cuts=tuple(cut.block for cut in made if course.number in (cut.starting, cut.ending)),
            )
        )
        before = course.station + course.length
    return rows, failures


def _stops(case: Case, course: Laid) -> list[LayingStop]:
    """Return the places where the tape stops while a course is laid: the control's own stops, and rests."""
    trajectory = case.trajectory
    first, last = np.searchsorted(trajectory.times, [course.begin, course.end], side="right")
    rows = np.arange(first, min(last, len(trajectory)))
    u = trajectory.column("u")
    fed = trajectory.positions[rows, u] != trajectory.begins(rows)[:, u]
    feeding = rows[fed]
    if not len(feeding):
        return []
    rests = (
        np.bincount(np.cumsum(fed), trajectory.durations[rows], len(feeding) + 1)[1:] - trajectory.durations[feeding]
    )
    stands = rests > 0.0
    if trajectory.clock is not None:
        stands |= trajectory.clock.stands[feeding]
    # At the end of a course the tape stops as it should.
    places = np.flatnonzero(stands[:-1])
    arcs = trajectory.positions[feeding, u] - case.setup.head.knife_to_nip_mm * MM - course.station
    lines = trajectory.lines[feeding]
    return [LayingStop(course.number, float(arcs[i]), float(rests[i]), int(lines[i])) for i in places.tolist()]


def _rolls(case: Case) -> list[Failure]:
    """Return failures of rolls that supply more tape, up to knife 2 at their start and end, than they hold."""
    trajectory, length, u = case.trajectory, case.setup.tape.roll_length_m, case.fed
    stops = np.flatnonzero(trajectory.events == Event.STOP) + 1
    known = int(np.argmin(np.isnan(u)))
    knives = case.machine.forward_all(np.zeros((1, len(case.machine.axes))), ("knife_1", "knife_2"))
    pitch = float(np.linalg.norm(knives["knife_1"][0, :3, 3] - knives["knife_2"][0, :3, 3]))
    failures = []
    for first, last in zip([known, *stops], [*stops, len(u)], strict=True):
        used = u[first:last] - u[first] + pitch
        empty = np.flatnonzero(~(used <= length + ROLL_DIGIT))
        if len(empty):
            line = int(trajectory.lines[max(first + int(empty[0]) - 1, 0)])
            failures.append(Failure(0, 0, "roll_used_m", float(np.max(used)), length, line))
    return failures


def _shares(case: Case) -> tuple[float, float, float]:
    """Return the seconds that the program spends laying, threading, and on everything else."""
    trajectory, courses = case.trajectory, case.courses
    laying = sum(course.end - course.begin for course in courses)
    outside = trajectory.kinds == Kind.LINEAR
    for course in courses:
        first, last = np.searchsorted(trajectory.times, [course.begin, course.end], side="right")
        outside[first:last] = False
    rows = np.flatnonzero(outside)
    u = trajectory.column("u")
    fed = trajectory.positions[rows, u] != trajectory.begins(rows)[:, u]
    threading = float(np.sum(trajectory.durations[rows[fed]]))
    return laying, threading, trajectory.duration - laying - threading
