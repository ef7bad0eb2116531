"""There and back: poses on a cylinder to axis values, and forward again, once more by Pinocchio itself.

.venv/bin/python examples/forward_inverse.py [FOLDER]
"""

import sys
import tempfile
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import tostring

import numpy as np

from tapelayer import Machine, inverse
from tapelayer.reporting.drawing import Panel, PlotCurve, element, heading_of, range_of, svg


def main() -> None:
    """Roll round a cylinder of 2 m radius at 30 degrees to its axis, and plot the two angles of the head."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)

    # (n, 3) in `machine` axes, metres; the cylinder lies along y, the course climbs and falls with its slope.
    slope = np.radians(np.linspace(-25.0, 25.0, 201))
    zero, one = np.zeros_like(slope), np.ones_like(slope)
    normals = np.column_stack([np.sin(slope), zero, np.cos(slope)])
    tangents = np.column_stack([np.cos(slope), one * np.tan(np.radians(60.0)), -np.sin(slope)])
    points = 2.0 * normals + np.column_stack([one * 1.2, slope * 2.0 * np.tan(np.radians(60.0)), one * -3.1])

    machine = Machine.load()
    forwards, _ = inverse(machine, points, normals, tangents)
    q = np.zeros((len(points), len(machine.axes)))
    q[:, :5] = forwards  # x, y, z, c, a; the tape and the knives stay where they are
    poses = machine.forward(q, "roller")
    radius = 0.04  # the centre of the roller stands one radius above the surface, along the normal
    off = np.max(np.abs(poses[:, :3, 3] - (points + radius * normals)))
    apart = np.max(np.abs(poses - machine.forward_pinocchio(q, "roller")))
    print(f"roller off its place: {off:.1e} m")
    print(f"batch evaluator against Pinocchio: {apart:.1e}")

    angles = np.degrees(forwards[:, 3:])
    curves = [PlotCurve(style, np.degrees(slope), angles[:, i]) for i, style in enumerate(("first", "second"))]
    panel = Panel(60, 30, 600, 240, (-25.0, 25.0), range_of(curves, []))
    heading = heading_of(("c", "first"), (" and ", ""), ("a", "second"), (", deg, over the slope, deg", ""))
    style = element("style", files("tapelayer.reporting").joinpath("page.css").read_text(encoding="utf-8"))
    plot = svg(680, 310, style, *panel.drawn(heading, curves, []), label="c and a over the slope")
    plot.set("xmlns", "http://www.w3.org/2000/svg")
    (folder / "angles.svg").write_bytes(tostring(plot))
    print(f"open {folder / 'angles.svg'} to see the angles")


if __name__ == "__main__":
    main()
