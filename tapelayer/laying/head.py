"""Head: the dimensions of the tape head that planning the tape needs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tapelayer.errors import BladesMeet, TapeWiderThanTravel
from tapelayer.laying.settings import Setup
from tapelayer.machines.machine import Machine
from tapelayer.motion.corners import Rule
from tapelayer.units import DEG, MM

# A sweep in passing at less than this share of the laying speed is not worth it: the tape stops for its ends instead.
LEAST_SWEEP = 0.8


@dataclass(frozen=True)
class RunUp:
    """What a knife needs to sweep while the tape goes on at speed: run-up, and blocks in which the speed is held.

    Attributes:
        lay_speed: of the tape, m/s.
        slide_speed: greatest speed of the slower slide, m/s.
        slide_acceleration: of the weaker slide, along its way, m/s2.
        tape_acceleration: of the axes that move the head, along the course, m/s2.
        longest: block that keeps the tolerances along the courses, metres.
        rule: how the control turns blocks into motion.
    """

    lay_speed: float
    slide_speed: float
    slide_acceleration: float
    tape_acceleration: float
    longest: float
    rule: Rule

    def speed(self, slope: float, width: float, room: float) -> float:
        """Return the greatest speed of the tape, m/s, at which a knife sweeps its width with the run-up that it needs.

        The block of a sweep from run-up to run-out is either one, or as many as the tolerances ask for.

        Args:
            slope: metres of slide per metre of tape.
            width: of the tape, metres.
            room: from the centre line to the end of the slide's travel, metres.
        """
        acceleration, share = self.acceleration(slope), self.rule.ramp_share
        most = min(self.lay_speed, self.slide_speed / slope)
        most = min(most, math.sqrt(2.0 * share * acceleration * max(room - width / 2.0, 0.0) / slope))
        across = width / slope
        whole = across + most**2 / (share * acceleration)
        pieces = math.ceil(whole / self.longest - 1e-9)
        if pieces <= 1:
            return min(most, self.held(whole, acceleration))
        single = math.sqrt(share * acceleration * max(self.longest - across, 0.0))
        return max(min(most, self.held(whole / pieces, acceleration)), min(most, single))

    def acceleration(self, slope: float) -> float:
        """Return the acceleration of the tape, m/s2, with a knife that moves `slope` metres per metre of tape."""
        return min(self.tape_acceleration, self.slide_acceleration / slope)

    def held(self, length: float, acceleration: float) -> float:
        """Return the speed, m/s, that the control holds through blocks of a length in metres at an acceleration."""
        return float(self.rule.held(np.array([length]), np.array([acceleration]))[0])


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
        run_up: what a slide needs to sweep at speed; None where the tape stops for every sweep's ends.
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
    run_up: RunUp | None = None

    @property
    def half_sweep(self) -> float:
        """Return the distance from the centre line to a sweep's start and end, in metres."""
        return self.tape_width / 2.0 + self.knife_clearance

    def sweep_speed(self, cot: float) -> float:
        """Return the speed of the tape, m/s, at which a knife sweeps in passing; 0 where the tape stops for it.

        Args:
            cot: cotangent of the cut's angle: metres of tape per metre of slide.
        """
        if self.run_up is None or cot == 0.0:
            return 0.0
        room = min(-self.travel_v[0], self.travel_v[1], -self.travel_q[0], self.travel_q[1])
        speed = self.run_up.speed(1.0 / abs(cot), self.tape_width, room)
        return speed if speed >= LEAST_SWEEP * self.run_up.lay_speed else 0.0

    def reach(self, cot: float) -> float:
        """Return the distance from the centre line to the start and end of a sweep, in metres, run-up included.

        Args:
            cot: as `sweep_speed`.
        """
        speed = self.sweep_speed(cot)
        if self.run_up is None or speed == 0.0:
            return self.half_sweep
        slope = 1.0 / abs(cot)
        ramp = speed**2 / (2.0 * self.run_up.rule.ramp_share * self.run_up.acceleration(slope))
        # Whole micrometres, which every control can write.
        return max(self.half_sweep, math.floor((self.tape_width / 2.0 + slope * ramp) * 1e6) / 1e6)


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


def head_of(setup: Setup, machine: Machine, rule: Rule, longest: float = math.inf) -> Head:
    """Return the tape head's dimensions: the knives' pitch and travel from the machine, the rest from the setup.

    Args:
        setup: the job's values.
        machine: the gantry, with the setup's limits already in it.
        rule: how the control passes from block to block, which decides what a knife's sweep needs to run up.
        longest: block that keeps the tolerances along the courses, metres.
    """
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
        run_up=_run_up(setup, machine, rule, longest),
    )


def _run_up(setup: Setup, machine: Machine, rule: Rule, longest: float) -> RunUp | None:
    """Return what a slide needs to sweep at speed; None where the control stops at every block's end."""
    slides = [machine.axis(name) for name in "vq"]
    if not rule.blends:
        return None
    return RunUp(
        lay_speed=setup.process.lay_speed_mm_per_s * MM,
        slide_speed=min(axis.speed for axis in slides),
        slide_acceleration=min(axis.acceleration for axis in slides),
        tape_acceleration=min(machine.axis(name).acceleration for name in "xyzu"),
        longest=longest,
        rule=rule,
    )
