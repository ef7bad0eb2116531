"""Part size: whether a part measures what a machine works on, or was read in another unit than its file's."""

from __future__ import annotations

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.errors import InputFault, InputRefused
from tapelayer.machines.machine import Machine
from tapelayer.units import METRES, MM, Unit

# A part that has more than this many times the longest travel is no part for the machine, even placed aside.
MOST_TRAVELS = 4.0


def check_size(
    points: Floats, unit: Unit, machine: Machine, least: tuple[str, float], name: str, refused: type[InputRefused]
) -> None:
    """Refuse a part that is smaller than what the machine lays or sprays, or far larger than its travel.

    Args:
        points: (n, 3) of the part, metres.
        unit: in which its file was read.
        machine: with an x, a y and a z axis.
        least: what a part must not be smaller than: its name with the article, and its size in metres.
        name: the file as the user named it.
        refused: error to raise with the fault.

    Raises:
        InputRefused: `refused`, with the part's size in every unit and those that fit the machine.
    """
    sides = np.max(points, axis=0) - np.min(points, axis=0)
    largest = float(np.max(sides))
    travel = max(axis.upper - axis.lower for axis in (machine.axis(name) for name in "xyz"))
    if largest < least[1]:
        doubt = f"less than {least[0]} of {least[1] / MM:g} mm"
    elif largest > MOST_TRAVELS * travel:
        doubt = f"far more than the machine's travel of {travel:g} m"
    else:
        return
    others = {other: METRES[other] / METRES[unit] for other in METRES if other != unit}
    sizes = ", ".join(f"as {other} {_size(sides * factor)}" for other, factor in others.items())
    fitting = [other for other, factor in others.items() if least[1] <= largest * factor <= travel]
    advice = f"give --unit {' or --unit '.join(fitting)}" if fitting else "none fits: is it damaged, or the wrong file?"
    raise refused(
        name,
        [
            InputFault(
                0, f"the part measures {_size(sides)}, {doubt}: is its unit {unit}? It would be {sizes}; {advice}"
            )
        ],
    )


def _size(sides: Floats) -> str:
    """Return the sides (3,) of a part in metres as words.

    Examples:
        >>> _size(np.array([0.3, 0.2, 0.0])), _size(np.array([300.0, 200.0, 10.25]))
        ('300 x 200 x 0 mm', '300 x 200 x 10.2 m')
    """
    scale, unit = (1.0, "m") if np.max(sides) >= 10.0 else (MM, "mm")
    return (
        " x ".join(f"{side / scale:.3g}" if side < 1000 * scale else f"{side / scale:.0f}" for side in sides)
        + f" {unit}"
    )
