"""Arcs: runs of straight blocks on one circle, which one circular block can replace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from post.columns import Column
from post.controllers import Controller
from post.words import rounded
from tapelayer.arrays import Floats, Ints, Mask
from tapelayer.errors import NotWritable
from tapelayer.motion.trajectory import Kind, Trajectory

# Indices of each plane's axes: a counterclockwise arc turns from the first to the second; the third is constant.
PLANES = {"xy": (0, 1, 2), "zx": (2, 0, 1), "yz": (1, 2, 0)}
# Joints that must not move along an arc: those that turn the head.
FIXED = ("a", "c", "theta", "phi")
# Five points leave two that can contradict the circle; three always have one.
LEAST_BLOCKS = 4
# An arc with a smaller bulge is a line in practice; a centre farther away is meaningless.
LEAST_BULGE_MM = 0.05
STRAIGHTEST_MM = 1e7
# More than the sagitta of a planner's chords, so that a corner of long blocks is not an arc.
MOST_SAGITTA_MM = 0.05
# Largest distance at any time between the arc at constant speed and the blocks.
MOST_LEAD_MM = 0.1


@dataclass(frozen=True, eq=False)
class Found:
    """Runs of blocks that are arcs, in order, less than half a turn each.

    Attributes:
        firsts: (m,) first block of each.
        lasts: (m,) last block of each.
        planes: (m,) number of the plane: 0 XY, 1 ZX, 2 YZ.
        clockwise: (m,) sense, seen against the plane's third axis.
        centres: (m, 3) from the beginning along x, y, z in millimetres; 0 along the third axis.
    """

    firsts: Ints
    lasts: Ints
    planes: NDArray[np.uint8]
    clockwise: Mask
    centres: Floats


def find(
    points: Floats, others: Floats, times: Floats, able: Mask, joined: Mask, planes: Sequence[str], tolerance: float
) -> Found:
    """Return the arcs in a sequence of straight blocks.

    A run is an arc where its ends and, within `tolerance`, all points between lie on one circle in a plane, and where
    all other axes and the time change in proportion to the arc.

    Args:
        points: (n + 1, 3) x, y, z in millimetres at the start and after each block, as written.
        others: (n + 1, k) the other axes in written units.
        times: (n + 1,) seconds.
        able: (n,) blocks that may be part of an arc.
        joined: (n,) whether a block may share an arc with the block before.
        planes: names of the planes in which to look for arcs.
        tolerance: in millimetres, and in the written units of the other axes.
    """
    arcs: list[tuple[int, int, int, bool, Floats]] = []
    for plane in planes:
        first, second, third = PLANES[plane]
        flat = able & (points[1:, third] == points[:-1, third])
        path = np.column_stack([points[:, first], points[:, second]])
        bent = _bent(path, others, flat, joined, tolerance)
        block = 0
        while block < len(bent):
            block += int(np.argmax(bent[block:]))
            if not bent[block]:
                break
            # Every run of five points on an arc is itself bent, so the arc ends before the first run that is not.
            straight = np.flatnonzero(~bent[block:])[:1]
            most = block + (int(straight[0]) if len(straight) else len(bent) - block) + LEAST_BLOCKS - 2
            last, centre, bulge = _longest(path, others, times, block, most, tolerance)
            if bulge < LEAST_BULGE_MM:
                block = max(last, block) + 1
                continue
            offset = np.zeros(3)
            offset[[first, second]] = centre - path[block]
            begin, end = path[block] - centre, path[last + 1] - centre
            clockwise = bool(begin[0] * end[1] - begin[1] * end[0] < 0.0)
            arcs.append((block, last, list(PLANES).index(plane), clockwise, offset))
            block = last + 1
    arcs.sort(key=lambda arc: arc[0])
    return Found(
        firsts=np.array([arc[0] for arc in arcs], dtype=np.int64),
        lasts=np.array([arc[1] for arc in arcs], dtype=np.int64),
        planes=np.array([arc[2] for arc in arcs], dtype=np.uint8),
        clockwise=np.array([arc[3] for arc in arcs], dtype=bool),
        centres=np.array([arc[4] for arc in arcs]).reshape(-1, 3),
    )


def _bent(path: Floats, others: Floats, flat: Mask, joined: Mask, tolerance: float) -> Mask:
    """Return the blocks (n,) that with the next three have five points on one circle and move in proportion."""
    bent = np.zeros(len(flat), dtype=bool)
    begins = _windows(flat, joined)
    p = [path[begins + step] for step in range(LEAST_BLOCKS + 1)]
    good = np.ones(len(begins), dtype=bool)
    for point in (p[1], p[3]):
        good &= _off_circle(p[0], p[2], p[4], point) <= tolerance
    lengths = np.cumsum([np.hypot(*(p[step + 1] - p[step]).T) for step in range(LEAST_BLOCKS)], axis=0)
    # Without motion in the plane there is no circle, even if other axes move.
    moving = lengths[-1] > 0.0
    good &= moving
    whole = others[begins + LEAST_BLOCKS] - others[begins]
    for step in range(1, LEAST_BLOCKS):
        share = lengths[step - 1] / np.where(moving, lengths[-1], 1.0)
        good &= np.all(np.abs(others[begins + step] - others[begins] - share[:, None] * whole) <= tolerance, axis=1)
    bent[begins] = good
    return bent


def _windows(flat: Mask, joined: Mask) -> Ints:
    """Return the blocks that begin a run of `LEAST_BLOCKS`, the length of the shortest arc."""
    count = max(len(flat) - LEAST_BLOCKS + 1, 0)
    runs = flat[:count].copy()
    for ahead in range(1, LEAST_BLOCKS):
        runs &= (flat & joined)[ahead : ahead + count]
    return np.flatnonzero(runs)


def _off_circle(a: Floats, b: Floats, c: Floats, points: Floats) -> Floats:
    """Return the distances (m,) of points from the circles or lines through three points each."""
    ab, ac = b - a, c - a
    double = 2.0 * _cross(ab, ac)
    line = np.abs(double) < 1e-12
    squares_b, squares_c = np.sum(ab * ab, axis=1), np.sum(ac * ac, axis=1)
    divisor = np.where(line, 1.0, double)
    x = (ac[:, 1] * squares_b - ab[:, 1] * squares_c) / divisor
    y = (ab[:, 0] * squares_c - ac[:, 0] * squares_b) / divisor
    from_circle = np.abs(np.hypot(points[:, 0] - a[:, 0] - x, points[:, 1] - a[:, 1] - y) - np.hypot(x, y))
    from_line = np.abs(_cross(ac, points - a)) / np.maximum(np.sqrt(squares_c), 1e-12)
    distances: Floats = np.where(line, from_line, from_circle)
    return distances


def _cross(a: Floats, b: Floats) -> Floats:
    product: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product


def _longest(
    path: Floats, others: Floats, times: Floats, first: int, most: int, tolerance: float
) -> tuple[int, Floats, float]:
    """Return the last block, centre and bulge of the longest arc from a block to at most `most`; bulge 0 for none."""
    last, centre, bulge = first - 1, np.zeros(2), 0.0
    # Longer runs only add points that can miss the circle, so doubling and then bisecting finds its end.
    fitting, beyond = 0, most - first + 2
    blocks = min(LEAST_BLOCKS, beyond - 1)
    while LEAST_BLOCKS <= blocks and fitting < blocks < beyond:
        here = slice(first, first + blocks + 1)
        fits, at, height = _fits(path[here], others[here], times[here], tolerance)
        if fits:
            fitting, last, centre, bulge = blocks, first + blocks - 1, at, height
            blocks = min(2 * blocks, beyond - 1) if beyond == most - first + 2 else (fitting + beyond) // 2
        else:
            beyond = blocks
            blocks = (fitting + beyond) // 2
    return last, centre, bulge


def _fits(path: Floats, others: Floats, times: Floats, tolerance: float) -> tuple[bool, Floats, float]:
    """Return whether points (m, 2) are one arc or line through the first and last, its centre and bulge (line: 0)."""
    chord = path[-1] - path[0]
    length = float(np.hypot(*chord))
    if length == 0.0:
        return False, path[0], 0.0
    along, normal = chord / length, np.array([-chord[1], chord[0]]) / length
    # The centre lies on the chord's perpendicular bisector; its position there is a linear least-squares problem.
    off = path - (path[0] + path[-1]) / 2.0
    heights = off @ normal
    weight = float(heights @ heights)
    inner = np.sum(off * off, axis=1) - length * length / 4.0
    place = float(heights @ inner) / (2.0 * weight) if weight > 0.0 else 0.0
    if weight == 0.0 or abs(place) > STRAIGHTEST_MM:
        share, error, arc, bulge, centre = (off @ along) / length + 0.5, np.abs(heights), length, 0.0, path[0]
        bent = True
    else:
        centre = (path[0] + path[-1]) / 2.0 + place * normal
        spokes = path - centre
        radius = float(np.hypot(*spokes[0]))
        angles = np.unwrap(np.arctan2(spokes[:, 1], spokes[:, 0]))
        sweep = float(angles[-1] - angles[0])
        if sweep == 0.0:
            return False, centre, 0.0
        share, error, arc = (angles - angles[0]) / sweep, np.abs(np.hypot(*spokes.T) - radius), abs(sweep) * radius
        bulge = radius * (1.0 - np.cos(sweep / 2.0))
        chords = np.hypot(*np.diff(path, axis=0).T)
        bent = abs(sweep) < np.pi and bool(np.all(chords * chords <= 8.0 * radius * MOST_SAGITTA_MM))
    lead = (times - times[0]) / (times[-1] - times[0]) - share
    good = (
        bent
        and np.all(error <= tolerance)
        and np.all(np.diff(share) > 0.0)
        and np.all(np.abs(others - others[0] - share[:, None] * (others[-1] - others[0])) <= tolerance)
        and np.all(np.abs(lead) * arc <= MOST_LEAD_MM)
    )
    return bool(good), centre, bulge


def merged(trajectory: Trajectory, columns: list[Column], controller: Controller) -> tuple[Trajectory, list[Column]]:
    """Replace runs of straight blocks on one circle by single circular blocks.

    Without such runs, the arguments are returned unchanged.
    """
    place = {column.joint: column for column in columns}
    if not {"x", "y", "z"} <= set(place):
        return trajectory, columns
    able = (trajectory.kinds == Kind.LINEAR) & (trajectory.stated == 0)
    for column in columns:
        # An arc must not move a rotary axis, or an axis that the control does not interpolate.
        if column.axis.word or column.joint in FIXED:
            able &= ~column.moved
    joined = np.diff(trajectory.courses, prepend=-1) == 0
    flat = {plane: able & ~place["xyz"[third]].moved for plane, (_, _, third) in PLANES.items()}
    planes = [plane for plane in controller.arcs.planes if len(_windows(flat[plane], joined))]
    if not planes:
        return trajectory, columns
    count = len(trajectory)
    runs = find(
        points=np.column_stack([place[joint].numbers / 10.0 ** place[joint].axis.decimals for joint in "xyz"]),
        others=np.column_stack(
            [column.numbers / 10.0**column.axis.decimals for column in columns if column.joint not in ("x", "y", "z")]
        ),
        times=np.concatenate([[0.0], np.cumsum(trajectory.requested)]),
        able=able,
        joined=joined,
        planes=planes,
        tolerance=controller.arcs.tolerance_mm,
    )
    if not len(runs.firsts):
        return trajectory, columns
    inside = np.zeros(count + 1, dtype=np.int64)
    inside[runs.firsts] += 1
    inside[runs.lasts] -= 1
    kept = np.cumsum(inside)[:count] == 0
    totals = np.concatenate([[0.0], np.cumsum(trajectory.requested)])
    durations, kinds = trajectory.requested.copy(), trajectory.kinds.copy()
    durations[runs.lasts] = totals[runs.lasts + 1] - totals[runs.firsts]
    kinds[runs.lasts] = np.where(runs.clockwise, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)
    plane_of = np.zeros(count, np.uint8) if trajectory.planes is None else trajectory.planes.copy()
    centres = np.full((count, 3), np.nan) if trajectory.centres is None else trajectory.centres.copy()
    plane_of[runs.lasts] = runs.planes
    begins = np.column_stack([place[joint].numbers[runs.firsts] for joint in "xyz"])
    scales = np.array([10.0 ** place[joint].axis.decimals for joint in "xyz"])
    centres[runs.lasts] = (begins / scales + runs.centres) / 1e3
    whole = Trajectory(
        axes=trajectory.axes,
        start=trajectory.start,
        positions=trajectory.positions[kept],
        kinds=kinds[kept],
        durations=durations[kept],
        events=trajectory.events[kept],
        courses=trajectory.courses[kept],
        stated=trajectory.stated[kept],
        lines=trajectory.lines[kept],
        centres=centres[kept],
        planes=plane_of[kept],
        tolerances=trajectory.tolerances[kept],
    )
    circular = np.zeros(count, dtype=bool)
    circular[runs.lasts] = True
    merged_columns = []
    for column in columns:
        numbers = column.numbers[np.append(True, kept)]
        written = np.where(circular[kept], numbers[1:] != numbers[:-1], column.written[kept])
        merged_columns.append(replace(column, numbers=numbers, written=written))
    return whole, merged_columns


@dataclass(frozen=True, eq=False)
class Circles:
    """Circular blocks.

    Attributes:
        of_block: (n,) number of the circle of each block, -1 where it is straight.
        axes: (m, 2) indices into x, y, z of the plane's first and second axis.
        planes: (m,) number of the plane.
        offsets: (m, 3) centre from the beginning along x, y, z in units of their last decimals.
        lengths: (m,) of the arcs in millimetres.
        clockwise: (m,) sense, seen against the plane's third axis.
    """

    of_block: Ints
    axes: Ints
    planes: Ints
    offsets: Ints
    lengths: Floats
    clockwise: Mask


def circles(trajectory: Trajectory, columns: Sequence[Column]) -> Circles:
    """Return the circular blocks, computed from their rounded ends and their given centres."""
    blocks = np.flatnonzero(np.isin(trajectory.kinds, (Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE)))
    of_block = np.full(len(trajectory) + 1, -1)
    of_block[blocks] = np.arange(len(blocks))
    if not len(blocks):
        return Circles(
            of_block, np.empty((0, 2), np.int64), blocks, np.empty((0, 3), np.int64), np.empty(0), blocks > 0
        )
    if trajectory.centres is None or trajectory.planes is None:
        raise NotWritable(f"block {blocks[0]}: a circular block without a centre")
    xyz = [next(column for column in columns if column.joint == joint) for joint in "xyz"]
    scales = np.array([10.0**column.axis.decimals for column in xyz])
    begins = np.column_stack([column.numbers[blocks] for column in xyz]) / scales
    ends = np.column_stack([column.numbers[blocks + 1] for column in xyz]) / scales
    planes = trajectory.planes[blocks].astype(np.int64)
    axes = np.array([pair[:2] for pair in PLANES.values()])[planes]
    rows = np.arange(len(blocks))[:, None]
    offsets = np.zeros((len(blocks), 3), dtype=np.int64)
    wanted = trajectory.centres[blocks] * 1e3 - begins
    for index, column in enumerate(xyz):
        here = np.flatnonzero(np.any(axes == index, axis=1))
        offsets[here, index] = rounded(wanted[here, index], column.axis.decimals)
    centres = (offsets / scales)[rows, axes]
    from_centre, to_centre = -centres, (ends - begins)[rows, axes] - centres
    cross = from_centre[:, 0] * to_centre[:, 1] - from_centre[:, 1] * to_centre[:, 0]
    turned = np.arctan2(cross, np.sum(from_centre * to_centre, axis=1))
    clockwise = trajectory.kinds[blocks] == Kind.CLOCKWISE
    sense = np.where(clockwise, -1.0, 1.0)
    radii = (np.hypot(*from_centre.T) + np.hypot(*to_centre.T)) / 2.0
    return Circles(of_block, axes, planes, offsets, (turned * sense) % (2.0 * np.pi) * radii, clockwise)
