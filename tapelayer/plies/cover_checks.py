"""Cover checks: what of a ply lies under tape, by spots on the facets and points along the boundary."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.plies.gap_profiles import GapProfiles
from tapelayer.plies.laid_ply import Fault, LaidPly
from tapelayer.plies.tape_cover import Overhang, TapeCover, boundary_points
from tapelayer.units import MM

_SEED = 1
# Accuracy of spots on the facets, metres.
_SPOT_ERROR = 0.05 * MM
# How far boundary and cut may miss each other, metres: boundaries are cut to by points.
CUT_ERROR = 0.2 * MM
# Steps of lines, metres, by which interruptions are measured.
_HOLE_ERROR = 10 * MM


class CoverCheck:
    """The cover of a ply.

    Args:
        laid: the courses on their mould.
        samples: spots drawn on the whole mould, from which those in the ply are taken.

    Attributes:
        area: of the ply's facets, m^2.
        inside: (n,) whether points are spots in the ply; the others are points along the boundary.
        points: (n, 3) metres.
        cover: of the points.
    """

    def __init__(self, laid: LaidPly, samples: int) -> None:
        self.laid = laid
        surface, terms = laid.surface, laid.terms
        spots = surface.sampled(samples, _SEED)
        plan = surface.on_facets(spots)[:, :2]
        kept = shapely.contains_xy(laid.outline, plan)
        edge = surface.spots(boundary_points(laid.target))
        spots = spots.joined([spots.rows(kept), edge.rows(edge.inside)])
        self.area = float(np.sum(surface.areas)) * float(np.mean(kept))
        self.inside: Mask = np.arange(len(spots.facets)) < np.sum(kept)
        self.points = surface.points(spots)
        self.cover = TapeCover.of(
            laid.lines, self.points, surface.normals(spots), max(terms.max_gap, 0.0) + MM, CUT_ERROR
        )
        self._bare = ~(self.cover.beside <= max(terms.max_gap, 0.0) + _SPOT_ERROR)

    def share(self, tapes: int) -> float:
        """Return the percentage of the ply under at least so many tapes; NaN where it has no spot."""
        return 100.0 * float(np.mean(self.cover.counts[self.inside] >= tapes)) if np.any(self.inside) else math.nan

    @property
    def deepest(self) -> float:
        """Largest breadth of an overlap, metres; minus infinity where no spot lies under two tapes."""
        return float(np.max(self.cover.depths[self.inside & (self.cover.counts > 1)], initial=-math.inf))

    @property
    def short(self) -> Mask:
        """Points (n,) that the cut of a course falls short of."""
        return self._bare & np.isfinite(self.cover.short)

    @property
    def lack(self) -> float:
        """Largest distance from a cut to a point that it falls short of, metres."""
        return float(np.max(self.cover.short[self.short], initial=0.0))

    def uncovered(self) -> tuple[Ints, Floats]:
        """Return the rows (k,) of spots that are too far from tape, and their distances (k,) in metres, about."""
        rows = np.flatnonzero(self._bare & self.inside)
        lines = np.concatenate([line.points[line.inner] for line in self.laid.lines])
        distances, _ = cKDTree(lines).query(self.points[rows])
        return rows, np.maximum(distances - self.laid.terms.width / 2, 0.0)

    def faults(self, profiles: GapProfiles) -> list[Fault]:
        """Return a fault for each cut that falls short, one for what is not covered, and for each other overlap."""
        return [*self._short_cuts(), *self._bare_spots(), *self._overlaps(profiles)]

    def _short_cuts(self) -> list[Fault]:
        faults = []
        for end in np.unique(self.cover.ends[self.short]).tolist():
            rows = np.flatnonzero(self.short & (self.cover.ends == end))
            worst = rows[np.argmax(self.cover.short[rows])]
            number, point = self.laid.courses[end // 2].number, self.points[worst]
            sentence = (
                f"course {number}: its {'end' if end % 2 else 'start'} cut falls {self.cover.short[worst] / MM:.2f} mm "
                f"short of the ply at {self.laid.at(point)}, expected at most {CUT_ERROR / MM:g}"
            )
            faults.append(Fault(sentence, (number,), self.laid.place(point)))
        return faults

    def _bare_spots(self) -> list[Fault]:
        rows, distances = self.uncovered()
        others = ~np.isfinite(self.cover.short[rows])
        if not np.any(others):
            return [] if np.any(self.inside) else [Fault("the ply has no spot on the mould that could be covered")]
        worst = int(np.argmax(np.where(others, distances, -1.0)))
        point, share = self.points[rows[worst]], 100 * float(np.sum(others)) / max(float(np.sum(self.inside)), 1.0)
        sentence = (
            f"{share:.2f} % of the ply is not covered, near {self.laid.at(point)}, {distances[worst] / MM:.1f} mm from "
            f"tape, expected at most {max(self.laid.terms.max_gap, 0.0) / MM:g}"
        )
        return [Fault(sentence, (), self.laid.place(point))]

    def _overlaps(self, profiles: GapProfiles) -> list[Fault]:
        limit = max(self.laid.terms.max_overlap, 0.0) + _SPOT_ERROR
        rows = np.flatnonzero(self.inside & (self.cover.depths > limit))
        known = {tuple(sorted(pair)) for pair in profiles.pairs.tolist()}
        pairs = np.sort(self.cover.over[rows], axis=1)
        faults = []
        for pair in np.unique(pairs, axis=0).tolist():
            if tuple(pair) in known:
                continue
            of_pair = rows[np.all(pairs == pair, axis=1)]
            worst = of_pair[np.argmax(self.cover.depths[of_pair])]
            point, numbers = self.points[worst], sorted(self.laid.courses[row].number for row in pair)
            sentence = (
                f"courses {numbers[0]} and {numbers[1]} lie on each other at {self.laid.at(point)}, "
                f"{self.cover.depths[worst] / MM:.2f} mm broad, expected at most {max(limit - _SPOT_ERROR, 0.0) / MM:g}"
            )
            faults.append(Fault(sentence, tuple(numbers), self.laid.place(point)))
        return faults


def hole_faults(laid: LaidPly, hangs: Sequence[Overhang]) -> list[Fault]:
    """Return a fault for each course laid through an interruption of the ply longer than allowed."""
    limit, faults = laid.terms.minimum_hole, []
    for course, line, hang in zip(laid.courses, laid.lines, hangs, strict=True):
        if not hang.laid_through <= limit + _HOLE_ERROR:
            point = line.points[hang.sample]
            sentence = (
                f"course {course.number} is laid through {hang.laid_through / MM:.0f} mm outside the ply at "
                f"{laid.at(point)}, expected at most {limit / MM:g}: split it"
            )
            faults.append(Fault(sentence, (course.number,), laid.place(point)))
    return faults
