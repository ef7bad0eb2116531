"""Plies of natural paths in closed form, with moulds of facets: plane, cylinder and sphere; nothing here plans."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

from tapelayer.arrays import Floats
from tapelayer.courses.course import Course
from tapelayer.geometry.plane import Plane
from tapelayer.plies.facet_surface import FacetSurface
from tapelayer.plies.judge import SAMPLES, judge_on
from tapelayer.plies.judgement import Judgement
from tapelayer.plies.laid_ply import Terms
from tapelayer.units import DEG, MM

CYLINDER, SPHERE = 1.8, 5.0
SQUARE = math.pi / 2
# The mould stands askew in its file.
PLANE = Plane(Rotation.from_euler("xyz", [0.3, -0.2, 0.8]).as_matrix(), np.array([0.4, -0.2, 0.1]))


def _flat(x: Floats, y: Floats) -> Floats:
    return 0.0 * x


def _cylinder(x: Floats, y: Floats) -> Floats:
    return np.sqrt(CYLINDER**2 - y**2) - CYLINDER


def _sphere(x: Floats, y: Floats) -> Floats:
    return np.sqrt(SPHERE**2 - x**2 - y**2) - SPHERE


HEIGHTS: dict[str, Callable[[Floats, Floats], Floats]] = {"plane": _flat, "cylinder": _cylinder, "sphere": _sphere}
SURFACES = tuple(HEIGHTS)


def facets_of(
    height: Callable[[Floats, Floats], Floats],
    length: float,
    breadth: float,
    edge: float = 25 * MM,
    jitter: float = 0.0,
) -> FacetSurface:
    """Facets with vertices on a height over a rectangle round the origin, in the plane's frame, as of a float32 STL."""
    counts = [round(side / edge) + 1 for side in (length, breadth)]
    x, y = np.meshgrid(
        *[np.linspace(-s / 2, s / 2, n) for s, n in zip((length, breadth), counts, strict=True)], indexing="ij"
    )
    chance = np.random.default_rng(1)
    for axis in (x, y):
        axis[1:-1, 1:-1] += chance.uniform(-jitter, jitter, (counts[0] - 2, counts[1] - 2)) * edge
    vertices = np.stack([x, y, height(x, y)], axis=2).reshape(-1, 3)
    at = np.arange(counts[0] * counts[1]).reshape(counts)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    vertices = PLANE.into(PLANE.out_of(vertices).astype(np.float32).astype(np.float64))
    return FacetSurface.of(vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def places(surface: str, lateral: float, s: Floats, v: Floats, angle: float) -> tuple[Floats, Floats]:
    """Points and normals (n, 3) in the plane's frame at strip coordinates of one of the natural paths.

    Args:
        surface: one of `SURFACES`.
        lateral: of the path from the top to the left, metres along the surface and square to the path.
        s: (n,) metres along the path from there.
        v: (n,) metres to the left of the path, along the surface and square to it.
        angle: of the path from +x to the left, radians.
    """
    along, left = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
    if surface == "sphere":
        up, left3, along3 = np.array([0.0, 0.0, 1.0]), np.append(left, 0.0), np.append(along, 0.0)
        foot = up * math.cos(lateral / SPHERE) + left3 * math.sin(lateral / SPHERE)
        aside = left3 * math.cos(lateral / SPHERE) - up * math.sin(lateral / SPHERE)
        on = np.cos(s / SPHERE)[:, None] * foot + np.sin(s / SPHERE)[:, None] * along3
        normals = np.cos(v / SPHERE)[:, None] * on + np.sin(v / SPHERE)[:, None] * aside
        return SPHERE * (normals - up), normals
    flat = s[:, None] * along + (lateral + v)[:, None] * left
    if surface == "plane":
        return np.column_stack([flat, 0 * s]), np.tile([0.0, 0.0, 1.0], (len(s), 1))
    turn = flat[:, 1] / CYLINDER
    normals = np.stack([0 * turn, np.sin(turn), np.cos(turn)], axis=1)
    return np.column_stack([flat[:, 0], CYLINDER * normals[:, 1], CYLINDER * (normals[:, 2] - 1.0)]), normals


Bow = Callable[[Floats], Floats]


def course_of(
    surface: str,
    number: int,
    lateral: float,
    span: tuple[float, float],
    angle: float,
    cuts: tuple[float, float] = (SQUARE, SQUARE),
    bow: Bow = np.zeros_like,
) -> Course:
    """A course along a natural path, in the mould's frame.

    Args:
        surface: one of `SURFACES`.
        number: of the course.
        lateral: of its path.
        span: from where to where it runs along the path, metres.
        angle: of the path.
        cuts: angles of its cuts, radians.
        bow: metres to the left of the path where its points lie, by arc length from `span`'s begin.
    """
    begin, end = span
    arcs = np.linspace(0.0, end - begin, max(math.ceil((end - begin) / (10 * MM)), 4) + 1)
    points, normals = places(surface, lateral, begin + arcs, bow(arcs), angle)
    return Course(number, PLANE.out_of(points), PLANE.turned_out_of(normals), arcs, cuts)


def tape_in_plan(
    surface: str, lateral: float, span: tuple[float, float], angle: float, cuts: tuple[float, float], width: float
) -> shapely.Polygon:
    """What a tape of a width covers in plan."""
    across = np.linspace(-width / 2, width / 2, 31)
    share = np.linspace(0.0, 1.0, 101)
    starts, ends = span[0] + across / math.tan(cuts[0]), span[1] + across / math.tan(cuts[1])
    rim = [
        (starts, across),
        (starts[-1] + share * (ends[-1] - starts[-1]), 0 * share + width / 2),
        (ends[::-1], across[::-1]),
        (ends[0] + share * (starts[0] - ends[0]), 0 * share - width / 2),
    ]
    return shapely.Polygon(np.concatenate([places(surface, lateral, s, v, angle)[0][:-1, :2] for s, v in rim]))


@dataclass(frozen=True, eq=False)
class PathPly:
    """Courses, and what they are judged by."""

    surface: FacetSurface
    courses: tuple[Course, ...]
    terms: Terms
    outline: shapely.Polygon

    def judged(self, courses: tuple[Course, ...] | None = None, samples: int = SAMPLES, **terms: object) -> Judgement:
        courses = self.courses if courses is None else courses
        changed = replace(self.terms, **terms)
        return judge_on(self.surface, courses, changed, PLANE, self.outline, samples)


def terms_of(width: float, angle: float, gap: float) -> Terms:
    """Terms that a good ply keeps, with gaps up to 1.2 mm or twice the nominal one more than it."""
    return Terms(
        width=width,
        angle=angle,
        rosette=PLANE.turned_out_of(np.array([[1.0, 0.0, 0.0]]))[0],
        seed=np.zeros(2),
        margin=0.0,
        stagger=0.0,
        minimum_length=0.1,
        minimum_hole=0.1,
        minimum_cut_angle=15 * DEG,
        order="one_way",
        start_corner="right",
        reverse=False,
        max_gap=2 * gap + 0.2 * MM,
        max_overlap=0.0,
        max_strain=0.002,
        max_lift=0.008,
        max_angle_deviation=5 * DEG,
        max_surface_residual=0.1 * MM,
        max_off_mould=width / 2,
    )


def ply_of(
    surface: str,
    width: float = 75 * MM,
    angle: float = 0.0,
    gap: float = 0.5 * MM,
    count: int = 7,
    length: float = 1.0,
    cuts: tuple[float, float] = (SQUARE, SQUARE),
) -> PathPly:
    """A ply of natural paths side by side, the gap apart over the top; its boundary lies 0.05 mm inside the tape."""
    lean = width / 2 * max(abs(1 / math.tan(cut)) for cut in cuts)
    reach = np.array([length + 2 * lean + 0.2, (count + 2) * (width + gap)])
    turned = np.abs(np.array([[math.cos(angle), math.sin(angle)], [math.sin(angle), math.cos(angle)]])) @ reach
    laterals = ((np.arange(count) - (count - 1) // 2) * (width + gap)).tolist()
    span = (-length / 2, length / 2)
    courses = [course_of(surface, n, lateral, span, angle, cuts) for n, lateral in enumerate(laterals, 1)]
    tapes = [tape_in_plan(surface, lateral, span, angle, cuts, width) for lateral in laterals]
    covered = (
        shapely.union_all(tapes, grid_size=1e-9)
        .buffer(gap, join_style="mitre")
        .buffer(-gap - 0.05 * MM, join_style="mitre")
    )
    return PathPly(facets_of(HEIGHTS[surface], *turned.tolist()), tuple(courses), terms_of(width, angle, gap), covered)
