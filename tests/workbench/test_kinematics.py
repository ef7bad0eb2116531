"""Kinematics over HTTP: poses and axis values are each other's, by Pinocchio, in millimetres and degrees."""

from __future__ import annotations

import json
import math
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tapelayer.workbench import kinematics, solving
from tapelayer.workbench.problems import Problem
from tests.helpers.machines import LENGTHS, sprayer, tape_layer
from tests.helpers.routes import Asking
from tests.helpers.served import Workbench

CLIENT = Asking(kinematics.router)
MACHINES = {"tapelayer": tape_layer, "sprayer": sprayer}
FRAMES = {"tapelayer": "contact", "sprayer": "P"}
PLACE, NORMAL, TANGENT = ["x_mm", "y_mm", "z_mm"], ["nx", "ny", "nz"], ["tx", "ty", "tz"]
POSE = {"tapelayer": PLACE + NORMAL + TANGENT, "sprayer": PLACE + NORMAL}
JOINTS = {"tapelayer": [*PLACE, "c_deg", "a_deg"], "sprayer": [*PLACE, "theta_deg", "phi_deg"]}

SPECIAL = st.sampled_from([-180.0, -135.0, -90.0, -45.0, -30.0, 0.0, 30.0, 45.0, 90.0, 135.0, 180.0])
MM = st.floats(0, 2000)
# For the machine to be very busy.
PATIENCE = 60


def ask(way: str, machine: str, axes: list[str], values: list[list[float]]) -> dict[str, Any]:
    body = {"machine": machine, "frame": FRAMES[machine], "axes": axes, "values": values}
    response = CLIENT.post(f"/{way}", json=body)
    assert response.status_code == 200, response.text
    found: dict[str, Any] = response.json()
    assert (found["machine"], found["frame"]) == (machine, FRAMES[machine])
    return found


def solved(machine: str, poses: list[list[float]]) -> dict[str, Any]:
    found = ask("inverse", machine, POSE[machine], poses)
    assert found["axes"] == JOINTS[machine]
    assert [len(branch) for branch in found["branches"]] == [len(poses)] * 2
    assert [len(branch) for branch in found["within_travel"]] == [len(poses)] * 2
    return found


def placed(machine: str, joints: list[list[float]]) -> Floats:
    found = ask("forward", machine, JOINTS[machine], joints)
    assert found["axes"] == POSE[machine]
    return np.array(found["values"]).reshape(-1, len(POSE[machine]))


def by_pinocchio(machine: str, joints: list[list[float]], frame: str) -> Floats:
    """Poses (n, 4, 4) of a frame in mm."""
    model = MACHINES[machine]()
    q = np.zeros((len(joints), len(model.axes)))
    for column, (name, values) in enumerate(zip(JOINTS[machine], np.array(joints).T, strict=True)):
        axis, _, unit = name.partition("_")
        q[:, model.column(axis)] = values / 1e3 if unit == "mm" else np.radians(values)
        assert column < 5
    poses = model.forward_pinocchio(q, frame)
    poses[:, :3, 3] *= 1e3
    return poses


def test_the_roller_lies_on_the_surface_square_to_the_travel_in_both_branches() -> None:
    rng = np.random.default_rng(3)
    n = rng.normal(size=(200, 3)) + [0, 0, 3]
    t = np.cross(n, rng.normal(size=(200, 3)))
    poses = np.hstack([rng.uniform(0, 2000, (200, 3)), 7.0 * n, 0.1 * t])
    found = solved("tapelayer", poses.tolist())
    radius = LENGTHS.radius * 1e3
    normals = n / np.linalg.norm(n, axis=1)[:, None]
    across = np.cross(t, n) / np.linalg.norm(np.cross(t, n), axis=1)[:, None]
    for branch, sign in zip(found["branches"], (1, -1), strict=True):
        roller = by_pinocchio("tapelayer", branch, "roller")
        np.testing.assert_allclose(roller[:, :3, 3], poses[:, :3] + radius * normals, atol=1e-8)
        np.testing.assert_allclose(-roller[:, :3, 1], sign * across, atol=1e-11)
        # What comes back is the same roller line, although the head may lean along the course.
        back = placed("tapelayer", branch)
        np.testing.assert_allclose(back[:, :3] + radius * back[:, 3:6], poses[:, :3] + radius * normals, atol=1e-8)
        again = solved("tapelayer", back.tolist())["branches"][0]
        np.testing.assert_allclose(turned(again), turned(branch), atol=1e-8)


def turned(joints: list[list[float]]) -> Floats:
    """Axis values with sines and cosines of the angles, so that whole turns do not count."""
    values = np.array(joints)
    return np.hstack([values[:, :3], np.sin(np.radians(values[:, 3:])), np.cos(np.radians(values[:, 3:]))])


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(
            MM, MM, MM, SPECIAL | st.floats(-180, 180), st.sampled_from([-60.0, -45.0, 0.0, 45.0]) | st.floats(-89, 89)
        ),
        min_size=1,
        max_size=5,
    )
)
def test_tape_layer_there_and_back(joints: list[tuple[float, ...]]) -> None:
    rows = [list(row) for row in joints]
    poses = placed("tapelayer", rows)
    expected = by_pinocchio("tapelayer", rows, "contact")
    np.testing.assert_allclose(
        poses, np.hstack([expected[:, :3, 3], expected[:, :3, 2], expected[:, :3, 0]]), atol=1e-8
    )
    first, second = solved("tapelayer", poses.tolist())["branches"]
    np.testing.assert_allclose(turned(first), turned(rows), atol=1e-8)
    np.testing.assert_allclose(placed("tapelayer", first), poses, atol=1e-8)
    np.testing.assert_allclose(placed("tapelayer", second), poses * np.repeat([1, -1], [6, 3]), atol=1e-8)


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(MM, MM, MM, SPECIAL | st.floats(-180, 180), st.sampled_from([0.0, 45.0]) | st.floats(0, 89.9)),
        min_size=1,
        max_size=5,
    )
)
def test_sprayer_there_and_back(rows: list[tuple[float, ...]]) -> None:
    theta, phi = np.radians(np.array(rows)[:, 3:].T)
    normals = np.column_stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
    poses = np.hstack([np.array(rows)[:, :3], normals])
    found = solved("sprayer", (poses * [1, 1, 1, 40, 40, 40]).tolist())
    for branch in found["branches"]:
        np.testing.assert_allclose(placed("sprayer", branch), poses, atol=1e-8)
        gun = by_pinocchio("sprayer", branch, "gun")
        np.testing.assert_allclose(gun[:, :3, 2], normals, atol=1e-9)
    first = np.array(found["branches"][0])
    assert np.all((first[:, 3] >= 0.0) & (first[:, 3] <= 360.0) & (first[:, 4] >= 0.0))


def test_poses_that_cannot_be_taken_are_null_beside_others() -> None:
    flat, along = [800.0, -900.0, -1300.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    poses = [
        [*flat, *along],
        [*flat, 0.0, 0.0, 2.0],
        [0.0, 0, 0, 1, 0, 0, 0, 1, 0],
        [*flat, 1.0, 0.0, 0.0],
        [*flat, 0, 0, 0],
    ]
    found = solved("tapelayer", poses)
    for branch, inside in zip(found["branches"], found["within_travel"], strict=True):
        assert [row is None for row in branch] == [False, True, True, False, True]
        assert not inside[1] and not inside[2]
    # c turns by 30 deg each way from along y.
    assert found["within_travel"][0][0] and not found["within_travel"][0][3]
    assert not found["within_travel"][1][0]
    down = solved("sprayer", [[0, 0, 0, 0, 0, -1], [0, 0, 0, 1, 0, 0], [5, 6, 7, 0, 0, 1], [1, 2, 3, 0, 0, 0]])
    assert [row is None for row in down["branches"][0]] == [True, True, False, True]
    assert down["branches"][0][2] == [5, 6, 7, 0, 0]
    assert [inside[2] for inside in down["within_travel"]] == [True, True]


@pytest.mark.parametrize(
    ("axis", "value", "inside"),
    [("x_mm", 2500, True), ("x_mm", 2501, False), ("z_mm", -1e-6, False), ("x_mm", -1, False)],
)
def test_travel_is_the_machines(axis: str, value: float, inside: bool) -> None:
    pose = dict(zip(POSE["sprayer"], [100.0, 100.0, 0.0, 0.6, 0.0, 0.8], strict=True)) | {axis: value}
    found = solved("sprayer", [list(pose.values())])
    assert found["within_travel"] == [[inside], [False]]


def test_turns_are_those_that_are_within_travel() -> None:
    rng = np.random.default_rng(9)
    heading = np.radians(rng.uniform(-29, 29, 100) + np.where(rng.random(100) < 0.5, 180, 0))
    poses = np.column_stack(
        [np.full((100, 3), 500.0), np.tile([0, 0, 1], (100, 1)), np.sin(heading), np.cos(heading), 0 * heading]
    )
    found = solved("tapelayer", poses.tolist())
    c = np.array(found["branches"])[:, :, 3]
    assert np.max(np.min(np.abs(c), axis=0)) < 29.001
    assert np.all(np.abs(c) <= 180.0 + 1e-9)


def test_columns_may_come_in_any_order() -> None:
    pose = [800.0, 100.0, -1300.0, 0.1, 0.2, 1.0, 0.1, 1.0, 0.0]
    order = [5, 2, 8, 0, 1, 7, 3, 6, 4]
    names = [POSE["tapelayer"][i] for i in order]
    assert ask("inverse", "tapelayer", names, [[pose[i] for i in order]]) == solved("tapelayer", [pose])
    assert solved("tapelayer", [])["branches"] == [[], []]
    assert placed("sprayer", []).shape == (0, 6)


FINE: dict[str, Any] = {
    "machine": "sprayer",
    "frame": "P",
    "axes": POSE["sprayer"],
    "values": [[1, 2, 3, 0, 0, 1], [1, 2, 3, 0, 0, 1]],
}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"machine": "robot"}, "Input tag 'robot' found using 'machine' does not match any of the expected tags"),
        ({"frame": "contact"}, "frame: Input should be 'P'"),
        (
            {"axes": ["x_mn", *POSE["sprayer"][1:]]},
            "axes[0]: Input should be 'x_mm', 'y_mm', 'z_mm', 'nx', 'ny' or 'nz'",
        ),
        ({"axes": [*POSE["sprayer"], "nx"]}, "axes: List should have at most 6 items after validation, not 7"),
        ({"axes": [*PLACE, "nx", "ny", "ny"]}, "axes: name each column once"),
        ({"axes": [*PLACE, "nx", "nz"]}, "axes: List should have at least 6 items after validation, not 5"),
        (
            {"values": [[1, 2, 3, 0, 0, 1], [1, 2]]},
            "values[1]: List should have at least 6 items after validation, not 2",
        ),
        ({"values": [[1, 2, 3, 0, math.nan, 1]]}, "values[0][4]: Input should be a finite number"),
        ({"values": [[1, 2, 3, 0, 0, 1], [math.inf, 2, 3, 0, 0, 1]]}, "values[1][0]: Input should be a finite number"),
        ({"values": [[1, 2, 3, 0, "0", 1]]}, "values[0][4]: Input should be a valid number"),
        ({"values": [[1, 2, True, 0, 0, 1]]}, "values[0][2]: Input should be a valid number"),
        ({"values": [[1, 1e13, 3, 0, 0, 1]]}, "values[0][1]: Input should be less than or equal to 1000000000000"),
        ({"values": [[0.0] * 10]}, "values[0]: List should have at most 6 items"),
        ({"unit": "mm"}, "unit: Extra inputs are not permitted"),
    ],
)
def test_what_cannot_be_solved_is_named(changes: dict[str, Any], words: str) -> None:
    response = CLIENT.post("/inverse", content=json.dumps(FINE | changes), headers={"Content-Type": "application/json"})
    problem = response.json()
    assert (response.status_code, problem["code"]) == (422, "invalid-request")
    assert words in problem["detail"].splitlines()[0]


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"\xff", b'"\\ud800"', b"[" * 5000, b'{"a":' * 101, b'["",' * 101])
def test_what_is_no_json_is_refused(body: bytes) -> None:
    response = CLIENT.post("/forward", content=body, headers={"Content-Type": "application/json"})
    assert (response.status_code, response.json()["code"]) == (422, "invalid-request")


def test_any_direction_is_as_good_as_its_unit() -> None:
    rows = [[1.0, 2.0, 3.0, *(scale * v for v in (0.6, 0.0, 0.8))] for scale in (1e-300, 1.0, 1e12)]
    first, *others = solved("sprayer", rows)["branches"][0]
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-12)


def rows(count: int) -> bytes:
    """Body of so many rows."""
    return json.dumps(FINE | {"values": [[1.0, 2.0, 3.0, 0.0, 0.6, 0.8]] * count}).encode()


def test_many_rows_are_solved_at_once() -> None:
    found = json.loads(solving.solve("inverse", rows(solving.MOST_ROWS)))
    assert found["within_travel"][0] == [True] * solving.MOST_ROWS
    with pytest.raises(Problem, match="^values: List should have at most 100000 items"):
        solving.solve("inverse", rows(solving.MOST_ROWS + 1))


def test_many_rows_keep_nobody_waiting(tmp_path: Path) -> None:
    """While the workers stand still, the server answers others; when they go on, the rows are answered as ever."""
    many = rows(solving.MOST_ROWS)
    assert len(many) > kinematics.HEAVY_BYTES
    with Workbench(tmp_path, "--workers", 1) as workbench, ThreadPoolExecutor(2) as threads:

        def asked(body: bytes) -> httpx.Response:
            return httpx.post(f"{workbench.url}/api/v1/inverse", content=body, timeout=PATIENCE)

        for body in (many, rows(solving.MOST_ROWS + 1)):
            while not workbench.workers():
                time.sleep(0.05)
            # A worker begins with the order that it gets, so the one that waits for it is stopped beforehand.
            stopped = workbench.workers()
            for worker in stopped:
                os.kill(worker, signal.SIGSTOP)
            answer = threads.submit(asked, body)
            while not list((tmp_path / "staging").glob("*/request.json")):
                time.sleep(0.02)
            for _ in range(5):
                assert httpx.get(f"{workbench.url}/api/v1/jobs", timeout=PATIENCE).status_code == 200
                assert asked(rows(2)).status_code == 200
            assert not answer.done()
            for worker in stopped:
                os.kill(worker, signal.SIGCONT)
            told = answer.result()
            if body is many:
                assert (told.status_code, told.content) == (200, solving.solve("inverse", many))
            else:
                assert told.status_code == 422
                assert told.json()["detail"].startswith("values: List should have at most 100000 items")
        assert not list((tmp_path / "staging").iterdir())


def test_the_description_has_the_body() -> None:
    routes = CLIENT.app.openapi()["paths"]
    for way in ("inverse", "forward"):
        schemas = routes[f"/api/v1/{way}"]["post"]["requestBody"]["content"]["application/json"]["schema"]["oneOf"]
        for machine, schema in zip(MACHINES, schemas, strict=True):
            names = (POSE if way == "inverse" else JOINTS)[machine]
            values, axes = schema["properties"]["values"], schema["properties"]["axes"]
            assert (schema["properties"]["machine"]["const"], axes["items"]["enum"]) == (machine, names)
            assert values["maxItems"] == solving.MOST_ROWS
            assert values["items"]["minItems"] == values["items"]["maxItems"] == axes["minItems"] == len(names)
            assert schema["required"] == ["machine", "frame", "axes", "values"]
            assert "$ref" not in json.dumps(schema)
