"""The API is what its OpenAPI document says, whatever is sent to it."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator

import pytest
import schemathesis
import uvicorn
from hypothesis import HealthCheck, given, settings
from schemathesis import Case, GenerationMode
from schemathesis.checks import load_all_checks
from schemathesis.schemas import BaseSchema
from schemathesis.specs.openapi.checks import positive_data_acceptance

from tapelayer.workbench import foreman
from tapelayer.workbench.foreman import Limits
from tapelayer.workbench.server import Settings, create_app
from tests.helpers.paths import ROOT
from tests.helpers.served import Client

# A worker that fails every job at once: what becomes of a job is tested elsewhere.
STAND_IN = """
import json, sys
sys.stdin.readline()
problem = {"type": "/problems/mesh-refused", "title": "", "status": 422, "detail": "a", "code": "mesh-refused"}
print(json.dumps({"state": "failed", "summary": None, "error": problem}), flush=True)
"""
FLAT = (ROOT / "examples" / "flat_panel_00.txt").read_bytes()

load_all_checks()


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BaseSchema]:
    """The document of a server with one job that is done, whose id stands for every other one that is made up."""
    work = tmp_path_factory.mktemp("work")
    config = uvicorn.Config(create_app(Settings(work, Limits(workers=1))), port=0, log_config=None, lifespan="on")
    server = uvicorn.Server(config)
    serving = threading.Thread(target=server.run)
    serving.start()
    while not server.started:
        serving.join(0.05)
    host, port = server.servers[0].sockets[0].getsockname()
    url = f"http://{host}:{port}"
    with Client(base_url=url, timeout=60) as client, pytest.MonkeyPatch.context() as patch:
        job = client.made("panel.txt", FLAT)
        assert job["state"] == "done"
        script = work / "stand_in.py"
        script.write_text(STAND_IN)
        patch.setattr(foreman, "COMMAND", (sys.executable, "-S", str(script)))
        schema = schemathesis.openapi.from_url(f"{url}/openapi.json")

        @schema.hook
        def map_path_parameters(context: object, path_parameters: dict[str, object] | None) -> object:
            if path_parameters and len(str(path_parameters.get("id", ""))) % 2:
                return path_parameters | {"id": job["id"]}
            return path_parameters

        yield schema
    server.should_exit = True
    serving.join()


def test_every_answer_is_documented(api: BaseSchema) -> None:
    asked = set()
    for found in api.get_all_operations():
        operation = found.ok()

        @given(case=operation.as_strategy() | operation.as_strategy(generation_mode=GenerationMode.NEGATIVE))
        @settings(max_examples=10, suppress_health_check=list(HealthCheck), database=None)
        def validated(case: Case) -> None:
            # A file of the right type may still be no course file, and a text no setup.
            case.call_and_validate(excluded_checks=[positive_data_acceptance])

        validated()
        asked.add(operation.label)
    assert {"POST /api/v1/jobs", "GET /api/v1/jobs/{id}/poses", "POST /api/v1/verify", "POST /api/v1/inverse"} <= asked


def test_every_file_is_of_the_type_that_is_documented(api: BaseSchema) -> None:
    """What made-up names do not find: each example, each machine, and what came along with a job."""
    base = str(api.location).removesuffix("/openapi.json")
    with Client(base_url=base, timeout=60) as client:
        examples = [example["name"] for example in client.get("/api/v1/examples").json()["examples"]]
        machines = [machine["name"] for machine in client.get("/api/v1/machines").json()["machines"]]
        sheet = (ROOT / "examples" / "curved_panel.stl").read_bytes()
        parts = {"notes.txt": b"mine"}
        laid = client.submit("panel.txt", FLAT, mould=sheet, parts=parts).json()["id"]
        client.ended(laid)
    given = {
        "/api/v1/examples/{name}": [{"name": name} for name in examples],
        "/api/v1/machines/{name}/urdf": [{"name": name} for name in machines],
        "/api/v1/jobs/{id}/parts/{name}": [{"id": laid, "name": name} for name in parts],
        **{f"/api/v1/jobs/{{id}}/{name}": [{"id": laid}] for name in ("source", "mould", "setup", "limits")},
        "/api/v1/jobs/{id}": [{"id": laid}],
    }
    types = {}
    for path, values in given.items():
        operation = api[path]["GET"]
        for parameters in values:
            answer = operation.Case(path_parameters=parameters).call_and_validate()
            assert answer.status_code == 200, (path, parameters)
            types[path, *parameters.values()] = answer.headers["content-type"][0].partition(";")[0]
    assert {types["/api/v1/examples/{name}", name] for name in examples} == {"text/plain", "model/stl"}
