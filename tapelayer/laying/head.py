"""Head: the dimensions of the tape head that planning the tape needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.errors import BladesMeet, TapeWiderThanTravel
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.units import DEG, MM


@dataclass(frozen=True)
class Head:
    """The tape head's dimensions, in metres and radians.

    Attributes:
        tape_width: width of the tape.
        knife_to_nip: tape path from knife 1 to the nip on a level surface.
        knife_pitch: distance of knife 2 upstream of knife 1.
        knife_clearance: how far a sweep runs beyond both edges of the tape.
        scrap_margin: least waste between two cuts that are not shared.
        blade_length: least distance between the two blades.
        travel_v: lower and upper end of knife 1's slide, left positive.
        travel_q: lower and upper end of knife 2's slide, left positive.
        minimum_cut_angle: least angle between a cut and the tape's edge.
        roll_length: tape on one roll.
    """

    tape_width: float
    knife_to_nip: float
    knife_pitch: float
    knife_clearance: float
    scrap_margin: float
    blade_length: float
    travel_v: tuple[float, float]
    travel_q: tuple[float, float]
    minimum_cut_angle: float
    roll_length: float

    @property
    def half_sweep(self) -> float:
        """Return the distance from the centre line to a sweep's start and end, in metres."""
        return self.tape_width / 2.0 + self.knife_clearance


def check_head(head: Head) -> None:
    """Refuse a head whose knives cannot cross the tape or whose blades would meet.

    Raises:
        TapeWiderThanTravel: a sweep needs more than a slide's travel.
        BladesMeet: the knives are closer together than their blades are long.
    """
    half = head.half_sweep
    for axis, knife, (lower, upper) in (("v", 1, head.travel_v), ("q", 2, head.travel_q)):
        if not (lower <= -half and half <= upper):
            widest = max(0.0, 2e3 * (min(-lower, upper) - head.knife_clearance))
            raise TapeWiderThanTravel(
                f"tape of {head.tape_width * 1e3:g} mm needs knife {knife} (axis {axis}) from {-half * 1e3:g} to "
                f"{half * 1e3:g} mm, {head.knife_clearance * 1e3:g} mm beyond both edges, but it travels from "
                f"{lower * 1e3:g} to {upper * 1e3:g} mm; the widest tape is {widest:g} mm"
            )
    if not head.blade_length <= head.knife_pitch:
        raise BladesMeet(
            f"blades of {head.blade_length * 1e3:g} mm would meet, as the knives pass each other at "
            f"{head.knife_pitch * 1e3:g} mm; blade_length_mm must not be more"
        )


def head_of(setup: Setup, machine: Machine) -> Head:
    """Return the tape head's dimensions: the knives' pitch and travel from the machine, the rest from the setup."""
    origins = machine.forward_all(np.zeros((1, len(machine.axes))), ("knife_1", "knife_2", "tape"))
    apart = origins["knife_1"][0, :3, 3] - origins["knife_2"][0, :3, 3]
    v, q = machine.axis("v"), machine.axis("q")
    return Head(
        tape_width=setup.tape.width_mm * MM,
        knife_to_nip=setup.head.knife_to_nip_mm * MM,
        knife_pitch=float(apart @ origins["tape"][0, :3, 0]),
        knife_clearance=setup.head.knife_clearance_mm * MM,
        scrap_margin=setup.head.scrap_margin_mm * MM,
        blade_length=setup.head.blade_length_mm * MM,
        travel_v=(v.lower, v.upper),
        travel_q=(q.lower, q.upper),
        minimum_cut_angle=setup.head.minimum_cut_angle_deg * DEG,
        roll_length=setup.tape.roll_length_m,
    )
