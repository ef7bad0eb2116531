"""Plans over HTTP: a mould and a ply become a course file, and that a program, with no file in between."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tapelayer.courses.course_file import parse_courses
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.plies.job import PlyJob
from tapelayer.plies.ply import parse_ply
from tests.helpers.panels import flat, sheet, stl_bytes
from tests.helpers.served import Client, Workbench

PLATE = stl_bytes(sheet(np.arange(0, 306, 61.0), np.arange(0, 801, 100.0), flat))
PLY = """[ply]
angle_deg = 0
boundary = [[1, 100, 0], [302, 100, 0], [302, 700, 0], [1, 700, 0]]
"""
# The gap aimed at is wider than this one allows.
STRICT = f"{PLY}[limits]\nmax_gap_mm = 0.4\n"
TABLES = {"part", "lines", "tape", "gaps", "boundary"}


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:
    with Workbench(tmp_path_factory.mktemp("work"), "--workers", 1) as workbench:
        yield workbench


@pytest.fixture(scope="module")
def client(workbench: Workbench) -> Iterator[Client]:
    with workbench.client() as client:
        yield client


@pytest.fixture(scope="module")
def plan(client: Client) -> dict[str, Any]:
    job = client.made("plate.stl", PLATE, "plan", setup=PLY)
    assert job["state"] == "done", job["error"]
    return job


@pytest.fixture(scope="module")
def failed(client: Client) -> dict[str, Any]:
    return client.made("plate.stl", PLATE, "plan", setup=STRICT)


def table(client: Client, job: dict[str, Any], name: str) -> dict[str, np.ndarray]:
    answer = client.result(job["id"], name)
    assert answer.status_code == 200, answer.text
    columns = answer.headers["X-Columns"].split(",")
    rows = np.frombuffer(answer.content, "<f4").reshape(-1, len(columns))
    assert len(rows) == int(answer.headers["X-Rows"])
    return dict(zip(columns, rows.T, strict=True))


def refused(answer: Any, status: int, code: str) -> dict[str, Any]:
    assert (answer.status_code, answer.json()["code"]) == (status, code), answer.text
    problem: dict[str, Any] = answer.json()
    return problem


def test_a_plan_gives_its_courses_and_what_is_known_of_them(client: Client, plan: dict[str, Any]) -> None:
    answer = client.result(plan["id"], "courses")
    assert answer.headers["content-type"].startswith("text/plain")
    assert 'filename="plate.txt"' in answer.headers["content-disposition"]
    courses = parse_courses(answer.content, "plate.txt")
    assert [course.number for course in courses] == [1, 2, 3, 4, 5]
    ply = parse_ply(f'[mould]\nfile = "plate.stl"\n{PLY}'.encode(), "ply.toml")
    assert answer.content == PlyJob.of(PLATE, "plate.stl", ply).make("plate.txt").text
    summary = plan["summary"]
    assert summary["courses_sha256"] == hashlib.sha256(answer.content).hexdigest()
    assert (summary["courses"], summary["passed"], summary["failures"]) == (5, True, 0)
    assert not {"blocks", "duration_s", "program_sha256", "controller", "max_position_error_mm"} & summary.keys()
    assert set(plan["results"]) == TABLES | {"courses", "report.json", "report.html"}
    report = client.result(plan["id"], "report.json").json()
    assert report["passed"] and "axes" not in report
    assert client.result(plan["id"], "report.html").status_code == 200
    assert client.result(plan["id"], "limits").json()["limits"]["max_gap_mm"] == {"value": 2.0, "judged": True}


def test_the_tables_are_the_plan_over_its_mould(client: Client, plan: dict[str, Any]) -> None:
    lines, tape = table(client, plan, "lines"), table(client, plan, "tape")
    assert sorted(set(lines["course"])) == [1, 2, 3, 4, 5]
    assert np.allclose(lines["x_mm"][lines["course"] == 3], 151.5) and np.allclose(lines["nz"], 1)
    third = tape["course"] == 3
    assert np.allclose((tape["right_x_mm"] - tape["left_x_mm"])[third], 75, atol=1e-3)
    assert np.ptp(tape["arc_length_mm"][third]) == pytest.approx(600, abs=0.01)
    for name in ("strain_percent", "lift_mm", "angle_deg", "residual_mm"):
        assert np.nanmax(np.abs(tape[name])) < 1e-4, name
    gaps = table(client, plan, "gaps")
    assert np.allclose(gaps["gap_mm"], 0.5, atol=1e-3)
    assert set(zip(gaps["right"], gaps["left"], strict=True)) == {(1, 2), (2, 3), (3, 4), (4, 5)}
    boundary = table(client, plan, "boundary")
    assert set(boundary["ring"]) == {0} and np.ptp(boundary["x_mm"]) == pytest.approx(301)
    assert len(table(client, plan, "part")["x_mm"]) == 3 * 80


@pytest.mark.parametrize("what", ["program", "urdf", "poses", "speeds", "blocks", "withheld", "trajectory"])
def test_what_belongs_to_a_machine_is_not_made(client: Client, plan: dict[str, Any], what: str) -> None:
    refused(client.result(plan["id"], what), 404, "not-made")


def test_the_courses_of_a_plan_beyond_its_limits_are_withheld(client: Client, failed: dict[str, Any]) -> None:
    assert (failed["state"], failed["error"]["code"]) == ("failed", "verification-failed")
    assert {failure["what"] for failure in failed["error"]["failures"]} == {"gap_mm"}
    assert failed["summary"]["failures"] == len(failed["error"]["failures"]) > 0
    assert set(failed["results"]) == TABLES | {"report.json", "report.html"}
    problem = refused(client.result(failed["id"], "courses"), 409, "courses-withheld")
    assert problem["failures"] == failed["error"]["failures"]
    assert problem["translations"]["zh"].startswith("校验判定道次不合格")


def test_a_program_is_made_of_a_plan_without_a_file(client: Client, plan: dict[str, Any]) -> None:
    laid = client.made("", b"", "lay", from_job=plan["id"])
    assert laid["state"] == "done", laid["error"]
    assert (laid["name"], laid["sent"]["from_job"], laid["sent"]["mould"]) == ("plate.txt", plan["id"], "plate.stl")
    courses = client.result(plan["id"], "courses").content
    assert client.result(laid["id"], "source").content == courses
    assert laid["source_sha256"] == plan["summary"]["courses_sha256"]
    assert client.result(laid["id"], "program").content == Job.of(courses, "plate.txt", Setup()).make("plate.nc").text
    assert client.result(laid["id"], "mould").content == PLATE
    assert {"part", "program"} <= set(laid["results"])


def test_the_mould_of_a_plan_keeps_its_unit(client: Client) -> None:
    metres = stl_bytes(sheet(np.arange(0, 0.31, 0.1), np.arange(0, 0.81, 0.1), flat))
    text = '[mould]\nunit = "m"\n[ply]\nangle_deg = 0\ninset_mm = 40\n'
    plan = client.made("plate.stl", metres, "plan", setup=text)
    assert plan["sent"]["unit"] == "m"
    laid = client.made("", b"", "lay", from_job=plan["id"])
    assert np.ptp(table(client, laid, "part")["y_mm"]) == pytest.approx(800)


def test_what_a_source_cannot_be_taken_from(client: Client, plan: dict[str, Any], failed: dict[str, Any]) -> None:
    refused(client.submit("", b"", "lay", from_job="0" * 32), 404, "not-found")
    refused(client.submit("", b"", "lay", from_job=failed["id"]), 409, "courses-withheld")
    problem = refused(client.submit("", b"", "spray", from_job=plan["id"]), 422, "invalid-request")
    assert problem["detail"].startswith("from_job: what a job of kind plan makes is no source of kind spray")
    assert problem["translations"].keys() == {"zh"}
    problem = refused(client.submit("a.txt", b"", "lay", from_job=plan["id"]), 422, "invalid-request")
    assert problem["detail"].startswith("from_job: names the source, and so does file")
    refused(client.submit("", b"", "lay"), 422, "invalid-request")


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"unit": "mm"}, "unit: a unit stands in the setup: [mould] unit; leave it out"),
        ({"controller": "jb3208"}, "controller: a controller belongs to kind lay or spray; leave it out"),
        ({"mould": PLATE}, "mould: a mould belongs to kind lay; leave it out"),
    ],
)
def test_a_plan_has_no_machine(client: Client, fields: dict[str, Any], sentence: str) -> None:
    problem = refused(client.submit("plate.stl", PLATE, "plan", setup=PLY, **fields), 422, "invalid-request")
    assert problem["detail"] == sentence and problem["translations"]["zh"]


def test_faults_of_a_ply_name_their_field(client: Client) -> None:
    text = "[tape]\nwidth_mm = -1\n[ply]\nboundary = [[0, 0, 0]]\n"
    problem = refused(client.submit("plate.stl", PLATE, "plan", setup=text), 422, "ply-refused")
    assert {(fault["section"], fault["key"]) for fault in problem["faults"]} == {
        ("tape", "width_mm"),
        ("ply", "angle_deg"),
        ("ply", "boundary"),
    }
    text = '[ply]\nangle_deg = 0\nboundary = "/etc/passwd"\n'
    problem = refused(client.submit("plate.stl", PLATE, "plan", setup=text), 422, "name-not-allowed")
    assert problem["detail"].startswith("[ply] boundary: '/etc/passwd' is neither built in nor a file sent along")
    parts = {"ring.txt": b"0 0 0\n1 0 0\n1 1 0\n"}
    text = text.replace("/etc/passwd", "ring.txt")
    assert client.submit("plate.stl", PLATE, "plan", setup=text, parts=parts).status_code == 202


def test_plans_are_listed_and_compared(client: Client, plan: dict[str, Any], failed: dict[str, Any]) -> None:
    listed = client.get("/api/v1/jobs").json()["jobs"]
    assert {plan["id"], failed["id"]} <= {job["id"] for job in listed}
    told = client.get("/api/v1/jobs/compare", params={"a": plan["id"], "b": failed["id"]}).json()
    assert told["kind"] == "plan" and {"key": "courses", "a": 5, "b": 5} in told["quantities"]
    assert told["setup"] == [{"section": "limits", "key": "max_gap_mm", "a": None, "b": 0.4}]
    laid = client.made("", b"", "lay", from_job=plan["id"])
    refused(client.get("/api/v1/jobs/compare", params={"a": plan["id"], "b": laid["id"]}), 422, "invalid-request")


def test_the_catalogue_tells_what_a_kind_makes_and_takes(client: Client) -> None:
    told = {kind["kind"]: kind for kind in client.get("/api/v1/quantities").json()["kinds"]}
    assert (told["plan"]["machine"], told["plan"]["product"], told["plan"]["suppliers"]) == (None, "courses", [])
    assert (told["lay"]["product"], told["lay"]["suppliers"]) == ("program", ["plan"])
    assert (told["plan"]["fields"], told["lay"]["fields"]) == ([], ["controller", "mould"])
    schema = client.get("/api/v1/setup-schema", params={"kind": "plan"}).json()
    assert {"mould", "ply", "tape", "gap", "courses", "limits"} == schema["properties"].keys()
    values = {"mould": {"file": "plate.stl"}, "ply": {"angle_deg": 45}}
    text = client.post("/api/v1/setup/format", json={"kind": "plan", "values": values}).text
    parsed = client.post("/api/v1/setup/parse?kind=plan", content=text, headers={"Content-Type": "text/plain"})
    assert parsed.json() == {"values": values}
    problem = refused(client.post("/api/v1/setup/format", json={"kind": "plan", "values": {}}), 422, "ply-refused")
    assert problem["faults"]


def test_a_program_is_not_judged_against_a_mould(client: Client) -> None:
    answer = client.post("/api/v1/verify", data={"kind": "plan"}, files={"program": b"M02\n", "file": PLATE})
    problem = refused(answer, 422, "invalid-request")
    assert problem["detail"] == "kind: expected lay or spray, got 'plan'"


def test_the_document_knows_plans(client: Client) -> None:
    document = client.get("/openapi.json").json()
    assert "/api/v1/jobs/{id}/courses" in document["paths"]
    assert document["components"]["schemas"]["Job"]["properties"]["kind"]["enum"] == ["lay", "spray", "plan"]
