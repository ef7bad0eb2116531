"""STL files, binary and ASCII: bytes to meshes; no other module knows the format."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats, Mask
from tapelayer.errors import InputFault, MeshRefused
from tapelayer.geometry.mending import RESOLUTION, mended
from tapelayer.geometry.mesh import Mesh
from tapelayer.text import plain_text
from tapelayer.units import METRES, Unit
from tapelayer.vectors import norms

FARTHEST = 1e6  # from the origin, in the file's unit: single precision leaves no shape there in any

HEADER_BYTES = 80
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
FACET_WORDS = (
    *(b"facet", b"normal", None, None, None, b"outer", b"loop"),
    *(b"vertex", None, None, None) * 3,
    *(b"endloop", b"endfacet"),
)
_TEXT = re.compile(rb"[\s -~]*")
_BEGIN = 4096  # bytes in which an ASCII file must begin
CORNER_COLUMNS = (8, 9, 10, 12, 13, 14, 16, 17, 18)
# A solid's name may hold any words; it ends with its line or, in a file without lines, before a facet or another solid.
_FACET = rb"\s{1,99}facet\s+normal\s+[-+.\dni]"
_SOLID = re.compile(
    rb"solid(?!\S)(?:(?<!\Ssolid)[^\n]*?(?=\n|\Z|%b)"
    rb"|(?<=endsolid)(?<!\Sendsolid)[^\n]*?(?=\n|\Z|%b|\ssolid(?=\s)[^\n]{0,200}?%b))" % (_FACET, _FACET, _FACET)
)


def parse_stl(data: bytes, name: str, unit: Unit = "mm") -> Mesh:
    r"""Return a mended mesh from the bytes of a binary or ASCII STL file.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: unit of its numbers; STL does not state one.

    Raises:
        MeshRefused: the file is empty, cut short or not STL, has corners that are not finite numbers or far from
            any part, or has no facet left after mending.

    Examples:
        >>> corners = "vertex 0 0 0 vertex 1000 0 0 vertex 0 1000 0"
        >>> text = f"solid part\nfacet normal 0 0 1 outer loop {corners} endloop endfacet\nendsolid part"
        >>> mesh = parse_stl(text.encode(), "part.stl", "mm")
        >>> mesh.vertices.tolist(), mesh.areas.tolist()
        ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0.5])
    """
    triangles, ignored = _triangles(name, data)
    wrong = np.flatnonzero(~np.all(np.isfinite(triangles), axis=(1, 2)))
    if len(wrong):
        count = f"{len(wrong)} of {len(triangles)} facets have" if len(wrong) > 1 else "a facet has"
        raise _refused(name, f"{count} corners that are no finite numbers, first facet {wrong[0] + 1}; export it again")
    distances = np.max(np.abs(triangles), axis=(1, 2))
    far = np.flatnonzero(distances > FARTHEST)
    if len(far):
        raise _refused(
            name,
            f"{f'{len(far)} of {len(triangles)} facets have corners' if len(far) > 1 else 'a facet has a corner'} "
            f"{distances[far[0]]:.3g} {unit} from the origin, expected at most {FARTHEST:g} {unit}, "
            f"first facet {far[0] + 1}: it is damaged; export it again",
        )
    triangles = triangles * METRES[unit]
    vertices, facets, mending = mended(triangles)
    if not len(facets):
        raise _refused(name, f"no facet is left: all {len(triangles)} are without area; export it again")
    return Mesh(
        vertices=vertices,
        facets=facets,
        name=Path(name).name,
        sha256=hashlib.sha256(data).hexdigest(),
        unit=unit,
        mending=replace(mending, bytes_ignored=ignored),
    )


def _triangles(name: str, data: bytes) -> tuple[Floats, int]:
    """Return the corners (m, 3, 3) in the file's unit, and the number of bytes after a binary file's last facet."""
    if not data:
        raise _refused(name, "the file is empty")
    count = int.from_bytes(data[HEADER_BYTES : HEADER_BYTES + 4], "little")
    expected = HEADER_BYTES + 4 + count * RECORD.itemsize
    if len(data) != expected:
        text = plain_text(data, name, MeshRefused)
        if b"\0" not in text[:1024]:
            return _ascii_triangles(name, text), 0
    if len(data) < HEADER_BYTES + 4:
        raise _refused(
            name, f"the file has {len(data)} bytes, expected a header of {HEADER_BYTES + 4}: it is cut short"
        )
    if len(data) < expected:
        raise _refused(
            name,
            f"a binary STL of {count} facets has {expected} bytes, got {len(data)}: it is cut short; export it again",
        )
    if not count:
        raise _refused(name, f"the header counts no facets, and {len(data) - expected} bytes follow; export it again")
    triangles = _corners(data, HEADER_BYTES + 4, count)
    further = _corners(data, expected, (len(data) - expected) // RECORD.itemsize)
    if not _TEXT.fullmatch(data, expected) and np.any(_of_one_part(further, triangles)):
        raise _refused(name, f"the header counts {count} facets, and {len(further)} more follow them; export it again")
    return triangles, len(data) - expected


def _corners(data: bytes, offset: int, count: int) -> Floats:
    """Return the corners (count, 3, 3) of binary records, in the file's unit."""
    records = np.frombuffer(data, dtype=RECORD, count=count, offset=offset)
    # A cast of a signalling NaN is an invalid operation, of which the caller makes a refusal.
    with np.errstate(invalid="ignore"):
        return records["corners"].astype(np.float64)


def _of_one_part(further: Floats, triangles: Floats) -> Mask:
    """Return whether each of the triangles (k, 3, 3) after the last one may be a facet of the same part.

    Padding, read as numbers, has no area or lies far off.
    """
    known = triangles[np.all(np.isfinite(triangles), axis=(1, 2))].reshape(-1, 3)
    if not len(known):
        return np.zeros(len(further), dtype=np.bool_)
    low, high = known.min(axis=0), known.max(axis=0)
    size = float(np.max(high - low))
    near: Mask = np.all((further >= low - size) & (further <= high + size), axis=(1, 2))
    first, second = (further[:, corner] - further[:, 0] for corner in (1, 2))
    near[near] = norms(np.cross(first[near], second[near])) > (RESOLUTION * size) ** 2
    return near


def _ascii_triangles(name: str, text: bytes) -> Floats:
    """Return the corners (m, 3, 3) in the file's unit."""
    if not text[:_BEGIN].lstrip().lower().startswith(b"solid"):
        begin = text.strip()[:40].partition(b"\n")[0].decode("utf-8", "replace")
        raise _refused(name, f"this is no STL file, it begins with {begin!r}; export the part as STL")
    text, begun, ended = _without_names(text.lower())
    words = text.split()
    facets = len(words) // len(FACET_WORDS)
    columns = [words[column :: len(FACET_WORDS)] for column in range(len(FACET_WORDS))]
    in_place = (column.count(word) == facets for word, column in zip(FACET_WORDS, columns, strict=True) if word)
    if len(words) % len(FACET_WORDS) or not all(in_place):
        raise MeshRefused(name, [_ascii_fault(text)])
    if not facets:
        raise _refused(name, "the file holds no facets")
    if begun != ended:
        line = len(text.splitlines())
        raise _refused(name, "the file ends without endsolid: it is cut short; export it again", line)
    try:
        numbers = np.array([columns[column] for column in CORNER_COLUMNS]).astype(np.float64)
    except ValueError as error:
        raise MeshRefused(name, [_ascii_fault(text)]) from error
    return numbers.T.reshape(-1, 3, 3)


def _without_names(text: bytes) -> tuple[bytes, int, int]:
    """Return a text in lower case without the words solid and endsolid and the names after them, and their numbers."""
    parts, at, ended = [], 0, 0
    for match in _SOLID.finditer(text):
        end = text.endswith(b"end", 0, match.start())
        parts.append(text[at : match.start() - 3 * end])
        at, ended = match.end(), ended + end
    return b"".join([*parts, text[at:]]), len(parts) - ended, ended


def _ascii_fault(text: bytes) -> InputFault:
    """Return the fault of the first word out of place in an ASCII STL's facets."""
    for position, word in enumerate(re.finditer(rb"\S+", text)):
        column = position % len(FACET_WORDS)
        expected, got = FACET_WORDS[column], word.group()
        if expected not in (None, got) or (column in CORNER_COLUMNS and not _is_number(got)):
            wanted = expected.decode() if expected else "a number"
            line = text.count(b"\n", 0, word.start()) + 1
            facet = position // len(FACET_WORDS) + 1
            shown, reason = got.decode("utf-8", "replace")[:40], _separator(got)
            return InputFault(
                line,
                f"expected {wanted}, got {shown!r} in facet {facet}{f': {reason}' if reason else ''}; export it again",
            )
    facet = len(text.split()) // len(FACET_WORDS) + 1
    return InputFault(len(text.splitlines()), f"the file ends inside facet {facet}: it is cut short; export it again")


def _separator(word: bytes) -> str:
    """Return what a word with commas or semicolons says of its file; empty for any other word."""
    if re.fullmatch(rb"[-+]?\d+,\d+(e[-+]?\d+)?", word):
        return "the file has decimal commas, STL has decimal points"
    for sign, signs in ((b",", "commas"), (b";", "semicolons")):
        if sign in word and all(_is_number(part) for part in word.strip(sign).split(sign)):
            return f"the numbers are separated by {signs}, STL has blanks"
    return ""


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _refused(name: str, sentence: str, line: int = 0) -> MeshRefused:
    return MeshRefused(name, [InputFault(line, sentence)])
