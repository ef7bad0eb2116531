"""The tape head of the examples."""

from __future__ import annotations

import math

from tapelayer.laying.head import Head

HEAD = Head(
    tape_width=0.3,
    knife_to_nip=0.35,
    knife_pitch=0.1,
    knife_clearance=0.01,
    scrap_margin=0.005,
    blade_length=0.02,
    travel_v=(-0.2, 0.2),
    travel_q=(-0.2, 0.2),
    minimum_cut_angle=math.radians(15.0),
    roll_length=150.0,
)
