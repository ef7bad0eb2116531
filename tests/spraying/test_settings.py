"""The setup of a spraying job: every key, one process at a time, what plating forces."""

from __future__ import annotations

import pytest

from tapelayer.errors import SetupRefused
from tapelayer.setups.sections import parse_setup, whole_text
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import DEG, MM

TITLE = "Setup of a spraying job"


def parsed(text: str) -> SpraySetup:
    return parse_setup(text.encode(), "job.toml", SpraySetup)


def refused(text: str) -> str:
    with pytest.raises(SetupRefused) as caught:
        parsed(text)
    return str(caught.value)


def test_whole_text_is_the_default_setup() -> None:
    assert parsed(whole_text(SpraySetup(), TITLE)) == SpraySetup()


def test_whole_text_describes_every_key() -> None:
    text = whole_text(SpraySetup(), TITLE)
    for name, field in SpraySetup.model_fields.items():
        assert f"[{name}]" in text
        for key, value in field.annotation.model_fields.items():  # type: ignore[union-attr]
            line = next(line for line in text.splitlines() if line.lstrip("# ").startswith(f"{key} ="))
            assert line.endswith(f"# {value.description}") and value.description


def test_defaults_where_nothing_else_decides() -> None:
    setup = SpraySetup()
    spray = setup.spray
    assert (spray.spot_mm, spray.pitch_mm, spray.speed_mm_per_s, spray.max_deviation_deg) == (60, 25, 300, 15)
    assert (spray.overrun_mm, spray.max_gap_mm, spray.target_cv_percent, spray.layers) == (30, 60, 5, 1)
    assert (setup.standoff, setup.speed, setup.smoothing) == (150 * MM, 300 * MM, 60 * MM)
    assert setup.max_deviation == 15 * DEG
    assert (spray.retract_mm, spray.min_normal_z, spray.layer_turn_deg, spray.layer_shift) == (50, 0.02, 90, 0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[spray]\npitch = 3", "job.toml:2: unknown key pitch in [spray]; did you mean pitch_mm?"),
        (
            "[head]\na = 1",
            "job.toml:1: unknown section [head]; there are [part], [machine], [spray], [process], [footprint], "
            "[verification], [output]",
        ),
        ("[spray]\npitch_mm = 'x'", "job.toml:2: [spray] pitch_mm: expected a finite number or 'auto', got 'x'"),
        ("[spray]\npitch_mm = 0", "job.toml:2: [spray] pitch_mm: expected a number above 0 or 'auto', got 0"),
        ("[part]\ny_mm = inf", "job.toml:2: [part] y_mm: expected a finite number or 'auto', got inf"),
        ("[part]\nx_mm = true", "job.toml:2: [part] x_mm: expected a finite number or 'auto', got True"),
        (
            "[spray]\nstandoff_mm = 201",
            "job.toml:2: [spray] standoff_mm: input should be less than or equal to 200, got 201",
        ),
        ("[spray]\nlayers = 1.5", "job.toml:2: [spray] layers: input should be a valid integer, got 1.5"),
        (
            "[process]\nkind = 'plating'\nvoltage_v = 30\nair_pressure_mpa = 0.4",
            "job.toml:1: [process]: voltage_v and air_pressure_mpa belong to kind = 'arc', this is 'plating'",
        ),
        (
            "[process]\nflow_l_per_min = 3",
            "job.toml:1: [process]: flow_l_per_min belongs to kind = 'plating', this is 'arc'",
        ),
        (
            "[footprint]\nmodel = 'parabolic_pass'\nsigma_mm = 3",
            "job.toml:1: [footprint]: sigma_mm belongs to model = 'gaussian', this is 'parabolic_pass'",
        ),
        (
            "[footprint]\nradius_mm = 3",
            "job.toml:1: [footprint]: radius_mm belongs to the parabolic models, this is 'gaussian'",
        ),
        (
            "[footprint]\nmodel = 'profile'",
            "job.toml:1: [footprint]: model = 'profile' and the file in profile belong together; give both or neither",
        ),
        (
            "[spray]\nstandoff_mm = 0",
            "job.toml: the setup: arc spraying keeps a distance; set [spray] standoff_mm above 0, 120 to 200 is usual",
        ),
    ],
)
def test_fault_is_named_with_its_line(text: str, message: str) -> None:
    assert refused(text) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[spray]\nstandoff_mm = 150", "plating works in contact; set [spray] standoff_mm = 0 or leave it out"),
        ("[footprint]\nradius_mm = 3\nmodel = 'parabolic_flux'", "plating has no footprint; leave [footprint] out"),
        (
            "[spray]\npitch_mm = 'auto'",
            "plating has no footprint to choose a pitch by; set [spray] pitch_mm to a number",
        ),
    ],
)
def test_plating_is_in_contact_and_has_no_footprint(text: str, message: str) -> None:
    assert refused(f"{text}\n[process]\nkind = 'plating'\n") == f"job.toml: the setup: {message}"


def test_plating_has_one_speed() -> None:
    text = "[process]\nkind = 'plating'\nrelative_speed_mm_per_s = 120\ncurrent_a = 50\n"
    setup = parsed(text)
    assert (setup.standoff, setup.speed) == (0.0, 120 * MM)
    assert setup.process.notes() == ("process plating", "current_a 50", "relative_speed_mm_per_s 120")
    assert refused(text + "[spray]\nspeed_mm_per_s = 200").endswith("are one speed; leave out speed_mm_per_s")
    assert parsed("[process]\nkind = 'plating'\n[spray]\nspeed_mm_per_s = 200").speed == 200 * MM


def test_arc_values_stand_in_the_header() -> None:
    setup = parsed("[process]\nvoltage_v = 32\ncurrent_a = 200\nair_pressure_mpa = 0.45\nwire_feed_m_per_min = 3.5\n")
    notes = ("current_a 200", "voltage_v 32", "air_pressure_mpa 0.45", "wire_feed_m_per_min 3.5")
    assert setup.process.notes() == ("process arc", *notes)


def test_values_from_the_command_line_are_validated_again() -> None:
    setup = SpraySetup().with_values("spray", direction_deg=30.0, pitch_mm="auto")
    assert (setup.spray.direction_deg, setup.spray.pitch_mm) == (30.0, "auto")
    with pytest.raises(SetupRefused, match="pitch_mm: expected a number above 0 or 'auto', got -1"):
        setup.with_values("spray", pitch_mm=-1)


def test_files_are_relative_to_the_setup_file() -> None:
    text = b'[machine]\nurdf = "mine.urdf"\n[footprint]\nmodel = "profile"\nprofile = "gun/a.txt"\n'
    setup = parse_setup(text, "jobs/hood.toml", SpraySetup)
    assert (setup.machine.urdf, setup.footprint.profile) == ("jobs/mine.urdf", "jobs/gun/a.txt")
    absolute = parse_setup(text.replace(b"gun/", b"/gun/"), "jobs/hood.toml", SpraySetup)
    assert absolute.footprint.profile == "/gun/a.txt"


def test_sha256_is_of_the_effective_values() -> None:
    default = SpraySetup().sha256(b"urdf", b"")
    assert parsed(whole_text(SpraySetup(), TITLE)).sha256(b"urdf", b"") == default
    assert parsed("[spray]\ndirection_deg = 1").sha256(b"urdf", b"") != default
    assert SpraySetup().sha256(b"other", b"") != default
    assert SpraySetup().sha256(b"urdf", b"0 1") != default
    one, other = (parsed(f"[footprint]\nmodel = 'profile'\nprofile = {name!r}") for name in ("a.txt", "b.txt"))
    assert one.sha256(b"", b"0 1") == other.sha256(b"", b"0 1")
