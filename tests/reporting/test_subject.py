"""A report says what it is about; its bytes follow from its inputs and from what the caller tells, not from a clock."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest

from tapelayer.errors import SetupRefused
from tapelayer.jobs.kinds import MACHINE_NAMES, MachineKindName, machine_kind_of
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.provenance import VERSION, moment
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.job import SprayJob
from tests.helpers.kinds import made, source
from tests.helpers.pages import Elements
from tests.helpers.paths import ROOT
from urdf import SPRAYER, TAPELAYER

OCCASION = Occasion("program.nc", "job.toml", "2026-01-01T00:00:00Z")
URDFS = {"lay": TAPELAYER, "spray": SPRAYER}


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize("kind", MACHINE_NAMES)
def test_the_subject_names_every_input_by_its_content(kind: MachineKindName) -> None:
    result = made(kind)
    control = result.job.controller.name
    assert result.report(OCCASION)["subject"] == {
        "sources": [{"name": "source.txt", "sha256": sha256(source(kind))}],
        "setup": {"name": "job.toml", "sha256": result.job.provenance.setup_sha256, "changed": []},
        "machine": {
            "robot": machine_kind_of(kind).machine.name,
            "name": URDFS[kind].name,
            "sha256": sha256(URDFS[kind].read_bytes()),
        },
        "controller": {
            "name": control,
            "sha256": sha256((ROOT / "post" / "controllers" / f"{control}.toml").read_bytes()),
        },
        "program": {"name": "program.nc", "sha256": sha256(result.text)},
        "version": VERSION,
        "judged_at": "2026-01-01T00:00:00Z",
    }


def test_what_was_changed_is_told_with_its_default_and_no_folder(tmp_path: Path) -> None:
    own = tmp_path / "own.urdf"
    own.write_bytes(TAPELAYER.read_bytes())
    text = f"[tape]\nwidth_mm = 50\n[process]\nlay_speed_mm_per_s = 250\n[machine]\nurdf = {str(own)!r}\n"
    setup = parse_setup(f"{text}limits_mm = {{x = [0, 2500]}}\n".encode(), "job.toml", Setup)
    subject = Job.of(source("lay"), "a/b.txt", setup).subject(OCCASION, "").values()
    assert subject["setup"]["changed"] == [
        {"section": "machine", "key": "urdf", "value": "own.urdf", "default": None},
        {"section": "machine", "key": "limits_mm", "value": {"x": [0.0, 2500.0]}, "default": {}},
        {"section": "tape", "key": "width_mm", "value": 50.0, "default": 75.0},
    ]
    assert subject["sources"][0]["name"] == "b.txt" and subject["machine"]["name"] == "own.urdf"
    assert subject["program"]["sha256"] is None
    assert str(tmp_path) not in json.dumps(subject)


def test_a_profile_is_a_source_too(tmp_path: Path) -> None:
    profile = tmp_path / "gun.txt"
    profile.write_text("0 1\n10 0.5\n20 0\n")
    text = f"[footprint]\nmodel = 'profile'\nprofile = {str(profile)!r}\n"
    setup = parse_setup(text.encode(), "job.toml", machine_kind_of("spray").setup)
    subject = SprayJob.of(source("spray"), "a.stl", setup).subject(OCCASION, "").values()
    assert subject["sources"][1:] == [{"name": "gun.txt", "sha256": sha256(profile.read_bytes())}]


@pytest.mark.parametrize("kind", MACHINE_NAMES)
def test_the_subject_stands_above_the_signatures(kind: MachineKindName) -> None:
    text = made(kind).page(OCCASION)
    cells = [words for _, words in Elements(text).of("td")]
    subject = made(kind).report(OCCASION)["subject"]
    for one in (*subject["sources"], subject["setup"], subject["machine"], subject["controller"], subject["program"]):
        assert one["sha256"] in cells and any(one["name"] in cell for cell in cells)
    for words in (VERSION, "2026-01-01T00:00:00Z"):
        assert words in cells
    assert text.index(">Subject</h2>") < text.rindex("2026-01-01T00:00:00Z") < text.index("Prepared by")


def test_no_report_reads_a_clock() -> None:
    """What nobody tells is not there, and two reports of one job are the same bytes."""
    result = made("lay")
    assert result.report()["subject"]["judged_at"] is None
    assert result.report_file() == result.report_file(Occasion())
    assert result.report_file(OCCASION) != result.report_file()
    for path in (ROOT / "tapelayer").rglob("*.py"):
        reads = re.search(r"\btime\.time\(|datetime\.now\(|\btoday\(", path.read_text(encoding="utf-8"))
        assert not reads or path.parent.name in ("workbench", "cli"), path


@pytest.mark.parametrize("epoch", ["", "now", "1e9", "9" * 30, "-" + "9" * 30])
def test_a_moment_that_is_none_is_refused(epoch: str) -> None:
    with pytest.raises(SetupRefused, match="SOURCE_DATE_EPOCH: expected whole seconds since 1970, got"):
        moment(0.0, epoch)
