"""A worker does one job in a process of its own, and says how it goes in lines that nothing else gets into."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tapelayer.jobs.kinds import kind_of
from tapelayer.jobs.stages import Stage
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.reporting.subject import Occasion
from tapelayer.reporting.words import Words
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.job import SprayJob
from tapelayer.spraying.settings import SpraySetup
from tapelayer.workbench.store import PAGES
from tapelayer.workbench.worker import WATERMARK, Stages
from tests.helpers.kinds import MOMENT
from tests.helpers.panels import flat, sheet, write_stl
from tests.helpers.paths import EXAMPLES, ROOT
from urdf import TAPELAYER

COURSES = EXAMPLES / "flat_panel_00.txt"
PLENTY = 8 * 2**30
TABLES = ("poses", "speeds", "errors", "points")


def ask(folder: Path, request: Mapping[str, Any], source: bytes, setup: str = "") -> Path:
    """A folder with what is asked for."""
    folder.mkdir()
    (folder / "request.json").write_text(json.dumps({"parts": [], **request}))
    (folder / "source").write_bytes(source)
    (folder / "setup.toml").write_text(setup)
    return folder


def lay(folder: Path, source: bytes | None = None, setup: str = "") -> Path:
    request = {"kind": "lay", "name": "铺层.txt", "program_name": "铺层.nc"}
    return ask(folder, request, COURSES.read_bytes() if source is None else source, setup)


def start(*arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, *(arguments or ("-P", "-m", "tapelayer.workbench.worker"))]
    worker = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert worker.stdout is not None
    assert json.loads(worker.stdout.readline()) == {"ready": True}
    return worker


def carry_out(folder: Path, memory_bytes: int = PLENTY, worker: subprocess.Popen[bytes] | None = None) -> Any:
    """Lines of a worker that is given a folder, and what it leaves on stderr."""
    worker = worker or start()
    assert worker.stdin and worker.stdout and worker.stderr
    with worker:
        worker.stdin.write(json.dumps({"folder": str(folder), "memory_bytes": memory_bytes}).encode() + b"\n")
        worker.stdin.flush()
        lines = [json.loads(line) for line in worker.stdout]
        errors = worker.stderr.read().decode()
    assert worker.returncode == 0, errors
    return lines, errors


def made(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "out").iterdir()}


def rising(lines: list[dict[str, Any]]) -> list[str]:
    """The stages in order, with their progress proved to rise from 0 and to stay under 1."""
    progress = [line["progress"] for line in lines]
    assert progress[0] == 0 and progress == sorted(progress) and progress[-1] < 1
    stages = [line["stage"] for line in lines]
    return [stage for stage, before in zip(stages, ["", *stages], strict=False) if stage != before]


def test_a_lay_job_is_the_librarys_with_tables_of_it(tmp_path: Path) -> None:
    setup = "[process]\nlay_speed_mm_per_s = 200\n"
    folder = lay(tmp_path / "job", setup=setup)
    lines, errors = carry_out(folder)
    assert errors == ""
    told = Job.of(COURSES.read_bytes(), "铺层.txt", parse_setup(setup.encode(), "setup.toml", Setup)).make("铺层.nc")
    out = made(folder)
    assert out["program.nc"] == told.text
    assert out["report.json"] == told.report_file(Occasion("铺层.nc", "", MOMENT))
    assert out["report.html"] == told.page_file(Occasion("铺层.nc", "", MOMENT))
    assert out["report.zh.html"] == told.page_file(Occasion("铺层.nc", "", MOMENT), "zh")
    assert out["setup.toml"].decode() == setup
    assert out["machine.urdf"] == told.job.machine.path.read_bytes()
    tables = {f"{name}.{end}" for name in (*TABLES, "tape") for end in ("f32", "json")}
    plain = {"program.nc", *PAGES.values(), "report.json", "setup.toml", "machine.urdf", "blocks.json"}
    assert set(out) == tables | plain
    assert rising(lines[:-1]) == [stage.name for stage in kind_of("lay").making]
    report = told.report()
    assert lines[-1] == {
        "state": "done",
        "error": None,
        "summary": {
            **{key: report[key] for key in ("blocks", "courses", "duration_s", "max_position_error_mm")},
            "program_sha256": hashlib.sha256(told.text).hexdigest(),
            "passed": True,
            "failures": 0,
            "controller": "jb3208",
            "bytes": len(told.text),
            "remarks": [],
        },
    }


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("plate") / "plate.stl"
    return write_stl(path, sheet(np.linspace(0, 300, 7), [0, 50, 100], flat)).read_bytes()


def test_a_spray_job_is_the_librarys(tmp_path: Path, plate: bytes) -> None:
    setup = "[footprint]\nrate_mm3_per_s = 100\n"
    request = {"kind": "spray", "name": "plate.stl", "program_name": "plate.nc", "unit": "mm"}
    folder = ask(tmp_path / "job", request, plate, setup)
    lines, _ = carry_out(folder)
    job = SprayJob.of(plate, "plate.stl", parse_setup(setup.encode(), "setup.toml", SpraySetup))
    told = job.make("plate.nc")
    out = made(folder)
    assert out["program.nc"] == told.text
    assert out["trajectory.txt"] == told.files()["trajectory.txt"]
    assert out["report.json"] == told.report_file(Occasion("plate.nc", "", MOMENT))
    assert {f"{name}.f32" for name in (*TABLES, "part", "coat")} <= set(out)
    assert rising(lines[:-1]) == [stage.name for stage in kind_of("spray").making]
    assert lines[-1]["state"] == "done"
    assert lines[-1]["summary"]["passes"] == told.report()["passes"]


def test_a_verdict_is_given_good_or_bad(tmp_path: Path) -> None:
    job = Job.of(COURSES.read_bytes(), "a.txt", Setup())
    text = job.make("a.nc").text
    request = {"kind": "verify", "of": "lay", "name": "a.txt", "program_name": "a.nc", "force": False}
    good = ask(tmp_path / "good", request, COURSES.read_bytes())
    (good / "program").write_bytes(text)
    lines, _ = carry_out(good)
    assert rising(lines[:-1]) == [stage.name for stage in kind_of("lay").judging]
    assert (lines[-1]["state"], lines[-1]["summary"]["passed"]) == ("done", True)
    assert set(made(good)) == {"report.json", *PAGES.values()}
    assert json.loads(made(good)["report.json"])["passed"] is True
    edited = text.replace(b" Y940.000", b" Y941.000")
    assert edited != text
    bad = ask(tmp_path / "bad", request | {"force": True}, COURSES.read_bytes(), "[tape]\nwidth_mm = 74\n")
    (bad / "program").write_bytes(edited)
    lines, _ = carry_out(bad)
    assert (lines[-1]["state"], lines[-1]["summary"]["passed"]) == ("done", False)
    report = json.loads(made(bad)["report.json"])
    assert report["passed"] is False and len(report["failures"]) == lines[-1]["summary"]["failures"] > 0


def test_a_verdict_on_a_spray_program(tmp_path: Path, plate: bytes) -> None:
    setup = "[footprint]\nrate_mm3_per_s = 100\n"
    job = SprayJob.of(plate, "plate.stl", parse_setup(setup.encode(), "setup.toml", SpraySetup))
    request = {"kind": "verify", "of": "spray", "name": "p.stl", "program_name": "p.nc", "unit": "mm", "force": False}
    folder = ask(tmp_path / "job", request, plate, setup)
    (folder / "program").write_bytes(job.make("p.nc").text)
    lines, _ = carry_out(folder)
    assert rising(lines[:-1]) == [stage.name for stage in kind_of("spray").judging]
    assert (lines[-1]["state"], lines[-1]["summary"]["passed"]) == ("done", True)


def test_a_program_that_fails_is_withheld_with_everything_else_there(tmp_path: Path) -> None:
    source = COURSES.with_name("cylinder_panel_15.txt").read_bytes()
    folder = lay(tmp_path / "job", source, "[verification]\nmax_position_error_mm = 0.001\n")
    lines, errors = carry_out(folder)
    last = lines[-1]
    assert (last["state"], last["error"]["code"], errors) == ("failed", "verification-failed", "")
    assert last["error"]["failures"][0]["what"] == "position_error_mm"
    assert last["summary"]["passed"] is False and last["summary"]["failures"] > 0
    out = made(folder)
    assert "program.nc" not in out
    assert {"report.json", "report.html", "poses.f32", "blocks.json", "setup.toml"} <= set(out)
    assert json.loads(out["report.json"])["failures"][0]["what"] == "position_error_mm"
    # Its lines can be read, as JSON that says what they are; the drawn motion has their numbers.
    withheld, blocks = json.loads(out["withheld.json"]), json.loads(out["blocks.json"])
    assert withheld["withheld"] == WATERMARK and any("X" in line for line in withheld["lines"])
    assert 0 < max(blocks["lines"]) <= len(withheld["lines"])
    assert not any(data.startswith(b"%") for data in out.values())


def test_the_lines_of_a_failed_plan_are_those_of_its_program(tmp_path: Path) -> None:
    """A limit between the plan's and nothing changes the verdict alone."""
    source = COURSES.with_name("cylinder_panel_15.txt").read_bytes()
    passed, failed = (tmp_path / name for name in ("passed", "failed"))
    carry_out(lay(passed, source))
    carry_out(lay(failed, source, "[verification]\nmax_position_error_mm = 0.001\n"))
    lines = json.loads(made(failed)["withheld.json"])["lines"]
    text = made(passed)["program.nc"].decode().splitlines()
    assert len(lines) == len(text)
    assert [line for line in lines if "sha256" not in line] == [line for line in text if "sha256" not in line]
    assert json.loads(made(failed)["blocks.json"]) == json.loads(made(passed)["blocks.json"])
    assert "withheld.json" not in made(passed)


def test_a_refused_file_is_its_own_sentences(tmp_path: Path) -> None:
    folder = lay(tmp_path / "job", source=b"1\nstart\nninety\n")
    lines, errors = carry_out(folder)
    error = lines[-1]["error"]
    assert (lines[-1]["state"], lines[-1]["summary"], errors) == ("failed", None, "")
    assert error["code"] == "course-file-refused"
    assert error["detail"].startswith("铺层.txt:3: ") and error["faults"][0]["line"] == 3
    assert not (folder / "out").exists()


def test_a_setup_names_files_that_came_with_it(tmp_path: Path) -> None:
    folder = lay(tmp_path / "job", setup='[machine]\nurdf = "mine.urdf"\n[output]\ncontroller = "mine.toml"\n')
    (folder / "parts").mkdir()
    (folder / "parts" / "mine.urdf").write_text("<robot>")
    table = ROOT / "post" / "controllers" / "jb3208.toml"
    (folder / "parts" / "mine.toml").write_bytes(table.read_bytes())
    error = carry_out(folder)[0][-1]["error"]
    assert error["code"] == "model-refused"
    assert error["detail"].startswith("mine.urdf") and str(tmp_path) not in error["detail"]


@pytest.mark.parametrize(
    ("change", "detail"),
    [
        (
            ('upper="2.5"', 'upper="2,5"'),
            ":{line}: joint 'x': <limit> upper is '2,5', expected a number",
        ),
        (
            ('type="revolute"', 'type="continuous"'),
            ": axis c turns without end, and hoses, cables and tape do not",
        ),
    ],
)
def test_a_urdf_loses_no_detail_over_http(tmp_path: Path, change: tuple[str, str], detail: str) -> None:
    folder = lay(tmp_path / "job", setup='[machine]\nurdf = "mine.urdf"\n')
    (folder / "parts").mkdir()
    before, _, after = TAPELAYER.read_text("utf-8").partition(change[0])
    (folder / "parts" / "mine.urdf").write_text(before + change[1] + after, "utf-8")
    lines, errors = carry_out(folder)
    error = lines[-1]["error"]
    assert (error["code"], errors) == ("model-refused", "")
    assert error["detail"].startswith(f"mine.urdf{detail.format(line=1 + before.count(chr(10)))}")


def test_what_cannot_be_saved_names_no_folder_of_the_server(tmp_path: Path) -> None:
    folder = lay(tmp_path / "job")
    (folder / "out").mkdir()
    (folder / "out" / "program.nc").mkdir()
    error = carry_out(folder)[0][-1]["error"]
    assert error["code"] == "target-not-writable"
    assert error["detail"].startswith("program.nc: cannot be written: is a directory; ")


def test_too_much_memory_is_a_reason_of_its_own(tmp_path: Path) -> None:
    point = b"75.0000 0.0000 25.0000 0.000000 0.000000 1.000000 0.0000\n"
    folder = lay(tmp_path / "job", source=b"1\nstart\n90\n" + 800_000 * point + b"end\n")
    worker = start()
    size = int(Path(f"/proc/{worker.pid}/statm").read_text().split()[0]) * resource.getpagesize()
    lines, errors = carry_out(folder, size + 100 * 2**20, worker)
    assert (lines[-1]["error"]["code"], errors) == ("out-of-memory", "")


def test_a_mistake_of_ours_is_a_reference_and_its_traceback_stays_here(tmp_path: Path) -> None:
    folder = ask(tmp_path / "job", {"kind": "dance", "name": "a.txt"}, b"")
    lines, errors = carry_out(folder)
    error = lines[-1]["error"]
    assert error["code"] == "internal"
    assert error["detail"].endswith(f"its log tells more under the reference {error['reference']}")
    assert "Traceback" not in json.dumps(lines)
    assert errors.startswith(f"reference {error['reference']}, job:\nTraceback") and "'dance'" in errors


def test_what_prints_by_mistake_stays_out_of_the_lines(tmp_path: Path) -> None:
    printing = (
        "import os\n"
        "from tapelayer.workbench import worker\n"
        "def answer(folder, say):\n"
        "    print('a print')\n"
        "    os.system('echo a child')\n"
        "    return {'state': 'done'}\n"
        "worker.answer = answer\n"
        "worker.main()\n"
    )
    worker = start("-u", "-c", printing)
    lines, errors = carry_out(tmp_path, worker=worker)
    assert lines == [{"state": "done"}]
    assert errors == "a print\na child\n"


def test_it_ends_with_the_server(tmp_path: Path) -> None:
    """Before its order, and in the midst of a job."""
    worker = start()
    assert worker.stdin and worker.stdout and worker.stderr
    with worker:
        worker.stdin.close()
        assert worker.stdout.read() == b""
    assert worker.returncode == 0
    folder = lay(tmp_path / "job")
    (folder / "source").unlink()
    os.mkfifo(folder / "source")
    worker = start()
    assert worker.stdin and worker.stdout and worker.stderr
    with worker:
        worker.stdin.write(json.dumps({"folder": str(folder), "memory_bytes": PLENTY}).encode() + b"\n")
        worker.stdin.flush()
        assert json.loads(worker.stdout.readline())["stage"] == "reading"
        worker.stdin.close()
        assert worker.stdout.read() == b""
    assert worker.returncode == 1


def test_ticks_move_within_their_stage() -> None:
    said: list[float] = []
    stages = Stages(
        lambda message: said.append(message["progress"]),
        {Stage("one", Words("", "")): 1, Stage("two", Words("", "")): 3},
    )
    stages.begin("two", 2)
    stages._said_at = -1.0
    for _ in range(3):
        stages.tick()
        stages._said_at = -1.0
    assert said == [0.25, 0.625, 1.0, 1.0]
