"""Boundary files: closed lines in space, as text or as the polylines of a DXF; no other module knows these formats.

A text has a point `x y z` a line, its numbers between blanks, tabs, commas or semicolons, and comments behind `#`; a
blank line ends a closed line and begins the next. Every line is closed by itself, its first point may be repeated.
Of several lines in a file the one around the largest area is the boundary, the others are holes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.courses.table import LONGEST_LINE, NUMBER
from tapelayer.errors import InputFault, PlyRefused
from tapelayer.plies.ply import LEAST_POINTS, corners_of
from tapelayer.text import plain_text
from tapelayer.units import METRES, MM, Unit
from tapelayer.vectors import norms

# Faults after which more of them would add nothing.
MOST_FAULTS = 1000
# Ends of a DXF's lines as near as this are one point, and arcs are drawn as closely, in metres.
JOINED = 1e-5

_DXF = re.compile(rb"\A(?:\s*999[^\n]*\n[^\n]*\n)*\s*0\s*\n\s*SECTION\b|\AAutoCAD Binary DXF")
_SEPARATORS = re.compile(rb"[ \t]*[,;\t ][ \t]*")
_DECIMAL_COMMAS = re.compile(rb"[-+]?\d+,\d+(?:[;\t ]+[-+]?\d+,\d+){2}")
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
# The units that a DXF can state, by the number that stands for them in it.
_DXF_UNITS: dict[int, Unit] = {1: "in", 4: "mm", 5: "cm", 6: "m"}
_DXF_LINES = {"LWPOLYLINE", "POLYLINE", "LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"}


@dataclass(frozen=True, eq=False)
class Loop(Frozen):
    """A closed line in space.

    Attributes:
        points: (n, 3) metres, in the mould's frame; the first one is not repeated.
        lines: (n,) line of each in its file, 0 where there is none.
    """

    points: Floats
    lines: Ints

    @property
    def area(self) -> float:
        """Return the area that it encloses, in square metres, seen from where it looks largest.

        Examples:
            >>> corners = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
            >>> Loop(corners, np.zeros(4, dtype=np.int64)).area
            2.0
        """
        away = self.points - self.points[0]
        return float(np.linalg.norm(np.cross(away, np.roll(away, -1, axis=0)).sum(axis=0)) / 2)


def read_boundary(path: Path | str, unit: Unit = "mm") -> tuple[Loop, ...]:
    """Return the closed lines in a file, that around the largest area first.

    Args:
        path: the file.
        unit: of its numbers; a DXF may state another.

    Raises:
        PlyRefused: the file is missing, or as `parse_boundary`.
    """
    name = str(path)
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise PlyRefused.unreadable(name, error) from None
    return parse_boundary(data, name, unit)


def parse_boundary(data: bytes, name: str, unit: Unit = "mm") -> tuple[Loop, ...]:
    r"""Return the closed lines in the bytes of a file, that around the largest area first, the others in file order.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: of its numbers; a DXF may state another.

    Raises:
        PlyRefused: it is neither text nor DXF, or has lines that are not three finite numbers or closed lines of fewer
            than three points; all faults at once.

    Examples:
        >>> (loop,) = parse_boundary(b"# corners\n0 0 0\n1000, 0, 0\n1000; 500; 0\n0 0 0\n", "points.txt")
        >>> loop.points.tolist(), loop.lines.tolist()
        ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.5, 0.0]], [2, 3, 4])
    """
    loops = _of_dxf(data, name, unit) if is_dxf(data) else _of_text(data, name, unit)
    outer = max(range(len(loops)), key=lambda index: loops[index].area)
    return (loops[outer], *loops[:outer], *loops[outer + 1 :])


def is_dxf(data: bytes) -> bool:
    r"""Return whether bytes begin as those of a DXF do.

    Examples:
        >>> is_dxf(b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n"), is_dxf(b"0 0 0\n")
        (True, False)
    """
    return _DXF.match(data) is not None


def is_text_of_points(data: bytes) -> bool:
    r"""Return whether most lines of bytes, which may end within one, have three numbers and nothing else.

    Examples:
        >>> is_text_of_points(b"# corners\n0, 0, 0\n100, 0, 0\n100, 50"), is_text_of_points(b"0 1\n20 0.5\n30 0\n")
        (True, False)
    """
    lines = [content for line in data.split(b"\n") if (content := line.partition(b"#")[0].strip())]
    return 2 * sum(not isinstance(_point(line), str) for line in lines) > len(lines)


def loop_of(points: Sequence[Sequence[float]], metres: float, lines: Sequence[int] = ()) -> Loop:
    """Return a closed line of points, without those that repeat the one before them, the first one at the end too.

    Args:
        points: rows x, y, z.
        metres: in their unit.
        lines: line of each in its file.
    """
    kept = corners_of(points)
    rows = np.array([points[index] for index in kept], dtype=np.float64).reshape(-1, 3)
    return Loop(rows * metres, np.array([lines[index] if lines else 0 for index in kept], dtype=np.int64))


def _of_text(data: bytes, name: str, unit: Unit) -> list[Loop]:
    text = plain_text(data, name, PlyRefused)
    if control := _CONTROL.search(text):
        line = text.count(b"\n", 0, control.start()) + 1
        sentence = f"byte 0x{control[0][0]:02x} is not text; expected points x y z a line, or a DXF"
        raise PlyRefused(name, [InputFault(line, sentence)])
    faults: list[InputFault] = []
    loops = []
    for rows, lines in _paragraphs(text, faults):
        loop = loop_of(rows, METRES[unit], lines)
        if len(loop.points) < LEAST_POINTS:
            faults.append(InputFault(lines[0], _too_few(len(loop.points))))
        loops.append(loop)
    if not loops and not faults:
        faults.append(InputFault(0, "the file has no points; expected x y z a line"))
    if faults:
        raise PlyRefused(name, sorted(faults, key=lambda fault: fault.line))
    return loops


def _too_few(count: int) -> str:
    return f"the line has {count} point{'' if count == 1 else 's'}, expected at least {LEAST_POINTS}"


def _paragraphs(text: bytes, faults: list[InputFault]) -> Iterator[tuple[list[list[float]], list[int]]]:
    """Yield the points and line numbers of each closed line; lines that are no points go to the faults."""
    rows: list[list[float]] = []
    lines: list[int] = []
    broken = False
    for number, line in enumerate(text.split(b"\n"), 1):
        if len(faults) > MOST_FAULTS:
            return
        content = line.partition(b"#")[0].strip()
        if content:
            point = _point(content)
            if isinstance(point, str):
                faults.append(InputFault(number, point))
                broken = True
            else:
                rows.append(point)
                lines.append(number)
        elif not line.strip():
            # A closed line with a fault has too few points for this reason alone.
            if rows and not broken:
                yield rows, lines
            rows, lines, broken = [], [], False
    if rows and not broken:
        yield rows, lines


def _point(content: bytes) -> list[float] | str:
    """Return the numbers of a line, or what is wrong with it."""
    if len(content) > LONGEST_LINE:
        return f"the line has {len(content)} characters, expected three numbers x y z"
    words = _SEPARATORS.split(content)
    if len(words) == 3 and all(map(NUMBER.fullmatch, words)):
        point = [float(word) for word in words]
        if np.all(np.isfinite(point)):
            return point
    shown = repr(content[:40].decode("utf-8", "replace"))
    if _DECIMAL_COMMAS.fullmatch(content):
        return f"numbers have decimal commas, got {shown}; write decimal points"
    return f"expected three finite numbers x y z, got {shown}"


def _of_dxf(data: bytes, name: str, unit: Unit) -> list[Loop]:
    if find_spec("ezdxf") is None:
        sentence = "reading a DXF needs ezdxf: pip install 'tapelayer[cad]', or give the points as text, x y z a line"
        raise PlyRefused(name, [InputFault(0, sentence)])
    drawing = _drawing(data, name)
    metres = METRES[_DXF_UNITS.get(drawing.header.get("$INSUNITS", 0), unit)]
    chains = [np.asarray(chain, dtype=np.float64) * metres for chain in _chains(drawing, JOINED / metres)]
    if not chains:
        sentence = f"the DXF has no line in its model space; expected one of {', '.join(sorted(_DXF_LINES))}"
        raise PlyRefused(name, [InputFault(0, sentence)])
    loops, faults = [], []
    for chain in _joined(chains):
        loop = loop_of(chain.tolist(), 1.0)
        gap = float(np.linalg.norm(chain[-1] - chain[0]))
        if gap > JOINED and len(loop.points) > 1:
            begin, end = _at(chain[0]), _at(chain[-1])
            faults.append(InputFault(0, f"a line from {begin} to {end} is open by {gap / MM:.3g} mm; close it"))
        elif len(loop.points) < LEAST_POINTS:
            faults.append(InputFault(0, _too_few(len(loop.points))))
        loops.append(loop)
    if faults:
        raise PlyRefused(name, faults)
    return loops


def _drawing(data: bytes, name: str) -> Any:
    """Return the drawing that ezdxf reads."""
    ezdxf, recover = import_module("ezdxf"), import_module("ezdxf.recover")
    try:
        drawing, _ = recover.read(io.BytesIO(data))
    except (ezdxf.DXFError, OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise PlyRefused(name, [InputFault(0, f"the DXF is damaged: {reason}; save it again")]) from None
    return drawing


def _chains(drawing: Any, distance: float) -> Iterator[Floats]:
    """Yield the points (n, 3) of each line of a drawing; arcs within a distance, all in the drawing's unit."""
    for entity in drawing.modelspace():
        if entity.dxftype() in _DXF_LINES:
            yield from _drawn(entity, distance)


def _drawn(entity: Any, distance: float) -> Iterator[Floats]:
    """Yield the points (n, 3) of the lines that an entity of a drawing is made of."""
    kind = entity.dxftype()
    if kind in ("LWPOLYLINE", "POLYLINE") and entity.has_arc:
        for part in entity.virtual_entities():
            yield from _drawn(part, distance)
        return
    if kind == "LINE":
        points = [entity.dxf.start, entity.dxf.end]
    elif kind == "LWPOLYLINE":
        points = list(entity.vertices_in_wcs())
    elif kind == "POLYLINE":
        points = list(entity.points_in_wcs())
    else:
        round_one = kind in ("ARC", "CIRCLE")
        points = list(entity.flattening(min(distance, abs(entity.dxf.radius) / 4) if round_one else distance))
    closed = kind in ("LWPOLYLINE", "POLYLINE") and bool(entity.is_closed)
    if points:
        yield np.array([tuple(point) for point in [*points, *points[: int(closed)]]], dtype=np.float64)


def _joined(chains: list[Floats]) -> Iterator[Floats]:
    """Yield chains of points whose ends meet, put together until they are closed or nothing meets them."""
    left = list(chains)
    while left:
        chain = left.pop(0)
        while norms(chain[-1:] - chain[:1])[0] > JOINED:
            ends = np.array([[other[0], other[-1]] for other in left]).reshape(-1, 3)
            near = np.flatnonzero(norms(ends - chain[-1]) <= JOINED)
            if not len(near):
                break
            other = left.pop(int(near[0]) // 2)
            chain = np.vstack([chain, (other if near[0] % 2 == 0 else other[::-1])[1:]])
        yield chain


def _at(point: Floats) -> str:
    return "(" + ", ".join(f"{round(value / MM, 1) + 0.0:.1f}" for value in point) + ")"
