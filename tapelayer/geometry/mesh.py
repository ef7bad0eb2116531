"""Mesh: a part's surface as facets, read from STL and mended, or refused with the reason.

Corners that are equal to the last bit are one vertex. What a gun can spray depends on facet normals, so a facet without
a sure normal does not stay in the mesh.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csgraph

from tapelayer.arrays import Floats, Ints, Mask, frozen
from tapelayer.errors import Fault, MeshRefused

Unit = Literal["mm", "m", "in"]

METRES: dict[Unit, float] = {"mm": 1e-3, "m": 1.0, "in": 0.0254}
LARGEST_SIDE = 1000.0  # metres; beyond it, it is a damaged file or a wrong unit and no part
RESOLUTION = 2.0**-23  # of an STL's single-precision numbers, relative to the largest of them

BLOCK = 16384  # rows

HEADER_BYTES = 80
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
FACET_WORDS = (
    *(b"facet", b"normal", None, None, None, b"outer", b"loop"),
    *(b"vertex", None, None, None) * 3,
    *(b"endloop", b"endfacet"),
)
CORNER_COLUMNS = (8, 9, 10, 12, 13, 14, 16, 17, 18)
NAME_LINE = re.compile(rb"^[ \t]*(?:end)?solid\b[^\r\n]*", re.MULTILINE)


@dataclass(frozen=True)
class Mending:
    """What was mended in a mesh, and what was left as it is.

    Attributes:
        facets_read: facets in the file.
        bytes_ignored: bytes after the last facet of a binary file.
        degenerate_facets: facets that were dropped because they have a corner twice, or are thinner than the file's
            numbers resolve and had no neighbour to share the place with.
        dissolved_facets: facets as thin that share their place with a neighbour by a swap of the edge between them.
        duplicate_facets: facets with the corners of another one that were dropped.
        flipped_facets: facets whose winding was turned to agree with their neighbours'.
        open_edges: edges of a single facet.
        nonmanifold_edges: edges of three facets or more.
        seam_edges: edges of two facets that no winding makes agree.
    """

    facets_read: int
    bytes_ignored: int = 0
    degenerate_facets: int = 0
    dissolved_facets: int = 0
    duplicate_facets: int = 0
    flipped_facets: int = 0
    open_edges: int = 0
    nonmanifold_edges: int = 0
    seam_edges: int = 0


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangular facets.

    Attributes:
        vertices: (n, 3) metres, in the frame of the file.
        facets: (m, 3) vertex indices; counterclockwise seen from the side the normal points to.
        name: base name of the file.
        sha256: SHA-256 of the file's bytes, hexadecimal.
        unit: unit of the file's numbers.
        mending: what was mended.
    """

    vertices: Floats
    facets: Ints
    name: str
    sha256: str
    unit: Unit
    mending: Mending

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "vertices", frozen(self.vertices))
        object.__setattr__(self, "facets", frozen(self.facets))

    @cached_property
    def normals(self) -> Floats:
        """Unit normals (m, 3) of the facets, by their winding."""
        normals = np.empty(self.facets.shape)
        for block in blocks(len(normals)):
            spans = _spans(self.vertices, self.facets[block])
            normals[block] = spans / np.sqrt(_squares(spans))[:, None]
        return frozen(normals)

    @cached_property
    def upward_normals(self) -> Floats:
        """Unit normals (m, 3) of the facets on their upper side, nz >= 0, whatever the winding."""
        return frozen(np.where(self.normals[:, 2:] < 0, -self.normals, self.normals))

    @cached_property
    def areas(self) -> Floats:
        """Areas (m,) of the facets in square metres."""
        areas = np.empty(len(self.facets))
        for block in blocks(len(areas)):
            areas[block] = np.sqrt(_squares(_spans(self.vertices, self.facets[block]))) / 2
        return frozen(areas)

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """Facet (m, 3) across the edge from each corner to the next, or -1: see `neighbours`."""
        return frozen(neighbours(self.facets, len(self.vertices)))


def blocks(count: int) -> Iterator[slice]:
    """Consecutive rows, block by block; what is computed of one at a time stays in the cache."""
    for begin in range(0, count, BLOCK):
        yield slice(begin, min(begin + BLOCK, count))


def read_mesh(path: Path, unit: Unit = "mm", spot: float = 0.0) -> Mesh:
    """Mesh from a binary or ASCII STL file, mended.

    Args:
        path: the file.
        unit: unit of its numbers; STL does not state one.
        spot: diameter of the spot in metres: a part smaller than it is taken for one in another unit.

    Raises:
        MeshRefused: the file is missing, or as `parse_mesh`.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshRefused.unreadable(str(path), error) from None
    return parse_mesh(data, str(path), unit, spot)


def parse_mesh(data: bytes, name: str, unit: Unit = "mm", spot: float = 0.0) -> Mesh:
    """Mesh from the bytes of a binary or ASCII STL file, mended.

    Args:
        data: the file's bytes.
        name: the file as the user named it, for messages.
        unit: unit of its numbers; STL does not state one.
        spot: diameter of the spot in metres: a part smaller than it is taken for one in another unit.

    Raises:
        MeshRefused: the file is empty, cut short or no STL, has corners that are no finite numbers, or nothing is left
            of it to work on.
    """
    triangles, ignored = _triangles(name, data)
    wrong = np.flatnonzero(~np.all(np.isfinite(triangles), axis=(1, 2)))
    if len(wrong):
        count = f"{len(wrong)} of {len(triangles)} facets have" if len(wrong) > 1 else "a facet has"
        raise _refused(name, f"{count} corners that are no finite numbers, first facet {wrong[0] + 1}; export it again")
    triangles = triangles * METRES[unit]
    sides = np.ptp(triangles.reshape(-1, 3), axis=0)
    if sides.max() < spot:
        raise _refused(
            name,
            f"the part's largest side is {sides.max() * 1e3:.3g} mm, less than the spot of {spot * 1e3:g} mm; "
            f"if the file is not in {unit}, say so: --unit {'m' if unit != 'm' else 'mm'}",
        )
    if sides.max() > LARGEST_SIDE:
        raise _refused(
            name,
            f"the part's largest side is {sides.max():.3g} m, expected at most {LARGEST_SIDE:g} m; "
            f"if the file is not in {unit}, say so: --unit {'mm' if unit != 'mm' else 'in'}",
        )
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


def mended(triangles: Floats) -> tuple[Floats, Ints, Mending]:
    """Vertices (n, 3) and facets (k, 3) of loose triangles, with what was mended.

    Args:
        triangles: (m, 3, 3) finite corners in metres.
    """
    vertices, facets = _merged(triangles.reshape(-1, 3))
    whole = np.all(facets != np.roll(facets, 1, axis=1), axis=1)
    facets, duplicates = _without_duplicates(facets[whole], len(vertices))
    facets, flipped = _wound(facets, len(vertices))
    facets, dissolved, thin = _without_thin(vertices, facets)
    if dissolved or thin:
        # Other facets meet now.
        facets, doubled = _without_duplicates(facets, len(vertices))
        facets, turned = _wound(facets, len(vertices))
        duplicates, flipped = duplicates + doubled, flipped + turned
    used, facets = np.unique(facets, return_inverse=True)
    facets = facets.reshape(-1, 3)
    sizes, forward = _edge_sizes(facets, len(used))
    mending = Mending(
        facets_read=len(triangles),
        degenerate_facets=int(np.sum(~whole)) + thin,
        dissolved_facets=dissolved,
        duplicate_facets=duplicates,
        flipped_facets=flipped,
        open_edges=int(np.sum(sizes == 1)),
        nonmanifold_edges=int(np.sum(sizes > 2)),
        seam_edges=int(np.sum((sizes == 2) & (forward != 1))),
    )
    return vertices[used], facets, mending


def neighbours(facets: Ints, vertex_count: int) -> NDArray[np.int32]:
    """Facet (m, 3) across the edge from each corner to the next, or -1 where there is none.

    Neighbours run along their edge in opposite directions. Where more than two facets meet, the last of one direction
    and the first of the other in facet order are neighbours, then the next two outwards; what is left over has none.

    Args:
        facets: (m, 3) vertex indices, no vertex twice in a facet.
        vertex_count: number of vertices.
    """
    order, first, forward = _half_edges(facets, vertex_count)
    across = np.full(len(order), -1, dtype=np.int32)
    right = np.flatnonzero(~first[1:-1] & forward[:-1] & ~forward[1:]) + 1
    left = right - 1
    while len(right):
        one, other = order.take(left), order.take(right)
        across[one], across[other] = other // 3, one // 3
        more = ~(first.take(left) | first.take(right + 1))
        left, right = left[more] - 1, right[more] + 1
    return across.reshape(-1, 3)


def _half_edges(facets: Ints, vertex_count: int) -> tuple[NDArray[np.int32], Mask, Mask]:
    """Half-edges (h,) by edge, direction and facet; where the next edge begins (h + 1,); which run forward (h,).

    Half-edge 3 f + c runs from corner c of facet f to the next; forward is from the lower vertex to the higher.
    """
    narrow = facets.astype(np.int32)  # half the memory to move; a mesh that does not fit would not fit anywhere
    begin, end = narrow.ravel(), np.roll(narrow, -1, axis=1).ravel()
    low, high, forward = np.minimum(begin, end), np.maximum(begin, end), begin < end
    order = _counting_order(2 * high + ~forward, 2 * vertex_count)
    order = order.take(_counting_order(low.take(order), vertex_count))
    low, high = low.take(order), high.take(order)
    first = np.ones(len(order) + 1, dtype=np.bool_)
    first[1:-1] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    return order, first, forward.take(order)


def _counting_order(keys: NDArray[np.int32], key_count: int) -> NDArray[np.int32]:
    """Stable order of integer keys by counting, which is what SciPy's row compression does: no comparison sort."""
    entries = np.arange(len(keys), dtype=np.int32)
    table = coo_array((np.ones(len(keys), dtype=np.int8), (keys, entries)), shape=(key_count, len(keys)))
    order: NDArray[np.int32] = table.tocsr().indices
    return order


def _edge_sizes(facets: Ints, vertex_count: int) -> tuple[Ints, Ints]:
    """Facets at each edge (e,), and how many of them run forward (e,)."""
    _, first, forward = _half_edges(facets, vertex_count)
    begins = np.flatnonzero(first)
    return np.diff(begins), np.diff(np.concatenate([[0], np.cumsum(forward)])[begins])


def _merged(corners: Floats) -> tuple[Floats, Ints]:
    """Different corners (n, 3) in order of appearance, and facets (m, 3) of their indices."""
    order = np.lexsort(corners.T)
    ranked = corners[order]
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = np.any(ranked[1:] != ranked[:-1], axis=1)
    appeared = order[new]
    number = np.empty(len(appeared), dtype=np.int64)
    number[np.argsort(appeared)] = np.arange(len(appeared))
    facets = np.empty(len(order), dtype=np.int64)
    facets[order] = number[np.cumsum(new) - 1]
    return corners[np.sort(appeared)], facets.reshape(-1, 3)


def _without_duplicates(facets: Ints, vertex_count: int) -> tuple[Ints, int]:
    """The first facet of each three vertices, and how many others there were."""
    low, middle, high = np.sort(facets, axis=1).T
    pair = low * vertex_count + middle
    order = np.lexsort((high, pair))
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = (np.diff(pair[order]) != 0) | (np.diff(high[order]) != 0)
    return facets[np.sort(order[new])], int(np.sum(~new))


def _wound(facets: Ints, vertex_count: int) -> tuple[Ints, int]:
    """Facets with a winding that agrees across the edges of two facets, and how many were turned: the fewest.

    Each facet stands twice in a graph, as it is and turned, and agreeing ones are joined; a surface with two sides
    falls into two mirrored parts, of which the one with more facets as they are is taken. One with one side stays.
    """
    order, first, forward = _half_edges(facets, vertex_count)
    two = np.flatnonzero(first[:-2] & ~first[1:-1] & first[2:])
    turned = forward[two] == forward[two + 1]
    if not np.any(turned):
        return facets, 0
    count = len(facets)
    one, other = order[two] // 3, order[two + 1] // 3
    begin = np.concatenate([one, one + count])
    end = np.concatenate([other + count * turned, other + count * ~turned])
    graph = coo_array((np.ones(len(begin), dtype=np.int8), (begin, end)), shape=(2 * count, 2 * count))
    _, labels = csgraph.connected_components(graph, directed=False)
    stays, turns = labels[:count], labels[count:]
    votes = np.bincount(stays, minlength=len(labels))
    flip = (votes[turns] > votes[stays]) | ((votes[turns] == votes[stays]) & (turns < stays))
    return np.where(flip[:, None], facets[:, ::-1], facets), int(np.sum(flip))


def _without_thin(vertices: Floats, facets: Ints) -> tuple[Ints, int, int]:
    """Facets without thin ones, how many of these were dissolved, which leaves no crack, and how many dropped.

    A thin facet A B C has C on its longest edge A B; with the neighbour B A D it becomes C A D and D B C.
    """
    dissolved = 0
    thin = _thin(vertices, facets)
    while np.any(thin):
        where = np.flatnonzero(thin)
        longest = np.argmax(_squared_sides(vertices, facets[where]), axis=0)
        # Each facet takes part in one swap at a time.
        neighbour, chosen = np.unique(neighbours(facets, len(vertices))[where, longest], return_index=True)
        free = (neighbour >= 0) & ~thin[neighbour]
        neighbour, where, longest = neighbour[free], where[chosen][free], longest[chosen][free]
        a, b, c = (facets[where, (longest + corner) % 3] for corner in range(3))
        d = np.sum(facets[neighbour], axis=1) - a - b
        one, other = np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)
        good = ~_thin(vertices, one) & ~_thin(vertices, other)
        if not np.any(good):
            break
        facets = facets.copy()
        facets[where[good]], facets[neighbour[good]] = one[good], other[good]
        thin[where[good]] = False
        dissolved += int(np.sum(good))
    return facets[~thin], dissolved, int(np.sum(thin))


def _thin(vertices: Floats, facets: Ints) -> Mask:
    """Whether each facet (m,) is thinner than the file's numbers resolve, so that its normal is chance."""
    least = RESOLUTION * np.max(np.abs(vertices))
    broad = np.empty(len(facets), dtype=np.bool_)
    for block in blocks(len(facets)):
        longest = np.max(_squared_sides(vertices, facets[block]), axis=0)
        broad[block] = _squares(_spans(vertices, facets[block])) > least**2 * longest
    return ~broad


def _squared_sides(vertices: Floats, facets: Ints) -> Floats:
    """Squared lengths (3, m) of the edges from each corner to the next, in square metres."""
    a, b, c = (vertices[facets[:, corner]] for corner in range(3))
    return np.stack([_squares(b - a), _squares(c - b), _squares(a - c)])


def _spans(vertices: Floats, facets: Ints) -> Floats:
    """Cross products (m, 3) of two edges of each facet: along its normal, twice its area long, in square metres."""
    a, b, c = (vertices[facets[:, corner]] for corner in range(3))
    spans: Floats = np.cross(b - a, c - a)
    return spans


def _squares(vectors: Floats) -> Floats:
    """Squared lengths (m,) of vectors (m, 3)."""
    squares: Floats = np.einsum("ij,ij->i", vectors, vectors)
    return squares


def _triangles(name: str, data: bytes) -> tuple[Floats, int]:
    """Corners (m, 3, 3) in the file's unit, and how many bytes follow the last facet of a binary file."""
    if not data:
        raise _refused(name, "the file is empty")
    count = int.from_bytes(data[HEADER_BYTES : HEADER_BYTES + 4], "little")
    expected = HEADER_BYTES + 4 + count * RECORD.itemsize
    if len(data) != expected and b"\0" not in data[:1024]:
        return _ascii_triangles(name, data), 0
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
    records = np.frombuffer(data, dtype=RECORD, count=count, offset=HEADER_BYTES + 4)
    return records["corners"].astype(np.float64), len(data) - expected


def _ascii_triangles(name: str, data: bytes) -> Floats:
    """Corners (m, 3, 3) in the file's unit."""
    text = data.lower()
    if not text.lstrip().startswith(b"solid"):
        begin = data.strip()[:40].partition(b"\n")[0].decode("ascii", "replace")
        raise _refused(name, f"this is no STL file, it begins with {begin!r}; export the part as STL")
    names = [line.split()[0] for line in NAME_LINE.findall(text)]
    text = NAME_LINE.sub(b"", text)
    words = text.split()
    facets = len(words) // len(FACET_WORDS)
    columns = [words[column :: len(FACET_WORDS)] for column in range(len(FACET_WORDS))]
    in_place = (column.count(word) == facets for word, column in zip(FACET_WORDS, columns, strict=True) if word)
    if len(words) % len(FACET_WORDS) or not all(in_place):
        raise MeshRefused(name, [_ascii_fault(text)])
    if names.count(b"solid") != names.count(b"endsolid"):
        raise _refused(name, "the file ends without endsolid: it is cut short; export it again", len(data.splitlines()))
    if not facets:
        raise _refused(name, "the file holds no facets")
    try:
        numbers = np.array([columns[column] for column in CORNER_COLUMNS]).astype(np.float64)
    except ValueError as error:
        raise MeshRefused(name, [_ascii_fault(text)]) from error
    return numbers.T.reshape(-1, 3, 3)


def _ascii_fault(text: bytes) -> Fault:
    """The first word of an ASCII STL's facets that is out of place."""
    for position, word in enumerate(re.finditer(rb"\S+", text)):
        column = position % len(FACET_WORDS)
        expected, got = FACET_WORDS[column], word.group()
        if expected not in (None, got) or (column in CORNER_COLUMNS and not _is_number(got)):
            wanted = expected.decode() if expected else "a number"
            line = text.count(b"\n", 0, word.start()) + 1
            facet = position // len(FACET_WORDS) + 1
            return Fault(
                line, f"expected {wanted}, got {got.decode('ascii', 'replace')!r} in facet {facet}; export it again"
            )
    facet = len(text.split()) // len(FACET_WORDS) + 1
    return Fault(len(text.splitlines()), f"the file ends inside facet {facet}: it is cut short; export it again")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _refused(name: str, sentence: str, line: int = 0) -> MeshRefused:
    return MeshRefused(name, [Fault(line, sentence)])
