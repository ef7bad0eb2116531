"""The command line as a user meets it: what it writes, says and leaves behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tapelayer.jobs.kinds import MACHINE_NAMES, kind_of, machine_kind_of
from tapelayer.laying.settings import Setup
from tapelayer.provenance import VERSION, unedited
from tapelayer.setups.sections import whole_text
from tests.helpers.paths import ROOT
from urdf import TAPELAYER

EXAMPLES = ROOT / "examples"
FLAT = EXAMPLES / "flat_panel_00.txt"
HERE = os.environ | {"PYTHONPATH": str(ROOT)}
SWAPPED = "[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}\n"


def run(*arguments: object, cwd: Path, expect: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder; no run may end in a traceback."""
    command = [sys.executable, "-c", "from tapelayer.cli import main; main()", *map(str, arguments)]
    environment = os.environ | {"COLUMNS": "80", "NO_COLOR": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=environment, timeout=120, check=False)
    assert done.returncode == expect, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_help_lists_the_commands(tmp_path: Path) -> None:
    shown = run("--help", cwd=tmp_path).stdout
    for command in ("export", "verify", "inspect", "setup", "machine", "controllers", "demo"):
        assert f" {command} " in shown
    assert "Example:" in run("export", "--help", cwd=tmp_path).stdout


def test_export_then_verify(tmp_path: Path) -> None:
    """The program, the report and the page are written together; the program is verified from its text again."""
    done = run("export", FLAT, "-o", "a.nc", "--report", "a.json", "--html", "a.html", cwd=tmp_path)
    assert "a.nc: " in done.stdout
    assert "blocks, verified" in done.stdout
    assert done.stderr == ""
    assert names(tmp_path) == {"a.nc", "a.json", "a.html"}
    report = json.loads((tmp_path / "a.json").read_text())
    assert report["passed"] is True
    assert report["courses"] == 7
    again = run("verify", "a.nc", FLAT, "--report", "b.json", cwd=tmp_path)
    assert "verified" in again.stdout
    assert json.loads((tmp_path / "b.json").read_text()) == report


def test_export_is_byte_identical_and_named_after_its_input(tmp_path: Path) -> None:
    run("export", FLAT, "--quiet", cwd=tmp_path)
    first = (tmp_path / "flat_panel_00.nc").read_bytes()
    run("export", FLAT, "-o", "other.nc", "--quiet", cwd=tmp_path)
    assert (tmp_path / "other.nc").read_bytes() == first


def test_stdout_takes_the_program_alone(tmp_path: Path) -> None:
    done = run("export", FLAT, "-o", "-", cwd=tmp_path)
    assert done.stdout.startswith("%\n(tapelayer ")
    assert done.stdout.endswith("M30\n%\n")
    assert "verified" in done.stderr
    assert names(tmp_path) == set()


def test_quiet_says_nothing_and_verbose_every_step(tmp_path: Path) -> None:
    quiet = run("export", FLAT, "--quiet", cwd=tmp_path)
    assert quiet.stdout == quiet.stderr == ""
    verbose = run("export", FLAT, "--verbose", cwd=tmp_path)
    for step in ("planning: ", "writing: ", "reading back: ", "verifying the plan: ", "verifying: "):
        assert step in verbose.stderr


def test_a_limit_is_one_sentence_and_nothing_is_written(tmp_path: Path) -> None:
    done = run("export", EXAMPLES / "wing_skin_45.txt", cwd=tmp_path, expect=2)
    lines = done.stderr.splitlines()
    name = EXAMPLES / "wing_skin_45.txt"
    assert lines[0] == (
        f"{name}: course 15 point 92: axis c would be at 45.101 deg, beyond its bound 30 deg (travel -30 to 30)"
    )
    assert lines[1].startswith(f"{name}: ")
    assert "limits_deg = {c = [-180, 180], a = [-30, 30]}" in lines[1]
    assert len(lines) == 2
    assert names(tmp_path) == set()


def test_a_setup_overrides_the_limits(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(SWAPPED)
    run("export", EXAMPLES / "wing_skin_45.txt", "--setup", "job.toml", "-o", "a.nc", cwd=tmp_path)
    run("verify", "a.nc", EXAMPLES / "wing_skin_45.txt", "--setup", "job.toml", cwd=tmp_path)
    other = run("verify", "a.nc", EXAMPLES / "wing_skin_45.txt", cwd=tmp_path, expect=2)
    assert other.stderr.startswith("a.nc: its header names the setup ")
    assert "--force" in other.stderr
    forced = run("verify", "a.nc", EXAMPLES / "wing_skin_45.txt", "--force", cwd=tmp_path, expect=1)
    assert "axis_c_deg is 45.1" in forced.stderr


def test_a_program_edited_by_hand_is_judged_by_its_text(tmp_path: Path) -> None:
    run("export", FLAT, "-o", "a.nc", "--quiet", cwd=tmp_path)
    text = (tmp_path / "a.nc").read_text()
    line = next(number for number, line in enumerate(text.splitlines(), 1) if " M20" in line)
    broken = text.splitlines()
    broken[line] = broken[line]
    move = next(number for number in range(line, len(broken)) if " Y" in broken[number])
    y = next(word for word in broken[move].split() if word.startswith("Y"))
    broken[move] = broken[move].replace(y, f"Y{float(y[1:]) + 1:.3f}")
    (tmp_path / "b.nc").write_text("\n".join(broken) + "\n")
    done = run("verify", "b.nc", FLAT, "--report", "b.json", cwd=tmp_path, expect=1)
    assert f"line {move + 1}: course 1 point " in done.stderr
    report = json.loads((tmp_path / "b.json").read_text())
    assert report["passed"] is False
    assert report["failures"][0]["course"] == 1


def test_another_course_file_is_said_and_judged(tmp_path: Path) -> None:
    run("export", FLAT, "-o", "a.nc", "--quiet", cwd=tmp_path)
    copy = tmp_path / "copy.txt"
    copy.write_bytes(b"# the same courses\n" + FLAT.read_bytes())
    done = run("verify", "a.nc", copy, cwd=tmp_path)
    assert "a.nc: its header names another course file than" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("export", "none.txt"), "none.txt: cannot be read: no such file or directory"),
        (("export", "."), ".: cannot be read: is a directory"),
        (("inspect", "none.txt"), "none.txt: cannot be read: no such file or directory"),
        (("verify", "none.nc", FLAT), "none.nc: cannot be read: no such file or directory"),
        (("export", FLAT, "--setup", "none.toml"), "none.toml: cannot be read: no such file or directory"),
        (("export", FLAT, "-o", "none/a.nc"), "none/a.nc: cannot be written: no such file or directory"),
        (
            ("export", FLAT, "--kinematics", "exact"),
            "--kinematics: input should be 'roller' or 'published', got 'exact'",
        ),
        (
            ("export", FLAT, "--controller", "fanuc"),
            "there are generic5, jb3208, linuxcnc, linuxcnc_remap, sinumerik840d;",
        ),
        (("machine", "--setup", "bad.toml"), "no axis 'w'; the axes are x, y, z, c, a, u, v, d, q, e"),
        (("export", FLAT, "--setup", "urdf.toml"), "none.urdf"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(tmp_path: Path, arguments: tuple[object, ...], message: str) -> None:
    (tmp_path / "bad.toml").write_text("[machine]\nlimits_mm = {w = [0, 1]}\n")
    (tmp_path / "urdf.toml").write_text('[machine]\nurdf = "none.urdf"\n')
    before = names(tmp_path)
    done = run(*arguments, cwd=tmp_path, expect=2)
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""
    assert names(tmp_path) == before


def test_a_failing_export_leaves_the_old_program(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text("old")
    run("export", EXAMPLES / "wing_skin_45.txt", "-o", "a.nc", "--force", cwd=tmp_path, expect=2)
    run("export", FLAT, "-o", "a.nc", "--html", "none/a.html", "--force", cwd=tmp_path, expect=2)
    assert (tmp_path / "a.nc").read_text() == "old"
    assert names(tmp_path) == {"a.nc"}


def test_the_papers_form_is_reported_loudly(tmp_path: Path) -> None:
    cylinder = EXAMPLES / "cylinder_panel_15.txt"
    done = run("export", cylinder, "--kinematics", "published", "-o", "a.nc", cwd=tmp_path)
    assert "published kinematics: the roller leaves the surface by up to 28.42 deg" in done.stderr
    (tmp_path / "tilt.toml").write_text("[verification]\nmax_roller_tilt_deg = 1\n")
    failed = run(
        *("export", cylinder, "--kinematics", "published", "--setup", "tilt.toml", "-o", "b.nc"), cwd=tmp_path, expect=1
    )
    assert "roller_tilt_deg is " in failed.stderr
    assert names(tmp_path) == {"a.nc", "tilt.toml"}


def test_setup_prints_the_commented_default(tmp_path: Path) -> None:
    assert run("setup", cwd=tmp_path).stdout == whole_text(Setup(), "Setup of a tape-laying job")


def test_machine_controllers_and_inspect_show_what_there_is(tmp_path: Path) -> None:
    assert "l4 = 350, l5 = 60, l6 = 450, roller radius = 40 mm" in run("machine", cwd=tmp_path).stdout
    assert "jb3208" in run("controllers", cwd=tmp_path).stdout
    shown = run("inspect", FLAT, cwd=tmp_path).stdout
    assert "7 courses, 259 points, 6.300 m of tape laid" in shown


def test_machine_shows_either_kind_and_knows_it_by_its_setup(tmp_path: Path) -> None:
    sprayer = run("machine", "--kind", "spray", cwd=tmp_path).stdout
    for axis in ("x", "y", "z", "theta", "phi"):
        assert f" {axis} " in sprayer
    (tmp_path / "s.toml").write_text("[footprint]\nrate_mm3_per_s = 100\n")
    assert run("machine", "--setup", "s.toml", cwd=tmp_path).stdout == sprayer
    refused = run("machine", "--setup", "s.toml", "--kind", "lay", cwd=tmp_path, expect=2)
    assert refused.stderr == "s.toml: this is a spraying setup: tapelayer spray MODEL.stl --setup s.toml\n"


def test_demo_leaves_program_report_and_page(tmp_path: Path) -> None:
    run("demo", cwd=tmp_path)
    assert names(tmp_path / "demo") == {f"cylinder_panel_15.{ending}" for ending in ("nc", "json", "html")}


def test_demo_of_planning_leaves_courses_too(tmp_path: Path) -> None:
    said = run("demo", "--plan", cwd=tmp_path).stdout
    assert names(tmp_path / "demo") == {f"panel_ply_0.{ending}" for ending in ("txt", "nc", "json", "html")}
    assert "11 courses, judged" in said and "blocks, verified" in said


def test_two_exports_at_once_do_not_mix(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from tapelayer.cli import main; main()", "export"]
    files = [EXAMPLES / "flat_panel_00.txt", EXAMPLES / "cylinder_panel_15.txt"]
    alone = []
    for file in files:
        run("export", file, "-o", "alone.nc", "--quiet", cwd=tmp_path)
        alone.append((tmp_path / "alone.nc").read_bytes())
    both = [
        subprocess.Popen(
            [*command, str(file), "-o", "a.nc", "--quiet"], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}
        )
        for file in files
    ]
    assert [process.wait(120) for process in both] == [0, 0]
    assert (tmp_path / "a.nc").read_bytes() in alone
    assert names(tmp_path) == {"alone.nc", "a.nc"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("export", "a.txt", "-o", "a.txt"), "a.txt: is the same file as the input a.txt; name another"),
        (("export", "b.nc"), "b.nc: is the same file as the input b.nc; name another"),
        (("export", "a.txt", "-o", "link"), "link: is the same file as the input a.txt; name another"),
        (("export", "a.txt", "-o", "x", "--report", "x"), "x: is the same file as the output x; name another"),
        (("export", "a.txt", "-o", "x", "--html", "./x"), "./x: is the same file as the output x; name another"),
        (
            ("export", "a.txt", "--setup", "s.toml", "--report", "s.toml"),
            "s.toml: is the same file as the input s.toml",
        ),
        (("export", "a.txt", "--setup", "s.toml", "--html", "m.urdf"), "m.urdf: is the same file as the input m.urdf"),
        (("export", "a.txt", "--controller", "./c.toml", "-o", "c.toml"), "is the same file as the input ./c.toml"),
        (("verify", "p.nc", "a.txt", "--report", "p.nc"), "p.nc: is the same file as the input p.nc"),
        (("export", "a.txt", "--report", "-"), "-: is no name of a report; only the program goes to stdout, by -o -"),
        (("export", "a.txt", "-o", "notes"), "notes: holds what tapelayer did not write, or what was edited since"),
        (("demo", "--into", "a.txt"), "a.txt: cannot be made a folder: file exists; name another by --into"),
    ],
)
def test_no_input_and_no_work_of_others_is_replaced(tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    for name in ("a.txt", "b.nc"):
        (tmp_path / name).write_bytes(FLAT.read_bytes())
    (tmp_path / "link").symlink_to("a.txt")
    (tmp_path / "s.toml").write_text('[machine]\nurdf = "m.urdf"\n')
    (tmp_path / "m.urdf").write_bytes((ROOT / "urdf" / TAPELAYER.name).read_bytes())
    (tmp_path / "c.toml").write_bytes((ROOT / "post" / "controllers" / "jb3208.toml").read_bytes())
    (tmp_path / "p.nc").write_text("%\nM30\n%\n")
    (tmp_path / "notes").write_text("mine")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    done = run(*arguments, cwd=tmp_path, expect=2)
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_own_outputs_are_replaced_and_edited_ones_with_force_only(tmp_path: Path) -> None:
    everything = ("export", FLAT, "-o", "a.nc", "--report", "a.json", "--html", "a.html", "--quiet")
    run(*everything, cwd=tmp_path)
    run(*everything, cwd=tmp_path)
    for name in ("a.nc", "a.json", "a.html"):
        written = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(written.replace(b"0.0", b"0.1", 1))
        assert f"{name}: holds what" in run(*everything, cwd=tmp_path, expect=2).stderr
        run(*everything, "--force", cwd=tmp_path)
        assert (tmp_path / name).read_bytes() == written


@pytest.mark.parametrize("arguments", [("setup",), ("controllers",), ("inspect", FLAT), ("export", FLAT, "-o", "-")])
def test_a_full_stdout_is_one_sentence(tmp_path: Path, arguments: tuple[object, ...]) -> None:
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", *map(str, arguments)]
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, env=HERE, timeout=120, check=False
        )
    assert done.stderr == "the output: cannot be read or written: no space left on device\n"
    assert done.returncode == 2


@pytest.mark.parametrize("seconds", [0.0, 0.1, 0.3, 0.6, 1.0])
def test_an_interrupt_at_any_moment_leaves_nothing(tmp_path: Path, seconds: float) -> None:
    """From the first line of the command on, within its imports too."""
    code = "import sys; from tapelayer.dispatch import main; print('begun', flush=True); main()"
    code = code.replace("print", "import tapelayer.dispatch as d; d.signal.signal(2, d._leave); print")
    command = [sys.executable, "-c", code, "export", str(FLAT), "--quiet"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=-1, stderr=-1, text=True, env=HERE) as started:
        assert started.stdout is not None
        started.stdout.readline()
        time.sleep(seconds)
        started.send_signal(signal.SIGINT)
        _, said = started.communicate(timeout=60)
    assert said == ""
    assert started.returncode in (0, 130, -signal.SIGINT)
    # Nothing, or the whole program: the signal may come when it is saved already.
    assert names(tmp_path) <= {"flat_panel_00.nc"} and (started.returncode or names(tmp_path))
    assert all(unedited((tmp_path / name).read_bytes()) for name in names(tmp_path))


def test_several_course_files_become_a_program_each(tmp_path: Path) -> None:
    """A faulty one stops only itself, each has a line, and the exit code is the worst."""
    (tmp_path / "bad.txt").write_text("1\nstart\n")
    sources = [FLAT, "bad.txt", EXAMPLES / "cylinder_panel_15.txt", EXAMPLES / "wing_skin_45.txt"]
    everything = ("-o", "out", "--report", "out", "--html", "pages")
    done = run("export", *sources, *everything, cwd=tmp_path, expect=2)
    assert [line.split(": ")[0] for line in done.stdout.splitlines()] == [
        "out/flat_panel_00.nc",
        "out/cylinder_panel_15.nc",
    ]
    assert {line.split(":")[0] for line in done.stderr.splitlines()} == {"bad.txt", str(EXAMPLES / "wing_skin_45.txt")}
    made = {"flat_panel_00", "cylinder_panel_15"}
    assert names(tmp_path / "out") == {f"{stem}.{ending}" for stem in made for ending in ("nc", "json")}
    assert names(tmp_path / "pages") == {f"{stem}.html" for stem in made}
    run("export", FLAT, "-o", "alone/", "--report", "alone/", "--quiet", cwd=tmp_path)
    for name in ("flat_panel_00.nc", "flat_panel_00.json"):
        assert (tmp_path / "alone" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    run("export", FLAT, "-o", "pages", "--quiet", cwd=tmp_path)
    assert "flat_panel_00.nc" in names(tmp_path / "pages")


def test_a_program_that_fails_among_several_has_exit_code_1(tmp_path: Path) -> None:
    (tmp_path / "tilt.toml").write_text("[verification]\nmax_roller_tilt_deg = 1\n")
    cylinder = EXAMPLES / "cylinder_panel_15.txt"
    options = ("--kinematics", "published", "--setup", "tilt.toml", "--json")
    done = run("export", cylinder, FLAT, *options, cwd=tmp_path, expect=1)
    assert all(line.startswith((f"{cylinder}: ", "flat_panel_00.nc: ")) for line in done.stderr.splitlines())
    reports = json.loads(done.stdout)
    assert {name: report["passed"] for name, report in reports.items()} == {str(cylinder): False, str(FLAT): True}
    assert names(tmp_path) == {"tilt.toml", "flat_panel_00.nc"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("-o", "file"), "-o file: is no folder; several programs go to a folder, name one"),
        (("-o", "-"), "-o -: is no folder; several programs go to a folder, name one"),
        (("--html", "file"), "--html file: is no folder; several programs go to a folder, name one"),
        (("sub/a.txt",), "sub/a.txt: its program would have the name of that of a.txt, a.nc; give them one by one"),
        (("b.nc",), "b.nc: is the same file as the input b.nc; name another"),
        (("a.txt",), "a.txt: its program would have the name of that of a.txt, a.nc; give them one by one"),
        (("-o", "file/sub"), "file/sub: cannot be made a folder: not a directory; name another by -o"),
    ],
)
def test_names_of_several_are_checked_before_any_work(
    tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    (tmp_path / "sub").mkdir()
    for name in ("a.txt", "c.txt", "b.nc", "sub/a.txt"):
        (tmp_path / name).write_bytes(FLAT.read_bytes())
    (tmp_path / "file").write_text("mine")
    before = names(tmp_path)
    done = run("export", "a.txt", "c.txt", *arguments, cwd=tmp_path, expect=2)
    assert set(done.stderr.splitlines()) == {sentence}
    assert done.stdout == ""
    assert names(tmp_path) == before and names(tmp_path / "sub") == {"a.txt"}


def test_json_alone_stands_on_stdout(tmp_path: Path) -> None:
    done = run("export", FLAT, "--json", "--report", "a.json", cwd=tmp_path)
    assert done.stdout == (tmp_path / "a.json").read_text()
    assert "blocks, verified" in done.stderr
    again = run("verify", "flat_panel_00.nc", FLAT, "--json", "--quiet", cwd=tmp_path)
    assert (again.stdout, again.stderr) == (done.stdout, "")
    refused = run("export", FLAT, "--json", "-o", "-", cwd=tmp_path, expect=2)
    assert refused.stderr == "--json: the program goes to stdout already, by -o -; leave one of them out\n"


def test_help_shows_the_defaults_of_the_setups_and_no_type(tmp_path: Path) -> None:
    lay, spray = (
        {"output": machine_kind_of(name).setup.model_validate({}).output.controller} for name in MACHINE_NAMES
    )
    process = Setup().process
    pages = {name: run(name, "--help", cwd=tmp_path).stdout for name in ("export", "spray", "verify", "serve", "setup")}
    pages = {name: " ".join(page.replace("│", " ").split()) for name, page in pages.items()}
    assert f"[default: {lay['output']}]" in pages["export"]
    assert f"[default: {process.kinematics}]" in pages["export"]
    assert f"[default: {spray['output']}]" in pages["spray"]
    passes = kind_of("spray").setup.model_validate({}).model_dump()["spray"]
    assert f"[default: {passes['direction_deg']:g}]" in pages["spray"]
    assert f"[default: {passes['pitch_mm']:g}]" in pages["spray"]
    for page in (*pages.values(), run("--help", cwd=tmp_path).stdout):
        assert "<bool>" not in page and "<str>" not in page


def test_brackets_in_a_name_are_no_markup(tmp_path: Path) -> None:
    name = "[bold]panel[x].txt"
    (tmp_path / name).write_bytes(FLAT.read_bytes())
    assert name in run("inspect", name, cwd=tmp_path).stdout
    assert "[bold]panel[x].nc: 125 blocks, verified" in run("export", name, cwd=tmp_path).stdout


def test_version(tmp_path: Path) -> None:
    assert run("--version", cwd=tmp_path).stdout == f"tapelayer {VERSION}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_are_shown_and_installed(tmp_path: Path, shell: str) -> None:
    environment = HERE | {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1", "HOME": str(tmp_path)}
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()"]
    for option in ("--show-completion", "--install-completion"):
        done = subprocess.run(
            [*command, option, shell], env=environment, capture_output=True, text=True, timeout=60, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert shell in done.stdout or "_TAPELAYER_COMPLETE" in done.stdout
    assert any("_TAPELAYER_COMPLETE" in path.read_text() for path in tmp_path.rglob("*") if path.is_file())


@pytest.mark.parametrize(
    ("variables", "offered"),
    [
        ({"_TAPELAYER_COMPLETE": "complete_bash", "COMP_WORDS": "tapelayer ex", "COMP_CWORD": "1"}, {"export"}),
        (
            {"_TAPELAYER_COMPLETE": "complete_bash", "COMP_WORDS": "tapelayer spray --unit ", "COMP_CWORD": "3"},
            {"mm", "cm", "m", "in"},
        ),
        (
            {
                "_TAPELAYER_COMPLETE": "complete_fish",
                "_TYPER_COMPLETE_ARGS": "tapelayer export --controller jb",
                "_TYPER_COMPLETE_FISH_ACTION": "get-args",
            },
            {"jb3208"},
        ),
    ],
)
def test_shells_complete_commands_and_values(variables: dict[str, str], offered: set[str]) -> None:
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()"]
    done = subprocess.run(command, env=HERE | variables, capture_output=True, text=True, timeout=60, check=False)
    assert set(done.stdout.split()) == offered


@pytest.mark.parametrize(
    "arguments", [("--help",), ("export", "--help"), ("controllers",), ("exprt",), ("inspect", FLAT)]
)
def test_the_locale_c_gets_ascii_from_every_command(tmp_path: Path, arguments: tuple[object, ...]) -> None:
    plain = {
        name: value for name, value in HERE.items() if not name.startswith(("LC_", "LANG", "PYTHONUTF8", "PYTHONIO"))
    }
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", *map(str, arguments)]
    environment = plain | {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, timeout=60, check=False)
    assert (done.stdout + done.stderr).isascii() and b"---" in done.stdout + done.stderr
    utf8 = subprocess.run(
        command, cwd=tmp_path, env=plain | {"LC_ALL": "C.UTF-8"}, capture_output=True, timeout=60, check=False
    )
    assert not (utf8.stdout + utf8.stderr).isascii()


@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
def test_a_file_name_that_is_no_text_is_shown_by_its_bytes(tmp_path: Path, locale: str) -> None:
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", "export"]
    environment = HERE | {"LC_ALL": locale}
    (tmp_path / os.fsdecode(b"p\xe7.txt")).write_bytes(FLAT.read_bytes())
    for name, words in (
        (b"n\xe7.txt", b"n\\xe7.txt: cannot be read"),
        (b"p\xe7.txt", b"p\\xe7.nc: 125 blocks, verified"),
    ):
        done = subprocess.run(
            [*map(os.fsencode, command), name],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            timeout=60,
            check=False,
        )
        assert words in done.stdout + done.stderr


def test_the_language_is_the_locales_unless_an_option_says_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page and the table are in one language; the JSON report is the same bytes in both."""
    outputs = ("-o", "a.nc", "--report", "a.json", "--html", "a.html")
    monkeypatch.setenv("LC_ALL", "zh_CN.UTF-8")
    chinese = run("export", FLAT, *outputs, cwd=tmp_path).stdout
    assert "校验：合格" in chinese and 'lang="zh-CN"' in (tmp_path / "a.html").read_text("utf-8")
    told = (tmp_path / "a.json").read_bytes()
    assert json.loads(told)["subject"]["judged_at"] == "2026-01-01T00:00:00Z"
    english = run("export", FLAT, *outputs, "--language", "en", cwd=tmp_path).stdout
    assert "Verification: passed" in english and 'lang="en"' in (tmp_path / "a.html").read_text("utf-8")
    assert (tmp_path / "a.json").read_bytes() == told


@pytest.mark.parametrize("epoch", ["yesterday", "", "1e9", "9" * 30])
def test_a_moment_that_is_none_is_refused_before_any_work(tmp_path: Path, epoch: str) -> None:
    command = [sys.executable, "-c", "from tapelayer.dispatch import main; main()", "export", str(FLAT)]
    environment = HERE | {"SOURCE_DATE_EPOCH": epoch}
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False)
    sentence = f"expected whole seconds since 1970, got {epoch!r}; set it to such a number, or unset it"
    assert (done.returncode, done.stderr) == (2, f"SOURCE_DATE_EPOCH: {sentence}\n")
    assert not names(tmp_path)


def test_controls_are_compared_in_one_table(tmp_path: Path) -> None:
    """A row a control, with the figures of its own export; nothing is written, and those without the axes are named."""
    shown = run("compare", FLAT, cwd=tmp_path).stdout
    for control in ("jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d"):
        assert f" {control} " in shown
    assert "controller generic5: has no address for axis u" in shown
    told = json.loads(run("compare", FLAT, "--json", cwd=tmp_path).stdout)
    assert set(told) == {"generic5", "jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d"}
    assert names(tmp_path) == set()
    run("export", FLAT, "--controller", "linuxcnc", "--report", "a.json", "--quiet", cwd=tmp_path)
    report = json.loads((tmp_path / "a.json").read_text())
    for key in ("duration_s", "asked_s", "speed_share", "laying_stops", "time_law", "passed"):
        assert told["linuxcnc"][key] == report[key]
    assert "expected a course number" in run("compare", ROOT / "pyproject.toml", cwd=tmp_path, expect=2).stderr
