"""Catalogue: what there is to choose from is what the library has, and setups go to text and back."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from post import controllers
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import SetupRefused
from tapelayer.geometry.models import parse_mesh
from tapelayer.jobs.kinds import MACHINE_NAMES, KindName, kind_of
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.setups.forms import text_of, text_of_values, values_of
from tapelayer.setups.sections import parse_setup, whole_text
from tapelayer.spraying.job import SprayJob
from tapelayer.spraying.settings import SpraySetup
from tapelayer.workbench import catalogue
from tests.helpers.panels import mesh_of, sheet
from tests.helpers.paths import EXAMPLES
from tests.helpers.routes import Asking
from urdf import SPRAYER, TAPELAYER

CLIENT = Asking(catalogue.router)


def test_controllers_are_the_tables() -> None:
    found = CLIENT.get("/controllers").json()["controllers"]
    assert [one["name"] for one in found] == list(controllers.names())
    assert all(one["title"] == controllers.load(one["name"]).title for one in found)


def test_machines_have_their_axes_in_millimetres_and_degrees() -> None:
    tapelayer, sprayer = CLIENT.get("/machines").json()["machines"]
    assert (tapelayer["name"], tapelayer["frames"], sprayer["name"], sprayer["frames"]) == (
        *("tapelayer", ["contact"]),
        *("sprayer", ["P"]),
    )
    assert [axis["name"] for axis in tapelayer["axes"]] == list(Machine.load(TAPELAYER).names)
    assert tapelayer["axes"][0] == {"name": "x", "unit": "mm", "lower": 0.0, "upper": 2500.0, "speed": 1000.0}
    assert tapelayer["axes"][3] == {"name": "c", "unit": "deg", "lower": -30.0, "upper": 30.0, "speed": 60.0}
    assert [axis["name"] for axis in sprayer["axes"]] == list(Machine.load(SPRAYER).names)


@pytest.mark.parametrize(("name", "path"), [("tapelayer", TAPELAYER), ("sprayer", SPRAYER)])
def test_urdfs_are_the_files(name: str, path: Path) -> None:
    response = CLIENT.get(f"/machines/{name}/urdf")
    assert response.headers["content-type"] == "application/xml"
    assert response.content == path.read_bytes()


@pytest.mark.parametrize("address", ["machines/robot/urdf", "examples/__init__.py", "examples/..%2Fpyproject.toml"])
def test_what_is_not_there_is_not_found(address: str) -> None:
    response = CLIENT.get(f"/{address}")
    assert response.status_code == 404
    if "%2F" not in address:
        assert response.json()["code"] == "not-found"
        assert "there are" in response.json()["detail"]


def test_examples_are_all_files_to_begin_with() -> None:
    listed = CLIENT.get("/examples").json()["examples"]
    files = sorted(path.name for path in EXAMPLES.iterdir() if path.suffix in (".txt", ".stl"))
    assert [one["name"] for one in listed] == files
    for one in listed:
        data = CLIENT.get(f"/examples/{one['name']}").content
        assert data == (EXAMPLES / one["name"]).read_bytes()
        assert len(data) < 300_000
        assert parse_courses(data, "a") if one["kind"] == "lay" else parse_mesh(data, "a").facets.size
    assert [one["kind"] for one in listed].count("spray") == 1


def test_the_model_to_spray_is_its_formula_and_can_be_sprayed() -> None:
    data = (EXAMPLES / "curved_panel.stl").read_bytes()
    x, y = np.arange(0, 481, 20.0), np.arange(0, 321, 20.0)
    expected = mesh_of(sheet(x, y, lambda x, y: 40 + 30 * np.sin(x / 90) * np.cos(y / 120) - y**2 / 4000))
    mesh = parse_mesh(data, "curved_panel.stl")
    np.testing.assert_allclose(mesh.vertices, expected.vertices, atol=1e-8)
    np.testing.assert_array_equal(mesh.facets, expected.facets)
    made = SprayJob.of(data, "curved_panel.stl", SpraySetup(), "mm").make("curved_panel.nc")
    assert made.failure is None
    assert made.report()["unreachable"] == []


@pytest.mark.parametrize("kind", ["lay", "spray", "plan"])
def test_the_schema_describes_every_key(kind: KindName) -> None:
    schema = CLIENT.get("/setup-schema", params={"kind": kind}).json()
    for section, field in kind_of(kind).setup.model_fields.items():
        model = schema["$defs"][schema["properties"][section]["$ref"].rpartition("/")[2]]
        keys = field.annotation.model_fields  # type: ignore[union-attr]
        assert list(model["properties"]) == list(keys)
        for key, value in keys.items():
            assert model["properties"][key]["description"] == value.description


def test_only_the_keys_that_are_set_are_parsed() -> None:
    text = "[tape]\nwidth_mm = 50\n[part]\nrotation_deg = [0, 0, 90]\n[head]\ndelays_ms = {shoe = 20}\n[process]\n"
    response = CLIENT.post("/setup/parse?kind=lay", content=text, headers={"Content-Type": "text/plain"})
    assert response.json() == {
        "values": {
            "tape": {"width_mm": 50.0},
            "part": {"rotation_deg": [0.0, 0.0, 90.0]},
            "head": {"delays_ms": {"shoe": 20.0}},
            "process": {},
        }
    }


@pytest.mark.parametrize("kind", MACHINE_NAMES)
def test_an_empty_setup_sets_nothing(kind: str) -> None:
    response = CLIENT.post(f"/setup/parse?kind={kind}", content=b"", headers={"Content-Type": "text/plain"})
    assert (response.status_code, response.json()) == (200, {"values": {}})


@pytest.mark.parametrize(
    ("kind", "text", "fault"),
    [
        ("lay", b"[tape]\nwidth_mm = -1\n", (2, 0, "tape", "width_mm", "greater than 0, got -1")),
        ("spray", b"\n[spray]\nspot = 1\n", (3, 0, "spray", "spot", "did you mean spot_mm?")),
        ("spray", b"[process]\nkind = 'plating'\nvoltage_v = 3", (1, 0, "process", "", "")),
        ("lay", b"[tape\n", (1, 6, None, None, "not TOML")),
        ("lay", b"\xff", (0, 0, None, None, "byte 0 is not UTF-8")),
        ("lay", b"[heads]\na = 1", (1, 0, "heads", "", "did you mean [head]?")),
    ],
)
def test_faults_name_their_place(kind: str, text: bytes, fault: tuple[int, int, str | None, str | None, str]) -> None:
    response = CLIENT.post(f"/setup/parse?kind={kind}", content=text, headers={"Content-Type": "text/plain"})
    assert (response.status_code, response.json()["code"]) == (422, "setup-refused")
    (found,) = response.json()["faults"]
    line, column, section, key, words = fault
    assert (found["line"], found["column"], found.get("section"), found.get("key")) == (line, column, section, key)
    assert words in found["sentence"]


def test_all_faults_of_values_are_told_at_once() -> None:
    values = {"tape": {"width_mm": 0, "colour": "red"}, "machine": {"limits_mm": {"x": [3, 1]}}}
    response = CLIENT.post("/setup/format", json={"kind": "lay", "values": values})
    assert response.status_code == 422
    places = {(fault["section"], fault["key"]) for fault in response.json()["faults"]}
    assert places == {("tape", "width_mm"), ("tape", "colour"), ("machine", "limits_mm")}


def test_values_become_toml() -> None:
    values = {"tape": {"width_mm": 50.125}, "process": {"link_clearance_mm": None}, "output": {"controller": 'a "b"'}}
    response = CLIENT.post("/setup/format", json={"kind": "lay", "values": values})
    assert response.headers["content-type"] == "text/plain; charset=utf-8"
    assert tomllib.loads(response.text) == {
        "tape": {"width_mm": 50.125},
        "process": {},
        "output": {"controller": 'a "b"'},
    }


def test_a_default_setup_is_written_whole() -> None:
    response = CLIENT.post("/setup/format", json={"kind": "lay", "values": {"tape": {"width_mm": 50}}, "whole": True})
    kind = kind_of("lay")
    setup = parse_setup(response.content, "setup.toml", kind.setup)
    assert setup == kind.setup().with_values("tape", width_mm=50.0)
    assert response.text == whole_text(setup, kind.title) and len(response.text) > 1000


def test_what_no_file_may_hold_is_refused() -> None:
    with pytest.raises(SetupRefused, match="setup.toml: byte 21 is not UTF-8"):
        text_of_values({"machine": {"limits_mm": {"\ud800": [1, 2]}}}, kind_of("lay").setup)
    with pytest.raises(SetupRefused, match="setup.toml:2: the line has 101. characters, expected at most 1000"):
        text_of_values({"output": {"controller": "n" * 1000}}, kind_of("lay").setup)


NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=8)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
RANGES = st.tuples(NUMBERS, NUMBERS).filter(lambda ends: ends[0] < ends[1]).map(list)
ANGLES = st.lists(NUMBERS, min_size=3, max_size=3)


def values(**keys: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({}, optional=keys)


LAY = values(
    part=values(l1_mm=NUMBERS, rotation_deg=NUMBERS | ANGLES, laid_thickness_mm=st.integers(0, 9)),
    machine=values(
        urdf=st.from_regex(r"[a-z]{1,5}\.urdf", fullmatch=True),
        limits_mm=st.dictionaries(NAMES, RANGES, max_size=3),
        speeds_deg_per_s=st.dictionaries(NAMES, POSITIVE, max_size=3),
    ),
    head=values(
        wrap_compensation=st.booleans(), run_out=st.sampled_from(["tangent", "none"]), delays_ms=values(shoe=POSITIVE)
    ),
    output=values(controller=NAMES),
    process=values(link_clearance_mm=st.none() | POSITIVE),
)
SPRAY = values(
    part=values(x_mm=st.just("auto") | NUMBERS, rotation_deg=NUMBERS),
    spray=values(pitch_mm=st.just("auto") | POSITIVE, min_normal_z=st.floats(0.001, 0.999), layers=st.integers(1, 5)),
    footprint=values(sigma_mm=st.none() | POSITIVE, rate_mm3_per_s=POSITIVE),
    output=values(controller=NAMES),
)


def set_only(given: dict[str, Any]) -> dict[str, Any]:
    """Values without those that say nothing."""
    return {name: {key: value for key, value in table.items() if value is not None} for name, table in given.items()}


@settings(max_examples=150)
@given(st.tuples(st.just("lay"), LAY) | st.tuples(st.just("spray"), SPRAY))
def test_text_of_values_is_read_back_as_the_same_values(case: tuple[KindName, dict[str, Any]]) -> None:
    kind, wanted = case
    text = text_of_values(wanted, kind_of(kind).setup)
    assert parse_setup(text.encode(), "setup.toml", kind_of(kind).setup) == kind_of(kind).setup(**wanted)
    assert values_of(text.encode(), kind_of(kind).setup) == set_only(wanted)
    assert text_of(kind_of(kind).setup(**wanted)) == text


@settings(max_examples=60)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=5,
    ),
    st.sampled_from(["tape", "head", "part", "x"]),
    st.sampled_from(["width_mm", "delays_ms", "rotation_deg", "y"]),
)
def test_any_value_is_taken_or_refused(value: Any, section: str, key: str) -> None:
    try:
        text = text_of_values({section: {key: value}}, kind_of("lay").setup)
    except SetupRefused as error:
        assert error.faults
    else:
        assert parse_setup(text.encode(), "setup.toml", Setup) == Setup(**{section: {key: value}})
