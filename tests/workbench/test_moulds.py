"""Moulds, boundaries and regions are told before there is a job, and nothing of them is kept."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from tests.helpers.panels import flat, sheet, stl_bytes
from tests.helpers.served import Client, Workbench

X, Y = np.arange(0, 601, 50.0), np.arange(0, 401, 50.0)
DOME = stl_bytes(sheet(X, Y, lambda x, y: 20 - ((x - 300) ** 2 + (y - 200) ** 2) / 6500))
HOLED = stl_bytes(sheet(X, Y, flat, (200, 300, 100, 200)))
PLY = "[ply]\nangle_deg = 90\ninset_mm = 50\n"


@pytest.fixture(scope="module")
def workbench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:
    with Workbench(tmp_path_factory.mktemp("work"), "--workers", 1) as workbench:
        yield workbench


@pytest.fixture(scope="module")
def client(workbench: Workbench) -> Iterator[Client]:
    with workbench.client() as client:
        yield client


def asked(client: Client, what: str, data: bytes, name: str = "a.stl", **fields: Any) -> httpx.Response:
    parts = [("parts", (part, content)) for part, content in fields.pop("parts", {}).items()]
    return client.post(f"/api/v1/{what}", files=[("file", (name, data)), *parts], data=fields)


def told(client: Client, what: str, data: bytes, name: str = "a.stl", **fields: Any) -> dict[str, Any]:
    answer = asked(client, what, data, name, **fields)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def refused(answer: httpx.Response, code: str) -> dict[str, Any]:
    assert (answer.status_code, answer.json()["code"]) == (422, code), answer.text
    problem: dict[str, Any] = answer.json()
    return problem


def test_a_mould_is_told_with_its_size_and_edges(client: Client, workbench: Workbench) -> None:
    mould = told(client, "mould", HOLED, "铺层.stl")
    assert (mould["name"], mould["sha256"]) == ("铺层.stl", hashlib.sha256(HOLED).hexdigest())
    assert (mould["size_mm"], mould["lower_mm"], mould["upper_mm"]) == ([600, 400, 0], [0, 0, 0], [600, 400, 0])
    assert (mould["unit"], mould["unit_guess"], mould["facets"]) == ("mm", "mm", 2 * (96 - 4))
    assert mould["area_m2"] == pytest.approx(0.23)
    assert [edge["length_mm"] for edge in mould["edges"]] == [2000, 400]
    assert len(mould["edges"][0]["points_mm"]) == 40
    corners = np.array(mould["vertices_mm"])[np.array(mould["triangles"])]
    spans = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(spans, axis=1).sum() / 2e6 == pytest.approx(0.23)
    assert [list((workbench.work / room).iterdir()) for room in ("jobs", "staging")] == [[], []]


def test_a_unit_is_guessed_where_the_mould_would_be_of_no_likely_size(client: Client) -> None:
    metres = stl_bytes(sheet(X / 1e3, Y / 1e3, flat))
    assert told(client, "mould", metres)["unit_guess"] == "m"
    mould = told(client, "mould", metres, unit="m")
    assert (mould["unit_guess"], mould["size_mm"]) == ("m", [600, 400, 0])


def test_a_large_mould_is_thinned_to_be_drawn(client: Client) -> None:
    fine = stl_bytes(sheet(np.arange(0, 601, 10.0), np.arange(0, 601, 10.0), lambda x, y: 20 * np.sin(x / 90)))
    mould = told(client, "mould", fine)
    assert mould["facets"] == 7200 and 3000 < len(mould["triangles"]) <= 4000


def test_what_is_no_mould_is_refused(client: Client) -> None:
    assert refused(asked(client, "mould", b"solid a\nendsolid a\n"), "mesh-refused")["faults"]
    refused(asked(client, "mould", HOLED, unit="ft"), "invalid-request")
    refused(client.post("/api/v1/mould", files=[("unit", (None, "mm"))]), "invalid-request")


def test_a_boundary_s_file_becomes_points(client: Client) -> None:
    text = b"# corners\n0 0 0\n1, 0, 0\n1 1 0\n0 1 0\n0 0 0\n\n0.4 0.4 0\n0.6 0.4 0\n0.5 0.6 0\n"
    boundary = told(client, "boundary", text, "ring.txt", unit="m")
    assert boundary == {
        "name": "ring.txt",
        "points_mm": [[0, 0, 0], [1000, 0, 0], [1000, 1000, 0], [0, 1000, 0]],
        "holes_mm": [[[400, 400, 0], [600, 400, 0], [500, 600, 0]]],
    }
    problem = refused(asked(client, "boundary", b"0 0 0\n1 a 0\n2 2\n", "ring.txt"), "ply-refused")
    assert [fault["line"] for fault in problem["faults"]] == [2, 3]
    assert problem["detail"].startswith("ring.txt:2: ")


def test_a_region_is_the_ply_over_its_mould(client: Client) -> None:
    region = told(client, "region", DOME, setup=PLY)
    (ring,) = (np.array(ring) for ring in region["rings_mm"])
    assert (ring.min(axis=0)[:2], ring.max(axis=0)[:2]) == (
        pytest.approx([50, 50], abs=0.1),
        pytest.approx([550, 350], abs=0.1),
    )
    height = 20 - ((ring[:, 0] - 300) ** 2 + (ring[:, 1] - 200) ** 2) / 6500
    assert np.max(np.abs(ring[:, 2] - height)) < 0.3
    assert region["area_m2"] == pytest.approx(0.15)
    assert region["seed_mm"] == pytest.approx([300, 200, 20], abs=0.1)
    assert region["normal"] == pytest.approx([0, 0, 1], abs=1e-6)
    assert region["rosette"] == pytest.approx([0, 1, 0], abs=1e-6)
    assert region["direction"] == pytest.approx([-1, 0, 0], abs=1e-6)


def test_the_boundary_of_a_region_may_be_a_file(client: Client) -> None:
    ring = {"ring.txt": b"100 100 0\n500 100 0\n500 300 0\n100 300 0\n"}
    text = '[ply]\nangle_deg = 0\nboundary = "ring.txt"\n'
    region = told(client, "region", stl_bytes(sheet(X, Y, flat)), setup=text, parts=ring)
    assert region["area_m2"] == pytest.approx(0.08)
    refused(asked(client, "region", HOLED, setup=text), "name-not-allowed")


def test_the_faults_of_a_region_name_their_field(client: Client) -> None:
    text = f"{PLY}seed = [0, 0, 500]\nrosette = [0, 0, 1]\n"
    problem = refused(asked(client, "region", DOME, setup=text), "ply-refused")
    assert ("ply", "seed") in {(fault.get("section"), fault.get("key")) for fault in problem["faults"]}
    text = "[ply]\nangle_deg = 'a'\n"
    problem = refused(asked(client, "region", DOME, setup=text), "ply-refused")
    assert [(fault["section"], fault["key"]) for fault in problem["faults"]] == [("ply", "angle_deg")]
