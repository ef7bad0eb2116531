"""A ply file: its defaults, all its faults at once with their lines, and the same ply written out and read back."""

from __future__ import annotations

from pathlib import Path

import pytest

from tapelayer.errors import PlyRefused
from tapelayer.plies.ply import Ply, parse_ply, read_ply
from tapelayer.setups.forms import changes, schema_of, text_of, text_of_values, values_of
from tapelayer.setups.sections import whole_text
from tapelayer.units import DEG

LEAST = '[mould]\nfile = "hood.stl"\n[ply]\nangle_deg = 45\n'
LOOP = [[float(x), float(x * x), 0.125] for x in range(40)]


def refused(text: str) -> str:
    with pytest.raises(PlyRefused) as caught:
        parse_ply(text.encode(), "one.toml")
    return str(caught.value)


def test_what_a_file_leaves_out() -> None:
    ply = parse_ply(LEAST.encode(), "plies/one.toml")
    assert (ply.mould.file, ply.mould.unit, ply.boundary_file) == ("plies/hood.stl", "mm", None)
    assert (ply.ply.rosette, ply.ply.seed, ply.ply.boundary, ply.ply.holes) == ([0, 1, 0], None, "edge", [])
    assert (ply.ply.inset_mm, ply.ply.margin_mm) == (0, 0)
    assert (ply.tape.width_mm, ply.tape.thickness_mm) == (75, 0.15)
    assert (ply.gap.least_mm, ply.gap.nominal_mm, ply.gap.largest_mm) == (0, 0.5, 2)
    courses = ply.courses
    assert (courses.minimum_length_mm, courses.minimum_hole_mm, courses.minimum_cut_angle_deg) == (100, 100, 15)
    assert (courses.stagger_mm, courses.order, courses.start_corner, courses.reverse) == (0, "one_way", "right", False)
    assert courses.point_spacing_mm == 10
    limits = ply.limits
    assert (limits.max_strain_percent, limits.max_lift_mm, limits.max_angle_deviation_deg) == (0.2, 2, 5)
    assert (limits.max_surface_residual_mm, limits.max_surface_ambiguity_mm) == (0.1, 0.2)
    assert (ply.max_gap, ply.max_overlap, ply.max_off_mould) == (0.002, 0.0, 0.0375)
    assert (ply.angle, ply.width, ply.metres) == (45 * DEG, 0.075, 0.001)


def test_limits_that_follow_other_values() -> None:
    text = f"{LEAST}[gap]\nleast_mm = -1\n[tape]\nwidth_mm = 50\n"
    ply = parse_ply(text.encode(), "one.toml")
    assert (ply.max_overlap, ply.max_off_mould) == (0.001, 0.025)
    told = parse_ply(f"{text}[limits]\nmax_gap_mm = 3\nmax_overlap_mm = 2\nmax_off_mould_mm = 0\n".encode(), "one.toml")
    assert (told.max_gap, told.max_overlap, told.max_off_mould) == (0.003, 0.002, 0.0)


@pytest.mark.parametrize(
    ("text", "sentences"),
    [
        ("", ["one.toml: [mould] is missing", "one.toml: [ply] is missing"]),
        (
            '[mould]\nfile = ""\nunit = "ft"\n[ply]\nangle_deg = inf\n',
            [
                "one.toml:2: [mould] file: string should have at least 1 character, got ''",
                "one.toml:3: [mould] unit: input should be 'mm', 'cm', 'm' or 'in', got 'ft'",
                "one.toml:5: [ply] angle_deg: input should be a finite number, got inf",
            ],
        ),
        (
            "[ply]\nangle = 3\n[tapes]\n",
            [
                "one.toml: [mould] is missing",
                "one.toml:1: [ply] angle_deg is missing",
                "one.toml:2: unknown key angle in [ply]; did you mean angle_deg?",
                "one.toml:3: unknown section [tapes]; did you mean [tape]?",
            ],
        ),
        (
            f"{LEAST}qqqq = 1\n[gap]\nwwww = 1\n",
            [
                "one.toml:5: unknown key qqqq in [ply]; there are angle_deg, rosette, seed, boundary, holes, inset_mm, "
                "margin_mm",
                "one.toml:7: unknown key wwww in [gap]; there are least_mm, nominal_mm, largest_mm",
            ],
        ),
        (
            f"{LEAST}boundary = 3\nholes = 4\nseed = [1, 2]\nrosette = [0, 0, 0]\n",
            [
                "one.toml:5: [ply] boundary: expected 'edge', points [x, y, z] or the name of a file, got 3",
                "one.toml:6: [ply] holes: expected a list of holes, each a list of points [x, y, z], got 4",
                "one.toml:7: [ply] seed: expected [x, y, z], three finite numbers, got [1, 2]",
                "one.toml:8: [ply] rosette: expected a direction [x, y, z] that is not zero, got [0.0, 0.0, 0.0]",
            ],
        ),
        (
            f"{LEAST}boundary = ''\n",
            ["one.toml:5: [ply] boundary: expected 'edge', points [x, y, z] or the name of a file, got ''"],
        ),
        (
            f"{LEAST}boundary = [[0, 0, 0], [1, 0], [1, nan, 0], ['a', 0, 0], [1, 1, 0]]\n",
            [
                "one.toml:5: [ply] boundary: 3 points, first point 2: expected [x, y, z], three finite numbers, "
                "got [1, 0]"
            ],
        ),
        (
            f"{LEAST}boundary = [[0, 0, 0], [1, 0, 0], true]\n",
            ["one.toml:5: [ply] boundary: point 3: expected [x, y, z], three finite numbers, got True"],
        ),
        (
            f"{LEAST}boundary = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]]\n",
            ["one.toml:5: [ply] boundary: it has 2 points, expected at least 3"],
        ),
        (
            f"{LEAST}holes = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0]]]\n",
            ["one.toml:5: [ply] holes: hole 2: it has 1 point, expected at least 3"],
        ),
        (f"{LEAST}holes = [3]\n", ["one.toml:5: [ply] holes: hole 1: expected a list of points [x, y, z], got 3"]),
        (
            f"{LEAST}inset_mm = -1\nmargin_mm = -1\n[tape]\nwidth_mm = 0\nthickness_mm = nan\n",
            [
                "one.toml:5: [ply] inset_mm: input should be greater than or equal to 0, got -1",
                "one.toml:6: [ply] margin_mm: input should be greater than or equal to 0, got -1",
                "one.toml:8: [tape] width_mm: input should be greater than 0, got 0",
                "one.toml:9: [tape] thickness_mm: input should be a finite number, got nan",
            ],
        ),
        (f"{LEAST}[gap]\nleast_mm = 3\n", ["one.toml:5: [gap]: least_mm is 3, above largest_mm 2; lower it"]),
        (
            f"{LEAST}[gap]\nleast_mm = 1\n",
            ["one.toml:5: [gap]: nominal_mm is 0.5, expected least_mm 1 to largest_mm 2"],
        ),
        (
            f"{LEAST}[gap]\nlargest_mm = 0.25\n",
            ["one.toml:5: [gap]: nominal_mm is 0.5, expected least_mm 0 to largest_mm 0.25"],
        ),
        (
            f'{LEAST}[courses]\norder = "both"\nstart_corner = "top"\nreverse = 1\nminimum_cut_angle_deg = 90\n'
            "[limits]\nmax_lift_mm = 0\n",
            [
                "one.toml:6: [courses] order: input should be 'one_way' or 'there_and_back', got 'both'",
                "one.toml:7: [courses] start_corner: input should be 'right' or 'left', got 'top'",
                "one.toml:8: [courses] reverse: input should be a valid boolean, got 1",
                "one.toml:9: [courses] minimum_cut_angle_deg: input should be less than 90, got 90",
                "one.toml:11: [limits] max_lift_mm: input should be greater than 0, got 0",
            ],
        ),
        (
            f"{LEAST}boundary = [\n  [0, 0, 0],\n  [1, 0, 0],\n  [1, 1, 0],\n]\n[tape]\nwidth = 3\n",
            ["one.toml:11: unknown key width in [tape]; did you mean width_mm?"],
        ),
    ],
)
def test_all_faults_of_a_file_at_once(text: str, sentences: list[str]) -> None:
    assert refused(text).splitlines() == sentences


def test_a_file_that_is_missing(tmp_path: Path) -> None:
    for read in (read_ply, Ply.read):
        with pytest.raises(PlyRefused, match=r"none\.toml: cannot be read: no such file or directory"):
            read(tmp_path / "none.toml")


def test_files_are_found_from_the_ply_file(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    path.write_text(f'{LEAST}boundary = "points.txt"\n')
    ply = Ply.read(path)
    assert (ply.mould.file, ply.boundary_file) == (str(tmp_path / "hood.stl"), tmp_path / "points.txt")
    path.write_text(f'{LEAST}boundary = "edge"\n')
    assert Ply.read(path).boundary_file is None


@pytest.mark.parametrize(
    "text",
    [
        LEAST,
        f'{LEAST}boundary = "points.txt"\nseed = [1, 2, 3.5]\n[limits]\nmax_gap_mm = 3\n',
        f"{LEAST}boundary = {LOOP}\nholes = [\n{LOOP},\n{LOOP[:4]}]\n[courses]\nreverse = true\n",
    ],
)
def test_a_ply_written_out_reads_back_as_itself(text: str) -> None:
    ply = parse_ply(text.encode(), "one.toml")
    for written in (whole_text(ply, "A ply"), text_of(ply), text_of_values(values_of(text.encode(), Ply), Ply)):
        assert parse_ply(written.encode(), "one.toml").model_dump() == ply.model_dump()
        assert max(map(len, written.splitlines())) < 250


def test_the_form_of_a_ply() -> None:
    schema = schema_of(Ply)
    assert set(schema["properties"]) == {"mould", "ply", "tape", "gap", "courses", "limits"}
    assert schema["$defs"]["Ply"]["required"] == ["angle_deg"]
    described = [key for section in schema["$defs"].values() for key in section["properties"].values()]
    assert all(key["description"] for key in described) and len(described) > 25
    ply = parse_ply(f'{LEAST}boundary = "points.txt"\n'.encode(), "folder/one.toml")
    assert [(change["key"], change["value"], change["default"]) for change in changes(ply)] == [
        ("file", "hood.stl", None),
        ("angle_deg", 45.0, None),
        ("boundary", "points.txt", "edge"),
    ]


def test_the_hash_is_of_values_and_of_the_bytes_of_files() -> None:
    ply = parse_ply(LEAST.encode(), "one.toml")
    elsewhere = parse_ply(LEAST.replace("hood", "copy").encode() + b"[tape]\nwidth_mm = 75\n", "folder/two.toml")
    assert ply.sha256(b"stl") == elsewhere.sha256(b"stl")
    assert len({ply.sha256(b"stl"), ply.sha256(b"other"), ply.with_values("ply", inset_mm=1).sha256(b"stl")}) == 3
    by_file = ply.with_values("ply", boundary="points.txt")
    again = ply.with_values("ply", boundary="corners.txt")
    assert by_file.sha256(b"stl", b"0 0 0") == again.sha256(b"stl", b"0 0 0") != by_file.sha256(b"stl", b"1 0 0")


def test_values_are_checked_when_they_are_replaced() -> None:
    ply = parse_ply(LEAST.encode(), "one.toml")
    assert ply.with_values("ply", angle_deg=0).angle == 0
    with pytest.raises(PlyRefused, match=r"^ply file: \[tape\] width_mm: input should be greater than 0, got -1$"):
        ply.with_values("tape", width_mm=-1)
