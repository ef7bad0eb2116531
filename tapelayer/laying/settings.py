"""Settings: every value of a tape-laying job that is in none of course file, URDF and controller table.

Fields are in the units of their names (mm, deg); multiply by `MM` and `DEG` to compute.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tapelayer.setups.sections import JobSetup, MachineSettings, NotNegative, Number, OutputSettings, Positive, Section
from tapelayer.units import DEG


class PartSettings(Section, title="Part"):
    """Where the part lies in the machine: machine = rotated part + (l1, l2, -l3) (the paper's 1.4)."""

    l1_mm: Annotated[Number, Field(description="part origin along the machine's x")] = 300.0
    l2_mm: Annotated[Number, Field(description="part origin along the machine's y")] = -1900.0
    l3_mm: Annotated[Number, Field(description="part origin below the machine's origin")] = 1400.0
    rotation_deg: Annotated[
        Number | Annotated[list[Number], Field(min_length=3, max_length=3)],
        Field(description="turn of the part before it is placed: about z, or [x, y, z] about fixed axes in that order"),
    ] = 0.0
    laid_thickness_mm: Annotated[
        NotNegative, Field(description="thickness of the plies already laid under these courses")
    ] = 0.0

    def rotation_rad(self) -> tuple[float, float, float]:
        """Return the angles about the fixed axes x, y, z in radians, applied in that order."""
        angles = self.rotation_deg if isinstance(self.rotation_deg, list) else [0.0, 0.0, self.rotation_deg]
        return angles[0] * DEG, angles[1] * DEG, angles[2] * DEG


class TapeSettings(Section, title="Tape"):
    """The material."""

    width_mm: Annotated[Positive, Field(description="width of the tape")] = 75.0
    thickness_mm: Annotated[Positive, Field(description="thickness of one laid ply")] = 0.15
    roll_length_m: Annotated[Positive, Field(description="tape on one roll")] = 150.0


class DelaySettings(Section, title="Delays"):
    """Time from a switching word to its effect; the word is moved ahead by planned speed x delay."""

    shoe: Annotated[NotNegative, Field(description="compaction shoe, ms")] = 0.0
    roller: Annotated[NotNegative, Field(description="auxiliary roller, ms")] = 0.0
    knife: Annotated[NotNegative, Field(description="knives, ms")] = 0.0
    heater: Annotated[NotNegative, Field(description="heater, ms")] = 0.0


class HeadSettings(Section, title="Head"):
    """The tape head, where the URDF does not hold it."""

    knife_to_nip_mm: Annotated[Positive, Field(description="tape path from knife 1 to the nip on a level surface")] = (
        350.0
    )
    knife_clearance_mm: Annotated[NotNegative, Field(description="a sweep's run beyond both edges of the tape")] = 10.0
    minimum_cut_angle_deg: Annotated[
        Positive, Field(description="smallest angle between a cut and the tape's edge", lt=90)
    ] = 15.0
    scrap_margin_mm: Annotated[NotNegative, Field(description="waste between two cuts that are not shared")] = 5.0
    blade_length_mm: Annotated[Positive, Field(description="least distance between the two blades")] = 20.0
    aux_roller_lag_mm: Annotated[
        NotNegative, Field(description="the auxiliary roller follows the nip by this distance")
    ] = 60.0
    run_out: Annotated[
        Literal["tangent", "none"],
        Field(description="how the auxiliary roller reaches the course's end: tangent | none"),
    ] = "tangent"
    wrap_compensation: Annotated[
        bool,
        Field(
            description="shorten the tape path where the nip moves round the roller; false: u is the arc length",
            strict=True,
        ),
    ] = True
    heater_stop_s: Annotated[NotNegative, Field(description="the heater goes off during a stop longer than this")] = 2.0
    delays_ms: Annotated[DelaySettings, Field(description="actuator delays")] = DelaySettings()


class ProcessSettings(Section, title="Process"):
    """How the job is run."""

    lay_speed_mm_per_s: Annotated[
        Positive, Field(description="speed of the nip over the surface, and of plunge and retract")
    ] = 250.0
    thread_speed_mm_per_s: Annotated[Positive, Field(description="speed of the tape while it is threaded")] = 250.0
    approach_mm: Annotated[Positive, Field(description="clearance along the head's normal before the plunge")] = 50.0
    link_clearance_mm: Annotated[
        NotNegative | None,
        Field(description="clearance above the highest course point between courses; without it approach_mm"),
    ] = None
    tolerance_mm: Annotated[
        Positive, Field(description="blocks are inserted where the contact would leave the course by more")
    ] = 0.02
    tolerance_deg: Annotated[
        Positive, Field(description="blocks are inserted where the roller axis would leave t x n by more")
    ] = 0.005
    kinematics: Annotated[
        Literal["roller", "published"],
        Field(description="roller: exact for a round roller; published: the 2008 paper's form"),
    ] = "roller"


class VerificationSettings(Section, title="Verification"):
    """What a program must keep; the emitted text is judged."""

    max_position_error_mm: Annotated[
        Positive, Field(description="contact off the course, normal to and along the surface")
    ] = 0.05
    max_roller_tilt_deg: Annotated[Positive, Field(description="roller axis out of the tangent plane")] = 0.05
    max_heading_error_deg: Annotated[Positive, Field(description="roller axis off square to the course")] = 0.05
    max_tape_error_mm: Annotated[Positive, Field(description="tape fed against arc length at the nip")] = 0.05
    max_cut_error_mm: Annotated[Positive, Field(description="knife off its cut line on the tape")] = 0.05
    max_blade_error_deg: Annotated[Positive, Field(description="blade off the direction of its cut")] = 0.05
    min_speed_share: Annotated[
        Positive | None,
        Field(description="share of the laid length at 95 % of the laying speed or more; without it not judged", le=1),
    ] = None
    max_stops_while_laying: Annotated[
        int | None,
        Field(description="stops of the tape while it is laid; without it not judged", ge=0, strict=True),
    ] = None


class LayOutputSettings(OutputSettings, title="Output"):
    """What comes out."""

    controller: Annotated[str, Field(description="name of a controller table, or the path of one", min_length=1)] = (
        "jb3208"
    )


class Setup(JobSetup):
    """Everything that a tape-laying job needs beside its courses."""

    # With the published form they are judged only then.
    MEANT_WHERE_SET = frozenset({("verification", "max_roller_tilt_deg"), ("verification", "max_heading_error_deg")})

    part: Annotated[PartSettings, Field(description="where the part lies in the machine")] = PartSettings()
    machine: Annotated[MachineSettings, Field(description="the machine, where it differs from its URDF")] = (
        MachineSettings()
    )
    tape: Annotated[TapeSettings, Field(description="the material")] = TapeSettings()
    head: Annotated[HeadSettings, Field(description="the tape head")] = HeadSettings()
    process: Annotated[ProcessSettings, Field(description="how the job is run")] = ProcessSettings()
    verification: Annotated[VerificationSettings, Field(description="what a program must keep")] = (
        VerificationSettings()
    )
    output: Annotated[LayOutputSettings, Field(description="what comes out")] = LayOutputSettings()

    def sha256(self, urdf: bytes) -> str:
        """Return the SHA-256 of the effective values in hexadecimal; the URDF counts by content, not by path.

        Args:
            urdf: the bytes of the URDF in use.
        """
        return self.digest({("machine", "urdf"): urdf})
