"""The setup file: every key, every fault, one description."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.errors import SetupRefused
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup, read_setup, whole_text
from tapelayer.units import DEG, MM

TITLE = "Setup of a tape-laying job"


def refused(text: str) -> str:
    with pytest.raises(SetupRefused) as caught:
        parse_setup(text.encode(), "job.toml", Setup)
    return str(caught.value)


def test_default_text_is_the_default_setup() -> None:
    assert parse_setup(whole_text(Setup(), TITLE).encode(), "s.toml", Setup) == Setup()


def test_default_text_describes_every_key() -> None:
    text = whole_text(Setup(), TITLE)
    for name, field in Setup.model_fields.items():
        assert f"[{name}]" in text
        for key, value in field.annotation.model_fields.items():  # type: ignore[union-attr]
            assert value.description, key
            line = next(line for line in text.splitlines() if line.lstrip("# ").startswith(f"{key} ="))
            assert line.endswith(f"# {value.description}")


def test_defaults_where_nothing_else_decides() -> None:
    setup = Setup()
    assert (setup.tape.width_mm, setup.tape.roll_length_m, setup.head.knife_to_nip_mm) == (75, 150, 350)
    assert (setup.head.knife_clearance_mm, setup.head.minimum_cut_angle_deg, setup.head.scrap_margin_mm) == (10, 15, 5)
    assert (setup.head.aux_roller_lag_mm, setup.process.approach_mm, setup.process.lay_speed_mm_per_s) == (60, 50, 250)
    assert (setup.part.l1_mm, setup.part.l2_mm, setup.part.l3_mm) == (300, -1900, 1400)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[process]\nlay_speed = 3",
            "job.toml:2: unknown key lay_speed in [process]; did you mean lay_speed_mm_per_s?",
        ),
        ("[head]\nl1_mm = 3", "job.toml:2: unknown key l1_mm in [head]; did you mean l1_mm in [part]?"),
        ("[heads]\na = 1", "job.toml:1: unknown section [heads]; did you mean [head]?"),
        (
            "[part]\nqqqq = 1",
            "job.toml:2: unknown key qqqq in [part]; the setup command prints every key there is",
        ),
        ("[head]\ndelays_ms = {sho = 1}", "job.toml:2: unknown key sho in [head]; did you mean shoe?"),
        (
            "[process]\n\ntolerance_mm = -1",
            "job.toml:3: [process] tolerance_mm: input should be greater than 0, got -1",
        ),
        ("[part]\nl1_mm = nan", "job.toml:2: [part] l1_mm: input should be a finite number, got nan"),
        ("[part]\nl1_mm = '5'", "job.toml:2: [part] l1_mm: input should be a valid number, got '5'"),
        (
            "[machine]\nlimits_mm = {x = [3, 1]}",
            "job.toml:2: [machine] limits_mm.x: expected [lower, upper] with lower below upper, got [3.0, 1.0]",
        ),
        (
            "[machine]\nlimits_mm = {c = [0, 1]}\nlimits_deg = {c = [0, 1]}",
            "job.toml:1: [machine]: axis c stands in both limits_mm and limits_deg; keep the one of its unit",
        ),
        ("[head]\nrun_out = 'x'", "job.toml:2: [head] run_out: input should be 'tangent' or 'none', got 'x'"),
        ("[head\n", "job.toml:1:6: not TOML: expected ']' at the end of a table declaration"),
    ],
)
def test_fault_is_named_with_its_line(text: str, message: str) -> None:
    assert refused(text) == message


def test_a_file_of_faults_alone_is_counted() -> None:
    text = "[part]\n" + "\n".join(f"k{number} = 1" for number in range(20_000))
    message = refused(text)
    assert message.startswith(
        "job.toml: has 20000 faults; is it the right file?\njob.toml:2: unknown key k0 in [part]; "
    )
    assert message.endswith("\njob.toml: and 81 more faults")


def test_all_faults_at_once() -> None:
    text = "[process]\nlay_speed = 3\napproach_mm = 0\n[tape]\nwidth_mm = inf\n"
    assert [line.split(":")[1] for line in refused(text).splitlines()] == ["2", "3", "5"]


def test_missing_file_directory_and_wrong_encoding(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "none.toml", "cannot be read: no such file or directory"),
        (tmp_path, "cannot be read: is a directory"),
    ):
        with pytest.raises(SetupRefused) as caught:
            read_setup(path, Setup)
        assert str(caught.value) == f"{path}: {message}"
    assert refused_bytes("[part]\n# 铺带".encode("gb18030")).endswith("is not UTF-8; save the file as UTF-8")


def refused_bytes(data: bytes) -> str:
    with pytest.raises(SetupRefused) as caught:
        parse_setup(data, "job.toml", Setup)
    return str(caught.value)


def test_urdf_is_relative_to_the_setup_file(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text('[machine]\nurdf = "mine.urdf"\n')
    assert read_setup(path, Setup).machine.urdf == str(tmp_path / "mine.urdf")


def test_units_are_converted_once() -> None:
    text = "[machine]\nlimits_mm = {x = [0, 2500]}\nlimits_deg = {c = [-180, 180]}\nspeeds_deg_per_s = {a = 10}\n"
    setup = parse_setup(text.encode(), "s.toml", Setup)
    assert setup.machine.travel() == {"x": (0.0, 2500 * MM), "c": (-180 * DEG, 180 * DEG)}
    assert setup.machine.speeds() == {"a": 10 * DEG}
    assert parse_setup(b"[part]\nrotation_deg = 90", "s", Setup).part.rotation_rad() == (0.0, 0.0, 90 * DEG)
    assert parse_setup(b"[part]\nrotation_deg = [1, 2, 3]", "s", Setup).part.rotation_rad() == (DEG, 2 * DEG, 3 * DEG)


def test_sha256_is_of_the_effective_values() -> None:
    written_out = parse_setup(whole_text(Setup(), TITLE).encode(), "s.toml", Setup)
    assert written_out.sha256(b"urdf") == Setup().sha256(b"urdf") != Setup().sha256(b"other")
    # Limits that judge nothing and ramps that are the URDF's where they are not set came later than this hash.
    assert Setup().sha256(b"urdf") == "ace51976338cc79d08240c3b6c53cca61d016b9da2d886159db975f019b58846"
    assert Setup().with_values("verification", min_speed_share=0.9).sha256(b"urdf") != Setup().sha256(b"urdf")
    ramps = ("accelerations_mm_per_s2", "accelerations_deg_per_s2", "jerks_mm_per_s3", "jerks_deg_per_s3")
    ramped = {Setup().with_values("machine", **{key: {"x": 100.0}}).sha256(b"urdf") for key in ramps}
    assert len(ramped | {Setup().sha256(b"urdf")}) == 5
    assert Setup().with_values("verification", max_stops_while_laying=0).sha256(b"urdf") != Setup().sha256(b"urdf")
    assert Setup().with_values("process", approach_mm=51).sha256(b"urdf") != Setup().sha256(b"urdf")


def test_with_values_keeps_what_was_set_and_validates() -> None:
    setup = parse_setup(b"[verification]\nmax_roller_tilt_deg = 1", "s", Setup).with_values(
        "process", kinematics="published"
    )
    assert setup.verification.model_fields_set == {"max_roller_tilt_deg"}
    assert setup.process.kinematics == "published"
    with pytest.raises(SetupRefused, match="approach_mm: input should be greater than 0, got -1"):
        setup.with_values("process", approach_mm=-1)


@given(st.floats(-1e5, 1e5), st.floats(0, 100), st.booleans())
def test_values_survive_the_file(l1: float, lag: float, wrap: bool) -> None:
    text = f"[part]\nl1_mm = {l1!r}\n[head]\naux_roller_lag_mm = {lag!r}\nwrap_compensation = {str(wrap).lower()}\n"
    assert tomllib.loads(text)
    setup = parse_setup(text.encode(), "s", Setup)
    assert (setup.part.l1_mm, setup.head.aux_roller_lag_mm, setup.head.wrap_compensation) == (l1, lag, wrap)


def test_faults_know_their_section_and_key() -> None:
    text = "[tape]\nwidth_mm = -1\nlength = 2\n\n[heads]\n\n[head.delays_ms]\nshoe = -2\n"
    with pytest.raises(SetupRefused) as caught:
        parse_setup(text.encode(), "job.toml", Setup)
    places = {fault.place for fault in caught.value.faults}
    assert places == {("tape", "width_mm"), ("tape", "length"), ("heads",), ("head", "delays_ms", "shoe")}
    with pytest.raises(SetupRefused) as caught:
        parse_setup(b"[tape", "job.toml", Setup)
    assert caught.value.faults[0].place == ()
