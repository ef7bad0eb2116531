"""Normal check: single normals of a course file that fit neither their neighbours nor the points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.courses.table import CourseTable, TableSteps, from_mm
from tapelayer.vectors import dot

# Degrees beyond what the surface explains. It explains a turn there and back as far as the neighbours' normals are
# apart, the chords turn near the point, and the normals beyond the neighbours turn too. The normals of real courses in
# steps of 1 mm, of the examples and of 400 random plies stay within that sum; off the chords' perpendicular they stand
# at most 1.1 deg more than the chords turn. The rest of the margin is for few decimals and for normals of facets.
MARGIN_DEG = 3.0
# Degrees from normal to normal that no crease turns: one of the two points into the surface.
OPPOSED_DEG = 170.0


@dataclass(frozen=True, eq=False)
class NormalCheck:
    """The normals of a table against their neighbours and against the chords beside them.

    Attributes:
        turns: (n,) angle from the normal of the point before, degrees; 0 where there is none.
        excess: (n,) half of what the normal turns away from its neighbours and back, degrees; 0 where not judged.
        apart: (n,) angle between the neighbours' normals, degrees.
        lean: (n,) larger angle of the normal off the perpendiculars of the chords beside it, degrees; 0 where not
            judged.
        bend: (n,) largest turn of the chords at the point and its neighbours, degrees.
        turning: (n,) the normal turns against both neighbours by more than the surface can.
        leaning: (n,) the normal stands off the chords' perpendicular by more than the chords turn.
        opposed: (n,) the normal points to the other side of the surface than that of the point before.
    """

    turns: Floats
    excess: Floats
    apart: Floats
    lean: Floats
    bend: Floats
    turning: Mask
    leaning: Mask
    opposed: Mask

    @classmethod
    def of(cls, table: CourseTable, steps: TableSteps) -> NormalCheck | None:
        """Return the check of a table, or None where no normal is near the margin.

        Examples:
            >>> rows = np.array([[0, 10 * i, 0, float(i == 2), 0, 1, 10 * i] for i in range(5)], dtype=float)
            >>> table = CourseTable([1], [(1.0, 1.0)], np.array([5]), rows, np.ones(5, dtype=bool))
            >>> check = NormalCheck.of(table, TableSteps.of(table))
            >>> check.turning.tolist(), round(float(check.excess[2]), 6)
            ([False, False, True, False, False], 45.0)
        """
        usable = steps.inside & (steps.chords > 0.0) & np.isfinite(steps.chords)
        if np.any(table.without_normal):
            usable &= ~(table.without_normal[:-1] | table.without_normal[1:])
        if not np.any(usable):
            return None
        normals = table.normals
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            chords = from_mm(np.diff(table.rows[:, :3], axis=0))
            ahead = np.abs(dot(chords, normals[:-1])) / steps.chords
            behind = np.abs(dot(chords, normals[1:])) / steps.chords
            turned = dot(normals[:-1], normals[1:])
            # Most files end here.
            near = (turned < math.cos(math.radians(MARGIN_DEG))) | (
                np.maximum(ahead, behind) > math.sin(math.radians(MARGIN_DEG))
            )
            if not np.any(near & usable):
                return None
            directions = chords / steps.chords[:, None]
        return cls._in_full(normals, directions, usable, ahead, behind)

    @classmethod
    def _in_full(cls, normals: Floats, directions: Floats, usable: Mask, ahead: Floats, behind: Floats) -> NormalCheck:
        inner = usable[:-1] & usable[1:]
        turns = np.where(usable, _angles(normals[:-1], normals[1:]), 0.0)
        apart = _at_points(np.where(inner, _angles(normals[:-2], normals[2:]), 0.0))
        judged = _at_points(np.where(inner, 1.0, 0.0))
        excess = judged * (_before(turns) + _after(turns) - apart) / 2.0
        # What the normals beyond the neighbours turn: both, or the only one near an end.
        outside = np.where(usable, turns, np.inf)
        beyond = np.minimum(
            np.concatenate([[np.inf, np.inf], outside])[: len(normals)],
            np.concatenate([outside, [np.inf, np.inf]])[1 : len(normals) + 1],
        )
        beyond = np.where(np.isfinite(beyond), beyond, 0.0)
        bend = _nearby(_at_points(np.where(inner, _angles(directions[:-1], directions[1:]), 0.0)))
        leans = [np.degrees(np.arcsin(np.clip(np.where(usable, sines, 0.0), 0.0, 1.0))) for sines in (behind, ahead)]
        # A course of two points has no turn to measure a lean by.
        known = _nearby(judged) > 0.0
        lean = np.where(known, np.maximum(_before(leans[0]), _after(leans[1])), 0.0)
        turning = excess > apart + bend + beyond + MARGIN_DEG
        leaning = ~turning & (lean > bend + MARGIN_DEG)
        opposed = (_before(turns) > OPPOSED_DEG) & ~turning & ~np.append(False, turning[:-1])
        return cls(_before(turns), excess, apart, lean, bend, turning, leaning & ~opposed, opposed)

    @property
    def damaged(self) -> Mask:
        """Rows (n,) whose normal is refused."""
        return self.turning | self.leaning | self.opposed

    def sentence(self, row: int) -> str:
        """Return what is wrong with the normal of a row."""
        if self.turning[row]:
            return (
                f"the normal turns {self.excess[row]:.1f} deg away from those of both neighbours, which are "
                f"{self.apart[row]:.1f} deg apart: it is damaged; correct it"
            )
        if self.opposed[row]:
            return (
                f"the normal turns {self.turns[row]:.1f} deg from that of the point before: one of the two points into "
                "the surface; reverse those that do"
            )
        return (
            f"the normal stands {self.lean[row]:.1f} deg off the perpendicular of the course, which turns no more than "
            f"{self.bend[row]:.1f} deg there; correct it"
        )


def _angles(left: Floats, right: Floats) -> Floats:
    """Return the angles (n,) between unit vectors (n, 3), degrees, exact for small ones too."""
    gap = left - right
    angles: Floats = np.degrees(2.0 * np.arcsin(np.clip(np.sqrt(dot(gap, gap)) / 2.0, 0.0, 1.0)))
    return angles


def _at_points(inner: Floats) -> Floats:
    """Return values of inner points (n - 2,) as values of all points (n,), 0 at both ends."""
    return np.concatenate([[0.0], inner, [0.0]])


def _before(steps: Floats) -> Floats:
    """Return the value (n,) of the step (n - 1,) before each point, 0 at the first."""
    return np.concatenate([[0.0], steps])


def _after(steps: Floats) -> Floats:
    """Return the value (n,) of the step (n - 1,) after each point, 0 at the last."""
    return np.concatenate([steps, [0.0]])


def _nearby(values: Floats) -> Floats:
    """Return the largest value (n,) at each point and those beside it."""
    ends = np.concatenate([[0.0], values, [0.0]])
    largest: Floats = np.maximum(values, np.maximum(ends[:-2], ends[2:]))
    return largest
