"""The API as a program meets it: jobs over HTTP are the command line's, and no accident mixes them up or loses them."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tapelayer.cli import main
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import parse_setup
from tapelayer.workbench import answers, results
from tests.helpers.forms import FORM, Part, body_of
from tests.helpers.kinds import MOMENT
from tests.helpers.panels import sheet, write_stl
from tests.helpers.paths import ROOT
from tests.helpers.served import Client, Workbench
from urdf import TAPELAYER

EXAMPLES = ROOT / "examples"
FLAT = (EXAMPLES / "flat_panel_00.txt").read_bytes()
MEGABYTE = 10**6
# Results of plans alone.
PLANNED = {"courses", "lines", "gaps", "boundary"}
BOSS = (EXAMPLES / "boss_panel_20.txt").read_bytes()
SHEET = (EXAMPLES / "curved_panel.stl").read_bytes()
TILTED = "[process]\nkinematics = 'published'\n[verification]\nmax_roller_tilt_deg = 1\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def workbench(folder: Path) -> Iterator[Workbench]:
    with Workbench(folder, "--max-upload-mb", 1, "--workers", 1) as workbench:
        yield workbench


@pytest.fixture(scope="module")
def client(workbench: Workbench) -> Iterator[Client]:
    with workbench.client() as client:
        yield client


@pytest.fixture(scope="module")
def wave(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    triangles = sheet(np.linspace(0, 300, 16), [0, 60, 120], lambda x, y: 10 * np.sin(x / 60) + 0.1 * y)
    return write_stl(tmp_path_factory.mktemp("wave") / "wave.stl", triangles).read_bytes()


@pytest.fixture(scope="module")
def laid(client: Client) -> dict[str, Any]:
    return client.made("panel.txt", FLAT)


@pytest.fixture(scope="module")
def sprayed(client: Client, wave: bytes) -> dict[str, Any]:
    setup = "[footprint]\nrate_mm3_per_s = 100\n"
    return client.made("wave.stl", wave, "spray", setup=setup)


@pytest.fixture(scope="module")
def judged_bad(client: Client) -> dict[str, Any]:
    return client.made("panel.txt", (EXAMPLES / "cylinder_panel_15.txt").read_bytes(), setup=TILTED)


def command(folder: Path, *arguments: str) -> None:
    """Run the command line in a folder, in this process."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as left:
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["tapelayer", *arguments, "--quiet"])
        main()
    assert not left.value.code


def assert_problem(answer: httpx.Response, code: str, status: int) -> dict[str, Any]:
    """The problem that an answer tells, and no more than that."""
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json"), answer.text
    problem: dict[str, Any] = answer.json()
    assert (problem["code"], problem["status"], problem["type"]) == (code, status, f"/problems/{code}")
    assert problem["detail"] and "Traceback" not in answer.text and str(ROOT) not in answer.text
    return problem


def table(client: Client, job: str, name: str) -> tuple[list[str], np.ndarray]:
    """Columns and rows of a table."""
    answer = client.result(job, name)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/octet-stream")
    columns = answer.headers["x-columns"].split(",")
    rows = np.frombuffer(answer.content, "<f4").reshape(-1, len(columns))
    assert int(answer.headers["x-rows"]) == len(rows) > 0
    return columns, rows


LINUXCNC = (ROOT / "post" / "controllers" / "linuxcnc.toml").read_bytes()
SHIFTED = "# 铺带\n[part]\nl1_mm = 310.1\n[tape]\nwidth_mm = 50\n"


@pytest.mark.parametrize(
    ("setup", "controller", "parts"),
    [
        ("", "", {}),
        (SHIFTED, "sinumerik840d", {}),
        (SHIFTED + '[machine]\nurdf = "own.urdf"\n', "own.toml", {"own.urdf": "urdf", "own.toml": "controller"}),
    ],
    ids=["defaults", "setup", "own files"],
)
def test_a_program_is_the_command_lines(
    tmp_path: Path, client: Client, setup: str, controller: str, parts: dict[str, str]
) -> None:
    contents = {name: {"urdf": TAPELAYER.read_bytes(), "controller": LINUXCNC}[what] for name, what in parts.items()}
    for name, data in {**contents, "铺层.txt": FLAT, "setup.toml": setup.encode()}.items():
        (tmp_path / name).write_bytes(data)
    chosen = [*(["--controller", controller] if controller else []), *(["--setup", "setup.toml"] if setup else [])]
    files = ["-o", "铺层.nc", "--report", "a.json", "--html", "a.html"]
    command(tmp_path, "export", "铺层.txt", *chosen, *files)
    texts = {"setup": setup} | ({"controller": controller} if controller else {})
    job = client.made("铺层.txt", FLAT, parts=contents, **texts)
    assert (job["state"], job["name"], job["progress"]) == ("done", "铺层.txt", 1)
    program = client.result(job["id"], "program")
    assert program.content == (tmp_path / "铺层.nc").read_bytes()
    assert program.headers["content-disposition"] == "attachment; filename*=utf-8''%E9%93%BA%E5%B1%82.nc"
    assert job["summary"]["program_sha256"] == hashlib.sha256(program.content).hexdigest()
    assert client.result(job["id"], "report.json").content == (tmp_path / "a.json").read_bytes()
    assert client.result(job["id"], "report.html").content == (tmp_path / "a.html").read_bytes()
    command(tmp_path, "export", "铺层.txt", *chosen, *files, "--language", "zh")
    assert client.result(job["id"], "report.html?language=zh").content == (tmp_path / "a.html").read_bytes()
    assert client.result(job["id"], "source").content == FLAT
    assert client.result(job["id"], "urdf").content == TAPELAYER.read_bytes()
    for name, data in contents.items():
        assert client.result(job["id"], f"parts/{name}").content == data
    effective = parse_setup(client.result(job["id"], "setup").content, "a.toml", Setup)
    asked = parse_setup(setup.encode(), "a.toml", Setup)
    whole = client.result(job["id"], "setup?whole=true").content
    assert parse_setup(whole, "a.toml", Setup) == effective and whole.count(b"\n") > 50
    assert effective == (asked.with_values("output", controller=controller) if controller else asked)


def test_a_spraying_program_is_the_command_lines(
    tmp_path: Path, client: Client, sprayed: dict[str, Any], wave: bytes
) -> None:
    (tmp_path / "wave.stl").write_bytes(wave)
    (tmp_path / "setup.toml").write_text("[footprint]\nrate_mm3_per_s = 100\n")
    command(tmp_path, "spray", "wave.stl", "--setup", "setup.toml", "--trajectory", "a.txt", "--report", "a.json")
    assert client.result(sprayed["id"], "program").content == (tmp_path / "wave.nc").read_bytes()
    assert client.result(sprayed["id"], "trajectory").content == (tmp_path / "a.txt").read_bytes()
    assert client.result(sprayed["id"], "report.json").content == (tmp_path / "a.json").read_bytes()


def test_what_the_page_draws_of_a_laying_job(client: Client, laid: dict[str, Any]) -> None:
    job = laid["id"]
    columns, poses = table(client, job, "poses")
    assert columns == ["time_s", *"x_mm y_mm z_mm c_deg a_deg u_mm v_mm d_deg q_mm e_deg".split()]
    assert np.all(np.diff(poses[:, 0]) >= 0) and poses[-1, 0] == pytest.approx(laid["summary"]["duration_s"])
    blocks = client.result(job, "blocks").json()
    assert blocks["rows"] == len(poses) == len(blocks["lines"]) == len(blocks["courses"]) == len(blocks["kinds"])
    assert len(table(client, job, "speeds")[1]) == len(poses)
    errors = table(client, job, "errors")
    worst = max(abs(errors[1][:, errors[0].index("position_error_mm")]))
    assert worst == pytest.approx(laid["summary"]["max_position_error_mm"], rel=1e-6)
    assert set(table(client, job, "tape")[1][:, 1]) == set(range(1, 8))
    for name in ("coat", "part", "trajectory"):
        assert_problem(client.result(job, name), "not-made", 404)


def test_what_the_page_draws_of_a_spraying_job(client: Client, sprayed: dict[str, Any]) -> None:
    job = sprayed["id"]
    columns, coat = table(client, job, "coat")
    answer = client.result(job, "coat")
    times = [float(time) for time in answer.headers["x-times"].split(",")]
    assert columns == ["x_mm", "y_mm", "z_mm", *(f"t{number}" for number in range(len(times)))]
    assert answer.headers["x-unit"] == "um" and times == sorted(times)
    assert np.all(np.diff(coat[:, 3:], axis=1) >= 0) and np.max(coat) > 0
    assert table(client, job, "part")[0] == ["x_mm", "y_mm", "z_mm"]
    assert_problem(client.result(job, "tape"), "not-made", 404)


def test_what_a_job_lists_is_what_it_has(
    client: Client, laid: dict[str, Any], sprayed: dict[str, Any], judged_bad: dict[str, Any]
) -> None:
    for job, missing in (
        (laid, {"withheld", "trajectory", "part", "coat"} | PLANNED),
        (sprayed, {"withheld", "tape"} | PLANNED),
        (judged_bad, {"program", "trajectory", "part", "coat"} | PLANNED),
    ):
        assert set(results.RESULTS) - set(job["results"]) == missing
        given = {name for name in results.RESULTS if client.result(job["id"], name).status_code == 200}
        assert given == set(job["results"])


def test_a_mould_is_shown(client: Client, wave: bytes) -> None:
    job = client.made("panel.txt", FLAT, mould=wave)
    assert len(table(client, job["id"], "part")[1]) == 3 * 60
    assert job["sent"]["mould"]
    assert client.result(job["id"], "mould").content == wave
    without = client.made("panel.txt", FLAT)
    assert without["sent"] == {"unit": "mm", "mould": "", "parts": []}
    assert_problem(client.result(without["id"], "mould"), "not-found", 404)


def test_events_tell_the_whole_way(client: Client) -> None:
    job = client.submit("panel.txt", FLAT).json()["id"]
    events = list(client.follow(job))
    names = [name for name, _ in events]
    assert names[0] == "state" and names[-1] == "done" and set(names) == {"state", "progress", "done"}
    keys = "id kind name source_sha256 title note state progress stage place created_at started_at finished_at "
    keys += "deleted_at run_s summary error results sent mine"
    assert set(keys.split()) == set(events[0][1])
    progress = [data["progress"] for _, data in events]
    assert progress == sorted(progress) and progress[-1] == 1
    states = [data["state"] for name, data in events if name != "progress"]
    assert states in (["queued", "running", "done"], ["running", "done"])
    assert events[-1][1] == client.get(f"/api/v1/jobs/{job}").json()
    assert list(client.follow(job)) == [("state", events[-1][1]), ("done", events[-1][1])]


def test_an_unreadable_file_fails_inside_the_job(client: Client) -> None:
    for data, sentence in ((b"start\n1 2 3\n", "bad.txt:1: "), (b"", "bad.txt: ")):
        job = client.made("../x/bad.txt", data)
        assert (job["state"], job["name"], job["summary"]) == ("failed", "bad.txt", None)
        assert (job["error"]["code"], job["error"]["status"]) == ("course-file-refused", 422)
        assert job["error"]["detail"].startswith(sentence)
        assert job["error"]["faults"][0]["sentence"] in job["error"]["detail"]
        for name in ("program", "report.json", "poses", "blocks"):
            assert sentence in assert_problem(client.result(job["id"], name), "job-failed", 409)["detail"]
        assert client.result(job["id"], "source").content == data


def test_a_wrong_kind_of_file_fails_inside_the_job(client: Client, wave: bytes) -> None:
    assert client.made("wave.stl", wave)["error"]["code"] == "course-file-refused"
    assert client.made("panel.txt", FLAT, "spray")["error"]["code"] == "mesh-refused"
    beyond = client.made("wing.txt", (EXAMPLES / "wing_skin_45.txt").read_bytes())
    assert beyond["error"]["code"] == "axis-beyond-travel"
    assert beyond["error"]["detail"].startswith("course 15 point 92: axis c would be at 45.101 deg, beyond its bound")


def test_a_program_judged_bad_is_withheld(client: Client, judged_bad: dict[str, Any]) -> None:
    job = judged_bad["id"]
    assert (judged_bad["state"], judged_bad["error"]["code"]) == ("failed", "verification-failed")
    assert judged_bad["summary"]["passed"] is False and judged_bad["summary"]["failures"] > 0
    problem = assert_problem(client.result(job, "program"), "program-withheld", 409)
    withheld = client.result(job, "withheld")
    assert withheld.headers["content-type"] == "application/json"
    assert withheld.json()["withheld"].startswith("FAILED") and withheld.json()["lines"]
    assert problem["failures"] == judged_bad["error"]["failures"]
    report = client.result(job, "report.json").json()
    assert report["passed"] is False and report["failures"][0] == problem["failures"][0]
    assert len(table(client, job, "poses")[1]) == client.result(job, "blocks").json()["rows"]


@pytest.mark.parametrize(
    ("query", "liked", "language"),
    [
        ("", "", "en"),
        ("", "zh-CN,zh;q=0.9,en;q=0.8", "zh"),
        ("", "de, en;q=0.1, zh;q=0", "en"),
        ("?language=zh", "en", "zh"),
        ("?language=en", "zh", "en"),
    ],
)
def test_a_report_page_is_in_the_askers_language(
    client: Client, laid: dict[str, Any], query: str, liked: str, language: str
) -> None:
    page = client.get(f"/api/v1/jobs/{laid['id']}/report.html{query}", headers={"Accept-Language": liked})
    assert (page.headers["content-language"], page.headers["vary"]) == (language, "Accept-Language")
    assert ("校验报告" in page.text) == (language == "zh")


def test_a_language_that_there_is_not_is_refused(client: Client, laid: dict[str, Any]) -> None:
    assert client.result(laid["id"], "report.html?language=fr").status_code == 422


def test_a_report_page_can_do_nothing(client: Client, laid: dict[str, Any]) -> None:
    page = client.result(laid["id"], "report.html")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"].startswith("sandbox; default-src 'none'")


def test_two_cookies_do_not_see_each_others_jobs(workbench: Workbench) -> None:
    with workbench.client() as ann, workbench.client() as bob:
        ids = []
        for person, file in ((ann, "ann.txt"), (bob, "bob.txt")):
            person.get("/api/v1/session")
            answer = person.submit(file, FLAT)
            assert answer.status_code == 202 and "owner_key" not in answer.json() and answer.json()["mine"] is True
            assert answer.headers["location"] == f"/api/v1/jobs/{answer.json()['id']}"
            ids.append(answer.json()["id"])
        for person, file in ((ann, "ann.txt"), (bob, "bob.txt")):
            assert [job["name"] for job in person.get("/api/v1/jobs").json()["jobs"]] == [file]
        anns = f"/api/v1/jobs/{ids[0]}"
        ann.ended(ids[0])
        assert bob.get(anns).json()["mine"] is False
        assert bob.get(f"{anns}/program").content == ann.get(f"{anns}/program").content
        assert_problem(bob.delete(anns), "not-owner", 403)
        assert_problem(bob.post(f"{anns}/cancel"), "not-owner", 403)
        assert ann.delete(anns).status_code == 204
        assert_problem(ann.get(anns), "not-found", 404)
        assert ann.get("/api/v1/jobs").json() == {"jobs": []}


def test_a_client_without_cookies_keeps_its_key(workbench: Workbench) -> None:
    with workbench.client() as client, workbench.client() as other:
        key = client.submit("a.txt", FLAT).json()["owner_key"]
        assert "owner_key" not in client.submit("b.txt", FLAT).json()
        other.headers["X-Owner-Key"] = key
        jobs = other.get("/api/v1/jobs").json()["jobs"]
        assert [job["name"] for job in jobs] == ["b.txt", "a.txt"]
        for job in jobs:
            assert other.delete(f"/api/v1/jobs/{job['id']}").status_code == 204


def without_hash(report: dict[str, Any]) -> dict[str, Any]:
    """The report without the hash of its file's text, which an answer over HTTP is not."""
    return {key: value for key, value in report.items() if key != "text_sha256"}


def test_a_program_is_judged(client: Client, laid: dict[str, Any]) -> None:
    program = client.result(laid["id"], "program").text
    report = client.result(laid["id"], "report.json").json()

    def judged(text: str, source: bytes = FLAT, **fields: str) -> httpx.Response:
        files = {"program": ("panel.nc", text.encode()), "file": ("panel.txt", source)}
        return client.post("/api/v1/verify", files=files, data={"kind": "lay", **fields})

    assert judged(program).json() == without_hash(report) | {"remarks": []}
    lines = program.splitlines()
    down = next(number for number, line in enumerate(lines) if " M20" in line)
    at = next(number for number in range(down, len(lines)) if " Y" in lines[number])
    word = next(word for word in lines[at].split() if word.startswith("Y"))
    lines[at] = lines[at].replace(word, f"Y{float(word[1:]) + 1:.3f}")
    edited = judged("\n".join(lines) + "\n").json()
    assert edited["passed"] is False and edited["program_sha256"] != report["program_sha256"]
    assert edited["failures"][0]["line"] == at + 1
    other = "[part]\nl1_mm = 310\n"
    problem = assert_problem(judged(program, setup=other), "program-of-other-setup", 409)
    assert problem["detail"].startswith("panel.nc: its header names the setup ")
    forced = judged(program, setup=other, force="true").json()
    assert forced["passed"] is False and forced["max_position_error_mm"] == pytest.approx(10)
    copied = judged(program, b"# the same\n" + FLAT).json()
    assert copied["passed"] and copied["remarks"] == ["panel.nc: its header names another course file than panel.txt"]
    assert assert_problem(judged("G1 X1 W\n"), "program-refused", 422)["faults"][0]["line"] == 1
    assert_problem(judged(program, b"nothing"), "course-file-refused", 422)


def test_a_spraying_program_is_judged(client: Client, sprayed: dict[str, Any], wave: bytes) -> None:
    files = {"program": ("wave.nc", client.result(sprayed["id"], "program").content), "file": ("wave.stl", wave)}
    setup = client.result(sprayed["id"], "setup").text
    answer = client.post("/api/v1/verify", files=files, data={"kind": "spray", "setup": setup})
    assert answer.json() == without_hash(client.result(sprayed["id"], "report.json").json()) | {"remarks": []}


LAUGHS = b'<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
OWN_URDF = '[machine]\nurdf = "a.urdf"\n'


@pytest.mark.parametrize(
    ("fields", "code", "status"),
    [
        ({"kind": "cut"}, "invalid-request", 422),
        ({"speed": "fast"}, "invalid-request", 422),
        ({"setup": "[tape]\nwidth_mm = -1\nwidht = 2\n"}, "setup-refused", 422),
        ({"setup": "[tape]\nwidth_mm = " + "[\n" * 5000}, "setup-refused", 422),
        ({"setup": "a." * 50_000 + "b = 1"}, "setup-refused", 422),
        ({"setup": OWN_URDF.replace("a.", "../a.")}, "name-not-allowed", 422),
        ({"setup": OWN_URDF.replace("a.", "/etc/passwd")}, "name-not-allowed", 422),
        ({"controller": "../jb3208.toml"}, "name-not-allowed", 422),
        ({"parts": {"../../x": b""}}, "name-not-allowed", 422),
        ({"parts": {"a.urdf": LAUGHS}, "setup": OWN_URDF}, "xml-refused", 422),
        ({"parts": {"a.stl": b"x" * (2 * MEGABYTE)}}, "upload-too-large", 413),
    ],
)
def test_what_is_refused_at_once(client: Client, fields: dict[str, Any], code: str, status: int) -> None:
    before = client.get("/api/v1/jobs").json()
    assert_problem(client.submit("panel.txt", FLAT, **fields), code, status)
    assert client.get("/api/v1/jobs").json() == before


def test_what_is_no_form_is_refused(client: Client, workbench: Workbench) -> None:
    assert_problem(client.post("/api/v1/jobs", json={"kind": "lay"}), "unsupported-media-type", 415)
    assert_problem(client.post("/api/v1/verify", content=FLAT), "unsupported-media-type", 415)
    assert_problem(client.submit("a\x7fb.txt", FLAT), "name-not-allowed", 422)

    def endless() -> Iterator[bytes]:
        yield b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
        yield from [b"x" * 100_000] * 20

    form = {"Content-Type": "multipart/form-data; boundary=b"}
    assert_problem(client.post("/api/v1/jobs", content=endless(), headers=form), "upload-too-large", 413)


@pytest.mark.parametrize("path", ["", "/events", "/program", "/report.json", "/poses", "/setup", "/source", "/parts/a"])
@pytest.mark.parametrize("job", ["0" * 32, "..%2f..%2fetc", "x", "'; DROP TABLE jobs; --"])
def test_there_is_no_such_job(client: Client, job: str, path: str) -> None:
    assert_problem(client.get(f"/api/v1/jobs/{job}{path}"), "not-found", 404)


def test_no_part_is_a_path(client: Client, laid: dict[str, Any]) -> None:
    for name in ("setup.toml", "..%2fsetup.toml", "%2e%2e", "..%2f..%2f..%2findex.sqlite"):
        assert_problem(client.result(laid["id"], f"parts/{name}"), "not-found", 404)


def planted(place: Path, target: Path, how: str) -> None:
    """Put something that is no file of the job's own in a place."""
    place.unlink()
    if how == "link":
        place.symlink_to(target)
    elif how == "name":
        place.hardlink_to(target)
    elif how == "pipe":
        os.mkfifo(place)
    else:
        place.mkdir()


@pytest.mark.parametrize("how", ["link", "name", "pipe", "folder"])
def test_what_is_planted_in_a_job_is_not_served(client: Client, folder: Path, tmp_path: Path, how: str) -> None:
    secret = folder / "secret"
    secret.write_bytes(b"secret")
    job = client.made("panel.txt", FLAT, parts={"notes.txt": b"mine"}, mould=SHEET)
    addresses = {"setup": "setup.toml", "source": "source", "mould": "mould", "parts/notes.txt": "parts/notes.txt"}
    addresses |= {address: f"out/{file}" for address, file in results.RESULTS.items() if address in job["results"]}
    for address, file in addresses.items():
        assert client.result(job["id"], address).status_code == 200
        planted(folder / "jobs" / job["id"] / file, secret, how)
        answer = client.result(job["id"], address)
        assert (answer.status_code, b"secret" in answer.content) == (404, False), address
    assert_problem(client.result(job["id"], "limits"), "not-found", 404)
    assert client.get(f"/api/v1/jobs/{job['id']}").json()["results"] == []
    secret.unlink()


def test_a_folder_that_is_planted_in_a_job_is_not_entered(client: Client, folder: Path, tmp_path: Path) -> None:
    job, other = (client.made("panel.txt", FLAT, parts={"notes.txt": b"mine"}) for _ in range(2))
    for name in ("out", "parts"):
        (folder / "jobs" / job["id"] / name).rename(tmp_path / name)
        (folder / "jobs" / job["id"] / name).symlink_to(tmp_path / name)
    assert client.get(f"/api/v1/jobs/{job['id']}").json()["results"] == []
    assert_problem(client.result(job["id"], "parts/notes.txt"), "not-found", 404)
    assert_problem(client.result(job["id"], "program"), "not-made", 404)
    # The whole folder may be another's.
    (folder / "jobs" / other["id"]).rename(tmp_path / "other")
    (folder / "jobs" / other["id"]).symlink_to(tmp_path / "other")
    assert_problem(client.result(other["id"], "source"), "not-found", 404)


def test_nothing_is_left_of_what_was_refused(client: Client, folder: Path) -> None:
    client.submit("panel.txt", FLAT, kind="cut")
    assert list((folder / "staging").iterdir()) == []


def held(workbench: Workbench, client: Client, file: str) -> tuple[str, list[int]]:
    """A job that has begun on a workbench without other ones, with its process standing still."""
    until(workbench.workers)
    stopped = workbench.workers()
    for worker in stopped:
        os.kill(worker, signal.SIGSTOP)
    job: str = client.submit(file, FLAT).json()["id"]
    until(lambda: client.get(f"/api/v1/jobs/{job}").json()["state"] == "running")
    return job, stopped


def kill(workers: list[int]) -> None:
    for worker in workers:
        os.kill(worker, signal.SIGKILL)


def until(true: Callable[[], object]) -> None:
    """Wait until something is so."""
    for _ in range(600):
        if true():
            return
        signal.sigtimedwait([], 0.05)
    raise AssertionError(true)


def test_a_killed_worker_takes_one_job_with_it(workbench: Workbench) -> None:
    with workbench.client() as client:
        lost, workers = held(workbench, client, "lost.txt")
        waiting = client.submit("waiting.txt", FLAT).json()["id"]
        for name in ("program", "report.json", "poses"):
            assert_problem(client.result(lost, name), "job-not-finished", 409)
        assert_problem(client.result(waiting, "program"), "job-not-finished", 409)
        kill(workers)
        job = client.ended(lost)
        assert (job["state"], job["error"]["code"]) == ("failed", "worker-killed")
        assert "SIGKILL" in job["error"]["detail"]
        assert_problem(client.result(lost, "program"), "job-failed", 409)
        assert client.ended(waiting)["state"] == "done"


def test_jobs_are_cancelled_and_removed(workbench: Workbench, folder: Path) -> None:
    with workbench.client() as client:
        running, _ = held(workbench, client, "running.txt")
        waiting = [client.submit(f"{number}.txt", FLAT).json()["id"] for number in range(2)]
        # As of a worker that is killed while it saves.
        (folder / "jobs" / running / "out").mkdir()
        (folder / "jobs" / running / "out" / "program.nc").write_bytes(b"%\n")
        for job in (waiting[0], running):
            answer = client.post(f"/api/v1/jobs/{job}/cancel")
            assert (answer.status_code, answer.json()["state"]) == (202, "cancelled")
            assert (answer.json()["error"]["code"], answer.json()["results"]) == ("cancelled", [])
            assert client.ended(job) == client.post(f"/api/v1/jobs/{job}/cancel").json()
            assert_problem(client.result(job, "program"), "job-failed", 409)
        assert client.ended(waiting[1])["state"] == "done"
        running, _ = held(workbench, client, "again.txt")
        assert client.delete(f"/api/v1/jobs/{running}", params={"forever": True}).status_code == 204
        assert_problem(client.get(f"/api/v1/jobs/{running}"), "not-found", 404)
        assert not (folder / "jobs" / running).exists()


def test_a_deleted_job_is_brought_back(workbench: Workbench, folder: Path) -> None:
    with workbench.client() as client, workbench.client() as stranger:
        job = client.made("panel.txt", FLAT)
        address = f"/api/v1/jobs/{job['id']}"
        program = client.get(f"{address}/program").content
        assert_problem(stranger.post(f"{address}/restore"), "not-owner", 403)
        assert client.delete(address).status_code == 204
        for path in ("", "/program", "/events"):
            told = assert_problem(client.get(f"{address}{path}"), "not-found", 404)
            assert told["detail"].startswith(f"job {job['id']} was deleted at 20")
        assert client.get("/api/v1/jobs").json() == {"jobs": []}
        (deleted,) = client.get("/api/v1/jobs", params={"deleted": True}).json()["jobs"]
        assert deleted["deleted_at"] and deleted | {"deleted_at": None} == job
        assert_problem(stranger.post(f"{address}/restore"), "not-owner", 403)
        assert client.post(f"{address}/restore").json() == job == client.get(address).json()
        assert client.get(f"{address}/program").content == program
        # What runs is cancelled, and stays so.
        running, _ = held(workbench, client, "running.txt")
        assert client.delete(f"/api/v1/jobs/{running}").status_code == 204
        assert client.post(f"/api/v1/jobs/{running}/restore").json()["state"] == "cancelled"
        # For good, also where it was deleted before.
        assert client.delete(address).status_code == 204
        assert_problem(client.delete(address), "not-found", 404)
        assert client.delete(address, params={"forever": True}).status_code == 204
        assert_problem(client.post(f"{address}/restore"), "not-found", 404)
        assert_problem(client.delete(address, params={"forever": True}), "not-found", 404)
        assert not (folder / "jobs" / job["id"]).exists()


def test_a_job_has_a_title_and_a_note(workbench: Workbench) -> None:
    with workbench.client() as client, workbench.client() as stranger:
        job = client.made("panel.txt", FLAT)
        assert (job["title"], job["note"], job["source_sha256"]) == ("", "", hashlib.sha256(FLAT).hexdigest())
        assert job["run_s"] > 0 and job["created_at"] <= job["started_at"] < job["finished_at"]
        address = f"/api/v1/jobs/{job['id']}"
        assert client.patch(address, json={"title": "左翼"}).json() == job | {"title": "左翼"}
        described = job | {"title": "左翼", "note": "new roll"}
        assert client.patch(address, json={"note": "new roll"}).json() == described == client.get(address).json()
        assert client.get("/api/v1/jobs").json()["jobs"] == [described]
        assert_problem(stranger.patch(address, json={"note": ""}), "not-owner", 403)
        for wrong in ({"title": "a" * 201}, {"note": "a" * 2001}, {"note": 1}, {"name": "b.txt"}):
            assert_problem(client.patch(address, json=wrong), "invalid-request", 422)
        # Who follows a job that is under way is told.
        running, workers = held(workbench, client, "running.txt")
        client.patch(f"/api/v1/jobs/{running}", json={"note": "while it runs"})
        events = client.follow(running)
        assert next(events)[1]["note"] == "while it runs"
        for worker in workers:
            os.kill(worker, signal.SIGCONT)
        assert client.ended(running)["note"] == "while it runs"


def test_places_in_the_queue_are_told(workbench: Workbench) -> None:
    with workbench.client() as ann, workbench.client() as bob:
        running, _ = held(workbench, ann, "running.txt")
        first, second = (ann.submit(f"{number}.txt", FLAT).json() for number in (1, 2))
        third = bob.submit("3.txt", FLAT).json()
        assert (first["place"], second["place"], third["place"]) == (1, 2, 2)
        # The owners take turns.
        places = {job["name"]: job["place"] for job in ann.get("/api/v1/jobs").json()["jobs"]}
        assert places == {"running.txt": None, "1.txt": 1, "2.txt": 3}
        events = ann.follow(second["id"])
        seen = [next(events)[1]["place"]]
        ann.post(f"/api/v1/jobs/{running}/cancel")
        seen += [data["place"] for name, data in events if name == "state" and data["state"] == "queued"]
        assert seen[0] == 3 and seen == sorted(seen, reverse=True) and seen[-1] == 1
        assert ann.ended(second["id"])["place"] is None and bob.ended(third["id"])["state"] == "done"


def test_two_jobs_are_compared(workbench: Workbench, wave: bytes) -> None:
    with workbench.client() as client:
        one = client.made("panel.txt", FLAT, parts={"notes.txt": b"a"})
        wide = "[tape]\nwidth_mm = 50\n[process]\nlay_speed_mm_per_s = 100\n"
        two = client.made("other.txt", BOSS, setup=wide, controller="linuxcnc", parts={"notes.txt": b"b"})

        def compared(a: dict[str, Any], b: dict[str, Any]) -> httpx.Response:
            return client.get("/api/v1/jobs/compare", params={"a": a["id"], "b": b["id"]})

        told = compared(one, two).json()
        reports = [client.result(job["id"], "report.json").json() for job in (one, two)]
        (rows,) = [kind for kind in client.get("/api/v1/quantities").json()["kinds"] if kind["kind"] == "lay"]
        keys = [row["key"] for row in rows["quantities"]]
        assert {"duration_s", "waste_mm", "max_position_error_mm"} < set(keys)
        assert told["quantities"] == [{"key": key, "a": reports[0][key], "b": reports[1][key]} for key in keys]
        assert {(row["section"], row["key"], row["a"], row["b"]) for row in told["setup"]} == {
            ("tape", "width_mm", Setup().tape.width_mm, 50),
            ("process", "lay_speed_mm_per_s", Setup().process.lay_speed_mm_per_s, 100),
            ("output", "controller", "jb3208", "linuxcnc"),
        }
        hashes = [[hashlib.sha256(data).hexdigest() for data in pair] for pair in ((FLAT, BOSS), (b"a", b"b"))]
        names = ("source", "notes.txt")
        assert told["files"] == [{"file": name, "a": a, "b": b} for name, (a, b) in zip(names, hashes, strict=True)]
        same = compared(one, one).json()
        assert (same["setup"], same["files"]) == ([], [])
        assert all(row["a"] == row["b"] for row in same["quantities"])
        sprayed, failed = client.made("wave.stl", wave, kind="spray"), client.made("bad.txt", b"1\n")
        told = assert_problem(compared(one, sprayed), "invalid-request", 422)
        assert told["detail"] == "job a is of kind lay, job b of kind spray; compare jobs of one kind"
        assert assert_problem(compared(one, failed), "job-failed", 409)["detail"].startswith("job b has no report: ")
        told = assert_problem(compared({"id": "0" * 32}, one), "not-found", 404)
        assert told["detail"] == f"there is no job {'0' * 32}; it may have expired or been removed"
        running, _ = held(workbench, client, "running.txt")
        told = assert_problem(compared(one, {"id": running}), "job-not-finished", 409)
        assert told["detail"] == "job b is under way; compare it when it has ended"
        client.post(f"/api/v1/jobs/{running}/cancel")


def test_a_file_that_goes_while_it_is_sent_is_sent(tmp_path: Path) -> None:
    file = tmp_path / "source"
    file.write_bytes(FLAT)
    answer = answers.JobFile(file.open("rb"), "text/plain")
    file.unlink()
    file.write_bytes(b"another")
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "GET", "headers": [], "asgi": {"spec_version": "2.4"}}
    asyncio.run(answer(scope, unasked, send))
    assert dict(sent[0]["headers"])[b"content-length"] == str(len(FLAT)).encode()
    assert b"".join(message["body"] for message in sent[1:]) == FLAT


async def unasked(*message: object) -> Any:
    raise AssertionError(message)


def test_nobody_waits_for_a_verdict_that_nobody_wants(workbench: Workbench, folder: Path) -> None:
    body = body_of([Part("program", b"", "a.nc"), Part("file", b"", "a.txt"), Part("kind", b"lay")])
    head = f"POST /api/v1/verify HTTP/1.1\r\nHost: localhost\r\nContent-Type: {FORM}\r\nContent-Length: {len(body)}\r\n"
    with workbench.client() as client:
        running, _ = held(workbench, client, "running.txt")
        with socket.create_connection(("127.0.0.1", client.base_url.port or 0)) as connection:
            connection.sendall(f"{head}\r\n".encode() + body)
            until(lambda: list((folder / "staging").glob("*/request.json")))
        until(lambda: not list((folder / "staging").iterdir()))
        assert client.delete(f"/api/v1/jobs/{running}").status_code == 204


def test_a_killed_server_loses_one_job(tmp_path: Path) -> None:
    with Workbench(tmp_path, "--workers", 1) as workbench, workbench.client() as client:
        kept = client.made("kept.txt", FLAT)
        program = client.result(kept["id"], "program").content
        lost, workers = held(workbench, client, "lost.txt")
        waiting = client.submit("waiting.txt", FLAT).json()["id"]
        key = client.headers["X-Owner-Key"]
        assert workbench.end(signal.SIGKILL) == -signal.SIGKILL
        kill(workers)
    with Workbench(tmp_path, "--workers", 1) as workbench, workbench.client() as client:
        client.headers["X-Owner-Key"] = key
        job = client.get(f"/api/v1/jobs/{lost}").json()
        assert (job["state"], job["error"]["code"]) == ("failed", "server-stopped")
        assert client.get(f"/api/v1/jobs/{kept['id']}").json() == kept
        assert client.result(kept["id"], "program").content == program
        assert client.ended(waiting)["state"] == "done"
        assert [job["name"] for job in client.get("/api/v1/jobs").json()["jobs"]] == [
            "waiting.txt",
            "lost.txt",
            "kept.txt",
        ]


def test_streams_end_with_the_server(tmp_path: Path) -> None:
    with Workbench(tmp_path, "--workers", 1) as workbench, workbench.client() as client:
        running, _ = held(workbench, client, "running.txt")
        waiting = client.submit("waiting.txt", FLAT).json()["id"]
        with ThreadPoolExecutor() as pool:
            streams = [pool.submit(lambda job=job: list(client.follow(job))) for job in (running, waiting)]
            until(lambda: client.get("/healthz").status_code == 200)
            assert workbench.end(signal.SIGTERM) == 0
            ends = [stream.result(10)[-1] for stream in streams]
        assert ends[0][0] == "done" and ends[0][1]["error"]["code"] == "server-stopped"
        assert ends[1][0] == "state" and ends[1][1]["state"] == "queued"


@pytest.mark.slow
def test_fifty_jobs_of_eight_clients_are_not_mixed_up(tmp_path: Path) -> None:
    setups = [f"[part]\nl1_mm = {300 + number}\n" for number in range(50)]

    def made(work: tuple[Client, int]) -> tuple[str, bytes, dict[str, Any]]:
        client, number = work
        job = client.made(f"{number}.txt", FLAT, setup=setups[number])
        report = client.result(job["id"], "report.json").json()
        return job["name"], client.result(job["id"], "program").content, report

    with Workbench(tmp_path) as workbench:
        clients = [workbench.client() for _ in range(8)]
        for client in clients:
            client.get("/api/v1/session")
        with ThreadPoolExecutor(8) as pool:
            done = list(pool.map(made, [(clients[number % 8], number) for number in range(50)]))
        names = [{job["name"] for job in client.get("/api/v1/jobs").json()["jobs"]} for client in clients]
        for client in clients:
            client.close()
    for number, (name, program, report) in enumerate(done):
        setup = parse_setup(setups[number].encode(), "a.toml", Setup)
        expected = Job.of(FLAT, f"{number}.txt", setup).make(f"{number}.nc")
        assert (name, program) == (f"{number}.txt", expected.text)
        assert without_hash(report) == json.loads(
            json.dumps(expected.report(Occasion(f"{number}.nc", "setup.toml", MOMENT)))
        )
    assert names == [{f"{number}.txt" for number in range(50) if number % 8 == of} for of in range(8)]
