"""Good plies pass the judge; each mutant of one of their courses is caught, whichever course it is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tapelayer.courses.course import Course
from tapelayer.courses.course_file import format_courses, parse_courses
from tapelayer.plies.course_line import STEP
from tapelayer.plies.judgement import Judgement
from tapelayer.units import DEG, MM
from tests.helpers.natural_paths import (
    HEIGHTS,
    PLANE,
    SPHERE,
    SQUARE,
    SURFACES,
    PathPly,
    course_of,
    facets_of,
    places,
    ply_of,
    terms_of,
)

WIDTH, GAP, LENGTH, COUNT = 75 * MM, 0.5 * MM, 1.0, 4
SPAN = (-LENGTH / 2, LENGTH / 2)
ANGLE = 33 * DEG
OBLIQUE = (50 * DEG, 50 * DEG)
FEW = 10_000


@cache
def good(surface: str, cuts: tuple[float, float] = (SQUARE, SQUARE)) -> PathPly:
    return ply_of(surface, WIDTH, ANGLE, GAP, COUNT, LENGTH, cuts)


def lateral(row: int) -> float:
    return (row - (COUNT - 1) // 2) * (WIDTH + GAP)


def said(judgement: Judgement) -> str:
    return "\n".join(fault.sentence for fault in judgement.faults)


@pytest.mark.parametrize(
    "cuts", [(SQUARE, SQUARE), OBLIQUE, (15.5 * DEG, 100 * DEG)], ids=["square", "oblique", "sharp"]
)
@pytest.mark.parametrize("surface", SURFACES)
def test_a_good_ply_passes(surface: str, cuts: tuple[float, float]) -> None:
    ply = good(surface, cuts)
    judgement = ply.judged()
    assert judgement.passed, said(judgement)
    assert judgement.max_gap_mm == pytest.approx(0.5, abs=1e-3)
    assert judgement.max_overlap_mm <= 0.0
    assert judgement.surface_residual_mm <= 1e-3
    assert judgement.normal_error_deg <= 0.01
    assert judgement.max_wander_mm <= 1e-3
    assert judgement.coverage_percent == pytest.approx(
        100 * WIDTH * COUNT / (WIDTH * COUNT + GAP * (COUNT - 1)), abs=0.3
    )
    assert judgement.off_facets_mm == pytest.approx(
        {"plane": 0.0, "cylinder": 0.045, "sphere": 0.031}[surface], abs=0.005
    )
    assert judgement.values()["passed"]


@pytest.mark.parametrize("surface", SURFACES)
def test_a_good_ply_passes_from_its_file(surface: str) -> None:
    ply = good(surface)
    assert ply.judged(parse_courses(format_courses(ply.courses), "ply.txt")).passed


Mutant = Callable[[str, Course, int], Course]


def moved(by: float) -> Mutant:
    return lambda surface, course, row: course_of(surface, course.number, lateral(row) + by, SPAN, ANGLE)


def bowed(bow: Callable[[np.ndarray], np.ndarray]) -> Mutant:
    return lambda surface, course, row: course_of(surface, course.number, lateral(row), SPAN, ANGLE, bow=bow)


def shortened(start: float, end: float) -> Mutant:
    span = (SPAN[0] + start, SPAN[1] - end)
    return lambda surface, course, row: course_of(surface, course.number, lateral(row), span, ANGLE)


def turned(arcs: np.ndarray) -> np.ndarray:
    return (arcs - LENGTH / 2) * math.tan(0.1 * DEG)


def tilted(angle: float, along: bool) -> Mutant:
    def mutant(surface: str, course: Course, row: int) -> Course:
        tangents = np.gradient(course.points, axis=0)
        axes = tangents if along else np.cross(course.normals, tangents)
        turns = Rotation.from_rotvec(angle * axes / np.linalg.norm(axes, axis=1)[:, None])
        return replace(course, normals=turns.apply(np.array(course.normals)))

    return mutant


def lifted(surface: str, course: Course, row: int) -> Course:
    return replace(course, points=course.points + 3 * MM * course.normals)


def one_reversed(surface: str, course: Course, row: int) -> Course:
    normals = course.normals.copy()
    normals[len(normals) // 2] *= -1.0
    return replace(course, normals=normals)


def all_reversed(surface: str, course: Course, row: int) -> Course:
    return replace(course, normals=-course.normals)


def against(surface: str, course: Course, row: int) -> Course:
    return replace(course, points=course.points[::-1], normals=course.normals[::-1])


def recut(start: float, end: float) -> Mutant:
    return lambda surface, course, row: replace(course, cut_angles=(start * DEG, end * DEG))


def not_a_number(surface: str, course: Course, row: int) -> Course:
    points = course.points.copy()
    points[7, 1] = math.nan
    return replace(course, points=points)


MUTANTS: dict[str, tuple[Mutant, str]] = {
    "1 mm to the left": (moved(MM), "gap of|overlap of|beside the seed"),
    "1 mm to the right": (moved(-MM), "gap of|overlap of|beside the seed"),
    "3 mm to the left": (moved(3 * MM), "gap of|overlap of|beside the seed"),
    "turned by 0.1 deg": (bowed(turned), "gap of|overlap of|off the ply's angle at the seed"),
    "bowed by 1 mm over 1 m": (bowed(lambda arcs: 4 * MM * arcs * (LENGTH - arcs) / LENGTH**2), "wanders 1.00 mm"),
    "5 mm short at the start": (shortened(5 * MM, 0.0), "its start cut falls 4.9. mm short"),
    "5 mm short at the end": (shortened(0.0, 5 * MM), "its end cut falls 4.9. mm short"),
    "100 mm short": (shortened(0.0, 100 * MM), "% of the ply is not covered"),
    "another start cut": (recut(80.0, 90.0), r"its start cut falls 6.\d+ mm short"),
    "another end cut": (recut(90.0, 100.0), r"its end cut falls 6.\d+ mm short"),
    "a flat cut": (recut(14.0, 90.0), "its start cut makes 14.00 deg"),
    "normals tilted along": (tilted(DEG, along=True), "the normal is 1.00 deg off"),
    "normals tilted across": (tilted(DEG, along=False), "the normal is 1.00 deg off"),
    "one normal reversed": (one_reversed, "the normal is 180.00 deg off"),
    "all normals reversed": (all_reversed, "the normal is 180.00 deg off"),
    "3 mm off the mould": (lifted, "3.0.. mm off the mould"),
    "laid against": (against, "runs against the ply's direction"),
}


def accused(judgement: Judgement, numbers: set[int], words: str) -> bool:
    return any(
        re.search(words, fault.sentence) and (numbers & set(fault.courses) or not fault.courses)
        for fault in judgement.faults
    )


@pytest.mark.parametrize("name", MUTANTS)
@pytest.mark.parametrize("surface", SURFACES)
def test_a_mutant_is_caught(surface: str, name: str) -> None:
    ply, (mutant, words) = good(surface), MUTANTS[name]
    for row, course in enumerate(ply.courses):
        courses = (*ply.courses[:row], mutant(surface, course, row), *ply.courses[row + 1 :])
        judgement = ply.judged(courses, FEW)
        assert not judgement.passed
        assert accused(judgement, {course.number}, words), f"{row}: {said(judgement)}"


@pytest.mark.parametrize("surface", SURFACES)
def test_a_course_left_out_is_caught(surface: str) -> None:
    ply = good(surface)
    for row in range(COUNT):
        judgement = ply.judged(ply.courses[:row] + ply.courses[row + 1 :], FEW)
        assert "% of the ply is not covered" in said(judgement)
        assert judgement.max_uncovered_mm > 30
        if 0 < row < COUNT - 1:
            assert f"courses {row} and {row + 2}: gap of 76" in said(judgement) or "gap of 75" in said(judgement)


@pytest.mark.parametrize("surface", SURFACES)
def test_courses_swapped_in_place_are_caught(surface: str) -> None:
    ply = good(surface)
    for one in range(COUNT):
        for other in range(one):
            courses = list(ply.courses)
            courses[one] = replace(ply.courses[other], number=one + 1)
            courses[other] = replace(ply.courses[one], number=other + 1)
            judgement = ply.judged(tuple(courses), FEW)
            assert accused(judgement, {one + 1, other + 1}, "expected numbers that rise to the left")


@pytest.mark.parametrize("surface", SURFACES)
def test_numbers_out_of_order_are_caught(surface: str) -> None:
    ply = good(surface)
    judgement = ply.judged(ply.courses[::-1], FEW)
    assert "course 1 stands after course 2 in the file" in said(judgement)
    assert not ply.judged(None, FEW, start_corner="left").passed
    renumbered = [replace(course, number=COUNT - row) for row, course in enumerate(ply.courses)]
    assert ply.judged(tuple(renumbered[::-1]), FEW, start_corner="left").passed


@pytest.mark.parametrize("surface", SURFACES)
def test_mirrored_cut_angles_are_caught(surface: str) -> None:
    ply = good(surface, OBLIQUE)
    for row, course in enumerate(ply.courses):
        start, end = course.cut_angles
        mirrored = replace(course, cut_angles=(math.pi - start, math.pi - end))
        judgement = ply.judged((*ply.courses[:row], mirrored, *ply.courses[row + 1 :]), FEW)
        assert accused(judgement, {course.number}, "cut falls .* mm short")


@pytest.mark.parametrize("surface", SURFACES)
def test_a_ply_at_another_angle_is_caught(surface: str) -> None:
    ply = good(surface)
    assert "off the ply's angle" in said(ply.judged(None, FEW, angle=-ANGLE))
    assert "off the ply's angle at the seed" in said(ply.judged(None, FEW, angle=ANGLE + 0.1 * DEG))


@pytest.mark.parametrize("surface", SURFACES)
def test_courses_laid_against_pass_where_the_ply_says_so(surface: str) -> None:
    ply = good(surface, (SQUARE, SQUARE))
    courses = tuple(against(surface, course, 0) for course in ply.courses)
    assert ply.judged(courses, FEW, reverse=True).passed
    there_and_back = tuple(course if row % 2 else courses[row] for row, course in enumerate(ply.courses))
    assert ply.judged(there_and_back, FEW, order="there_and_back").passed


def test_a_stagger_moves_the_reference_course() -> None:
    ply = good("sphere")
    assert ply.judged(None, FEW, stagger=WIDTH + GAP).passed
    assert "0.30 mm beside the seed" in said(ply.judged(None, FEW, stagger=0.3 * MM))


def test_limits_of_the_ply_are_kept() -> None:
    ply = good("sphere")
    assert "gap of 0.50 mm" in said(ply.judged(None, FEW, max_gap=0.4 * MM))
    assert "use narrower tape, or allow overlap with gap.least_mm = -0.25" in said(
        ply.judged(None, FEW, max_gap=0.4 * MM)
    )
    assert "overlap of -0." in said(ply.judged(None, FEW, max_overlap=-0.45 * MM))
    assert "strain of 0.00 %" in said(ply.judged(None, FEW, max_strain=-1e-3))
    assert "the roller lifts 0.14 mm" in said(ply.judged(None, FEW, max_lift=0.1 * MM))
    assert "1000.0 mm long, expected at least 1100" in said(ply.judged(None, FEW, minimum_length=1.1))
    assert "off the ply's angle" in said(ply.judged(None, FEW, max_angle_deviation=0.05 * DEG))
    assert "its start cut falls" in said(ply.judged(None, FEW, margin=2 * MM))


def test_strain_and_lift_are_those_of_the_surface() -> None:
    judgement = good("sphere").judged(None, FEW)
    assert judgement.max_strain_percent == pytest.approx(100 * WIDTH**2 / 8 / SPHERE**2, rel=0.01)
    assert judgement.max_lift_mm == pytest.approx(WIDTH**2 / 8 / SPHERE / MM, rel=0.01)
    assert judgement.curvature_known_percent == 100.0


def test_a_course_beyond_the_mould_is_refused_by_name() -> None:
    ply = good("cylinder")
    short = facets_of(HEIGHTS["cylinder"], 0.8, 2.0)
    judgement = replace(ply, surface=short, outline=shapely.box(-0.3, -0.3, 0.3, 0.3)).judged(None, FEW)
    assert judgement.off_mould_mm > 37.5
    assert "mm beyond the mould at" in said(judgement)


def test_nothing_not_measured_passes() -> None:
    ply = good("plane")
    assert math.isnan(replace(ply, outline=shapely.box(5, 5, 6, 6)).judged(None, FEW).coverage_percent)
    assert not replace(ply, outline=shapely.box(5, 5, 6, 6)).judged(None, FEW).passed


@pytest.mark.parametrize("width", [75 * MM, 150 * MM, 300 * MM])
def test_gaps_on_a_sphere_are_exact(width: float) -> None:
    """Along the lateral great circle from the edge of the one to that of the other."""
    count, length = 3, 1.4
    ply = ply_of("sphere", width, 0.0, 2 * MM, count, length)
    # The last sample in the ply.
    ends = np.array([length / 2 - STEP])
    edge, normal = places("sphere", 0.0, ends, np.array([width / 2]), 0.0)
    _, further = places("sphere", 0.0, ends, np.array([width / 2 + MM]), 0.0)
    pole = np.array([0.0, math.cos((width + 2 * MM) / SPHERE), -math.sin((width + 2 * MM) / SPHERE)])
    heading = further[0] - normal[0]
    heading /= np.linalg.norm(heading)
    low, high = -5 * MM, 5 * MM
    for _ in range(60):
        middle = (low + high) / 2
        at = normal[0] * math.cos(middle / SPHERE) + heading * math.sin(middle / SPHERE)
        away = SPHERE * math.asin(float(at @ pole))
        low, high = (middle, high) if away < -width / 2 else (low, middle)
    judgement = ply.judged(None, FEW, max_gap=1.0, max_overlap=1.0)
    assert -judgement.max_overlap_mm * MM == pytest.approx(low, abs=0.012 * MM)
    assert judgement.max_gap_mm == pytest.approx(2.0, abs=1e-3)


# Shrinking takes minutes.
PHASES = (Phase.explicit, Phase.reuse, Phase.generate)


@settings(max_examples=25, deadline=None, phases=PHASES)
@given(
    surface=st.sampled_from(SURFACES),
    angle=st.floats(-80, 80),
    width=st.sampled_from([25 * MM, 75 * MM, 150 * MM, 300 * MM]),
    cuts=st.tuples(st.floats(30, 150), st.floats(30, 150)),
    row=st.integers(0, 2),
    side=st.sampled_from([-1.0, 1.0]),
)
def test_any_good_ply_passes_and_a_course_moved_does_not(
    surface: str, angle: float, width: float, cuts: tuple[float, float], row: int, side: float
) -> None:
    angles = (cuts[0] * DEG, cuts[1] * DEG)
    if surface == "sphere":
        # Wider tapes overlap at the ends.
        width = min(width, 75 * MM)
    ply = ply_of(surface, width, angle * DEG, 2 * GAP, 3, 1.0, angles)
    terms = {"max_lift": 0.02, "max_strain": 0.02, "max_gap": 1.5 * MM}
    judgement = ply.judged(None, FEW, **terms)
    assert judgement.passed, said(judgement)
    at = (row - 1) * (width + 2 * GAP) + side * 1.2 * MM
    astray = course_of(surface, row + 1, at, SPAN, angle * DEG, angles)
    assert not ply.judged((*ply.courses[:row], astray, *ply.courses[row + 1 :]), FEW, **terms).passed


@settings(max_examples=10, deadline=None, phases=PHASES)
@given(surface=st.sampled_from(SURFACES), jitter=st.floats(0, 0.25), edge=st.sampled_from([12.5, 25, 50]))
def test_facets_of_any_shape_do_not_matter(surface: str, jitter: float, edge: float) -> None:
    ply = good(surface)
    coarse = replace(ply, surface=facets_of(HEIGHTS[surface], 1.4, 1.4, edge * MM, jitter))
    judgement = coarse.judged(None, FEW)
    assert judgement.passed, said(judgement)
    assert judgement.surface_residual_mm <= 0.01
    assert judgement.normal_error_deg <= 0.05


def split_ply(surface: str, outline: shapely.Polygon, pieces: list[tuple[int, float, float]]) -> PathPly:
    """A ply at 0 deg of an outline laid flat, with pieces of strips from the first to the second place."""
    loops = [np.array(loop.coords) for loop in (outline.exterior, *outline.interiors)]
    fine = [shapely.get_coordinates(shapely.segmentize(shapely.linestrings(loop), 5 * MM)) for loop in loops]
    plan = [places(surface, 0.0, loop[:, 0], loop[:, 1], 0.0)[0][:, :2] for loop in fine]
    courses = [
        course_of(surface, number, row * (WIDTH + GAP), (begin, end), 0.0)
        for number, (row, begin, end) in enumerate(pieces, 1)
    ]
    facets = facets_of(HEIGHTS[surface], 1.6, 1.0)
    return PathPly(facets, tuple(courses), terms_of(WIDTH, 0.0, GAP), shapely.Polygon(plan[0], plan[1:]))


def with_hole(surface: str) -> PathPly:
    """Four strips of 1 m, of which the second is split by a hole 0.2 m long that reaches into the third."""
    edges = np.array([-1, 0, 1, 2]) * (WIDTH + GAP)
    low, high = edges[0] - WIDTH / 2, edges[-1] + WIDTH / 2
    hole = shapely.box(-0.1, edges[1] - WIDTH / 2, 0.1, edges[2])
    outline = shapely.box(-0.5, low, 0.5, high).difference(hole)
    return split_ply(
        surface, outline, [(-1, -0.5, 0.5), (0, -0.5, -0.1), (0, 0.1, 0.5), (1, -0.5, 0.5), (2, -0.5, 0.5)]
    )


def concave(surface: str) -> PathPly:
    """A U, whose legs are laid by two courses a strip."""
    edges = np.array([-1, 0, 1]) * (WIDTH + GAP)
    notch = shapely.box(-0.2, edges[1] - WIDTH / 2 - GAP / 2, 0.1, 1.0)
    outline = shapely.box(-0.5, edges[0] - WIDTH / 2, 0.5, edges[-1] + WIDTH / 2).difference(notch)
    return split_ply(
        surface, outline, [(-1, -0.5, 0.5), (0, -0.5, -0.2), (0, 0.1, 0.5), (1, -0.5, -0.2), (1, 0.1, 0.5)]
    )


@pytest.mark.parametrize("surface", ["plane", "cylinder"])
@pytest.mark.parametrize("shape", [with_hole, concave])
def test_strips_in_pieces(shape: Callable[[str], PathPly], surface: str) -> None:
    ply = shape(surface)
    seed = {"seed": np.array([-0.3, 0.0])}
    judgement = ply.judged(None, FEW, **seed)
    assert judgement.passed, said(judgement)
    for row in range(5):
        assert "% of the ply is not covered" in said(
            ply.judged(ply.courses[:row] + ply.courses[row + 1 :], FEW, **seed)
        )
    through = course_of(surface, 2, 0.0, SPAN, 0.0)
    laid = ply.judged((ply.courses[0], through, *ply.courses[3:]), FEW, **seed)
    assert "course 2 is laid through" in said(laid)
    twice = ply.judged((*ply.courses[:2], course_of(surface, 3, 0.0, (-0.15, 0.5), 0.0), *ply.courses[3:]), FEW, **seed)
    assert twice.passed or "laid through" in said(twice)
    doubled = ply.judged(
        (*ply.courses[:2], course_of(surface, 3, 0.0, (-0.3, 0.5), 0.0), *ply.courses[3:]), FEW, **seed
    )
    assert "courses 2 and 3: overlap of 75.00 mm" in said(doubled)


def test_places_are_told_in_the_frame_of_the_mould() -> None:
    ply = good("cylinder")
    astray = moved(MM)("cylinder", ply.courses[3], 3)
    (fault,) = ply.judged((*ply.courses[:3], astray), FEW).faults
    assert fault.courses == (3, 4)
    assert fault.place is not None
    middle, _ = places("cylinder", 1.5 * (WIDTH + GAP), np.linspace(*SPAN, 1001), np.zeros(1001), ANGLE)
    assert np.min(np.linalg.norm(PLANE.out_of(middle) - fault.place, axis=1)) < 2 * MM
    shown = ", ".join(f"{value / MM:.1f}" for value in fault.place)
    assert f"gap of 1.50 mm at ({shown}), expected at most 1.2" in fault.sentence


def test_a_course_across_others_is_caught() -> None:
    ply = good("cylinder")
    across = course_of("cylinder", COUNT + 1, 0.1, (-0.1, 0.1), ANGLE + SQUARE)
    judgement = ply.judged((*ply.courses, across), FEW)
    assert accused(judgement, {COUNT + 1}, "90.00 deg off the ply's angle at")
    # It crosses every other course, all of them as broadly.
    assert re.search(
        f"courses [1-{COUNT}] and {COUNT + 1} lie on each other .* mm broad, expected at most 0", said(judgement)
    )
    assert judgement.max_overlap_mm > 10


def test_what_is_not_judged_is_said() -> None:
    values = good("plane").judged(None, FEW).values()
    assert "reach of the machine" in values["not_judged"]
    assert values["faults"] == []
