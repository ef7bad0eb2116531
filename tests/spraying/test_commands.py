"""Spraying as a user meets it on the command line: programs, trajectory files, reports, refusals."""

from __future__ import annotations

import io
import json
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from tapelayer.cli import main
from tests.helpers.panels import flat, sheet, write_stl
from tests.helpers.paths import ROOT

SETUP = "[part]\nrotation_deg = 90\n[footprint]\nrate_mm3_per_s = 100\n[machine]\nlimits_deg = {theta = [-180, 540]}\n"
PLATE = sheet(np.linspace(0, 300, 7), [0, 50, 100], flat)
WAVE = sheet(np.linspace(0, 300, 31), [0, 60, 120], lambda x, y: 15 * np.sin(x / 40) + 0.1 * y)


class Done(NamedTuple):
    """What a run left on its two streams."""

    stdout: str
    stderr: str


def run(*arguments: object, cwd: Path, expect: int = 0) -> Done:
    """Run the command in a folder, in this process."""
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        patch.setattr(sys, "argv", ["tapelayer", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
    out.flush()
    done = Done(out.buffer.getvalue().decode(), err.getvalue())  # type: ignore[attr-defined]
    assert (left.value.code or 0) == expect, done
    return done


@pytest.fixture(scope="module")
def sprayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model, a setup with the part turned by 90 deg, and everything that is made of them."""
    folder = tmp_path_factory.mktemp("wave")
    write_stl(folder / "wave.stl", WAVE)
    (folder / "job.toml").write_text(SETUP)
    files = ["-o", "a.nc", "--trajectory", "a.txt", "--report", "a.json", "--html", "a.html"]
    done = run("spray", "wave.stl", "--setup", "job.toml", "--direction-deg", 90, *files, cwd=folder)
    assert "a.nc: " in done.stdout and "blocks, verified" in done.stdout and done.stderr == ""
    return folder


def test_the_report_has_every_key(sprayed: Path) -> None:
    report = json.loads((sprayed / "a.json").read_text())
    assert report["passed"] is True and report["failures"] == [] and report["splits"] == []
    assert (report["passes"], report["layers"]) == (5, 1)
    assert report["sprayed_area_m2"] == pytest.approx(0.0378, rel=0.01)
    assert report["unreachable"] == []
    assert report["mesh"]["facets"] == 120 and report["mesh"]["mended"]["duplicate_facets"] == 0
    assert 0 < report["max_deviation_deg"] <= 15 and report["max_position_error_mm"] <= 0.5
    assert report["crease_length_mm"] == 0 and report["max_crease_deviation_deg"] is None
    # Where the gun is at speed on its way along the edge from pass to pass, it leaves a little bare there.
    assert report["coverage_percent"] == pytest.approx(98.0, abs=0.5)
    assert 0 < report["cv_interior_percent"] < report["cv_percent"] < 20
    assert set(report["thickness"]) == {"mean_um", "interior_mean_um", "least_um", "greatest_um"}
    assert set(report["axes"]) == {"x", "y", "z", "theta", "phi"}
    assert report["duration_s"] > report["arc_time_s"] > 6
    # The gun never stands, so this is its way with the arc on: five times the wave with 28 mm beyond either end, and
    # four pitches. No word asks for more than the set 300 mm/s.
    assert report["spraying_stops"] == 0
    sprayed_mm = report["mean_spraying_speed_mm_per_s"] * report["arc_time_s"]
    assert sprayed_mm == pytest.approx(5 * 356 * 1.035 + 4 * 25, rel=0.02)
    assert report["duration_s"] > report["asked_s"] > sprayed_mm / 300
    assert report["time_law"] == "look_ahead"


def test_the_page_stands_alone(sprayed: Path) -> None:
    page = (sprayed / "a.html").read_text()
    assert not re.search(r"src=|href=\"[^#]|url\(|@import|https?://", page)
    for words in ("PASSED", "Plan view", "Thickness of the coat", "Histogram", "along pass", "across the passes"):
        assert words in page


def test_the_trajectory_file_is_the_program_in_the_part_s_frame(sprayed: Path) -> None:
    """Rows turned back by the part's placement are the program's own poses with the arc on."""
    text = (sprayed / "a.txt").read_text()
    heads = re.findall(r"^# pass (\d+) plane (\d+) curve (\d+) layer (\d+)$", text, re.MULTILINE)
    assert [tuple(map(int, head)) for head in heads] == [(k, k, 1, 1) for k in range(1, 6)]
    blocks = [block for block in text.split("\n\n") if block.strip()]
    assert len(blocks) == 5 and text.endswith("\n\n")
    rows = np.loadtxt(sprayed / "a.txt")
    assert re.search(r"^-?\d+\.\d{4}( -?\d+\.\d{4}){4}$", text, re.MULTILINE)
    assert -30 <= np.min(rows[:, 0]) < -20 and 320 < np.max(rows[:, 0]) <= 330
    words: dict[str, float] = {}
    poses, lit = [], False
    for line in (sprayed / "a.nc").read_text().splitlines():
        words |= {letter: float(value) for letter, value in re.findall(r"([XYZAC])(-?[\d.]+)", line) if line[0] == "N"}
        if " M03" in line:
            lit = True
            poses.append(dict(words))
        elif " M05" in line:
            lit = False
        elif lit and re.search(r" [XYZAC]", line):
            poses.append(dict(words))
    program = np.array([[pose[letter] for letter in "XYZCA"] for pose in poses])
    # The part is turned by 90 deg and centred: x = 1250 - (y - 60), y = 1000 + (x - 150).
    expected = np.column_stack([1310 - rows[:, 1], 850 + rows[:, 0], rows[:, 2:] + [0, 90, 0]])
    expected[:, 2] -= np.min(expected[:, 2]) - np.min(program[:, 2])
    found = 0
    for pose in program:
        found += found < len(expected) and bool(np.all(np.abs(pose - expected[found]) <= 1.1e-3))
    assert found == len(expected)
    # The way from pass to pass is one block.
    assert len(program) == len(expected)


def test_verify_says_the_same_of_the_same_program(sprayed: Path) -> None:
    arguments = ["verify", "a.nc", "wave.stl", "--setup", "job.toml", "--direction-deg", 90]
    assert "verified" in run(*arguments, "--report", "b.json", cwd=sprayed).stdout
    assert (sprayed / "b.json").read_bytes() == (sprayed / "a.json").read_bytes()
    refused = run("verify", "a.nc", "wave.stl", "--setup", "job.toml", cwd=sprayed, expect=2)
    assert "give the setup it was made with (options count, too)" in refused.stderr


def test_a_program_edited_by_hand_is_judged(sprayed: Path) -> None:
    text = (sprayed / "a.nc").read_text()
    line = next(line for line in text.splitlines()[60:] if re.search(r"Z\d", line) and " G0" not in line)
    edited = re.sub(r"Z([\d.]+)", lambda found: f"Z{float(found[1]) + 2:.3f}", line)
    (sprayed / "b.nc").write_text(text.replace(line, edited))
    arguments = ["wave.stl", "--setup", "job.toml", "--direction-deg", 90, "--quiet"]
    done = run("verify", "b.nc", *arguments, cwd=sprayed, expect=1)
    assert re.match(r"line \d+: pass \d+ point \d+: position_error_mm is ", done.stderr)
    (sprayed / "c.nc").write_text(text.replace(" M05\n", " M00\n"))
    assert "arc_left_on" in run("verify", "c.nc", *arguments, cwd=sprayed, expect=1).stderr


def test_a_program_is_byte_identical_and_goes_to_stdout(sprayed: Path) -> None:
    arguments = ["spray", "wave.stl", "--setup", "job.toml", "--direction-deg", 90]
    done = run(*arguments, "-o", "-", cwd=sprayed)
    assert done.stdout == (sprayed / "a.nc").read_text()
    assert "verified" in done.stderr


def test_other_controls_say_the_same(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE)
    for controller in ("linuxcnc", "sinumerik840d"):
        run("spray", "plate.stl", "--controller", controller, "-o", "a.nc", "--quiet", cwd=tmp_path)
        run("verify", "a.nc", "plate.stl", "--controller", controller, "--quiet", cwd=tmp_path)
    refused = run("spray", "plate.stl", "--controller", "jb3208", cwd=tmp_path, expect=2).stderr
    assert "has no address for axis theta" in refused


def test_two_layers_the_second_turned(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE)
    (tmp_path / "s.toml").write_text("[spray]\nlayers = 2\ninterlayer_stop = true\n[footprint]\nrate_mm3_per_s = 100\n")
    run("spray", "plate.stl", "--setup", "s.toml", "--report", "a.json", "--trajectory", "a.txt", cwd=tmp_path)
    report = json.loads((tmp_path / "a.json").read_text())
    assert report["passed"] is True and report["layers"] == 2 and report["passes"] == 4 + 12
    # 100 mm3/s on 25 mm x 300 mm/s leave 13.33 um, twice.
    assert report["thickness"]["interior_mean_um"] == pytest.approx(26.67, rel=0.02)
    assert report["coverage_percent"] == pytest.approx(100.0)
    assert (tmp_path / "plate.nc").read_text().count(" M00\n") == 1
    assert len(re.findall(r"layer 2$", (tmp_path / "a.txt").read_text(), re.MULTILINE)) == 12


def test_plating_is_in_contact_and_has_no_coat(tmp_path: Path) -> None:
    write_stl(tmp_path / "wave.stl", WAVE)
    text = "[process]\nkind = 'plating'\ncurrent_a = 80\nrelative_speed_mm_per_s = 150\nflow_l_per_min = 4\n"
    (tmp_path / "s.toml").write_text(text)
    files = ["--report", "a.json", "--html", "a.html"]
    assert "verified" in run("spray", "wave.stl", "--setup", "s.toml", *files, cwd=tmp_path).stdout
    report = json.loads((tmp_path / "a.json").read_text())
    assert report["passed"] is True
    assert report["thickness"] is report["cv_percent"] is report["coverage_percent"] is None
    program = (tmp_path / "wave.nc").read_text()
    assert "(note: current_a 80)" in program and "(note: relative_speed_mm_per_s 150)" in program
    assert "Thickness of the coat" not in (tmp_path / "a.html").read_text()


def test_pitch_auto_is_the_widest_that_is_even_enough(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE)
    run("spray", "plate.stl", "--pitch-mm", "auto", "--report", "a.json", "--quiet", cwd=tmp_path)
    report = json.loads((tmp_path / "a.json").read_text())
    # Gaussian of sigma = 15 mm: 5 % between 2.2 sigma (2.4 %) and 2.5 sigma (6.0 %).
    assert 33.0 < report["pitch_mm"] < 37.5
    refused = run("spray", "plate.stl", "--pitch-mm", "wide", cwd=tmp_path, expect=2).stderr
    assert refused == "--pitch-mm: expected a finite number or 'auto', got 'wide'\n"


def test_the_current_stands_beside_the_arc_and_a_profile_can_be_given(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE)
    (tmp_path / "gun.txt").write_text("0 1\n20 0.5\n30 0\n")
    text = "[process]\ncurrent_a = 180\nvoltage_v = 32\n[footprint]\nmodel = 'profile'\nprofile = 'gun.txt'\n"
    (tmp_path / "s.toml").write_text(text)
    run("spray", "plate.stl", "--setup", "s.toml", "--quiet", cwd=tmp_path)
    program = (tmp_path / "plate.nc").read_text()
    assert program.count(" M03 S180\n") == 1 and "(note: voltage_v 32)" in program
    run("verify", "plate.nc", "plate.stl", "--setup", "s.toml", "--quiet", cwd=tmp_path)
    (tmp_path / "b.nc").write_text(program.replace("S180", "S200"))
    run("verify", "b.nc", "plate.stl", "--setup", "s.toml", "--quiet", cwd=tmp_path)
    (tmp_path / "gun.txt").write_text("0 1\n20 0.7\n30 0\n")
    refused = run("verify", "plate.nc", "plate.stl", "--setup", "s.toml", cwd=tmp_path, expect=2)
    assert "options count, too" in refused.stderr
    (tmp_path / "gun.txt").write_text("1 1\n")
    refused = run("spray", "plate.stl", "--setup", "s.toml", cwd=tmp_path, expect=2)
    assert "gun.txt:1: expected radius 0 first" in refused.stderr


def test_setup_prints_both_kinds(tmp_path: Path) -> None:
    assert run("setup", "--kind", "spray", cwd=tmp_path).stdout.startswith("# Setup of a spraying job\n")
    assert run("setup", cwd=tmp_path).stdout.startswith("# Setup of a tape-laying job\n")
    (tmp_path / "s.toml").write_text(run("setup", "--kind", "spray", cwd=tmp_path).stdout)
    write_stl(tmp_path / "plate.stl", PLATE)
    run("spray", "plate.stl", "--setup", "s.toml", "-o", "a.nc", "--quiet", cwd=tmp_path)
    run("verify", "a.nc", "plate.stl", "--quiet", cwd=tmp_path)


def test_an_option_of_the_other_machine_is_refused(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE)
    (tmp_path / "a.nc").write_text("%\nM30\n%\n")
    done = run("verify", "a.nc", "plate.stl", "--kinematics", "roller", cwd=tmp_path, expect=2)
    assert done.stderr == "--kinematics: belongs to tape courses; leave it out here\n"
    done = run("verify", "a.nc", ROOT / "examples" / "flat_panel_00.txt", "--pitch-mm", 3, cwd=tmp_path, expect=2)
    assert done.stderr == "--pitch-mm: belongs to models; leave it out here\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "part.stl: the file is empty"),
        (b"<html><body>404</body></html>", "part.stl: this is an HTML page; expected an STL model"),
        (b"\0" * 80 + (9).to_bytes(4, "little") + b"\0" * 50, "it is cut short; export it again"),
        (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 nan\n", "part.stl"),
    ],
)
def test_what_is_no_model_is_refused_in_a_sentence(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "part.stl").write_bytes(data)
    done = run("spray", "part.stl", "-o", "a.nc", cwd=tmp_path, expect=2)
    assert message in done.stderr and done.stdout == ""
    assert not (tmp_path / "a.nc").exists()


def test_a_model_in_metres_needs_its_unit(tmp_path: Path) -> None:
    write_stl(tmp_path / "plate.stl", PLATE / 1e3)
    refused = run("spray", "plate.stl", cwd=tmp_path, expect=2).stderr
    assert "--unit m" in refused
    run("spray", "plate.stl", "--unit", "m", "--report", "a.json", "--quiet", cwd=tmp_path)
    assert json.loads((tmp_path / "a.json").read_text())["sprayed_area_m2"] == pytest.approx(0.03, rel=1e-6)
    run("verify", "plate.nc", "plate.stl", "--unit", "m", "--quiet", cwd=tmp_path)


def test_dirty_models_are_mended_and_it_is_told(tmp_path: Path) -> None:
    doubled = np.concatenate([PLATE, PLATE[:3], PLATE[:2][:, [0, 0, 1]], PLATE[5:8][:, ::-1] + [0, 0, 1e-7]])
    write_stl(tmp_path / "plate.stl", doubled)
    done = run("spray", "plate.stl", "--report", "a.json", cwd=tmp_path)
    assert "duplicate facets" in done.stdout and "degenerate facets" in done.stdout
    report = json.loads((tmp_path / "a.json").read_text())
    assert report["passed"] is True
    assert report["mesh"]["mended"]["duplicate_facets"] >= 3 and report["mesh"]["mended"]["degenerate_facets"] >= 2


def test_a_single_facet_is_sprayed_and_a_wall_refused(tmp_path: Path) -> None:
    write_stl(tmp_path / "one.stl", PLATE[:1])
    run("spray", "one.stl", "--report", "a.json", "--quiet", cwd=tmp_path, expect=2)
    write_stl(tmp_path / "one.stl", np.array([[[0, 0, 0], [200, 0, 0], [0, 200, 0]]]))
    run("spray", "one.stl", "--report", "a.json", "--quiet", cwd=tmp_path)
    assert json.loads((tmp_path / "a.json").read_text())["sprayed_area_m2"] == pytest.approx(0.02, rel=1e-6)
    write_stl(tmp_path / "wall.stl", np.array([[[0, 0, 0], [200, 0, 0], [0, 0, 200]]]))
    refused = run("spray", "wall.stl", cwd=tmp_path, expect=2).stderr
    assert refused.startswith("wall.stl: no pass can be sprayed on it: of the surface 200 cm2 too steep")


def test_the_documents_name_every_key(sprayed: Path) -> None:
    text = (ROOT / "docs" / "spray.md").read_text()
    report = json.loads((sprayed / "a.json").read_text())
    rows = text[text.index("## The report") :]
    assert [key for key in report if f"`{key}`" not in rows] == []


@pytest.mark.parametrize(
    ("limit", "sentence"),
    [("max_thickness_deviation_percent = 0.01", "cv_percent is "), ("min_speed_share = 1", "speed_share is ")],
)
def test_a_coat_or_speed_beyond_its_limit_withholds_the_program(tmp_path: Path, limit: str, sentence: str) -> None:
    write_stl(tmp_path / "wave.stl", WAVE)
    axes = "[machine]\nspeeds_deg_per_s = {phi = 5}\n"
    (tmp_path / "s.toml").write_text(f"{axes}[verification]\n{limit}\n")
    outputs = ("--report", "a.json", "--html", "a.html")
    done = run("spray", "wave.stl", "--setup", "s.toml", *outputs, cwd=tmp_path, expect=1)
    assert sentence in done.stderr and done.stdout == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.toml", "wave.stl"]
