"""Settings: every value of a spraying job that is in none of model file, URDF and controller table."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from tapelayer.setups.sections import JobSetup, MachineSettings, NotNegative, Number, OutputSettings, Positive, Section
from tapelayer.units import DEG, MM

STANDOFF_MM = 150.0
ARC_KEYS = ("voltage_v", "air_pressure_mpa", "wire_feed_m_per_min")
PLATING_KEYS = ("relative_speed_mm_per_s", "flow_l_per_min")


def _number_or_auto(value: object) -> object:
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if value != "auto" and not number:
        raise ValueError(f"expected a finite number or 'auto', got {value!r}")
    return value


def _positive_or_auto(value: object) -> object:
    _number_or_auto(value)
    if isinstance(value, int | float) and not value > 0:
        raise ValueError(f"expected a number above 0 or 'auto', got {value!r}")
    return value


NumberOrAuto = Annotated[float | Literal["auto"], BeforeValidator(_number_or_auto)]
PositiveOrAuto = Annotated[float | Literal["auto"], BeforeValidator(_positive_or_auto)]


class SprayedPartSettings(Section, title="Part"):
    """Where the part lies in the machine."""

    x_mm: Annotated[
        NumberOrAuto, Field(description="part origin along the machine's x; auto: the part is centred in the travel")
    ] = "auto"
    y_mm: Annotated[
        NumberOrAuto, Field(description="part origin along the machine's y; auto: the part is centred in the travel")
    ] = "auto"
    z_mm: Annotated[
        NumberOrAuto, Field(description="part origin along the machine's z; auto: its lowest point is at z = 0")
    ] = "auto"
    rotation_deg: Annotated[Number, Field(description="turn of the part about z before it is placed")] = 0.0


class PassSettings(Section, title="Spray"):
    """The passes and how the gun goes along them."""

    direction_deg: Annotated[
        Number, Field(description="travel of the passes, from the machine's +x towards +y, seen from above")
    ] = 0.0
    standoff_mm: Annotated[
        Annotated[NotNegative, Field(le=200)] | None,
        Field(description="nozzle to surface; without it 150, and 0 for plating"),
    ] = None
    spot_mm: Annotated[Positive, Field(description="diameter of the sprayed spot, or of the plating brush")] = 60.0
    pitch_mm: Annotated[
        PositiveOrAuto,
        Field(description="from pass to pass; auto: the widest with which target_cv_percent is kept"),
    ] = 25.0
    target_cv_percent: Annotated[
        Positive, Field(description="standard deviation of the thickness over its mean that pitch_mm = auto aims at")
    ] = 5.0
    speed_mm_per_s: Annotated[Positive, Field(description="speed of the gun along the surface")] = 300.0
    max_deviation_deg: Annotated[
        Positive, Field(description="angle of the gun off the surface's normal, at most", lt=90)
    ] = 15.0
    smoothing_mm: Annotated[
        NotNegative | None, Field(description="window over which normals are averaged; without it spot_mm")
    ] = None
    chord_tolerance_mm: Annotated[
        Positive, Field(description="points of a section are left out where the path stays as near to it")
    ] = 0.1
    max_point_spacing_mm: Annotated[Positive, Field(description="from point to point of a pass, at most")] = 10.0
    tolerance_mm: Annotated[Positive, Field(description="blocks end where P would leave the path by more")] = 0.5
    tolerance_deg: Annotated[
        Positive, Field(description="blocks end where the gun would leave its planned direction by more", lt=15)
    ] = 2.0
    overrun_mm: Annotated[
        NotNegative, Field(description="straight on over both ends of a pass, arc on, where the travel permits")
    ] = 30.0
    max_gap_mm: Annotated[
        NotNegative, Field(description="gaps in a pass and ways between passes up to this length keep the arc on")
    ] = 60.0
    min_normal_z: Annotated[
        Positive, Field(description="facets whose unit normal has a smaller z are too steep to be sprayed", lt=1)
    ] = 0.02
    pattern: Annotated[
        Literal["boustrophedon", "one_way"],
        Field(description="boustrophedon: every other plane is sprayed backwards; one_way: none is"),
    ] = "boustrophedon"
    retract_mm: Annotated[
        Positive, Field(description="the gun is drawn off along its axis by this between passes that are apart")
    ] = 50.0
    layers: Annotated[int, Field(description="how often the whole part is sprayed", ge=1, strict=True)] = 1
    layer_turn_deg: Annotated[
        Number, Field(description="each layer's direction is turned by this against the last")
    ] = 90.0
    layer_shift: Annotated[
        NotNegative, Field(description="passes against those of the last layer along the same lines, in pitches", lt=1)
    ] = 0.5
    interlayer_dwell_s: Annotated[NotNegative, Field(description="pause between layers, gun drawn off")] = 0.0
    interlayer_stop: Annotated[
        bool, Field(description="the program stops between layers until it is started again", strict=True)
    ] = False


class SprayProcessSettings(Section, title="Process"):
    """What is sprayed or plated; the values stand in the program's header for the operator."""

    kind: Annotated[Literal["arc", "plating"], Field(description="arc: arc spraying; plating: brush plating")] = "arc"
    current_a: Annotated[Positive | None, Field(description="current of the arc or of the plating")] = None
    voltage_v: Annotated[Positive | None, Field(description="arc only: voltage")] = None
    air_pressure_mpa: Annotated[Positive | None, Field(description="arc only: pressure of the air")] = None
    wire_feed_m_per_min: Annotated[Positive | None, Field(description="arc only: feed of the wires")] = None
    relative_speed_mm_per_s: Annotated[
        Positive | None, Field(description="plating only: speed of the brush, in place of speed_mm_per_s")
    ] = None
    flow_l_per_min: Annotated[Positive | None, Field(description="plating only: flow of the electrolyte")] = None
    air_lead_s: Annotated[
        NotNegative, Field(description="air, or electrolyte, is on for this long before arc or current")
    ] = 0.5

    @model_validator(mode="after")
    def _keys_of_one_process(self) -> Self:
        others, name = (PLATING_KEYS, "plating") if self.kind == "arc" else (ARC_KEYS, "arc")
        given = [key for key in others if getattr(self, key) is not None]
        if given:
            verb = "belongs" if len(given) == 1 else "belong"
            raise ValueError(f"{' and '.join(given)} {verb} to kind = {name!r}, this is {self.kind!r}")
        return self

    def notes(self) -> tuple[str, ...]:
        """Return the given values, with their units, for the program's header."""
        keys = ("current_a", *(ARC_KEYS if self.kind == "arc" else PLATING_KEYS))
        given = [(key, getattr(self, key)) for key in keys]
        return (f"process {self.kind}", *(f"{key} {value:g}" for key, value in given if value is not None))


class FootprintSettings(Section, title="Footprint"):
    """What a gun at rest, or a pass, leaves on a plane."""

    model: Annotated[
        Literal["gaussian", "parabolic_flux", "parabolic_pass", "profile"],
        Field(description="gaussian | parabolic_flux (at rest) | parabolic_pass (across a pass) | profile (of a file)"),
    ] = "gaussian"
    sigma_mm: Annotated[Positive | None, Field(description="gaussian: without it spot_mm / 4")] = None
    radius_mm: Annotated[Positive | None, Field(description="parabolic: without it spot_mm / 2")] = None
    profile: Annotated[
        str | None,
        Field(description="profile: text file of radius in mm and flux, a pair a line", min_length=1),
    ] = None
    rate_mm3_per_s: Annotated[
        Positive | None, Field(description="material that arrives; without it thickness is relative to its mean")
    ] = None

    @model_validator(mode="after")
    def _keys_of_one_model(self) -> Self:
        if (self.model == "profile") != (self.profile is not None):
            raise ValueError("model = 'profile' and the file in profile belong together; give both or neither")
        if self.sigma_mm is not None and self.model != "gaussian":
            raise ValueError(f"sigma_mm belongs to model = 'gaussian', this is {self.model!r}")
        if self.radius_mm is not None and not self.model.startswith("parabolic"):
            raise ValueError(f"radius_mm belongs to the parabolic models, this is {self.model!r}")
        return self


class SprayVerificationSettings(Section, title="Verification"):
    """What a program must keep; the emitted text is judged."""

    max_position_error_mm: Annotated[Positive, Field(description="P off the smoothed path")] = 1.5
    max_theta_step_deg: Annotated[
        Positive, Field(description="turn of theta within one block with the arc on", lt=180)
    ] = 60.0
    max_thickness_deviation_percent: Annotated[
        Positive | None, Field(description="standard deviation of the thickness over its mean; without it not judged")
    ] = None
    min_coverage_percent: Annotated[
        Positive | None,
        Field(
            description="share of the area seen from above that is covered; without it not judged",
            le=100,
        ),
    ] = None
    max_crease_deviation_deg: Annotated[
        Positive | None, Field(description="gun off the facets' normals beside creases; without it not judged")
    ] = None
    min_speed_share: Annotated[
        Positive | None,
        Field(description="share of the sprayed length at 95 % of the set speed or more; without it not judged", le=1),
    ] = None
    max_stops_while_spraying: Annotated[
        int | None,
        Field(description="stops of the gun with the arc on; without it not judged", ge=0, strict=True),
    ] = None


class SprayOutputSettings(OutputSettings, title="Output"):
    """What comes out."""

    controller: Annotated[str, Field(description="name of a controller table, or the path of one", min_length=1)] = (
        "generic5"
    )


class SpraySetup(JobSetup):
    """Everything that a spraying job needs beside its model."""

    FILES = (*JobSetup.FILES, ("footprint", "profile"))

    part: Annotated[SprayedPartSettings, Field(description="where the part lies in the machine")] = (
        SprayedPartSettings()
    )
    machine: Annotated[MachineSettings, Field(description="the machine, where it differs from its URDF")] = (
        MachineSettings()
    )
    spray: Annotated[PassSettings, Field(description="the passes and how the gun goes along them")] = PassSettings()
    process: Annotated[SprayProcessSettings, Field(description="what is sprayed or plated")] = SprayProcessSettings()
    footprint: Annotated[
        FootprintSettings, Field(description="what the gun leaves on the surface; for arc spraying")
    ] = FootprintSettings()
    verification: Annotated[SprayVerificationSettings, Field(description="what a program must keep")] = (
        SprayVerificationSettings()
    )
    output: Annotated[SprayOutputSettings, Field(description="what comes out")] = SprayOutputSettings()

    @model_validator(mode="after")
    def _plating_is_in_contact(self) -> Self:
        if self.process.kind == "plating":
            if self.spray.standoff_mm:
                raise ValueError("plating works in contact; set [spray] standoff_mm = 0 or leave it out")
            if self.footprint != FootprintSettings():
                raise ValueError("plating has no footprint; leave [footprint] out")
            for key in ("max_thickness_deviation_percent", "min_coverage_percent"):
                if getattr(self.verification, key) is not None:
                    raise ValueError(f"plating leaves no coat to judge; leave out [verification] {key}")
            if self.spray.pitch_mm == "auto":
                raise ValueError("plating has no footprint to choose a pitch by; set [spray] pitch_mm to a number")
            if self.process.relative_speed_mm_per_s and self.spray.speed_mm_per_s != PassSettings().speed_mm_per_s:
                raise ValueError("speed_mm_per_s and relative_speed_mm_per_s are one speed; leave out speed_mm_per_s")
        elif self.spray.standoff_mm == 0.0:
            raise ValueError("arc spraying keeps a distance; set [spray] standoff_mm above 0, 120 to 200 is usual")
        return self

    @property
    def standoff(self) -> float:
        """Return the distance from nozzle to surface in metres."""
        if self.process.kind == "plating":
            return 0.0
        return (STANDOFF_MM if self.spray.standoff_mm is None else self.spray.standoff_mm) * MM

    @property
    def speed(self) -> float:
        """Return the speed of the gun along the surface, m/s."""
        return (self.process.relative_speed_mm_per_s or self.spray.speed_mm_per_s) * MM

    @property
    def smoothing(self) -> float:
        """Return the window over which normals are averaged, metres."""
        return (self.spray.spot_mm if self.spray.smoothing_mm is None else self.spray.smoothing_mm) * MM

    @property
    def max_deviation(self) -> float:
        """Return the largest angle of the gun off the surface's normal, radians."""
        return self.spray.max_deviation_deg * DEG

    @property
    def planned_deviation(self) -> float:
        """Return the largest angle of the gun off the normal in a plan, radians: the rest is for straight blocks."""
        return max(self.spray.max_deviation_deg - self.spray.tolerance_deg, self.spray.max_deviation_deg / 2.0) * DEG

    def sha256(self, urdf: bytes, profile: bytes) -> str:
        """Return the SHA-256 of the effective values in hexadecimal; files count by content, not by path.

        Args:
            urdf: the bytes of the URDF in use.
            profile: the bytes of the footprint's profile; empty without a profile.
        """
        return self.digest({("machine", "urdf"): urdf, ("footprint", "profile"): profile})
